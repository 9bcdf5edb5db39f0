"""Random cases for `benchmarks.silent`: robots, logs, and how a result is judged."""
