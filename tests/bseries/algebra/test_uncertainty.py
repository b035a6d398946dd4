"""Uncertainties of coefficients against exact series of methods with changed entries."""

import random
from fractions import Fraction
from itertools import product

import numpy as np
import pytest

import bseries as bs
from bseries.algebra.uncertainty import conjugated
from integrators import PartitionedRungeKutta, RungeKutta, Splitting
from integrators.exact.entries import half_unit
from integrators.methods.kinds.extended_runge_kutta import Rosenbrock
from integrators.methods.kinds.second_order import RungeKuttaNystrom
from trees import TreeTable, Words

DIGITS = 40
TSIT5 = bs.method("tsit5")


def tableau(x, digits):
    return RungeKutta([x[:3], x[3:6], x[6:9]], x[9:], digits=digits, warn=False)


def partitioned(x, digits):
    parts = {"p": tableau(x[:12], digits), "q": tableau(x[12:], digits)}
    return PartitionedRungeKutta(parts, warn=False)


def splitting(x, digits):
    return Splitting([("abc"[k % 3], v) for k, v in enumerate(x)], digits=digits)


def rosenbrock(x, digits):
    return Rosenbrock([[0, 0], [x[0], 0]], [[x[1], 0], [x[2], x[1]]], x[3:], digits=digits)


def nystrom(x, digits):
    return RungeKuttaNystrom([[0, 0], [x[0], 0]], x[1:3], x[3:5], [0, x[5]], digits=digits)


ENTRIES = [Fraction(k, 100) for k in (31, -20, 170, 6, 40, 93, -71, 11, 230, 25, 50, -35)]
KINDS = {
    "tableau": (tableau, ENTRIES, 5),
    "partitioned": (partitioned, [*ENTRIES, *(x / 2 for x in ENTRIES[::-1])], 4),
    "splitting": (splitting, ENTRIES[:7], 4),
}
RELATIVE = {"rosenbrock": (rosenbrock, ENTRIES[1:6], 4), "nystrom": (nystrom, ENTRIES[:6], 4)}
"""Kinds whose entries are known to a relative error."""


def worst_case(function, make, entries, errors):
    """Σ over the entries of the change of an exact function of a method with one entry."""
    base, found = function(make(entries, None)), None
    for k, error in enumerate(errors):
        changed = list(entries)
        changed[k] += error
        changes = [abs(x - y) for x, y in zip(function(make(changed, None)), base, strict=True)]
        found = changes if found is None else [x + y for x, y in zip(found, changes, strict=True)]
    return list(map(float, found))


@pytest.mark.parametrize("operation", [bs.series, bs.modified_equation, bs.modifying_integrator])
@pytest.mark.parametrize("kind", [*KINDS, *RELATIVE])
def test_uncertainties_are_the_worst_case(kind, operation):
    make, entries, order = (KINDS | RELATIVE)[kind]
    if kind in RELATIVE:
        errors = [Fraction(5, 10**DIGITS) * x for x in entries]
    else:
        errors = [half_unit(x, DIGITS) for x in entries]
    if operation is bs.modifying_integrator:
        if kind in ("splitting", "nystrom"):
            pytest.skip("its entries are those of the stages of flows, or its trees are restricted")
        order = 3
    s = operation(make(entries, DIGITS), order)
    wanted = worst_case(lambda m: operation(m, order).coefficients(), make, entries, errors)
    found = [s.uncertainty(at) for at in range(len(s))]
    assert any(wanted)
    if kind == "rosenbrock":  # γ is in several places of the program, which may differ
        assert all(x * (1 - 1e-9) <= y <= 4 * x for x, y in zip(wanted, found, strict=True))
    else:
        assert found == pytest.approx(wanted, rel=1e-6, abs=1e-12 * max(wanted))


def test_uncertainties_of_words_are_the_worst_case():
    def words(method):
        return bs.series(method, Words(4, 3)).coefficients()

    entries = ENTRIES[:7]
    errors = [half_unit(x, DIGITS) for x in entries]
    found = list(map(bs.series(splitting(entries, DIGITS), Words(4, 3)).uncertainty, range(3 + 9 + 27 + 81)))
    assert found == pytest.approx(worst_case(words, splitting, entries, errors), rel=1e-6, abs=0)


@pytest.mark.parametrize("operation", [bs.series, bs.modified_equation])
def test_few_digits_need_terms_of_higher_order(operation):
    """All corners of the errors of two digits; the worst case to first order is exceeded, the bound is not."""

    def make(x, digits):
        return RungeKutta([[0, 0], [x[0], 0]], x[1:], digits=digits, warn=False)

    entries, order = [Fraction("0.13"), Fraction("-1.1"), Fraction("2.1")], 4
    s = operation(make(entries, 2), order)
    errors = [half_unit(x, 2) for x in entries]
    largest = [0.0] * len(s)
    for signs in product((-1, 1), repeat=3):
        changed = [x + sign * error for x, sign, error in zip(entries, signs, errors, strict=True)]
        moved = operation(make(changed, None), order).coefficients()
        largest = [max(x, abs(float(y - z))) for x, y, z in zip(largest, moved, s.coefficients(), strict=True)]
    first = abs(s.uncertainty.changes).sum(axis=1)
    assert all(x <= s.uncertainty(at) for at, x in enumerate(largest))
    assert any(x > y * 1.001 for x, y in zip(largest, first, strict=True))


def test_half_units():
    numbers = {
        "1": "0.005",
        "0.999": "0.0005",
        "-9.99": "0.005",
        "1000": "5",
        "0.001": "5e-6",
        "0": "0",
        "1e-30": "5e-33",
    }
    assert {text: half_unit(Fraction(text), 3) for text in numbers} == {x: Fraction(y) for x, y in numbers.items()}
    assert half_unit(Fraction(1, 3), 1000) == Fraction(5, 10**1001)
    assert 0 < bs.series(RungeKutta([[0]], ["0.999"], digits=1000, warn=False), 1).uncertainty(0) < 1e-200


def test_entries_beyond_floats():
    huge = RungeKutta([[0, 0], [Fraction(10) ** 200, 0]], [0, 1], digits=10, warn=False)
    with pytest.raises(bs.SeriesError, match="within the range of floats"):
        bs.series(huge, 4).uncertainty(3)


def test_uncertainties_do_not_depend_on_the_size_of_arrays(monkeypatch):
    def found():
        b = bs.modified_equation(TSIT5, 6)
        return [b.uncertainty(at) for at in range(len(b))]

    at_once = found()
    monkeypatch.setattr("bseries.algebra.uncertainty.LARGEST_ARRAY", 500)
    assert found() == pytest.approx(at_once, rel=1e-12, abs=0)


def test_changes_of_conjugated_fields_are_those_of_exact_changes():
    """The change of log(χ a χ⁻¹) with the logarithms of a and χ, against an exact difference quotient."""
    source, step = random.Random(1), Fraction(1, 10**12)

    def field(first):
        numbers = lambda tree: Fraction(source.randint(-9, 9), 7) if tree.order > 1 else Fraction(first)  # noqa: E731
        return bs.BSeries.from_rule(numbers, 5, empty=0)

    b, g, db, dg = field(1), field(0), field(1), field(0)

    def exact(t):
        return bs.analysis.conjugate((b + t * db).exp(), (g + t * dg).exp()).log().coefficients()

    dual = [np.array([[float(x) for x in s.coefficients()] for s in pair]).T for pair in ((b, db), (g, dg))]
    found = conjugated(b.table, *dual)
    assert found[:, 0] == pytest.approx([float(x) for x in exact(0)], rel=1e-10)
    quotient = [float((x - y) / (2 * step)) for x, y in zip(exact(step), exact(-step), strict=True)]
    assert found[:, 1] == pytest.approx(quotient, rel=1e-10)
    assert any(abs(x) > 1 for x in found[4:, 1] - dual[0][4:, 1])


@pytest.mark.parametrize("basis", [TreeTable(4, 2), Words(4)], ids=repr)
def test_logarithms_of_shortened_series_have_the_same_uncertainties(basis):
    method = bs.Splitting([("a", "0.2929"), ("b", "0.5"), ("a", "0.4142"), ("b", "0.5"), ("a", "0.2929")], digits=4)
    s = bs.series(method, basis)
    short, whole = s.truncate(3).log(), s.log()
    assert [short.uncertainty(at) for at in range(len(short))] == pytest.approx(
        [whole.uncertainty(at) for at in range(len(short))], rel=1e-12
    )
    assert short.uncertainty(len(short) - 1) > 0
