"""Estimators: `linear` (the papers' linear methods), `output_error`, and what gives their numbers `confidence`."""
