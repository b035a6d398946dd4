"""Generated code of scenes: the field and its observables, compiled, interpreted and in high precision."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy

from integrators import IntegratorError
from integrators.compile import printer
from integrators.compile.scene_source import compiled_scene, scene_source
from integrators.exact.expressions import ELEMENTARY
from integrators.scenes.catalogue.registry import scene, scene_catalogue
from integrators.scenes.checks import precise_field
from integrators.scenes.model.terms import Effect, Term
from integrators.scenes.scene import Scene

ROOT = Path(__file__).parents[3]
DISTANCE = "((qx_i - qx_j)^2 + (qy_i - qy_j)^2)"
KINETIC = Term(over="each", hamiltonian="p_i^2/(2*m_i)")
PLANAR = Term(over="each", hamiltonian="(px_i^2 + py_i^2)/(2*m_i)")

SCENES = {
    "single": Scene(
        {"p": 1, "q": 1}, hamiltonian="p^2/2 - a*cos(q) + 1/3", parameters={"a": 2}, invariants={"a": "p*q/a", "b": "a"}
    ),
    "names that are words of Python": Scene({"lambda": ["def", "τ"]}, field={"def": "τ", "τ": "-def"}),
    "time": Scene({"p": 2, "q": 2}, terms=[
        Term(over="each", hamiltonian="p_i^2/2 + q_i^2/2"), Term(over="each", field={"p_i": "sin(t)*q_i"})
    ]),
    "poisson": Scene(
        {"y": ["u", "v"]}, hamiltonian="u - log(u) + v - 2*log(v) + 1", poisson=[["0", "u*v"], ["-u*v", "0"]]
    ),
    "chain": Scene({"p": 5, "q": 5}, terms=[
        KINETIC, Term(over="chain", hamiltonian="(q_i - q_j)^2/2 + (q_i - q_j)^4/4")
    ], parameters={"m": [1, 2, 3, 4, 5]}),
    "ring": Scene({"p": 4, "q": 4}, terms=[KINETIC, Term(over="ring", hamiltonian="exp(q_i - q_j) - 1")],
                  parameters={"m": [2, 2, 2, 2]}),
    "pairs": Scene({"p": [4, 2], "q": [4, 2]}, terms=[
        PLANAR, Term(over="pairs", hamiltonian=f"4/{DISTANCE}^6 - 4/{DISTANCE}^3"),
        Term(over="pairs", hamiltonian=f"-m_i*m_j/sqrt({DISTANCE}) + m_i*m_j"),
    ], parameters={"m": [1, "1/3", "sqrt(2)", 4]}),
    "table": Scene({"p": 4, "q": 4}, terms=[
        KINETIC, Term(over=[(1, 3), (2, 4), (1, 4)], hamiltonian="cos(q_i - 2*q_j)*m_j"),
        Term(over=[(1, 2, 4)], hamiltonian="q_i*q_j*q_k"),
    ], parameters={"m": [1, 2, 3, 4]}),
    "mixed": Scene({"p": 3, "q": 3, "s": 1}, field={"s": "q1*s", "p2": "s^2"}, terms=[
        Term(over="each", field={"q_i": "p_i", "p_i": "-q_i"}),
        Term(over="pairs", field={"p_i": "q_j^2", "q_j": "p_i"}),
    ]),
}  # fmt: skip


@pytest.fixture(autouse=True, scope="module")
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BSERIES_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def point(system, seed=0):
    return np.random.default_rng(seed).uniform(0.5, 2, system.dimension)


def reference(system, formulas, y):
    """What SymPy's own printer makes of the flat formulas, in 40 digits."""
    symbols = sympy.symbols([f"v{k}" for k in range(system.dimension)])
    renamed = dict(zip(system.symbols, symbols, strict=True))
    function = sympy.lambdify(symbols, [formula.xreplace(renamed) for formula in formulas], "mpmath", cse=True)
    with mpmath.workdps(40):
        return [+mpmath.mpf(value) for value in function(*map(mpmath.mpf, y))]


def close(found, expected, tolerance):
    scale = max(map(abs, expected), default=1)
    return all(abs(a - b) <= tolerance * scale for a, b in zip(found, expected, strict=True))


def by_rows(system, y):
    """The field in 40 digits, row by row from the local terms: every derivative by SymPy, nothing shared."""
    out = [mpmath.mpf(0)] * system.dimension
    with mpmath.workdps(40):
        y = [mpmath.mpf(value) for value in y]
        for term in system.local_terms:
            x = sympy.symbols([f"x{k}" for k in range(len(term.arguments))])
            d = sympy.symbols([f"d{k}" for k in range(len(term.data))])
            formulas = [term.formula if k < 0 else term.formula.diff(x[k]) for k, _, _ in term.outputs]
            function = sympy.lambdify([*x, *d], formulas, "mpmath")
            data = [[mpmath.mpf(sympy.N(value, 45)) for value in datum.values] for datum in term.data]
            for row in term.sites.rows():
                values = [y[a.plus.at(row)] - (y[a.minus.at(row)] if a.minus else 0) for a in term.arguments]
                values += [at_sites[row[datum.role]] for datum, at_sites in zip(term.data, data, strict=True)]
                for (_, place, sign), value in zip(term.outputs, function(*values), strict=True):
                    out[place.at(row)] += sign * value
    return out


def check(system, y, expected):
    """The field interpreted and in high precision, and the energy in both."""
    module, precise, out = compiled_scene(system), precise_field(system), np.full(system.dimension, np.nan)
    module.field.py_func(y, out)
    assert close(out, expected, 1e-13)
    with mpmath.workdps(40):
        assert close(precise([mpmath.mpf(value) for value in y]), expected, mpmath.mpf("1e-36"))
    assert hasattr(module, "energy") == system.is_hamiltonian
    assert hasattr(module, "invariants") == bool(system.invariants)
    if system.is_hamiltonian:
        (energy,) = reference(system, [system.hamiltonian], y)
        assert close([module.energy.py_func(y)], [energy], 1e-13)


@pytest.mark.few(4)
@pytest.mark.parametrize("name", SCENES)
def test_scenes(name):
    system, y = SCENES[name], point(SCENES[name])
    expected, out = reference(system, system.field, y), np.full(system.dimension, np.nan)
    check(system, y, expected)
    compiled_scene(system).field(y, out)
    assert close(out, expected, 1e-14)
    assert close(by_rows(system, y), expected, mpmath.mpf("1e-38"))


def test_observables():
    system, y, out = SCENES["single"], np.array([3.0, 5.0]), np.empty(2)
    compiled_scene(system).invariants(y, out)
    assert list(out) == [7.5, 2]
    assert compiled_scene(system).energy(y) == pytest.approx(4.5 - 2 * math.cos(5) + 1 / 3, rel=1e-15)


@pytest.mark.few(8)
@pytest.mark.parametrize("name", [entry.name for entry in scene_catalogue()])
def test_catalogue(name):
    bare = scene(name)
    for system in [bare, bare.with_effects(*bare.effects)][: 2 if bare.effects else 1]:
        y = system.y0 * (1 + 0.01 * point(system))
        check(system, y, by_rows(system, y))


def test_functions_compiled():
    functions = [*ELEMENTARY, "sqrt", "cbrt"]
    formulas = {name: f"{name}({name}_/2 + 1)" if name == "acosh" else f"{name}({name}_/2)" for name in functions}
    field = {f"{name}_": f"{formula} + 1/{formula}^3" for name, formula in formulas.items()}
    system = Scene({"y": list(field)}, field=field)
    compiled, out = compiled_scene(system).field, np.empty(system.dimension)
    for seed in range(20):
        y = point(system, seed) * 0.9
        compiled(y, out)
        expected = reference(system, system.field, y)
        wrong = [name for name, a, b in zip(functions, out, expected, strict=True) if abs(a - b) > 1e-14 * abs(b)]
        assert wrong == []


def test_beyond_the_domain_nothing_is_raised():
    system = Scene({"y": ["u", "v", "w"]}, field={"u": "1/u", "v": "sqrt(u - 1) + log(u)", "w": "v^(-3)*exp(w) + v/u"})
    out = np.empty(3)
    with np.errstate(all="raise"):
        compiled_scene(system).field(np.zeros(3), out)
    assert out[0] == math.inf
    assert np.isnan(out[1:]).all()


def test_symbols_are_refused():
    free = Scene({"y": 1}, field={"y": "a*y"}, parameters={"a": "a"})
    with pytest.raises(IntegratorError, match=r"parameters\.a must be a number in compiled code, but was a symbol"):
        scene_source(free)


TEN = {f"effect{k}": Effect(field={"p": f"-c{k}*p^{k}"}, parameters={f"c{k}": f"1/{k}"}) for k in range(1, 11)}


def test_effects_that_are_off_leave_no_trace():
    plain = Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)", name="pendulum")
    rich = Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)", name="other", effects=TEN, summary="text")
    damped = Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)", terms=[Term(field={"p": "-p^3/3"})])
    assert scene_source(rich) == scene_source(plain)
    assert scene_source(rich.with_effects("effect3")) == scene_source(damped) != scene_source(plain)
    assert compiled_scene(rich) is compiled_scene(plain)


READABLE = '''\
"""The field f of y' = f(y) and its observables in double precision.

y[0:4] = p1, p2, p3, p4
y[4:8] = q1, q2, q3, q4
"""

from math import exp
from bseries_base.machine_code import njit

compiled = njit(nogil=True, error_model="numpy", fastmath={"contract"})


@compiled
def field(y, out):
    """Put f(y) in out."""
    for i in range(4):
        out[i] = 0.0
    for i in range(4):
        x0 = y[i]
        out[4 + i] = 0.5*x0
    for i in range(4):
        j = i + 1 if i < 3 else 0
        x0 = y[4 + i] - y[4 + j]
        c0 = exp(x0)
        out[i] -= c0
        out[j] += c0


@compiled
def energy(y):
    """The Hamiltonian at y."""
    total = -4.0
    for i in range(4):
        x0 = y[i]
        total += 0.25*x0*x0
    for i in range(4):
        j = i + 1 if i < 3 else 0
        x0 = y[4 + i] - y[4 + j]
        total += exp(x0)
    return total
'''


def test_the_source_can_be_read():
    assert scene_source(SCENES["ring"]) == READABLE


def test_large_constant_arrays_are_compiled_without_cache(monkeypatch):
    assert "from bseries_base.machine_code import njit" in scene_source(SCENES["chain"])
    monkeypatch.setattr(printer, "MAX_KEPT_DATA", 4)
    assert "from numba import njit" in scene_source(SCENES["chain"])
    module = compiled_scene(SCENES["chain"])
    assert compiled_scene(SCENES["chain"]) is module
    assert module.__name__ not in sys.modules


def test_cached_code_stays():
    assert compiled_scene(SCENES["chain"]).__name__ in sys.modules


PROGRAM = """
import numpy as np
from integrators.compile.scene_source import compiled_scene, scene_source
from integrators.scenes.scene import Scene
from integrators.scenes.model.terms import Term
system = Scene({"p": [3, 2], "q": [3, 2]}, terms=[
    Term(over="each", hamiltonian="(px_i^2 + py_i^2)/(2*m_i)"),
    Term(over="pairs", hamiltonian="m_i*m_j*exp(qx_i - qx_j)/((qx_i - qx_j)^2 + (qy_i - qy_j)^2)^3"),
], parameters={"m": [1, "1/3", 2]})
field = compiled_scene(system).field
field(np.arange(12.0)**1.5, np.empty(12))
print(sum(field.stats.cache_hits.values()), sum(field.stats.cache_misses.values()))
print(scene_source(system))
"""


def test_the_next_process_has_the_same_text_and_machine_code():
    outputs = []
    for seed in "12":
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONWARNINGS": "error::Warning:numba"}
        command = [sys.executable, "-c", PROGRAM]
        run = subprocess.run(command, capture_output=True, text=True, check=True, env=environment, cwd=ROOT)
        outputs.append(run.stdout.split("\n", 1))
    assert [counts for counts, _ in outputs] == ["0 1", "1 0"]
    assert len({source for _, source in outputs}) == 1
