"""Order of accuracy of a method, its principal error coefficients, and the series on which its structure is decided.

Exact series are decided exactly. Of a method published as decimals, a residual counts as zero if other entries with the
same digits change it by as much, in the worst case (see `bseries.algebra.uncertainty`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from itertools import chain
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.algebra.bseries import BSeries
from bseries.algebra.modified import exact_values, modified_equation, series, series_to, table_of
from bseries.algebra.series import Series, check_flow
from bseries.algebra.stages import auxiliary_colors, check_method, inputs_of, is_chain
from bseries.analysis.simplifying_assumptions import simplifying_assumptions
from bseries.analysis.stability.field_elements import RealAlgebraic, from_element, real_algebraic
from bseries.exact.domains import alike, exact_number, ring_element, to_float
from bseries.exact.rationals import RationalValues
from bseries.exceptions import SeriesError
from bseries_base.table import Column, Table, as_frame, as_html, as_text, fact_table
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.exact.entries import nearest_decimal
from integrators.exact.polynomials import from_flint, to_flint
from integrators.methods.catalogue.registry import as_method
from integrators.methods.kinds.memory import LinearMultistep, MethodWithMemory
from integrators.methods.programs.program import Method, RepeatedProgram, as_decimals
from trees.basis import Basis
from trees.counting import check_order, count_trees
from trees.table import TreeTable
from trees.tree import Tree
from trees.words import Words

if TYPE_CHECKING:
    from bseries.exact.domains import Coefficient

MOST_STRUCTURE_TREES = 1300
"""Structure is tested on tables up to this size."""

LEAST_NODES = 7
"""Structure is tested to at least this number of nodes, if the table allows it."""

MOST_TREES = 25_000
"""Largest table of trees for the order, where simplifying assumptions do not decide it."""

FLOAT_DIGITS = 15
"""Significant digits assumed of floating-point entries in order conditions, unless the method says fewer."""


class Verdict(NamedTuple):
    """The order up to which a property holds.

    Attributes:
        order: The largest k ≤ `tested_to` such that no tree with up to k nodes violates the property.
        breaks: The first tree that violates it, or None.
        tested_to: The largest number of nodes tested.

    Example:
        >>> import bseries as bs
        >>> verdict = bs.symplecticity("rk4", 6)
        >>> verdict.order, str(verdict.breaks), verdict.tested_to, verdict.holds
        (4, '[τ,[[τ]]]', 6, False)
    """

    order: int
    breaks: Tree | None
    tested_to: int

    @property
    def holds(self) -> bool:
        """Whether no tree violates the property."""
        return self.breaks is None

    def __str__(self) -> str:
        return f"holds to order {self.order}, " + (f"violated by {self.breaks}" if self.breaks else "as far as tested")

    def to_dict(self) -> dict[str, Any]:
        """The verdict as plain data."""
        return {"order": self.order, "breaks": self.breaks and str(self.breaks), "tested_to": self.tested_to}

    def to_table(self) -> Table:
        """The verdict as a table."""
        return fact_table(str(self), self.to_dict().items())

    _repr_html_ = as_html


def verdict(table: TreeTable, violating: int | None) -> Verdict:
    """The verdict for a property whose first violating tree has this id."""
    if violating is None:
        return Verdict(table.max_order, None, table.max_order)
    return Verdict(int(table.columns.order[violating]) - 1, table[violating], table.max_order)


class ErrorCoefficients(NamedTuple):
    """The terms of the local error with one power of h, by default the leading one.

    The local error is h^(p+1) Σ e(τ) F(τ) + O(h^(p+2)).

    Attributes:
        order: The order p.
        terms: Each tree of order p+1 with e(τ) = (a(τ) − 1/γ(τ)) / σ(τ).
        norm_squared: Σ e(τ)²: the square of the principal error norm, exact where the method is.
        largest: max |e(τ)|; None where it depends on symbols.
        names: The names of the colours, if there are several.
    """

    order: int
    terms: tuple[tuple[Tree, Coefficient], ...]
    norm_squared: Coefficient
    largest: Coefficient | None
    names: tuple[str, ...] | None = None

    def __repr__(self) -> str:
        return f"<ErrorCoefficients: order {self.order}, {len(self.terms)} trees>"

    def to_dict(self) -> dict[str, Any]:
        """The coefficients as plain data."""
        terms = [{"tree": tree.text(self.names), "coefficient": str(e)} for tree, e in self.terms]
        return {"schema": 1, "kind": "error-coefficients", "order": self.order, "norm": self.norm, "terms": terms}

    def to_table(self) -> Table:
        """The coefficients as a table."""
        columns = (Column("tree τ", get=lambda row: row[0].text(self.names)), Column("e(τ)", True, itemgetter(1)))
        notes = [] if self.norm is None else [f"Principal error norm: {self.norm:.6g}."]
        return Table(f"Error coefficients at order {self.order + 1}", columns, self.terms, notes, data=self.to_dict)

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame

    @property
    def norm(self) -> float | None:
        """The principal error norm as a float; None where it depends on symbols or exceeds floats."""
        try:
            return None if getattr(self.norm_squared, "free_symbols", None) else math.sqrt(self.norm_squared)
        except OverflowError:
            return None


def order_of(method: Method | BSeries | str, max_order: int | None = None) -> int:
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
        >>> bs.order_of("rk4"), bs.order_of("gauss5")
        (4, 10)

    References:
        HLW, theorems II.1.8 and III.1.5.
    """
    method = as_method(method)
    if isinstance(method, BSeries):
        return accuracy_of(series_to(method, max_order)).order
    return decide_order(method, max_order)[0]


def accuracy_of(s: BSeries, auxiliary: frozenset[int] = frozenset()) -> Verdict:
    """The verdict on the order conditions of a flow, in which `auxiliary` colours are not parts of the field."""
    check_flow(s, "method")
    return verdict(s.table, first_failure(s, auxiliary))


def first_failure(s: Series, auxiliary: frozenset[int] = frozenset()) -> int | None:
    """Id of the first element whose order condition a flow violates; `auxiliary` colours are not parts of the field."""
    return next(failures(s, auxiliary), None)


def failures(s: Series, auxiliary: frozenset[int] = frozenset()) -> Iterator[int]:
    """Ids of the elements whose order condition a flow violates."""
    _check_exact(s)
    mine, others = alike([s.stored, exact_values_of(s.basis, auxiliary)])
    for at in range(len(s)):
        if not mine.equals_at(others, at) and not s.may_be(at, others[at]):
            yield at


def _check_exact(s: Series) -> None:
    """Refuse a series whose errors are not known."""
    if not s.is_exact:
        raise SeriesError("method must be a method or an exact series, but was a series in floats")
    if s.digits is not None and s.uncertainty is None:
        raise SeriesError("method must be a method or an exact series, but was made of a series in decimals")


def exact_values_of(basis: Basis, auxiliary: frozenset[int]) -> RationalValues:
    """The exact flow, and 0 for trees with a node of an auxiliary colour."""
    exact = exact_values(basis)
    if not auxiliary:
        return exact
    values = zip(basis, exact.coefficients(), strict=True)
    return RationalValues.from_fractions(basis, [0 if auxiliary & set(basis.letters(t)) else x for t, x in values])


def decide_order(method: Method, max_order: int | None) -> tuple[int, int]:
    """The order, and the largest number of nodes tested."""
    check_method(method)
    max_order = None if max_order is None else check_order(max_order)
    method = trusted(method)
    if isinstance(method, LinearMultistep) and not method.rescaled:
        return (method.order, method.order + 1) if max_order is None else (min(method.order, max_order), max_order)
    if isinstance(method, RungeKutta) and (method.algebra is not None or method.domain == "QQ"):
        limit = 2 * method.stages + 1 if max_order is None else min(max_order, 2 * method.stages) + 1
        proved = simplifying_assumptions(method, limit).order(method)
        if proved is not None:
            return (proved, proved + 1) if max_order is None else (min(proved, max_order), max_order)
    if isinstance(method, RepeatedProgram):  # equal steps have the order of one
        method = method.step
    colors, auxiliary = len(method.names), auxiliary_colors(method)
    if max_order is not None:
        limit = max_order
    elif has_words(method):
        limit = max(n for n in range(13) if colors**n <= MOST_TREES)
    else:
        limit = affordable_order(colors)
    for tested_to in chain(range(4, limit, 2), [limit]):
        s = series(method, basis_of_conditions(method, tested_to))
        failure = first_failure(s, auxiliary)
        order = tested_to if failure is None else s.basis.order_of(failure) - 1
        if order < tested_to:
            return order, tested_to
    return limit, limit


def has_words(method: Method) -> bool:
    """Whether words decide the order: a product of flows is the exact flow to order p if and only if its coefficients
    of all words up to p letters are 1/n!, since that of a tree is the sum over its monotonic orders.

    References:
        A. Murua, Found. Comput. Math. 6 (2006) 387–426, doi:10.1007/s10208-003-0111-0.
    """
    return not auxiliary_colors(method) and method.max_children is None and is_chain(method)


def basis_of_conditions(method: Method, order: int) -> Words | TreeTable:
    """Words, of which there are far fewer than trees, where they decide the order; else trees."""
    colors = len(method.names)
    if has_words(method) and colors**order <= MOST_TREES:
        return Words(order, colors)
    return table_of(method, order, None)


def affordable_order(colors: int, trees: int = MOST_TREES) -> int:
    """Largest order, between 4 and 12, of a table with at most `trees` trees."""
    order = 4
    while order < 12 and sum(count_trees(order + 1, colors)) <= trees:
        order += 1
    return order


def trusted(method: Method) -> Method:
    """The method, or its program, with floats as decimals of `FLOAT_DIGITS` digits, or fewer if it says so."""
    if (
        isinstance(method, MethodWithMemory)
        or inputs_of(method.step if isinstance(method, RepeatedProgram) else method, 1).kind != "float"
    ):
        return method
    if isinstance(method, RungeKutta):
        A, b = ([[nearest_decimal(to_float(x)) for x in row] for row in rows] for rows in (method.A, [method.b]))
        digits = min(method.digits or FLOAT_DIGITS, FLOAT_DIGITS)
        return RungeKutta(A, b[0], name=method.name, digits=digits, warn=False)
    if isinstance(method, PartitionedRungeKutta):
        parts = [trusted(part) for part in method.partitions]
        return PartitionedRungeKutta(dict(zip(method.names, parts, strict=True)), name=method.name)  # pyright: ignore[reportArgumentType]
    return as_decimals(method.program, min(method.digits or FLOAT_DIGITS, FLOAT_DIGITS))


def error_coefficients(method: Method | str, order: int | None = None) -> ErrorCoefficients:
    """Principal error coefficients: the residuals of the order conditions for trees with p+1 nodes, over σ.

    Args:
        method: A method.
        order: The order p, by default computed. Larger numbers give later terms of the error.

    Raises:
        SeriesError: `method` is no method.
        TreeError: There are too many trees with p+1 nodes for the memory.

    Example:
        >>> import bseries as bs
        >>> error = bs.analysis.error_coefficients("rk4")
        >>> error.order, error.norm_squared * 2880**2, error.largest
        (4, Fraction(1745, 1), Fraction(1, 120))

    References:
        J. C. Butcher, *Numerical Methods for Ordinary Differential Equations*, section 318.
    """
    method = as_method(method)
    order = order_of(method) if order is None else order and check_order(order)
    s = series(method, order + 1)
    exact, ids = exact_values_of(s.table, auxiliary_colors(method)), s.table.ids(order + 1)
    values: Any = s.stored
    if values.kind == "ring" and values.ring.is_AlgebraicField:
        values = values.reduced
        values = dict(zip(ids, real_algebraic(values.ring, values.raw[ids.start : ids.stop]), strict=True))

    def public(number: Any) -> Any:
        return from_element(number) if isinstance(number, RealAlgebraic) else number

    symmetry = s.table.symmetry_and_density[0]
    errors = [_simple((values[at] - exact[at]) / int(symmetry[at])) for at in ids]
    has_symbols = any(getattr(e, "free_symbols", None) for e in errors)
    largest = None if has_symbols else public(max(map(abs, errors), default=Fraction(0)))
    return ErrorCoefficients(
        order,
        tuple((s.table[at], public(e)) for at, e in zip(ids, errors, strict=True)),
        public(sum((e * e for e in errors), start=Fraction(0))),
        largest,
        s.names if s.table.colors > 1 else None,
    )


def _simple(value: Coefficient) -> Coefficient:
    """Simplify a SymPy expression; other numbers are unchanged."""
    if isinstance(value, Fraction | float | RealAlgebraic):
        return value
    import sympy

    return exact_number(sympy.cancel(sympy.expand(value)))


def flow_of(method: Method | BSeries | str, order: int | None) -> BSeries:
    """The flow of a method."""
    if isinstance(method, BSeries):
        check_flow(method, "method")
    return decidable(method, order)


def field_of(method: Method | BSeries | str, order: int | None) -> BSeries:
    """The modified equation of a method, or a field itself."""
    s = decidable(method, order, modified_equation)
    if s.empty == 0:
        return s
    check_flow(s, "method")
    return s.log()


def decidable(
    method: Method | BSeries | str, order: int | None, make: Callable[[Method, int], BSeries] = series
) -> BSeries:
    """A series, or that of a method, up to some order, whose structure can be decided: its errors are known."""
    method = as_method(method)
    s = series_of(method, order, make)
    if not isinstance(method, BSeries) and auxiliary_colors(method):
        parts = ", ".join(method.names[color] for color in auxiliary_colors(method))
        raise SeriesError(f"method must be made of the field alone to have a structure, but has the extra part {parts}")
    _check_exact(s)
    return s


def series_of(method: Method | BSeries, order: int | None, make: Callable[[Method, int], BSeries] = series) -> BSeries:
    """A series, or that which is made of a method, up to some order, with floats taken as decimals."""
    if isinstance(method, BSeries):
        return series_to(method, order)
    check_method(method)
    return make(trusted(method), structure_order(method, order_of(method)) if order is None else order)


def structure_order(method: Method, accuracy: int) -> int:
    """Default number of nodes for structure tests: beyond the order of accuracy, within the limits of cost."""
    most = affordable_order(len(method.names), MOST_STRUCTURE_TREES)
    if method.digits is not None or method.parameters:
        return max(4, min(accuracy + 1, most))
    return min(max(accuracy + 2, LEAST_NODES), most)


def field_elements(b: Series) -> tuple[list[Any], Callable[[Fraction], Any], Callable[[Any], Any]]:
    """Coefficients in a field, the conversion of a Fraction to the field, and that of an element to a coefficient."""
    values: Any = b.stored
    if values.kind == "ring":
        values = values.reduced
        return list(values.raw), partial(ring_element, values.ring), values.ring.to_sympy
    return list(map(to_flint, values.coefficients())), to_flint, from_flint
