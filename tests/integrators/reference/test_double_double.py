"""Double-double numbers against mpmath, over wide ranges, and what happens without strict rules of floating point."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from numba import njit

from integrators.exact.expressions import ELEMENTARY
from integrators.reference import double_double as dd

UNIT = 2.0**-106
TOLERANCE = 6 * UNIT
SAMPLES = 150


@pytest.fixture(autouse=True)
def precise():
    with mpmath.workprec(600):
        yield


def exactly(x):
    return mpmath.mpf(x[0]) + mpmath.mpf(x[1])


def pair(source, high):
    """A double with something below it."""
    return dd.quick_two_sum(high, high * 2.0**-54 * source.uniform(-1, 1))


def log_uniform(low, high, signs=(1, -1)):
    return lambda source: source.choice(signs) * 10 ** source.uniform(low, high)


def positive(low, high):
    return log_uniform(low, high, signs=(1,))


def uniform(low, high):
    return lambda source: source.uniform(low, high)


def near_one(source):
    return 1 + source.choice([1, -1]) * 10 ** source.uniform(-17, -0.5)


def near_the_ends(source):
    return source.choice([1, -1]) * (1 - 10 ** source.uniform(-15, -1))


def above_one(source):
    return 1 + 10 ** source.uniform(-15, 1)


def error(found, expected):
    return abs(exactly(found) / expected - 1) if expected else abs(exactly(found))


@pytest.mark.parametrize("name", ["two_sum", "two_product"])
def test_transformations_are_free_of_error(name):
    source = np.random.default_rng(1)
    exact = {"two_sum": lambda x, y: x + y, "two_product": lambda x, y: x * y}[name]
    for _ in range(SAMPLES):
        x, y = log_uniform(-100, 100)(source), log_uniform(-20, 20)(source)
        high, low = getattr(dd, name)(x, y)
        assert Fraction(high) + Fraction(low) == exact(Fraction(x), Fraction(y))
        assert high == exact(x, y)


@pytest.mark.parametrize("flags", [{"contract"}, True], ids=["contract", "all"])
def test_callers_with_loose_rules_change_nothing(flags):
    two_sum, two_product = dd.two_sum, dd.two_product

    @njit(fastmath=flags)
    def loose(x, y):
        return two_sum(x, y), two_product(x, y)

    assert loose(1.0, 1e-20) == ((1.0, 1e-20), (1e-20, 0.0))
    third = 1 / 3
    assert loose(third, third)[1] == (third * third, float(Fraction(third) ** 2 - Fraction(third * third)))


def test_loose_rules_would_break_a_transformation():
    assert njit(fastmath=True)(dd.two_sum.py_func)(1.0, 1e-20) != (1.0, 1e-20)


@pytest.mark.parametrize(
    ("name", "exact"),
    [
        ("add", lambda x, y: x + y),
        ("subtract", lambda x, y: x - y),
        ("multiply", lambda x, y: x * y),
        ("divide", lambda x, y: x / y),
    ],
)
def test_arithmetic(name, exact):
    source = np.random.default_rng(2)
    for _ in range(SAMPLES):
        x, y = (pair(source, log_uniform(-3, 3)(source)) for _ in range(2))
        assert error(getattr(dd, name)(x, y), exact(exactly(x), exactly(y))) < 3 * UNIT


def test_sums_keep_relative_precision_where_high_parts_cancel():
    x, y = (1.0, 3e-17), (-1.0, 1e-17)
    assert exactly(dd.add(x, y)) == exactly(x) + exactly(y)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 7, -1, -3, -7])
def test_integer_powers(n):
    source = np.random.default_rng(3)
    for _ in range(SAMPLES):
        x = pair(source, log_uniform(-2, 2)(source))
        assert error(dd.integer_power(x, n), exactly(x) ** n) < 2 * (abs(n) + 1) * UNIT


def test_square_root():
    source = np.random.default_rng(4)
    for _ in range(SAMPLES):
        x = pair(source, positive(-280, 300)(source))
        assert error(dd.square_root(x), mpmath.sqrt(exactly(x))) < 4 * UNIT
    assert dd.square_root((0.0, 0.0)) == (0.0, 0.0)
    assert math.isnan(dd.square_root((-1.0, 0.0))[0])


def test_numbers_are_split_to_the_nearest_pair():
    high, low = dd.split(Fraction(1, 10))
    assert high == 0.1
    assert low == float(Fraction(1, 10) - Fraction(0.1))
    with pytest.raises(OverflowError):
        dd.split(Fraction(10) ** 400)


RANGES = [
    ("exp", log_uniform(-20, 2)),
    ("exp", uniform(-600, 700)),
    ("expm1", log_uniform(-20, 2)),
    ("log", positive(-300, 300)),
    ("log", uniform(0, 10)),
    ("log", near_one),
    ("log1p", log_uniform(-30, -0.1)),
    ("log1p", positive(-1, 300)),
    ("sin", log_uniform(-20, 1)),
    ("sin", log_uniform(0, 15)),
    ("cos", log_uniform(-20, 1)),
    ("cos", log_uniform(0, 15)),
    ("tan", log_uniform(-20, 1)),
    ("tan", log_uniform(0, 15)),
    ("asin", log_uniform(-20, 0)),
    ("asin", near_the_ends),
    ("acos", log_uniform(-20, 0)),
    ("acos", near_the_ends),
    ("atan", log_uniform(-20, 3)),
    ("atan", log_uniform(-300, 300)),
    ("sinh", log_uniform(-20, 1)),
    ("sinh", uniform(-700, 700)),
    ("cosh", log_uniform(-20, 1)),
    ("cosh", uniform(-700, 700)),
    ("tanh", log_uniform(-20, 1)),
    ("tanh", uniform(-700, 700)),
    ("asinh", log_uniform(-20, 2)),
    ("asinh", log_uniform(-300, 300)),
    ("acosh", above_one),
    ("acosh", positive(0, 300)),
    ("atanh", log_uniform(-20, 0)),
    ("atanh", near_the_ends),
    ("erf", log_uniform(-20, 0)),
    ("erf", uniform(-12, 12)),
]


@pytest.mark.few(10)
@pytest.mark.parametrize(("name", "draw"), RANGES, ids=[f"{k}-{name}" for k, (name, _) in enumerate(RANGES)])
def test_elementary_functions(name, draw):
    source, function = np.random.default_rng(5), getattr(dd, name)
    exact = {"log1p": lambda x: mpmath.log(1 + x)}.get(name) or getattr(mpmath, name)
    for _ in range(SAMPLES):
        x = pair(source, draw(source))
        assert error(function(x), exact(exactly(x))) < TOLERANCE


def test_every_function_of_formulas_is_tested():
    assert set(ELEMENTARY) <= {name for name, _ in RANGES}


@pytest.mark.parametrize("k", [1, 2, 3, 64, 10**6 + 1])
def test_sines_near_multiples_of_half_a_turn_keep_absolute_precision(k):
    high = float(k * mpmath.pi)
    x = high, float(k * mpmath.pi - high)
    assert abs(exactly(dd.sin(x)) - mpmath.sin(exactly(x))) < 1e-45 * k


def test_angles_are_reduced_by_more_than_two_doubles():
    high = float(64 * mpmath.pi)
    x = high, float(64 * mpmath.pi - high)  # the sine is what is missing in x, below 1e-30
    twice = dd.subtract(x, dd.scale(dd.HALF_PI[:2], 128.0))
    assert abs(exactly(twice) / mpmath.sin(exactly(x)) - 1) > 1e-3
    assert error(dd.sin(x), mpmath.sin(exactly(x))) < 1e-12


@pytest.mark.parametrize(
    ("name", "x"), [("log", -1.0), ("asin", 1.5), ("acos", -2.0), ("acosh", 0.5), ("atanh", 2.0), ("sin", 1e300)]
)
def test_outside_their_domain_functions_are_nan(name, x):
    assert math.isnan(sum(getattr(dd, name)((x, 0.0))))


@pytest.mark.parametrize(("x", "expected"), [(1000.0, math.inf), (-1000.0, 0.0), (0.0, 1.0), (math.nan, math.nan)])
def test_extreme_exponentials(x, expected):
    assert dd.exp((x, 0.0)) == pytest.approx((expected, 0.0), nan_ok=True)
