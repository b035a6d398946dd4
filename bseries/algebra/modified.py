"""Series of methods and of the exact flow, and modified equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any, overload

from bseries.algebra.bseries import BSeries, class_on
from bseries.algebra.series import Series
from bseries.algebra.stages import ExactStages, MethodInputs, check_method, inputs_of, is_chain, size_without_cuts
from bseries.algebra.uncertainty import Uncertainty, uncertainty_of
from bseries.exact.denominators import primorial
from bseries.exact.domains import Values
from bseries.exact.rationals import RationalValues
from bseries.exact.residues import PRIME_BITS, WORD
from bseries.exceptions import SeriesError
from integrators.methods.catalogue.registry import as_method
from integrators.methods.kinds.memory import LinearMultistep
from integrators.methods.programs.program import Method, RepeatedProgram
from trees.basis import Basis
from trees.counting import Limits, check_order, count_trees, memory_estimate, normal_limits, refuse_table_beyond_memory
from trees.table import TreeTable, tree_table
from trees.words import Words

DEFAULT_ORDER = 5
"""Of series of methods."""


@overload
def series(method: Method | str, order: int | TreeTable | None = None, *, max_children: Any = None) -> BSeries: ...
@overload
def series(method: Method | str, order: Words) -> Series: ...
def series(method: Method | str, order: int | TreeTable | Words | None = None, *, max_children: Any = None) -> Series:
    """B-series (or P-series) of a method: its elementary weights, or its underlying one-step method if it has memory.

    Args:
        method: The method; each part of a partitioned method is a colour of the trees.
        order: Largest number of nodes, by default 5, or a table of trees. For a splitting method also `trees.Words`:
            there its series is a product of exponentials.
        max_children: Which trees to include, as for `trees.TreeTable`; by default all, or those of the special systems,
            such as y'' = g(y), of the method.

    Returns:
        The flow series a(τ) = Σ b_i Φ_i(τ); the order conditions are a(τ) = 1/γ(τ).

    Raises:
        SeriesError: `method` is no method, has too many stages, or is no product of flows where words are given.
        TreeError: `order` is not a whole number ≥ 1, or needs more memory than there is (refused before any work).

    Example:
        >>> import bseries as bs
        >>> bs.series(bs.method("rk4"), 5)["[[[[τ]]]]"]
        Fraction(0, 1)

    References:
        HLW, theorems III.1.4 and III.2.4.
    """
    method = as_method(method)
    table = table_of(method, order, max_children)
    if isinstance(method, RepeatedProgram) and method.digits is None:
        one = series(method.step, table).scale_step(Fraction(1, method.count))
        return (one**method.count).with_label(method.name)
    return of_method(method, table, lambda inputs: inputs.series(table), 1, inputs_of(method, table.max_order))


def modified_equation(
    method: Method | BSeries | str, order: int | TreeTable | None = None, *, max_children: Any = None
) -> BSeries:
    """Modified equation: the field whose exact flow is the numerical method, as a formal series.

    With b the result, the numerical solution is formally the exact solution of
    y' = f_h(y) = Σ_τ h^(|τ|−1) / σ(τ) · b(τ) F(τ)(y).

    Args:
        method: A method, or any flow series.
        order: Largest number of nodes N: powers h^0 … h^(N−1) of the modified equation; by default 5, or the order of
            a series. For a method also a table of trees.
        max_children: Which trees to include, as for `trees.TreeTable`.

    Returns:
        The field series b = log a; b(τ) vanishes for 2 ≤ |τ| ≤ p if the method has order p.

    Raises:
        SeriesError: `method` is neither a method nor a flow, or `order` exceeds the order of the series.
        TreeError: `order` is not a whole number ≥ 1, or needs more memory than there is (refused before any work).

    Example:
        >>> import bseries as bs
        >>> b = bs.modified_equation(bs.method("explicit-midpoint"), 3)
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

    table = table_of(method, order, max_children)
    if isinstance(method, RepeatedProgram) and method.digits is None:
        one = modified_equation(method.step, table).scale_step(Fraction(1, method.count))
        return (one * method.count).with_label(method.name, "modified")
    if method.digits is not None:
        flow: Any = series(method, table)
        return flow.log().with_label(method.name, "modified")
    found = of_method(method, table, lambda inputs: inputs.logarithm(table), 0, inputs_of(method, table.max_order))
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
        >>> import bseries as bs
        >>> bs.exact_flow(4)["[τ,[τ]]"]
        Fraction(1, 8)

    References:
        HLW, theorem III.1.3.
    """
    table = tree_table(order, colors, max_children)
    return BSeries(table, exact_values(table), 1, names=names)


@lru_cache(maxsize=4)
def exact_values(basis: Basis[Any]) -> RationalValues:
    """The exact flow: 1/γ for trees, 1/n! for words of n letters."""
    denominators = [math.factorial(n) for n in range(basis.max_order + 1)]
    compact = basis.column(basis.exact_flow) if basis.max_order <= 20 else basis.exact_flow  # int64 for kernels
    return RationalValues(basis, compact, denominators, primorial(basis.max_order))


def table_of(method: Method, order: int | Basis[Any] | None, max_children: Any) -> Any:
    """The basis for the series of a method."""
    colors = len(check_method(method).names)
    if order is None:
        order = DEFAULT_ORDER
    if max_children is None and not isinstance(order, Basis):
        max_children = method.max_children
    if isinstance(order, Basis):
        if order.colors != colors:
            raise SeriesError(f"order must be a table of {order.what} in {colors} colours, but was {order!r}")
        if not isinstance(order, TreeTable) and not is_chain(method):
            raise SeriesError(f"order must be a table of trees for {method.name}, which is no product of flows")
        if max_children is not None:
            raise SeriesError(f"max_children must be None where a table is given, but was {max_children!r:.60}")
        return order
    limits = None if max_children is None else normal_limits(colors, max_children)
    _refuse_beyond_memory(check_order(order), colors, limits, size_without_cuts(method))
    return tree_table(order, colors, max_children)


@lru_cache(maxsize=64)
def _refuse_beyond_memory(order: int, colors: int, limits: Limits | None, size: tuple[int, int] | None) -> None:
    """Refuse series that would not fit in memory, before their table is made, once for each size.

    Methods with `size` stages and bits of denominators need two numbers for each stage and smaller tree, and one for
    each tree and prime; without, trees are cut.
    """
    sizes = count_trees(order, colors, limits)
    stages, bits = size or (0, 0)
    numbers = len(sizes) + 3 if size is None else 2 * stages + 1
    primes = max(0, order * bits - WORD) // PRIME_BITS
    needed = memory_estimate(sizes, colors, splits=size is None)
    needed += 8 * (numbers * sum(sizes[:-1]) + (3 + primes) * sum(sizes))
    refuse_table_beyond_memory(needed, f"a series of {sum(sizes)} trees")


def of_method(
    method: Method,
    basis: Basis[Any],
    values_of: Callable[[Any], Values],
    empty: int,
    inputs: MethodInputs,
    uncertainty: Callable[[Method, Any, Any], Uncertainty] = uncertainty_of,
) -> Any:
    """The series computed from the stages of a method, or from its chain of flows; digits give an `uncertainty`."""
    values, digits = values_of(inputs), method.digits
    errors = uncertainty(method, inputs, basis) if digits is not None and inputs.kind in ("rational", "float") else None
    made = class_on(basis)(
        basis, values, empty, names=method.names, label=method.name, digits=digits, uncertainty=errors
    )
    if isinstance(method, LinearMultistep) and method.rescaled:
        return made.scale_step(method.rescaling).with_label(method.name)
    if empty == 1 and isinstance(made, BSeries) and isinstance(inputs, ExactStages):
        return made.with_source(inputs)
    return made
