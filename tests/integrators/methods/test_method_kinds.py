"""Every kind of method: its program against the step as its source defines it, equivalent methods, and bad input."""

from __future__ import annotations

import pickle
from fractions import Fraction

import method_definitions as definitions
import pytest
import sympy
from power_series_oracle import add, coefficients, number, run

from integrators import (
    ContinuousStageRungeKutta,
    GeneralizedAdditiveRungeKutta,
    IntegratorError,
    LawsonMethod,
    PartitionedRungeKutta,
    Rosenbrock,
    RungeKutta,
    RungeKuttaNystrom,
    Splitting,
    TakahashiImada,
    TwoDerivativeRungeKutta,
    WMethod,
    lie_trotter,
    method,
    save_method,
    strang,
)

CASES = definitions.CASES
HALF = Fraction(1, 2)


def step(method, fields):
    dimension = len(next(iter(fields.values())))
    return coefficients(run(method.program, fields, [number(x) for x in definitions.POINT[:dimension]]))


@pytest.mark.few(5)
@pytest.mark.parametrize("name", CASES)
def test_program_makes_the_step_of_the_source(name):
    case = CASES[name]
    found, y = step(case.method, case.fields), definitions.start(case)
    assert found == coefficients(case.step(case.fields, y))
    assert found != coefficients(case.wrong(case.fields, y))


@pytest.mark.parametrize(
    "others",
    [
        {"rkn": method("rkn-verlet"), "partitioned": method("stormer-verlet"), "gark": method("gark2")},
        {"rkn": method("rkn-verlet"), "uncorrected": TakahashiImada(0), "flows": strang(["p", "q"])},
    ],
    ids=lambda others: ", ".join(others),
)
def test_the_same_method_as_several_kinds(others):
    """Störmer–Verlet for q'' = g(q)."""
    steps = [step(other, definitions.second_order_fields()) for other in others.values()]
    assert all(other == steps[0] for other in steps)
    assert step(method("takahashi-imada"), definitions.second_order_fields()) != steps[0]


@pytest.mark.parametrize("velocity", [False, True])
def test_nystrom_method_made_of_a_runge_kutta_method(velocity):
    """HNW I, II.14: ā = a², b̄ = b a."""
    A, b, c = (tableau := method("kutta3")).A, tableau.b, tableau.c
    squared = [[sum(row[k] * A[k][j] for k in range(3)) for j in range(3)] for row in (*A, b)]
    made = RungeKuttaNystrom(squared[:3], squared[3], b, c, A=A)
    fields = definitions.second_order_fields(velocity=velocity)
    assert step(made, fields) == step(tableau, _total(fields))


def _total(fields):
    return {"": [add(*components) for components in zip(*fields.values(), strict=True)]}


def test_additive_methods_are_generalised_additive_methods_with_equal_blocks():
    case = CASES["additive"]
    blocks = {n: part.A for n, part in zip("abc", case.method.partitions, strict=True)}
    weights = {n: part.b for n, part in zip("abc", case.method.partitions, strict=True)}
    made = GeneralizedAdditiveRungeKutta(dict.fromkeys("abc", blocks), weights)
    assert step(made, case.fields) == step(case.method, case.fields)


def test_rosenbrock_without_jacobian_is_explicit_and_the_transformation_is_undone():
    case = CASES["rosenbrock"]
    zero = [[0] * 3] * 3
    explicit = Rosenbrock(case.method.alpha, zero, case.method.b)
    assert step(explicit, case.fields) == step(RungeKutta(case.method.alpha, case.method.b, warn=False), case.fields)
    gamma, below = sympy.Rational(2, 7), sympy.Matrix([[0, 0, 0], [3, 0, 0], [-1, sympy.Rational(1, 2), 0]])
    inverse = sympy.eye(3) / gamma - below  # Γ⁻¹ = I/γ − C
    alpha, b = (sympy.Matrix([[str(x) for x in row] for row in rows]) for rows in (case.method.alpha, [case.method.b]))
    a, m = (alpha * inverse).tolist(), (b * inverse).tolist()[0]
    made = Rosenbrock.from_transformed(a, below.tolist(), m, gamma)
    assert (made.alpha, made.b) == (case.method.alpha, case.method.b)
    assert (sympy.Matrix([[str(x) for x in row] for row in made.gamma]) * inverse) == sympy.eye(3)


def test_w_method_with_the_exact_jacobian_is_the_rosenbrock_method():
    rosenbrock, field = CASES["rosenbrock"].method, CASES["rosenbrock"].fields[""]
    w = WMethod(rosenbrock.alpha, rosenbrock.gamma, rosenbrock.b)
    assert step(w, {"f": field, "W": field}) == step(rosenbrock, {"": field})


@pytest.mark.parametrize("nodes", [["1/2"], ["1/2-sqrt(3)/6", "1/2+sqrt(3)/6"]])
def test_energy_preserving_collocation_at_gauss_nodes(nodes):
    """Hairer (2010): Σ_i ∫₀^τ ℓ_i ℓ_i(σ) / b_i; the nodes drop out."""
    M = definitions.hairer_matrix([sympy.sympify(node) for node in nodes])
    expected = [[sympy.nsimplify(sympy.simplify(x)) for x in row] for row in M]
    found = method(f"energy-collocation{len(nodes)}").M
    assert [[sympy.Rational(str(x)) for x in row] for row in found] == expected


def test_energy_preserving_collocation_at_other_nodes_is_another_method():
    M = definitions.hairer_matrix([Fraction(1, 4), Fraction(3, 4)])
    assert ContinuousStageRungeKutta(M).M != method("energy-collocation2").M
    assert ContinuousStageRungeKutta(M).B == (1, 0)  # Σ ℓ_i = 1: y1 averages the field without weight


def test_lawson_method_without_linear_part_is_its_tableau():
    case = CASES["lawson"]
    nothing = {"L": [{}, {}], "N": case.fields["N"]}
    assert step(case.method, nothing) == step(case.method.tableau, {"": case.fields["N"]})


def test_lawson4_needs_few_flows():
    flows = [
        str(evaluation.time) for evaluation in method("lawson4").program.evaluations if hasattr(evaluation, "time")
    ]
    assert sorted(flows) == ["1", "1", "1/2", "1/2", "1/2", "1/2"]


def test_flows_of_one_part_in_a_row_are_one():
    made = Splitting([("a", HALF), ("a", "1/4"), ("b", 1), ("a", "1/4")])
    assert made.flows == (("a", Fraction(3, 4)), ("b", 1), ("a", Fraction(1, 4)))
    assert made == Splitting([("a", "3/4"), ("b", 1), ("a", "1/4")], parts=("a", "b"))
    assert made != Splitting(made.flows, parts=("b", "a"))


def test_explicit_kinds_say_so():
    explicit = ["rkn-nystrom5", "rkn-nystrom4-general", "takahashi-imada", "tdrk5", "lawson4", "suzuki4"]
    assert all(method(name).is_explicit for name in explicit)
    assert not any(method(name).is_explicit for name in ("avf", "ros2", "gark2"))


@pytest.mark.parametrize("name", CASES)
def test_kinds_are_frozen_values(name):
    made = CASES[name].method
    assert pickle.loads(pickle.dumps(made)) == made
    assert hash(pickle.loads(pickle.dumps(made))) == hash(made)
    assert made.program == made.program
    with pytest.raises(AttributeError, match="is immutable"):
        made.name = "other"


def test_labels_symbols_floats_and_digits():
    made = Rosenbrock([[0]], [["gamma"]], [1], parameters=["gamma"], name="family", reference="somewhere")
    assert (made.name, made.reference, made.parameters, made.domain) == ("family", "somewhere", ("gamma",), "symbolic")
    assert made.program.name == "family"
    assert repr(made) == "<Rosenbrock family: 1 stage>"
    assert repr(strang()) == "<Splitting strang: a, b, 3 stages>"
    assert Splitting([("a", 0.5), ("b", 1.0), ("a", 0.5)]).domain == "float"
    decimal = TwoDerivativeRungeKutta([["0.333"]], [[0]], ["0.999"], [0], digits=3)
    assert (decimal.domain, decimal.digits, decimal.issues) == ("decimal", 3, ())
    assert decimal != TwoDerivativeRungeKutta([["0.333"]], [[0]], ["0.999"], [0])
    assert "0.333*k1" in str(decimal)


def test_inconsistent_weights_are_issues():
    (issue,) = Splitting([("a", 1), ("b", "1/2")]).issues
    assert issue == "weights of part b sum to 1/2, not 1: the method is inconsistent"
    (issue,) = TwoDerivativeRungeKutta([[0]], [[0]], [2], [5]).issues
    assert issue.startswith("weights of the evaluations sum to 2, not 1")
    assert not RungeKuttaNystrom([[0]], [7], [1], [0]).issues


def test_a_program_is_not_saved(tmp_path):
    with pytest.raises(IntegratorError, match="or a method with memory, but was <Rosenb"):
        save_method(method("ros2"), tmp_path / "ros2.json")  # pyright: ignore[reportArgumentType]
    assert not list(tmp_path.iterdir())


TABLEAU = RungeKutta([[0]], [1])


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: GeneralizedAdditiveRungeKutta({}, [1]), r"b must map names of parts to weights, but was \[1\]"),
        (lambda: GeneralizedAdditiveRungeKutta({}, {"p": [1]}), "parts must be two or more names, but were 1"),
        (lambda: GeneralizedAdditiveRungeKutta({"r": {}}, {"p": [1], "q": [1]}), "A must be given for p, q, but one"),
        (lambda: GeneralizedAdditiveRungeKutta({"p": 1}, {"p": [1], "q": [1]}), r"A\[p\] must map names of parts"),
        (
            lambda: GeneralizedAdditiveRungeKutta({"p": {"q": [[1]]}}, {"p": [1], "q": [1, 2]}),
            r"A\[p\]\[q\]\[1\] must have 2 entries, but has 1",
        ),
        (lambda: RungeKuttaNystrom([[0]], [1], [1], [0, 1]), "c must have 1 entry, but has 2"),
        (
            lambda: RungeKuttaNystrom([[0]], [1], [1], [0], parts="pq"),
            "parts must be a sequence of names, but was 'pq'",
        ),
        (lambda: RungeKuttaNystrom([[0]], [1], [1], [0], parts=["p", "p"]), "parts must have different names"),
        (lambda: RungeKuttaNystrom([[0]], [1], [1], [0], parts=["p", "t"]), "names of partitions must start with"),
        (lambda: RungeKuttaNystrom([[0]], [1], [], []), "b must have from 1 to 1000 entries, but has 0"),
        (lambda: TwoDerivativeRungeKutta([[0]], [[0], [0]], [1], [0]), "A_hat must have 1 row, but has 2"),
        (lambda: TwoDerivativeRungeKutta([["x"]], [[0]], [1], [0]), r"A\[1\]\[1\] must be a formula, but 'x' has"),
        (lambda: Rosenbrock([[1]], [[1]], [1]), r"alpha must be strictly lower triangular, but alpha\[1\]\[1\] was 1"),
        (
            lambda: WMethod([[0, 0], [1, 0]], [[1, 2], [0, 1]], [1, 0]),
            r"gamma must be lower triangular, but gamma\[1\]\[2",
        ),
        (lambda: Rosenbrock.from_transformed([[0]], [[1]], [1], 1), "c must be strictly lower triangular"),
        (lambda: Rosenbrock([[0]], [[1]], [1], digits=0), "digits must be an integer from 1 to 1000, but was 0"),
        (lambda: Rosenbrock([[0]], [[1]], [1], name=5), "name must be text, but was 5"),
        (lambda: ContinuousStageRungeKutta([]), "M must have 1 row, but has 0"),
        (lambda: ContinuousStageRungeKutta([[0], [1, 2]]), r"M\[2\] must have 1 entry, but has 2"),
        (lambda: ContinuousStageRungeKutta([[0], [1]], [1, 2]), "B must have 1 entry, but has 2"),
        (lambda: ContinuousStageRungeKutta(5), "M must be a sequence, but was 5"),
        (lambda: LawsonMethod(method("gauss2")), "tableau must be an explicit RungeKutta, but was <RungeKutta gauss2"),
        (lambda: LawsonMethod("rk4"), "tableau must be an explicit RungeKutta, but was 'rk4'"),
        (lambda: LawsonMethod(TABLEAU, parts=["L"]), "parts must be 2 names, but were 1"),
        (lambda: Splitting("ab"), "flows must be a sequence, but was 'ab'"),
        (lambda: Splitting(["ab"]), r"flows\[1\] must be a part and its coefficient, but was 'ab'"),
        (lambda: Splitting([("a", 1), ("b", "one")]), r"flows\[2\] must be a formula, but 'one' has"),
        (lambda: Splitting([("a", 1)]), "parts must be two or more names, but were 1"),
        (lambda: Splitting([("c", 1)], parts=["a", "b"]), "flows must be of the parts a, b, but one was of 'c'"),
        (lambda: lie_trotter("ab"), "parts must be a sequence of names, but was 'ab'"),
        (lambda: TakahashiImada(simplified=1), "simplified must be True or False, but was 1"),
        (lambda: TakahashiImada("alpha"), "alpha must be a formula, but 'alpha' has the unknown name"),
        (lambda: PartitionedRungeKutta({"a": {"A": [[0]], "b": [1]}}), "partitions must map two or more names"),
    ],
)
def test_bad_input(build, message):
    with pytest.raises(IntegratorError, match=message):
        build()
