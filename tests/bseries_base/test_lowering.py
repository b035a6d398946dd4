"""Generated functions lowered to LLVM do what Python does with the same text."""

import importlib
from math import sin, sqrt

import numpy as np
import pytest
from numba import types
from numba.core.errors import NumbaError

from bseries_base.lowering import vectors
from bseries_base.lowering.units import Unit, lowered
from bseries_base.lowering.vectors import VectorLoop
from integrators.compile.machine import DOUBLES, bits, compiled, fma, pointer, shifted, stack, value_of

pytestmark = pytest.mark.minimum

NUMBERS = np.array([0.5, -2.0, 3.25])
PLACES = np.array([2, 0, 1])
KIND = types.float64(DOUBLES, types.float64, types.int64)


def loops(y, h, n):
    total = 0.0
    for i in range(n):
        if i == 3:
            continue
        if i > 7:
            break
        total += y[i] * i
        y[i] = total
    for i in range(n - 1, 1, -2):
        total -= y[i - 1] * h
    for i in range(2, n):
        for j in range(i + 1, n):
            total += y[i] / (y[j] + 10.0 * j)
    return total


def branches(y, h, n):
    found, before, settled = 0.0, 100.0, False
    while not settled:
        change = 0.5 * (before % 7.0) if (n > 2 and h > 0) or before < 1 else before / 2
        if change < before:
            found += min(change, h, 0.25)
        elif n == 4:
            found -= max(change, -h)
        else:
            return -found
        before = change
        settled = change <= abs(h) or found != found
        settled |= found > 1e3
    return found if found >= 0 else -(2**n) * found


def swaps(y, h, n):
    first, second = y[0], y[1]
    first, second = second, first
    y[0], y[n] = y[n], y[0]
    y[1] = y[2] = y[1] + h
    pair = halves(first, second)
    low, high = pair
    k = 3 * n // 2 % 5 + (1 << n)
    return low * y[0] - high * y[1] + NUMBERS[n - 1] * k + NUMBERS[PLACES[0]] + abs(-h) + int(2.75)


def calls(y, h, n):
    scale(y, n, h)
    return power(y[1], 3) - sin(total(y, n))


def scale(y, n, h):
    for i in range(n):
        y[i] *= h


def power(x, n):
    product = 1.0
    for _ in range(n):
        product *= x
    return product


def total(y, n):
    found = 0
    found += n > 2
    value = float(found)
    for i in range(n):
        value += y[i]
    return value


@compiled
def halves(a, b):
    return (0.5 * a, 0.5 * b) if a < b else (0.5 * b, 0.5 * a)


@pytest.mark.few(8)
@pytest.mark.parametrize("function", [loops, branches, swaps, calls])
@pytest.mark.parametrize(("h", "n"), [(0.3, 4), (-0.75, 2), (0.1, 3), (2.5, 1), (-1e-3, 9)])
def test_lowered_functions_are_those_of_python(function, h, n):
    if n > 3 and function is swaps:
        n = 3
    made = lowered(KIND)(function)

    @compiled
    def run(y, h, n):
        return made(pointer(y), h, n)

    y = np.linspace(-1.5, 2.5, 12)
    there = y.copy()
    value, wanted = run(y, h, n), function(there, h, n)
    assert value == wanted or value == pytest.approx(wanted, rel=1e-15)
    np.testing.assert_allclose(y, there, rtol=1e-15)


def work(y, n):
    z = stack(6)
    for i in range(6):
        z[i] = y[i]
    copy(shifted(z, 2), y, n)


def copy(source, y, n):
    for i in range(n):
        y[i] = source[i]


def test_arrays_on_the_stack_and_nothing_returned():
    made = lowered(types.void(DOUBLES, types.int64))(work)

    @compiled
    def run(y, n):
        made(pointer(y), n)

    y = np.arange(6.0)
    run(y, 3)
    assert list(y) == [2, 3, 4, 3, 4, 5]


WEIGHTS = np.linspace(1.0, 2.0, 11)
TURNED = np.array([0, 1, 2, 3, 4, 5, 6, 7, 16, 15, 14, 13, 12, 11, 10, 9, 8])
ROUND = np.array([7, 3, 0, 10, 2, 9, 1, 5, 8, 6, 4])


def entries(y, h):
    """Loops over entries: each sets its own only."""
    z = stack(11)
    for i in range(11):
        s = 0.5 * y[i] - h
        z[i] = abs(s) * WEIGHTS[i] / 3.0 + sqrt(y[i] * y[i])
    for i in range(4, 12):
        y[i] = y[i + 9] + fma(h, -z[i - 4], y[i])
        y[i] *= 2.0
    for i in range(11):
        y[2 * i] += z[ROUND[i]] - z[ROUND[(10 - i)]]
    largest = 3
    for i in range(11):
        most = 0
        most = max(most, bits(abs(z[i] - y[i])))
        largest = max(largest, most)
    for i in range(3):
        z[i] = y[i]
    return value_of(largest) + z[2] + s + i


def running(y, h):
    for i in range(1, 9):
        y[i] = y[i - 1] + h


def ahead(y, h):
    for i in range(8):
        y[i + 1] += h * y[i]


def turned(y, h):
    for i in range(8):
        y[i] = y[7 - i]


def doubled(y, h):
    for i in range(8):
        y[ROUND[i] - ROUND[i]] = h + y[i + 1]


def carried(y, h):
    s = h
    for i in range(8):
        y[i] += s
        s = 2.0 * y[i]


def counted(y, h):
    for i in range(8):
        y[i] *= i


def called(y, h):
    for i in range(8):
        y[i] = sin(y[i])


def chained(y, h):
    for i in range(8):
        y[i] = y[i + 9] = h


def recounted(y, h):
    for i in range(8):
        i = 3
        y[i] = y[i] + h


def seven(y, h):
    for i in range(7):
        y[i] += h


def many(y, h):
    z = stack(65)
    for i in range(65):
        z[i] = h
    y[0] = z[64]


def largest_number(y, h):
    best = 0.0
    for i in range(8):
        best = max(best, y[i + 9])
    y[0] = best


@pytest.fixture
def vector_loops(monkeypatch):
    """Whether the loops with bounds that are written out are in vectors."""
    found, write = [], VectorLoop.write

    def noted(self):
        found.append(write(self))
        return found[-1]

    monkeypatch.setattr(VectorLoop, "write", noted)
    return found


def results(function, kind, monkeypatch):
    """What a function does to an array, in LLVM and in Python."""
    made = lowered(kind(DOUBLES, types.float64))(function)

    @compiled
    def run(y, h):
        return made(pointer(y), h)

    there, here = np.linspace(-1.5, 2.5, 23), np.linspace(-1.5, 2.5, 23)
    value = run(there, 0.7)
    for name, plain in PLAIN.items():
        monkeypatch.setitem(globals(), name, plain)
    return (value, there), (function(here, 0.7), here)


PLAIN = {
    "stack": np.empty,
    "fma": lambda a, b, c: a * b + c,
    "bits": lambda x: int(np.float64(x).view(np.int64)),
    "value_of": lambda n: float(np.int64(n).view(np.float64)),
}


def test_loops_over_entries_are_written_in_vectors(vector_loops, monkeypatch):
    (value, there), (wanted, here) = results(entries, types.float64, monkeypatch)
    assert vector_loops == [True, True, True, True, False]  # three entries are for LLVM
    assert value == pytest.approx(wanted, rel=1e-14)
    np.testing.assert_allclose(there, here, rtol=1e-14)


UNSUITED = (
    running, ahead, turned, doubled, carried, counted, called, largest_number, chained, recounted, seven, many,
)  # fmt: skip


@pytest.mark.parametrize("function", UNSUITED)
def test_loops_whose_entries_depend_on_one_another_are_not(function, vector_loops, monkeypatch):
    """Nor those that count or call; a loop with a vector of old values would do something else."""
    (_, there), (_, here) = results(function, types.void, monkeypatch)
    assert vector_loops == [False]
    np.testing.assert_allclose(there, here, rtol=1e-14)


def heavy(y, h):
    """As many entries as fill vectors, and one more; the largest change, and what is left of the last entry."""
    largest, z = 0, stack(23)
    for i in range(3, 20):
        s = y[i] * y[i] + h
        x = (s + y[i]) / (2.0 + s * s)
        largest = max(largest, bits(abs(x - y[i])))
        z[i + 1] = x - s
        y[i] = sqrt(abs(x)) - s / 7.0
    return value_of(largest) + s + z[20]


def stored(y, h):
    """The first places of the table lie one behind the other."""
    z = stack(23)
    for i in range(23):
        z[i] = y[i]
    for i in range(17):
        y[TURNED[i]] = z[i] + h


@pytest.mark.parametrize("long", [0, 1000], ids=["by a loop", "one by one"])
def test_vectors_are_one_behind_the_other_or_made_by_a_loop(long, vector_loops, monkeypatch):
    monkeypatch.setattr(vectors, "LONG", long)
    (value, there), (wanted, here) = results(heavy, types.float64, monkeypatch)
    assert vector_loops == [True]
    assert value == pytest.approx(wanted, rel=1e-14)
    np.testing.assert_allclose(there, here, rtol=1e-14)


def test_places_that_are_looked_up_are_not_those_of_the_first_vector(vector_loops, monkeypatch):
    monkeypatch.setattr(vectors, "LONG", 0)
    (_, there), (_, here) = results(stored, types.void, monkeypatch)
    assert vector_loops == [True, True]
    np.testing.assert_allclose(there, here, rtol=1e-15)


def narrow_field(y, out):
    z = stack(500)
    for i in range(8):
        z[i] = 2.0 * y[i]
    for i in range(8):
        out[i] = z[i] - y[i + 8]


def wide_field(y, out):
    z = stack(5000)
    for i in range(8):
        z[625 * i] = 2.0 * y[i]
    for i in range(8):
        out[i] = z[625 * i] - y[8 + i]


field = narrow_field


def two_calls(y, h):
    k = stack(8)
    field(y, k)
    for i in range(8):
        y[i] += h * k[i]
    field(y, k)


@pytest.mark.parametrize(("chosen", "is_copied"), [(narrow_field, True), (wide_field, False)])
def test_fields_are_copied_as_long_as_the_stack_of_a_thread_suffices(chosen, is_copied, monkeypatch):
    copied, function = {}, Unit.function

    def noted(self, *arguments):
        copied[arguments[0]] = function(self, *arguments)[0].attributes
        return function(self, *arguments)

    monkeypatch.setattr(Unit, "function", noted)
    monkeypatch.setitem(globals(), "field", chosen)
    made = lowered(types.void(DOUBLES, types.float64))(two_calls)

    @compiled
    def run(y):
        made(pointer(y), 0.5)

    y = np.linspace(0.0, 1.0, 16)
    run(y)
    assert copied.keys() == {two_calls, chosen}
    assert ["alwaysinline" in attributes for attributes in copied.values()] == [is_copied, True]
    np.testing.assert_allclose(y[:8], 2 * np.arange(8) / 15 - (np.arange(8) + 8) / 30)


ONE, TWO = np.uint64(1), np.uint64(2)


def tables(ints, table, n):
    row = ints[ONE] * TWO
    for i in range(n - ONE):
        for k in range(ONE, n):
            if i in (ONE, TWO) or k == n - ONE:
                table[i, k] += np.pi * ints[i + row]
    table[0, 0] = n


def test_arrays_and_unsigned_numbers():
    made = lowered()(tables)

    @compiled
    def run(ints, table, n):
        made(ints, table, n)

    table, wanted = np.zeros((4, 4)), np.zeros((4, 4))
    run(np.arange(12, dtype=np.uint64), table, np.uint64(4))
    for i in range(3):
        wanted[i, 3 if i == 0 else 1 :] = np.pi * (i + 2)
    wanted[3], wanted[0, 0] = 0, 4
    np.testing.assert_allclose(table, wanted, rtol=1e-15)


def becomes_signed(y, h, n):
    found = np.pi + n
    place = ONE
    for _ in range(2):
        place = n
    return found + place


def changes_type(y, h, n):
    found = 1
    found += h
    return found


def lists(y, h, n):
    return sum([h, h])


def chains(y, h, n):
    return h if 0 < h < 1 else -h


def otherwise(y, h, n):
    for _ in range(n):
        h *= 2
    else:
        h = 0.0
    return h


def keywords(y, h, n):
    return round(h, ndigits=1)


def local_calls(y, h, n):
    sine = abs
    return sine(h)


def early(y, h, n):
    for i in range(n):
        if i > 0:
            h += later  # noqa: F821
        later = h  # noqa: F841
    return h


def narrow(y, h, n):
    return min(h, 1)


def over_others(y, h, n):
    for i in (1, 2):
        h += i
    return h


CASES = (
    (changes_type, "a float64 is no int64"),
    (becomes_signed, "a int64 is no uint64"),
    (lists, "is not lowered"),
    (chains, "compares more than two"),
    (otherwise, "has an else"),
    (keywords, "more than positional"),
    (local_calls, "no function of the module"),
    (early, "read before"),
    (narrow, "several types"),
    (over_others, "over no range"),
)


@pytest.mark.parametrize(("function", "reason"), CASES)
def test_what_cannot_be_lowered_is_refused(function, reason):
    made = lowered(KIND)(function)

    @compiled
    def run(y):
        return made(pointer(y), 1.0, 1)

    with pytest.raises((NotImplementedError, NumbaError), match=reason):
        run(np.zeros(3))


def test_a_file_that_has_changed_since_it_was_loaded_is_refused(tmp_path, monkeypatch):
    text = "def {}(x):\n    return {} * x\n\n\n"
    path = tmp_path / "changing_functions.py"
    path.write_text(text.format("first", "2.0 * x") + text.format("second", "100.0"))
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module("changing_functions")
    made = lowered(types.float64(types.float64))(module.first)
    path.write_text(text.format("second", "100.0") + text.format("first", "2.0 * x"))

    @compiled
    def run(x):
        return made(x)

    with pytest.raises((NotImplementedError, NumbaError), match="which changed"):
        run(1.0)
