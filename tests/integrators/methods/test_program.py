"""Programs: how they are written down, what they know about themselves, and what is refused."""

from __future__ import annotations

import pickle
from fractions import Fraction

import numpy as np
import pytest
import sympy
from method_definitions import POINT, runge_kutta
from power_series_oracle import coefficients, number, random_field, run

from integrators import IntegratorError, Program, ProgramBuilder, RungeKutta, method
from integrators.methods.programs.evaluations import LinearForm
from integrators.methods.programs.program import Field


def test_forms_are_computed_exactly():
    builder = ProgramBuilder()
    y, (k1, k2) = builder.y, builder.unknowns(2)
    form = y + k1 / 3 - 2 * k2 + k1 * "1/6" - k1 / 2 + k2 * sympy.sqrt(2)
    assert form == LinearForm(1, {1: sympy.sqrt(2) - 2})
    assert hash(form) == hash(LinearForm(1, {1: sympy.sqrt(2) - 2}))
    assert str(y - k1 + k2 / 2) == "y - k1 + 1/2*k2"
    assert str(k2 * "1/2 - sqrt(3)/6") == "(1/2 - sqrt(3)/6)*k2"
    assert str(y - y) == "0"
    assert sum([k1, k2]) == k1 + k2


@pytest.mark.parametrize(
    ("compute", "message"),
    [
        (lambda k: k * k, "number must be a number, but was a linear form: only the field is nonlinear"),
        (lambda k: k / 0, "number must not be zero to divide by"),
        (lambda k: k * "x", "number must be a formula, but 'x' has the unknown name 'x'"),
        (lambda k: k * float("nan"), "number must be a finite number, but was nan"),
        (lambda k: LinearForm(0, {0: None}), "coefficient of k1 must be a real number or a formula, but was None"),
    ],
)
def test_forms_refuse(compute, message):
    with pytest.raises(IntegratorError, match=message):
        compute(LinearForm(0, {0: 1}))


@pytest.mark.parametrize("compute", [lambda k: k + 1, lambda k: 1 + k, lambda k: k - "k"])
def test_forms_are_added_to_forms_only(compute):
    with pytest.raises(TypeError, match="unsupported operand"):
        compute(LinearForm(0, {0: 1}))


TEXT = """\
k1 = h f_a(y)
k2 = h f_b'(y + k1) (1/2*k1)
k3 = z(1) - z(0), z' = 2/3 h f_b(z) + (k1) + θ (k2), z(0) = y
k4 = ∫ θ^2 h f_a(y + θ (k1) + θ^2 (k2)) dθ
k5 = h f(y)
y1 = y + k1 - 1/2*k4"""


def everything(**labels):
    builder = ProgramBuilder(["a", "b"])
    y = builder.y
    k1 = builder.field(y, "a")
    k2 = builder.derivative(y + k1, k1 / 2, "b")
    builder.flow(y, "b", time="2/3", forcing=[k1, k2])
    k4 = builder.average([y, k1, k2], "a", power=2)
    builder.field(y)
    return builder.program(y + k1 - k4 / 2, **labels)


def test_a_program_shows_its_formulas():
    program = everything(name="all", reference="nowhere")
    assert str(program) == TEXT
    assert (program.name, program.reference, program.names, program.stages) == ("all", "nowhere", ("a", "b"), 5)
    assert repr(program) == "<Program all: 5 evaluations>"
    assert program.program is program
    assert program.is_explicit
    assert (program.domain, program.parameters, program.digits, program.precision) == ("QQ", (), None, 0)
    assert "z' = (1 - gamma) h f(z)" in str(_flow("1-gamma"))


def _flow(time):
    builder = ProgramBuilder()
    gamma = sympy.Symbol("gamma")
    k = builder.flow(builder.y, time=1 - gamma if time == "1-gamma" else time)
    return builder.program(builder.y + k)


def test_programs_are_frozen_values():
    program = everything()
    assert program == everything(name="other")
    assert pickle.loads(pickle.dumps(program)) == program
    assert hash(program) == hash(everything())
    assert program != everything(digits=5)
    with pytest.raises(AttributeError, match="Program is immutable"):
        program.result = program.result


def test_floats_are_no_exact_numbers():
    builder = ProgramBuilder()
    k = builder.field(builder.y)
    exact, rounded = builder.program(builder.y + k * Fraction(1, 2)), builder.program(builder.y + k * 0.5)
    assert exact != rounded
    assert (exact.domain, rounded.domain) == ("QQ", "float")


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        (None, None),
        (2, ((None, None, 2), (None, None, 2))),
        ([[1, 1, 1], [None, None, None]], ((1, 1, 1), (None, None))),
        (((0, None), (1, 0)), ((0, None), (1, 0))),
        (np.array([[0, 3], [1, 0]]), ((0, 3), (1, 0))),
        ([[2.0, float("inf")], np.array([1, 0, 1])], ((2, None), (1, 0, 1))),
        ([[None, None], [None, float("inf"), None]], None),
    ],
)
def test_a_program_knows_which_trees_it_is_meant_for(given, kept):
    program = everything(name="all", max_children=given)
    assert program.max_children == kept
    assert all(isinstance(bound, int | None) for row in kept or () for bound in row)
    assert (program == everything()) == (kept is None)
    assert program == everything().restricted(given)
    assert hash(program) == hash(everything(max_children=kept))
    assert program.restricted(None) == everything()
    shown = "" if kept is None else f", max_children={kept}"
    assert repr(program) == f"<Program all: 5 evaluations{shown}>"
    assert pickle.loads(pickle.dumps(program)).max_children == kept
    labels = ("name", "reference", "digits", "names", "auxiliary")
    labelled = everything(name="all", reference="nowhere", digits=7)
    again = labelled.restricted(given)
    assert [getattr(labelled, label) for label in labels] == [getattr(again, label) for label in labels]


@pytest.mark.parametrize(
    "bounds",
    [
        -1, True, "2", 1.5, float("nan"), [], [[0, 1]], [[0, 1], [0]], [[0, 1, 2, 3], [0, 1]], [0, 1], ["01", "10"],
        [[0, -1], [0, 1]], [["0", 1], [0, 1]], [[0, True], [1, 0]], [[[0, 1], 1], [0, 1]], {"a": 1}, sympy.Symbol("x"),
    ],
    ids=str,
)  # fmt: skip
def test_bounds_on_children_are_refused(bounds):
    message = r"^max_children must be one bound or 2 rows of 2 or 3 bounds, each a whole number, .*, but was .{1,70}$"
    for build in (lambda: everything(max_children=bounds), lambda: everything().restricted(bounds)):
        with pytest.raises(IntegratorError, match=message):
            build()


def test_weights_of_constant_fields():
    program = everything()
    assert program.weight_sums == (1 - Fraction(1, 6), 0)
    assert program.issues == (
        "weights of part a sum to 5/6, not 1: the method is inconsistent",
        "weights of part b sum to 0, not 1: the method is inconsistent",
    )
    assert _flow(1).issues == ()
    assert _flow("1-gamma").issues == (
        "weights of the evaluations sum to 1 - gamma, not 1: the method is inconsistent",
    )


def test_forcing_counts_for_what_a_constant_field_does():
    builder = ProgramBuilder(["slow", "fast"])
    k = builder.field(builder.y, "slow")
    z = builder.flow(builder.y, "fast", forcing=[k / 2, k])
    assert builder.program(builder.y + z).weight_sums == (1, 1)


def test_auxiliary_parts_must_not_count():
    builder = ProgramBuilder(["f", "W"], auxiliary=["W"])
    k = builder.field(builder.y, "f")
    assert builder.program(builder.y + k).issues == ()
    w = builder.field(builder.y, "W")
    (issue,) = builder.program(builder.y + k + w).issues
    assert issue == "weights of part W sum to 1, not 0: the method is inconsistent"
    with pytest.raises(IntegratorError, match="part must be one of f, W, but was None"):
        builder.field(builder.y)


def test_rounding_is_no_issue():
    builder = ProgramBuilder()
    k = [builder.field(builder.y) for _ in range(10)]
    assert builder.program(builder.y + sum(x * 0.1 for x in k)).issues == ()
    thirds = builder.y + sum(x * Fraction("0.3333") for x in k[:3])
    assert builder.program(thirds).issues != ()
    assert builder.program(thirds, digits=4).issues == ()


def test_implicit_programs_are_no_explicit_ones():
    builder = ProgramBuilder()
    (k,) = builder.unknowns(1)
    builder.field(builder.y + k, into=k)
    assert not builder.program(builder.y + k).is_explicit


@pytest.mark.parametrize("name", ["rk4", "radau-iia2", "lobatto-iiic3", "kahan", "tsit5"])
def test_program_of_a_tableau_makes_its_step(name):
    tableau, field, y = method(name), random_field(3), [number(x) for x in POINT[:2]]
    expected = runge_kutta(tableau.A, tableau.b, field, y)
    assert coefficients(run(tableau.program, {"": field}, y)) == coefficients(expected)
    assert tableau.program.is_explicit is tableau.is_explicit
    assert (tableau.program.name, tableau.program.digits) == (tableau.name, tableau.digits)


@pytest.mark.parametrize("name", ["gauss3", "radau-iia4", "sdirk2", "crouzeix3", "crouzeix4"])
def test_program_of_a_tableau_with_roots_or_symbols_has_its_entries(name):
    tableau = method(name)
    stages = range(tableau.stages)
    found = [[e.at.terms.get(j, 0) for j in stages] for e in tableau.program.evaluations]
    difference = [
        sympy.N(x - y) for row, other in zip(found, tableau.A, strict=True) for x, y in zip(row, other, strict=True)
    ]
    assert not any(difference)
    assert tableau.program.domain == tableau.domain


@pytest.mark.parametrize("name", ["stormer-verlet", "symplectic-euler-p", "lobatto-iiia-iiib3"])
def test_program_of_a_partitioned_method(name):
    program = method(name).program
    assert program.names == ("p", "q")
    assert program.stages == 2 * method(name).stages
    assert all(isinstance(evaluation, Field) for evaluation in program.evaluations)


def builder(*parts):
    return ProgramBuilder(parts)


def k(number=1):
    return LinearForm(0, {number - 1: 1})


Y = LinearForm(1)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: ProgramBuilder("ab"), "parts must be a sequence of names, but was 'ab'"),
        (lambda: builder("a", "a"), "parts must have different names, but were a, a"),
        (lambda: builder("τ"), "names of partitions must start with a letter"),
        (lambda: ProgramBuilder(["a"], auxiliary=["b"]), "auxiliary must name parts, but 'b' is none"),
        (lambda: builder("a", "b").field(Y, "c"), "part must be one of a, b, but was 'c'"),
        (lambda: builder().field(Y, "c"), "part must be one of None, as there is only one, but was 'c'"),
        (lambda: builder().field(k()), r"at must be a point, y plus evaluations, but was k1"),
        (lambda: builder().field(2), "at must be a point, y plus evaluations, but was 2"),
        (lambda: builder().derivative(Y, Y), "along must be a vector, evaluations without y, but was y"),
        (lambda: builder().flow(Y, time="x"), "time must be a formula, but 'x' has"),
        (lambda: builder().flow(Y, forcing=[Y]), "forcing must be a vector, evaluations without y, but was y"),
        (lambda: builder().average([]), "path must be a sequence that holds at least its start, but was"),
        (lambda: builder().average([Y, Y]), r"path\[1\] must be a vector, evaluations without y, but was y"),
        (lambda: builder().average([Y], power=-1), "power must be 0, 1, 2, …, but was -1"),
        (lambda: builder().field(Y, into=k()), "into must be one of the unknowns, not yet defined, but was k1"),
        (lambda: builder().program(Y + k()), "evaluations must all be defined, but k1 is not"),
        (lambda: builder().program(k()), "result must be a point, y plus evaluations, but was k1"),
        (lambda: builder().program(Y, name=3), "name must be text, but was 3"),
        (lambda: builder().program(Y, digits="3"), "digits must be an integer from 1 to 1000, but was '3'"),
        (lambda: Program([Field(0, Y + k(2))], Y), "evaluations must all be defined, but k2 is not"),
        (lambda: builder().program(Y, max_children=[1] * 99), "1 row of 1 or 2 bounds, each .* but was .{55,62}$"),
    ],
)
def test_refusals(build, message):
    with pytest.raises(IntegratorError, match=message):
        build()


def test_unknowns_must_be_defined_once():
    one = ProgramBuilder()
    unknown, other = one.unknowns(2)
    one.field(Y, into=unknown)
    with pytest.raises(IntegratorError, match="into must be one of the unknowns, not yet defined, but was k1"):
        one.field(Y, into=unknown)
    with pytest.raises(IntegratorError, match="evaluations must all be defined, but k2 is not"):
        one.program(Y + other)


def test_forcing_must_not_depend_on_its_own_flow():
    one = ProgramBuilder()
    unknown, other = one.unknowns(2)
    one.flow(Y, forcing=[other], into=unknown)
    one.flow(Y, forcing=[unknown], into=other)
    with pytest.raises(
        IntegratorError, match="forcing must not depend on the flow that it drives, but that of k1 does"
    ):
        one.program(Y + other)


@pytest.mark.parametrize(
    "end",
    [
        lambda k1, k2, x: Y + k1 * 0.5 + k2 * x,
        lambda k1, k2, x: Y + k1 * 0.5 + k1 * x,
        lambda k1, k2, x: Y + k1 * x * 0.5,
    ],
)
def test_floats_and_symbols_do_not_mix(end):
    one = builder()
    k1, k2 = one.field(Y), one.field(Y)
    with pytest.raises(IntegratorError, match="coefficients must not mix floats and symbols"):
        one.program(end(k1, k2, sympy.Symbol("x")))


def test_floats_and_roots_make_floats():
    one = builder()
    program = one.program(Y + one.field(Y) * sympy.sqrt(2) * 0.5)
    assert program.domain == "float"
    assert all(isinstance(x, float | Fraction) for x in program.result.entries)


def test_a_tableau_of_floats_gives_a_program_of_floats():
    assert RungeKutta([[0, 0], [0.5, 0]], [0, 1]).program.domain == "float"
