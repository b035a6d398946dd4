"""Underlying one-step methods: published values, power series without trees, and the same method in two forms."""

import json
import random
from fractions import Fraction
from functools import cache
from itertools import product
from pathlib import Path

import power_series_oracle as oracle
import pytest
import sympy

import bseries as bs

VALUES = json.loads((Path(__file__).parents[2] / "reference" / "methods_with_memory.json").read_text(encoding="utf-8"))
LMM = {
    name: bs.LinearMultistep(data["rho_ascending"], data["sigma_ascending"], name=name)
    for name, data in VALUES["lmm"].items()
}
ORDER = oracle.ORDER


def dimsim(**changes):
    data = VALUES["glm"]["dimsim2"] | changes
    return bs.GeneralLinear(*(data[key] for key in "AUBV"), finishing=data["finishing"], name="dimsim2")


def random_field(seed):
    """Two polynomials of degree 3 in two variables, with small integers."""
    rng = random.Random(seed)
    powers = [(i, j) for i, j in product(range(4), repeat=2) if i + j <= 3]
    return [{power: Fraction(rng.randint(-3, 3)) for power in powers} for _ in range(2)]


def series_as_map(s, field):
    """The map y ↦ s(∅) y + Σ h^|τ| s(τ)/σ(τ) F(τ)(y), with F(τ) as polynomials."""

    @cache
    def differential(tree):
        def contracted(polynomial, vectors):
            if not vectors:
                return polynomial
            parts = (
                oracle.multiply(contracted(oracle.partial(polynomial, i), vectors[1:]), vectors[0][i]) for i in (0, 1)
            )
            return oracle.add(*parts)

        children = [differential(child) for child in tree.children]
        return [contracted(polynomial, children) for polynomial in field]

    terms = [(tree.order, Fraction(x, tree.symmetry), differential(tree)) for tree, x in s.items() if x]

    def value(y):
        total = oracle.times(s["∅"], y)
        for order, x, field_of_tree in terms:
            if order <= ORDER:
                h = oracle.number(1)
                for _ in range(order):
                    h = h * oracle.H
                total = oracle.plus(total, oracle.times(h * x, oracle.value(field_of_tree, y)))
        return total

    return value


def multistep_residual(method, phi, field, y):
    """Σ α_j Φ^j(y) − h Σ β_j f(Φ^j(y))."""
    step, total = series_as_map(phi, field), [oracle.number(0)] * 2
    for alpha, beta in zip(method.alpha, method.beta, strict=True):
        slope = oracle.times(-beta * oracle.H, oracle.value(field, y))
        total = oracle.plus(total, oracle.times(alpha, y), slope)
        y = step(y)
    return oracle.coefficients(total)


def general_residual(method, phi, starting, field, y):
    """B h f(Y) + V S(y) − S(Φ(y)) and d · S(y) − y, with Y = h A f(Y) + U S(y)."""
    maps = [series_as_map(s, field) for s in starting]
    inputs, after = [s(y) for s in maps], [s(series_as_map(phi, field)(y)) for s in maps]
    points = [y] * len(method.A)
    for _ in range(ORDER + 1):
        slopes = [oracle.times(oracle.H, oracle.value(field, at)) for at in points]
        rows = zip(method.A, method.U, strict=True)
        points = [oracle.plus(oracle.combined(a, slopes), oracle.combined(u, inputs)) for a, u in rows]
    slopes = [oracle.times(oracle.H, oracle.value(field, at)) for at in points]
    found = [oracle.plus(oracle.combined(method.finishing, inputs), oracle.times(-1, y))]
    for b, v, end in zip(method.B, method.V, after, strict=True):
        found.append(oracle.plus(oracle.combined(b, slopes), oracle.combined(v, inputs), oracle.times(-1, end)))
    return [oracle.coefficients(vector) for vector in found]


def name_of(method):
    return method.name


def is_zero(residual):
    return all(is_zero(x) if isinstance(x, list) else x == 0 for x in residual)


@pytest.mark.parametrize("name", LMM)
def test_multistep_series_are_those_computed_from_the_definition(name):
    data, method = VALUES["lmm"][name], LMM[name]
    for made, key in ((bs.series, "underlying_one_step_to_6"), (bs.modified_equation, "modified_equation_to_6")):
        assert {str(tree): str(x) for tree, x in made(method, 6).items()} == data[key]
    assert bs.underlying_one_step(method, 6) == bs.series(method, 6)
    b, phi, sums = bs.modified_equation(method, 8), bs.series(method, 8), data["checksums_order_8"]
    for s, kind in ((b, "log"), (phi, "phi")):
        assert str(sum(x / tree.symmetry for tree, x in s.items())) == sums[f"{kind}_sum_over_sigma"]
        assert str(sum(x * x for x in s.values())) == sums[f"{kind}_sum_squares"]
    assert (method.order, str(method.error_constant)) == (data["order"], data["error_constant"])
    assert bs.order_of(phi) == bs.order_of(method) == data["order"]


def test_general_linear_series_are_those_computed_from_the_definition():
    data, method = VALUES["glm"]["dimsim2"], dimsim()
    assert {str(tree): str(x) for tree, x in bs.series(method, 6).items()} == data["underlying_one_step_to_6"]
    assert {str(tree): str(x) for tree, x in bs.modified_equation(method, 5).items()} == data["modified_equation_to_5"]
    for found, given in zip(bs.memory.starting_procedure(method, 4), data["starting_procedure_to_4"], strict=True):
        assert {str(tree): str(x) for tree, x in found.items()} == given
    assert list(map(str, method.u)) == data["u"]
    assert bs.order_of(method) == data["order_of_underlying"]


OTHERS = bs.memory.bdf(3), bs.memory.adams_moulton(2), bs.memory.momentum("9/10")


@pytest.mark.parametrize("method", [*LMM.values(), *OTHERS], ids=name_of)
def test_iterated_as_a_power_series_the_underlying_method_solves_the_recursion(method):
    field, y = random_field(method.name), list(map(oracle.number, (1, Fraction(-1, 2))))
    phi = bs.series(method, ORDER)
    assert is_zero(multistep_residual(method, phi, field, y))
    for tree in ("[τ,τ]", "[[[[τ]]]]"):  # negative control: another coefficient
        wrong = bs.BSeries.from_rule(lambda t, at=tree: phi[t] + Fraction(str(t) == at, 7), ORDER)
        assert not is_zero(multistep_residual(method, wrong, field, y))


GENERAL = {
    "dimsim2": dimsim(),
    "implicit": bs.GeneralLinear(
        [["1/2", 0], [1, "1/3"]], [[1, 1], [1, 0]], [["1/2", "1/2"], ["1/3", "-1/4"]], [[1, "1/5"], [0, "1/2"]]
    ),
    "two-step": bs.TwoStepRungeKutta(
        [0, "1/3"], "1/5", [[0, 0], ["2/3", 0]], ["1/2", "1/3"], [[0, 0], ["1/6", "1/4"]], ["1/6", "1/5"]
    ),
    "nesterov": bs.memory.nesterov("1/2"),
    "nesterov-points": bs.memory.nesterov("1/2", lookahead=True),
}


@pytest.mark.parametrize("name", GENERAL)
def test_general_linear_methods_commute_with_their_starting_procedure_on_power_series(name):
    method = GENERAL[name]
    field, y = random_field(name), list(map(oracle.number, (1, Fraction(-1, 2))))
    phi, starting = bs.series(method, ORDER), bs.memory.starting_procedure(method, ORDER)
    assert is_zero(general_residual(method, phi, starting, field, y))
    wrong = bs.BSeries.from_rule(lambda t: phi[t] + Fraction(str(t) == "[τ,[τ]]", 7), ORDER)
    assert not is_zero(general_residual(method, wrong, starting, field, y))


@pytest.mark.parametrize("method", [*LMM.values(), *map(bs.method, ("ab4", "bdf4", "milne-simpson3"))], ids=name_of)
def test_a_multistep_method_is_also_a_general_linear_one(method):
    general = method.to_general_linear()
    assert bs.series(general, 7) == bs.series(method, 7)
    assert bs.modified_equation(general, 7) == bs.modified_equation(method, 7)
    powers = bs.memory.starting_procedure(method, 5)
    newest_first = bs.memory.starting_procedure(general, 5)[: method.steps]
    last = powers[-1]  # the finishing procedure takes y_{n+k−1}, and Φ^j for the others is seen from there
    assert [bs.compose(last, p) for p in newest_first[::-1]] == list(powers)


def test_the_trapezoidal_rule_is_a_runge_kutta_method_too():
    assert bs.series("am1", 8) == bs.series("trapezoidal", 8)
    assert bs.series("bdf1", 8) == bs.series("implicit-euler", 8)
    assert bs.series("ab1", 8) == bs.series("explicit-euler", 8)


def test_other_finishing_vectors_give_conjugate_methods():
    first, other = dimsim(), dimsim(finishing=["1/3", "2/3"])
    assert bs.series(first, 5) != bs.series(other, 5)
    change = bs.memory.starting_procedure(other, 5)[0]  # d·S = id for the other d, so that y is read by the first d
    assert bs.compose(change, bs.series(first, 5)) == bs.compose(bs.series(other, 5), change)


def test_the_leading_term_of_the_modified_equation_is_the_error_constant():
    for name, method in LMM.items():
        p, b = method.order, bs.modified_equation(method, method.order + 1)
        for tree, x in b.items():
            if tree.order == p + 1:
                factorial = sympy.factorial(p + 1)
                assert sympy.Rational(x) == -sympy.Rational(method.error_constant) * factorial / tree.density, name


def test_symmetric_methods_have_structure_and_others_have_not():
    milne = bs.memory.symmetric_multistep(["pi/2", "pi"])
    for method, order in ((LMM["leapfrog"], 2), (milne, 4), (bs.method("milne-simpson2"), 4), (bs.method("am1"), 2)):
        assert bs.symmetry(method, 8).holds
        assert bs.conjugate_symplecticity(method, 8).holds
        assert bs.symplecticity(method, 8).order == order
    for name in ("ab2", "bdf2"):  # negative controls
        assert bs.conjugate_symplecticity(LMM[name], 7).order == 3
        assert bs.symmetry(LMM[name], 7).order <= 3


def test_symbols_and_roots_give_exact_series():
    s = bs.LinearMultistep(["a", "-1 - a", "1"], ["-(1 + a)/2", "(3 - a)/2", "0"], parameters=["a"], name="family")
    b = bs.modified_equation(s, 5)
    a = sympy.Symbol("a")
    for value in (Fraction(1, 3), Fraction(-1, 2)):
        at = bs.LinearMultistep([value, -1 - value, 1], [-(1 + value) / 2, (3 - value) / 2, 0])
        exact = bs.modified_equation(at, 5)
        number = sympy.Rational(value.numerator, value.denominator)
        assert [sympy.sympify(x, strict=True).subs(a, number) for x in b.values()] == [
            sympy.Rational(x.numerator, x.denominator) for x in exact.values()
        ]
    general = bs.modified_equation(s.to_general_linear(), 4)
    assert all(sympy.simplify(general[tree] - b[tree]) == 0 for tree in general)
    golden = bs.memory.symmetric_multistep(["2*pi/5", "4*pi/5"], explicit=False)
    assert bs.order_of(bs.series(golden, 6)) == 6 == golden.order
    assert bs.symmetry(golden, 5).holds


def test_momentum_solves_the_rescaled_field():
    method = bs.LinearMultistep(["m", "-1 - m", 1], [0, 1, 0], rescaled=True, parameters=["m"], name="momentum")
    b, m = bs.modified_equation(method, 3), sympy.Symbol("m")
    assert sympy.simplify(b["τ"] - 1 / (1 - m)) == 0
    assert sympy.simplify(b["[τ]"] + (1 + m) / (2 * (1 - m) ** 3)) == 0
    half = bs.LinearMultistep(["1/2", "-3/2", 1], [0, 1, 0], rescaled=True)
    field, y = random_field("momentum"), list(map(oracle.number, (1, 2)))
    assert is_zero(multistep_residual(half, bs.series(half, ORDER), field, y))


def nesterov(m):
    """x_{n+1} = y_n + h f(y_n), y_n = (1 + m) x_n − m x_{n−1}, with the inputs x_n and x_{n−1}."""
    shares = [f"1 + {m}", f"-({m})"]
    return bs.GeneralLinear([[0]], [shares], [[1], [0]], [shares, [1, 0]], parameters=["m"], name="nesterov")


def test_nesterovs_method_is_a_general_linear_one():
    method, field, y = nesterov("1/3"), random_field("nesterov"), list(map(oracle.number, (1, Fraction(-1, 2))))
    phi, starting = bs.series(method, ORDER), bs.memory.starting_procedure(method, ORDER)
    assert is_zero(general_residual(method, phi, starting, field, y))
    b, m = bs.modified_equation(nesterov("m"), 4), sympy.Symbol("m")
    assert sympy.simplify(b["τ"] - 1 / (1 - m)) == 0
    at_third = bs.modified_equation(method, 4)
    assert all(sympy.sympify(b[t], strict=True).subs(m, sympy.Rational(1, 3)) == at_third[t] for t in at_third)
    heavy = bs.LinearMultistep(["1/3", "-4/3", 1], [0, 1, 0], rescaled=True)
    assert bs.modified_equation(heavy, 2)["[τ]"] != at_third["[τ]"]  # the two kinds of momentum differ in the next term
