"""Output error: the parameters whose simulation comes closest to the measurement."""
