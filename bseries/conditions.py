"""Order of a method, its principal error coefficients, and the report of `check`."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators import PartitionedRungeKutta, RungeKutta
from trees.counting import check_order, count_trees

from .domains import RingValues, alike, to_float
from .exceptions import SeriesError
from .modified import exact_flow, series
from .presentation import number_text
from .simplifying import simplifying_assumptions
from .truncated import BSeries

if TYPE_CHECKING:
    from trees.tree import Tree

    from .coefficients import Method

MOST_TREES = 25_000
"""Order is decided on tables up to this size, unless the simplifying assumptions decide it."""

FLOAT_DIGITS = 15
"""Significant digits that floating-point entries are trusted to have when an order condition is decided."""


class ErrorCoefficients(NamedTuple):
    """The terms of the local error with one power of h, the first that does not vanish unless another was asked for.

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
    """The order of accuracy: the largest k such that all order conditions for trees with up to k nodes hold.

    Exact methods are decided exactly. Where entries are decimals or floats, a condition holds if its residual is no
    larger than the digits can tell from zero. Methods of high order are decided by the simplifying assumptions
    B(p), C(q), D(r), which need no trees.

    Args:
        method: A method or a flow series.
        max_order: Where to stop looking; by default the series' order, or as far as 25,000 trees reach.

    Returns:
        The order; `max_order` if no condition up to there fails.

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
        return _order_of_series(method if max_order is None else method.truncate(max_order))
    return _decide_order(method, max_order)[0]


def _order_of_series(s: BSeries) -> int:
    if s.empty != 1:
        raise SeriesError(f"method must be a flow, with the coefficient 1 of the empty tree, but has {s.empty} there")
    failing = first_failure(s)
    return s.order if failing is None else int(s.table._order[failing]) - 1


def first_failure(s: BSeries) -> int | None:
    """Id of the first tree whose order condition a flow violates."""
    if not s.is_exact:
        raise SeriesError("method must be a method or an exact series, but was a series in floats")
    if s.digits is not None and s.uncertainty is None:
        raise SeriesError("method must be a method or an exact series, but was made of a series in decimals")
    exact = exact_flow(s.order, colors=s.table.colors, max_children=s.table.limits)
    mine, others = alike([s._values, exact._values])
    for at in range(len(s)):
        if isinstance(mine, RingValues):
            if mine.elements[at] != others.elements[at]:
                return at
            continue
        residual = abs(mine[at] - others[at])
        if residual and (s.uncertainty is None or residual > s.uncertainty(at)):
            return at
    return None


def _decide_order(method: Method, max_order: int | None) -> tuple[int, int]:
    """The order, and how far it was tested."""
    if not isinstance(method, RungeKutta | PartitionedRungeKutta):
        raise SeriesError(f"method must be a method such as method('rk4') or a series, but was {method!r:.60}")
    max_order = None if max_order is None else check_order(max_order)
    method = trusted(method)
    if isinstance(method, RungeKutta) and (method.algebra is not None or method.domain == "QQ"):
        proved = simplifying_assumptions(method, 2 * method.stages + 1 if max_order is None else max_order + 1).order
        if proved is not None:
            return (proved, proved + 1) if max_order is None else (min(proved, max_order), max_order)
    limit = _affordable_order(len(method.partitions)) if max_order is None else max_order
    for reach in [*range(4, limit, 2), limit]:
        order = _order_of_series(series(method, reach))
        if order < reach:
            return order, reach
    return limit, limit


def _affordable_order(colors: int) -> int:
    order = 4
    while order < 12 and sum(count_trees(order + 1, colors)) <= MOST_TREES:
        order += 1
    return order


def trusted(method: Method) -> Method:
    """The method with floats taken as decimals of `FLOAT_DIGITS` digits, others as they are."""
    parts = [_as_decimals(part) if part.domain == "float" else part for part in method.partitions]
    if isinstance(method, RungeKutta):
        return parts[0]
    return PartitionedRungeKutta(dict(zip(method.names, parts, strict=True)), name=method.name)


def _as_decimals(part: RungeKutta) -> RungeKutta:
    A, b = ([[Fraction(to_float(x)) for x in row] for row in rows] for rows in (part.A, [part.b]))
    return RungeKutta(A, b[0], name=part.name, digits=FLOAT_DIGITS, warn=False)


def error_coefficients(method: Method, order: int | None = None) -> ErrorCoefficients:
    """The principal error coefficients: the order conditions' residuals for the trees with p+1 nodes, over σ.

    Args:
        method: A method.
        order: Its order p, if known; computed otherwise. Larger numbers give the next terms of the error.

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
    exact = exact_flow(order + 1, colors=s.table.colors)
    ids = s.table.ids(order + 1)
    terms = tuple((s.table[at], (s._values[at] - exact._values[at]) / s.table[at].symmetry) for at in ids)
    return ErrorCoefficients(order, tuple((tree, _simple(e)) for tree, e in terms))


def _simple(value: Any) -> Any:
    """SymPy expressions in their simplest form, numbers as they are."""
    if isinstance(value, Fraction | float):
        return value
    import sympy

    from .domains import exact_number

    return exact_number(sympy.cancel(sympy.expand(value)))


class Report(NamedTuple):
    """What `check` found.

    `tested_to` says up to how many nodes order conditions were looked at; `error` is None where the trees of the
    principal error are too many. `embedded_orders` are the orders of the embedded weights.
    """

    method: Method
    order: int
    tested_to: int
    error: ErrorCoefficients | None
    embedded_orders: tuple[int, ...]
    properties: dict[str, bool]

    @property
    def row_sums(self) -> tuple[tuple[Any, ...], ...]:
        """Row sums of A for each part; in floats where they are roots of high degree, which fill pages."""
        parts = self.method.partitions
        return tuple((p.to_float() if p.algebra is not None and p.stages > 3 else p).row_sums for p in parts)

    def to_dict(self) -> dict[str, Any]:
        """The report as JSON-ready data."""
        method = self.method
        data: dict[str, Any] = {
            "schema": 1,
            "kind": "check",
            "method": method.name,
            "stages": method.stages,
            "order": self.order,
            "tested_to": self.tested_to,
        }
        if self.embedded_orders:
            data["embedded_orders"] = list(self.embedded_orders)
        data["properties"] = self.properties
        digits = method.digits
        data["row_sums"] = [[number_text(x, digits) for x in sums] for sums in self.row_sums]
        data["issues"] = list(method.issues)
        if self.error is not None:
            names = method.names if len(method.partitions) > 1 else None
            terms = [{"tree": t.text(names), "coefficient": number_text(e, digits)} for t, e in self.error.terms]
            norms = {"norm_squared": number_text(self.error.norm_squared, digits), "norm": self.error.norm}
            largest = None if self.error.largest is None else number_text(self.error.largest, digits)
            data["error"] = {**norms, "largest": largest, "terms": terms}
        return data


def check(method: Method, order: int | None = None) -> Report:
    """Order, principal error, and what the tableau tells about a method.

    Args:
        method: A method.
        order: How far to test order conditions; by default as far as is needed.

    Returns:
        A `Report`.

    Raises:
        SeriesError: `method` is no method.

    Example:
        >>> import bseries as bs
        >>> report = check(bs.method("implicit-midpoint"))
        >>> report.order, report.properties["symplectic"], report.properties["explicit"]
        (2, True, False)

    References:
        HLW, theorems V.2.3 (symmetry) and VI.4.3, VI.4.6 (symplecticity).
    """
    found, tested_to = _decide_order(method, order)
    affordable = sum(count_trees(min(found + 1, 60), len(method.partitions))) <= MOST_TREES and found < tested_to
    properties = {
        "consistent": found >= 1,
        "explicit": method.is_explicit,
        "symmetric": method.is_symmetric,
        "symplectic": method.is_symplectic,
    }
    if isinstance(method, RungeKutta):
        properties["diagonally_implicit"] = method.is_diagonally_implicit
    else:
        properties["explicit_if_separable"] = method.is_explicit_if_separable
    return Report(
        method,
        found,
        tested_to,
        error_coefficients(method, found) if affordable else None,
        _embedded_orders(method),
        properties,
    )


def _embedded_orders(method: Method) -> tuple[int, ...]:
    if not isinstance(method, RungeKutta):
        return ()
    rows = (
        RungeKutta(method.A, weights, method.c, digits=method.digits, warn=False) for weights in method.embedded or ()
    )
    return tuple(order_of(row) for row in rows)
