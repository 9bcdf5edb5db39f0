"""The first look: what every candidate promises, before any is refitted."""
