"""A modified equation in a process of its own; prints the peak memory in bytes.

The method is a name of the catalogue, or `exact` or `float` for the explicit midpoint rule in these numbers.
"""

import sys

import bseries as bs

from .cases import FLOAT_MIDPOINT
from .timing import peak_memory

if __name__ == "__main__":
    name, order = sys.argv[1:]
    if name == "float":
        method = bs.RungeKutta(*FLOAT_MIDPOINT)
    else:
        method = bs.method("explicit-midpoint" if name == "exact" else name)
    bs.modified_equation(method, int(order))
    print(peak_memory())
