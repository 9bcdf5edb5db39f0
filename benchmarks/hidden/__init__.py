"""Logs with something hidden in them, from the independent simulator in `reference/`."""
