"""A modified field compiled in a process of its own; prints the seconds until its first value."""

from time import perf_counter

import numba  # noqa: F401  (what is timed is our code)
import numpy as np

import bseries as bs

if __name__ == "__main__":
    f = bs.modified_field(bs.method("rk4"), bs.scene("pendulum"), 9)
    out = np.empty(2)
    begin = perf_counter()
    f.compiled(np.array([0.1, 0.2]), 0.01, out)
    print(perf_counter() - begin)
