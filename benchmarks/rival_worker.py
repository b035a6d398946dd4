"""Runs in the virtual environment of the other packages, and knows nothing of this one.

`python rival_worker.py PACKAGE TASK ORDER` prints, as JSON, the seconds that the package took from nothing, and the
answer: the sum of all coefficients, or the order up to which a property holds. The method, if the task names no other,
is the explicit midpoint rule; compositions go on with rk4, substitutions put the midpoint rule's modified equation into
rk4's series.
"""
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

import collections
import collections.abc
import json
import sys
from fractions import Fraction
from time import perf_counter


def pybs(task):
    """The task as a function of the order, done by pybs."""
    # pybs was written for Python versions that had these names here.
    collections.Hashable = collections.abc.Hashable
    collections.Mapping = collections.abc.Mapping
    from pybs.rungekutta.methods import RK4, RKimplicitMidpoint, RKmidpoint
    from pybs.series import AVF, checks, composition, modified_equation
    from pybs.unordered_tree import trees_of_order

    def total(rule, order):
        return sum(rule(tree) for n in range(1, order + 1) for tree in trees_of_order(n))

    return {
        "modified equation": lambda n: total(modified_equation(RKmidpoint.phi()), n),
        "composition": lambda n: total(composition(RKmidpoint.phi(), RK4.phi()), n),
        "symplecticity": lambda n: checks.symplectic_up_to_order(RKimplicitMidpoint.phi(), n),
        "energy preservation": lambda n: checks.energy_preserving_upto_order(modified_equation(AVF), n),
    }[task]


def kauri(task):
    """The task as a function of the order, done by kauri."""
    import kauri

    def total(rule, order):
        return sum(rule(tree) for n in range(1, order + 1) for tree in kauri.trees_of_order(n))

    midpoint, rk4 = (method.elementary_weights_map() for method in (kauri.midpoint, kauri.rk4))
    return {
        "modified equation": lambda n: total(midpoint.modified_equation(), n),
        "modifying integrator": lambda n: total(midpoint.preprocessed_integrator(), n),
        "composition": lambda n: total(midpoint * rk4, n),
        "substitution": lambda n: total(midpoint.modified_equation() ^ rk4, n),
    }[task]


def nodepy(task):
    """The task as a function of the order, done by nodepy; the conditions it has written out reach order 13."""
    from nodepy import rk

    midpoint, gauss3 = rk.loadRKM("Mid22"), rk.loadRKM("GL3")
    return {
        "error coefficients": lambda n: sum(midpoint.error_coeffs(n)),
        "order conditions of gauss3": lambda n: min(gauss3.order(), n),
    }[task]


if __name__ == "__main__":
    package, task, order = sys.argv[1], sys.argv[2], int(sys.argv[3])
    work = {"pybs": pybs, "kauri": kauri, "nodepy": nodepy}[package](task)
    start = perf_counter()
    answer = work(order)
    seconds = perf_counter() - start
    print(json.dumps({"seconds": seconds, "sum": str(Fraction(str(answer)))}))
