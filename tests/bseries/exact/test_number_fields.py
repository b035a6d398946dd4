"""Number fields of roots within roots: proved minimal polynomials and elements."""

import json
import random
from typing import Any

import mpmath
import pytest
import sympy
from sympy import CRootOf, Integer, Rational, cbrt, cos, pi, sqrt, tan

import bseries as bs
from bseries.exact import number_fields
from bseries.exact.number_fields import NoNumberFieldError, domain_of, is_zero
from integrators import RungeKutta, Splitting
from integrators.exact.arithmetic import degree_bound
from integrators.exact.expressions import parse_number

Z = "(-root(2/27 - 1/(9*sqrt(3)), 3))"
W = f"(-2/3 + 1/(9*{Z}) + {Z})"
Y = f"((1 + {W}^2)/4)"
A1 = f"(sqrt(1/(9*{Y}) - {W}/2 + sqrt({Y})) - 1/(3*sqrt({Y})))"
A2 = f"(1/(4*{A1}) - {A1}/2)"
A3 = f"(1 - {A1} - {A2})"
"""The third-order coefficients of R. I. McLachlan, P. Atela, Nonlinearity 5 (1992) 541–562, by formulas."""
common_field: Any = number_fields.common_field
X = sympy.Symbol("x")
WIDE = "(sqrt(2 + sqrt(3 + sqrt(5)))*cbrt(7 + sqrt(11)) + sqrt(1 + cbrt(2)))"
"""A number of degree 144."""


def kicks_and_drifts(a, b):
    return Splitting([x for i in range(len(a)) for x in (("p", b[i]), ("q", a[i]))], name="typed")


def two_stages(c):
    """The explicit methods of order 2 with two stages."""
    return RungeKutta([[0, 0], [c, 0]], [f"1 - 1/(2*{c})", f"1/(2*{c})"], name="two")


@pytest.mark.slow
def test_a_splitting_typed_by_nested_roots_is_exact():
    typed = kicks_and_drifts((A1, A2, A3), (A3, A2, A1))
    assert abs(typed.flows[1][1] - sympy.Float("0.919661523017399857", 25)) < 1e-18  # as published
    assert bs.order_of(typed) == 3
    field = bs.modified_equation(typed, 4)
    assert field.domain.startswith("QQ<CRootOf(36*x**4 - 96*x**3 + 54*x**2 - 12*x + 1, 0)>")
    decimals = [str(sympy.sympify(parse_number(a), strict=True).evalf(40)) for a in (A1, A2, A3)]
    rounded = bs.modified_equation(kicks_and_drifts(decimals, decimals[::-1]), 4)
    for tree, value in field.items():
        assert float(value) == pytest.approx(float(rounded[tree]), abs=1e-25)


@pytest.mark.slow
def test_one_wrong_digit_in_a_nested_root_is_seen():
    wrong = A1.replace(f"{W}/2", f"{W}/3")
    assert bs.order_of(kicks_and_drifts((wrong, A2, A3), (A3, A2, wrong))) == 0


def test_one_nested_coefficient_among_three_flows():
    method = Splitting([("a", A1), ("b", 1), ("a", f"1 - {A1}")])
    assert bs.order_of(method) == 1
    value = bs.modified_equation(method, 2)["a[b]"]
    assert abs(float(value)) == pytest.approx(0.919661523017399857 - 0.5)  # BCH: (a1 − (1 − a1))/2 [A, B]


FIELDS = {
    "two, by de-nesting": ([sqrt(3 + 2 * sqrt(2))], 2),
    "the golden ratio": ([cbrt(2 + sqrt(5)), sqrt(5)], 2),
    "Ramanujan's": ([cbrt(cbrt(2) - 1), cbrt(Rational(1, 9))], 9),
    "tower": ([sqrt(2 + sqrt(2 + sqrt(2)))], 8),
    "cosine and root of it": ([sqrt(2 + 2 * cos(pi / 9)), cos(pi / 18)], 6),
    "tangent": ([tan(pi / 8), sqrt(4 + 2 * sqrt(2))], 4),
    "root of a polynomial": ([sqrt(CRootOf(X**3 - X - 1, 0)), CRootOf(X**3 - X - 1, 0)], 6),
    "a sum that is rational": ([sqrt(3 + 2 * sqrt(2)) - sqrt(2)], 1),
}


@pytest.mark.parametrize(("numbers", "degree"), FIELDS.values(), ids=FIELDS)
def test_fields_have_the_smallest_degree_and_the_right_elements(numbers, degree):
    field, elements = common_field(numbers)
    assert field.mod.degree() == degree
    for number, element in zip(numbers, elements, strict=True):
        assert abs(field.to_sympy(element).evalf(60) - number.evalf(60)) < 1e-50


def test_fields_agree_with_resultants():
    number = sqrt(1 + sqrt(2)) + sqrt(3)
    field, (element,) = common_field([number])
    assert sympy.Poly(field.mod.to_list(), X).as_expr() == sympy.minimal_polynomial(number, X)
    assert field.to_sympy(element) == field.ext.as_expr()


def random_number(source, depth):
    if depth == 0:
        return Integer(source.randint(1, 9)) / source.randint(1, 5)
    x, y = random_number(source, depth - 1), random_number(source, source.randrange(depth))
    return source.choice([sqrt(x), sqrt(x) + y, 1 / (y + sqrt(x)), y * sqrt(x), x * y])


@pytest.mark.slow
def test_sums_and_products_are_those_of_the_numbers():
    source, found = random.Random(7), 0
    for _ in range(40):
        x, y = (random_number(source, 3) for _ in range(2))
        if degree_bound([x, y]) > 16 or x.is_Rational or y.is_Rational:
            continue
        if (field := common_field([x, y, x + y, x * y])) is not None:
            a, b, total, product = field[1]
            assert (a + b, a * b) == (total, product)
            found += 1
    assert found > 5


def test_zero_is_proved_and_what_is_tiny_is_not_zero():
    assert is_zero(sqrt(3 + 2 * sqrt(2)) - 1 - sqrt(2), 4)
    assert is_zero(cbrt(cbrt(2) - 1) - cbrt(Rational(1, 9)) + cbrt(Rational(2, 9)) - cbrt(Rational(4, 9)), 81)
    with mpmath.workdps(1200):
        near = Rational(str(mpmath.sqrt(3 + 2 * mpmath.sqrt(2))))  # to 1,200 digits
    assert not is_zero(sqrt(3 + 2 * sqrt(2)) - near, 4)


def test_the_inverse_of_a_nested_zero_is_no_entry():
    zero = sqrt(3 + 2 * sqrt(2)) - 1 - sqrt(2)
    with pytest.raises(NoNumberFieldError, match="number field of degree 16 at most"):
        domain_of([sqrt(2 + 1 / zero)], few=True)


def test_beyond_the_bound_numbers_are_floats_and_it_is_said():
    method = two_stages(WIDE)
    assert bs.order_of(method) == 2
    text = str(bs.modified_equation(method, 3))
    assert "Floating point (RR): the tableau holds floats, or roots within roots of a degree above 16" in text
    assert "within rounding errors" in str(bs.check(method))
    c = mpmath.mpf(str(sympy.sympify(parse_number(WIDE), strict=True).evalf(30)))
    assert bs.modified_equation(method, 3)["[τ,τ]"] == pytest.approx(float(c / 2 - mpmath.mpf(1) / 3))


@pytest.mark.parametrize("verb", [bs.series, bs.modified_equation])
def test_documents_of_nested_roots_are_read(verb):
    written = verb(two_stages("sqrt(2 + sqrt(3 + sqrt(5)))"), 4)
    assert "CRootOf" in json.dumps(written.to_dict())
    assert bs.load_series(json.dumps(written.to_dict())) == written


@pytest.mark.parametrize(
    "root", ["x**2 + 1, 0", "x**99 - x - 1, 0", "x/2, 0", "7, 0", "x**2 - 2, 5", "x - 1" + "0" * 99 + ", 0"]
)
def test_other_roots_in_documents_are_refused(root):
    data = bs.series(two_stages("sqrt(2 + sqrt(3 + sqrt(5)))"), 3).to_dict()
    data["terms"][-1]["coefficient"] = f"CRootOf({root})"
    with pytest.raises(bs.SeriesError, match="real roots of integer polynomials up to degree 16, with small"):
        bs.load_series(json.dumps(data))
