"""What compiled steps are and keep: plain steps by definition, reversal by adjoint steps, symplecticity."""

from __future__ import annotations

from functools import cache

import catalogue_cases as cases
import mpmath
import numpy as np
import pytest
import sympy

from integrators import adjoint_method, catalogue, method, scene, stepper
from integrators.reference.plain_steps import block_parts, plain_step, plain_steps

STEPS = 20


def fields(name, names, arithmetic):
    """The whole field of a scene, or its blocks: p, q by name, a for the positions and b for the momenta."""
    system = cases.SCENES[name]
    whole = sympy.lambdify([system.symbols], list(system.field), arithmetic)
    if len(names) == 1:
        return whole
    blocks = [range(block.offset, block.end) for block in system.blocks]
    return block_parts(whole, dict(zip(names, reversed(blocks) if "a" in names else blocks, strict=True)))


# Plain steps

ELSEWHERE = {
    "rosenbrock",
    "w-method",
    "force gradient",
    "two-derivative",
    "continuous stage",
    "exponential",
    "implicit-explicit",
}
"""Kinds whose compiled steps are compared with thirty digits in `test_implicit_steppers` and `test_flow_steppers`."""


@pytest.mark.few(10)
@pytest.mark.parametrize(("entry", "stages", "name", "order"), [*cases.claims(ELSEWHERE)])
def test_steps_are_those_of_the_definition(entry, stages, name, order):
    made = cases.built(entry, stages)
    start = cases.STARTS[name]
    expected = plain_steps(made, fields(name, made.names, "numpy"), start, 1 / 32, STEPS)
    compiled = stepper(made, cases.SCENES[name])
    state = compiled.start(start, h=1 / 32)
    compiled.advance(state, STEPS)
    assert np.abs(state.y - expected[:, -1]).max() < 300 * np.spacing(np.abs(expected).max())


@pytest.mark.parametrize("name", ["kennedy-carpenter32", "kennedy-carpenter54"])
def test_steps_of_additive_pairs_are_those_of_the_definition(name):
    start, made = cases.STARTS["reaction"], method(name)
    parts = {
        "L": lambda y: np.array([-y[0] + 2 * y[1], y[0] - 8 * y[1]]),
        "N": lambda y: np.array([y[0] * y[1], 1 - y[0] ** 2]),
    }
    expected = plain_steps(made, parts, start, 1 / 32, STEPS)
    compiled = stepper(made, cases.SCENES["reaction"])
    state = compiled.start(start, h=1 / 32)
    compiled.advance(state, STEPS)
    assert np.abs(state.y - expected[:, -1]).max() < 300 * np.spacing(np.abs(expected).max())


def test_steps_of_another_method_are_others():
    expected = plain_steps(method("heun3"), fields("pendulum", ["f"], "numpy"), [0.4, 1.1], 1 / 32, STEPS)
    compiled = stepper("kutta3", scene("pendulum"))
    state = compiled.start([0.4, 1.1], h=1 / 32)
    compiled.advance(state, STEPS)
    assert np.abs(state.y - expected[:, -1]).max() > 1e-8


# Reversal


def return_gap(there, back, name, h=1 / 16, steps=50):
    """How far from the start, in units of rounding errors, steps there and back end."""
    start = np.array(cases.STARTS[name])
    forth = stepper(there, cases.SCENES[name])
    state = forth.start(start, h=h)
    forth.advance(state, steps)
    assert np.abs(state.y - start).max() > 0.1
    return_steps = stepper(back, cases.SCENES[name])
    state = return_steps.start(state.y, h=-h)
    return_steps.advance(state, steps)
    return np.abs(state.y - start).max() / np.spacing(np.abs(start).max())


SYMMETRIC = [
    ("implicit-midpoint", "double-pendulum"),
    ("trapezoidal", "double-pendulum"),
    ("gauss2", "double-pendulum"),
    ("gauss3", "henon-heiles"),
    ("lobatto-iiia3", "lotka-volterra"),
    ("lobatto-iiib3", "lotka-volterra"),
    ("lobatto-iiid3", "brusselator"),
    ("lobatto-iiie3", "lotka-volterra"),
    ("avf", "henon-heiles"),
    ("energy-collocation2", "henon-heiles"),
    ("kahan", "lotka-volterra"),
    ("stormer-verlet-kdk", "double-pendulum"),
    ("stormer-verlet-kdk", "kepler"),
    ("stormer-verlet-dkd", "double-pendulum"),
    ("stormer-verlet-dkd", "kepler"),
    ("lobatto-iiia-iiib3", "double-pendulum"),
    ("gark2", "double-pendulum"),
    ("takahashi-imada", "kepler"),
    ("simplified-takahashi-imada", "kepler"),
    ("chin4b", "kepler"),
    ("chin4c", "henon-heiles"),
    ("strang", "lotka-volterra"),
    ("blanes-moan6", "henon-heiles"),
    ("sofroniou-spaletta10", "henon-heiles"),
    ("blanes-casas-rkn8", "henon-heiles"),
]
ONE_WAY = [
    ("rk4", "double-pendulum"),
    ("radau-iia2", "henon-heiles"),
    ("lobatto-iiic3", "lotka-volterra"),
    ("crouzeix3", "lotka-volterra"),
    ("symplectic-euler-p", "double-pendulum"),
    ("symplectic-euler-q", "kepler"),
    ("lie-trotter", "lotka-volterra"),
    ("ruth3", "henon-heiles"),
]


@pytest.mark.few(12)
@pytest.mark.parametrize(("name", "where"), SYMMETRIC)
def test_symmetric_methods_reverse_to_rounding(name, where):
    assert return_gap(name, name, where) < 400


@pytest.mark.parametrize(("name", "where"), SYMMETRIC[::4])
def test_a_run_may_turn_round(name, where):
    """With its compensation; stage derivatives of the last step are not those of the next one."""
    compiled, start = stepper(name, cases.SCENES[where]), cases.STARTS[where]
    state = compiled.start(start, h=1 / 16)
    compiled.advance(state, 50)
    state = compiled.restart(state, h=-state.h)
    compiled.advance(state, 50)
    assert np.abs(state.y - start).max() < 400 * np.spacing(np.abs(start).max())


@pytest.mark.few(4)
@pytest.mark.parametrize(("name", "where"), ONE_WAY)
def test_adjoint_methods_reverse_to_rounding_and_only_they(name, where):
    assert return_gap(name, adjoint_method(method(name)), where) < 400
    assert return_gap(name, name, where) > 1e6


# Symplecticity, by central differences in forty digits

SYMPLECTIC = {
    *("implicit-midpoint", "lobatto-iiib2", "qin-zhang", "gauss1", "gauss2", "gauss-gauss1", "gauss-gauss2"),
    *("lobatto-iiid2", "lobatto-iiid3", "lobatto-iiie2", "lobatto-iiie3"),
    *("symplectic-euler-p", "symplectic-euler-q", "stormer-verlet-kdk", "stormer-verlet-dkd"),
    *("lobatto-iiia-iiib2", "lobatto-iiia-iiib3", "lobatto-iiib-iiia2", "lobatto-iiib-iiia3"),
}
"""Symplectic methods for all Hamiltonian systems (HLW, sections VI.4 and VI.5); lobatto-iiib2 is the midpoint rule."""
SEPARABLE_KINDS = {"splitting", "nystrom splitting"}
SEPARABLE = {"rkn-verlet", "takahashi-imada", "chin4a", "chin4b", "chin4c", "gark2", "boris"}
"""Those for H = T(p) + U(q) only: compositions of exact flows, and those above (HLW, section VI.4.1)."""
WIDTH = mpmath.mpf(10) ** -12


@cache
def precise_fields(name, names):
    return fields(name, names, "mpmath")


def kicks_and_drifts(parts):
    """The exact flows of parts that do not change what they depend on."""
    return {name: lambda y, t, f=f: [a + t * b for a, b in zip(y, f(y), strict=True)] for name, f in parts.items()}


def defect_of_symplecticity(made, name):
    """The largest entry of Φ′ᵀ J Φ′ − J for one step."""
    parts = precise_fields(name, tuple(made.names))
    options = {"flows": kicks_and_drifts(parts)} if "a" in made.names else {}
    columns = []
    with mpmath.workdps(40):
        for i in range(4):
            ends = []
            for sign in (1, -1):
                y = [mpmath.mpf(x) for x in cases.STARTS[name]]
                y[i] += sign * WIDTH
                ends.append(plain_step(made, parts, y, "1/4", digits=40, **options))
            columns.append((ends[0] - ends[1]) / (2 * WIDTH))
        return max(
            abs(a[0] * b[2] + a[1] * b[3] - a[2] * b[0] - a[3] * b[1] - (j == i + 2) + (i == j + 2))
            for i, a in enumerate(columns)
            for j, b in enumerate(columns)
        )


def named(left_out, slow):
    """Two members of each family and all other methods, without some kinds; those that are `slow` are marked."""
    for entry in catalogue():
        if entry.kind not in {*left_out, "multistep"}:
            for stages in range(entry.least_stages, entry.least_stages + 2) if entry.is_family else [None]:
                marks = [pytest.mark.slow] * slow(entry, stages)
                yield pytest.param(entry, stages, id=f"{entry.name}{stages or ''}", marks=marks)


def is_long_rosenbrock(entry, stages):
    """Those with one and two stages are no more symplectic."""
    return entry.kind == "rosenbrock" and entry.stages > 2


def is_rosenbrock_or_large(entry, stages):
    """The smallest members of families are here, and larger ones on the other scene."""
    return entry.kind == "rosenbrock" or (stages or 0) > 2


@pytest.mark.few(20)
@pytest.mark.parametrize(("entry", "stages"), [*named({"exponential", "w-method"}, is_long_rosenbrock)])
def test_symplecticity_where_the_hamiltonian_is_separable(entry, stages):
    made = cases.built(entry, stages)
    expected = made.name in SYMPLECTIC | SEPARABLE or entry.kind in SEPARABLE_KINDS
    defect = defect_of_symplecticity(made, "henon-heiles")
    assert defect < 1e-19 if expected else defect > 1e-13


SPECIAL = {"exponential", "w-method", "splitting", "nystrom", "nystrom splitting", "force gradient"}
SLOW = {"continuous stage"}
"""Averages of this field take minutes in forty digits; they are above."""


@pytest.mark.few(8)
@pytest.mark.parametrize(("entry", "stages"), [*named(SPECIAL | SLOW, is_rosenbrock_or_large)])
def test_symplecticity_where_it_is_not(entry, stages):
    made = cases.built(entry, stages)
    defect = defect_of_symplecticity(made, "double-pendulum")
    assert defect < 1e-19 if made.name in SYMPLECTIC else defect > 1e-13
