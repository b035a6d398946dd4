"""One order condition: its trees, its equation, and how it is written."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from integrators.frozen import Frozen

from .program import Equation, Program, Summand
from .reductions import class_weights
from .texts import equation_text, left_text

if TYPE_CHECKING:
    from trees.tree import Tree

    from .kinds import Sums


class OrderCondition(Frozen):
    """One order condition: left-hand side = right-hand side.

    Attributes:
        trees: The tree of the condition; several isomeric ones for scalar equations.
        right: The right-hand side: 1/γ(τ).

    Example:
        >>> import bseries as bs
        >>> condition = bs.order_conditions("runge-kutta", 4)["[τ,[τ]]"]
        >>> print(condition)
        Σ b_i c_i a_ij c_j = 1/8
        >>> condition.tree, condition.right, condition.left
        (Tree('[τ,[τ]]'), Fraction(1, 8), 'Σ b_i c_i a_ij c_j')
        >>> print(condition.latex)
        \\sum_{i,j} b_{i} c_{i} a_{ij} c_{j} = \\frac{1}{8}
    """

    trees: tuple[Tree, ...]
    right: Fraction

    _program: Program
    _equation: Equation

    def __init__(self, trees: tuple[Tree, ...], program: Program, equation: Equation):
        self.__dict__.update(trees=trees, right=equation.right, _program=program, _equation=equation)

    @property
    def _data(self) -> tuple[Any, ...]:
        return self.trees, self.left, self.right

    @property
    def tree(self) -> Tree:
        """The tree, or the first of several."""
        return self.trees[0]

    @property
    def left(self) -> str:
        """The left-hand side as text."""
        return left_text(self._program, self._equation, "text")

    @property
    def latex(self) -> str:
        """The equation as LaTeX."""
        return equation_text(self._program, self._equation, "latex")

    def __str__(self) -> str:
        return f"{self.left} = {self.right}"

    def __repr__(self) -> str:
        return f"<OrderCondition {self.tree}: {self}>"


def equation_of(trees: Sequence[Tree], sums: Sums) -> Equation:
    """The equation of one tree, or the sum of those of isomeric trees."""
    summands: list[Summand] = []
    right = Fraction(0)
    for tree, weight in zip(trees, class_weights(trees), strict=True):
        summands += [Summand(weight * coefficient, block, stage) for coefficient, block, stage in sums(tree)]
        right += weight / tree.density
    return Equation(tuple(summands), right)
