"""The order conditions of a kind of methods as text, LaTeX, SymPy equations, code, and compiled functions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple, overload

from bseries.algebra.modified import series
from bseries.analysis.simplifying_assumptions import Assumptions
from bseries.conditions.compiling import CompiledConditions
from bseries.conditions.condition import OrderCondition, class_weights, equation_of
from bseries.conditions.condition_program import ConditionProgram
from bseries.conditions.exact_values import check_stages, equations, left_sides, read_blocks, symbols
from bseries.conditions.kinds import KINDS, NODES
from bseries.conditions.source_code import source
from bseries.exceptions import SeriesError
from foundation.table import Column, LazyRows, Table, as_frame, as_html, listed
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.core.immutable import ImmutableValue
from trees.tree import Tree


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

        Returns:
            A list of ``sympy.Eq``.

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

        Returns:
            The source.

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
