"""`order_conditions`: its arguments, and the trees that have conditions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from bseries.analysis.simplifying_assumptions import Assumptions
from bseries.conditions.condition_program import EXPLICIT, FULL, STRUCTURES
from bseries.conditions.exact_values import check_stages
from bseries.conditions.kinds import KINDS, MethodKind
from bseries.conditions.listing import OrderConditions, Request
from bseries.exceptions import SeriesError
from integrators.core.errors import suggestion
from trees.counting import check_size, count_trees, normal_limits
from trees.lyndon_words import count_lyndon_words
from trees.notation import default_names
from trees.table import tree_table
from trees.tree import Tree

SCALAR = ("autonomous", "nonautonomous")

MOST_CONDITIONS = 200_000
"""Larger sets of trees are refused before any work."""


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
        >>> conditions = order_conditions("runge-kutta", 10)
        >>> len(conditions), len(order_conditions("runge-kutta", 10, assumptions="B10 C5 D4"))
        (1205, 0)
        >>> print(order_conditions("rosenbrock", 3))
        Σ b_i = 1
        Σ b_i β_i = 1/2
        Σ b_i β_ij β_j = 1/6
        Σ b_i α_i^2 = 1/3
        >>> print(order_conditions("splitting", 2))
        Σ x^p_i = 1
        Σ x^q_i = 1
        Σ_{j<i} x^p_i x^q_j = 1/2

    References:
        HLW, sections III.1–III.2; E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*,
        sections II.7 and II.14; E. Hairer, G. Wanner, *… II*, section IV.7; A. Murua, J. M. Sanz-Serna, *Order
        conditions for numerical integrators obtained by composing simpler integrators*, doi:10.1098/rsta.1999.0365;
        J. C. Butcher, *Numerical Methods for Ordinary Differential Equations*, section 316 (isomeric trees).
    """
    name, chosen = _find_kind(kind)
    colors = _check_colors(name, chosen, colors)
    order, colors = check_size(order, colors)
    limits = normal_limits(colors, chosen.limits if max_children is None else max_children)
    if max_children is not None and (chosen.trees or chosen.limits):
        raise SeriesError(f"max_children must be left out for {chosen.about}, but was {max_children!r:.60}")
    names = default_names(colors)
    request = Request(
        name,
        order,
        None if stages is None else check_stages(stages),
        colors,
        _check_structure(chosen, names, EXPLICIT if explicit else structure),
        Assumptions.read(assumptions),
        _check_scalar(scalar),
        bool(symmetric),
        limits,
    )
    if name != "runge-kutta" and (any(request.assumptions) or request.scalar):
        argument = "scalar" if request.scalar else "assumptions"
        raise SeriesError(f"{argument} must be left out for {chosen.about}, but was given")
    if request.scalar and any(request.assumptions):
        raise SeriesError(f"assumptions must be left out where scalar is given, but were {request.assumptions}")
    return OrderConditions(request, names, _classes(request, chosen))


def _classes(request: Request, kind: MethodKind) -> list[list[Tree]]:
    """The trees of each condition."""
    counts = (
        count_lyndon_words(request.order, request.colors)
        if kind.trees
        else count_trees(request.order, request.colors, request.limits)
    )
    if sum(counts) > MOST_CONDITIONS:
        raise SeriesError(
            f"order must be smaller: there would be {sum(counts):,} conditions, and {MOST_CONDITIONS:,} is the most"
        )
    if kind.trees:
        trees = kind.trees(request.order, request.colors)
    else:
        trees = tree_table(request.order, request.colors, request.limits)
    needed = [
        tree
        for tree in trees
        if kind.has_condition(tree)
        and not (request.symmetric and tree.order % 2 == 0)
        and not (any(request.assumptions) and request.assumptions.implies(tree))
    ]
    return _isomeric(needed, request.scalar) if request.scalar else [[tree] for tree in needed]


def _autonomous_class(tree: Tree) -> tuple[int, ...]:
    """Numbers of children, which determine the elementary differential Π f^(m) of a scalar y' = f(y).

    The classes of trees with n nodes are the partitions of n−1.
    """
    return tuple(sorted(len(t.children) for _, t in tree.preorder() if t.children))


def _nonautonomous_class(tree: Tree) -> tuple[tuple[int, int], ...]:
    """Butcher's atoms, which determine the elementary differential of a scalar y' = f(t, y).

    A leaf is a derivative along (1, f), any other child a derivative by y: a node with l leaves and m other children is
    the atom (∂_t + f ∂_y)^l ∂_y^m f.
    """
    atoms = []
    for _, t in tree.preorder():
        others = sum(1 for child in t.children if child.children)
        if t.children:
            atoms.append((len(t.children) - others, others))
    return tuple(sorted(atoms))


def _isomeric(trees: Iterable[Tree], scalar: str) -> list[list[Tree]]:
    """Group trees by their elementary differential on scalar equations, in the order of the first trees."""
    key: Callable[[Tree], Any] = _autonomous_class if scalar == "autonomous" else _nonautonomous_class
    classes: dict[Any, list[Tree]] = {}
    for tree in trees:
        classes.setdefault(key(tree), []).append(tree)
    return list(classes.values())


def _find_kind(kind: object) -> tuple[str, MethodKind]:
    name = kind.lower().replace("_", "-") if isinstance(kind, str) else kind
    if not isinstance(name, str) or name not in KINDS:
        near = suggestion(str(name), KINDS)
        raise SeriesError(f"kind must be one of {', '.join(KINDS)}, but was {kind!r:.60}{near}")
    return name, KINDS[name]


def _check_colors(name: str, kind: MethodKind, colors: int | None) -> int:
    if colors is None:
        return kind.colors
    if not kind.any_colors:
        raise SeriesError(f"colors must be left out for {kind.about}, but was {colors!r:.60}")
    return colors


def _check_structure(kind: MethodKind, names: Sequence[str], structure: object) -> tuple[str, ...]:
    """The structure of each matrix."""
    arguments, _ = kind.coefficients(names)
    count = sum(len(argument.parts) for argument in arguments if argument.is_matrix)
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


def _check_scalar(scalar: object) -> str:
    if scalar is None or isinstance(scalar, bool):
        return SCALAR[0] if scalar else ""
    if scalar not in SCALAR:
        raise SeriesError(f"scalar must be True, False, {SCALAR[0]!r} or {SCALAR[1]!r}, but was {scalar!r:.60}")
    return str(scalar)
