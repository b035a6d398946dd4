"""A method as shown on a page: tableau, order, structure, modified equation, stability region and order star."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bseries.algebra.modified import modified_equation
from bseries.algebra.presentation import SeriesTerm
from bseries.analysis.report import check
from bseries.analysis.stability import criteria
from bseries.exceptions import SeriesError
from bseries_base.errors import BSeriesError, as_sentence
from integrators.methods.programs.program import Method
from integrators.methods.tableaux.partitioned import PartitionedRungeKutta
from integrators.methods.tableaux.presentation import tableau_html
from integrators.methods.tableaux.runge_kutta import RungeKutta
from trees.counting import count_trees
from trees.drawing import svg

if TYPE_CHECKING:
    from bseries.exact.domains import Coefficient

MOST_TREES = 300
"""Largest number of trees on a page: those up to eight nodes without colours, up to five with two."""
DEFAULT_TREES = 100
"""Largest number of trees on a page by default."""


class TermRow(NamedTuple):
    """A tree of the modified equation as text; `size` and `value` are the coefficient and the weight as numbers."""

    picture: str
    tree: str
    nodes: int
    coefficient: str
    weight: str
    size: float
    value: float
    differential: str


class MethodFacts(NamedTuple):
    """A method as text for a page; `tableau` and `facts` are HTML."""

    name: str
    order: int
    tableau: str
    tableau_latex: str
    facts: str
    issues: tuple[str, ...]
    nodes: int
    terms: tuple[TermRow, ...]
    latex: str
    json: str
    notes: tuple[str, ...]


def most_nodes(method: Method, trees: int = MOST_TREES) -> int:
    """The largest number of nodes up to which there are at most `trees` trees.

    Example:
        >>> import bseries as bs
        >>> most_nodes(bs.method("rk4")), most_nodes(bs.method("stormer-verlet"))
        (8, 5)
    """
    colors, nodes = len(method.names), 1
    while sum(count_trees(nodes + 1, colors)) <= trees:
        nodes += 1
    return nodes


def method_facts(method: Method, nodes: int | None = None) -> MethodFacts:
    """The facts about a method that a page shows.

    Args:
        method: The method.
        nodes: The largest number of nodes of trees; by default the largest with at most a hundred trees.

    Raises:
        SeriesError: There would be too many trees, or the method is inconsistent.

    Example:
        >>> import bseries as bs
        >>> facts = method_facts(bs.method("explicit-euler"), 2)
        >>> facts.order, facts.latex, [term.weight for term in facts.terms]
        (1, "f - \\\\frac{1}{2} h\\\\, f'(f)", ['1', '-1/2'])
    """
    most = most_nodes(method)
    nodes = most_nodes(method, DEFAULT_TREES) if nodes is None else nodes
    if not 1 <= nodes <= most:
        raise SeriesError(
            f"order must be from 1 to {most} for {method.name}, as a page shows at most {MOST_TREES} trees, "
            f"but was {nodes}"
        )
    report, series = check(method), modified_equation(method, nodes)
    names = method.names if len(method.names) > 1 else None
    table = series.to_table()
    return MethodFacts(
        method.name,
        report.order,
        _tableau(method),
        method.to_table().to_latex(),
        report.to_table(nonzero=True).to_html(),
        tuple(method.issues),
        nodes,
        tuple(_row(term, names) for term in series.terms()),
        series.to_latex(),
        table.to_json(),
        tuple(table.notes),
    )


def _row(term: SeriesTerm, names: tuple[str, ...] | None) -> TermRow:
    tree = term.element
    size, value = (0.0 if term.is_zero else _number(x) for x in (term.coefficient, term.weight))
    return TermRow(
        svg(tree, names=names),
        tree.text(names),
        tree.order,
        term.coefficient_text,
        term.weight_text,
        size,
        value,
        tree.differential(names=names),
    )


def _number(value: Coefficient) -> float:
    """The value as a double; NaN for a formula in the symbols of the tableau."""
    try:
        return float(value)
    except TypeError:
        return math.nan


def _tableau(method: Method) -> str:
    """The tableau, or the steps of a method that has none, as HTML."""
    if not isinstance(method, RungeKutta | PartitionedRungeKutta):
        return method.to_table().to_html()
    return "".join(
        f"<p>{name}</p>{tableau_html(part)}" for name, part in zip(method.names, method.partitions, strict=True)
    )


POINTS = 161
"""Number of grid points in each direction."""
LEAST, MOST = 4.0, 60.0
"""Bounds of the half width of the window."""


class StabilityShapes(NamedTuple):
    """The stability region and the order star of a method, on a grid."""

    formula: str  # the stability function R as text
    axis: np.ndarray  # real parts, and imaginary parts, of the grid
    growth: np.ndarray  # log |R(z)| at x + iy, (imaginary parts, real parts); not positive in the stability region
    star: np.ndarray  # log |R(z) e^(−z)|; positive in the order star
    poles: tuple[complex, ...]  # the poles of R in the window


def stability_shapes(method: RungeKutta | str) -> StabilityShapes:
    """The values of log |R| and log |R e^(−z)| in a window around the stability region.

    Args:
        method: A Runge–Kutta method without symbols.

    Raises:
        IntegratorError: The method is not given by one tableau.
        SeriesError: The tableau has symbols.

    Example:
        >>> shapes = stability_shapes("implicit-midpoint")
        >>> stable = shapes.growth <= 0
        >>> bool(stable[:, shapes.axis < 0].all()), bool(stable[:, shapes.axis > 0].any()), len(shapes.poles)
        (True, False, 1)

    References:
        G. Wanner, E. Hairer, S. P. Nørsett, Order stars and stability theorems, BIT 18 (1978) 475–489,
        doi:10.1007/BF01932026.
    """
    R = criteria.stability_function(method)
    if R.parameters:
        raise SeriesError(f"method must have numbers for {', '.join(R.parameters)} to have a stability region")
    intervals = criteria.real_stability_interval(R), criteria.imaginary_stability_interval(R)
    ends = [end for end in intervals if end is not None and math.isfinite(end)]
    radius = min(1.2 * max([LEAST, *ends]), MOST)
    axis = np.linspace(-radius, radius, POINTS)
    z = axis + 1j * axis[:, None]
    with np.errstate(divide="ignore"):
        parts = [np.log(abs(np.polyval([float(a) for a in reversed(p)], z))) for p in (R.numerator, R.denominator)]
    growth = np.clip(parts[0] - parts[1], -50, 50)
    poles = tuple(z for z in map(complex, R.poles) if max(abs(z.real), abs(z.imag)) < radius)
    return StabilityShapes(str(R), axis, growth, np.clip(growth - z.real, -50, 50), poles)


def region_of(method: Method) -> StabilityShapes | str:
    """The stability region of a method, or a sentence on why there is none."""
    if not isinstance(method, RungeKutta):
        return f"There is no stability region of {method.name}, which is not given by one tableau."
    try:
        return stability_shapes(method)
    except BSeriesError as error:
        return as_sentence(f"There is no stability region: {error}")
