"""Independent simulator of the three robots with true dry friction: NumPy, SciPy and numba only, nothing from `jaxid`.

It produces the demonstration logs, serves as the yardstick of the tests, and hides effects in logs that `jaxid
explain` has to find. Each model is derived here a second time, from body positions and rolling constraints, and dry
friction really sticks: the integrator locates every stop and every break-away instead of smoothing the sign function.
"""
