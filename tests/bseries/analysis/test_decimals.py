"""Orders and structure of methods whose entries are rounded decimals, against those of the exact methods."""

import math
import random
from collections import Counter
from fractions import Fraction
from itertools import islice

import mpmath
import numpy as np
import pytest
import sympy
from rounded_methods import cases, rounded, unit

import bseries as bs
from bseries.analysis.report import structure_of
from bseries.analysis.rounding import RoundedOrder, rounded_order
from integrators import PartitionedRungeKutta, RungeKutta, Splitting
from integrators.exact.entries import half_unit
from integrators.methods.catalogue.registry import catalogue


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
    missed, units = missed_changes(40, 3)
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


# Rounded numbers that nobody calls so

DIAGONAL, OTHER = "0.292893218813452", "0.707106781186548"
WRITTEN = {
    "text": (str, 15),
    "fractions": (Fraction, 15),
    "doubles": (float, 15),
    "doubles of NumPy": (np.float64, 15),
    "single precision": (lambda x: np.float32(float(x)), 7),
    "nearby fractions": (lambda x: Fraction(x).limit_denominator(10**6), 12),
}


def sdirk(write, **labels):
    diagonal, other = write(DIAGONAL), write(OTHER)
    return RungeKutta([[diagonal, 0], [other, diagonal]], [other, diagonal], warn=False, **labels)


@pytest.mark.parametrize("how", WRITTEN)
def test_rounded_numbers_are_recognised_however_they_are_written(how):
    write, digits = WRITTEN[how]
    assert rounded_order(sdirk(write)) == (2, digits)
    assert bs.order_of(sdirk(write, digits=digits)) == 2
    report = bs.check(sdirk(write))
    assert report.rounded == (None if report.order == 2 else (2, digits))


@pytest.mark.parametrize("array", [False, True])
def test_single_precision_says_how_many_digits_it_has(array):
    diagonal, other = np.float32(DIAGONAL), np.float32(OTHER)
    A, b = [[diagonal, 0], [other, diagonal]], [other, diagonal]
    method = RungeKutta(np.array(A, np.float32), np.array(b, np.float32)) if array else RungeKutta(A, b)
    report, field = bs.check(method), bs.modified_equation(method, 3)
    assert (method.digits, bs.order_of(method), report.order, report.rounded) == (7, 2, 2, None)
    assert field.is_zero("[τ]")
    assert not field.is_zero("[τ,τ]")
    assert bs.symmetry(method, 4).order == bs.symmetry(sdirk(float), 4).order
    third, half = np.float32(1 / 3), np.float32(1 / 2)
    splitting = Splitting([("p", third), ("q", half), ("p", third), ("q", half), ("p", third)])
    assert (splitting.digits, bs.order_of(splitting)) == (7, 2)
    wrong = Splitting([("p", third), ("q", half), ("p", third), ("q", half), ("p", third + np.float32(1e-6))])
    assert bs.order_of(wrong) == 0
    flows = [("p", 0.333333), ("q", 0.5), ("p", 0.333333), ("q", 0.5), ("p", 0.333333)]
    assert [bs.order_of(Splitting(flows, digits=digits)) for digits in (None, 6)] == [0, 2]


def test_a_number_has_the_same_uncertainty_however_it_is_written():
    def found(write):
        s = bs.series(bs.analysis.order.trusted(sdirk(write, digits=15)), 4)
        return s.coefficients(), [s.uncertainty(at) for at in range(len(s))]

    assert found(str) == found(Fraction) == found(float) == found(np.float64)


def test_a_report_says_to_how_many_digits():
    report = bs.check(sdirk(str))
    assert (report.order, str(report.rounded)) == (1, "order 2 to 15 digits")
    assert report.to_dict()["rounded_order"] == {"order": 2, "digits": 15}
    text = str(report)
    assert "order to 15 digits" in text
    assert "with digits = 15 they count as zero" in text
    exact = bs.check("rk4")
    assert exact.rounded is None
    assert "rounded_order" not in exact.to_dict()


def test_too_many_digits_are_seen():
    """Of a method that claims 15 digits, one number has twelve."""
    method = RungeKutta([["0.292893218813", 0], [OTHER, DIAGONAL]], [OTHER, DIAGONAL], digits=15, warn=False)
    report = bs.check(method)
    assert (report.order, report.rounded) == (1, (2, 12))


PRINCE_DORMAND = """1/18
1/48 1/16
1/32 0 3/32
5/16 0 -75/64 75/64
3/80 0 0 3/16 3/20
29443841/614563906 0 0 77736538/692538347 -28693883/1125000000 23124283/1800000000
16016141/946692911 0 0 61564180/158732637 22789713/633445777 545815736/2771057229 -180193667/1043307555
39632708/573591083 0 0 -433636366/683701615 -421739975/2616292301 100302831/723423059 790204164/839813087
    800635310/3783071287
246121993/1340847787 0 0 -37695042795/15268766246 -309121744/1061227803 -12992083/490766935 6005943493/2108947869
    393006217/1396673457 123872331/1001029789
-1028468189/846180014 0 0 8478235783/508512852 1311729495/1432422823 -10304129995/1701304382 -48777925059/3047939560
    15336726248/1032824649 -45442868181/3398467696 3065993473/597172653
185892177/718116043 0 0 -3185094517/667107341 -477755414/1098053517 -703635378/230739211 5731566787/1027545527
    5232866602/850066563 -4093664535/808688257 3962137247/1805957418 65686358/487910083
403863854/491063109 0 0 -5068492393/434740067 -411421997/543043805 652783627/914296604 11173962825/925320556
    -13158990841/6184727034 3936647629/1978049680 -160528059/685178525 248638103/1413531060 0
14005451/335480064 0 0 0 0 -59238493/1068277825 181606767/758867731 561292985/797845732 -1041891430/1371343529
    760417239/1151165299 118820643/751138087 -528747749/2220607170 1/4
"""


@pytest.mark.parametrize("kind", [pytest.param("rounded", marks=pytest.mark.slow), "digits"])
def test_rational_approximations(kind):
    """P. J. Prince, J. R. Dormand, J. Comput. Appl. Math. 7 (1981), 67–75: RK8(7)13M in fractions."""
    *rows, weights = (row.split() for row in PRINCE_DORMAND.replace("\n    ", " ").strip().splitlines())
    A = [["0"] * 13, *(row + ["0"] * (13 - len(row)) for row in rows)]
    if kind == "rounded":
        assert str(rounded_order(RungeKutta(A, weights, warn=False))) == "order 8 to 17 digits"
    else:
        assert [bs.order_of(RungeKutta(A, weights, warn=False, digits=d)) for d in (15, 17, 18)] == [8, 8, 0]


@pytest.mark.few(20)
@pytest.mark.parametrize("entry", [e for e in catalogue() if not e.parameters], ids=lambda e: e.name)
def test_methods_of_the_catalogue_are_as_good_as_their_digits(entry):
    """No method seems to be a rounded one of larger order: residuals of methods are far from those of rounding."""
    method = bs.method(entry.name + "3" * entry.is_family)
    report = bs.analysis.rounding.hidden_order(method, bs.order_of(method))
    assert report is None


def test_splittings_and_pairs():
    with mpmath.workdps(50):
        g = 1 / (2 - mpmath.cbrt(2))
        times = [g / 2, g, (1 - g) / 2, 1 - 2 * g, (1 - g) / 2, g, g / 2]
        jump = bs.methods.Splitting([("pq"[k % 2], rounded(x, 14)) for k, x in enumerate(times)])
    assert (bs.order_of(jump), rounded_order(jump)) == (0, (4, 14))
    pair = in_decimals(bs.method("lobatto-iiia-iiib3"), 13)
    parts = {name: part.with_digits(None) for name, part in zip(pair.names, pair.partitions, strict=True)}
    assert rounded_order(PartitionedRungeKutta(parts, warn=False)) == RoundedOrder(4, 13)
