"""Broken input, made on purpose, and the judge of what jaxid makes of it: shared by `benchmarks/fuzz.py` and the tests."""
