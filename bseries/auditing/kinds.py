"""Methods of sources that are no tableaus: splitting, Nyström and Rosenbrock methods, and forms in few registers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import combinations, pairwise, zip_longest
from typing import Any

from bseries.analysis.rounding import LEAST_DIGITS
from bseries.auditing.corrections import Correction, reached
from bseries.auditing.written import as_decimal, digits_of
from bseries.exceptions import SeriesError
from integrators import RungeKutta
from integrators.methods.exchange.numbers import Number
from integrators.methods.exchange.records import Record
from integrators.methods.exchange.shapes import flattened
from integrators.methods.kinds.compositions import linear_combination
from integrators.methods.kinds.extended_runge_kutta import Rosenbrock
from integrators.methods.kinds.second_order import RungeKuttaNystrom
from integrators.methods.kinds.splitting import NystromSplitting, Splitting
from integrators.methods.programs.program import Method

Tables = Mapping[str, Any]
"""Nested lists of fractions, by the names of the tables of a record."""


def methods_of(record: Record) -> Iterator[Method]:
    """The methods that a record may mean: both where a source leaves open which of two flows is the first."""
    if record.kind in KINDS:
        yield from KINDS[record.kind](_plain(record.tables), _digits(record))


def restored(record: Record, order: int) -> tuple[Correction, ...]:
    """The changes of rows of times that give an order: of single times, of two, or rows of a composition exchanged.

    A correction that exchanges rows has their names as entries, and no values. For splittings both orders of the rows
    are tried anyway.
    """
    if record.kind not in ("splitting", "composition") or _are_nodes(record.tables):
        return ()
    tables, digits = _plain(record.tables), _digits(record)
    if record.kind == "composition":
        exchanged = dict(zip(tables, reversed(tables.values()), strict=True))
        if _has_order(record.kind, exchanged, digits, order):
            return (Correction("exchanged", tuple(tables), (), ()),)
    for changes in (_single_times, _pairs_of_times):
        found = []
        for kind, values in changes(tables):
            rows = {n: [values.get((n, i), x) for i, x in enumerate(row)] for n, row in tables.items()}
            if _has_order(record.kind, rows, digits, order):
                entries = tuple(f"{n}[{i + 1}]" for n, i in values)
                found.append(Correction(kind, entries, tuple(tables[n][i] for n, i in values), tuple(values.values())))
        if found:
            return tuple(found)
    return ()


def _digits(record: Record) -> int | None:
    """The digits of the numbers of a record."""
    return digits_of(x for x in flattened(list(record.tables.values())) if isinstance(x, Number))


Changes = Iterator[tuple[str, Mapping[tuple[str, int], Any]]]
"""The kind of a change, and the new times by the name of the row and the place."""


def _single_times(tables: Tables) -> Changes:
    """Another sign, or the time that completes the sum of a row."""
    for n, row in tables.items():
        for i, x in enumerate(row):
            yield "sign", {(n, i): -x}
            if sum(row) not in (1, 1 + 2 * x):
                yield "entry", {(n, i): x + 1 - sum(row)}


def _pairs_of_times(tables: Tables) -> Changes:
    """Two times of a row exchanged, or two equal ones that complete its sum."""
    for n, row in tables.items():
        for (i, x), (j, y) in combinations(enumerate(row), 2):
            yield "exchanged", {(n, i): y, (n, j): x}
            if x == y and sum(row) != 1:
                yield "entry", dict.fromkeys(((n, i), (n, j)), x + (1 - sum(row)) / 2)


def _has_order(kind: str, tables: Tables, digits: int | None, order: int) -> bool:
    """Whether one of the methods that tables may mean has an order."""
    return any(reached(method, order)[0] >= order for method in KINDS[kind](tables, digits))


def _plain(table: Any) -> Any:
    """Numbers as fractions, roots as decimals; missing entries are zeros."""
    if isinstance(table, Mapping):
        return {name: _plain(x) for name, x in table.items()}
    if isinstance(table, list):
        return [_plain(x) for x in table]
    return as_decimal(table.value) if isinstance(table, Number) else Fraction(0)


def _splittings(tables: Tables, digits: int | None) -> Iterator[Method]:
    """Flows of two parts in turn, either first; then those of positions and momenta in second-order equations."""
    if _are_nodes(tables):
        yield _sum_of_splittings(tables, digits)
        return
    one, two = tables.values()
    for rows in ({"p": one, "q": two}, {"q": two, "p": one}):
        yield Splitting(_in_turn(rows), digits=digits)
    for rows in ({"p": one, "q": two}, {"q": one, "p": two}, {"q": two, "p": one}, {"p": two, "q": one}):
        yield NystromSplitting(_in_turn(rows), digits=digits)


def _are_nodes(tables: Tables) -> bool:
    """Whether beta holds the times of parts after each flow, by splitting, and is no row."""
    return any(isinstance(x, list) for x in tables.get("beta", ()))


def _checked(*rows: Sequence[Any]) -> Iterator[tuple[Any, ...]]:
    """The columns of rows of equal lengths; other rows are refused."""
    if len(lengths := {len(row) for row in rows}) > 1:
        raise SeriesError(f"rows must have equally many entries, but had {' and '.join(map(str, sorted(lengths)))}")
    return zip(*rows, strict=True)


def _in_turn(rows: Mapping[str, Sequence[Fraction]]) -> list[tuple[str, Fraction]]:
    """The flows of parts, one after the other."""
    return [flow for times in zip_longest(*rows.values(), fillvalue=Fraction(0)) for flow in zip(rows, times)]  # noqa: B905


def _sum_of_splittings(tables: Tables, digits: int | None) -> Method:
    """Σ α_l of splittings l, whose part p is at the time β_lkp after k of its flows."""
    parts = "pqrstuvw"
    steps = []
    for times in tables["beta"]:
        between = [[y - x for x, y in _checked(*pair)] for pair in pairwise(times)]
        steps.append(Splitting([flow for row in between for flow in zip(parts, row)], digits=digits))  # noqa: B905
    return steps[0] if len(steps) == 1 else linear_combination(_checked(tables["alpha"], steps))


def _compositions(tables: Tables, digits: int | None) -> Iterator[Method]:
    """A method and its adjoint in turn, as flows of two parts."""
    times = _checked(tables["method"], tables["adjoint"])
    yield Splitting([flow for a, b in times for flow in zip("pqqp", (a, a, b, b), strict=True)], digits=digits)


def _symmetric_compositions(tables: Tables, digits: int | None) -> Iterator[Method]:
    """Symmetric steps, of which the first half is given."""
    row = tables["half"]
    steps = [*row, *row[-2::-1]] if len(row) > 1 else row
    halves = [flow for x in steps for flow in zip("pqp", (x / 2, x, x / 2), strict=True)]
    yield Splitting(halves, digits=digits)


def _nystrom(tables: Tables, digits: int | None) -> Iterator[Method]:
    """A Nyström method whose nodes are given."""
    if "c" in tables:
        velocity = tables.get("A_velocity")
        yield RungeKuttaNystrom(tables["A"], tables["b"], tables["b_velocity"], tables["c"], A=velocity, digits=digits)


def _rosenbrock(tables: Tables, digits: int | None) -> Iterator[Method]:
    """A Rosenbrock method, also in the form without products with the Jacobian; the last stage may be the result."""
    A = tables["A"]
    if "Gamma" in tables and "b" in tables:
        yield Rosenbrock(A, tables["Gamma"], tables["b"], digits=digits)
    elif "C" in tables and ("gamma" in tables or "d" in tables):
        gamma = tables["gamma"] if "gamma" in tables else tables["d"][0]
        weights = tables.get("b", [*A[-1][:-1], Fraction(1)])
        yield Rosenbrock.from_transformed(A, tables["C"], weights, gamma, digits=digits)


def _two_registers(tables: Tables, digits: int | None) -> Iterator[Method]:
    """Williamson's form 2N; other forms with the same letters have a first entry."""
    if not tables["A"][0]:
        yield RungeKutta.from_2n(tables["A"], tables["B"], digits=digits, warn=False)


def _three_registers(tables: Tables, digits: int | None) -> Iterator[Method]:
    """Ketcheson's form 3S*, with or without the factors of the first stage, and with an entry before the first one."""
    gamma1, gamma2, gamma3, beta, delta = (
        next((tables[n] for n in (f"{name}2end", name) if n in tables), []) for name in _letters(tables)
    )
    digits = digits and max(LEAST_DIGITS, digits - LOST_DIGITS)
    first = tables.get("β", beta)[:1] if len(beta) == len(gamma1) and "β2end" in tables else []
    if first:  # entries from the second stage on
        rows = [[0, 1, 0], *_checked(gamma1, gamma2, gamma3)]
        yield RungeKutta.from_3s_star(rows, [*first, *beta], [1, *delta], digits=digits, warn=False)
    else:
        extra = len(gamma1) - len(delta)
        rows = [*_checked(gamma1, gamma2, gamma3)][extra:]
        yield RungeKutta.from_3s_star(rows, beta[extra:], delta, digits=digits, warn=False)


LOST_DIGITS = 4
"""Factors of three registers that are rounded leave y_n with a weight that is 1 to fewer digits."""


def _letters(tables: Tables) -> tuple[str, ...]:
    """The names of the factors of three registers, of slopes, and of sums."""
    if "gamma1" in tables:
        return "gamma1", "gamma2", "gamma3", "beta", "delta"
    return "γ1", "γ2", "γ3", "β", "δ"


def _shu_osher(tables: Tables, digits: int | None) -> Iterator[Method]:
    """A Shu–Osher form; the first stage may be left out, and the factor 1 of the stage before."""
    alpha, beta = ([list(row) for row in tables[name]] for name in ("alpha", "beta"))
    if any(alpha[0]):
        alpha, beta = [[], *alpha], [[], *beta]
    size = len(alpha) - 1
    alpha, beta = ([(row + [Fraction(0)] * size)[:size] for row in table] for table in (alpha, beta))
    for i, row in enumerate(alpha[1:]):
        if not any(row):
            row[i] = Fraction(1)
    yield RungeKutta.from_shu_osher(alpha, beta, digits=digits, warn=False)


KINDS: dict[str, Callable[[Tables, int | None], Iterator[Method]]] = {
    "splitting": _splittings,
    "composition": _compositions,
    "symmetric-composition": _symmetric_compositions,
    "nystrom": _nystrom,
    "rosenbrock": _rosenbrock,
    "2n": _two_registers,
    "2s": _three_registers,
    "shu-osher": _shu_osher,
}
