"""Orders and structure of methods whose entries are rounded decimals, against those of the exact methods."""

import math
import random
from collections import Counter
from fractions import Fraction
from itertools import islice

import mpmath
import pytest
import sympy
from rounded_methods import cases, rounded, unit

import bseries as bs
from bseries.analysis.report import structure_of
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.exact.entries import half_unit


def order_of_rounded(case, digits):
    return bs.order_of(case.make([rounded(x, digits) for x in case.numbers], digits))


def wrong_orders(count, seed):
    source = random.Random(seed)
    found = ((case, source.randint(6, 60)) for case in islice(cases(seed), count))
    return [(case.kind, digits) for case, digits in found if order_of_rounded(case, digits) != case.order]


def test_correct_digits_show_the_order():
    assert wrong_orders(100, 1) == []


@pytest.mark.slow
def test_correct_digits_show_the_order_of_five_thousand_methods():
    assert wrong_orders(5000, 2) == []


def least_units(case, digits, numbers, at):
    """A number of units by which an entry must differ so that other entries cannot make up for it.

    It moves a coefficient by more than twice its uncertainty: what the true entries and others with the same digits
    may differ by.
    """
    changed = list(numbers)
    changed[at] += unit(case.numbers[at], digits)
    s, moved = (bs.series(case.make(x, digits), case.order) for x in (numbers, changed))
    differences = [abs(x - y) for x, y in zip(s.coefficients(), moved.coefficients(), strict=True)]
    return math.ceil(min(2.02 * s.uncertainty(k) / float(x) for k, x in enumerate(differences) if x))


def missed_changes(count, seed):
    """Changes of one digit that leave the order as it was, and the numbers of units changed."""
    source, missed, units = random.Random(seed), [], []
    for case in islice(cases(seed), count):
        digits = source.randint(6, 60)
        numbers = [rounded(x, digits) for x in case.numbers]
        at = source.choice([k for k, x in enumerate(numbers) if x])
        units.append(least_units(case, digits, numbers, at))
        numbers[at] += source.choice((-1, 1)) * units[-1] * unit(case.numbers[at], digits)
        if bs.order_of(case.make(numbers, digits)) >= case.order:
            missed.append((case.kind, digits, at, units[-1]))
    return missed, sorted(units)


def test_changed_digits_are_found():
    missed, units = missed_changes(60, 3)
    assert missed == []
    assert units[len(units) // 2] <= 5


@pytest.mark.slow
def test_changed_digits_of_five_thousand_methods_are_found():
    missed, units = missed_changes(5000, 4)
    assert missed == []
    assert units[len(units) // 2] <= 5
    assert units[len(units) * 9 // 10] <= 30


@pytest.mark.parametrize("digits", [9, 12, 18, 19, 34, 38, 41, 53])
def test_signs_that_cancelled(digits):
    """Ralston's method, whose order was 1 with these digits, and where a coefficient counted as zero."""
    third = RungeKutta([[0, 0], [Fraction(2 * 10**digits // 3 + 1, 10**digits), 0]], ["0.25", "0.75"], digits=digits)
    assert bs.order_of(third) == 2
    ralston = RungeKutta([["0", "0"], ["0.666666667", "0"]], ["0.25", "0.75"], digits=9)
    assert bs.order_of(ralston) == 2
    assert bs.modified_equation(ralston, 3).is_zero("[τ]")
    assert not bs.modified_equation(ralston, 3).is_zero("[[τ]]")


def test_what_half_units_reach_is_the_limit():
    """With c = 2/3 + x the residual of [τ] is 3 x/4, and half a unit of c and both weights moves it by 13/12 units."""
    A, b = [[0, 0], [Fraction("0.666666667"), 0]], [Fraction("0.25"), Fraction("0.75")]
    u = Fraction(1, 10**9)
    reach = (b[1] * u / 2 + A[1][0] * u / 2) / b[1]
    for sign in (-1, 1):
        inside, outside = (Fraction(2, 3) + sign * reach * x for x in (Fraction(99, 100), Fraction(101, 100)))
        orders = [bs.order_of(RungeKutta([[0, 0], [c, 0]], b, digits=9, warn=False)) for c in (inside, outside)]
        assert orders == [2, 1]


NAMES = ("rk4", "heun3", "gauss2", "gauss3", "lobatto-iiia3", "radau-iia2", "trapezoidal", "crouzeix3", "lobatto-iiib3")
PAIRS = ("lobatto-iiia-iiib3", "lobatto-iiia-iiib2", "stormer-verlet", "symplectic-euler-p")


def in_decimals(method, digits):
    """A tableau, or a pair of them, with all entries rounded."""
    if isinstance(method, PartitionedRungeKutta):
        parts = {name: in_decimals(part, digits) for name, part in zip(method.names, method.partitions, strict=True)}
        return PartitionedRungeKutta(parts, warn=False)

    def entry(x):
        with mpmath.workdps(80):
            return rounded(mpmath.mpf(sympy.N(sympy.sympify(x), 75)._to_mpmath(300)), digits)

    rows = [[entry(x) for x in row] for row in (*method.A, method.b)]
    return RungeKutta(rows[:-1], rows[-1], digits=digits, warn=False)


def verdicts(method, order):
    found = structure_of(method, order, bs.order_of(method))
    return {name: (x.order, str(x.breaks)) for name, x in found.items()}


@pytest.mark.parametrize("digits", [8, 33])
@pytest.mark.parametrize("name", [*NAMES, *PAIRS])
def test_structure_of_decimals_is_that_of_the_exact_method(name, digits):
    exact = bs.method(name)
    order = 5 if isinstance(exact, PartitionedRungeKutta) else 6
    assert verdicts(in_decimals(exact, digits), order) == verdicts(exact, order)


@pytest.mark.parametrize("name", ["gauss2", "lobatto-iiia-iiib3", "lobatto-iiia3"])
def test_a_changed_digit_breaks_structure(name):
    def change(x, digits):
        return x + 200 * half_unit(x, digits)

    method = in_decimals(bs.method(name), 20)
    part = method.partitions[0]
    rows = [list(row) for row in part.A]
    rows[-1][0] = change(rows[-1][0], 20)
    changed = RungeKutta(rows, part.b, digits=20, warn=False)
    if isinstance(method, PartitionedRungeKutta):
        changed = PartitionedRungeKutta(dict(zip(method.names, (changed, method.partitions[1]), strict=True)))
    found, wanted = verdicts(changed, 4), verdicts(method, 4)
    assert found.keys() == wanted.keys()
    changes = Counter(found[name] != wanted[name] for name in found)
    assert changes[True] >= 3
    assert wanted["symmetric"][0] == 4 > found["symmetric"][0]
