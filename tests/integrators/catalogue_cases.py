"""Every method of the catalogue with scenes that it suits, for tests of compiled steps.

Each method has one of the three scenes that suit its kind, in turn, so that each kind runs on all of them; with
BSERIES_ALL_SCENES=1 in the environment each method has all three.
"""

from __future__ import annotations

import os

import pytest

from integrators import Scene, Term, catalogue, method, scene

VALUES = {"alpha": "3/7", "gamma": "2/7", "c2": "3/5", "c3": "6/7"}
"""Parameters in general position: no further order condition holds by accident."""

STARTS = {
    "lotka-volterra": [1.5, 2.25],
    "henon-heiles": [0.3, 0.1, -0.2, 0.25],
    "double-pendulum": [0.4, -0.3, 0.8, 1.1],
    "brusselator": [1.5, 3.0],
    "pendulum": [0.4, 1.1],
    "damped-pendulum": [0.4, 1.1],
    "kepler": [0.2, 1.0, 0.9, -0.3],
    "stiff-scalar": [1.5],
    "fast-oscillator": [0.4, 0.75],
    "reaction": [0.75, 1.0],
}
"""Starts without any symmetry."""


def semilinear(name, blocks, linear, nonlinear):
    """A scene y' = L y + N(y)."""
    return Scene(blocks, terms=[Term(field=linear, part="L"), Term(field=nonlinear, part="N")], name=name)


SCENES = {
    "lotka-volterra": scene("lotka-volterra"),
    "henon-heiles": scene("henon-heiles"),
    "double-pendulum": scene("double-pendulum"),
    "brusselator": scene("brusselator"),
    "pendulum": scene("pendulum"),
    "damped-pendulum": scene("pendulum", effects=["damping"]),
    "kepler": scene("kepler"),
    "stiff-scalar": semilinear("stiff-scalar", {"y": ["u"]}, {"u": "-20*u"}, {"u": "10*sin(u) + 4"}),
    "fast-oscillator": semilinear("fast-oscillator", {"p": 1, "q": 1}, {"p": "-25*q", "q": "p"}, {"p": "-q^3"}),
    "reaction": semilinear(
        "reaction", {"y": ["u", "v"]}, {"u": "-u + 2*v", "v": "u - 8*v"}, {"u": "u*v", "v": "1 - u^2"}
    ),
}
GENERAL = "lotka-volterra", "henon-heiles", "brusselator"
SECOND_ORDER = "pendulum", "henon-heiles", "kepler"
TWO_BLOCKS = "double-pendulum", "henon-heiles", "lotka-volterra"
SUITABLE = {
    "partitioned": TWO_BLOCKS,
    "additive": TWO_BLOCKS,
    "splitting": ("lotka-volterra", "henon-heiles", "pendulum"),
    "nystrom": SECOND_ORDER,
    "nystrom splitting": SECOND_ORDER,
    "force gradient": SECOND_ORDER,
    "implicit-explicit": ("stiff-scalar", "fast-oscillator", "reaction"),
    "exponential": ("stiff-scalar", "fast-oscillator", "reaction"),
}
"""Scenes for the methods that are made for special systems."""
FOR_FORCES_WITH_VELOCITY = ("damped-pendulum", "pendulum", "kepler")


def built(entry, stages):
    """The method of an entry, or the member of a family."""
    return method(f"{entry.name}{stages or ''}", **{name: VALUES[name] for name in entry.parameters})


def order_of(entry, stages):
    """The order that an entry claims: a number, or a formula like 2s-1."""
    if not isinstance(entry.order, str):
        return entry.order
    factor, _, shift = entry.order.partition("s")
    return int(factor) * stages + int(shift or 0)


def claims(left_out=()):
    """All methods, three members of each family, with scenes and the order that they claim; some kinds left out.

    Third members are slow: `test_plain_steps` has their orders, and their steps are generated as those of the second.
    """
    places = {}
    for entry in catalogue():
        suitable = SUITABLE.get(entry.kind, GENERAL)
        if entry.kind == "nystrom" and entry.name.endswith("general"):
            suitable = FOR_FORCES_WITH_VELOCITY
        for stages in range(entry.least_stages, entry.least_stages + 3) if entry.is_family else [None]:
            place = places[entry.kind] = places.get(entry.kind, -1) + 1
            if entry.kind == "multistep" or entry.kind in left_out:
                continue
            for name in suitable if os.environ.get("BSERIES_ALL_SCENES") else [suitable[place % 3]]:
                case = f"{entry.name}{stages or ''}-{name}"
                marks = [pytest.mark.slow] * (stages is not None and stages > entry.least_stages + 1)
                yield pytest.param(entry, stages, name, order_of(entry, stages), id=case, marks=marks)
