"""The modified equation of the explicit midpoint rule in a process of its own; prints the peak memory in bytes."""

import sys

import bseries as bs

from .cases import FLOAT_MIDPOINT
from .timing import peak_memory

if __name__ == "__main__":
    domain, order = sys.argv[1:]
    method = bs.method("explicit-midpoint") if domain == "exact" else bs.RungeKutta(*FLOAT_MIDPOINT)
    bs.modified_equation(method, int(order))
    print(peak_memory())
