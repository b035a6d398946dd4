"""Which entry of a tableau is wrong: the changes of one entry, or of a few, that restore the order it claims.

With x in place of one entry, the conditions of tall trees, b A^(k−1) 1 = 1/k!, are polynomials in x, linear ones in
explicit methods. Only their roots can restore the order; whether they do is decided by all conditions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.analysis.order import order_of
from bseries.analysis.rounding import LEAST_DIGITS, hidden_order
from bseries.exceptions import SeriesError
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.exact.polynomials import from_flint, to_flint
from integrators.methods.programs.program import Method
from trees.counting import check_order

if TYPE_CHECKING:
    from flint import fmpq_poly

MOST_STAGES = 16
"""Wrong entries of larger tableaus are not looked for."""

NEAR = 1e-5
"""Conditions that hold to this are worth the decision of all conditions, and row sums this near agree with nodes."""

ENOUGH = 12
"""Digits to which an order may hold whatever is written: tables are often printed with digits beyond doubles."""

Rows = tuple[tuple[Fraction, ...], ...]
"""The rows of A, the weights b, and the nodes c."""

Place = tuple[int, int]


class Correction(NamedTuple):
    """A change of a tableau that restores the orders it claims.

    Attributes:
        kind: ``entry`` or ``sign`` (of one entry, or of one of the last row that is a weight, too), ``exchanged`` (two
            entries), or ``shifted`` (a row by one place).
        entries: The entries that change, such as ``a[4,3]``, ``b[2]`` and ``c[2]``, counted from 1.
        was: Their values.
        should_be: The values that restore the orders.

    Example:
        >>> from fractions import Fraction
        >>> import bseries as bs
        >>> print(bs.auditing.Correction("sign", ("b[1]",), (Fraction(-1),), (Fraction(1),)))
        b[1] = 1 in place of -1
    """

    kind: str
    entries: tuple[str, ...]
    was: tuple[Fraction, ...]
    should_be: tuple[Fraction, ...]

    def __str__(self) -> str:
        changes = zip(self.entries, self.was, self.should_be, strict=True)
        return ", ".join(f"{entry} = {value} in place of {was}" for entry, was, value in changes)


def corrections(
    method: RungeKutta, order: int, embedded: Sequence[int] = (), *, weights: str = "", other: RungeKutta | None = None
) -> tuple[Correction, ...]:
    """The changes of single entries, exchanges of two, and shifts of a row that give a tableau the orders it claims.

    Of several changes, those are given that leave the fewest rows whose sums differ from their nodes, and of these the
    ones that read most like a slip: a sign, or one digit.

    Args:
        method: A tableau with rational entries, decimals included.
        order: The order that it claims.
        embedded: The orders that its other rows of weights claim.
        weights: The name of the weights if only they can be wrong; by default all entries.
        other: The other part of an additive pair; together with it, too, the tableau has the order.

    Returns:
        The changes; none where none exists, or where orders and row sums are as claimed.

    Raises:
        SeriesError: The entries are no rational numbers, or there are more than 16 stages.

    Example:
        >>> import bseries as bs
        >>> weights = ["1/6", "1/3", "1/3", "1/6"]
        >>> wrong = bs.RungeKutta([[0, 0, 0, 0], ["1/2", 0, 0, 0], [0, "1/3", 0, 0], [0, 0, 1, 0]], weights)
        >>> bs.order_of(wrong), [str(x) for x in bs.auditing.corrections(wrong, 4)]
        (1, ['a[3,2] = 1/2 in place of 1/3'])
    """
    search = _Search(method, check_order(order), tuple(embedded), weights, other)
    if not wrong_sums(search.rows) and search.restores(search.rows):
        return ()
    for changes in (search.single_entries, search.several_entries, search.entries_above):
        found = list(changes())
        if found:
            rated = [(len(wrong_sums(rows)), _unlike_a_slip(x)) for rows, x in found]
            return tuple(x for (_, x), rate in zip(found, rated, strict=True) if rate == min(rated))
    return ()


def wrong_sums(rows: Rows) -> list[int]:
    """The rows of A whose sums differ from their nodes."""
    *A, _, nodes = rows
    return [i for i, (row, c) in enumerate(zip(A, nodes, strict=True)) if abs(sum(row) - c) > NEAR]


class _Search:
    """The search for changes of one tableau."""

    def __init__(
        self, method: RungeKutta, order: int, embedded: tuple[int, ...], weights: str, other: RungeKutta | None
    ):
        if not isinstance(method, RungeKutta) or method.domain not in ("QQ", "decimal"):
            raise SeriesError(f"method must be a tableau with rational entries, but was {method!r:.60}")
        if method.stages > MOST_STAGES:
            raise SeriesError(f"method must have at most {MOST_STAGES} stages, but has {method.stages}")
        self.method, self.size, self.only_weights, self.other = method, method.stages, bool(weights), other
        self.names = [f"a[{i + 1}," for i in range(self.size)] + [f"{weights or 'b'}[", "c["]
        rows: Any = (*method.A, method.b, method.c)
        self.rows: Rows = tuple(tuple(map(Fraction, row)) for row in rows)
        self.near = max(1e-12, min(NEAR, 10 ** -((method.digits or 0) / 2)))
        self.claims = [(None, order), *zip(method.embedded, embedded, strict=False)]
        self.places: list[Place] = [(self.size, j) for j in range(self.size)]
        if not weights:
            self.places += [(i, j) for i in range(self.size) for j in range(i if method.is_explicit else self.size)]
        self.shared: list[tuple[Place, ...]] = []
        """Entries of the last stage that are the weights, too."""
        if not weights and self.rows[self.size - 1] == self.rows[self.size]:
            self.shared = [((self.size - 1, j), (self.size, j)) for j in range(self.size)]

    def restores(self, rows: Rows) -> bool:
        """Whether a tableau has the orders that are claimed, exactly or as rounded numbers."""
        A, own = rows[:-2], rows[-2]
        matrix = [list(map(float, row)) for row in A]
        for b, order in self.claims:
            if any(abs(x) > self.near for x in residuals(matrix, list(map(float, b or own)), order)):
                return False
        found = [(RungeKutta(A, b or own, digits=self.method.digits, warn=False), p) for b, p in self.claims]
        pairs = [(pair_of(found[0][0], self.other), self.claims[0][1])] if self.other else []
        return all(reached(x, p)[0] >= p for x, p in (*found, *pairs))

    def tested(self, kind: str, values: Mapping[Place, Fraction]) -> Iterator[tuple[Rows, Correction]]:
        """A change, if it restores the orders."""
        rows = tuple(tuple(values.get((i, j), x) for j, x in enumerate(row)) for i, row in enumerate(self.rows))
        if self.restores(rows):
            entries = tuple(f"{self.names[i]}{j + 1}]" for i, j in values)
            was = tuple(self.rows[i][j] for i, j in values)
            yield rows, Correction(kind, entries, was, tuple(values.values()))

    def single_entries(self) -> Iterator[tuple[Rows, Correction]]:
        """The entries for which another value restores the orders, or the sum of a row; shared ones change together."""
        missing = {i: self.rows[-1][i] - sum(self.rows[i]) for i in wrong_sums(self.rows)}
        single = [*self.places, *((self.size + 1, i) for i in missing)]
        groups: list[tuple[Place, ...]] = [*((place,) for place in single), *self.shared]
        for places in groups:
            i, j = places[0]
            was = self.rows[i][j]
            if i > self.size:
                values = [was - missing[j]]
            else:  # a sign and the sum of a row are not less exact than the numbers of the source, as roots are
                values = [-was, *([was + missing[i]] if i in missing else []), *common_roots(self.conditions(places))]
            found: list[Fraction] = []
            for x in values:
                if x != was and all(abs(x - y) > self.near for y in found):
                    for rows, correction in self.tested("sign" if x == -was else "entry", dict.fromkeys(places, x)):
                        found.append(x)
                        yield rows, correction

    def conditions(self, places: tuple[Place, ...]) -> Iterator[fmpq_poly]:
        """The conditions of tall trees, of all weights on which an entry has influence."""
        *A, own, _ = self.rows
        for b, order in self.claims:
            if changed := [place for place in places if b is None or place[0] < self.size]:
                yield from tall_conditions((*A, own if b is None else tuple(map(Fraction, b))), changed, order)

    def entries_above(self) -> Iterator[tuple[Rows, Correction]]:
        """The entries that an explicit tableau does not have: one may have been lost."""
        if self.method.is_explicit and not self.only_weights:
            self.places, self.shared = [(i, j) for i in range(self.size) for j in range(i, self.size)], []
            yield from self.single_entries()

    def several_entries(self) -> Iterator[tuple[Rows, Correction]]:
        """Two entries of a row or column, or across the diagonal, exchanged; or a row shifted by a place."""
        for (i, j), (k, m) in combinations(self.places, 2):
            x, y = self.rows[i][j], self.rows[k][m]
            if x != y and (i == k or j == m or (i, j) == (m, k)):
                yield from self.tested("exchanged", {(i, j): y, (k, m): x})
        for i in {i for i, _ in self.places}:
            row = [self.rows[i][j] for k, j in self.places if k == i]
            for moved in (row[1:] + row[:1], row[-1:] + row[:-1]):
                values = {(i, j): y for j, (x, y) in enumerate(zip(row, moved, strict=True)) if x != y}
                if len(values) > 2:
                    yield from self.tested("shifted", values)


def pair_of(implicit: RungeKutta, explicit: RungeKutta) -> PartitionedRungeKutta:
    """The additive pair of two tableaus."""
    parts = {"implicit": implicit, "explicit": explicit}
    return PartitionedRungeKutta(
        {name: RungeKutta(x.A, x.b, x.c, digits=x.digits, warn=False) for name, x in parts.items()}, warn=False
    )


def reached(method: Method, most: int, *, is_claimed: bool = True) -> tuple[int, int | None]:
    """The order of a method up to one, and the digits to which it holds; None if exactly.

    Rounded numbers count to the digits that they show: 12, half of those that are written, or at least 6. Exact numbers
    of which nothing is claimed must show 12.
    """
    found, least = order_of(method, most), digits_wanted(method) if is_claimed or method.digits else ENOUGH
    return (found < most and hidden_order(method, found, most, least)) or (found, None)


def digits_wanted(method: Method) -> int:
    """The digits to which rounded numbers must satisfy a claim."""
    return max(LEAST_DIGITS, min(math.ceil((method.digits or 0) / 2), ENOUGH))


def _unlike_a_slip(correction: Correction) -> bool:
    """Whether a change is no sign, single digit, dropped entry, exchange or shift."""
    if correction.kind != "entry":
        return False
    was, value = correction.was[0], correction.should_be[0]
    if not was:
        return False
    for common in (was.denominator, value.denominator):
        texts = [str(x * common) for x in (was, value)]
        if len(texts[0]) == len(texts[1]) and sum(x != y for x, y in zip(*texts, strict=True)) == 1:
            return False
    return True


def residuals(A: Sequence[Sequence[float]], b: Sequence[float], order: int) -> Iterator[float]:
    """The residuals of the conditions of tall and bushy trees: b A^(k−1) 1 − 1/k! and b c^(k−1) − 1/k to an order."""
    stages, nodes = [1.0] * len(b), [sum(row) for row in A]
    for k in range(1, order + 1):
        yield sum(x * y for x, y in zip(b, stages, strict=True)) - 1 / math.factorial(k)
        yield sum(x * c ** (k - 1) for x, c in zip(b, nodes, strict=True)) - 1 / k
        stages = [sum(x * y for x, y in zip(row, stages, strict=True)) for row in A]


def common_roots(all_conditions: Iterable[fmpq_poly]) -> list[Fraction]:
    """The values of one entry of A or b that can satisfy the conditions of tall trees.

    They are the roots of the greatest common divisor of these polynomials; in tableaus of rounded numbers, which have
    none, those of the linear one with the largest derivative, else of the first one that depends on the entry.
    """
    conditions = []
    for condition in all_conditions:
        if condition.degree() > 0:
            conditions.append(condition)
        elif abs(float(from_flint(condition(0)))) > NEAR:
            return []
    if not conditions:
        return []
    common = conditions[0]
    for condition in conditions[1:]:
        common = common.gcd(condition)
    if common.degree() > 0:
        return real_roots(common)
    linear = [condition for condition in conditions if condition.degree() == 1]
    return real_roots(max(linear, key=lambda x: abs(x[1])) if linear else conditions[0])


def tall_conditions(rows: Rows, places: Sequence[Place], order: int) -> Iterator[fmpq_poly]:
    """b A^(k−1) 1 − 1/k! for k = 1 … order as polynomials in an entry at some places."""
    from flint import fmpq_poly

    entries = [[fmpq_poly([to_flint(x)]) for x in row] for row in rows]
    for i, j in places:
        entries[i][j] = fmpq_poly([0, 1])
    *A, b = entries
    stages = [fmpq_poly([1])] * len(b)
    for k in range(1, order + 1):
        yield _product(b, stages) - to_flint(Fraction(1, math.factorial(k)))
        stages = [_product(row, stages) for row in A]


def _product(row: Sequence[fmpq_poly], column: Sequence[fmpq_poly]) -> fmpq_poly:
    from flint import fmpq_poly

    return sum((x * y for x, y in zip(row, column, strict=True)), fmpq_poly())


def real_roots(polynomial: fmpq_poly) -> list[Fraction]:
    """The rational roots of a polynomial exactly, other real ones to 30 digits."""
    import flint

    found: list[Fraction] = []
    for factor, _ in polynomial.factor()[1]:
        if factor.degree() == 1:
            found.append(from_flint(-flint.fmpq(factor[0]) / factor[1]))
            continue
        with flint.ctx.workprec(120):
            roots: Any = factor.complex_roots()
            for root, _ in roots:
                if root.imag == 0:
                    mantissa, exponent = root.real.mid().man_exp()
                    found.append(Fraction(int(mantissa)) * Fraction(2) ** int(exponent))
    return found
