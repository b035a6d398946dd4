"""Series that diverge: the best truncation is found, and what lies beyond it, or outside a radius, is never silent.

Truth for H = p − ½ log(1 + q²), a quadrature of q / (1 + q²): a step of the Störmer–Verlet method is the trapezoidal
rule, a step of its truncated modified field an integral. The series is that of Euler and Maclaurin, which diverges with
the solution's singularities at ±i: the best error is about e^(−x) with x = 2π/h, at about x terms.
"""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest

import bseries as bs

TERMS = 35


@cache
def quadrature() -> Any:
    scene = bs.parse_hamiltonian("p - log(1 + q^2)/2")
    return bs.modified_field(bs.method("stormer-verlet"), scene, TERMS, route="towers")


@cache
def riccati(name: str, order: int) -> Any:
    return bs.modified_field(bs.method(name), bs.scene("riccati"), order)


def reach(f: Any, y: Any, h: float, **options: Any) -> tuple[bs.Reach, bool]:
    """What `bs.reach` says, and whether it warns."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = bs.reach(f, y, h, **options)
    assert all(issubclass(warning.category, bs.TruncationWarning) for warning in caught)
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
    case = f"h = 2π/{x}: order {found.optimal_order} found, {best} is best, {TERMS} are given"
    shown = f"{here:.1e}, least {errors.min():.1e}, foretold {told:.1e}; warns: all terms {errors[-1]:.1e}"
    measured(case, "error within a factor of 3 of the least and the foretold one; a warning", shown)
    assert abs(best - x) <= 2
    assert here <= 3 * errors.min()
    assert told / 3 <= here <= 3 * told
    assert np.exp(-x) / 10 <= here <= 10 * np.exp(-x)
    assert warned
    assert errors[-1] > 5 * here


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
    measured(f"{name} on y' = y², 12 steps, orders 2 to 13: passed in silence", "never", f"{silent} of {beyond}")
    assert beyond >= 10
    assert silent == 0


# Linear scenes, where the series converges inside a radius that is known.

STIFF = ["rk4", "implicit-euler", "implicit-midpoint", "gauss2", "radau-iia2", "lobatto-iiic3", "dormand-prince54"]


@pytest.mark.parametrize("name", STIFF)
def test_stiff_linear_scenes_warn_outside_the_radius(name, measured):
    """h λ from 3 · 10^−8 to 3 · 10^8: a warning exactly outside, also where the state has no stiff component."""
    method, radius = bs.method(name), bs.convergence_radius(bs.method(name)).radius
    warned = {}
    for k in range(-8, 9):
        f = bs.modified_field(method, bs.scene("linear", matrix=[[-1, 0], [0, -3 * 10 ** (k + 8)]]), 9)
        for y in ([1.0, 1.0], [1.0, 0.0]):
            found, warned[k] = reach(f, y, 1e-8, method=method)
            assert warned[k] == (3 * 10.0**k > radius) == (found.converges is False)
    last = max(k for k in warned if not warned[k])
    measured(
        f"{name} on linear scenes, hλ = 3·10^−8 … 3·10^8",
        f"warns for hλ > {radius:.4g}",
        f"silent to 3·10^{last}, then warns",
    )


@pytest.mark.parametrize("name", STIFF)
def test_the_radius_is_where_the_sums_stop_converging(name, measured):
    """Σ b_k z^k against log R(z), on the ray of the nearest singularity: inside it converges, outside it does not."""
    method, found = bs.method(name), bs.convergence_radius(bs.method(name))
    R = bs.stability_function(method)
    f = bs.modified_field(method, bs.scene("linear", matrix=[[1]]), 60)
    coefficients = f.terms(np.ones((1, 1)))[:, 0, 0]

    powers = np.arange(1, len(coefficients) + 1)

    def terms(z: complex) -> np.ndarray:
        return coefficients * z**powers

    assert found.root is not None
    inside, outside = (found.root * factor for factor in (0.6, 1.3))
    error = abs(np.exp(terms(inside).sum()) / complex(R(inside)) - 1)
    measured(f"{name}: 60 terms of the modified equation at 0.6 of the radius", "error ≤ 10⁻⁶", error)
    assert error < 1e-6
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
    ("name", "scene"), [("rk4", "van-der-pol"), ("implicit-midpoint", "van-der-pol"), ("rk4", "lorenz")]
)
def test_stiff_nonlinear_scenes_warn(name, scene, measured):
    f = bs.modified_field(bs.method(name), bs.scene(scene), 9)
    found, warned = reach(f, list(f.scene.y0), 0.2)
    measured(
        f"{name} on {scene}, h = 0.2, order 9",
        "warns",
        f"warns; order {found.optimal_order}, h ≤ {found.largest_step:.1e}",
    )
    assert warned
    assert not reach(f, list(f.scene.y0), found.largest_step * 0.99)[1]
