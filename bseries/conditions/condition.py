"""Single order conditions: trees, equation, text and LaTeX."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import groupby
from typing import Any, NamedTuple

from bseries.conditions.condition_program import IMAGE, ONE, ConditionProgram, Equation, EquationTerm
from bseries.conditions.kinds import Sums
from foundation.numbers import latex_number
from integrators.core.immutable import ImmutableValue
from trees.formulas import factor_text, index_letters
from trees.tree import Tree


class OrderCondition(ImmutableValue):
    """One order condition: left-hand side = right-hand side.

    Attributes:
        trees: The tree of the condition; several isomeric trees for scalar equations.
        right: The right-hand side: 1/γ(τ).

    Example:
        >>> import bseries as bs
        >>> condition = bs.order_conditions("runge-kutta", 4)["[τ,[τ]]"]
        >>> print(condition)
        Σ b_i c_i a_ij c_j = 1/8
        >>> condition.tree, condition.right, condition.left
        (Tree('[τ,[τ]]'), Fraction(1, 8), 'Σ b_i c_i a_ij c_j')
        >>> print(condition.to_latex())
        \\sum_{i,j} b_{i} c_{i} a_{ij} c_{j} = \\frac{1}{8}
    """

    trees: tuple[Tree, ...]
    right: Fraction

    _program: ConditionProgram
    _equation: Equation

    def __init__(self, trees: tuple[Tree, ...], program: ConditionProgram, equation: Equation):
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
        return left_text(self._program, self._equation)

    def to_latex(self) -> str:
        """The equation as LaTeX."""
        return f"{left_text(self._program, self._equation, latex=True)} = {latex_number(self.right, None)}"

    def __str__(self) -> str:
        return f"{self.left} = {self.right}"

    def __repr__(self) -> str:
        return f"<OrderCondition {self.tree}: {self}>"


def equation_of(trees: Sequence[Tree], sums: Sums) -> Equation:
    """The equation of one tree, or the sum of those of isomeric trees."""
    summands: list[EquationTerm] = []
    right = Fraction(0)
    for tree, weight in zip(trees, class_weights(trees), strict=True):
        summands += [EquationTerm(weight * factor, block, stage) for factor, block, stage in sums(tree)]
        right += weight / tree.density
    return Equation(tuple(summands), right)


def class_weights(trees: Iterable[Tree]) -> list[Fraction]:
    """Coprime integers proportional to 1/σ, the weights of isomeric trees in Σ (a(τ) − 1/γ(τ))/σ(τ) = 0."""
    symmetries = [tree.symmetry for tree in trees]
    multiple = math.lcm(*symmetries)
    return [Fraction(multiple, symmetry) for symmetry in symmetries]


class Factor(NamedTuple):
    """A factor of a product: a symbol with the numbers of its indices, to a power."""

    symbol: tuple[str, str]
    part: str
    indices: tuple[int, ...]
    exponent: int


def left_text(program: ConditionProgram, equation: Equation, *, latex: bool = False) -> str:
    """The left-hand side of an equation."""
    return " + ".join(_summand_text(program, summand, latex) for summand in equation.summands)


def _summand_text(program: ConditionProgram, summand: EquationTerm, latex: bool) -> str:
    """A sum of products over indices: one for the root, and one for each edge that is not a single factor."""
    block = program.blocks[summand.block]
    factors = [Factor((block.argument.letter, block.argument.latex), block.part, (0,), 1)]
    relations = [""]  # of each index to the previous one
    _visit(program, summand.value, 0, factors, relations)
    indices = index_letters(len(relations), latex)
    parts = [_sign(relations, indices, latex)]
    for symbol, part, at, exponent in factors:
        own = [indices[k] for k in at]
        subscript = ("," if len(own[-1]) > 1 and not latex else "").join(own)
        parts.append(factor_text(symbol[latex], part, subscript, exponent, latex))
    if summand.factor != 1:
        parts.insert(0, latex_number(summand.factor, None) if latex else str(summand.factor))
    return " ".join(parts)


def _sign(relations: Sequence[str], indices: Sequence[str], latex: bool) -> str:
    """Σ with the relations of its indices."""
    chain = indices[-1]
    for relation, index in zip(reversed(relations[1:]), reversed(indices[:-1]), strict=True):
        sign = {"≤": r" \le " if latex else "≤"}.get(relation, f" {relation} " if latex else relation)
        chain += sign + index
    if latex:
        return f"\\sum_{{{chain if any(relations) else ','.join(indices)}}}"
    return f"Σ_{{{chain}}}" if any(relations) else "Σ"


def _visit(program: ConditionProgram, stage: int, at: int, factors: list[Factor], relations: list[str]) -> None:
    """Append the factors of a stage vector: first those with the index `at` only, then branch by branch."""
    branches = []
    for factor, equal in groupby(program.factors(stage)):
        exponent = len(list(equal))
        leaf = _leaf(program, factor)
        if leaf is None:
            branches += [factor] * exponent
        elif leaf == factors[0][:2] and at == 0:  # x · x^(r−1) at the root is x^r
            factors[0] = factors[0]._replace(exponent=exponent + 1)
        else:
            factors.append(Factor(*leaf, (at,), exponent))
    for factor in branches:
        _, which, branch = program.operations[factor]
        operator, own = program.operators[which], len(relations)
        relations.append(operator.relation)
        if not operator.relation:
            factors.append(Factor((operator.letter, operator.latex), operator.part, (at, own), 1))
        _visit(program, branch, own, factors, relations)


def _leaf(program: ConditionProgram, factor: int) -> tuple[tuple[str, str], str] | None:
    """Symbol and part of a factor with one index: a vector, or row sums with a symbol."""
    kind, which, branch = program.operations[factor]
    if kind != IMAGE:
        block = program.blocks[which]
        return (block.argument.letter, block.argument.latex), block.part
    operator = program.operators[which]
    return (operator.row_sum, operator.part) if branch == ONE and operator.row_sum else None
