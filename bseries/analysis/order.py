"""Order of accuracy of a method, and its principal error coefficients."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.algebra.bseries import BSeries, check_flow
from bseries.algebra.modified import exact_values, series, series_to
from bseries.algebra.stages import auxiliary_colors, check_method
from bseries.analysis.simplifying_assumptions import simplifying_assumptions
from bseries.exact.domains import RingValues, alike, exact_number, to_float
from bseries.exact.rationals import RationalValues
from bseries.exceptions import SeriesError
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.methods.program.transformations import as_decimals
from trees.counting import check_order, count_trees

if TYPE_CHECKING:
    from integrators.methods.program.program import Method
    from trees.table import TreeTable
    from trees.tree import Tree

MOST_TREES = 25_000
"""Largest table of trees for the order, where simplifying assumptions do not decide it."""

FLOAT_DIGITS = 15
"""Significant digits assumed of floating-point entries in order conditions."""


class ErrorCoefficients(NamedTuple):
    """The terms of the local error with one power of h, by default the leading one.

    `terms` pairs each tree of order p+1 with e(τ) = (a(τ) − 1/γ(τ)) / σ(τ); the local error is
    h^(p+1) Σ e(τ) F(τ) + O(h^(p+2)).
    """

    order: int
    terms: tuple[tuple[Tree, Any], ...]

    @property
    def norm_squared(self) -> Any:
        """Σ e(τ)²: the square of the principal error norm, exact where the method is."""
        return sum((e * e for _, e in self.terms), start=Fraction(0))

    @property
    def norm(self) -> float | None:
        """The principal error norm as a float; None where it depends on symbols or exceeds floats."""
        square = self.norm_squared
        try:
            return None if getattr(square, "free_symbols", None) else math.sqrt(square)
        except OverflowError:
            return None

    @property
    def largest(self) -> Any:
        """max |e(τ)|; None where it depends on symbols."""
        if any(getattr(e, "free_symbols", None) for _, e in self.terms):
            return None
        return max(abs(e) for _, e in self.terms)


def order_of(method: Method | BSeries, max_order: int | None = None) -> int:
    """Order of accuracy: the largest k such that all order conditions for trees with up to k nodes hold.

    Exact methods are decided exactly. Where entries are decimals or floats, a condition holds if its residual is zero
    within their digits. Methods of high order are decided by the simplifying assumptions B(p), C(q), D(r), which need
    no trees.

    Args:
        method: A method or a flow series.
        max_order: The largest order to test; by default the order of the series, or the order of 25,000 trees.

    Returns:
        The order; `max_order` if all conditions up to it hold.

    Raises:
        SeriesError: `method` is neither a method nor a flow, or `max_order` is out of its range.

    Example:
        >>> import bseries as bs
        >>> order_of(bs.method("rk4")), order_of(bs.method("gauss5"))
        (4, 10)

    References:
        HLW, theorems II.1.8 and III.1.5.
    """
    if isinstance(method, BSeries):
        return _order_of_series(series_to(method, max_order))
    return decide_order(method, max_order)[0]


def _order_of_series(s: BSeries, auxiliary: frozenset[int] = frozenset()) -> int:
    check_flow(s, "method")
    failing = first_failure(s, auxiliary)
    return s.order if failing is None else int(s.table.columns.order[failing]) - 1


def first_failure(s: BSeries, auxiliary: frozenset[int] = frozenset()) -> int | None:
    """Id of the first tree whose order condition a flow violates; `auxiliary` colours are not parts of the field."""
    if not s.is_exact:
        raise SeriesError("method must be a method or an exact series, but was a series in floats")
    if s.digits is not None and s.uncertainty is None:
        raise SeriesError("method must be a method or an exact series, but was made of a series in decimals")
    mine, others = alike([s.stored, _exact(s.table, auxiliary)])
    for at in range(len(s)):
        if isinstance(mine, RingValues):
            if mine.elements[at] != others.elements[at]:
                return at
            continue
        residual = abs(mine[at] - others[at])
        if residual and (s.uncertainty is None or residual > s.uncertainty(at)):
            return at
    return None


def _exact(table: TreeTable, auxiliary: frozenset[int]) -> RationalValues:
    """1/γ, and 0 for trees with a node of an auxiliary colour."""
    exact = exact_values(table)
    if not auxiliary:
        return exact
    values = zip(table, exact.coefficients(), strict=True)
    return RationalValues.from_fractions(table, [0 if auxiliary & set(t.colors) else x for t, x in values])


def decide_order(method: Method, max_order: int | None) -> tuple[int, int]:
    """The order, and the largest number of nodes tested."""
    check_method(method)
    max_order = None if max_order is None else check_order(max_order)
    method = trusted(method)
    if isinstance(method, RungeKutta) and (method.algebra is not None or method.domain == "QQ"):
        limit = 2 * method.stages + 1 if max_order is None else min(max_order, 2 * method.stages) + 1
        proved = simplifying_assumptions(method, limit).order(method)
        if proved is not None:
            return (proved, proved + 1) if max_order is None else (min(proved, max_order), max_order)
    limit = affordable_order(len(method.names)) if max_order is None else max_order
    for tested_to in chain(range(4, limit, 2), [limit]):
        order = _order_of_series(series(method, tested_to), auxiliary_colors(method))
        if order < tested_to:
            return order, tested_to
    return limit, limit


def affordable_order(colors: int, trees: int = MOST_TREES) -> int:
    """Largest order, between 4 and 12, of a table with at most `trees` trees."""
    order = 4
    while order < 12 and sum(count_trees(order + 1, colors)) <= trees:
        order += 1
    return order


def trusted(method: Method) -> Method:
    """The method, or its program, with floats as decimals of `FLOAT_DIGITS` digits."""
    if isinstance(method, RungeKutta):
        if method.domain != "float":
            return method
        A, b = ([[Fraction(to_float(x)) for x in row] for row in rows] for rows in (method.A, [method.b]))
        return RungeKutta(A, b[0], name=method.name, digits=FLOAT_DIGITS, warn=False)
    if isinstance(method, PartitionedRungeKutta):
        if all(part.domain != "float" for part in method.partitions):
            return method
        parts = [trusted(part) for part in method.partitions]
        return PartitionedRungeKutta(dict(zip(method.names, parts, strict=True)), name=method.name)  # pyright: ignore[reportArgumentType]
    program = method.program
    return as_decimals(program, FLOAT_DIGITS) if program.domain == "float" else method


def error_coefficients(method: Method, order: int | None = None) -> ErrorCoefficients:
    """Principal error coefficients: the residuals of the order conditions for trees with p+1 nodes, over σ.

    Args:
        method: A method.
        order: The order p, by default computed. Larger numbers give later terms of the error.

    Raises:
        SeriesError: `method` is no method.
        TreeError: There are too many trees with p+1 nodes for the memory.

    Example:
        >>> import bseries as bs
        >>> error = error_coefficients(bs.method("rk4"))
        >>> error.order, error.norm_squared * 2880**2, error.largest
        (4, Fraction(1745, 1), Fraction(1, 120))

    References:
        J. C. Butcher, *Numerical Methods for Ordinary Differential Equations*, section 318.
    """
    order = order_of(method) if order is None else order and check_order(order)
    s = series(method, order + 1)
    exact = _exact(s.table, auxiliary_colors(method))
    ids = s.table.ids(order + 1)
    terms = tuple((s.table[at], (s.stored[at] - exact[at]) / s.table[at].symmetry) for at in ids)
    return ErrorCoefficients(order, tuple((tree, _simple(e)) for tree, e in terms))


def _simple(value: Any) -> Any:
    """Simplify a SymPy expression; numbers are unchanged."""
    if isinstance(value, Fraction | float):
        return value
    import sympy

    return exact_number(sympy.cancel(sympy.expand(value)))
