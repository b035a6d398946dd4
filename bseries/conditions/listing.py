"""Order conditions of a kind of methods: `order_conditions`, what it returns, and the trees that have conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple, overload

from bseries.algebra.modified import series
from bseries.algebra.stages import auxiliary_colors, is_chain
from bseries.analysis.simplifying_assumptions import Assumptions
from bseries.conditions import formulas
from bseries.conditions.condition_program import EXPLICIT, FULL, STRUCTURES, ConditionProgram, Equation, EquationTerm
from bseries.conditions.formulas import check_stages
from bseries.conditions.kinds import KINDS, MethodKind
from bseries.exceptions import SeriesError
from bseries_base.errors import suggestion
from bseries_base.numbers import latex_number
from bseries_base.table import Column, LazyRows, Table, as_frame, as_html, listed
from integrators.core.immutable import ImmutableValue
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from trees.counting import check_size, count_trees, normal_limits
from trees.lyndon_words import count_lyndon_words
from trees.notation import default_names
from trees.table import tree_table
from trees.tree import Tree

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike

    from bseries.conditions.compiling import CompiledConditions

SCALAR = ("autonomous", "nonautonomous")

MOST_CONDITIONS = 200_000
"""Larger sets of trees are refused before any work."""


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
    def _data(self) -> tuple[object, ...]:
        return self.trees, self.left, self.right

    @property
    def tree(self) -> Tree:
        """The tree, or the first of several."""
        return self.trees[0]

    @property
    def left(self) -> str:
        """The left-hand side as text."""
        return formulas.left_text(self._program, self._equation)

    def to_latex(self) -> str:
        """The equation as LaTeX."""
        return f"{formulas.left_text(self._program, self._equation, latex=True)} = {latex_number(self.right, None)}"

    def __str__(self) -> str:
        return f"{self.left} = {self.right}"

    def __repr__(self) -> str:
        return f"<OrderCondition {self.tree}: {self}>"


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
    def _data(self) -> tuple[object, ...]:
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
    def _weighted(self) -> list[list[tuple[Fraction, Tree]]]:
        """The trees of each condition, with their weights in Σ (a(τ) − 1/γ(τ))/σ(τ) = 0 as coprime integers."""
        symmetries = [[tree.symmetry for tree in trees] for trees in self.classes]
        return [
            [(Fraction(math.lcm(*own), symmetry), tree) for symmetry, tree in zip(own, trees, strict=True)]
            for own, trees in zip(symmetries, self.classes, strict=True)
        ]

    @cached_property
    def program(self) -> ConditionProgram:
        """The program that computes the equations."""
        kind = KINDS[self.kind]
        program = kind.program(self.names, self.request.structures)
        sums, equations = kind.sums(program), []
        for weighted in self._weighted:
            terms = [EquationTerm(w * term.factor, *term[1:]) for w, tree in weighted for term in sums(tree)]
            equations.append(Equation(tuple(terms), sum((w / tree.density for w, tree in weighted), Fraction(0))))
        program.equations, program.size = tuple(equations), len(program.operations)
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
        if isinstance(index, str | Tree):
            tree = Tree(index)
            found = next((at for at, trees in enumerate(self.classes) if tree in trees), None)
            if found is None:
                raise SeriesError(f"tree must have one of these {len(self)} conditions, but was {tree}")
            index = found
        return OrderCondition(self.classes[index], self.program, self.program.equations[index])

    def __iter__(self) -> Iterator[OrderCondition]:
        return (self[k] for k in range(len(self)))

    def __repr__(self) -> str:
        assumed = f", assuming {self.request.assumptions}" if any(self.request.assumptions) else ""
        return f"<OrderConditions {self.kind}: order {self.order}, {len(self)} conditions{assumed}>"

    def text(self) -> str:
        """The equations as text, one on each line."""
        return "\n".join(map(str, self))

    __str__ = text

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

    def residuals(self, *arrays: ArrayLike) -> list[Any]:
        """Left-hand sides minus right-hand sides, exactly for exact numbers.

        Args:
            *arrays: A method or its name, or the arrays of `arguments`: nested sequences of numbers or SymPy
                expressions.

        Raises:
            SeriesError: The arrays, or the method, do not fit.

        Example:
            >>> import bseries as bs
            >>> bs.order_conditions("runge-kutta", 4).residuals("rk4")
            [Fraction(0, 1), Fraction(0, 1), ..., Fraction(0, 1)]
        """
        if len(arrays) != 1 or not isinstance(arrays[0], str | Method):
            left = formulas.left_sides(self.program, formulas.read_blocks(self.program, arrays, self.request.stages))
        else:  # the method's series is exact and simple also for irrational tableaux
            method = as_method(arrays[0])
            fits = len(method.names) == len(self.names) and not auxiliary_colors(method)
            if not fits or (self.kind == "splitting" and not is_chain(method)):
                what = f"{len(self.names)}-part {self.kind}"
                raise SeriesError(f"method must be one of the {what} kind, but was {method!r}")
            s = series(method, self.order, max_children=self.request.limits)
            left = [sum(weight * s[tree] for weight, tree in weighted) for weighted in self._weighted]
        return [a - equation.right for a, equation in zip(left, self.program.equations, strict=True)]

    def sympy(self, *arrays: ArrayLike, stages: int | None = None, nodes: bool = False) -> list[sympy.Eq]:
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
            blocks = formulas.read_blocks(self.program, arrays, self.request.stages)
        else:
            blocks = formulas.symbols(self.program, check_stages(self._chosen_stages(stages)))
        if nodes and any(operator.row_sum != "c" for operator in self.program.operators):
            raise SeriesError(f"nodes must be False for {self.kind} methods, but was True")
        return formulas.equations(self.program, blocks, nodes=nodes)

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
        return formulas.source(self.program, title, labels, language, self._chosen_stages(stages), jacobian)

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
    def _fields(self) -> dict[str, Callable[[OrderCondition], object]]:
        """The entries of a condition in JSON and CSV."""
        names = self._shown_names
        return {
            "tree": lambda x: x.tree.text(names),
            "levels": lambda x: list(x.tree.levels),
            "colors": lambda x: list(x.tree.colors),
            "order": attrgetter("tree.order"),
            "isomeric": lambda x: [tree.text(names) for tree in x.trees[1:]],
            "left": attrgetter("left"),
            "right": lambda x: str(x.right),
            "latex": OrderCondition.to_latex,
        }

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
            "conditions": [{name: get(condition) for name, get in self._fields.items()} for condition in self],
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
        names, rows, request = self._shown_names, LazyRows(lambda: self, len(self)), self.request
        notes = [f"{KINDS[self.kind].notation}."]
        if any(request.assumptions):
            notes.append(f"Conditions that follow from {request.assumptions} and from those listed are left out.")
        if request.scalar:
            equation = "y' = f(y)" if request.scalar == SCALAR[0] else "y' = f(t, y)"
            notes.append(f"For scalar equations {equation}: isomeric trees share one condition.")
        if request.symmetric:
            notes.append(
                "For symmetric methods, whose order is even: conditions for even numbers of nodes are left out."
            )
        columns = (
            Column("|τ|", True, self._fields["order"]),
            Column("tree τ", get=lambda x: ", ".join(tree.text(names) for tree in x.trees)),
            Column("condition", get=str),
        )
        return Table(
            f"Order {self.order} of {KINDS[self.kind].about}: {len(self)} condition{'s' * (len(self) != 1)}",
            columns,
            rows,
            notes,
            data=self.to_dict,
            items="conditions",
            section=self._fields["order"],
            records=listed(self._fields.items(), rows),
            own={"latex": lambda width: self.to_latex() + "\n"},
        )

    _repr_html_, to_pandas = as_html, as_frame


def order_conditions(
    kind: str,
    order: int,
    *,
    stages: int | None = None,
    colors: int | None = None,
    structure: str | Sequence[str] = FULL,
    explicit: bool = False,
    assumptions: str | Mapping[str, int] | None = None,
    scalar: bool | str = False,
    symmetric: bool = False,
    max_children: Any = None,
) -> OrderConditions:
    """Order conditions on the coefficients of a method.

    Args:
        kind: ``"runge-kutta"``; ``"partitioned"`` or ``"additive"`` (one matrix A and row b for each part, stacked);
            ``"nystrom"`` for y'' = g(y) and ``"general-nystrom"`` for y'' = g(y, y'), with stages
            Y_i = y + c_i h y' + h² Σ ā_ij g_j and Y'_i = y' + h Σ a_ij g_j, positions y + h y' + h² Σ b̄_i g_i and
            velocities y' + h Σ b_i g_i; ``"rosenbrock"`` with α_ij, γ_ij and b_i, where β = α + γ; ``"splitting"``: s
            sweeps of exact flows, x^ν_i h being the time of the flow of part ν in sweep i.
        order: The order.
        stages: The number of stages s (sweeps of a splitting method), where equations and code need one.
        colors: The number of parts, for kinds with parts; by default 2.
        structure: ``"full"``, ``"explicit"`` or ``"diagonally-implicit"`` matrices; a list with one for each matrix.
        explicit: Short for ``structure="explicit"``.
        assumptions: Simplifying assumptions on a Runge–Kutta method, as in ``"B5 C2 D1"`` or ``{"C": 2}``: conditions
            that they and the remaining conditions imply are left out; see `Assumptions.implies`.
        scalar: ``"autonomous"`` (or True) and ``"nonautonomous"`` for Runge–Kutta methods on scalar equations y' = f(y)
            and y' = f(t, y): isomeric trees, with equal elementary differentials, are summed,
            Σ (a(τ) − 1/γ(τ))/σ(τ) = 0.
        symmetric: The methods are symmetric, hence of even order: conditions for even numbers of nodes are left out.
        max_children: Which trees to include, as in `TreeTable`, for Runge–Kutta, partitioned and additive methods.

    Raises:
        SeriesError: The kind is unknown, an argument does not apply to it, or there are too many conditions.
        TreeError: `order`, `colors`, `stages` or `max_children` is out of its range.

    Example:
        >>> import bseries as bs
        >>> conditions = bs.order_conditions("runge-kutta", 10)
        >>> len(conditions), len(bs.order_conditions("runge-kutta", 10, assumptions="B10 C5 D4"))
        (1205, 0)
        >>> print(bs.order_conditions("rosenbrock", 3))
        Σ b_i = 1
        Σ b_i β_i = 1/2
        Σ b_i β_ij β_j = 1/6
        Σ b_i α_i^2 = 1/3
        >>> print(bs.order_conditions("splitting", 2))
        Σ x^p_i = 1
        Σ x^q_i = 1
        Σ_{j<i} x^p_i x^q_j = 1/2

    References:
        HLW, sections III.1–III.2; E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*,
        sections II.7 and II.14; E. Hairer, G. Wanner, *… II*, section IV.7; A. Murua, J. M. Sanz-Serna, *Order
        conditions for numerical integrators obtained by composing simpler integrators*, doi:10.1098/rsta.1999.0365;
        J. C. Butcher, *Numerical Methods for Ordinary Differential Equations*, section 316 (isomeric trees).
    """
    name = kind.lower().replace("_", "-") if isinstance(kind, str) else ""
    if name not in KINDS:
        near = suggestion(str(name or kind), KINDS)
        raise SeriesError(f"kind must be one of {', '.join(KINDS)}, but was {kind!r:.60}{near}")
    chosen = KINDS[name]
    if colors is not None and not chosen.has_parts:
        raise SeriesError(f"colors must be left out for {chosen.about}, but was {colors!r:.60}")
    order, colors = check_size(order, chosen.colors if colors is None else colors)
    limits = normal_limits(colors, chosen.limits if max_children is None else max_children)
    if max_children is not None and (chosen.trees or chosen.limits):
        raise SeriesError(f"max_children must be left out for {chosen.about}, but was {max_children!r:.60}")
    if not isinstance(scalar, bool | None) and scalar not in SCALAR:
        raise SeriesError(f"scalar must be True, False, {SCALAR[0]!r} or {SCALAR[1]!r}, but was {scalar!r:.60}")
    names = default_names(colors)
    request = Request(
        name,
        order,
        None if stages is None else check_stages(stages),
        colors,
        _check_structure(chosen, names, EXPLICIT if explicit else structure),
        Assumptions.read(assumptions),
        SCALAR[0] if scalar is True else scalar or "",
        bool(symmetric),
        limits,
    )
    if name != "runge-kutta" and (any(request.assumptions) or request.scalar):
        argument = "scalar" if request.scalar else "assumptions"
        raise SeriesError(f"{argument} must be left out for {chosen.about}, but was given")
    if request.scalar and any(request.assumptions):
        raise SeriesError(f"assumptions must be left out where scalar is given, but were {request.assumptions}")
    return OrderConditions(request, names, _classes(request, chosen))


def _check_structure(kind: MethodKind, names: Sequence[str], structure: object) -> tuple[str, ...]:
    """The structure of each matrix."""
    count = sum(argument.is_matrix for argument in kind.arguments) * (len(names) if kind.has_parts else 1)
    if kind.structures or not count:
        if structure != FULL:
            raise SeriesError(f"structure must be left out for {kind.about}, but was {structure!r:.60}")
        return kind.structures or ()
    each = (structure,) * count if isinstance(structure, str) else structure
    listed = tuple(each) if isinstance(each, Sequence) else ()
    if len(listed) != count or not all(s in STRUCTURES for s in listed):
        raise SeriesError(
            f"structure must be one of {', '.join(STRUCTURES)}, or {count} of them, but was {structure!r:.60}"
        )
    return listed


def _classes(request: Request, kind: MethodKind) -> list[list[Tree]]:
    """The trees of each condition; on scalar equations those with equal elementary differentials, first ones first."""
    order, colors, limits = request.order, request.colors, request.limits
    count = sum(count_lyndon_words(order, colors) if kind.trees else count_trees(order, colors, limits))
    if count > MOST_CONDITIONS:
        raise SeriesError(
            f"order must be smaller: there would be {count:,} conditions, and {MOST_CONDITIONS:,} is the most"
        )
    classes: dict[Any, list[Tree]] = {}
    for tree in kind.trees(order, colors) if kind.trees else tree_table(order, colors, limits):
        implied = any(request.assumptions) and request.assumptions.implies(tree)
        even = request.symmetric and tree.order % 2 == 0
        holds = kind.limits and tree.order == 1 and tree.color  # y₁ = y₀ + h y₀' + … of Nyström methods
        if not (implied or even or holds):
            key = _scalar_differential(tree, request.scalar) if request.scalar else tree
            classes.setdefault(key, []).append(tree)
    return list(classes.values())


def _scalar_differential(tree: Tree, scalar: str) -> tuple[Any, ...]:
    """What determines the elementary differential of a tree on scalar equations.

    On y' = f(y) it is Π f^(m) over the nodes with m ≥ 1 children. On y' = f(t, y) a leaf is a derivative along (1, f),
    any other child a derivative by y: a node with l leaves and m other children is (∂_t + f ∂_y)^l ∂_y^m f, one of
    Butcher's atoms.
    """
    inner = [t.children for _, t in tree.preorder() if t.children]
    if scalar == SCALAR[0]:
        return tuple(sorted(map(len, inner)))
    others = [sum(1 for child in children if child.children) for children in inner]
    return tuple(sorted((len(children) - m, m) for m, children in zip(others, inner, strict=True)))
