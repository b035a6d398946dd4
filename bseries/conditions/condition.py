"""One order condition: its trees, its equation, and how it is written."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.conditions.kernels import IMAGE, ONE
from bseries.conditions.program import Equation, Program, Summand
from bseries.conditions.reductions import class_weights
from integrators.core.immutable import ImmutableValue
from trees.formulas import factor_text, index_letters

if TYPE_CHECKING:
    from bseries.conditions.kinds import Sums
    from trees.tree import Tree


class OrderCondition(ImmutableValue):
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


class Power(NamedTuple):
    """A factor: a symbol with the numbers of its indices, to a power."""

    symbol: tuple[str, str]
    part: str
    indices: tuple[int, ...]
    exponent: int


class Sum(NamedTuple):
    """A sum of products: its factors, how many indices it runs over, and how each relates to the one before."""

    factors: list[Power]
    relations: list[str]


def equation_text(program: Program, equation: Equation, format: str) -> str:
    """An equation as ``"text"`` or ``"latex"``."""
    return f"{left_text(program, equation, format)} = {_number(equation.right, format == 'latex')}"


def left_text(program: Program, equation: Equation, format: str) -> str:
    """The left-hand side of an equation."""
    return " + ".join(_summand_text(program, summand, format == "latex") for summand in equation.summands)


def _summand_text(program: Program, summand: Summand, latex: bool) -> str:
    found = _read(program, summand)
    indices = index_letters(len(found.relations), latex)
    parts = [_sign(found.relations, indices, latex)]
    for symbol, part, at, exponent in found.factors:
        own = [indices[k] for k in at]
        subscript = ("," if len(own[-1]) > 1 and not latex else "").join(own)
        parts.append(factor_text(symbol[latex], part, subscript, exponent, latex))
    if summand.coefficient != 1:
        parts.insert(0, _number(summand.coefficient, latex))
    return " ".join(parts)


def _sign(relations: Sequence[str], indices: Sequence[str], latex: bool) -> str:
    """Σ with what its indices satisfy."""
    chain = indices[-1]
    for relation, index in zip(reversed(relations[1:]), reversed(indices[:-1]), strict=True):
        sign = {"≤": r" \le " if latex else "≤"}.get(relation, f" {relation} " if latex else relation)
        chain += sign + index
    if latex:
        return f"\\sum_{{{chain if any(relations) else ','.join(indices)}}}"
    return f"Σ_{{{chain}}}" if any(relations) else "Σ"


def _number(value: Fraction, latex: bool) -> str:
    if latex and value.denominator > 1:
        return f"\\frac{{{value.numerator}}}{{{value.denominator}}}"
    return str(value)


def _read(program: Program, summand: Summand) -> Sum:
    """The factors of a summand; an index is given to the root and to each edge that is more than one factor."""
    block = program.blocks[summand.block]
    found = Sum([Power((block.argument.letter, block.argument.latex), block.part, (0,), 1)], [""])
    _visit(program, summand.value, 0, found)
    return found


def _visit(program: Program, stage: int, at: int, found: Sum) -> None:
    """Append the factors of the stage vector with index `at`: those with this index only, then branch by branch."""
    branches = []
    for factor, equal in groupby(program.factors(stage)):
        exponent = len(list(equal))
        leaf = _leaf(program, factor)
        if leaf is None:
            branches += [factor] * exponent
        elif leaf == found.factors[0][:2] and at == 0:  # x · x^(r−1) at the root is x^r
            found.factors[0] = found.factors[0]._replace(exponent=exponent + 1)
        else:
            found.factors.append(Power(*leaf, (at,), exponent))
    for factor in branches:
        _, which, branch = program.operations[factor]
        operator, own = program.operators[which], len(found.relations)
        found.relations.append(operator.relation)
        if not operator.relation:
            found.factors.append(Power((operator.letter, operator.latex), operator.part, (at, own), 1))
        _visit(program, branch, own, found)


def _leaf(program: Program, factor: int) -> tuple[tuple[str, str], str] | None:
    """Symbol and part of a factor with one index: a vector, or row sums that have a name."""
    kind, which, branch = program.operations[factor]
    if kind != IMAGE:
        block = program.blocks[which]
        return (block.argument.letter, block.argument.latex), block.part
    operator = program.operators[which]
    return (operator.row_sum, operator.part) if branch == ONE and operator.row_sum else None
