"""Find where simulation and data disagree, name the missing effect, add it, and show the gap shrink."""
