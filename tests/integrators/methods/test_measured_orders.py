"""The order of every method of the catalogue, measured: compiled steps against reference solutions."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import catalogue_cases as cases
import numpy as np
import pytest

from integrators import RungeKutta, StepError, method, reference_solution, stepper

ROUNDING = 2e-15
"""Errors that are smaller are spoilt by rounding: compensated sums keep rounding errors near 1e-16."""
UNCOMPENSATED = 1e-10
"""The same for forms whose stages are no sums of y and increments: n steps leave some n rounding errors."""
DECIMALS = 100
"""Errors are spoilt by the last digits of published decimals where they are smaller than so many units of these."""
FINEST = 13
"""No more than 2^13 steps, which show orders 1, 2 and 3 well."""


@cache
def exact_end(name):
    """The exact solution at time 1."""
    return reference_solution(cases.SCENES[name], 1, y0=cases.STARTS[name], full=True)


def global_error(compiled, name, steps):
    """The error at time 1; rounding errors that the state keeps apart count."""
    exact = exact_end(name)
    state = compiled.start(cases.STARTS[name], h=1 / steps)
    compiled.advance(state, steps)
    return np.linalg.norm((state.y - exact.high[:, 0]) + (state.carry - exact.low[:, 0]))


def measured_order(made, name):
    """The order that the two smallest of the steps 1/2, 1/4, … show whose errors are not spoilt."""
    compiled, errors = stepper(made, cases.SCENES[name]), []
    form = made.form.kind if isinstance(made, RungeKutta) and made.form is not None else ""
    spoilt = UNCOMPENSATED if form in ("3S*", "Shu-Osher") else ROUNDING
    spoilt = max(spoilt, DECIMALS * 10.0**-made.digits if made.digits else 0)
    for level in range(1, FINEST + 1):
        try:
            error = global_error(compiled, name, 2**level)
        except StepError:  # implicit stages need not exist for the largest steps
            continue
        if error < spoilt:
            break
        errors.append(error)
    return np.log2(errors[-2] / errors[-1])


@pytest.mark.few(15)
@pytest.mark.parametrize(("entry", "stages", "name", "order"), [*cases.claims()])
def test_measured_order_is_not_below_the_claim(entry, stages, name, order):
    assert measured_order(cases.built(entry, stages), name) > order - 0.1


@pytest.mark.parametrize("name", cases.GENERAL)
def test_a_wrong_coefficient_is_seen(name):
    rk4 = method("rk4")
    A = [*rk4.A[:3], [0, 0, Fraction(99, 100), 0]]
    assert measured_order(RungeKutta(A, rk4.b), name) < 3
