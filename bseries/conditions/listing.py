"""Order conditions, single ones and those of a kind of methods, as text, LaTeX, SymPy equations, code and functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple, overload

from bseries.algebra.modified import series
from bseries.analysis.simplifying_assumptions import Assumptions
from bseries.conditions.condition_program import IMAGE, ONE, ConditionProgram, Equation, EquationTerm
from bseries.conditions.exact_values import check_stages, equations, left_sides, read_blocks, symbols
from bseries.conditions.kinds import KINDS, NODES, Sums
from bseries.conditions.source_code import source
from bseries.exceptions import SeriesError
from foundation.numbers import latex_number
from foundation.table import Column, LazyRows, Table, as_frame, as_html, listed
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.core.immutable import ImmutableValue
from trees.formulas import factor_text, index_letters
from trees.tree import Tree

if TYPE_CHECKING:
    from bseries.conditions.compiling import CompiledConditions


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


class Request(NamedTuple):
    """The checked arguments of `order_conditions` in normal form."""

    kind: str
    order: int
    stages: int | None
    colors: int
    structures: tuple[str, ...]
    assumptions: Assumptions
    scalar: str
    symmetric: bool
    limits: Any


class OrderConditions(ImmutableValue, Sequence[OrderCondition]):
    """The order conditions of a kind of methods, made by `order_conditions`.

    A sequence of `OrderCondition`s in the order of the trees, also indexed by trees and their texts. Arrays of
    coefficients, and the columns of a Jacobian, have the order of `arguments`.

    Attributes:
        request: The arguments of `order_conditions`.
        names: The names of the parts.
        classes: The trees of each condition.

    Example:
        >>> import bseries as bs
        >>> conditions = bs.order_conditions("runge-kutta", 3)
        >>> print(conditions)
        Σ b_i = 1
        Σ b_i c_i = 1/2
        Σ b_i a_ij c_j = 1/6
        Σ b_i c_i^2 = 1/3
        >>> [str(x) for x in conditions.residuals(bs.method("heun2"))]
        ['0', '0', '-1/6', '1/6']
    """

    request: Request
    names: tuple[str, ...]
    classes: tuple[tuple[Tree, ...], ...]

    def __init__(self, request: Request, names: tuple[str, ...], classes: Sequence[Sequence[Tree]]):
        self.__dict__.update(request=request, names=names, classes=tuple(map(tuple, classes)))

    @property
    def _data(self) -> tuple[Any, ...]:
        return self.request

    @property
    def kind(self) -> str:
        """The kind of methods."""
        return self.request.kind

    @property
    def order(self) -> int:
        """The order that the conditions give."""
        return self.request.order

    @cached_property
    def program(self) -> ConditionProgram:
        """The program that computes the equations."""
        kind = KINDS[self.kind]
        program = ConditionProgram(*kind.coefficients(self.names), self.request.structures)
        sums = kind.sums(program)
        program.require([equation_of(trees, sums) for trees in self.classes])
        return program

    @property
    def arguments(self) -> tuple[str, ...]:
        """The names of the arrays of coefficients.

        Example:
            >>> import bseries as bs
            >>> bs.order_conditions("nystrom", 3).arguments
            ('Abar', 'bbar', 'b', 'c')
        """
        return tuple(argument.name for argument in self.program.arguments)

    def __len__(self) -> int:
        return len(self.classes)

    @overload
    def __getitem__(self, index: int | str | Tree) -> OrderCondition: ...
    @overload
    def __getitem__(self, index: slice) -> list[OrderCondition]: ...
    def __getitem__(self, index: int | str | Tree | slice) -> OrderCondition | list[OrderCondition]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        at = self._find(Tree(index)) if isinstance(index, str | Tree) else index
        return OrderCondition(self.classes[at], self.program, self.program.equations[at])

    def _find(self, tree: Tree) -> int:
        for at, trees in enumerate(self.classes):
            if tree in trees:
                return at
        raise SeriesError(f"tree must have one of these {len(self)} conditions, but was {tree}")

    def __iter__(self) -> Iterator[OrderCondition]:
        return (self[k] for k in range(len(self)))

    def __repr__(self) -> str:
        assumed = f", assuming {self.request.assumptions}" if any(self.request.assumptions) else ""
        return f"<OrderConditions {self.kind}: order {self.order}, {len(self)} conditions{assumed}>"

    def __str__(self) -> str:
        return self.text()

    def text(self) -> str:
        """The equations as text, one on each line."""
        return "\n".join(map(str, self))

    def to_latex(self) -> str:
        """The equations as LaTeX, aligned at their equality signs.

        Example:
            >>> import bseries as bs
            >>> print(bs.order_conditions("runge-kutta", 2).to_latex())
            \\begin{align*}
            \\sum_{i} b_{i} &= 1 \\\\
            \\sum_{i} b_{i} c_{i} &= \\frac{1}{2}
            \\end{align*}
        """
        lines = " \\\\\n".join(condition.to_latex().replace(" = ", " &= ") for condition in self)
        return f"\\begin{{align*}}\n{lines}\n\\end{{align*}}"

    def residuals(self, *arrays: Any) -> list[Any]:
        """Left-hand sides minus right-hand sides, exactly for exact numbers.

        Args:
            *arrays: A method, or the arrays of `arguments`: nested sequences of numbers or SymPy expressions.

        Raises:
            SeriesError: The arrays do not fit.

        Example:
            >>> import bseries as bs
            >>> bs.order_conditions("runge-kutta", 4).residuals(bs.method("rk4"))
            [Fraction(0, 1), Fraction(0, 1), ..., Fraction(0, 1)]
        """
        if len(arrays) == 1 and isinstance(arrays[0], RungeKutta | PartitionedRungeKutta):
            return self._residuals_of_method(arrays[0])
        left = left_sides(self.program, read_blocks(self.program, arrays, self.request.stages))
        return [a - equation.right for a, equation in zip(left, self.program.equations, strict=True)]

    def _residuals_of_method(self, method: RungeKutta | PartitionedRungeKutta) -> list[Any]:
        """The residuals from the method's series, which are exact and simple also for irrational tableaux."""
        if self.kind not in ("runge-kutta", "partitioned", "additive") or len(method.partitions) != len(self.names):
            raise SeriesError(f"method must be one of the {len(self.names)}-part {self.kind} kind, but was {method!r}")
        s = series(method, self.order, max_children=self.request.limits)
        left = [
            sum(weight * s[tree] for tree, weight in zip(trees, class_weights(trees), strict=True))
            for trees in self.classes
        ]
        return [a - equation.right for a, equation in zip(left, self.program.equations, strict=True)]

    def sympy(self, *arrays: Any, stages: int | None = None, nodes: bool = False) -> list[Any]:
        """The conditions as SymPy equations.

        Args:
            *arrays: The arrays of `arguments`, of SymPy expressions or numbers; by default symbols a_ij, b_i, …, and
                zeros given by the structure.
            stages: The number of stages; not needed if it was given to `order_conditions`, or with arrays.
            nodes: Write the row sums of A as symbols c_i, and append the equations c_i = Σ a_ij.

        Raises:
            SeriesError: The arrays do not fit, or the number of stages is not known.

        Example:
            >>> import bseries as bs
            >>> bs.order_conditions("runge-kutta", 3, explicit=True).sympy(stages=3)[3].lhs
            a_21**2*b_2 + b_3*(a_31 + a_32)**2
        """
        if arrays:
            blocks = read_blocks(self.program, arrays, self.request.stages)
        else:
            blocks = symbols(self.program, check_stages(self._chosen_stages(stages)))
        if nodes and any(operator.row_sum != NODES for operator in self.program.operators):
            raise SeriesError(f"nodes must be False for {self.kind} methods, but was True")
        return equations(self.program, blocks, nodes=nodes)

    def code(self, language: str, *, stages: int | None = None, jacobian: bool = True) -> str:
        """Source code of a function ``residual`` and, by default, ``jacobian``.

        Args:
            language: ``"numpy"``, ``"c"`` or ``"julia"``. Arrays are those of `arguments`; in C they are
                flat, row by row, and the result is the last argument.
            stages: The number of stages; ``"numpy"`` does not need it.
            jacobian: Whether to write the Jacobian: a row for each condition, a column for each free coefficient,
                argument by argument, row by row.

        Raises:
            SeriesError: The language is unknown, the number of stages is missing or too large to write scalar code, or
                there are no conditions.

        Example:
            >>> import bseries as bs
            >>> print(bs.order_conditions("runge-kutta", 3, explicit=True).code("julia", stages=2, jacobian=False))
            # 4 order conditions of runge-kutta methods: order 3; 2 stages
            <BLANKLINE>
            function residual(A, b)
                r = zeros(promote_type(eltype(A), eltype(b)), 4)
                r[1] = b[1] + b[2] - 1
                r[2] = A[2,1] .* b[2] - 1 // 2
                r[3] = -1 // 6
                r[4] = A[2,1] .^ 2 .* b[2] - 1 // 3
                return r
            end
            <BLANKLINE>
        """
        title = f"{len(self)} order conditions of {self.kind} methods: order {self.order}"
        labels = (", ".join(tree.text(self._shown_names) for tree in trees) for trees in self.classes)
        return source(self.program, title, labels, language, self._chosen_stages(stages), jacobian)

    def compile(self, stages: int | None = None) -> CompiledConditions:
        """The residual and its Jacobian as compiled functions of floats; see `CompiledConditions`.

        Args:
            stages: The number of stages; not needed if it was given to `order_conditions`.

        Raises:
            SeriesError: The number of stages is missing or not 1 or more.
        """
        from bseries.conditions.compiling import CompiledConditions

        return CompiledConditions(self.program, check_stages(self._chosen_stages(stages)))

    def _chosen_stages(self, stages: int | None) -> int | None:
        """The number of stages given here or to `order_conditions`."""
        return self.request.stages if stages is None else stages

    @property
    def _shown_names(self) -> tuple[str, ...] | None:
        """The names of the parts where there are several."""
        return self.names if len(self.names) > 1 else None

    @property
    def _fields(self) -> tuple[tuple[str, Callable[[OrderCondition], object]], ...]:
        """The entries of a condition in JSON and CSV."""
        names = self._shown_names
        return (
            ("tree", lambda x: x.tree.text(names)),
            ("levels", lambda x: list(x.tree.levels)),
            ("colors", lambda x: list(x.tree.colors)),
            ("order", lambda x: x.tree.order),
            ("isomeric", lambda x: [tree.text(names) for tree in x.trees[1:]]),
            ("left", lambda x: x.left),
            ("right", lambda x: str(x.right)),
            ("latex", lambda x: x.to_latex()),
        )

    def to_dict(self) -> dict[str, Any]:
        """The conditions as JSON-ready data."""
        request = self.request
        return {
            "schema": 1,
            "kind": "conditions",
            "methods": self.kind,
            "order": self.order,
            "colors": list(self.names),
            "assumptions": {name: k for name, k in request.assumptions._asdict().items() if k},
            "scalar": request.scalar or None,
            "symmetric": request.symmetric,
            "conditions": [{name: get(condition) for name, get in self._fields} for condition in self],
        }

    def to_table(self) -> Table:
        """The conditions as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Example:
            >>> import bseries as bs
            >>> print(bs.order_conditions("runge-kutta", 2).to_table().to_text())
            Order 2 of Runge–Kutta methods: 2 conditions
            <BLANKLINE>
            |τ|  tree τ  condition
            ───  ──────  ───────────────
              1  τ       Σ b_i = 1
            <BLANKLINE>
              2  [τ]     Σ b_i c_i = 1/2
            <BLANKLINE>
            c_i = Σ_j a_ij.
        """
        names, rows = self._shown_names, LazyRows(lambda: self, len(self))
        columns = (
            Column("|τ|", True, lambda x: x.tree.order),
            Column("tree τ", get=lambda x: ", ".join(tree.text(names) for tree in x.trees)),
            Column("condition", get=str),
        )
        return Table(
            f"Order {self.order} of {KINDS[self.kind].about}: {len(self)} condition{'s' * (len(self) != 1)}",
            columns,
            rows,
            list(_notes(self)),
            data=self.to_dict,
            items="conditions",
            section=lambda x: x.tree.order,
            records=listed(self._fields, rows),
            own={"latex": lambda width: self.to_latex() + "\n"},
        )

    _repr_html_, to_pandas = as_html, as_frame


def _notes(found: OrderConditions) -> Iterator[str]:
    """Sentences below the table."""
    request = found.request
    yield f"{KINDS[found.kind].notation}."
    if any(request.assumptions):
        yield f"Conditions that follow from {request.assumptions} and from those listed are left out."
    if request.scalar:
        equation = "y' = f(y)" if request.scalar == "autonomous" else "y' = f(t, y)"
        yield f"For scalar equations {equation}: isomeric trees share one condition."
    if request.symmetric:
        yield "For symmetric methods, whose order is even: conditions for even numbers of nodes are left out."
