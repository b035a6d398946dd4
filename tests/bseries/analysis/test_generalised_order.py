"""Generalised orders of splitting methods, against products of exponentials of matrices as power series in h and ε."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest
import sympy

import bseries as bs
from bseries.analysis import generalised_order

PUBLISHED = {
    "strang": (2,),
    "saba2": (4, 2),
    "saba3": (6, 2),
    "aba864": (8, 6, 4),
    "ruth3": (3,),
    "blanes-moan4": (4,),
    "mclachlan4": (4,),
}
A = mpmath.matrix([[1, 2, 0], [-1, 1, 3], [2, 0, -1]])
B = mpmath.matrix([[0, 1, -1], [2, -1, 1], [1, 3, 1]])


def product(left, right, most):
    """The product of two series {(power of h, power of ε): matrix} up to h^most."""
    total = {}
    for (n, j), x in left.items():
        for (m, k), y in right.items():
            if n + m <= most:
                total[n + m, j + k] = total.get((n + m, j + k), mpmath.zeros(3)) + x * y
    return total


def exponential(field, most):
    """The exponential of a field, a series of the first power of h."""
    total = term = {(0, 0): mpmath.eye(3)}
    for k in range(1, most + 1):
        term = {at: x / k for at, x in product(term, field, most).items()}
        total = {
            at: total.get(at, mpmath.zeros(3)) + term.get(at, mpmath.zeros(3)) for at in total.keys() | term.keys()
        }
    return total


def orders(method, most, small):
    """The powers of h up to which each power of ε agrees with exp(h(A + εB))."""
    fields = {"a": {(1, int(small == "a")): A}, "b": {(1, int(small == "b")): B}}
    step = {(0, 0): mpmath.eye(3)}
    for part, time in method.flows:
        number = mpmath.mpmathify(str(sympy.N(sympy.sympify(time), 40)))
        scaled = {at: x * number for at, x in fields[part].items()}
        step = product(exponential(scaled, most), step, most)
    exact = exponential(fields["a"] | fields["b"], most)
    reached = [most] * (most + 1)
    for n, j in exact:
        if mpmath.mnorm(step[n, j] - exact[n, j]) > mpmath.mpf(10) ** -12:
            reached[j] = min(reached[j], n - 1)
    return reached


@pytest.mark.parametrize("name", PUBLISHED)
def test_generalised_orders_are_those_published_and_those_of_matrices(name):
    method = bs.method(name)
    found = generalised_order(method)
    assert found == PUBLISHED[name]
    assert found[-1] == bs.order_of(method)
    with mpmath.workdps(40):
        reached = orders(method, max(found) + 1, "b")
    assert [min(reached[1 : j + 2]) for j in range(len(found))] == list(found)


def test_the_other_part_may_be_the_small_one():
    method = bs.Splitting([("b" if part == "a" else "a", time) for part, time in bs.method("saba3").flows])
    assert (generalised_order(method, "a"), generalised_order(method)) == ((6, 2), (2,))
    with mpmath.workdps(40):
        assert orders(method, 7, "a")[1:3] == [6, 2]


def test_a_changed_time_lowers_it():
    flows = list(bs.method("aba864").flows)
    for at, sign in ((0, 1), (2, -1), (12, -1), (14, 1)):  # still symmetric and consistent
        flows[at] = (flows[at][0], flows[at][1] + sign * Fraction(1, 10**6))
    assert generalised_order(bs.Splitting(flows, digits=30)) == (2,)


def test_the_report_has_it_where_it_is_larger():
    report = bs.check("aba864")
    assert report.generalised == {"b": (8, 6, 4)}
    assert report.to_dict()["generalised_orders"] == {"b": [8, 6, 4]}
    assert "generalised order for small b  (8, 6, 4)" in str(report)
    assert not bs.check("strang").generalised
    assert not bs.check("rk4").generalised


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("rk4",), "method must be a product of the flows of two parts, but rk4 is not"),
        (("takahashi-imada",), "method must be a product of the flows of two parts"),
        (("strang", "c"), "perturbation must be one of a, b, but was 'c'"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(bs.SeriesError, match=message):
        generalised_order(*arguments)
