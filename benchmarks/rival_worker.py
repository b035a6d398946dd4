"""Runs in the virtual environment of the other packages, and knows nothing of this one.

`python rival_worker.py PACKAGE ORDER` prints, as JSON, the seconds that the package took for the modified equation of
the explicit midpoint rule from nothing, the number of trees, and the sum of all coefficients.
"""
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

import collections
import collections.abc
import json
import sys
from fractions import Fraction
from time import perf_counter


def pybs(order):
    """Exact coefficients by pybs."""
    # pybs was written for Python versions that had these names here.
    collections.Hashable = collections.abc.Hashable
    collections.Mapping = collections.abc.Mapping
    from pybs.rungekutta.methods import RKmidpoint
    from pybs.series import modified_equation
    from pybs.unordered_tree import trees_of_order

    start = perf_counter()
    b = modified_equation(RKmidpoint.phi())
    values = [b(tree) for n in range(1, order + 1) for tree in trees_of_order(n)]
    return perf_counter() - start, values


def kauri(order):
    """Floating-point coefficients by kauri."""
    import kauri

    start = perf_counter()
    b = kauri.midpoint.modified_equation_map()
    values = [b(tree) for n in range(1, order + 1) for tree in kauri.trees_of_order(n)]
    return perf_counter() - start, values


if __name__ == "__main__":
    package, order = sys.argv[1], int(sys.argv[2])
    seconds, values = {"pybs": pybs, "kauri": kauri}[package](order)
    print(json.dumps({"seconds": seconds, "trees": len(values), "sum": str(Fraction(sum(values)))}))
