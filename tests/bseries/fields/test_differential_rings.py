"""Formulas as elements of differential rings, against SymPy's derivatives evaluated at points with 30 digits."""

from fractions import Fraction

import pytest
import sympy

from bseries import SeriesError
from bseries.fields.differential_rings import DifferentialRing, Lattice
from bseries.fields.polynomials import TooLarge

pytestmark = pytest.mark.minimum

x, y, a, k = sympy.symbols("x y a k")
sin, cos, tan, exp, log, sqrt = sympy.sin, sympy.cos, sympy.tan, sympy.exp, sympy.log, sympy.sqrt
sinh, cosh, tanh = sympy.sinh, sympy.cosh, sympy.tanh
UNKNOWN = sympy.Function("g")
POINT = {x: sympy.Rational(37, 100), y: sympy.Rational(58, 100), a: sympy.Rational(17, 10), k: sympy.Rational(3, 7)}

FORMULAS = [
    sin(2 * x) * cos(x) + tan(x),
    sin(x + y) / (x**2 + y**2),
    cos(x - y) * cos(x) / (1 + sin(x - y) ** 2),
    sin(x + sympy.pi / 3) * cos(x),
    sinh(2 * x) * cosh(x) + tanh(x + y),
    exp(2 * x) + exp(-x) + exp(x / 2) * exp(-(x**2)),
    exp(exp(x)) + sin(x + sin(x)),
    sqrt(x**2 + y**2) ** 3 + 1 / (x**2 + y**2),
    (x + y) ** sympy.Rational(1, 3) + 1 / (x + y),
    x ** sympy.Rational(-3, 2) + x ** sympy.Rational(1, 4),
    x ** sympy.Rational(1, 10**9),
    1 / (1 + 1 / x) + 1 / sqrt(sin(x)),
    1 / (2 * x - 3 * y) + k / (a + 1),
    sqrt(sqrt(x) + 1) + sqrt(2 * x + 2 * y),
    sqrt(3) * x + sqrt(6) / y + x * sqrt(2 + sqrt(3)),
    x**a + x ** (a - 2) + x ** (2 * a) + 2**x + x**y,
    log(x * y) / x + log(2) * sin(1) * x,
    sympy.asin(x * y) + sympy.acos(x) + sympy.atan(x / y),
    sympy.asinh(x) + sympy.acosh(y + 2) + sympy.atanh(x / 3),
    sympy.erf(x) * y + sympy.besselj(0, x),
    UNKNOWN(2 * x) * y,
    sympy.Integer(-8) ** sympy.Rational(1, 3) * x,
]


def value(formula):
    known = formula.subs(UNKNOWN, sympy.Lambda(x, x**3 + x**2)).doit()
    return complex(sympy.N(known.subs(POINT), 20))


def ring_of(*formulas):
    ring = DifferentialRing(formulas, (x, y))
    return ring, *ring.elements


@pytest.mark.few(20)
@pytest.mark.parametrize("formula", FORMULAS, ids=str)
@pytest.mark.parametrize("along", [(0, 0, 1), (1, 0), (0, 0, 0)], ids=str)
def test_derivatives_are_those_of_sympy(formula, along):
    ring, element = ring_of(formula)
    for i in along:
        formula, element = formula.diff((x, y)[i]), ring.derivative(element, i)
        for simplify in (False, True):
            assert value(ring.to_expression(element, simplify=simplify)) == pytest.approx(value(formula), rel=1e-12)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (sin(x) ** 2, 1 - cos(x) ** 2),
        (sin(3 * x), 3 * sin(x) - 4 * sin(x) ** 3),
        (cos(x - y), cos(x) * cos(y) + sin(x) * sin(y)),
        (tan(2 * x), 2 * tan(x) / (1 - tan(x) ** 2)),
        (sin(x + sympy.pi / 4), (sin(x) + cos(x)) / sqrt(2)),
        (cosh(2 * x), 1 + 2 * sinh(x) ** 2),
        (exp(2 * x) * exp(-3 * x) * exp(x / 2), exp(-x / 2)),
        (1 / (x * (x + 1)), 1 / x - 1 / (x + 1)),
        (1 / (1 + x / y), y / (x + y)),
        (1 / sqrt(x**2 + y**2) ** 3, sqrt(x**2 + y**2) / (x**2 + y**2) ** 2),
        (sqrt(x) * x ** sympy.Rational(1, 3), x ** sympy.Rational(5, 6)),
        (1 / (sqrt(2) * x), sqrt(2) / (2 * x)),
        (sqrt(3) * sqrt(6), 3 * sqrt(2)),
        (sympy.E * exp(-1) * x + exp(sympy.Rational(3, 2)), x + sympy.E * exp(sympy.Rational(1, 2))),
        (x ** (2 * a - 1), (x**a) ** 2 / x),
    ],
    ids=str,
)
def test_equal_formulas_are_equal_elements_and_others_are_not(first, second):
    ring, one, other = ring_of(first, second)
    assert one == other
    assert ring.is_zero(one - other)
    assert one != other + Fraction(1, 10**20)


def test_elements_are_a_ring():
    ring, f, g = ring_of(sin(x) / y, x + exp(y))
    assert (f + g) * (f - g) == f * f - g * g
    assert 2 - f == -(f - 2)
    assert Fraction(1, 2) * f + f * Fraction(1, 2) == f
    assert f.size == 1
    assert ring.derivative(f * g, 0) == ring.derivative(f, 0) * g + f * ring.derivative(g, 0)  # Leibniz
    assert ring.derivative(ring.derivative(g * f, 0), 1) == ring.derivative(ring.derivative(g * f, 1), 0)
    assert f != 1
    with pytest.raises(SeriesError, match="elements must be of one ring, but one was of another"):
        f + ring_of(x)[1]


def test_arguments_and_roots_share_generators():
    def generators(*formulas):
        return set(ring_of(*formulas)[0].generators) - {x, y}

    assert generators(sin(2 * x), sin(3 * x), cos(x)) == {sin(x), cos(x)}
    assert generators(sin(2 * x)) == {sin(2 * x), cos(2 * x)}
    assert generators(cos(x - y), sin(2 * x - 2 * y)) == {cos(x - y), sin(x - y)}
    assert generators(exp(2 * x), exp(3 * x)) == {exp(x)}
    assert generators(exp(-(x**2))) == {exp(-(x**2))}
    assert generators(sqrt(x + y), (x + y) ** -3) == {1 / sqrt(x + y)}


@pytest.mark.parametrize(
    "text",
    [
        "-q*(p**2 - p*q + 1)/2",
        "(p - q)/(p + q)**2",
        "sin(q)**2*p/(p + 1)",
        "p + exp(-q)",
        "x/((p - q)**2 + x**2)**(3/2)",
        "sqrt(p**2 + q**2)",
        "(2*p + q)/(p*(p + q))",
    ],
)
def test_written_forms_are_kept(text):
    """Formulas that nobody would write otherwise come back as they are, even if their numerators are expanded first."""
    from integrators.exact.expressions import parse_expression

    names = ("p", "q", "x")
    formula = parse_expression(text, names=names)
    expanded = formula.expand(numer=True)
    ring = DifferentialRing([expanded, formula], sympy.symbols(names))
    assert [str(ring.to_expression(element)) for element in ring.elements] == [str(formula)] * 2


def test_large_multiples_are_taken_for_independent():
    ring, element = ring_of(sin(10**6 * x) + sin(x) + exp(10**7 * x) * exp(y))
    assert ring.to_expression(ring.derivative(element, 1)) == exp(10**7 * x) * exp(y)


def test_users_functions_may_bear_known_names():
    own = sympy.Function("exp")
    ring, element, known = ring_of(own(x), exp(x))
    assert ring.derivative(element, 0) != element
    assert ring.derivative(known, 0) == known


def test_constants_and_floats():
    ring = DifferentialRing([0.5 * x + 1 / (0.25 * x + y)], [x, y], digits=15)
    assert ring.to_expression(ring.derivative(ring.elements[0], 1)) == -1 / (0.25 * x + y) ** 2
    third = Fraction(1, 3) * ring.elements[0] - Fraction(1, 3) / Fraction(2)
    assert "0.166666666666667*x" in str(ring.to_expression(third))


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        (1 / (sin(x) ** 2 + cos(x) ** 2 - 1), "formula must not divide by zero"),
        (x * sympy.oo, "formula must be finite, but holds"),
        (sympy.nan, "formula must be finite, but holds nan"),
    ],
)
def test_what_is_no_function_is_refused(formula, message):
    with pytest.raises(SeriesError, match=message):
        ring_of(formula)


@pytest.mark.parametrize("formula", [(x + y + 1) ** 200, x ** (10**8), (1 + x) ** (10**30)])
def test_large_powers_are_given_up_early(formula):
    with pytest.raises(TooLarge):
        ring_of(formula)


def test_the_limit_holds_for_results():
    ring = DifferentialRing([(x + y) ** 5, (x - y + 1) ** 5], [x, y], limit=30)
    with pytest.raises(TooLarge):
        ring.elements[0] * ring.elements[1]


@pytest.mark.parametrize("limit", [3000, 4000])
def test_long_products_are_computed_in_parts(limit):
    """(1 + x + y)^80 has 3321 monomials, from 741,321 products."""
    ring = DifferentialRing([(1 + x + y) ** 40], [x, y], limit=limit)
    (element,) = ring.elements
    if limit < 3321:
        with pytest.raises(TooLarge):
            element * element
    else:
        assert (element * element).terms == ring.power(element, 2).terms


def test_rings_grow_beyond_a_word_of_generators():
    """Elements made before the ring had more than eight generators mix with later ones."""
    ring, early, own = ring_of(sin(x) / y, UNKNOWN(x))
    derivatives = [own]
    for _ in range(12):
        derivatives.append(ring.derivative(derivatives[-1], 0))
    assert len(ring.generators) > 12
    product = derivatives[-1] * early - early * derivatives[-1]
    assert not product
    late = early * derivatives[3] + derivatives[10]
    assert ring.to_expression(late, simplify=False) == sin(x) / y * UNKNOWN(x).diff(x, 3) + UNKNOWN(x).diff(x, 10)
    assert ring.elements[0].terms == early.terms


def test_lattices_take_what_does_not_fit_as_it_is():
    lattice = Lattice(int)
    lattice.insert({1: Fraction(2, 3)})
    assert lattice.coordinates({1: 2}) == [({1: Fraction(2, 3)}, 3)]
    assert lattice.coordinates({1: 1}) == [({1: 1}, 1)]  # no integer multiple


def test_assumptions_are_asked_of_functions_of_numbers_only(monkeypatch):
    formulas = cosh(y**7), sin(y**7) * y, sinh(a * y)

    def asked(function):  # for cosh(y**99) the answer of SymPy takes seconds
        raise AssertionError(function)

    for family in (sin, cos, sinh, cosh):
        for fact in ("real", "algebraic"):
            monkeypatch.setitem(family._prop_handler, fact, asked)
    ring = DifferentialRing(formulas, [y])
    assert [ring.to_expression(ring.element(formula)) for formula in formulas] == list(formulas)
