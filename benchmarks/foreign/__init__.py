"""A second, foreign physics engine (MuJoCo) drives the Pioneer; `python -m benchmarks.foreign` explains its logs."""
