"""Formulas in new variables, simplified by the relations that all functions in them have."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..differential_rings import DifferentialRing
from ..sparse_polynomials import TooLarge

if TYPE_CHECKING:
    import sympy

MOST_MONOMIALS = 10_000
"""Longer formulas are not simplified."""


def simplified(formula: sympy.Expr, symbols: Sequence[sympy.Symbol]) -> sympy.Expr:
    """An equal formula, factored, with sin² + cos² = 1 used; very long ones stay as they are."""
    try:
        ring = DifferentialRing([formula], symbols, limit=MOST_MONOMIALS)
        return ring.to_expression(ring.elements[0])
    except TooLarge:
        return formula


def simplified_from_within(formula: Any, symbols: Sequence[sympy.Symbol]) -> Any:
    """A formula simplified from within: √(x² + y²) is known as a radius only when its inside is.

    What comes out is factored, or a sum where that is shorter.
    """
    import sympy

    def inner(part: Any) -> Any:
        return part.func(*(simplified(argument, symbols) for argument in part.args))

    def is_opaque(part: Any) -> bool:
        return bool(part.is_Function or (part.is_Pow and not part.exp.is_Integer))

    factored: Any = simplified(formula.replace(is_opaque, inner), symbols)
    return min(sympy.expand_mul(factored), factored, key=sympy.count_ops)
