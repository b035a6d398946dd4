"""Tableaux with entries of all sizes, families with many stages, and reducible ones: exact results stay exact.

Oracles: the definitions of `series_oracles` (sums over stages, cuts, partitions) in Fractions, and for the families the
nodes and matrices in 60 digits, from the conditions that define them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cache
from itertools import chain, pairwise
from typing import Any

import mpmath
import numpy as np
import pytest
import series_oracles as oracle  # pyright: ignore[reportMissingImports]

import bseries as bs

pytestmark = pytest.mark.slow

F = Fraction
HUGE, BIG = 10**300, F(10**12, 7)
TREES = list(bs.TreeTable(5))


def collocation(first: Fraction, second: Fraction) -> tuple[list[list[Fraction]], list[Fraction]]:
    """A and b from integrals of Lagrange polynomials: as the nodes meet, the entries grow like 1/gap."""

    def row(x: Fraction) -> list[Fraction]:
        return [(x * x / 2 - second * x) / (first - second), (x * x / 2 - first * x) / (second - first)]

    return [row(first), row(second)], row(F(1))


HARD = {
    "entries of 10^300 and 10^−300": ([[0, 0], [HUGE, F(1, HUGE)]], [F(1, HUGE), 1 - F(1, HUGE)]),
    "tiny entries": ([[0, 0], [F(1, 10**200), 0]], [F(1, 10**250), 1]),
    "coprime denominators": (
        [[F(1, 1000003), F(2, 1000033)], [F(-5, 1000037), F(7, 1000039)]],
        [F(3, 999983), F(1, 2)],
    ),
    "denominators of 200 digits": ([[0, 0], [F(1, 7**236), 0]], [F(1, 3**419), F(1, 5**286)]),
    "large entries that cancel": (
        [[0, 0, 0], [BIG, -BIG, 0], [BIG, 1 - BIG / 3, -2 * BIG / 3]],
        [BIG / 3, F(2, 3) - BIG / 3, F(1, 3)],
    ),
    "negative entries": ([[F(-1, 2), F(-1, 3)], [-4, F(-2, 7)]], [-3, F(-1, 9)]),
    "stages that differ by 10^−40": ([[F(1, 2), 0], [F(1, 2), F(1, 10**40)]], [1 - 10**40, 10**40]),
    "collocation at nodes 10^−6 apart": collocation(F(1, 3), F(1, 3) + F(1, 10**6)),
    "collocation at nodes 10^−30 apart": collocation(F(1, 3), F(1, 3) + F(1, 10**30)),
}


def runge_kutta(name: str) -> bs.RungeKutta:
    method = bs.method(name)
    assert isinstance(method, bs.RungeKutta)
    return method


def hard(name: str) -> bs.RungeKutta:
    A, b = HARD[name]
    return bs.RungeKutta(A, b, name=name, warn=False)


def logarithm(a: Mapping[Any, Any], trees: Iterable[bs.Tree]) -> dict[Any, Fraction]:
    """b with exp b = a from b(τ) = a(τ) − Σ_{j≥2} (∂_b^(j−1) b)(τ) / j!, every derivative by cutting edges."""
    derivatives: list[dict[Any, Fraction]] = [{"∅": F(0)} for _ in range(6)]
    b = derivatives[0]
    for tree in trees:
        b[tree] = F(0)  # the empty tree's part, which is multiplied by 0
        for lower, higher in pairwise(derivatives):
            higher[tree] = oracle.derived(b, lower, tree) if tree.order > 1 else F(0)
        b[tree] = a[tree] - sum(d[tree] / math.factorial(j) for j, d in enumerate(derivatives[1:], 2))
    return b


def sizes(method: bs.RungeKutta, tree: bs.Tree) -> Fraction:
    """The weight of a tree with all entries made positive: what its terms add up to before they cancel."""
    return oracle.weight([([[abs(x) for x in row] for row in method.A], [abs(x) for x in method.b])], tree)


@pytest.mark.parametrize("name", HARD)
def test_hard_entries_stay_exact(name, measured):
    method = hard(name)
    a, b = bs.series(method, 5), bs.modified_equation(method, 5)
    expected = logarithm(a, TREES)
    digits = max(len(str(abs(x.numerator))) + len(str(x.denominator)) for x in b.values() if x)
    for tree in TREES:
        assert a[tree] == oracle.weight([(method.A, method.b)], tree)
        assert b[tree] == expected[tree]
    field = bs.modifying_integrator(method, 5)
    assert all(oracle.substituted(field, a, tree) == F(1, tree.density) for tree in TREES)
    assert bs.order_of(method) == next(t.order for t in TREES if a[t] != F(1, t.density)) - 1
    measured.said(f"{name}: series, log, modifying integrator", "exact", f"exact, up to {digits} digits")
    one_more = bs.RungeKutta(method.A, [method.b[0] + F(1, HUGE**3), *method.b[1:]], warn=False)
    assert bs.series(one_more, 1) != bs.series(method, 1)  # nothing is rounded


HUGE_ENTRIES, *IN_RANGE = HARD


@pytest.mark.parametrize("name", IN_RANGE)
def test_floats_lose_what_cancels_and_no_more(name, measured):
    """The error of a float weight is a few roundings of the terms it adds, and not of the weight that is left."""
    method = hard(name)
    exact, found = bs.series(method, 5), bs.series(method.to_float(), 5)
    error = {tree: abs(F(found[tree]) - x) for tree, x in exact.items()}
    units = max(float(e / (sizes(method, tree) + F(SMALLEST))) for tree, e in error.items()) * 2**53
    measured.within(f"{name}: float series to order 5", units, 16, " roundings of the terms")
    lost = max(float(e / abs(exact[tree])) for tree, e in error.items() if abs(exact[tree]) > SMALLEST) * 2**53
    assert (lost > 1e6) == (name in CANCELLING)  # control: seen from the coefficient itself, most digits are gone


CANCELLING = [name for name in HARD if any(word in name for word in ("cancel", "differ", "apart"))]
SMALLEST = 2.0**-1022


def test_what_floats_cannot_hold_is_refused():
    method = hard(HUGE_ENTRIES)
    with pytest.raises(bs.SeriesError, match="coefficients must stay within the range of floats, but some overflowed"):
        bs.series(method.to_float(), 5)
    with pytest.raises(bs.SeriesError, match=r"coefficient must stay within the range of floats, but was 9{30}…"):
        bs.series(method, 5).to_float()


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (math.nan, r"A\[1\]\[1\] must be a finite number, but was nan"),
        (-math.inf, r"A\[1\]\[1\] must be a finite number, but was -inf"),
        (F(1, 10**5000), r"A\[1\]\[1\] must be of reasonable size, but has a number of more than 4000 digits"),
    ],
)
def test_entries_that_are_refused(entry, message):
    with pytest.raises(bs.errors, match=message):
        bs.RungeKutta([[entry]], [1], warn=False)
    assert bs.series(bs.RungeKutta([[F(1, 10**3000)]], [1], warn=False), 2)["[τ]"] == F(1, 10**3000)


# Families: nodes from Legendre polynomials, matrices from C(s), D(s), or b₁ in the first column and C(s − 1).

FAMILIES = {"gauss": 0, "lobatto-iiia": -2, "lobatto-iiib": -2, "lobatto-iiic": -2}


@cache
def tableau(family: str, s: int) -> tuple[list[list[Any]], list[Any]]:
    """A and b in 60 digits."""
    x = mpmath.taylor(lambda t: mpmath.legendre(s if family == "gauss" else s - 1, 2 * t - 1), 0, s)[::-1]
    while not x[0]:
        x = x[1:]
    if family == "gauss":
        nodes = mpmath.polyroots(x, maxsteps=100, extraprec=60)
    else:
        slope = [(len(x) - 1 - k) * value for k, value in enumerate(x[:-1])]
        inner = mpmath.polyroots(slope, maxsteps=100, extraprec=60) if s > 2 else []
        nodes = [mpmath.mpf(0), *inner, mpmath.mpf(1)]
    c = sorted(mpmath.re(node) for node in nodes)
    powers = mpmath.matrix([[node**k for node in c] for k in range(s)])
    b = list(mpmath.lu_solve(powers, mpmath.matrix([mpmath.mpf(1) / (k + 1) for k in range(s)])))
    if family == "lobatto-iiib":
        scaled = mpmath.matrix([[b[i] * c[i] ** k for i in range(s)] for k in range(s)])
        columns = [
            mpmath.lu_solve(scaled, mpmath.matrix([b[j] * (1 - c[j] ** (k + 1)) / (k + 1) for k in range(s)]))
            for j in range(s)
        ]
        return [[columns[j][i] for j in range(s)] for i in range(s)], b
    if family == "lobatto-iiic":
        first = powers[: s - 1, 1:]
        rows = [
            mpmath.lu_solve(first, mpmath.matrix([c[i] ** (k + 1) / (k + 1) - b[0] * c[0] ** k for k in range(s - 1)]))
            for i in range(s)
        ]
        return [[b[0], *row] for row in rows], b
    rows = [mpmath.lu_solve(powers, mpmath.matrix([c[i] ** (k + 1) / (k + 1) for k in range(s)])) for i in range(s)]
    return [list(row) for row in rows], b


def weights(A: Sequence[Sequence[Any]], b: Sequence[Any], trees: Iterable[bs.Tree]) -> dict[bs.Tree, Any]:
    """Elementary weights, each from the stage vectors of smaller trees."""
    stages: dict[bs.Tree, list[Any]] = {}
    for tree in trees:
        stages[tree] = [mpmath.mpf(1)] * len(b)
        for child in tree.children:
            image = [mpmath.fdot(row, stages[child]) for row in A]
            stages[tree] = [x * y for x, y in zip(stages[tree], image, strict=True)]
    return {tree: mpmath.fdot(b, value) for tree, value in stages.items()}


def distance(exact: bs.BSeries, found: Mapping[bs.Tree, Any]) -> float:
    return float(max(abs(mpmath.mpf(x.numerator) / x.denominator - found[tree]) for tree, x in exact.items()))


@pytest.mark.parametrize("family", FAMILIES)
def test_families_to_ten_stages(family, measured):
    """Exact series against sums over irrational nodes in many digits; orders by the simplifying assumptions."""
    worst = ulps = 0.0
    trees = list(bs.TreeTable(6))
    with mpmath.workdps(60):
        tableaux = [(runge_kutta(f"{family}{s}"), tableau(family, s)) for s in range(2, 11)]
        for method, (A, b) in tableaux:
            worst = max(worst, distance(bs.series(method, 6), weights(A, b, trees)))
            rounded = method.to_float()
            found, exact = (list(chain(*rows)) for rows in ([*rounded.A, rounded.b], [*A, b]))
            error = [
                abs(x - y) / np.spacing(float(abs(y))) for x, y in zip(found, exact, strict=True) if abs(y) > 1e-50
            ]
            ulps = max(ulps, *map(float, error))
            assert bs.order_of(method) == 2 * len(b) + FAMILIES[family]
        method, (A, b) = tableaux[-1]
        A[0] = [entry + mpmath.mpf(10) ** -40 for entry in A[0]]
        shifted = distance(bs.series(method, 6), weights(A, b, trees))
    measured.within(
        f"{family}, 2 to 10 stages: exact series to order 6, against sums over irrational nodes", worst, 1e-50
    )
    measured.within(f"{family}, 2 to 10 stages: entries rounded to floats", ulps, 0.5, " ulp", form=".3f")
    assert shifted > 1e-45  # the 41st digit of one row is seen


@pytest.mark.parametrize("family", ["lobatto-iiid", "lobatto-iiie", "radau-ia", "radau-iia"])
def test_orders_of_further_families_to_ten_stages(family, measured):
    lost = 2 if family.startswith("lobatto") else 1
    found = [bs.order_of(bs.method(f"{family}{s}")) for s in range(2, 11)]
    assert found == [2 * s - lost for s in range(2, 11)]
    measured.said(f"order of {family}, 2 to 10 stages", f"2s − {lost}", ", ".join(map(str, found)))


@pytest.mark.parametrize("name", ["gauss10", "lobatto-iiia10", "lobatto-iiib10", "lobatto-iiic10"])
def test_floats_of_ten_stages(name, measured):
    method = runge_kutta(name)
    exact, found = bs.series(method, 9), bs.series(method.to_float(), 9)
    error = max(abs(found[tree] - float(x)) for tree, x in exact.items()) / 2.0**-52
    measured.within(f"{name}: float series to order 9", error, 16, " · 2⁻⁵²")
    assert max(abs(found[t] - float(x)) for t, x in bs.series(bs.method("radau-iia2"), 9).items()) > 1e-3


# Reducible and confluent tableaux: whatever follows from the map is the same for a method in more stages than it needs.

RK4, MIDPOINT = runge_kutta("rk4"), runge_kutta("implicit-midpoint")
UNUSED = bs.RungeKutta([*([*row, 0] for row in RK4.A), [0, 0, 0, 0, -1]], [*RK4.b, 0], name="unused", warn=False)
TWICE = bs.RungeKutta([[2, F(-3, 2)], [F(-3, 2), 2]], [F(2, 5), F(3, 5)], name="twice", warn=False)
SPLIT = bs.RungeKutta([[0, 0, 0], [F(1, 2), 0, 0], [F(1, 2), 0, 0]], [0, F(1, 3), F(2, 3)], name="split", warn=False)
REDUCIBLE = [
    (UNUSED, RK4, "rk4 and a stage that nothing uses"),
    (TWICE, MIDPOINT, "implicit midpoint in two equal stages"),
    (SPLIT, runge_kutta("explicit-midpoint"), "explicit midpoint in three stages"),
]


@pytest.mark.parametrize(("method", "reduced", "what"), REDUCIBLE, ids=lambda x: getattr(x, "name", None))
def test_reducible_tableaux(method, reduced, what, measured):
    for kind in (bs.series, bs.modified_equation, bs.modifying_integrator):
        assert kind(method, 7) == kind(reduced, 7)
    assert bs.order_of(method) == bs.order_of(reduced)
    assert bs.stability_function(method) == bs.stability_function(reduced)
    assert bs.symplecticity(method, 7).holds == bs.symplecticity(reduced, 7).holds
    assert (
        bs.stability.is_a_stable(method)
        == bs.stability.is_a_stable(reduced)
        == bs.stability.is_a_stable(method.to_float())
    )
    exact, found, in_floats = (bs.fields.convergence_radius(m).radius for m in (reduced, method, method.to_float()))
    assert found == exact
    measured.said(
        f"{what}: series, order, stability, radius", "as for the reduced tableau", f"equal, radius {exact:.6g}"
    )
    measured.within(f"{what}: radius from a float tableau", abs(in_floats / exact - 1) * 2.0**52, 16, " · 2⁻⁵²")


def test_a_stage_that_is_used_counts():
    """Negative control: with a weight on them, the same stages bring their own poles and zeros."""
    used = bs.RungeKutta(UNUSED.A, [*RK4.b[:3], 0, RK4.b[3]], warn=False)
    assert bs.stability_function(used).poles == bs.stability_function(used.to_float()).poles == (-1,)
    assert bs.fields.convergence_radius(used).radius < 1
    assert bs.fields.convergence_radius(used.to_float()).radius < 1
    assert bs.series(used, 7) != bs.series(RK4, 7)
    assert bs.order_of(used) < 4
