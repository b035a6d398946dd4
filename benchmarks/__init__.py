"""Measurements: `python -m benchmarks` prints what everything costs, beside other packages timed in the same run."""
