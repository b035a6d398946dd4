"""Series of methods and of the exact flow, and modified equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any

from bseries.algebra.bseries import BSeries
from bseries.algebra.stages import FlowChain, MethodStages, check_method, inputs_of
from bseries.algebra.uncertainty import Uncertainty, uncertainty_of
from bseries.exact import recursions
from bseries.exact.domains import apply
from bseries.exact.rationals import Operation, RationalValues, log_denominator, primorial, wider_step
from bseries.exceptions import SeriesError
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method, RepeatedProgram
from trees.counting import Limits, check_order, count_trees, memory_estimate, normal_limits, refuse_table_beyond_memory
from trees.table import TreeTable, tree_table


def series(method: Method | str, order: int | TreeTable, *, max_children: Any = None) -> BSeries:
    """B-series (or P-series) of a method: its elementary weights.

    Args:
        method: The method; each part of a partitioned method is a colour of the trees.
        order: Largest number of nodes, or a table of trees.
        max_children: Which trees to include, as for `trees.TreeTable`; by default all, or those of the special systems,
            such as y'' = g(y), of the method.

    Returns:
        The flow series a(τ) = Σ b_i Φ_i(τ); the order conditions are a(τ) = 1/γ(τ).

    Raises:
        SeriesError: `method` is no method, or has too many stages.
        TreeError: `order` is not a whole number ≥ 1, or needs more memory than there is (refused before any work).

    Example:
        >>> import bseries as bs
        >>> series(bs.method("rk4"), 5)["[[[[τ]]]]"]
        Fraction(0, 1)

    References:
        HLW, theorems III.1.4 and III.2.4.
    """
    method = as_method(method)

    def operation(inputs: MethodStages | FlowChain) -> Operation:
        return Operation(lambda arithmetic, weights: weights(field=False), passes=inputs.passes)

    table = table_of(method, order, max_children)
    if isinstance(method, RepeatedProgram) and method.digits is None:
        one = series(method.step, table).scale_step(Fraction(1, method.count))
        return (one**method.count).with_label(method.name)
    return of_method(method, table, operation, 1, inputs_of(method, table.max_order))


def modified_equation(
    method: Method | BSeries | str, order: int | TreeTable | None = None, *, max_children: Any = None
) -> BSeries:
    """Modified equation: the field whose exact flow is the numerical method, as a formal series.

    With b the result, the numerical solution is formally the exact solution of
    y' = f_h(y) = Σ_τ h^(|τ|−1) / σ(τ) · b(τ) F(τ)(y).

    Args:
        method: A method, or any flow series.
        order: Largest number of nodes N: powers h^0 … h^(N−1) of the modified equation. For a method also a table of
            trees; for a series by default its own order.
        max_children: Which trees to include, as for `trees.TreeTable`.

    Returns:
        The field series b = log a; b(τ) vanishes for 2 ≤ |τ| ≤ p if the method has order p.

    Raises:
        SeriesError: `method` is neither a method nor a flow, or `order` exceeds the order of the series.
        TreeError: `order` is not a whole number ≥ 1, or needs more memory than there is (refused before any work).

    Example:
        >>> import bseries as bs
        >>> b = modified_equation(bs.method("explicit-midpoint"), 3)
        >>> [(str(tree), str(value)) for tree, value in b.items() if value]
        [('τ', '1'), ('[[τ]]', '-1/6'), ('[τ,τ]', '-1/12')]

    References:
        HLW, theorem IX.9.2; E. Hairer, *Backward analysis of numerical integrators and symplectic methods*,
        Annals of Numerical Mathematics 1 (1994).
    """
    method = as_method(method)
    if isinstance(method, BSeries):
        given = series_to(method, order, max_children)
        return given.log().with_label(given.label, "modified")

    def expression(arithmetic: Any, weights: Any) -> Any:
        return recursions.logarithm(weights(field=True), table, arithmetic)

    def operation(inputs: MethodStages | FlowChain) -> Operation:
        facts: dict[str, Any] = {"units": inputs.units, "passes": inputs.passes}
        return Operation(expression, log_denominator, wider_step, field=True, **facts)

    table = table_of(method, order, max_children)
    if isinstance(method, RepeatedProgram) and method.digits is None:
        one = modified_equation(method.step, table).scale_step(Fraction(1, method.count))
        return (one * method.count).with_label(method.name, "modified")
    if method.digits is not None:
        return series(method, table).log().with_label(method.name, "modified")
    found = of_method(method, table, operation, 0, inputs_of(method, table.max_order))
    return found.with_label(method.name, "modified")


def series_to(s: BSeries, order: Any, max_children: Any = None) -> BSeries:
    """A series in place of a method, up to some order (None: its own), on its own trees."""
    if max_children is not None:
        raise SeriesError(f"max_children must be None for a series, but was {max_children!r:.60}")
    return s if order is None else s.truncate(order)


def exact_flow(order: int, *, colors: int = 1, max_children: Any = None, names: Sequence[str] = ()) -> BSeries:
    """B-series of the exact flow: 1/γ(τ).

    Args:
        order: Largest number of nodes.
        colors: Number of colours of the trees.
        max_children: Which trees to include, as for `trees.TreeTable`.
        names: Names of the colours.

    Raises:
        TreeError: An argument is out of its range.

    Example:
        >>> exact_flow(4)["[τ,[τ]]"]
        Fraction(1, 8)

    References:
        HLW, theorem III.1.3.
    """
    table = tree_table(order, colors, max_children)
    return BSeries(table, exact_values(table), 1, names=names)


@lru_cache(maxsize=4)
def exact_values(table: TreeTable) -> RationalValues:
    """1/γ for every tree of a table."""
    denominators = [math.factorial(n) for n in range(table.max_order + 1)]
    density, nodes = table.density.tolist(), table.order.tolist()
    numerators = [denominators[n] // gamma for n, gamma in zip(nodes, density, strict=True)]
    compact = table.column(numerators) if table.max_order <= 20 else numerators  # int64 for compiled kernels
    return RationalValues(table, compact, denominators, primorial(table.max_order))


def table_of(method: Method, order: int | TreeTable | None, max_children: Any) -> TreeTable:
    """The table of trees for the series of a method."""
    if order is None:
        raise SeriesError("order must be given for a method, but was None")
    colors = len(check_method(method).names)
    if max_children is None and not isinstance(order, TreeTable):
        max_children = method.max_children
    if isinstance(order, TreeTable):
        if order.colors != colors:
            raise SeriesError(f"order must be a table of trees in {colors} colours, but was {order!r}")
        if max_children is not None:
            raise SeriesError(f"max_children must be None where a table is given, but was {max_children!r:.60}")
        return order
    _refuse_beyond_memory(
        check_order(order), colors, None if max_children is None else normal_limits(colors, max_children)
    )
    return tree_table(order, colors, max_children)


@lru_cache(maxsize=64)
def _refuse_beyond_memory(order: int, colors: int, limits: Limits | None) -> None:
    """Refuse series that would not fit in memory, before their table is made, once for each size."""
    sizes = count_trees(order, colors, limits)
    rows = (len(sizes) + 3) * sum(sizes[:-1])
    needed = memory_estimate(sizes, colors) + 8 * (rows + 3 * sum(sizes))
    refuse_table_beyond_memory(needed, f"a series of {sum(sizes)} trees")


def of_method(
    method: Method,
    table: TreeTable,
    operation: Callable[[Any], Operation],
    empty: int,
    inputs: MethodStages | FlowChain,
    uncertainty: Callable[[Method, Any, TreeTable], Uncertainty] = uncertainty_of,
) -> BSeries:
    """Apply an operation to the stages of a method, or to its chain of flows; decimals have an `uncertainty`."""

    values, digits = apply(table, [inputs], operation(inputs)), method.digits
    errors = uncertainty(method, inputs, table) if digits is not None and inputs.kind == "rational" else None
    return BSeries(table, values, empty, names=method.names, label=method.name, digits=digits, uncertainty=errors)
