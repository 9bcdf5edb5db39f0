"""What standard errors of the final fit have to allow for: the form of laws, curves that share a line, names left open."""
