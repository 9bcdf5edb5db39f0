"""Hidden laws of another simulator: is the mechanism named whoever wrote its law? See `python -m benchmarks.laws --help`."""
