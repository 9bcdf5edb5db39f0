"""Models with one more effect, refitted."""
