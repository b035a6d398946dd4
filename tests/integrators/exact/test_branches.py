"""Functions that are not smooth: values, derivatives, text, SymPy's own, code, and what refuses them."""

from __future__ import annotations

import io
import pickle
from math import erf

import numpy as np
import pytest
import sympy

import bseries as bs
from integrators.exact.branches import Absolute, Sign, Where
from integrators.exact.expressions import parse_expression
from integrators.scenes.model.formulas import formula_text, read_formula

X, Y = sympy.symbols("x y")
CASES = {
    "abs(x - y)": lambda x, y: abs(x - y),
    "sign(x)*abs(y)": lambda x, y: np.sign(x) * abs(y),
    "heaviside(x)": lambda x, y: np.heaviside(x, 0.5),
    "max(x, y, 1/2)": lambda x, y: max(x, y, 0.5),
    "min(x, y^2)": lambda x, y: min(x, y**2),
    "where(x > y, x, y^3)": lambda x, y: x if x > y else y**3,
    "where(x >= y, 1, 2)": lambda x, y: 1 if x >= y else 2,
    "where(x < 0, 1, 2) + where(x <= 0, 10, 20)": lambda x, y: (1 if x < 0 else 2) + (10 if x <= 0 else 20),
    "where(x > 0, log(x), sqrt(-x))": lambda x, y: np.log(x) if x > 0 else np.sqrt(-x),
    "erf(x*y)": lambda x, y: erf(x * y),
}
POINTS = [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (-1.5, 2.0), (0.3, -0.7), (2.0, 0.5)]


@pytest.mark.parametrize("text", CASES)
def test_compiled_and_precise_values_are_those_of_python(text):
    scene = bs.Scene({"z": ["x", "y"]}, field={"x": text, "y": "0"})
    rate = bs.integrators.right_hand_side(scene)
    for point in POINTS:
        expected = CASES[text](*point)
        assert rate(0.0, point)[0] == pytest.approx(expected, rel=1e-15)
        for module in ("mpmath", "numpy", "math"):
            with np.errstate(all="ignore"):
                found = sympy.lambdify([X, Y], scene.field[0], module)(*point)
            assert float(found) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("text", CASES)
def test_text_is_read_back(text):
    formula = parse_expression(text, names=["x", "y"])
    assert read_formula(formula_text(formula), ["x", "y"], "f") == formula == pickle.loads(pickle.dumps(formula))
    scene = bs.Scene({"z": ["x", "y"]}, field={"x": text, "y": "0"})
    assert bs.load_scene(io.StringIO(scene.to_toml())) == scene
    assert "where" not in sympy.latex(formula)


@pytest.mark.parametrize("text", CASES)
def test_derivatives_are_those_on_either_side(text):
    formula = parse_expression(text, names=["x", "y"])
    for x, y in POINTS[3:]:
        for symbol, step in ((X, (1e-6, 0)), (Y, (0, 1e-6))):
            values = [CASES[text](x + s * step[0], y + s * step[1]) for s in (1, -1)]
            derivative = sympy.lambdify([X, Y], formula.diff(symbol), "math")(x, y)
            assert derivative == pytest.approx((values[0] - values[1]) / 2e-6, abs=1e-8)


def test_normal_forms():
    assert Absolute(-X) == Absolute(X)
    assert (Absolute(-3), Sign(sympy.sqrt(2) - 2), Sign(0), Sign(-X)) == (3, -1, 0, -Sign(X))
    assert (Where(X, Y, Y), Where(-1, X, Y), Where(2, X, Y)) == (Y, Y, X)
    assert Absolute(X**2 - 1).diff(X) == 2 * X * Sign(X**2 - 1)
    assert Where(X, sympy.sqrt(X), 0).diff(X) == Where(X, 1 / (2 * sympy.sqrt(X)), 0)


def test_formulas_of_sympy():
    real = sympy.Symbol("x", real=True)
    pieces = sympy.Piecewise((real, real <= 1), (2, real < 3), (5, True))
    given = sympy.Abs(real) + sympy.Max(real, 2) + pieces + sympy.Heaviside(real) + sympy.sign(real) * sympy.erf(real)
    text = "abs(x) + max(x, 2) + where(x <= 1, x, where(x < 3, 2, 5)) + heaviside(x) + sign(x)*erf(x)"
    found, expected = (sympy.lambdify(X, read_formula(value, ["x"], "f"), "math") for value in (given, text))
    assert [found(x) for x in (-2, 0.5, 1, 2, 3, 7)] == [expected(x) for x in (-2, 0.5, 1, 2, 3, 7)]
    with pytest.raises(bs.IntegratorError, match=r"f must have functions of .* only, but has 'Piecewise'"):
        read_formula(sympy.Piecewise((1, sympy.Eq(real, 1)), (2, True)), ["x"], "f")


def test_only_the_branch_taken_must_be_defined():
    scene = bs.Scene({"y": 1}, field={"y": "where(y > 0, sqrt(y), -y)"}, start={"y": [-1]})
    assert bs.integrate("rk4", scene, h=0.1, steps=10).y[0, -1] == pytest.approx(-np.exp(-1), rel=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("where(x, 1, 2)", "has ',' where '>', '<', '>=' or '<=' is expected"),
        ("where(x = 1, 1, 2)", "has '='"),
        ("where(x > 1, 2)", r"has '\)' where ',' is expected"),
        ("min(x)", r"has '\)' where ',' is expected"),
        ("abs(x, y)", r"has ',' where '\)' is expected"),
        ("x > y", "has '>' where an operator is expected"),
    ],
)
def test_bad_text(text, message):
    with pytest.raises(bs.IntegratorError, match=message):
        parse_expression(text, names=["x", "y"])


BOUNCING = bs.parse_hamiltonian("p^2/2 + abs(q)", start="p=0; q=1")


@pytest.mark.parametrize(
    "request_series",
    [
        lambda: str(bs.modified_field(bs.method("stormer-verlet"), BOUNCING, 3)),
        lambda: bs.modified_field(bs.method("stormer-verlet"), BOUNCING, 3)([0, 1], 0.1),
        lambda: bs.modified_hamiltonian("stormer-verlet", BOUNCING, 3, route="trees").symbolic(2),
        lambda: bs.modified_hamiltonian("stormer-verlet", BOUNCING, 3, route="brackets"),
        lambda: bs.modified_field(bs.method("rk4"), bs.parse_scene("y' = where(y > 1, y, 1)"), 3)([2], 0.1),
    ],
)
def test_series_are_refused_where_the_field_is_not_smooth(request_series):
    with pytest.raises(bs.SeriesError, match=r"field must be smooth for a series, but has .*, whose derivatives jump"):
        request_series()


def test_reference_solutions_are_refused_where_the_field_is_not_smooth():
    with pytest.raises(bs.IntegratorError, match=r"must have a smooth field for a reference solution, but .* has sign"):
        bs.reference_solution(BOUNCING, 1)


def test_runs_across_a_kink():
    energy = bs.integrate("stormer-verlet", BOUNCING, h=0.01, steps=2000, observe="energy").observed["energy"]
    assert 1e-4 < np.ptp(energy) < 0.01
    chain = [bs.Term(over="chain", hamiltonian="where(q_i > q_j, (q_i - q_j)^2, 0)")]
    kinetic = [bs.Term(over="each", hamiltonian="p_i^2/2")]
    start = {"p": [0.0] * 20, "q": list(np.sin(np.arange(20)).round(3))}
    scene = bs.Scene({"p": 20, "q": 20}, terms=[*kinetic, *chain], start=start)
    gap = np.maximum(-np.diff(scene.y0[20:]), 0)
    force = bs.integrators.right_hand_side(scene)(0.0, scene.y0)[:20]
    assert force == pytest.approx(2 * (np.append(0, gap) - np.append(gap, 0)), abs=1e-15)


@pytest.mark.slow
def test_error_functions_are_smooth():
    scene = bs.parse_hamiltonian("p^2/2 + q*erf(q)", start="p=0; q=1")
    H = [bs.modified_hamiltonian("stormer-verlet", scene, 5, route=route) for route in ("trees", "brackets")]
    assert H[0]([0.3, 0.2], 0.1) == pytest.approx(H[1]([0.3, 0.2], 0.1), rel=1e-14)
    field = bs.modified_field(bs.method("rk4"), scene, 5)
    assert field([0.3, 0.2], 0.1) == pytest.approx([float(x) for x in field.at_digits(25)([0.3, 0.2], 0.1)], rel=1e-13)
    run = bs.integrate("gauss6", scene, h=0.02, steps=50).y[:, -1]
    reference = bs.reference_solution(scene, 1)
    assert run == pytest.approx(np.asarray(reference, dtype=float).reshape(2, -1)[:, -1], rel=1e-14)


def test_what_is_undecided_is_no_number():
    for formula in ("sign(log(y))", "heaviside(log(y))", "max(log(y), -5)", "where(log(y) > 0, 1, 2)"):
        scene = bs.parse_scene(f"y' = -1; z' = {formula}", start="y=1/20; z=1")
        with pytest.raises(bs.integrators.StepError, match="did not end in finite numbers"):
            bs.integrate("rk4", scene, h=0.1, steps=3)


def test_hamiltonians_that_jump_are_refused():
    with pytest.raises(bs.IntegratorError, match=r"hamiltonian must be continuous, but has sign\(q\), which jumps"):
        bs.parse_hamiltonian("p^2/2 + heaviside(q)")
    kink = bs.parse_hamiltonian("p^2/2 + abs(q)", start="p=1; q=-1/2")
    with pytest.raises(bs.SeriesError, match="field must be smooth"):
        bs.energy_drift("stormer-verlet", kink, h=0.1)


def test_the_largest_of_many_values_has_a_size_of_their_square():
    scene = bs.scene_from_function(lambda y: [np.max(y)] * 9, range(9))
    assert len(str(scene.field[0])) < 2000
    assert bs.integrate("explicit-euler", scene, h=1, steps=1).y[:, 1].tolist() == [k + 8.0 for k in range(9)]
