"""The underlying one-step method of a method with memory, and the starting values on it."""

from __future__ import annotations

from typing import Any, cast

from bseries.algebra.bseries import BSeries
from bseries.algebra.general_linear import GeneralLinearInputs
from bseries.algebra.modified import series, table_of
from bseries.algebra.stages import inputs_of
from bseries.analysis.memory_properties import with_memory
from integrators.methods.kinds.memory import LinearMultistep
from integrators.methods.programs.program import Method
from trees.table import TreeTable


def underlying_one_step(method: Method | str, order: int | TreeTable) -> BSeries:
    """The one-step method Φ that a method with memory is, once it starts on it: the same as `series`.

    For a linear multistep method Σ α_j Φ^j = h Σ β_j f∘Φ^j; for a general linear one GLM∘S = S∘Φ.

    Args:
        method: A method with memory, or its name.
        order: Largest number of nodes, or a table of trees.

    Raises:
        SeriesError: `method` has no memory.
        TreeError: `order` is not a whole number ≥ 1, or needs more memory than there is.

    Example:
        >>> import bseries as bs
        >>> phi = bs.underlying_one_step("bdf2", 4)
        >>> phi["[τ,τ]"], bs.order_of(phi)
        (Fraction(1, 1), 2)

    References:
        U. Kirchgraber, Numer. Math. 48 (1986) 85–90; HLW, sections XV.2 and XV.8.
    """
    return series(with_memory(method), order)


def starting_procedure(method: Method | str, order: int | TreeTable) -> tuple[BSeries, ...]:
    """The series of the inputs of a step that start a method on its underlying one-step method Φ, without parasites.

    Args:
        method: A method with memory, or its name.
        order: Largest number of nodes, or a table of trees.

    Returns:
        For a linear multistep method with k steps the powers Φ^0, …, Φ^(k−1), the series of y_0, …, y_{k−1}; for a
        general linear method S_1, …, S_r, with the coefficients u_i at the empty tree.

    Raises:
        SeriesError: `method` has no memory.
        TreeError: `order` is not a whole number ≥ 1, or needs more memory than there is.

    Example:
        >>> import bseries as bs
        >>> first, second = bs.memory.starting_procedure("bdf2", 3)
        >>> bs.compose(first, second) == bs.underlying_one_step("bdf2", 3)
        True

    References:
        HLW, theorem XV.8.1.
    """
    checked = with_memory(method)
    table = table_of(checked, order, None)
    if isinstance(checked, LinearMultistep):
        phi = series(checked, table)
        powers: list[Any] = [phi**0]
        while len(powers) < checked.steps:
            powers.append(phi ** len(powers))
        return tuple(powers)
    inputs = cast(GeneralLinearInputs, inputs_of(checked, table.max_order))
    pairs: Any = zip(inputs.starting(table), cast(Any, checked).u, strict=True)
    return tuple(BSeries(table, values, u, names=checked.names, label=checked.name) for values, u in pairs)
