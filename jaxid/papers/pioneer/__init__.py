"""The Pioneer paper (Innocenti et al.)."""
