"""The omni paper (Conceição, Moreira, Costa 2006)."""
