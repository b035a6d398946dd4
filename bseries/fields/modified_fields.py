"""Series on scenes: modified fields, modifying fields and steps with them, truncated maps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from bseries.algebra.bseries import BSeries
from bseries.algebra.modified import modified_equation, series
from bseries.algebra.stages import check_method
from bseries.algebra.substitution import modifying_integrator
from bseries.exact.domains import make_values
from bseries.exceptions import SeriesError
from bseries.fields.elementary_differentials import FLOAT_DIGITS, SymbolicSeries
from bseries.fields.inputs import MpNumber, Numeral, Point, check_power, read_states
from bseries.fields.scene_trees import SceneTrees, flat_fields, trees_of_method, trees_of_series
from bseries.scene_text import field_equations, first_powers, formula_notes, head, place, remarks, short_powers, span
from bseries_base.formulas import formula_text
from bseries_base.table import PRINT_WIDTH, Column, Table, listed
from integrators.core.immutable import cached_method
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene
from trees.free_trees import grafting
from trees.table import TreeTable

if TYPE_CHECKING:
    import numpy as np
    import sympy
    from numpy.typing import ArrayLike

    from bseries.exact.domains import Coefficient
    from bseries.fields.evaluation import CompiledSeries, PreciseSeries

ROUTES = ("auto", "towers", "symbolic")
MODIFYING = "the modifying integrator"
MEANINGS = {
    MODIFYING: "As a formal series: applied to y' = Σ h^k · (coefficient of h^k), the method follows the exact flow.",
    "field": "As a formal series: the numerical solution follows y' = Σ h^k · (coefficient of h^k).",
    "map": "The map is y1 = Σ h^k · (coefficient of h^k).",
}


class SceneSeries:
    """A B-series on a scene, as a function of the state and the step size.

    A field series gives f_h(y) = Σ h^(|τ|−1)/σ(τ) b(τ) F(τ)(y), a flow series a(∅) y + Σ h^|τ|/σ(τ) a(τ) F(τ)(y). The
    trees whose elementary differentials vanish on the scene are left out, and only the differentials that the sum needs
    are computed. Use `modified_field`, `modifying_field` or `series_map` to make one.

    Attributes:
        scene: The scene.
        trees: The trees, with the piece of the field for each colour.
        series: The coefficients.

    Example:
        >>> import bseries as bs
        >>> f = bs.modified_field(bs.method("rk4"), bs.scene("pendulum"), 8)
        >>> f
        <the modified equation of rk4 on pendulum: order 8, 123 of 24,314 trees>
        >>> f([0.0, 1.0], 0.1).round(6).tolist()
        [-0.84147, -0.0]
    """

    def __init__(self, scene: Scene, trees: SceneTrees, series: BSeries, *, route: str = "auto"):
        if route not in ROUTES:
            raise SeriesError(f"route must be one of {', '.join(ROUTES)}, but was {route!r:.60}")
        self.scene, self.trees, self.series, self._wanted = scene, trees, series, route
        self.label = series.label or "a series"
        self.order, self.dimension, self.variables = trees.table.max_order, scene.dimension, scene.variables
        self.empty = series.empty  # the coefficient of the empty tree: 0 for a field, not a map
        self.is_field = series.empty == 0

    def __repr__(self) -> str:
        return f"<{self.label} on {self.scene.name}: order {self.order}, {self.report()}>"

    def __str__(self) -> str:
        return self._overview().to_text(PRINT_WIDTH)

    def _repr_html_(self) -> str:
        return self._overview().to_html()

    def _overview(self) -> Table:
        """The table of the first powers of h, whose formulas are short."""
        count = self.order + (not self.is_field)
        return first_powers(repr(self), count, self.to_table, short_powers(self.scene, self.symbolic, count))

    def report(self) -> str:
        """The numbers of trees that are needed, and of all trees."""
        return f"{len(self.trees.table):,} of {self.trees.total:,} trees"

    def __call__(self, y: ArrayLike, h: float, *, workers: int = 1) -> np.ndarray:
        """The value at one point or many.

        A `TruncationWarning` is given if a field is beyond its reach at one of up to 32 of the points. `compiled` and
        `evaluator.value` do not look.

        Args:
            y: The state, of shape (variables,), or (variables, n) for n points.
            h: The step size.
            workers: The number of threads that share the points.

        Returns:
            An array of the shape of `y`.

        Raises:
            SeriesError: `y` has the wrong number of variables, or is not numeric.
        """
        from bseries.fields.term_sizes import warn_beyond_reach

        value = self.evaluator.value(y, h, workers)
        if self.is_field and h:
            states, _ = read_states(y, self.dimension)
            warn_beyond_reach(self, states, float(h), f"{self.label} on {self.scene.name}")
        return value

    def __reduce__(self) -> tuple[partial[SceneSeries], tuple[Scene, SceneTrees, BSeries]]:
        return partial(SceneSeries, route=self._wanted), (self.scene, self.trees, self.series)

    @property
    def route(self) -> str:
        """The way of evaluation: ``"towers"`` (derivative tensors) or ``"symbolic"`` (formulas)."""
        return self.evaluator.route

    @cached_property
    def evaluator(self) -> CompiledSeries:
        """The compiled form."""
        from bseries.fields.evaluation import CompiledSeries

        return CompiledSeries(self, self._wanted)

    def terms(self, y: ArrayLike, *, workers: int = 1) -> np.ndarray:
        """The terms by order at one point or many, without the powers of h.

        Args:
            y: As for a call.
            workers: The number of threads that share the points.

        Returns:
            An array (order, variables) or (order, variables, n): its k-th row is Σ_{|τ|=k+1} b(τ)/σ(τ) F(τ)(y).
        """
        return self.evaluator.terms(y, workers)

    @property
    def compiled(self) -> Callable[..., None]:
        """A numba function (y, h, out) for other compiled code; it writes the value to `out`."""
        return self.evaluator.compiled

    def precise(self, y: Point, h: Numeral, digits: int = 50) -> list[MpNumber]:
        """The value at one point with a given number of digits, as numbers of mpmath.

        Args:
            y: One point: numbers, fractions, strings or numbers of mpmath.
            h: The step size.
            digits: The number of decimal digits.

        Raises:
            SeriesError: The coefficients have fewer digits, or `y` has the wrong number of values.
            IntegratorError: An argument has the wrong type.
        """
        known = self.series.digits if self.series.is_exact else FLOAT_DIGITS
        if known is not None and isinstance(digits, int) and digits > known:
            raise SeriesError(f"digits must be at most {known}, as coefficients have, but was {digits}")
        return self.at_digits(digits)(y, h)

    @cached_method
    def at_digits(self, digits: int) -> PreciseSeries:
        """The series as a function of numbers with this number of digits; decimal coefficients count as exact."""
        from bseries.fields.evaluation import PreciseSeries

        return PreciseSeries(self, digits)

    @cached_property
    def weights(self) -> list[Coefficient]:
        """The factors coefficient/σ of the elementary differentials."""
        return self.series.weights()

    @cached_property
    def formulas(self) -> SymbolicSeries:
        """The symbolic form of the series."""
        return self.symbolic_series()

    def symbolic_series(self, **limits: int) -> SymbolicSeries:
        """A new symbolic form of the series, abandoned where formulas exceed a limit."""
        fields = flat_fields(self.scene, self.trees.pieces)
        return SymbolicSeries(self.series, fields, self.scene.symbols, **limits)

    def symbolic(self, k: int) -> tuple[sympy.Expr, ...]:
        """The formulas of the term with h^k: f_(k+1) for a field, the terms of order k for a map.

        Args:
            k: The power of h, from 0 to order − 1 (order for a map).

        Raises:
            SeriesError: The power is out of range.
        """
        last = self.order - 1 if self.is_field else self.order
        check_power(k, last)
        if not self.is_field and k == 0:
            return tuple(self.empty * symbol for symbol in self.scene.symbols)
        return self.formulas.term(k + 1 if self.is_field else k)

    def to_latex(self) -> str:
        """The equations by powers of h as a displayed align; for a map, a tabular.

        Example:
            >>> import bseries as bs
            >>> print(bs.modified_field("explicit-euler", "riccati", 2).to_latex(), end="")
            \\begin{align*}
            \\dot{y} &= y^{2} - h\\, y^{3} + \\mathcal{O}(h^{2})
            \\end{align*}
        """
        return self.to_table().to_latex()

    def to_dict(self) -> dict[str, Any]:
        """The formulas as plain data."""
        return dict(self.to_table().data())

    def to_table(
        self,
        powers: Sequence[int] | None = None,
        *,
        nonzero: bool = False,
        effects: Sequence[str] | None = None,
        issues: Sequence[str] = (),
    ) -> Table:
        """The formulas as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            powers: Consecutive powers of h; by default all.
            nonzero: Leave out formulas that are zero.
            effects: Effects for the title; by default those that are on.
            issues: Contradictions in the method's tableau.
        """
        is_map = not self.is_field
        powers = range(self.order + is_map) if powers is None else powers
        terms = [(k, self.symbolic(k)) for k in powers]
        rows = [(k, x, g) for k, field in terms for x, g in zip(self.variables, field, strict=True) if g or not nonzero]
        what, _, method = self.label.rpartition(" of ")
        kind = "map" if is_map else what if what in MEANINGS else "field"

        def data() -> dict[str, Any]:
            records = [
                {"power": k, "field": list(map(formula_text, field))} for k, field in terms if any(field) or not nonzero
            ]
            return {
                **head("equation", method, self.scene, effects),
                "order": self.order,
                "modifying": what == MODIFYING,
                "domain": self.series.domain,
                "trees": {"needed": len(self.trees.table), "total": self.trees.total},
                "variables": list(self.variables),
                **remarks(self.series, issues, self.scene),
                "terms": records,
            }

        title = (what.removeprefix("the ") or "series").capitalize()
        return Table(
            f"{title} of {place(method, self.scene, effects)}: {span(powers)}, {self.report()}",
            (Column("k", True), Column("y1" if is_map else "d/dt"), Column("coefficient of h^k")),
            rows,
            [MEANINGS[kind], *formula_notes(self.series, issues, self.scene, nonzero=nonzero)],
            data=data,
            items="terms",
            section=itemgetter(0),
            records=listed([(name, itemgetter(at)) for at, name in enumerate(("power", "variable", "field"))], rows),
            own={} if is_map else {"latex": lambda width: field_equations(self.scene, terms)},
        )


def check_field(f: object) -> SceneSeries:
    """Check that an argument is a field on a scene, and return it."""
    if not isinstance(f, SceneSeries):
        raise SeriesError(f"f must be a field, such as modified_field gives, but was {f!r:.60}")
    if not f.is_field:
        raise SeriesError(f"f must be a field, such as modified_field gives, but was {f.label}, a map")
    return f


def modified_field(
    method: Method | BSeries | str,
    scene: Scene | str,
    order: int | None = None,
    *,
    parts: Parts | None = None,
    route: str = "auto",
) -> SceneSeries:
    """The truncated modified equation y' = f_h(y) of a method on a scene.

    With trees of up to N nodes, a step differs from its flow by O(h^(N+1)).

    Args:
        method: A method, or a field series such as a `modified_equation`.
        scene: The scene.
        order: The largest number of nodes N: powers h^0 … h^(N−1); by default the order of a series.
        parts: For methods that split the field: a map from the names of their parts to blocks or parts of the scene,
            where the names differ.
        route: ``"towers"`` (derivative tensors), ``"symbolic"`` (simplified and compiled formulas) or ``"auto"``.

    Raises:
        SeriesError: The parts of the method are ambiguous, or an argument is out of range.

    Example:
        >>> import bseries as bs
        >>> f = bs.modified_field(bs.method("explicit-euler"), bs.scene("riccati"), 4)
        >>> [f.symbolic(k) for k in range(4)]
        [(y**2,), (-y**3,), (3*y**4/2,), (-8*y**5/3,)]
        >>> print(f.report())
        7 of 8 trees

    References:
        HLW, section IX.1, theorem IX.9.2.
    """
    return _make(method, scene, order, parts, route, modified_equation, "the modified equation")


def modifying_field(
    method: Method | BSeries | str,
    scene: Scene | str,
    order: int | None = None,
    *,
    parts: Parts | None = None,
    route: str = "auto",
) -> SceneSeries:
    """The modifying field of a method on a scene: the method applied to it solves y' = f(y).

    Args:
        method, scene, parts, route: As for `modified_field`.
        order: The largest number of nodes N: applied to this field, the method has order N.

    Raises:
        SeriesError: The parts of the method are ambiguous, or an argument is out of range.

    Example:
        >>> import bseries as bs
        >>> f = bs.modifying_field(bs.method("implicit-midpoint"), bs.scene("riccati"), 5)
        >>> [f.symbolic(k)[0] for k in range(5)]
        [y**2, 0, -y**4/4, 0, y**6/8]

    References:
        P. Chartier, E. Hairer, G. Vilmart, *Numerical integrators based on modified differential equations*,
        Math. Comp. 76 (2007), doi:10.1090/S0025-5718-07-01967-9.
    """
    return _make(method, scene, order, parts, route, modifying_integrator, MODIFYING)


def series_map(
    method: Method | BSeries | str,
    scene: Scene | str,
    order: int | None = None,
    *,
    parts: Parts | None = None,
    route: str = "auto",
) -> SceneSeries:
    """The truncated B-series of a method on a scene, as a map y ↦ a(∅) y + Σ h^|τ|/σ(τ) a(τ) F(τ)(y).

    Args:
        method: A method, or a flow series.
        scene, order, parts, route: As for `modified_field`.

    Raises:
        SeriesError: The parts of the method are ambiguous, or an argument is out of range.

    Example:
        >>> import bseries as bs
        >>> step = bs.series_map(bs.method("explicit-euler"), bs.scene("riccati"), 2)
        >>> step([1.0], 0.5)
        array([1.5])
    """
    return _make(method, scene, order, parts, route, series, "the series")


def _make(
    method: Method | BSeries | str,
    scene: Scene | str,
    order: int | None,
    parts: Parts | None,
    route: str,
    series_of: Callable[[Method, TreeTable], BSeries],
    title: str,
) -> SceneSeries:
    method, scene = as_method(method), as_scene(scene)
    nodes = read_order(method, order, is_map=series_of is series)
    if isinstance(method, BSeries):
        given = method.truncate(nodes)
        return SceneSeries(scene, trees_of_series(given, scene, parts), given, route=route)
    trees = trees_of_method(method, nodes, scene, parts)
    plain = series_of(method, trees.shapes)
    values = plain.coefficients()
    if trees.table != trees.shapes:
        plain_id = shapes(trees.table, trees.shapes)
        chosen = make_values(trees.table, [values[at] for at in plain_id])
        uncertainty = plain.uncertainty and plain.uncertainty.mapped(plain_id)
        plain = BSeries(trees.table, chosen, plain.empty, digits=plain.digits, uncertainty=uncertainty)
    return SceneSeries(scene, trees, plain.with_label(f"{title} of {method.name}"), route=route)


def shapes(table: TreeTable, plain: TreeTable) -> list[int]:
    """The id of each tree, without its colours, in another table."""
    _, _, left, right = table.lists
    product = grafting(plain)
    found: list[int] = []
    for u, v in zip(left, right, strict=True):
        found.append(0 if u < 0 else product(found[u], found[v]))
    return found


def read_order(method: Method | BSeries, order: int | None, *, is_map: bool = False) -> int:
    """The order, by default that of a series; refuses what is no method, or a series of the other kind."""
    if not isinstance(method, BSeries):
        check_method(method)
        if order is None:
            raise SeriesError("order must be given for a method, but was None")
        return order
    if (method.empty != 0) != is_map:
        kind = "flow, with a(∅) other than 0" if is_map else "field, with b(∅) = 0"
        raise SeriesError(f"method must be a method or the series of a {kind}, but its empty tree has {method.empty}")
    return method.order if order is None else order


def modifying_steps(
    method: Method | str,
    scene: Scene | str,
    order: int,
    y: Sequence[Numeral],
    h: Numeral,
    steps: int,
    *,
    parts: Parts | None = None,
    digits: int | None = None,
) -> np.ndarray:
    """Take steps of a method on its modifying field: a method of higher order with the same geometric properties.

    Stages are solved for in Python; only the field is compiled.

    Args:
        method: The basic method, for the whole field or for blocks of variables.
        scene: The scene.
        order: The order to reach.
        y: The initial state.
        h: The step size.
        steps: The number of steps.
        parts: As for `modified_field`.
        digits: The number of digits, in interpreted arithmetic; None for doubles.

    Returns:
        An array with one row for each variable and one column for the initial state and each step.

    Raises:
        SeriesError: The parts of the method are ambiguous, or are not blocks of variables.
        IntegratorError: An argument does not fit, or the stage equations are not solved.

    Example:
        >>> import bseries as bs
        >>> run = bs.fields.modifying_steps(bs.method("implicit-midpoint"), bs.scene("riccati"), 8, [1.0], 0.05, 10)
        >>> print(abs(run[0, -1] - 2) < 1e-8)
        True

    References:
        P. Chartier, E. Hairer, G. Vilmart, *Numerical integrators based on modified differential equations*,
        Math. Comp. 76 (2007), doi:10.1090/S0025-5718-07-01967-9.
    """
    from integrators.reference.plain_steps import Arithmetic, block_parts, plain_steps

    method, scene = as_method(method), as_scene(scene)
    f = modifying_field(method, scene, order, parts=parts)
    arithmetic = Arithmetic(digits)
    with arithmetic.working():
        step = arithmetic.number(h, "h")
    values = f.evaluator.value if digits is None else f.at_digits(digits)

    def field(state: np.ndarray) -> np.ndarray | list[MpNumber]:
        return values(state, step)

    fields = block_parts(field, _part_indices(f, method)) if len(method.names) > 1 else field
    return plain_steps(method, fields, y, h, steps, digits=digits)


def _part_indices(f: SceneSeries, method: Method) -> dict[str, list[int]]:
    """The indices of the variables in each part of the method."""
    indices: dict[str, list[int]] = {}
    for name, piece in zip(method.names, f.trees.pieces, strict=True):
        if piece.blocks is None:
            raise SeriesError(f"method must treat blocks of variables, but {method.name} treats parts of the field")
        chosen = [block for block in f.scene.blocks if block.name in piece.blocks]
        indices[name] = [k for block in chosen for k in range(block.offset, block.end)]
    return indices
