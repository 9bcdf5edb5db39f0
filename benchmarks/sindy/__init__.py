"""PySINDy on the blind study's logs: residual acceleration regressed on a library of functions of states and inputs."""
