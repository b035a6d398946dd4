"""Series that diverge: the best truncation is found, and what lies beyond it, or outside a radius, is never silent.

Truth for H = p − ½ log(1 + q²), a quadrature of q / (1 + q²): a step of the Störmer–Verlet method is the trapezoidal
rule, a step of its truncated modified field an integral. The series is that of Euler and Maclaurin, which diverges with
the solution's singularities at ±i: the best error is about e^(−x) with x = 2π/h, at about x terms.
"""

from __future__ import annotations

import warnings
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest

import bseries as bs

pytestmark = pytest.mark.slow

TERMS = 35


@cache
def quadrature() -> Any:
    scene = bs.parse_hamiltonian("p - log(1 + q^2)/2")
    return bs.modified_field(bs.method("stormer-verlet"), scene, TERMS, route="towers")


def runge_kutta(name: str) -> bs.RungeKutta:
    method = bs.method(name)
    assert isinstance(method, bs.RungeKutta)
    return method


@cache
def riccati(name: str, order: int) -> Any:
    return bs.modified_field(bs.method(name), bs.scene("riccati"), order)


def reach(f: Any, y: Any, h: float, **options: Any) -> tuple[bs.fields.Reach, bool]:
    """What `bs.fields.reach` says, and whether it warns."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = bs.fields.reach(f, y, h, **options)
    assert all(issubclass(warning.category, bs.fields.TruncationWarning) for warning in caught)
    return found, bool(caught)


def truncation_errors(h: float) -> np.ndarray:
    """For 1, 2, … terms the distance of a step from (0, 0) to the flow of the modified field."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    q = h * (nodes + 1) / 2
    terms = quadrature().terms(np.array([np.zeros_like(q), q]))[:, 0, :]
    flows = np.cumsum(h ** np.arange(1, TERMS + 1) * (terms @ weights) / 2)
    return abs(flows - h * h / 2 / (1 + h * h))


@pytest.mark.parametrize("x", [6, 8, 10, 12, 16, 20, 24, 28])
def test_the_optimal_truncation_is_found(x, measured):
    """From the sizes of the terms alone: where to stop, the error there, and that all terms would be worse."""
    h = 2 * np.pi / x
    errors = truncation_errors(h)
    found, warned = reach(quadrature(), [h * h / 4, h / 2], h)
    assert found.best_error is not None
    best, here, told = int(errors.argmin()) + 1, errors[found.optimal_order - 1], found.best_error * h
    case = f"quadrature, h = 2π/{x}: error"
    measured.within(
        f"{case} at the order found", here / errors.min(), 3, " times the least one", form=".1f",
        note=f"{here:.1e} at order {found.optimal_order}, {errors.min():.1e} at order {best}",
    )  # fmt: skip
    measured.within(f"{case} foretold", max(here / told, told / here), 3, " times off", form=".1f", note=f"{told:.1e}")
    assert warned
    measured.at_least(
        f"{case} of all {TERMS} terms, of which it warns", errors[-1] / here, 5, " times that", note=f"{errors[-1]:.1e}"
    )
    assert abs(best - x) <= 2
    assert np.exp(-x) / 10 <= here <= 10 * np.exp(-x)


def test_shorter_truncations_do_not_warn():
    """Negative control: a warning at every order would pass the test above."""
    f = bs.modified_field(bs.method("stormer-verlet"), quadrature().scene, 9, route="towers")
    for x in (12, 20, 28):
        h = 2 * np.pi / x
        found, warned = reach(f, [h * h / 4, h / 2], h)
        assert not warned
        assert found.optimal_order == 9


@pytest.mark.parametrize("name", ["explicit-euler", "implicit-midpoint", "implicit-euler"])
def test_no_order_beyond_the_optimum_is_silent(name, measured):
    """For every order and step: a warning exactly where h exceeds the largest step of that order."""
    silent = beyond = 0
    for h in np.geomspace(0.02, 5, 12):
        whole, _ = reach(riccati(name, 13), [1.0], h)
        for order in range(2, 14):
            found, warned = reach(riccati(name, order), [1.0], h)
            assert warned == found.is_beyond == (h > found.largest_step)
            grown = found.sizes[-1] > 4 * max(whole.best_error or 0, found.sizes[-2])
            beyond += grown and order >= whole.optimal_order + 3
            silent += grown and order >= whole.optimal_order + 3 and not warned
    assert beyond >= 10
    assert silent == 0
    measured.said(f"{name} on y' = y², 12 steps, orders 2 to 13: passed in silence", "never", f"{silent} of {beyond}")


# Linear scenes, where the series converges inside a radius that is known.

STIFF = [
    "rk4",
    "implicit-euler",
    "implicit-midpoint",
    "gauss2",
    "radau-iia2",
    "radau-iia3",
    "lobatto-iiic3",
    "dormand-prince54",
]


@pytest.mark.parametrize("name", STIFF)
def test_stiff_linear_scenes_warn_outside_the_radius(name, measured):
    """hλ from 3·10⁻⁸ to 3·10⁸: a warning outside, also where the state has no stiff component."""
    method, radius = runge_kutta(name), bs.fields.convergence_radius(runge_kutta(name)).radius
    sizes = sorted([3 * 10.0**k for k in range(-8, 9)] + [0.99 * radius, 1.01 * radius])
    for size in sizes:
        f = bs.modified_field(method, bs.scene("linear", matrix=[[-1, 0], [0, -Fraction(size) * 10**8]]), 9)
        for y in ([1.0, 1.0], [1.0, 0.0]):
            found, warned = reach(f, y, 1e-8, method=method)
            assert warned == (size > radius) == (found.converges is False)
    below, above = (sizes[sizes.index(factor * radius)] for factor in (0.99, 1.01))
    measured.said(
        f"modified equation of {name} on linear scenes, hλ = 3·10⁻⁸ … 3·10⁸",
        f"warns outside the radius {radius:.4g}",
        f"silent to {below:.4g}, warns from {above:.4g} on",
    )


@pytest.mark.parametrize("name", STIFF)
def test_the_radius_is_where_the_sums_stop_converging(name, measured):
    """Σ b_k z^k against log R(z), on the ray of the nearest singularity: inside it converges, outside it does not.

    Each of the n zeros and poles of R, none of them nearer, adds ±(z/root)^k/k to b_k z^k: after K terms at 0.6 of the
    radius less than n 0.6^(K+1) / ((K+1)(1 − 0.6)) is left.
    """
    method = runge_kutta(name)
    found, R = bs.fields.convergence_radius(method), bs.stability_function(method)
    assert found.root is not None
    inside, outside = (found.root * factor for factor in (0.6, 1.3))
    coefficients = bs.modified_field(method, bs.scene("linear", matrix=[[1]]), 60).terms(np.ones((1, 1)))[:, 0, 0]

    def terms(z: complex) -> np.ndarray:
        return coefficients * z ** np.arange(1, 61)

    def error(count: int) -> float:
        return abs(np.exp(terms(inside)[:count].sum()) / complex(R(inside)) - 1)

    roots = bs.stability.StabilityFunction.from_elements(R.q, R.p, floating=R.floating, digits=R.digits).poles + R.poles
    tail = len(roots) * 0.6**41 / (41 * 0.4)
    measured.within(f"{name}: error of 40 terms of the modified equation at 0.6 of the radius", error(40), tail)
    assert error(30) > tail
    sizes = abs(terms(outside))
    assert sizes[-6:].max() > 10 * sizes[24:30].max()


@pytest.mark.parametrize("name", ["rk4", "implicit-midpoint", "dormand-prince54"])
def test_without_the_method_sizes_still_warn(name):
    """Unless told the method, `reach` guesses from the sizes of the terms: far outside that is enough."""
    f = bs.modified_field(bs.method(name), bs.scene("linear", matrix=[[-1, 0], [0, -100]]), 13)
    found, warned = reach(f, [1.0, 1.0], 1.0)
    assert warned
    assert found.converges is None
    assert not reach(f, [1.0, 1.0], 1e-3)[1]


@pytest.mark.parametrize(
    ("name", "scene"),
    [
        ("rk4", "van-der-pol"),
        ("implicit-midpoint", "van-der-pol"),
        ("implicit-euler", "van-der-pol"),
        ("rk4", "lorenz"),
    ],
)
def test_stiff_nonlinear_scenes_warn(name, scene, measured):
    f = bs.modified_field(bs.method(name), bs.scene(scene), 9)
    found, warned = reach(f, list(f.scene.y0), 0.2)
    assert warned
    measured.said(
        f"modified equation of {name} on {scene}, h = 0.2, order 9",
        "warns",
        f"warns; order {found.optimal_order}, h ≤ {found.largest_step:.1e}",
    )
    assert not reach(f, list(f.scene.y0), found.largest_step * 0.99)[1]
