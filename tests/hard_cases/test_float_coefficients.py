"""Coefficients in floats against exact ones: what rounding costs, and how much of it summing carefully wins back.

An error is counted in units in the last place (ulp): of the coefficient itself (the median over all trees of an order),
and of the largest coefficient with so many nodes (the worst tree: small coefficients lose more of their own digits).
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numba  # noqa: F401
import numpy as np
import pytest

import bseries as bs
from bseries import recursions, substitution_recursions
from bseries.arithmetic import Exact, Float, floats
from bseries.coefficients import stages_of

METHODS = [
    "implicit-euler", "explicit-midpoint", "implicit-midpoint", "heun3", "rk4", "ssprk33", "rkf45",
    "dormand-prince54", "gauss2", "gauss3", "lobatto-iiia3", "radau-iia3",
]  # fmt: skip
ORDER, OF_SUBSTITUTION = 15, 11
"""The largest odd orders within seconds (141,083 and 3,047 trees); at even ones symmetric methods have zeros."""


def rounded(s: bs.BSeries) -> np.ndarray:
    """The coefficients, rounded once; read off integers, since 10^5 Fractions take a second."""
    values = s._values
    if values.kind == "float":
        return np.array(values.public())
    orders = s.table.order.tolist()
    return np.array([int(x) / values.denominators[n] for x, n in zip(values.numerators, orders, strict=True)])


class Errors:
    """Errors of floats against exact values, at the trees of one order."""

    def __init__(self, found: np.ndarray, exact: np.ndarray, orders: np.ndarray, order: int):
        here = orders == order
        error, size = np.abs(found - exact)[here], np.abs(exact[here])
        self.median = float(np.median(error[size > 0] / np.spacing(size[size > 0])))
        self.largest = float(error.max() / np.spacing(size.max()))

    def __str__(self) -> str:
        return f"median {self.median:.3g} ulp, worst {self.largest:.3g} ulp of the largest"


def errors(kind: Callable[..., bs.BSeries], name: str, order: int, change: float = 0.0) -> Errors:
    """What the float tableau (with its first weight changed) makes of the series, against the exact tableau."""
    method = bs.method(name)
    exact, tableau = kind(method, order), method.to_float()
    b = [tableau.b[0] * (1 + change), *tableau.b[1:]]
    found = kind(bs.RungeKutta(tableau.A, b, tableau.c, warn=False), order)
    return Errors(rounded(found), rounded(exact), exact.table.order, order)


PROMISES = [
    (bs.series, ORDER, 200),
    (bs.modified_equation, ORDER, 5000),
    (bs.modifying_integrator, OF_SUBSTITUTION, 20000),
]


@pytest.mark.parametrize(("kind", "order", "limit"), PROMISES, ids=["series", "log", "modifying"])
@pytest.mark.parametrize("name", METHODS)
def test_float_coefficients_against_exact_ones(name, kind, order, limit, measured):
    found = errors(kind, name, order)
    what = kind.__name__.replace("_", " ")
    measured(f"{what} of {name}, order {order}", f"≤ {limit} ulp of the largest", str(found))
    assert found.largest <= limit


@pytest.mark.parametrize(("kind", "order", "limit"), PROMISES, ids=["series", "log", "modifying"])
def test_ten_digits_would_be_noticed(kind, order, limit):
    assert errors(kind, "gauss2", 9, 1e-10).largest > limit


def log_of_weights(name: str, order: int) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray]:
    """The rounded weights of a method, the log of its weights, and the log of the rounded ones, both rounded once."""
    exact = bs.series(bs.method(name), order)
    weights = rounded(exact)
    kept = dict(zip(exact.table, map(Fraction, weights.tolist()), strict=True))
    return (
        exact.table,
        weights,
        rounded(bs.modified_equation(exact)),
        rounded(bs.modified_equation(bs.BSeries.from_rule(kept.__getitem__, order))),
    )


class Plain(Float):
    """Floats whose sums are not compensated."""

    factors = Exact.factors


@pytest.mark.parametrize("name", ["rk4", "gauss3", "radau-iia3", "implicit-euler", "rkf45"])
def test_cancellation_in_log(name, measured):
    """log loses what it must, since rounding the weights already changes it so much, and little more."""
    table, weights, exact, of_rounded = log_of_weights(name, 9)
    given = Errors(of_rounded, exact, table.order, 9)
    own = Errors(recursions.logarithm(weights, table, floats()), of_rounded, table.order, 9)
    measured(f"log of {name} to order 9, from weights rounded to floats", "lost in any case", str(given))
    measured("the same, lost by computing in floats", "≤ 100 ulp of the largest", str(own))
    assert own.largest <= 100
    assert own.median <= max(given.median, 50)


@pytest.mark.parametrize(("name", "gain"), [("rk4", 2), ("gauss3", 100), ("implicit-euler", 2)])
def test_cancellation_in_log_without_compensation(name, gain, measured):
    table, weights, _, exact = log_of_weights(name, 9)
    careful, plain = (
        Errors(recursions.logarithm(weights, table, arithmetic), exact, table.order, 9)
        for arithmetic in (floats(), Plain())
    )
    measured(f"log of {name} to order 9, sums not compensated", f"control: ≥ {gain} times the median", str(plain))
    assert plain.median >= gain * careful.median


@pytest.mark.parametrize(("name", "gain"), [("implicit-euler", 3), ("explicit-midpoint", 1)])
def test_cancellation_in_substitution_without_compensation(name, gain, measured):
    """The modifying integrator: the field b for which the method follows the exact flow."""
    method, order = bs.method(name), OF_SUBSTITUTION
    exact = bs.modifying_integrator(method, order)
    flow, stages = rounded(bs.exact_flow(order)), stages_of(method.to_float(), order).stages
    careful, plain = (
        Errors(
            substitution_recursions.into_stages(stages, exact.table, arithmetic, target=flow, inverses=[1.0]),
            rounded(exact), exact.table.order, order,
        )
        for arithmetic in (floats(), Plain())
    )  # fmt: skip
    case = f"modifying integrator of {name} to order {order}"
    measured(case, "error in floats", str(careful))
    measured(f"{case}, sums not compensated", f"control: ≥ {gain} times the median", str(plain))
    assert plain.median >= gain * careful.median


def test_substitution_into_a_series(measured):
    """b ★ a over partitions: nothing but products and one sum for each tree."""
    a, b = bs.series(bs.method("gauss3"), 9), bs.modified_equation(bs.method("rk4"), 9)
    exact, found = bs.substitute(b, a), bs.substitute(b.to_float(), a.to_float())
    error = Errors(rounded(found), rounded(exact), exact.table.order, 9)
    measured("rk4's modified equation substituted into gauss3, order 9", "≤ 100 ulp of the largest", str(error))
    assert error.largest <= 100
    swapped = bs.substitute(bs.modified_equation(bs.method("heun3"), 9).to_float(), a.to_float())
    assert Errors(rounded(swapped), rounded(exact), exact.table.order, 9).largest > 1e10


@pytest.mark.parametrize("name", ["rk4", "gauss3", "dormand-prince54"])
def test_zeros_of_the_modified_equation(name, measured):
    """Up to the method's order log vanishes; in floats it is small, but not zero."""
    method = bs.method(name)
    exact, found = (bs.modified_equation(x, bs.order_of(method)) for x in (method, method.to_float()))
    zeros = [tree for tree in exact if tree.order > 1]
    assert zeros
    assert not any(exact[tree] for tree in zeros)
    largest = max(abs(found[tree]) for tree in zeros) / 2.0**-52
    measured(f"zeros of the modified equation of {name} up to its order", "≤ 16 · 2⁻⁵²", largest, "{:.2g} · 2⁻⁵²")
    assert largest <= 16
    beyond = bs.modified_equation(method, bs.order_of(method) + 1)
    assert max(map(abs, beyond.values())) > 1e-4  # the next order does not vanish: the test can fail


@pytest.mark.parametrize("name", ["dormand-prince54", "gauss3", "dop853"])
def test_exact_coefficients_are_rounded_once(name, measured):
    """to_float of an exact series: every coefficient within half an ulp, as an exact comparison says."""
    exact = bs.modified_equation(bs.method(name), 9)
    found = exact.to_float()
    ulps = max(
        float(abs(Fraction(found[tree]) - x) / Fraction(np.spacing(abs(found[tree])))) for tree, x in exact.items()
    )
    measured(f"exact modified equation of {name} to order 9, then floats", "≤ 0.5 ulp", ulps, "{:.6f} ulp")
    assert ulps <= 0.5
    assert any(x.numerator / x.denominator != float(x.numerator) / float(x.denominator) for x in exact.values()) == (
        name == "dop853"
    )  # numerators and denominators of its coefficients are no floats: rounding each first is noticed
