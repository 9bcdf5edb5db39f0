"""Where simulation and data disagree: the missing force, and what it follows."""
