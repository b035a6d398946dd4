"""Costs by order: digits are counted rightly, and every kind of numbers and every scene has its rows."""

import sys
from fractions import Fraction
from pathlib import Path

import pytest
import sympy

import bseries as bs

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks import algebra_growth, fresh_growth, scene_growth  # noqa: E402


@pytest.mark.parametrize(
    ("coefficient", "largest"),
    [
        (Fraction(-7, 12), 12),
        (Fraction(-70, 12), 35),
        (Fraction(0), 1),
        (sympy.Rational(-5, 36) + sympy.sqrt(3) / 81, 81),
        (sympy.Symbol("gamma") ** 2 * 40 - sympy.Rational(1, 6), 40),
    ],
)
def test_the_largest_integer_in_a_coefficient(coefficient, largest):
    assert fresh_growth.largest_integer(coefficient) == largest


def test_digits_are_those_of_the_largest_number_of_each_order():
    field = bs.modified_equation(bs.method("explicit-midpoint"), 4)
    numbers = [max(abs(x.numerator), x.denominator) for x in field.coefficients()]
    assert fresh_growth.by_order(field, numbers) == [1, 1, 12, 8]
    assert fresh_growth.largest_digits(field) == [1, 1, 2, 1]


def test_digits_that_are_right():
    assert fresh_growth.digits_of(1e-9) == pytest.approx(9)
    assert fresh_growth.digits_of(0.0) == fresh_growth.digits_of(1e-30) == pytest.approx(15.95, abs=0.01)
    field = bs.modified_equation(fresh_growth.DOMAINS["float"](), 5)
    digits = fresh_growth.right_digits(field)
    assert digits[0] == pytest.approx(15.95, abs=0.01)
    assert 13 < digits[4] < 15.5
    off = bs.BSeries.from_rule(lambda tree: field[tree] * (1 + 1e-6 * (str(tree) == "[τ,τ]")), 5, empty=0)
    assert fresh_growth.right_digits(off)[2] == pytest.approx(6, abs=0.01)


def test_the_four_kinds_of_numbers_are_values_of_one_tableau():
    series = {name: bs.modified_equation(make(), 4) for name, make in fresh_growth.DOMAINS.items()}
    assert [s.domain for s in series.values()] == ["RR", "QQ", "QQ<sqrt(3)>", "QQ[gamma]"]
    gamma, polynomials = sympy.Symbol("gamma"), series["symbolic"].coefficients()
    for name, value in (("exact", sympy.Rational(1, 3)), ("algebraic", (3 + sympy.sqrt(3)) / 6)):
        for general, special in zip(polynomials, series[name].coefficients(), strict=True):
            assert sympy.simplify(sympy.sympify(general).subs(gamma, value) - special) == 0


@pytest.fixture(scope="module")
def algebra():
    return algebra_growth.measure(limit=0.0)


@pytest.mark.slow
def test_the_algebra_is_measured_in_a_process_of_its_own(algebra):
    assert [(row["domain"], row["order"], row["trees"]) for row in algebra] == [
        (domain, 1, 1) for domain in ("float", "exact", "algebraic", "symbolic")
    ]
    assert all(row["seconds"] > 0 and row["bytes"] >= 0 and row["digits"] >= 1 for row in algebra)


def rows_of(**series):
    """Rows of several orders."""
    trees = [1, 2, 4]
    return [
        {"domain": domain, "order": n, "trees": trees[n - 1], "seconds": seconds, "bytes": 10**6 * n, "digits": n}
        for domain, times in series.items()
        for n, seconds in enumerate(times, 1)
    ]


def test_tables_have_a_row_for_each_order_and_gaps_where_a_kind_ended():
    rows = rows_of(float=[1e-3, 2e-3, 4e-3], exact=[0.1, 0.2], algebraic=[1], symbolic=[2])
    times, sizes = algebra_growth.tables(rows)
    assert times.headings[:4] == ["order", "trees", "floats", "fractions"]
    assert times.rows[1] == ["2", "2", "2 ms", "200 ms", "", "", "1 ms", "100 ms", "", ""]
    assert sizes.rows[2] == ["3", "4", "3 MB", "", "", "", "3", "", "", ""]
    assert {len(row) for table in (times, sizes) for row in table.rows} == {len(times.headings)}
    works = [figure.work for figure in algebra_growth.figures(rows)]
    assert len(works) == len(set(works)) == len(rows)


def test_the_picture_of_the_algebra_has_a_curve_for_each_kind_of_numbers():
    rows = rows_of(float=[1e-3, 2e-3, 4e-3], exact=[0.1, 0.2], algebraic=[1], symbolic=[2])
    times, digits = algebra_growth.draw(rows).axes
    assert [len(line.get_xdata()) for line in times.lines] == [3, 2, 1, 1]
    assert list(times.lines[0].get_ydata()) == pytest.approx([1e3, 1e3, 1e3])
    assert list(digits.lines[1].get_ydata()) == [1, 2]


@pytest.fixture(scope="module")
def pendulum():
    """One route in a process of its own, as in the benchmark, the other one here."""
    measured = algebra_growth.grown("scene", "pendulum", "rk4", "auto", limit=0.0)
    return measured + fresh_growth.scene("pendulum", "rk4", "towers", limit=0.0)


@pytest.mark.slow
def test_a_series_on_a_scene_is_measured(pendulum):
    assert [(row["route"], row["order"]) for row in pendulum] == [("auto", 1), ("towers", 1)]
    assert all(row["seconds"] > 0 and row["ready"] > 0 and row["digits"] > 14 for row in pendulum)
    first, second = scene_growth.tables(pendulum)
    assert (first.title, second.title) == ("rk4 on pendulum", "rk4 on pendulum, by towers")
    assert {len(first.headings)} == {len(row) for row in first.rows}
    assert [len(panel.lines) for panel in scene_growth.draw(pendulum).axes] == [2, 2]
    assert [figure.unit for figure in scene_growth.figures(pendulum)] == ["s", "s"]


def test_a_value_that_is_off_has_fewer_digits():
    import numpy as np

    field = bs.modified_field(bs.method("rk4"), bs.scene("pendulum"), 5)
    point = np.array([0.3, 1.2])
    value = field(point, fresh_growth.STEP)
    assert fresh_growth.precise_error(field, point, value) < 1e-14
    assert fresh_growth.precise_error(field, point, value * (1 + 1e-8)) == pytest.approx(1e-8, rel=1e-3)
