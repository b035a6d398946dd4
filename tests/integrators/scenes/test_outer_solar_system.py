"""The outer solar system over centuries, against an independent solution of high order."""

from __future__ import annotations

import numpy as np
import pytest

from integrators import integrate, reference_solution, scene

DAYS = 100_000


@pytest.fixture(scope="module")
def exact():
    """By Taylor series in double-double arithmetic, at a tenth of the time and at its end."""
    system = scene("outer-solar-system")
    return reference_solution(system, [DAYS / 10, DAYS], y0=system.y0)


def relative_errors(method, h, exact):
    """Errors in parts of the largest momentum and coordinate of each body, at both times."""
    system = scene("outer-solar-system")
    steps = round(DAYS / h)
    run = integrate(method, system, h=h, steps=steps, save_every=steps // 10)
    gaps, sizes = (np.abs(x).reshape(2, -1, 3, 2) for x in (run.y[:, [1, -1]] - exact, exact))
    return gaps / sizes.max(axis=(2, 3), keepdims=True)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "h"), [("gauss6", 100), ("sofroniou-spaletta10", 100), ("blanes-casas-rkn8", 25)])
def test_centuries_to_twelve_digits(method, h, exact):
    assert relative_errors(method, h, exact).max() < 1e-12


def test_verlet_does_not_come_so_far(exact):
    assert relative_errors("stormer-verlet", 25, exact).max() > 1e-6
