"""Formulas as lines of Python: the values are right in doubles and in any precision, and nothing is done twice."""

from __future__ import annotations

import math
import os
import random
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import mpmath
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from integrators import IntegratorError
from integrators.compile import printer
from integrators.compile.modules import load_module
from integrators.compile.printer import FUNCTIONS, Assign, count_operations, operation_cost, source_lines
from integrators.exact.expressions import ELEMENTARY, literal, nearest_double, parse_expression

pytestmark = pytest.mark.minimum

SYMBOLS = x, y, z = sympy.symbols("x y z")
NAMES = {symbol: symbol.name for symbol in SYMBOLS}
ROOT = Path(__file__).parents[3]
HALF, THIRD = sympy.Rational(1, 2), sympy.Rational(1, 3)


@pytest.fixture(autouse=True, scope="module")
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BSERIES_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def text(*formulas, **options):
    statements = [Assign(f"out[{k}]", "=", sympy.sympify(formula)) for k, formula in enumerate(formulas)]
    return "\n".join(source_lines(statements, NAMES, **options))


def evaluate(formulas, values, *, module="math", exact=None):
    """Run the lines with the functions of a module; `exact` converts the numbers, otherwise they are doubles."""
    numbers = []

    def place(number):
        numbers.append(exact(number))
        return f"numbers[{len(numbers) - 1}]"

    with pytest.MonkeyPatch.context() as patch:
        if exact is not None:
            patch.setattr(printer, "literal", place)
        body = text(*formulas).replace("\n", "\n    ")
    names = ", ".join(FUNCTIONS)
    header = f"from {module} import {names}\ndef run(numbers, out, x, y, z):\n"
    run = load_module(f"{header}    {body}\n    return out\n").run
    return run(numbers, [None] * len(formulas), *values)


def reference(formulas, values):
    """What SymPy's own printer gives in 40 digits."""
    with mpmath.workdps(40):
        return [
            +mpmath.mpf(sympy.lambdify(SYMBOLS, formula, "mpmath")(*map(mpmath.mpf, values))) for formula in formulas
        ]


def digits(number):
    """An exact number in mpmath's precision."""
    return mpmath.mpf(sympy.N(sympy.sympify(number), 60))


AWKWARD = [
    "x^5 + x^4*y^2", "x^-1", "x^-3*y + x^-6*z", "sqrt(x)", "x^(3/2)", "x^(-1/2) + x^(-5/2)", "x^(1/4)*y^(-3/4)",
    "1/(x*y)", "x^(1/3)", "x^(-2/3) + x^(4/3)", "x^(7/10)", "cbrt(x + y)*sqrt(x*y)", "sqrt(2*x + 2*y)",
    "(y - x - 5)^3/(x - 7)^2",
    "sqrt(5 - x)", "x^y", "2^x", "(x + y)^(x/3)", "x^(-y)", "sqrt(sqrt(x))^3", "(x^2)^(1/2)", "x^2/3 - y^2/7 + 2*z/9",
    "x^100*y^-100", "sqrt(3)*x/6 + pi*y - exp(1)", "(1 + sqrt(2))^(x/2)", "pi^2*x^pi", "x/1000000000000000000001",
    "sqrt(2)*(x + y) + sqrt(2)*(x + y)^2", "exp(-x^2/2)*sin(3*x - y)", "log(x)^2/log(y + 1)", "7", "pi", "0", "-x - y",
]  # fmt: skip


@pytest.mark.parametrize("formula", [*AWKWARD, *(f"{name}(x/4 + y/8)*z" for name in ELEMENTARY)])
def test_values(formula):
    if "acosh" in formula:
        formula = formula.replace("x/4", "x + 1")
    expression = parse_expression(formula, names=("x", "y", "z"))
    generator = random.Random(formula)
    for _ in range(5):
        values = [generator.uniform(0.5, 2) for _ in SYMBOLS]
        (expected,) = reference([expression], values)
        (found,) = evaluate([expression], values)
        assert abs(found - expected) <= 1e-14 * abs(expected)
        with mpmath.workdps(40):
            (found,) = evaluate([expression], map(mpmath.mpf, values), module="mpmath", exact=digits)
            assert abs(found - expected) <= mpmath.mpf("1e-37") * abs(expected)


def monomials():
    powers = st.tuples(*(st.integers(-4, 6) for _ in SYMBOLS))
    return st.dictionaries(powers, st.fractions(max_denominator=12).filter(bool), min_size=1, max_size=8)


@settings(max_examples=50)
@given(st.lists(monomials(), min_size=1, max_size=3), st.lists(st.integers(1, 9), min_size=3, max_size=3))
def test_rational_formulas_are_exact(polynomials, values):
    def write(polynomial):
        terms = (sympy.Rational(c.numerator, c.denominator) * x**i * y**j * z**k for (i, j, k), c in polynomial.items())
        return sympy.Add(*terms)

    formulas = [write(polynomial) for polynomial in polynomials]
    formulas += [formulas[0] ** 3 + formulas[-1] * x, formulas[0] - formulas[-1]]
    point = [Fraction(value, 7) for value in values]
    at = dict(zip(SYMBOLS, map(sympy.Rational, point), strict=True))
    expected = [formula.subs(at) for formula in formulas]
    found = evaluate(formulas, point, exact=Fraction)
    assert [sympy.Rational(value) for value in found] == expected


WRITTEN = {
    "squares are shared": ([x**4, x**5], ["c0 = x*x", "c1 = c0*c0", "out[0] = c1", "out[1] = x*c1"]),
    "Horner": ([1 + 2 * x + 3 * x**2 + 4 * x**3], ["out[0] = x*(x*(4.0*x + 3.0) + 2.0) + 1.0"]),
    "a single negative power divides": ([y * x**-3], ["out[0] = y/(x*x*x)"]),
    "several share a reciprocal": ([x**-3, x**-6], ["c0 = 1.0/(x*x*x)", "out[0] = c0", "out[1] = c0*c0"]),
    "a reciprocal used once divides": ([x / z + y / z], ["out[0] = (x + y)/z"]),
    "half powers": ([x**sympy.Rational(-3, 2)], ["out[0] = 1.0/(x*sqrt(x))"]),
    "thirds": ([x / 3, -2 * x / 3, x / 4], ["out[0] = x/3.0", "out[1] = -0.6666666666666666*x", "out[2] = 0.25*x"]),
    "equal values": ([x * y, -x * y, x * y], ["c0 = x*y", "out[0] = c0", "out[1] = -c0", "out[2] = c0"]),
    "signs": ([x - y, y - x], ["c0 = x - y", "out[0] = c0", "out[1] = -c0"]),
    "pairs": ([x * y * z, x * y + 1], ["c0 = x*y", "out[0] = z*c0", "out[1] = c0 + 1.0"]),
    "constants": ([sympy.pi, sympy.Integer(0), -THIRD], [
        "out[0] = 3.141592653589793", "out[1] = 0.0", "out[2] = -0.3333333333333333"
    ]),
}  # fmt: skip


@pytest.mark.parametrize(("formulas", "lines"), WRITTEN.values(), ids=WRITTEN)
def test_written(formulas, lines):
    assert text(*formulas).splitlines() == lines


def test_targets_names_and_temporaries():
    formulas = [Assign("c0", "=", x**2 * y), Assign("out[1]", "+=", -(x**2) * z), Assign("total", "-=", x**2)]
    lines = source_lines(formulas, {x: "y[0]", y: "c1", z: "t"})
    assert lines == ["c2 = y[0]*y[0]", "c0 = c1*c2", "out[1] -= c2*t", "total -= c2"]
    assert source_lines([], {}) == []


def test_long_formulas_are_cut_into_lines():
    generator = random.Random(5)
    terms = [generator.randint(1, 99) * sympy.sin(k * x) * sympy.cos(y / k) for k in range(1, 80)]
    lines = text(sympy.Add(*terms), sympy.Add(*terms) ** 2 + z).splitlines()
    assert max(map(len, lines)) < 200
    assert len(lines) > 20


@pytest.mark.parametrize("seed", range(4))
def test_fewer_operations_than_common_subexpressions(seed):
    generator = random.Random(seed)
    powers = [(generator.randint(0, 5), generator.randint(0, 5)) for _ in range(60)]
    terms = [generator.randint(1, 9) * x**i * y**j for i, j in powers]
    formulas = [sympy.Add(*terms[:30]), sympy.Add(*terms[30:])]
    ours = sum(count_operations(text(*formulas).splitlines()).values())
    shared, rest = sympy.cse(formulas)
    theirs = sum(sympy.count_ops(formula) for _, formula in shared) + sum(map(sympy.count_ops, rest))
    assert ours < theirs


@pytest.mark.parametrize(("power", "most"), [(2, 1), (3, 2), (4, 2), (7, 4), (8, 3), (12, 4), (100, 8)])
def test_powers_cost_few_multiplications(power, most):
    assert sum(count_operations(text(x**power).splitlines()).values()) <= most


def test_costs():
    lines = ["c0 = sqrt(x) - 2.0**y", "out[0] += c0*sin(-c0)/3.0"]
    counts = count_operations(lines)
    assert counts == {"add": 2, "multiply": 1, "divide": 1, "sqrt": 1, "call": 1, "power": 1}
    assert operation_cost(lines) == 2 + 1 + 4 + 5 + 20 + 40


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        (sympy.Symbol("u"), "formula must use the names x, y, z, but has 'u'"),
        (sympy.Symbol("x", real=True), "formula must use the names"),
        (abs(x), r"formula must be made of \+ \* \*\* and sin, .*, but has 'Abs\(x\)'"),
        (sympy.Piecewise((x, x > 0), (0, True)), "formula must be made of .*, but has 'Piecewise"),
        (sympy.Function("f")(x), "formula must be made of .*, but has 'f\\(x\\)'"),
        (sympy.I * x, "formula must have finite real numbers only, but has 'I'"),
        (x + sympy.oo, "formula must have finite real numbers only, but has 'oo'"),
        (x**sympy.nan, "formula must have finite real numbers only, but has 'nan'"),
        (sympy.log(-2) * x, "formula must have finite real numbers only, but has 'I'"),
        (
            1 / (sympy.sqrt(2) * (x**2 + x * y) - sympy.sqrt(2) * x * (x + y)),
            "formula must not divide by zero, but does",
        ),
        (x * 10**400, "formula must have numbers that doubles can stand for, but has 10"),
        (x * sympy.exp(sympy.exp(9)), "formula must have numbers that doubles can stand for"),
    ],
)
def test_refusals(formula, message):
    with pytest.raises(IntegratorError, match=message):
        text(formula)


def test_roots_of_polynomials_are_numbers():
    root = sympy.CRootOf(x**5 - x - 1, 0)
    assert text(root * x) == "out[0] = 1.1673039782614187*x"


@pytest.mark.parametrize(
    "number",
    [sympy.sqrt(2), sympy.pi, sympy.exp(20), HALF - sympy.sqrt(3) / 6, sympy.sqrt(10**40 + 1) - 10**20, sympy.log(2)],
)
def test_literals_are_the_nearest_doubles(number):
    with mpmath.workdps(80):
        exact = mpmath.mpf(sympy.N(number, 80))
        found = float(literal(number))
        below, above = math.nextafter(found, -math.inf), math.nextafter(found, math.inf)
        assert abs(exact - found) < min(abs(exact - below), abs(exact - above))


def test_square_roots_are_rounded_to_the_nearest_double():
    with mpmath.workdps(60):
        roots = {k: mpmath.sqrt(k) for k in range(2, 400) if math.isqrt(k) ** 2 != k}
        expected = {k: nearest(root) for k, root in roots.items()}
    assert len(roots) == 380
    assert {k: nearest_double(sympy.sqrt(k)) for k in roots} == expected


def nearest(number):
    """That of three neighbouring doubles which is nearest."""
    near = float(number)
    candidates = math.nextafter(near, -math.inf), near, math.nextafter(near, math.inf)
    return min(candidates, key=lambda double: abs(double - number))


HALFWAY = Fraction(2**53 + 1)


@pytest.mark.parametrize(
    ("number", "expected"),
    [
        (Fraction(1, 3), 1 / 3),
        (HALFWAY, 2.0**53),
        (HALFWAY + Fraction(1, 10**50), 2.0**53 + 2),  # rounding to 40 digits first would lose this
        (-3, -3.0),
        (0, 0.0),
        (Fraction(1, 10**400), 0.0),
        (Fraction(3, 2**1076), 2.0**-1074),
    ],
)
def test_rational_numbers_are_rounded_once(number, expected):
    assert nearest_double(number) == expected
    assert nearest_double(sympy.Rational(number)) == expected


@pytest.mark.parametrize(
    ("number", "error"),
    [
        (10**400, OverflowError),
        (sympy.Integer(10) ** 400, OverflowError),
        (sympy.exp(2000), OverflowError),
        (sympy.sin(1) ** 2 + sympy.cos(1) ** 2 - 1, ArithmeticError),
        (x, TypeError),
        (sympy.I * sympy.sqrt(2), TypeError),
        (sympy.oo, TypeError),
        (None, TypeError),
    ],
    ids=str,
)
def test_what_is_near_no_double(number, error):
    with pytest.raises(error):
        nearest_double(number)


PROGRAM = """
import sympy
from integrators.compile.printer import Assign, source_lines
x, y, z = sympy.symbols("x y z")
r = sympy.sqrt(x**2 + y**2 + z**2)
V = sympy.exp(-r)/r**6 + sympy.sin(x*y)*sympy.cos(x*y)*z**3 - (x + y)**5*(x - z)**2/3
gradient = [V.diff(s) for s in (x, y, z)] + [sympy.expand((x + 2*y - z)**4).diff(x)]
print(*source_lines([Assign(f"out[{k}]", "=", f) for k, f in enumerate(gradient)], {x: "x", y: "y", z: "z"}), sep="\\n")
"""


def test_text_is_the_same_in_every_process():
    def run(seed):
        environment = {**os.environ, "PYTHONHASHSEED": str(seed)}
        command = [sys.executable, "-c", PROGRAM]
        return subprocess.run(command, capture_output=True, text=True, check=True, env=environment, cwd=ROOT).stdout

    first, *others = [run(seed) for seed in (0, 1, 2)]
    assert first.count("\n") > 10
    assert others == [first, first]
