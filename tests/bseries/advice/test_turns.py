"""How soon a motion has turned once: sines by what is known of them, rests, and what goes on."""

from __future__ import annotations

import math

import numpy as np
import pytest

import bseries as bs
from bseries.advice.work_precision.extrapolation import first_period

PHASES = [k * math.pi / 4 for k in range(8)]


def circle(turns, phase=0.0):
    t = np.linspace(0, 2 * math.pi * turns, 801) + phase
    return np.array([np.cos(t), np.sin(t)])


@pytest.mark.parametrize("phase", PHASES)
def test_less_than_a_turn_is_none_and_a_turn_and_a_half_is_one(phase):
    assert first_period(circle(0.95, phase)) == math.inf
    assert first_period(circle(1.5, phase)) <= 1
    assert 1 <= 20 * first_period(circle(20, phase)) <= 1.5


def test_the_slowest_variable_decides():
    fast, slow = circle(20), circle(0.7)
    assert first_period(np.concatenate([fast, slow])) == math.inf
    assert first_period(np.concatenate([fast, 1e-10 * slow])) == first_period(fast)  # it does not move
    assert first_period(slow + 0.1 * fast) == math.inf  # ripples are no turns


@pytest.mark.parametrize(("start", "turns"), [(3, (0.3, 0.5, 0.9, 2)), (1.2, (0.3, 0.5, 0.9, 2))])
def test_pendulums_that_swing_or_go_round(start, turns):
    """Angles that go on turn in their pace."""
    scene = bs.scene("pendulum").with_start(p=[start], q=[0])
    run = bs.integrate(scene, "gauss4", h=0.01, steps=3000)
    p = run.y[0]
    back = np.nonzero((p[1:-1] > p[:-2]) & (p[1:-1] >= p[2:]))[0][0] + 1  # momenta begin with their largest value
    found = [first_period(run.y[:, : round(back * part)]) for part in turns]
    assert [x <= 1 for x in found] == [False, False, False, True]


def test_rest_and_even_pace_have_no_turns():
    t = np.linspace(0, 1, 401)
    assert first_period(np.exp(-20 * t)[None]) == 0.0
    assert first_period(np.exp(-t)[None]) == math.inf
    assert first_period(np.array([3 * t, 0 * t])) == 0.0
    assert first_period(np.exp(2 * t)[None]) == math.inf
    assert first_period(np.zeros((2, 401))) == 0.0
