"""Low-storage and Shu–Osher forms: tableaus against the data, by matrices and by steps; conversions and refusals."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest
import sympy

from integrators import IntegratorError, RungeKutta, Scene, TableauWarning, Term, method, scene, stepper
from integrators.methods import to_2n
from integrators.methods.catalogue.low_storage import METHODS
from integrators.methods.kinds.files import dumps_method, loads_method

WILLIAMSON = [0, "-5/9", "-153/128"], ["1/3", "15/16", "8/15"]
ALPHA = [[0, 0, 0], [1, 0, 0], ["3/4", "1/4", 0], ["1/3", 0, "2/3"]]
BETA = [[0, 0, 0], [1, 0, 0], [0, "1/4", 0], [0, 0, "2/3"]]
FORMS = [entry.name for entry in METHODS]


CONSTRUCTORS = {
    "2N": RungeKutta.from_2n,
    "2R": RungeKutta.from_2r,
    "3S*": RungeKutta.from_3s_star,
    "Shu-Osher": RungeKutta.from_shu_osher,
}


def numbers(text):
    """Rows of fractions from text."""
    return tuple(tuple(map(Fraction, row.split())) for row in text.split(";"))


def random_rows(rows, columns, seed):
    chosen = random.Random(seed)
    return [[Fraction(chosen.randint(-9, 9), chosen.randint(1, 9)) for _ in range(columns)] for _ in range(rows)]


@pytest.mark.parametrize(("found", "name", "rows"), [
    (RungeKutta.from_2n(*WILLIAMSON), "williamson3", "0 0 0; 1/3 0 0; -3/16 15/16 0; 1/6 3/10 8/15; 0 1/3 3/4"),
    (RungeKutta.from_shu_osher(ALPHA, BETA), "ssprk33", "0 0 0; 1 0 0; 1/4 1/4 0; 1/6 1/6 2/3; 0 1 1/2"),
])  # fmt: skip
def test_tableaus_are_the_published_ones(found, name, rows):
    *A, b, c = numbers(rows)
    assert (found.A, found.b, found.c, found.domain) == (tuple(A), b, c, "QQ")
    assert found == method(name)
    assert found.form == method(name).form


def test_2n_by_hand():
    a, b1, b2 = sympy.symbols("a b1 b2")
    found = RungeKutta.from_2n([0, "a"], ["b1", "b2"], parameters=["a", "b1", "b2"], warn=False)
    assert found.A[1][0] == b1
    assert found.b == (b1 + a * b2, b2)


def test_2r_by_definition():
    below, weights = random_rows(2, 5, seed=1)
    found = RungeKutta.from_2r(below[:4], weights, warn=False)
    for i in range(5):
        assert found.A[i] == tuple(weights[j] if j < i - 1 else below[j] if j == i - 1 else 0 for j in range(5))
    assert found.b == tuple(weights)


def test_shu_osher_by_the_inverse_of_a_matrix():
    """The rows of the tableau are (I - α)⁻¹ β; rows of α that do not sum to 1 leave the rest to y_n."""
    given = (random_rows(6, 5, seed) for seed in (2, 3))
    alpha, beta = ([[x * (j < i) for j, x in enumerate(row)] for i, row in enumerate(rows)] for rows in given)
    square = sympy.Matrix(6, 6, lambda i, j: sympy.Rational(alpha[i][j]) if j < 5 else 0)
    expected = (sympy.eye(6) - square).inv() * sympy.Matrix(6, 5, lambda i, j: sympy.Rational(beta[i][j]))
    found = RungeKutta.from_shu_osher(alpha, beta, warn=False)
    assert [[sympy.Rational(x) for x in row] for row in (*found.A, found.b)] == expected.tolist()
    beta[4][2] += 1
    assert RungeKutta.from_shu_osher(alpha, beta, warn=False) != found


def test_3s_star_step_by_definition():
    """The registers run literally on y' = f(y) with symbols for the slopes."""
    made = method("ssprk104").form.coefficients
    slopes, y = sympy.symbols("k1:11"), sympy.Symbol("y")
    first, second = y, sympy.Integer(0)
    for k, row, b, d in zip(slopes, made["gamma"], made["beta"], made["delta"], strict=True):
        g, b, d = [sympy.Rational(x) for x in row], sympy.Rational(b), sympy.Rational(d)
        second += d * first
        first = sympy.expand(g[0] * first + g[1] * second + g[2] * y + b * k)
    tableau = RungeKutta.from_3s_star(**made)
    assert first - y == sum(sympy.Rational(x) * k for x, k in zip(tableau.b, slopes, strict=True))
    printed = [[Fraction(1, 6) if j >= 5 * (i > 4) else Fraction(1, 15) for j in range(i)] for i in range(10)]
    assert [[x for x in row if x] for row in tableau.A] == printed
    assert tableau.b == (Fraction(1, 10),) * 10


@pytest.mark.parametrize(("kind", "changes"), [
    ("2N", {"A": [0, "-5/9", "-1"], "B": ["1/3", "15/16", "7/15"]}),
    ("2R", {"a": ["1/2", "2/3"], "b": ["1/4", "1/4", "3/4"]}),
    ("3S*", {"beta": [1, "1/3"], "gamma": [[1, 0, 0], ["1/3", 0, "2/3"]]}),
    ("Shu-Osher", {"alpha": [*ALPHA[:3], ["1/2", 0, "1/2"]], "beta": [*BETA[:3], [0, "1/7", "2/3"]]}),
])  # fmt: skip
def test_a_changed_coefficient_changes_the_tableau_and_the_file(kind, changes):
    given = {
        "2N": dict(zip("AB", WILLIAMSON, strict=True)),
        "2R": {"a": ["1/2", "3/4"], "b": ["1/4", 0, "3/4"]},
        "3S*": {"gamma": [[1, 0, 0], ["1/2", 0, "1/2"]], "beta": [1, "1/2"], "delta": [1, 0]},
        "Shu-Osher": {"alpha": ALPHA, "beta": BETA},
    }[kind]
    found = CONSTRUCTORS[kind](**given, warn=False)
    for name, changed in changes.items():
        other = CONSTRUCTORS[kind](**given | {name: changed}, warn=False)
        assert other != found
        assert other.form != found.form
        assert dumps_method(other, "json") != dumps_method(found, "json")


def test_floats_and_roots_stay_in_their_domain():
    assert RungeKutta.from_2n([0, -5 / 9, -153 / 128], [1 / 3, 15 / 16, 8 / 15]).domain == "float"
    root = RungeKutta.from_2n([0, "sqrt(2) - 2"], ["sqrt(2)/2", "sqrt(2)/2"], warn=False)
    assert root.domain == "algebraic"
    assert root.b == (sympy.expand("sqrt(2)/2*(sqrt(2) - 1)"), sympy.sqrt(2) / 2)
    A, B = to_2n(root)
    assert RungeKutta.from_2n(A, B, warn=False) == root


# Williamson's conditions


@pytest.mark.parametrize("name", [entry.name for entry in METHODS if method(entry.name).form.kind == "2N"])
def test_2n_methods_come_back(name):
    made = method(name)
    A, B = to_2n(made)
    tolerance = Fraction(1000, 10**made.digits) if made.digits else 0
    for found, given in ((A, made.form.coefficients["A"]), (B, made.form.coefficients["B"])):
        assert all(abs(x - y) <= tolerance * max(1, abs(y)) for x, y in zip(found, given, strict=True))


@pytest.mark.parametrize(("made", "condition"), [
    ("rk4", r"Williamson's conditions .* for i = 3, j = 1 the left side was 0 and the right 1/2"),
    ("ssprk33", "for i = 3, j = 1 the left side was -1/12 and the right 1/4"),
    ("tsit5", "i = 3, j = 1"),
    ("nystrom5", "i = 3, j = 1"),
    ("gauss2", "an explicit RungeKutta"),
    ("strang", "an explicit RungeKutta"),
])  # fmt: skip
def test_other_methods_are_refused_with_the_condition_that_fails(made, condition):
    with pytest.raises(IntegratorError, match=condition):
        to_2n(method(made))


def test_every_method_of_two_stages_is_2n_unless_a_stage_has_no_weight():
    idle = RungeKutta([[0, 0, 0], [0, 0, 0], [0, 1, 0]], [0, 0, 1])
    with pytest.raises(IntegratorError, match=r"B_1 = a_\(2,1\) other than 0 for a 2N form, but it was 0"):
        to_2n(idle)
    with pytest.raises(IntegratorError, match="B_2 = b_2 other than 0 for a 2N form, but it was 0"):
        to_2n(RungeKutta([[0, 0], ["1/2", 0]], [1, 0]))
    for name in ("heun2", "ralston2", "explicit-midpoint"):
        A, B = to_2n(method(name))
        assert RungeKutta.from_2n(A, B) == method(name)


# The form is kept


@pytest.mark.parametrize("format", ["json", "toml"])
@pytest.mark.parametrize("made", [
    *map(method, FORMS),
    RungeKutta.from_2n([0, -0.5], [0.5, 1.0], warn=False),
    RungeKutta.from_2n([0, "-1/(2*a)"], ["1/2", "a"], parameters=["a"], warn=False),
], ids=lambda made: f"{made.name}-{made.domain}" if isinstance(made, RungeKutta) else None)  # fmt: skip
def test_files_hold_the_form(made, format):
    found = loads_method(dumps_method(made, format), format, warn=False)
    assert (found, found.form, found.domain, found.digits) == (made, made.form, made.domain, made.digits)


def test_values_for_symbols_keep_the_form_and_other_digits_do_not():
    family = RungeKutta.from_2n([0, "-1/(2*a)"], ["1/2", "a"], parameters=["a"], warn=False)
    assert family.substitute({"a": "3/4"}).form.coefficients["A"] == (0, Fraction(-2, 3))
    assert method("berland64").form.digits == 12
    assert method("berland64").with_digits(9).form is None  # with other digits its coefficients need not fit together
    assert method("williamson3").to_float().form is None  # its entries are rounded, not those of a rounded form
    with pytest.raises(AttributeError, match="immutable"):
        family.form = None


@pytest.mark.parametrize(("text", "message"), [
    ('{"kind": "4N"}', "form.kind must be one of 2N, 2R, 3S*, Shu-Osher, but was '4N'"),
    ('{"kind": ["2N"]}', "form.kind must be one of"),
    ("3", "form.kind must be one of"),
    ('{"kind": "2N", "A": [0]}', "form must have the keys A, B besides kind, but had A"),
    ('{"kind": "2N", "A": [1], "B": [1]}', "A[1] must be 0, since no slope is known before the first, but was 1"),
    ('{"kind": "2N", "A": [0], "B": [1, 2]}', "B must have 1 entry, but has 2"),
    ('{"kind": "2N", "A": [], "B": []}', "A must have 1 entry, but has 0"),
    ('{"kind": "2N", "A": 3, "B": [1]}', "A must be a sequence, but was 3"),
    ('{"kind": "2N", "A": ["x"], "B": [1]}', "unknown name 'x'"),
    ('{"kind": "2R", "a": [1], "b": [1]}', "a must have 0 entries, but has 1"),
    ('{"kind": "Shu-Osher", "alpha": [[0]], "beta": [[0]]}', "alpha must have 2 rows, but has 1"),
    ('{"kind": "Shu-Osher", "alpha": [[0], [1]], "beta": [[1], [1]]}', "beta[1][1] must be 0 in an explicit method"),
    ('{"kind": "3S*", "gamma": [[1, 0, 1]], "beta": [1], "delta": [0]}', "that of the result was 2"),
    ('{"kind": "3S*", "gamma": [[0, 0, 0], [1, 0, 0]], "beta": [0, 1], "delta": [0, 0]}', "one stage was zero"),
    ('{"kind": "3S*", "gamma": [1], "beta": [1], "delta": [0]}', "gamma[1] must be a sequence, but was 1"),
])  # fmt: skip
def test_bad_forms_are_refused_in_one_sentence(text, message):
    with pytest.raises(IntegratorError) as error:
        loads_method(f'{{"form": {text}}}', "json")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


# Steps


def arrays(source):
    """The vectors that a generated step holds."""
    (text,) = source.split("def advance")[1:]
    return [line.split(" = ")[0].strip() for line in text.splitlines() if " = stack(" in line or " = shifted(w" in line]


REGISTERS = {"2N": 2, "2R": 2, "3S*": 3}


@pytest.mark.parametrize("name", FORMS)
def test_generated_steps_hold_as_many_vectors_as_the_form(name):
    made = method(name)
    compiled = stepper(made, scene("double-pendulum"), compensated=False)
    assert len(arrays(compiled.source)) == made.form.registers
    assert made.form.registers == REGISTERS.get(made.form.kind, made.form.registers)
    tableau = RungeKutta(made.A, made.b, digits=made.digits, warn=False)
    assert len(arrays(stepper(tableau, scene("double-pendulum"), compensated=False).source)) == 3 + made.stages


def test_sums_over_particles_need_one_vector_more_where_a_slope_replaces_its_point():
    for name, count in (("williamson3", 2), ("kennedy43", 3), ("ssprk104", 4)):
        assert len(arrays(stepper(name, scene("lennard-jones"), compensated=False).source)) == count


def test_increments_are_compensated_and_other_forms_say_so_by_having_no_carry():
    for name, compensates in (("williamson3", True), ("kennedy43", True), ("ssprk104", False), ("ssprk33", False)):
        compiled = stepper(name, scene("pendulum"))
        assert ("e" in arrays(compiled.source)) is compensates
        state = compiled.start([0.4, 1.1], h=0.1)
        compiled.advance(state, 10)
        assert bool(np.abs(state.carry).max() > 0) is compensates


@pytest.mark.parametrize("where", ["kepler", "lennard-jones", "lorenz"])
@pytest.mark.parametrize("name", ["williamson3", "kennedy43", "parsani53", "ssprk33", "ssprk54", "ssprk104"])
def test_steps_are_those_of_the_tableau_up_to_rounding(name, where):
    made = method(name)
    tableau = RungeKutta(made.A, made.b, digits=made.digits, name="tableau", warn=False)
    ends = []
    for given in (made, tableau):
        compiled = stepper(given, scene(where))
        state = compiled.start(h=0.01)
        compiled.advance(state, 10)
        ends.append(state.y)
    assert np.abs(ends[0] - ends[1]).max() < 1e-13 * np.abs(ends[1]).max()
    assert stepper(made, scene(where)) is not stepper(tableau, scene(where))  # though the methods are equal


def random_forms(stages, seed):
    """One method of each kind with random coefficients, whose slopes and stages are used again in any later stage."""
    (below, b, beta, d, A), gamma = random_rows(5, stages, seed), random_rows(stages, 2, seed + 1)
    second, rows = Fraction(0), []
    for i in range(stages):
        second += d[i]
        first, middle = gamma[i]
        rows.append([first, middle, 1 - first - middle * second])
    lower = (random_rows(stages + 1, stages, seed + k) for k in (2, 3))
    alpha, shu_osher = ([[x * (j < i) for j, x in enumerate(row)] for i, row in enumerate(part)] for part in lower)
    return [
        RungeKutta.from_2n([0, *A[1:]], b, warn=False),
        RungeKutta.from_2r(below[1:], b, warn=False),
        RungeKutta.from_3s_star(rows, beta, d, warn=False),
        RungeKutta.from_shu_osher(alpha, shu_osher, warn=False),
    ]


@pytest.mark.few(2)
@pytest.mark.parametrize("where", ["lorenz", "lennard-jones"])
@pytest.mark.parametrize("seed", range(4))
def test_random_forms_step_as_their_tableaus(seed, where):
    for made in random_forms(3 + seed % 2, 10 * seed):
        tableau = RungeKutta(made.A, made.b, name="tableau", warn=False)
        ends = []
        for given in (made, tableau):
            compiled = stepper(given, scene(where), compensated=seed % 2 == 0)
            state = compiled.start(h=1e-4)
            compiled.advance(state, 2)
            ends.append(state.y)
        assert np.abs(ends[0] - ends[1]).max() < 1e-12 * np.abs(ends[1]).max()


def registers_by_numpy(made, f, y, h):
    """A step of the form 3S*, as its definition says."""
    given = made.form.coefficients
    g = [[float(x) for x in row] for row in given["gamma"]]
    b, d = ([float(x) for x in given[key]] for key in ("beta", "delta"))
    first, second = y.copy(), np.zeros_like(y)
    for (one, two, three), beta, delta in zip(g, b, d, strict=True):
        second = second + delta * first
        first = one * first + two * second + three * y + beta * h * f(first)
    return first


def test_3s_star_steps_are_those_of_the_registers_and_a_changed_coefficient_is_seen():
    made = method("parsani53")

    def f(y):
        return np.array([-np.sin(y[1]), y[0]])

    compiled = stepper(made, scene("pendulum"))
    state = compiled.start([0.4, 1.1], h=0.125)
    compiled.advance(state, 1)
    expected = registers_by_numpy(made, f, np.array([0.4, 1.1]), 0.125)
    assert np.abs(state.y - expected).max() < 1e-14
    given = made.form.coefficients
    other = {**given, "beta": [Fraction(1, 3), *given["beta"][1:]]}
    changed = RungeKutta.from_3s_star(**other, digits=16, warn=False)
    assert np.abs(registers_by_numpy(changed, f, np.array([0.4, 1.1]), 0.125) - expected).max() > 1e-4


def test_variables_that_the_field_leaves_alone_stay_as_they_are():
    still = Scene({"y": ["u", "v"]}, terms=[Term(field={"u": "v - u", "v": "0"})], name="still")
    for name in ("ssprk104", "ssprk33", "kennedy43", "parsani53"):
        compiled = stepper(name, still)
        state = compiled.start([3, 2], h=0.25)
        compiled.advance(state, 4)
        assert state.y[1] == pytest.approx(2, abs=1e-14)
        assert abs(state.y[0] - 2 - np.exp(-1)) < 1e-2


def test_a_stage_that_changes_nothing_and_a_last_update_of_zero():
    made = RungeKutta.from_2n([0, 0], [1, 0], warn=False)
    compiled = stepper(made, scene("lorenz"), compensated=False)
    euler = stepper("explicit-euler", scene("lorenz"), compensated=False)
    states = [each.start(h=0.01) for each in (compiled, euler)]
    for each, state in zip((compiled, euler), states, strict=True):
        each.advance(state, 5)
    assert np.array_equal(states[0].y, states[1].y)


def test_a_warning_of_an_inconsistent_form():
    with pytest.warns(TableauWarning, match="weights b sum to 1/2"):
        RungeKutta.from_2n([0], ["1/2"])
