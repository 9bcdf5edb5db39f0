"""The same output-error problem as jaxid, SciPy and plain optimistix each see it."""
