"""Modified Hamiltonians of methods on scenes, as functions of the state and the step size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from operator import itemgetter
from typing import TYPE_CHECKING, Any, TypeAlias
from warnings import catch_warnings, simplefilter

import numpy as np
import sympy
from numpy.typing import ArrayLike, NDArray

from bseries import scene_text
from bseries.algebra.bseries import BSeries
from bseries.analysis.order import order_of
from bseries.exceptions import SeriesError
from bseries.fields.differential_rings import DifferentialRing
from bseries.fields.inputs import (
    MpNumber,
    Numeral,
    Point,
    Step,
    check_power,
    power_sum,
    read_states,
    read_step,
    warn_where_not_finite,
)
from bseries.fields.modified_fields import SceneSeries, modified_field, read_order
from bseries.fields.modified_invariants import modified_invariant
from bseries.fields.term_sizes import warn_beyond_reach
from bseries.hamiltonians.brackets.poisson_brackets import bracket_terms
from bseries.hamiltonians.from_trees import EnergyFormulas, EnergySeries, energy_series, energy_trees
from bseries.hamiltonians.generating_functions import generating_terms
from bseries.hamiltonians.verdicts import (
    FURTHER,
    HamiltonianVerdict,
    hamiltonian_verdict,
    is_proved_symplectic,
    name_of,
)
from bseries_base.diagrams import axis_label, draw_curves, draw_levels
from bseries_base.errors import BSeriesError, shown
from bseries_base.formulas import formula_text
from bseries_base.plotting import BLUE, drawing
from bseries_base.table import PRINT_WIDTH, Column, Table, listed, short_latex
from integrators.exact.arguments import read_window
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.reference.plain_steps import Arithmetic
from integrators.runs.titles import write_title
from integrators.runs.trajectory import Trajectory
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene
from trees.counting import check_order

if TYPE_CHECKING:
    from matplotlib.axes import Axes


Array: TypeAlias = NDArray[np.float64]

POINTS, LEVELS = 200, 15  # of a plot: points in each direction, and level curves
SPACE = 0.15  # around the states of a run, as a part of their range


class ModifiedHamiltonian:
    """Truncated modified Hamiltonian H̃ = H + h H_2 + h² H_3 + … as a function of the state and the step size.

    Use `modified_hamiltonian` to make one. For h = 0 it is H, with its constant.

    Attributes:
        method: The method, or the field series.
        scene: The scene.
        order: The number of terms N, with the powers h^0 … h^(N−1).
        parts: The parts of the method on the scene, if given.
        route: The way of computation: ``"trees"``, ``"brackets"``, ``"generating-function"`` or ``"integration"``.
        label: The name of the modified Hamiltonian.
        variables: The names of the variables.

    Example:
        >>> import bseries as bs
        >>> H = bs.modified_hamiltonian(bs.method("implicit-midpoint"), bs.scene("pendulum"), 5)
        >>> H
        <the modified Hamiltonian of implicit-midpoint on pendulum: order 5, by trees>
        >>> H.symbolic(2)
        -p**2*cos(q)/24 - sin(q)**2/24
        >>> H([0.0, -1.5], 0.1), H.gradient([0.0, -1.5], 0.1).round(6).tolist()
        (-0.071151..., [0.0, -0.997436])
    """

    def __init__(
        self,
        method: Method | BSeries,
        scene: Scene,
        order: int,
        parts: Parts | None,
        route: str,
        energy: EnergySeries | EnergyFormulas,
    ):
        self.method, self.scene, self.order, self.parts, self.route = method, scene, order, parts, route
        self._energy = energy
        self.label, self.variables = f"the modified Hamiltonian of {name_of(method)}", scene.variables

    def __reduce__(self) -> tuple[type[ModifiedHamiltonian], tuple[object, ...]]:
        return ModifiedHamiltonian, (self.method, self.scene, self.order, self.parts, self.route, self._energy)

    def __repr__(self) -> str:
        return f"<{self.label} on {self.scene.name}: order {self.order}, by {self.route}>"

    def __str__(self) -> str:
        return scene_text.first_powers(repr(self), self.order, self.to_table, self._short_powers()).to_text(PRINT_WIDTH)

    def _short_powers(self) -> range:
        return scene_text.short_powers(self.scene, lambda k: [self.symbolic(k)], self.order)

    @cached_property
    def verdict(self) -> HamiltonianVerdict:
        """The order to which a modified Hamiltonian exists, tested beyond the terms computed here.

        Example:
            >>> import bseries as bs
            >>> H = bs.modified_hamiltonian(bs.method("rk4"), bs.scene("pendulum"), 5)
            >>> H.verdict.exists_through
            4
            >>> print(H.verdict.limit())
            H~ exists through h^4 only: on pendulum the term with h^5 has no Hamiltonian; the first tree to break it for
            all H is [τ,[[τ]]].
        """
        method, scene, order, parts = self.method, self.scene, self.order, self.parts
        if isinstance(method, BSeries):
            order = None
        elif not is_proved_symplectic(method, modified_field(method, scene, 1, parts=parts)):
            order = max(order + 1, order_of(method) + FURTHER)
        return hamiltonian_verdict(method, scene, order, parts=parts)

    def __call__(self, y: ArrayLike, h: float, workers: int = 1) -> float | Array:
        """The value at one point or many.

        A `TruncationWarning` is given if the modified equation is beyond its reach at one of up to 32 of the points.
        `compiled` does not look.

        Args:
            y: The state, of shape (variables,), or (variables, n) for n points.
            h: The step size.
            workers: The number of threads that share the points.

        Returns:
            A float, or an array of shape (n,).

        Raises:
            SeriesError: `y` has the wrong number of variables, or is not numeric.
        """
        states, shape = read_states(y, self.scene.dimension)
        step = read_step(h)
        values = self._energy.evaluator.values(states, step, workers)
        warn_where_not_finite(values, f"{self.label} on {self.scene.name}", step)
        self._check_reach(states.T, step)
        return values if len(shape) == 2 else float(values[0])

    def _check_reach(self, y: np.ndarray, h: float) -> None:
        """Warn the caller of a method that states (variables, n) are beyond the reach of the series."""
        if h:
            warn_beyond_reach(self.field, y.T, h, f"{self.label} on {self.scene.name}")

    def terms(self, y: ArrayLike, *, workers: int = 1) -> np.ndarray:
        """The terms at one point or many, without the powers of h.

        Args:
            y: As for a call.
            workers: The number of threads that share the points.

        Returns:
            An array (order,) or (order, n); the k-th row is the coefficient of h^k.
        """
        states, shape = read_states(y, self.scene.dimension)
        return self._energy.evaluator.terms(states, workers).reshape(self.order, *shape[1:])

    @property
    def compiled(self) -> Callable[[Array, float], float]:
        """A numba function (y, h) for other compiled code."""
        return self._energy.evaluator.compiled

    def observer(self, h: float) -> Callable[[float, Array], float]:
        """An observer (t, y) for `bs.integrate`; a `TruncationWarning` is given if the scene's start is beyond reach.

        Example:
            >>> import bseries as bs
            >>> pendulum, midpoint = bs.scene("pendulum"), bs.method("implicit-midpoint")
            >>> H = bs.modified_hamiltonian(midpoint, pendulum, 3)
            >>> run = bs.integrate(midpoint, pendulum, h=0.1, steps=1000, observe={"H": H.observer(0.1)})
            >>> bool(abs(run.observed["H"] - run.observed["H"][0]).max() < 1e-6)
            True
        """
        step, compiled = read_step(h), self.compiled
        if self.scene.start is not None:
            self._check_reach(self.scene.y0[:, None], step)

        def modified_energy(t: float, y: Array) -> float:
            """The modified Hamiltonian at y."""
            return compiled(y, step)

        return modified_energy

    def precise(self, y: Point, h: Numeral, digits: int = 50) -> MpNumber:
        """The value at one point with a given number of digits, as a number of mpmath.

        Args:
            y: One point: numbers, fractions, strings or numbers of mpmath.
            h: The step size.
            digits: The number of decimal digits.

        Raises:
            SeriesError: The coefficients have fewer digits, or `y` has the wrong number of values.
            IntegratorError: An argument has the wrong type.
        """
        arithmetic = Arithmetic(digits)
        with arithmetic.working():
            point = arithmetic.read(y, "y")
            if len(point) != self.scene.dimension:
                raise SeriesError(f"y must have {self.scene.dimension} values, but had {len(point)}")
            value = self._energy.precise(list(point), arithmetic.number(h, "h"), digits)
            return arithmetic.rounded([value])[0]

    def symbolic(self, k: int) -> sympy.Expr:
        """The formula of the coefficient of h^k.

        Args:
            k: The power of h, from 0 to order − 1.

        Raises:
            SeriesError: The power is out of range.
        """
        check_power(k, self.order - 1)
        return self._energy.symbolic(k)

    def expression(self, h: Step) -> sympy.Expr:
        """The formula for a step size, a number or a symbol.

        Raises:
            SeriesError: `h` is neither a number nor an expression.
        """
        return power_sum(map(self.symbolic, range(self.order)), h)

    @cached_property
    def field(self) -> SceneSeries:
        """The truncated modified equation with this Hamiltonian."""
        return modified_field(self.method, self.scene, self.order, parts=self.parts)

    def gradient(self, y: ArrayLike, h: float, workers: int = 1) -> np.ndarray:
        """The gradient at one point or many; by trees from the modified equation f = (−∂H̃/∂q, ∂H̃/∂p).

        Args:
            y: As for a call.
            h: The step size.
            workers: The number of threads that share the points.

        Returns:
            An array of the shape of `y`.
        """
        if isinstance(self._energy, EnergyFormulas):
            states, shape = read_states(y, self.scene.dimension)
            return self._energy.gradient(states, read_step(h), workers).T.reshape(shape)
        field = self.field(y, h, workers=workers)
        gradient = np.empty_like(field)
        momenta, positions = (slice(block.offset, block.end) for block in self.scene.canonical_pair or ())
        gradient[momenta], gradient[positions] = field[positions], -field[momenta]
        return gradient

    def plot(
        self, ax: Axes | None = None, *, h: float, run: Trajectory | None = None, x: str | None = None,
        y: str | None = None, window: Sequence[float] | None = None,
    ) -> Axes:  # fmt: skip
        """Level curves of H̃ over two variables, which a numerical solution follows; or H̃ along a run.

        With more than two variables no picture in a plane shows that a run follows level curves. Then a run is drawn
        over time, as the errors of H and of H̃ to each power of h; and a plane without a run is a slice of the level
        sets, through the scene's start, which the title gives.

        Args:
            ax: The axes, which are returned; None for pyplot's current or new ones.
            h: The step size.
            run: A run of the method, whose states are drawn as points.
            x: The variable across; by default the first position.
            y: The variable upwards; by default the first momentum.
            window: The ends (left, right, bottom, top) of the axes; by default those of the run with some space.

        Raises:
            SeriesError: A variable is unknown, there is neither a run nor a window, a run of more than two variables
                comes with a plane, or `ax` is no axes.
            IntegratorError: The scene has no start, and it is needed; or the window has the wrong form.
            ImportError: matplotlib is not installed.

        Example:
            >>> import bseries as bs
            >>> H = bs.modified_hamiltonian("symplectic-euler-p", "pendulum", 3)
            >>> run = bs.integrate(H.method, H.scene, h=0.4, steps=200, y0=[0, 2])
            >>> axes = H.plot(h=0.4, run=run)
            >>> axes.get_xlabel(), axes.get_ylabel()
            ('$q$', '$p$')
        """
        i, j = self._plane(x, y)
        if run is not None and getattr(run, "variables", None) != tuple(self.variables):
            raise SeriesError(f"run must have the variables {', '.join(self.variables)}, but was {shown(run)}")
        if run is not None and len(self.variables) > 2:
            if (x, y, window) != (None, None, None):
                raise SeriesError(
                    "run must be left out with x, y or window, as there are more than two variables, but was not"
                )
            return self._plot_along(ax, run, read_step(h))
        if window is None and run is None:
            raise SeriesError("window must be given, as in (-3, 3, -2, 2), where no run is, but was not")
        if window is None and run is not None:
            lower, upper = (f(run.y[[i, j]], axis=1) for f in (np.min, np.max))
            space = SPACE * np.where(upper > lower, upper - lower, 1.0)
            left, bottom, right, top = map(float, (*(lower - space), *(upper + space)))
            ends = left, right, bottom, top
        else:
            ends = read_window(window)
        across, upwards = np.linspace(*ends[:2], POINTS), np.linspace(*ends[2:], POINTS)
        centre = self.scene.y0 if run is None and len(self.variables) > 2 else np.zeros(len(self.variables))
        states = np.repeat(centre[:, None], POINTS**2, axis=1)
        states[i], states[j] = (grid.ravel() for grid in np.meshgrid(across, upwards))
        with catch_warnings():
            simplefilter("ignore")  # H̃ need not be finite everywhere in a window
            values = np.reshape(self(states, h), (POINTS, POINTS))
        self._check_reach(states if run is None else run.y, h)
        if not np.isfinite(values).any():
            raise SeriesError(f"window must have points where H~ is finite, but was {ends}")
        with drawing(ax, SeriesError) as axes:
            draw_levels(axes, across, upwards, values, LEVELS)
            if run is not None:
                axes.plot(run.y[i], run.y[j], ".", color=BLUE, markersize=2.5)
            fixed = [
                f"{name} = {value:g}"
                for k, (name, value) in enumerate(zip(self.variables, centre, strict=True))
                if k not in (i, j)
            ]
            write_title(
                axes, ", ".join([self._title(read_step(h)), *(["slice at " + ", ".join(fixed)] if fixed else [])])
            )
            labels = [axis_label(self.variables[k]) for k in (i, j)]
            axes.set(xlabel=labels[0], ylabel=labels[1], xlim=ends[:2], ylim=ends[2:])
        return axes

    def _title(self, h: float) -> str:
        return f"{self.label} on {self.scene.name} to h^{self.order - 1}, h = {h:g}"

    def _plot_along(self, ax: Axes | None, run: Trajectory, h: float) -> Axes:
        """The errors of H and of H̃ along a run, on a logarithmic axis."""
        terms = h ** np.arange(self.order)[:, None] * self.terms(run.y)
        sums = {k: np.cumsum(terms, axis=0)[k] for k in range(self.order) if k == 0 or terms[k].any()}
        curves = {
            f"$\\widetilde{{H}}$ to $h^{{{k}}}$" if k else "$H$": np.abs(value - value[0])[1:]
            for k, value in sums.items()
        }
        with drawing(ax, SeriesError) as axes:
            draw_curves(axes, run.t[1:], curves, linewidth=0.8)
            write_title(axes, f"{self._title(h)}: errors along a run")
            axes.set(xlabel=axis_label("t"), ylabel="change since the start, absolute", yscale="log")
        return axes

    def _plane(self, x: str | None, y: str | None) -> tuple[int, int]:
        """The indices of two variables; by default of the first position and the first momentum."""
        if self.scene.canonical_pair is None:
            first = self.variables[:2]
        else:
            first = [self.variables[block.offset] for block in reversed(self.scene.canonical_pair)]
        pair = [default if name is None else name for name, default in zip((x, y), first, strict=True)]
        for name in pair:
            if name not in self.variables:
                raise SeriesError(f"x and y must be of {', '.join(self.variables)}, but one was {shown(name)}")
        return self.variables.index(pair[0]), self.variables.index(pair[1])

    def to_dict(self) -> dict[str, Any]:
        """The formulas and the verdict as plain data."""
        return dict(self.to_table().data())

    def to_latex(self) -> str:
        """The formula as LaTeX, without zero terms, with a note on where the modified Hamiltonian ends."""
        terms = [(k, sympy.latex(self.symbolic(k))) for k in range(self.order) if self.symbolic(k) != 0]
        powers = {0: "", 1: "h ", **{k: f"h^{{{k}}} " for k, _ in terms if k > 1}}
        formula = " + ".join(f"{powers[k]}\\left({text}\\right)" if k else text for k, text in terms) or "0"
        limit = self.verdict.limit(latex=True)
        return f"{formula}\\quad\\text{{({limit})}}" if limit else formula

    def _repr_latex_(self) -> str | None:
        return short_latex(self.to_latex()) if len(self._short_powers()) == self.order else None

    def _repr_html_(self) -> str:
        return scene_text.first_powers(repr(self), self.order, self.to_table, self._short_powers()).to_html()

    def to_table(
        self, powers: Sequence[int] | None = None, *, nonzero: bool = False, effects: Sequence[str] | None = None
    ) -> Table:
        """The formulas as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            powers: Consecutive powers of h; by default all.
            nonzero: Leave out formulas that are zero.
            effects: Effects for the title; by default those that are on.
        """
        powers = range(self.order) if powers is None else powers
        terms = [(k, self.symbolic(k)) for k in powers]
        rows = [(k, formula) for k, formula in terms if formula != 0 or not nonzero]
        method, scene, series = name_of(self.method), self.scene, self.field.series
        issues = getattr(self.method, "issues", ())
        where = scene_text.place(method, scene, effects)
        meaning = "The numerical solution follows the system with the Hamiltonian Σ h^k · (coefficient of h^k)."

        def data() -> dict[str, Any]:
            return {
                **scene_text.head("hamiltonian", method, scene, effects),
                "order": self.order,
                "route": self.route,
                "domain": series.domain,
                "variables": list(self.variables),
                "exists_through": self.verdict.exists_through,
                "verdict": self.verdict.to_dict(),
                **scene_text.remarks(series, issues, scene),
                "terms": [{"power": k, "hamiltonian": formula_text(formula)} for k, formula in rows],
            }

        return Table(
            f"Modified Hamiltonian of {where}: {scene_text.span(powers)}, by {self.route}",
            (Column("k", True), Column("coefficient of h^k")),
            rows,
            [self.verdict.limit() or meaning, *scene_text.formula_notes(series, issues, scene, nonzero=nonzero)],
            data=data,
            items="terms",
            records=listed([("power", itemgetter(0)), ("hamiltonian", itemgetter(1))], rows),
            own={"latex": lambda width: scene_text.hamiltonian_equation(scene, terms, self.verdict.limit(latex=True))},
        )


ROUTES = ("auto", "trees", "brackets", "generating-function", "integration")


def modified_hamiltonian(
    method: Method | BSeries | str,
    scene: Scene | str,
    order: int | None = None,
    *,
    parts: Parts | None = None,
    route: str = "auto",
) -> ModifiedHamiltonian:
    """The modified Hamiltonian of a method on a scene: the Hamiltonian of its truncated modified equation.

    Args:
        method: A method, or a field series such as a `modified_equation`.
        scene: A canonical scene, or a Poisson system.
        order: The number of terms N, with the powers h^0 … h^(N−1); by default the order of a series.
        parts: For methods that split the field: a map from the names of their parts to blocks or parts of the scene,
            where the names differ.
        route: ``"trees"`` (elementary Hamiltonians), ``"brackets"`` (nested Poisson brackets, for splittings and
            compositions), ``"generating-function"`` (the Hamilton–Jacobi equation), ``"integration"`` (of the modified
            equation on this scene), or ``"auto"``: trees for symplectic methods, else brackets on a Poisson system,
            else integration.

    Raises:
        SeriesError: The modified equation is not Hamiltonian on the scene, the route does not apply, or an argument is
            out of range.

    Example:
        >>> import bseries as bs
        >>> H = bs.modified_hamiltonian(bs.method("stormer-verlet"), bs.scene("henon-heiles"), 3)
        >>> print(H)
        Modified Hamiltonian of stormer-verlet-kdk on henon-heiles: powers h^0 to h^2, by trees
        <BLANKLINE>
        k  coefficient of h^k
        ─  ...
        0  p1**2/2 + p2**2/2 + q1**2*q2 + q1**2/2 - q2**3/3 + q2**2/2
        1  0
        2  p1**2*q2/6 + p1**2/12 + p1*p2*q1/3 - p2**2*q2/6 + p2**2/12 - q1**4/24 - q1**2*q2**2/12 - ...
        <BLANKLINE>
        The numerical solution follows the system with the Hamiltonian Σ h^k · (coefficient of h^k).

        A method that is not symplectic has none:

        >>> bs.modified_hamiltonian(bs.method("rk4"), bs.scene("henon-heiles"), 5)
        Traceback (most recent call last):
        bseries.exceptions.SeriesError: method must be symplectic on henon-heiles, but rk4 is Hamiltonian for all H
        to order 4, where [τ,[[τ]]] breaks it, and on henon-heiles to order 4, where the term with h^4 breaks it

    References:
        HLW, sections IX.3, IX.4 and IX.9, theorem IX.9.8.
    """
    method = as_method(method)
    scene = as_scene(scene)
    if route not in ROUTES:
        raise SeriesError(f"route must be one of {', '.join(ROUTES)}, but was {route!r:.60}")
    order = check_order(read_order(method, order))
    if isinstance(method, BSeries) and route in ("brackets", "generating-function"):
        raise SeriesError(f"method must be a method for the route {route!r}, but was a series")
    found, energy = _route_and_energy(method, scene, order, parts, route)
    return ModifiedHamiltonian(method, scene, order, parts, found, energy)


def _route_and_energy(
    method: Method | BSeries, scene: Scene, order: int, parts: Parts | None, route: str
) -> tuple[str, EnergySeries | EnergyFormulas]:
    """The route to H̃, and H̃ itself."""
    canonical = scene.is_hamiltonian and scene.poisson is None
    if route == "trees" or (route == "auto" and canonical):
        if not canonical:
            raise SeriesError(f"scene must be given by a Hamiltonian in canonical variables, but {scene.title} is not")
        trees = energy_trees(method, scene, order, parts)
        if trees.verdict.holds:
            return "trees", energy_series(trees)
        if route == "trees":
            verdict = hamiltonian_verdict(method, scene, order, parts=parts)
            raise SeriesError(f"method must be symplectic for the route 'trees', but {verdict}")
    is_method = not isinstance(method, BSeries)
    if is_method and (route == "brackets" or (route == "auto" and scene.poisson is not None)):
        try:
            return "brackets", EnergyFormulas(scene.symbols, bracket_terms(method, scene, order, parts))
        except SeriesError:
            if route == "brackets":
                raise
    if is_method and route == "generating-function":
        return route, EnergyFormulas(scene.symbols, generating_terms(method, scene, order, parts))
    verdict = hamiltonian_verdict(method, scene, order, parts=parts)
    if verdict.order == 0:
        raise SeriesError(f"scene must be Hamiltonian, but the field of {scene.title} is not")
    if not verdict.holds:
        kind = "symplectic" if scene.poisson is None else "a Poisson integrator"
        raise SeriesError(f"method must be {kind} on {scene.title}, but {verdict}")
    terms = modified_invariant(modified_field(method, scene, order, parts=parts)).terms
    if route == "integration":
        terms = _with_constants(terms, method, scene, order, parts, "trees" if canonical else "brackets")
    return "integration", EnergyFormulas(scene.symbols, terms)


def _with_constants(
    terms: tuple[sympy.Expr, ...], method: Method | BSeries, scene: Scene, order: int, parts: Parts | None, route: str
) -> tuple[sympy.Expr, ...]:
    """Integrals with the constants of elementary Hamiltonians or brackets, where these give H̃."""
    if route == "brackets" and isinstance(method, BSeries):
        return terms
    try:
        _, energy = _route_and_energy(method, scene, order, parts, route)
    except BSeriesError:
        return terms
    found = [terms[0]]
    for k, term in enumerate(terms[1:], 1):
        ring = DifferentialRing([energy.symbolic(k) - term], scene.symbols)
        gap = ring.elements[0]
        is_constant = all(ring.is_zero(ring.derivative(gap, i)) for i in range(scene.dimension))
        found.append(term + ring.to_expression(gap) if is_constant else term)
    return tuple(found)
