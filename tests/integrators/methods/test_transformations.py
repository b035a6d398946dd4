"""Methods made of methods: against steps taken one after another, the laws they obey, and bad input."""

from __future__ import annotations

from fractions import Fraction

import method_definitions as definitions
import power_series_oracle
import pytest
from order_oracle import Tableau, order_of
from power_series_oracle import coefficients, number, plus, run, scaled_fields, times

from integrators import (
    IntegratorError,
    Program,
    Splitting,
    adjoint_method,
    composition,
    extrapolation,
    lie_trotter,
    linear_combination,
    method,
    repeat,
    strang,
    suzuki_fractal,
    triple_jump,
)

CASES = {name: case for name, case in definitions.CASES.items() if name not in ("additive", "kahan")}
SYMMETRIC = {"averaged vector field", "takahashi-imada", "simplified takahashi-imada"}
THIRD = Fraction(1, 3)


@pytest.fixture(autouse=True)
def short_series(monkeypatch):
    """Laws that hold at all orders are tested to a lower one."""
    monkeypatch.setattr(power_series_oracle, "ORDER", 4)


def step(method, fields, y, factor=1):
    """A step of factor · h: what the program does with factor · f."""
    return run(method.program, scaled_fields(fields, factor), y)


def same(first, second):
    return coefficients(first) == coefficients(second)


@pytest.mark.few(5)
@pytest.mark.parametrize("name", CASES)
def test_composition_is_one_step_after_another(name):
    case = CASES[name]
    fields, y = case.fields, definitions.start(case)
    composed = composition([(case.method, THIRD), (case.method, "-1/2")])
    expected = step(case.method, fields, step(case.method, fields, y, THIRD), Fraction(-1, 2))
    assert same(step(composed, fields, y), expected)
    turned = step(case.method, fields, step(case.method, fields, y, Fraction(-1, 2)), THIRD)
    assert not same(expected, turned)


@pytest.mark.few(5)
@pytest.mark.parametrize("name", CASES)
def test_adjoint_undoes_a_step_backwards(name):
    case = CASES[name]
    y = definitions.start(case)
    end = step(adjoint_method(case.method), case.fields, y)
    assert same(step(case.method, case.fields, end, -1), y)
    assert same(end, step(case.method, case.fields, y)) is (name in SYMMETRIC)
    twice = adjoint_method(adjoint_method(case.method))
    assert same(step(twice, case.fields, y), step(case.method, case.fields, y))


@pytest.mark.parametrize("name", ["rk4", "radau-iia2", "stormer-verlet", "lobatto-iiia-iiib2", "gark2", "avf", "tdrk4"])
def test_adjoint_twice_is_the_program_itself(name):
    program = method(name).program
    assert adjoint_method(adjoint_method(program)) == program
    assert adjoint_method(program) != program


@pytest.mark.parametrize("name", ["implicit-midpoint", "avf", "strang", "kahan", "rkn-verlet", "takahashi-imada"])
def test_symmetric_methods_are_their_own_adjoints(name):
    one = method(name)
    fields = {"": definitions.CASES["kahan"].fields[""]}
    if len(one.names) == 2:
        names, second = one.names, definitions.second_order_fields()
        fields = dict(zip(names, second.values(), strict=True))
    y = [number(x) for x in definitions.POINT[: len(fields[one.names[0]])]]
    assert same(step(adjoint_method(one), fields, y), step(one, fields, y))


def test_strang_is_lie_trotter_then_its_adjoint():
    parts = ["a", "b", "c"]
    lie = lie_trotter(parts)
    composed = composition([(lie, "1/2"), (adjoint_method(lie), "1/2")])
    assert isinstance(composed, Splitting)
    assert composed == strang(parts)
    assert composition([(adjoint_method(lie), "1/2"), (lie, "1/2")]) != strang(parts)
    one_by_one = composition([(lie.program, "1/2"), (adjoint_method(lie.program), "1/2")])
    fields = definitions.CASES["splitting"].fields
    y = definitions.start(definitions.CASES["splitting"])
    assert isinstance(one_by_one, Program)
    assert same(step(one_by_one, fields, y), step(strang(parts), fields, y))


def test_composition_is_associative():
    first, second, third = (
        (method(name), Fraction(1, n)) for n, name in enumerate(("rk4", "avf", "rosenbrock-euler"), 2)
    )
    together = composition([first, second, third])
    assert composition([(composition([first, second]), 1), third]).program == together
    assert composition([first, (composition([second, third]), 1)]).program == together
    assert composition([second, first, third]) != together


def test_adjoint_of_a_composition_is_the_composition_of_the_adjoints_backwards():
    steps = [(method("rk4"), THIRD), (method("avf"), "2/3")]
    backwards = [(adjoint_method(one), x) for one, x in reversed(steps)]
    fields, y = {"": definitions.CASES["kahan"].fields[""]}, [number(1), number(2)]
    expected = step(adjoint_method(composition(steps)), fields, y)
    assert same(step(composition(backwards), fields, y), expected)
    assert not same(step(composition(backwards[::-1]), fields, y), expected)


def test_repeated_steps():
    case = definitions.CASES["gark"]
    y = definitions.start(case)
    for _ in range(3):
        y = step(case.method, case.fields, y, THIRD)
    assert same(step(repeat(case.method, 3), case.fields, definitions.start(case)), y)
    assert (
        repeat(strang(), 2).program
        == Splitting([("a", "1/4"), ("b", "1/2"), ("a", "1/2"), ("b", "1/2"), ("a", "1/4")]).program
    )


def test_linear_combination_is_the_mean_of_the_ends():
    weights = [Fraction(2), Fraction(-3, 2), Fraction(1, 2)]
    methods = [method(name) for name in ("rk4", "avf", "tdrk4")]
    fields, y = {"": definitions.CASES["kahan"].fields[""]}, [number(1), number(2)]
    combined = linear_combination(zip(methods, weights, strict=True))
    ends = [times(w, step(one, fields, y)) for one, w in zip(methods, weights, strict=True)]
    assert same(step(combined, fields, y), plus(*ends))


def tableau_order(program):
    """The order of a program of field evaluations, from its tableau."""
    stages = range(len(program.evaluations))
    A = [[e.at.terms.get(j, Fraction(0)) for j in stages] for e in program.evaluations]
    return order_of(Tableau((A, [program.result.terms.get(j, Fraction(0)) for j in stages])), limit=8)


@pytest.mark.parametrize(
    ("name", "order", "steps", "symmetric", "reached"),
    [
        ("explicit-euler", 1, (1, 2), False, 2),
        ("explicit-euler", 1, (1, 2, 3), False, 3),
        ("explicit-euler", 1, (3, 1, 2, 4), False, 4),
        ("heun2", 2, (1, 2), False, 3),
        ("rk4", 4, (1, 2), False, 5),
        ("implicit-midpoint", 2, (1, 2), True, 4),
        ("trapezoidal", 2, (1, 2, 4), True, 6),
        ("heun2", 2, (1, 2, 3), False, 4),
        ("heun2", 2, (1, 2, 3), True, 3),  # it is not symmetric: its error has a term with h³, too
        ("rk4", 3, (1, 2), False, 4),  # the wrong power is removed
    ],
)
def test_extrapolation_raises_the_order(name, order, steps, symmetric, reached):
    assert tableau_order(extrapolation(method(name), order, steps, symmetric=symmetric)) == reached


def test_triple_jump_and_fractal_fractions():
    for composed, count in ((triple_jump(strang(), 2), 1), (suzuki_fractal(strang(), 2), 2)):
        gamma = composed.flows[1][1]  # pyright: ignore[reportAttributeAccessIssue]
        rest = 1 - 2 * count * gamma
        assert abs(2 * count * gamma**3 + rest**3).evalf(30) < 1e-25
        assert not composed.issues
    assert float(gamma) == pytest.approx(1 / (4 - 4 ** (1 / 3)))


def test_digits_and_names_are_passed_on():
    assert composition([(method("rk4"), "1/2"), (method("tsit5"), "1/2")]).digits == method("tsit5").digits
    assert adjoint_method(method("blanes-moan4")).digits == 15
    assert repeat(method("rk4"), 2).name == "2 steps of rk4"
    assert composition([(method("rk4"), 1)], name="mine").name == "mine"
    assert adjoint_method(method("rk4")).name == "adjoint of rk4"


def test_parts_are_matched_by_name():
    forth, back = lie_trotter(["a", "b"]), lie_trotter(["b", "a"])
    assert composition([(forth, "1/2"), (back, "1/2")]) == strang(["a", "b"])
    as_program = composition([(forth.program, "1/2"), (back.program, "1/2")])
    fields = {name: definitions.CASES["splitting"].fields[name] for name in "ab"}
    y = definitions.start(definitions.CASES["splitting"])
    assert same(step(as_program, fields, y), step(strang(["a", "b"]), fields, y))


RK4 = method("rk4")


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: composition([]), "steps must have at least one pair, but was empty"),
        (lambda: composition(RK4), "steps must be a sequence, but was <RungeKutta rk4"),
        (lambda: composition([RK4]), r"steps\[1\] must be a method and its fraction, but was <RungeKutta rk4"),
        (lambda: composition([("rk4", 1)]), r"steps\[1\] must be a method, but was 'rk4'"),
        (lambda: composition([(RK4, "half")]), r"fraction of steps\[1\] must be a formula, but 'half' has"),
        (
            lambda: composition([(RK4, 1), (strang(), 1)]),
            "steps must be methods with the same parts, but rk4 has no parts and strang has a, b",
        ),
        (lambda: composition([(strang(), 1), (strang(["p", "q"]), 1)]), "strang has a, b and strang has p, q"),
        (lambda: linear_combination([(RK4, 1), (RK4, 1)]), "terms must have weights that sum to 1, but they sum to 2"),
        (lambda: adjoint_method("rk4"), "method must be a method, but was 'rk4'"),
        (lambda: repeat(RK4, 0), "count must be an integer from 1 to 1000, but was 0"),
        (lambda: repeat("rk4", 2), "method must be a method, but was 'rk4'"),
        (lambda: extrapolation(RK4, 4, [1, 1]), r"steps must be different numbers, but were \[1, 1\]"),
        (lambda: extrapolation(RK4, 4, []), r"steps must be different numbers, but were \[\]"),
        (lambda: extrapolation(RK4, 4, [1, "2"]), r"steps\[2\] must be an integer from 1 to 1000, but was '2'"),
        (lambda: extrapolation(RK4, True), "order must be an integer from 1 to 1000, but was True"),
        (lambda: triple_jump(strang(), 3), "order must be an even number from 2 to 30, but was 3"),
        (lambda: suzuki_fractal("strang", 2), r"steps\[1\] must be a method, but was 'strang'"),
    ],
)
def test_bad_input(build, message):
    with pytest.raises(IntegratorError, match=message):
        build()
