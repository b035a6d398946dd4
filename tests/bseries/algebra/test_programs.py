"""Programs as series: against tableaux, exact flows, rules from the literature, and compositions."""

from fractions import Fraction

import pytest

import bseries as bs
from integrators.methods.programs.builder import ProgramBuilder
from integrators.methods.programs.program import Program

HALF = Fraction(1, 2)


def one_stage(record):
    """The program y₁ = y + k with k implicitly given by record(builder, k)."""
    builder = ProgramBuilder()
    (k,) = builder.unknowns(1)
    record(builder, k)
    return builder.program(builder.y + k)


def flow_of_part(color, time, order):
    def rule(tree):
        return Fraction(time) ** tree.order / tree.density if set(tree.colors) == {color} else 0

    return bs.BSeries.from_rule(rule, order, colors=2, names=("p", "q"))


@pytest.mark.few(6)
@pytest.mark.parametrize("name", ["rk4", "gauss2", "lobatto-iiic3", "stormer-verlet", "lobatto-iiia-iiib3", "sdirk2"])
def test_tableaux_and_their_programs_agree(execution, name):
    method = bs.method(name)
    order = 4 if len(method.names) == 2 or name in ("gauss2", "sdirk2") else 6
    assert bs.series(method.program, order) == bs.series(method, order)
    assert bs.modified_equation(method.program, order) == bs.modified_equation(method, order)
    assert bs.modifying_integrator(method.program, order) == bs.modifying_integrator(method, order)


def test_a_flow_is_the_exact_flow(execution):
    builder = ProgramBuilder()
    whole = builder.program(builder.y + builder.flow(builder.y))
    assert bs.series(whole, 7) == bs.exact_flow(7)
    assert bs.modifying_integrator(whole, 5) == bs.exact_flow(5).log()


def test_a_flow_with_forcing_solves_its_equation(execution):
    """z' = h f(z) + 2θ k with k = h f(y), z(0) = y: on trees by hand."""
    builder = ProgramBuilder()
    k = builder.field(builder.y)
    s = bs.series(builder.program(builder.y + builder.flow(builder.y, forcing=[0 * k, 2 * k]) - k), 3)
    # z(θ)(τ) = θ + θ², so z([τ]) = ∫ θ + θ² = 5/6, z([τ,τ]) = ∫ (θ + θ²)² and z([[τ]]) = ∫∫ (θ + θ²).
    assert [s[t] for t in ("τ", "[τ]", "[τ,τ]", "[[τ]]")] == [1, Fraction(5, 6), Fraction(31, 30), Fraction(1, 4)]


def test_the_average_vector_field(execution):
    """a([τ₁, …, τₘ]) = Π a(τᵢ) / (m + 1) (Celledoni, McLachlan, McLaren, Owren, Quispel, Wright 2009)."""

    def rule(tree):
        value = Fraction(1, len(tree.children) + 1)
        for child in tree.children:
            value *= rule(child)
        return value

    avf = one_stage(lambda builder, k: builder.average([builder.y, k], into=k))
    assert bs.series(avf, 7) == bs.BSeries.from_rule(rule, 7)
    assert bs.substitute(bs.modifying_integrator(avf, 6), avf) == bs.exact_flow(6)


def test_derivatives_are_taken_along_vectors(execution):
    builder = ProgramBuilder()
    k = builder.field(builder.y)
    taylor = builder.program(builder.y + k + builder.derivative(builder.y, k) / 2)
    assert [(str(t), x) for t, x in bs.series(taylor, 6).nonzero()] == [("τ", 1), ("[τ]", HALF)]
    at_midpoint = builder.derivative(builder.y + k / 2, k)  # f'(y + h f/2) f = Σ f^(m+1)(f/2, …, f/2, f)/m!
    s = bs.series(builder.program(builder.y + at_midpoint), 4)
    assert [s[t] for t in ("τ", "[τ]", "[τ,τ]", "[τ,τ,τ]", "[[τ]]")] == [0, 1, 1, Fraction(3, 4), 0]


def test_a_linearly_implicit_method():
    """(1 − h/2 f'(y)) k = h f(y): only tall trees and their leaves, a = 2^(1−n)."""
    builder = ProgramBuilder()
    (d,) = builder.unknowns(1)
    k = builder.field(builder.y) + d / 2
    builder.derivative(builder.y, k, into=d)
    s = bs.series(builder.program(builder.y + k), 5)
    assert all(x == (HALF ** (t.order - 1) if t.height == t.order - 1 else 0) for t, x in s.items())


def test_splitting_is_the_composition_of_flows(execution):
    builder = ProgramBuilder(("p", "q"))
    y = builder.y
    for part, time in (("p", "1/3"), ("q", 1), ("p", "2/3")):
        y = y + builder.flow(y, part, time=time)
    expected = flow_of_part(0, Fraction(1, 3), 4)
    for color, time in ((1, 1), (0, Fraction(2, 3))):
        expected = bs.compose(expected, flow_of_part(color, time, 4))
    assert bs.series(builder.program(y), 4) == expected


def test_substitution_into_a_program_goes_as_over_partitions(execution, random_series):
    builder = ProgramBuilder()
    k = builder.field(builder.y)
    d = builder.derivative(builder.y + k / 3, k)
    y = builder.y + k + d / 2 + builder.flow(builder.y + d, time=HALF)
    program = builder.program(y + builder.average([builder.y, k, d], power=1))
    b = random_series(6, 3, 0)
    assert bs.substitute(b, program) == bs.substitute(b, bs.series(program, 6))
    assert bs.modifying_integrator(program, 6) == bs.modifying_integrator(bs.series(program, 6))


def test_symbols_roots_and_floats_in_programs():
    sympy = pytest.importorskip("sympy")
    c = sympy.Symbol("c")
    builder = ProgramBuilder()
    k = builder.field(builder.y)
    flow = builder.flow(builder.y + c * k, time="sqrt(2)/2")
    method = builder.program(builder.y + flow + (1 - sympy.sqrt(2) / 2) * k)
    assert method.domain == "symbolic"
    assert method.parameters == ("c",)
    assert method.issues == ()
    assert sympy.simplify(bs.series(method, 2)["[τ]"] - (sympy.Rational(1, 4) + sympy.sqrt(2) / 2 * c)) == 0
    builder = ProgramBuilder()
    k = builder.field(builder.y)
    rounded = bs.series(builder.program(builder.y + builder.flow(builder.y + 0.5 * k) / 1), 4)
    assert not rounded.is_exact


@pytest.mark.parametrize("first", [HALF, 0.5])
def test_exact_and_rounded_programs_are_not_taken_for_each_other(first):
    """Stages are kept for the next caller, and 0.5 equals 1/2."""
    for kind in ("field", "flow"):
        domains = {}
        for number in (first, HALF, 0.5):
            builder = ProgramBuilder()
            k = builder.field(builder.y) * number if kind == "field" else builder.flow(builder.y, time=number)
            domains[type(number)] = bs.series(builder.program(builder.y + k), 3).domain
        assert domains == {Fraction: "QQ", float: "RR"}


NYSTROM_TREES = ((0, None), (1, 0))


def test_a_program_for_special_systems_has_their_trees_only():
    """As the kind of method that it comes from; on all trees it has order 1."""
    method = bs.method("rkn-nystrom5")
    program = method.program.restricted(NYSTROM_TREES)
    assert bs.series(program, 6) == bs.series(method, 6)
    assert bs.modified_equation(program, 6) == bs.modified_equation(method, 6)
    assert bs.modifying_integrator(program, 6) == bs.modifying_integrator(method, 6)
    assert (bs.order_of(program), bs.order_of(program.restricted(None))) == (5, 1)
    assert bs.analysis.error_coefficients(program).terms == bs.analysis.error_coefficients(method).terms
    assert bs.symplecticity(program, 7) == bs.symplecticity(method, 7)
    assert bs.check(program).structure == bs.check(method).structure
    assert len(bs.series(program, 6, max_children=[[0, None], [None, 0]])) > len(bs.series(program, 6))


def test_floats_do_not_change_which_trees_a_method_is_meant_for():
    rounded = bs.methods.RungeKuttaNystrom([[0, 0], [0.5, 0]], [0.5, 0], [0.5, 0.5], [0, 1])
    exact = bs.method("rkn-verlet")
    assert rounded.domain == "float"
    for method in (rounded, rounded.program.restricted(NYSTROM_TREES)):
        assert bs.order_of(method) == 2
        assert bs.symplecticity(method, 6) == bs.symplecticity(exact, 6)
        assert bs.check(method).structure["effective_order"].order == 2
    assert not bs.symplecticity(rounded.program.restricted(None), 4).holds


def test_a_class_of_ones_own_says_which_trees_it_is_meant_for():
    class Drift(bs.methods.Method):
        def __init__(self, program):
            self.__dict__.update(program=program)

    plain = bs.method("rkn-verlet").program.restricted(None)
    assert bs.series(Drift(plain.restricted(NYSTROM_TREES)), 5) == bs.series(bs.method("rkn-verlet"), 5)
    assert len(bs.series(Drift(plain), 5)) == len(bs.exact_flow(5, colors=2))


def test_many_stages_stay_on_the_fast_path():
    """Forty flows in a row: more products than residues can add up without a reduction."""
    builder = ProgramBuilder()
    y = builder.y
    for _ in range(40):
        y = y + builder.flow(y, time="1/40")
    import numba  # noqa: F401

    half_method = builder.program(y + builder.field(builder.y) * 0)
    assert bs.series(half_method, 6) == bs.exact_flow(6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda b: b.field(b.field(b.y)), "at must be a point, y plus evaluations, but was k1"),
        (lambda b: b.field(2 * b.y), "at must be a point"),
        (lambda b: b.derivative(b.y, b.y), "along must be a vector, evaluations without y, but was y"),
        (lambda b: b.field(b.y, "q"), "part must be None, as there is only one|part must be one of None"),
        (lambda b: b.field("y"), "at must be a point, .* but was 'y'"),
        (lambda b: b.average([]), "path must be a sequence that holds at least its start"),
        (lambda b: b.average(5), "path must be a sequence"),
        (lambda b: b.unknowns(10**9), "count must be from 0 to 1000"),
        (lambda b: b.unknowns("x"), "count must be from 0 to 1000"),
        (lambda b: b.field(b.y + ProgramBuilder().field(ProgramBuilder().y)), "at must come from this|must come from"),
        (lambda b: b.program(ProgramBuilder().y), "result must come from this builder, but y is another's"),
        (lambda b: ProgramBuilder(5), "parts must be a sequence of names, but was 5"),
        (lambda b: ProgramBuilder(("a",), auxiliary="a"), "auxiliary must be a sequence of names"),
        (lambda b: b.average([b.y], power=-1), "power must be 0, 1, 2"),
        (lambda b: b.y * b.y, "number must be a number, but was a linear form"),
        (lambda b: b.y / 0, "number must not be zero"),
        (lambda b: b.program(b.field(b.y)), "result must be a point"),
        (lambda b: (b.unknowns(2), b.program(b.y)), "evaluations must all be defined, but k1 is not"),
        (lambda b: b.field(b.y, into=b.y), "into must be one of the unknowns"),
        (lambda b: b.flow(b.y, time="x"), "time"),
        (lambda b: Program([], b.y + b.field(b.y)), "evaluations must all be defined, but k1 is not"),
        (lambda b: ProgramBuilder("pq"), "parts must be a sequence of names"),
        (lambda b: ProgramBuilder(("p", "p")), "parts must have different names"),
        (lambda b: ProgramBuilder(("p",), auxiliary=("J",)), "auxiliary must name parts"),
    ],
)
def test_bad_programs_are_refused(call, message):
    with pytest.raises(bs.errors, match=message):
        call(ProgramBuilder())


def test_a_flow_cannot_drive_itself():
    builder = ProgramBuilder()
    (k,) = builder.unknowns(1)
    builder.flow(builder.y, forcing=[k], into=k)
    with pytest.raises(bs.errors, match="forcing must not depend on the flow that it drives, but that of k1 does"):
        builder.program(builder.y + k)


def test_too_many_components_are_refused():
    builder = ProgramBuilder()
    y = builder.y
    for _ in range(120):
        y = y + builder.flow(y, time=1)
    method = builder.program(y + builder.field(builder.y))
    with pytest.raises(bs.errors, match=r"method must have at most 1000 stages, .* but has 1201"):
        bs.series(method, 10)


def test_the_method_that_takes_no_step():
    builder = ProgramBuilder()
    none, rk4 = bs.series(builder.program(builder.y), 5), bs.series("rk4", 5)
    assert none.inverse() == none**3 == bs.compose(none, none) == none.adjoint() == none
    assert bs.compose(none, rk4) == bs.compose(rk4, none) == rk4
    assert bs.compose(none, rk4).log() == bs.compose(rk4, none).log() == rk4.log()
