"""Coefficients in floats against exact ones: what rounding costs, and how much of it summing carefully wins back.

An error is counted in roundings, 2⁻⁵³, of the terms that are added: of the sum of their absolute values, computed like
the coefficient itself, with all entries and terms made positive. Beside it stand units in the last place (ulp): of the
coefficient (the median over all trees of an order), and of the largest coefficient with so many nodes (the worst tree).
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numba  # noqa: F401
import numpy as np
import pytest

import bseries as bs
from bseries.algebra.stages import stages_of
from bseries.exact import recursions
from bseries.exact.arithmetic import Exact, Float, floats

pytestmark = pytest.mark.slow

METHODS = [
    "implicit-euler", "explicit-midpoint", "implicit-midpoint", "heun3", "rk4", "ssprk33", "rkf45",
    "dormand-prince54", "gauss2", "gauss3", "lobatto-iiia3", "radau-iia3",
]  # fmt: skip
ORDER, OF_SUBSTITUTION = 15, 11
"""The largest odd orders within seconds (141,083 and 3,047 trees); at even ones symmetric methods have zeros."""
ROUNDING = 2.0**-53
OF_TERMS = " roundings of the terms"
LIMIT = 64
"""A term is a product of an entry for each of 15 nodes; each entry is rounded, so is each product, and sums of some."""


def runge_kutta(name: str) -> bs.RungeKutta:
    method = bs.method(name)
    assert isinstance(method, bs.RungeKutta)
    return method


def rounded(s: bs.BSeries) -> np.ndarray:
    """The coefficients, rounded once; read off integers, since 10^5 Fractions take a second."""
    values = s.stored
    if values.kind == "float":
        return np.array(values.coefficients())
    orders = s.table.order.tolist()
    return np.array([int(x) / values.denominators[n] for x, n in zip(values.raw, orders, strict=True)])


# What the terms of a coefficient add up to before they cancel


def positive(method: bs.RungeKutta) -> bs.RungeKutta:
    """The method with |A| and |b|: weights of its trees are sums of the absolute values of terms."""
    floating = method.to_float()
    return bs.RungeKutta([[abs(x) for x in row] for row in floating.A], [abs(x) for x in floating.b], warn=False)


def terms_of_series(method: bs.RungeKutta, exact: bs.BSeries) -> np.ndarray:
    return rounded(bs.series(positive(method), exact.table.max_order))


def terms_of_log(weights: np.ndarray, b: np.ndarray, table: Any) -> np.ndarray:
    """Of b = a − Σ_{j≥2} ∂_b^(j−1) b / j!: with |b| in place of b, all summands but a are those of exp |b|."""
    return abs(weights) + recursions.lie_series(abs(b), None, 1.0, table, floats())


def terms_of_modified_equation(method: bs.RungeKutta, exact: bs.BSeries) -> np.ndarray:
    return terms_of_log(terms_of_series(method, exact), rounded(exact), exact.table)


def terms_of_modifying_integrator(method: bs.RungeKutta, exact: bs.BSeries) -> np.ndarray:
    """|b| ★ |a|, stage by stage."""
    stages = stages_of(positive(method), exact.table.max_order).stages
    return recursions.into_stages(stages, exact.table, floats(), field=abs(rounded(exact)))


class Errors:
    """Errors of floats against exact values, at the trees of one order."""

    def __init__(self, found: np.ndarray, exact: np.ndarray, terms: np.ndarray, orders: np.ndarray, order: int):
        here = orders == order
        error, size, added = np.abs(found - exact)[here], np.abs(exact[here]), terms[here]
        assert not error[added == 0].any()  # nothing is added
        self.roundings = float((error[added > 0] / added[added > 0]).max() / ROUNDING)
        self.median = float(np.median(error[size > 0] / np.spacing(size[size > 0])))
        self.largest = float(error.max() / np.spacing(size.max()))

    def __str__(self) -> str:
        return f"median {self.median:.3g} ulp, worst {self.largest:.3g} ulp of the largest"


def errors(kind: Callable[..., bs.BSeries], terms: Any, name: str, order: int, change: float = 0.0) -> Errors:
    """What the float tableau (with its first weight changed) makes of the series, against the exact tableau."""
    method = runge_kutta(name)
    exact, tableau = kind(method, order), method.to_float()
    b = [tableau.b[0] * (1 + change), *tableau.b[1:]]
    found = kind(bs.RungeKutta(tableau.A, b, tableau.c, warn=False), order)
    return Errors(rounded(found), rounded(exact), terms(method, exact), exact.table.order, order)


KINDS = [
    (bs.series, terms_of_series, ORDER),
    (bs.modified_equation, terms_of_modified_equation, ORDER),
    (bs.modifying_integrator, terms_of_modifying_integrator, OF_SUBSTITUTION),
]


@pytest.mark.parametrize(("kind", "terms", "order"), KINDS, ids=["series", "log", "modifying"])
@pytest.mark.parametrize("name", METHODS)
def test_float_coefficients_against_exact_ones(name, kind, terms, order, measured):
    found = errors(kind, terms, name, order)
    what = kind.__name__.replace("_", " ")
    measured.within(f"{what} of {name}, order {order}", found.roundings, LIMIT, OF_TERMS, note=str(found))


@pytest.mark.parametrize(("kind", "terms", "order"), KINDS, ids=["series", "log", "modifying"])
def test_thirteen_digits_would_be_noticed(kind, terms, order):
    assert errors(kind, terms, "gauss2", 9, 1e-13).roundings > LIMIT


# Where digits go: rounded weights, and rounded sums


class Plain(Float):
    """Floats whose sums are not compensated."""

    factors = Exact.factors


class RoundedWeights:
    """The rounded weights of a method, the log of its weights, and the log of the rounded ones, both rounded once."""

    def __init__(self, name: str, order: int):
        series = bs.series(bs.method(name), order)
        self.table, self.order, self.weights = series.table, order, rounded(series)
        kept = dict(zip(series.table, map(Fraction, self.weights.tolist()), strict=True))
        self.of_exact = rounded(bs.modified_equation(series))
        self.exact = rounded(bs.modified_equation(bs.BSeries.from_rule(kept.__getitem__, order)))
        self.terms = terms_of_log(self.weights, self.exact, self.table)

    def log(self, arithmetic: Float) -> Errors:
        """The errors of the log of the rounded weights."""
        return self.errors(recursions.logarithm(self.weights, self.table, arithmetic), self.exact)

    def errors(self, found: np.ndarray, exact: np.ndarray) -> Errors:
        return Errors(found, exact, self.terms, self.table.order, self.order)


def test_log_takes_most_of_the_weights_away(measured):
    given = RoundedWeights("gauss3", 9)
    left = np.median(abs(given.exact / given.weights)[given.table.order == 9])
    measured.within("log of gauss3 to order 9: what is left of the weights, in the median", left, 0.02)


LOG_LIMIT = 2
"""One rounding of the result, and what errors of smaller trees, as large, bring."""


@pytest.mark.parametrize("name", ["rk4", "gauss3", "radau-iia3", "implicit-euler", "rkf45"])
def test_cancellation_in_log(name, measured):
    """log loses what it must, since rounding the weights already changes it so much, and little more."""
    given = RoundedWeights(name, 9)
    lost, own, plain = given.errors(given.exact, given.of_exact), given.log(floats()), given.log(Plain())
    case = f"log of {name} to order 9"
    measured.said(
        f"{case}: what rounding its weights changes", "lost in any case", f"{lost.roundings:.2g}{OF_TERMS}; {lost}"
    )
    measured.within(f"{case}, computed in floats", own.roundings, LOG_LIMIT, OF_TERMS, note=str(own))
    measured.at_least(
        f"{case}, sums not compensated", plain.roundings, LOG_LIMIT, OF_TERMS, what="control:", note=str(plain)
    )


@pytest.mark.parametrize("name", ["implicit-euler", "rk4", "implicit-midpoint"])
def test_cancellation_in_substitution(name, measured):
    """The modifying integrator: the field b for which the method follows the exact flow."""
    method, order = runge_kutta(name), OF_SUBSTITUTION
    exact = bs.modifying_integrator(method, order)
    terms = terms_of_modifying_integrator(method, exact)
    flow, stages = rounded(bs.exact_flow(order)), stages_of(method.to_float(), order).stages

    def found(arithmetic: Float) -> Errors:
        field = recursions.into_stages(stages, exact.table, arithmetic, target=flow, inverses=[1.0])
        return Errors(field, rounded(exact), terms, exact.table.order, order)

    careful, plain = found(floats()), found(Plain())
    measured.at_least(
        f"modifying integrator of {name} to order {order}: errors where sums are not compensated",
        plain.roundings / careful.roundings, 2, " times those where they are", form=".1f",
        note=f"{plain.roundings:.2g} against {careful.roundings:.2g}{OF_TERMS}",
    )  # fmt: skip


def test_substitution_into_a_series(measured):
    """b ★ a over partitions: nothing but products and one sum for each tree."""
    a, b = bs.series(bs.method("gauss3"), 9), bs.modified_equation(bs.method("rk4"), 9)
    exact, found = bs.substitute(b, a), bs.substitute(b.to_float(), a.to_float())
    absolute = [dict(zip(x.table, abs(rounded(x)).tolist(), strict=True)).__getitem__ for x in (b, a)]
    terms = rounded(bs.substitute(*(bs.BSeries.from_rule(x, 9, empty=k) for k, x in enumerate(absolute))))
    error = Errors(rounded(found), rounded(exact), terms, exact.table.order, 9)
    measured.within(
        "rk4's modified equation substituted into gauss3, order 9", error.roundings, 16, OF_TERMS, note=str(error)
    )
    swapped = bs.substitute(bs.modified_equation(bs.method("heun3"), 9).to_float(), a.to_float())
    assert Errors(rounded(swapped), rounded(exact), terms, exact.table.order, 9).roundings > 1e10


@pytest.mark.parametrize("name", ["rk4", "gauss3", "dormand-prince54"])
def test_zeros_of_the_modified_equation(name, measured):
    """Up to the method's order log vanishes; in floats it is small, but not zero."""
    method = runge_kutta(name)
    order = bs.order_of(method)
    exact, found = (bs.modified_equation(x, order) for x in (method, method.to_float()))
    zeros = exact.table.order > 1
    assert zeros.any()
    assert not rounded(exact)[zeros].any()
    sizes = terms_of_modified_equation(method, exact)
    worst = float((abs(rounded(found)) / sizes)[zeros].max() / ROUNDING)
    measured.within(f"zeros of the modified equation of {name} up to its order", worst, 16, OF_TERMS)
    beyond = bs.modified_equation(method, order + 1)
    assert max(map(abs, beyond.values())) > 1e-4  # the next order does not vanish: the test can fail


@pytest.mark.parametrize("name", ["dormand-prince54", "gauss3", "dop853"])
def test_exact_coefficients_are_rounded_once(name, measured):
    """to_float of an exact series: every coefficient within half an ulp, as an exact comparison says."""
    exact = bs.modified_equation(bs.method(name), 9)
    found = exact.to_float()
    ulps = max(
        float(abs(Fraction(found[tree]) - x) / Fraction(np.spacing(abs(found[tree])))) for tree, x in exact.items()
    )
    measured.within(f"exact modified equation of {name} to order 9, then floats", ulps, 0.5, " ulp", form=".6f")
    assert any(x.numerator / x.denominator != float(x.numerator) / float(x.denominator) for x in exact.values()) == (
        name == "dop853"
    )  # numerators and denominators of its coefficients are no floats: rounding each first is noticed
