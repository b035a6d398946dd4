"""The flows that a page compares on a scene: numerical, exact and modified, with energies, areas and many orbits."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
import sympy

from bseries.exceptions import SeriesError
from bseries.explorer.carried import FLOW, by_field, by_steps, crossings, orbit, padded, quiet
from bseries.fields.compiled_formulas import CompiledFormulas
from bseries.fields.modified_fields import modified_field
from bseries.hamiltonians.modified_hamiltonian import ModifiedHamiltonian, modified_hamiltonian
from bseries_base.errors import BSeriesError
from integrators import Stepper, reference_solution, stepper
from integrators.core.errors import IntegratorError
from integrators.core.immutable import cached_method
from integrators.methods.programs.program import Method
from integrators.scenes.scene import Scene

OSCILLATION = 2.0
"""The largest h is this over the size of the Jacobian at the start: where Störmer–Verlet becomes unstable."""
RESOLVED, DRAWN = 1e-3, 0.03
"""The largest Fourier coefficient in the upper third of frequencies, relative to the largest of all, of a closed curve
whose points resolve it well enough for its area, and for a picture."""


class Plane(NamedTuple):
    """Variables of a scene, by their indices."""

    x: int | None  # the variable across in pictures of orbits; None for the time
    y: int  # the variable upwards
    conjugate: tuple[int, int] | None  # (q, p), around which a patch of initial values lies; None for one variable
    pairs: tuple[tuple[int, int], ...]  # all (q, p), over which areas are summed; none where areas have no meaning


def plane_of(scene: Scene) -> Plane:
    """The plane of a scene: (q, p) for one degree of freedom, (q1, q2) for more, else the first two variables.

    Example:
        >>> import bseries as bs
        >>> plane_of(bs.scene("pendulum")), plane_of(bs.scene("kepler")).conjugate
        (Plane(x=1, y=0, conjugate=(1, 0), pairs=((1, 0),)), (2, 0))
    """
    if scene.dimension == 1:
        return Plane(None, 0, None, ())
    if scene.canonical_pair is None:
        return Plane(0, 1, (1, 0), ((1, 0),) if scene.dimension == 2 else ())
    momenta, positions = (range(block.offset, block.end) for block in scene.canonical_pair)
    pairs = tuple(zip(positions, momenta, strict=True))
    x, y = pairs[0] if len(pairs) == 1 else positions[:2]
    return Plane(x, y, pairs[0], pairs)


def angles(scene: Scene) -> tuple[int, ...]:
    """The variables that the field depends on with period 2π.

    Example:
        >>> import bseries as bs
        >>> angles(bs.scene("pendulum")), angles(bs.scene("kepler"))
        ((1,), ())
    """
    field = sympy.Tuple(*scene.field)
    found = [i for i, symbol in enumerate(scene.symbols) if symbol in field.free_symbols]
    return tuple(i for i in found if field.xreplace({scene.symbols[i]: scene.symbols[i] + 2 * sympy.pi}) == field)


def area_primitive(scene: Scene) -> sympy.Expr | None:
    """The formula A(p, q) with ∂A/∂p = 1/B, for two variables with the Poisson structure B; None for any other scene.

    The flow of a Poisson system preserves the integral of dp dq/B.

    Example:
        >>> import bseries as bs
        >>> area_primitive(bs.scene("lotka-volterra"))
        log(p)/q
    """
    if scene.poisson is None or scene.dimension != 2:
        return None
    return sympy.integrate(1 / scene.poisson[1][0], scene.symbols[0])


def enclosed_area(form: np.ndarray, q: np.ndarray) -> float:
    """The integral ∮ form dq along a smooth closed curve; not a number if the curve is not resolved.

    Values are those at points with equal differences of the curve's parameter.

    Example:
        >>> import numpy as np
        >>> angle = np.arange(16) * np.pi / 8
        >>> round(enclosed_area(3 * np.sin(angle), np.cos(angle)) / np.pi, 12)
        -3.0
    """
    if not is_resolved(np.array([form, q]), RESOLVED):
        return math.nan
    wave = np.fft.rfft(q)
    slope = np.fft.irfft(1j * np.arange(len(wave)) * wave, n=len(q))
    return float(2 * math.pi * np.mean(form * slope))


def is_resolved(curves: np.ndarray, tail: float) -> bool:
    """Whether the points of closed curves, (curves, points), resolve them: see `RESOLVED`."""
    sizes = abs(np.fft.rfft(curves)[:, 1:])
    return bool(sizes[:, 2 * sizes.shape[1] // 3 :].max() <= tail * sizes.max())


def largest_step(jacobian: np.ndarray) -> float:
    """The largest step size of a page, of one digit, from the Jacobian of the field at the start."""
    size = max(abs(np.linalg.eigvals(jacobian))) if np.isfinite(jacobian).all() else 1.0
    return float(f"{min(OSCILLATION / max(size, 1e-3), 2.0):.1g}")


View = dict[str, dict[str, np.ndarray]]
"""Columns of `curve`, `patch` and `area`."""

SAMPLES = 150
"""States of a curve, after the start."""
MOST_STEPS = 20_000
SPAN, MOST_SPAN = 20.0, 1_000.0
TERMS, FEW_VARIABLES, TERMS_OF_MANY = 6, 4, 4
"""The most terms of the modified equation, in scenes with few variables and with many."""
SCALES = (0.2, 1.6)
"""Starts are the scene's, times a factor in between."""
PATCHES, CIRCLE, RADIUS = 5, 48, 0.1
"""Times at which the patch is drawn after the start, points on its boundary, its radius relative to q and p."""
LENGTHS = {"curve": SAMPLES + 1, "patch": (PATCHES + 1) * (CIRCLE + 2), "area": PATCHES + 1}
NOTHING: View = {part: defaultdict(partial(np.full, length, np.nan)) for part, length in LENGTHS.items()}
"""Instead of a flow that does not exist."""
ORBITS, ORBIT_STEPS, SECTION_STEPS, MOST_CROSSINGS = 12, 250, 2_000, 200
NEAR = 4.0
"""Points of orbits that escape are drawn up to this many times the start."""


class SceneShape(NamedTuple):
    """What a page says of a scene before it has curves, all of it plain text and numbers."""

    title: str  # the method and the scene
    start: str  # the start as text
    span: float  # the length of time
    largest: float  # the largest step size
    terms: int  # the most terms of the modified equation
    energy_terms: int  # the most terms of the modified Hamiltonian, 1 if it is H; 0 without a Hamiltonian
    axes: tuple[str, str]  # the names on the axes of curves
    patch_axes: tuple[str, str] | None  # those of patches; None without patches
    orbit_axes: tuple[str, str]  # those of many orbits
    section: str | None  # the variable that is zero where many orbits are shown; None if they are shown everywhere
    lengths: dict[str, int]  # of the columns of `curve`, `patch`, `area` and `orbits`, whatever the step size
    area: str  # what areas are; empty if they have no meaning


class SceneFlows:
    """A method on a scene, as curves for a page.

    Args:
        method: The method.
        scene: The scene, with a start.
        span: The length of time.

    Attributes:
        terms: The most terms of the modified equation.
        largest: The largest step size.

    Raises:
        IntegratorError: The method does not fit the scene, or has symbols.
        SeriesError: Likewise, or the field is not finite at the start.

    Example:
        >>> import bseries as bs
        >>> flows = SceneFlows(bs.method("stormer-verlet"), bs.scene("pendulum"))
        >>> curve = flows.modified(0.1, 1.0, 5)["curve"]
        >>> flows.largest, bool(max(curve["error"][1:]) < 1e-4), bool(max(abs(curve["energy"])) < 1e-6)
        (2.0, True, True)
    """

    def __init__(self, method: Method, scene: Scene, span: float = SPAN):
        self.method, self.scene, self.span = method, scene, span
        self._stepper = stepper(method, scene)  # refuses symbols, and methods that do not fit
        self.plane = plane_of(scene)
        self.terms = TERMS if scene.dimension <= FEW_VARIABLES else TERMS_OF_MANY
        with quiet():
            slope = self.field(1)(scene.y0, 0.0)
        if not all(map(math.isfinite, slope)):
            raise SeriesError("start must be where the field is finite, but was not")
        self.largest = min(largest_step(self._jacobian()), span / 2)
        self._last: tuple[Any, Any] = (), ()

    def _jacobian(self) -> np.ndarray:
        width = 1e-6 * (1 + abs(self.scene.y0).max())
        shifts, start, f = width * np.eye(self.scene.dimension), self.scene.y0[:, None], self.field(1)
        with quiet():
            return (f(start + shifts, 0.0) - f(start - shifts, 0.0)) / (2 * width)

    @property
    def section(self) -> tuple[int, int, int] | None:
        """The section q1 = 0 and the variables (q2, p2) in it; None with one degree of freedom."""
        return (self.plane.pairs[0][0], *self.plane.pairs[1]) if len(self.plane.pairs) > 1 else None

    @property
    def shape(self) -> SceneShape:
        """What a page says of the scene."""
        names, (x, y, conjugate, pairs) = self.scene.variables, self.plane
        values = zip(names, self.scene.y0, strict=True)
        axes, section = ("t" if x is None else names[x], names[y]), self.section
        poisson = "∫ dp dq/B, B being the Poisson structure" if self.scene.poisson is not None else "Σ ∮ p dq"
        return SceneShape(
            title=f"{self.method.name} on {self.scene.name}",
            start=", ".join(f"{name} = {value:.4g}" for name, value in values),
            span=self.span,
            largest=self.largest,
            terms=self.terms,
            energy_terms=self.energy_terms,
            axes=axes,
            patch_axes=None if conjugate is None else (names[conjugate[0]], names[conjugate[1]]),
            orbit_axes=axes if section is None else (names[section[1]], names[section[2]]),
            section=None if section is None else names[section[0]],
            lengths={**LENGTHS, "orbits": ORBITS * self._orbit_sizes[1]},
            area=poisson if pairs else "",
        )

    def numerical(self, h: float, scale: float) -> View:
        """The numerical solution; its column energy is H(y) − H(y0)."""
        t, states = self._states(h, scale)
        every, times = self._grid(h)[0], self._patch_times(h)
        counts = [every * count for count in self._samples(h)]
        view = self._patch(by_steps(self._stepper, self._circle(scale), h, counts), times)
        return {"curve": {**self._curve(t, states), "energy": self._energy_change(1, 0.0, states)}, **view}

    def exact(self, h: float, scale: float) -> View:
        """The exact solution; its column error is the distance of the numerical one."""
        t, states = self._states(h, scale)
        last, start, longest = int((t == t).sum()), scale * self.scene.y0, self.span / SAMPLES
        try:
            with quiet():
                exact = reference_solution(self.scene, t[:last], y0=start)
        except IntegratorError:  # the solution ends before, or is known to fewer digits than doubles have
            exact = by_field(self.field(1), 0.0, start[:, None], t[:last], longest)[:, :, 0].T
        length = h * self._grid(h)[0]
        parts = max(1, math.ceil(length / longest - 1e-9))
        counts = [parts * count for count in self._samples(h)]
        moved = by_steps(self._flow_stepper, self._circle(scale), length / parts, counts)
        return {"curve": self._compared(t, padded(exact, len(t)), states), **self._patch(moved, self._patch_times(h))}

    def modified(self, h: float, scale: float, terms: int) -> View:
        """The modified equation's solution; its columns are error, and energy: H̃(y) − H̃(y0) of the numerical one."""
        t, states = self._states(h, scale)
        last, longest = int((t == t).sum()), self.span / SAMPLES
        points = np.column_stack([scale * self.scene.y0, self._circle(scale)])
        times = h * self._grid(h)[0] * np.arange(self._grid(h)[1] + 1)
        moved = by_field(self.field(terms), h, points, times, longest)
        curve = self._compared(t, padded(moved[:last, :, 0].T, len(t)), states)
        curve["energy"] = self._energy_change(terms, h, states)
        places = np.cumsum([0, *self._samples(h)])
        return {"curve": curve, **self._patch(moved[places, :, 1:], self._patch_times(h))}

    def orbits(self, h: float) -> dict[str, np.ndarray]:
        """Columns x and y: states of many numerical orbits, or with two degrees of freedom their section q1 = 0."""
        section, (steps, kept) = self.section, self._orbit_sizes
        columns = np.full((2, ORBITS, kept), np.nan)
        for k, scale in enumerate(np.linspace(*SCALES, ORBITS)):
            states = orbit(self._stepper, scale * self.scene.y0, h, steps).T
            points = states if section is None else crossings(states, section[0])
            for i in self._angles:
                points[i] = np.remainder(points[i] + np.pi, 2 * np.pi) - np.pi
            shown = [h * np.arange(steps + 1) if self.plane.x is None else points[self.plane.x], points[self.plane.y]]
            shown = shown if section is None else [points[section[1]], points[section[2]]]
            count = min(points.shape[1], kept)
            columns[:, k, :count] = np.array(shown)[:, :count]
        columns[abs(columns) > NEAR * (abs(self.scene.y0).max() or 1.0)] = np.nan
        return {"x": columns[0].ravel(), "y": columns[1].ravel()}

    @property
    def _orbit_sizes(self) -> tuple[int, int]:
        """The steps of each of many orbits, and the points that are kept."""
        return (ORBIT_STEPS, ORBIT_STEPS + 1) if self.section is None else (SECTION_STEPS, MOST_CROSSINGS)

    @cached_property
    def _flow_stepper(self) -> Stepper:
        return stepper(FLOW, self.scene)

    @cached_method
    def field(self, terms: int) -> Callable[..., Any]:
        """The modified equation with a number of terms."""
        return modified_field(self.method, self.scene, terms)

    @cached_property
    def _angles(self) -> tuple[int, ...]:
        return angles(self.scene)

    @cached_property
    def energy(self) -> ModifiedHamiltonian | None:
        """The modified Hamiltonian with as many terms as there are; None without a Hamiltonian."""
        if not self.scene.is_hamiltonian:
            return None
        tries = [(self.method, terms) for terms in range(self.terms, 0, -1)]
        for method, terms in [*tries, ("implicit-midpoint", 1)]:  # whose first term is H
            try:
                return modified_hamiltonian(method, self.scene, terms)
            except BSeriesError:
                continue
        return None

    @cached_property
    def energy_terms(self) -> int:
        """The most terms of the modified Hamiltonian, 1 if it is H; 0 without a Hamiltonian."""
        return 0 if self.energy is None else self.energy.order

    def _energy_change(self, terms: int, h: float, states: np.ndarray) -> np.ndarray:
        """The change of the truncated modified Hamiltonian; not numbers where it does not exist."""
        if self.energy is None or terms > self.energy_terms:
            return np.full(states.shape[1], np.nan)
        with quiet():
            values = h ** np.arange(terms) @ self.energy.terms(np.nan_to_num(states))[:terms]
        return np.where(np.isnan(states[0]), np.nan, values - values[0])

    def _curve(self, t: np.ndarray, states: np.ndarray) -> dict[str, np.ndarray]:
        return {"t": t, "x": t if self.plane.x is None else states[self.plane.x], "y": states[self.plane.y]}

    def _compared(self, t: np.ndarray, flow: np.ndarray, states: np.ndarray) -> dict[str, np.ndarray]:
        """A flow, and its distance from the numerical solution; zero has no place in a logarithmic scale."""
        distance = np.sqrt(((states - flow) ** 2).sum(axis=0))
        return {**self._curve(t, flow), "error": np.where(distance > 0, distance, np.nan)}

    def _grid(self, h: float) -> tuple[int, int]:
        """The steps between stored states, and the number of these after the start."""
        if not 0 < h < math.inf:
            raise SeriesError(f"h must be a number greater than 0, but was {h!r:.60}")
        steps = max(1, math.floor(self.span / h + 1e-9))
        if steps > MOST_STEPS:
            least = self.span / MOST_STEPS
            raise SeriesError(f"h must be at least {least:g} for a time of {self.span:g}, but was {h:g}")
        every = -(-steps // SAMPLES)
        return every, steps // every

    def _states(self, h: float, scale: float) -> tuple[np.ndarray, np.ndarray]:
        """Times and states of the numerical solution, filled up with nan; those asked for last are kept."""
        if self._last[0] != (h, scale):
            every, count = self._grid(h)
            found = orbit(self._stepper, scale * self.scene.y0, h, every * count, every)
            states, t = padded(found.T, SAMPLES + 1), h * (every * np.arange(SAMPLES + 1))
            self._last = (h, scale), (np.where(np.isnan(states[0]), np.nan, t), states)
        return self._last[1]

    def _samples(self, h: float) -> list[int]:
        """The stored states from one time of the patch to the next."""
        return np.diff(np.round(np.linspace(0, self._grid(h)[1], PATCHES + 1)).astype(int)).tolist()

    def _patch_times(self, h: float) -> np.ndarray:
        return h * self._grid(h)[0] * np.cumsum([0, *self._samples(h)])

    def _circle(self, scale: float) -> np.ndarray:
        """Points around the start in the plane of conjugate variables, (variables, points)."""
        start, angle = scale * self.scene.y0, np.arange(CIRCLE) * (2 * np.pi / CIRCLE)
        circle = np.tile(start[:, None], CIRCLE)
        conjugate = list(self.plane.conjugate or ())
        radius = RADIUS * (abs(start[conjugate]).max(initial=0.0) or 1.0)
        for i, wave in zip(conjugate, (np.cos(angle), np.sin(angle)), strict=False):
            circle[i] += radius * wave
        return circle

    def _patch(self, moved: np.ndarray, times: np.ndarray) -> View:
        """Closed curves separated by nan, and their areas relative to the first."""
        nowhere = np.full((len(times), CIRCLE + 2), np.nan)
        if self.plane.conjugate is None:
            x = y = nowhere
        else:
            shown = moved[:, list(self.plane.conjugate)]
            shown[[not is_resolved(curve, DRAWN) for curve in shown]] = np.nan
            x, y = (np.hstack([z, z[:, :1], nowhere[:, :1]]) for z in shown.swapaxes(0, 1))
        areas = np.array([self._area(curve) for curve in moved])
        return {"patch": {"x": x.ravel(), "y": y.ravel()}, "area": {"t": times, "area": areas / areas[0]}}

    @cached_property
    def _primitive(self) -> CompiledFormulas | None:
        formula = area_primitive(self.scene)
        return None if formula is None else CompiledFormulas(self.scene.symbols, [(formula,)])

    def _area(self, curve: np.ndarray) -> float:
        """The area that the flow of a Hamiltonian or Poisson system preserves."""
        if not self.plane.pairs:
            return math.nan
        if self._primitive is not None:
            form = self._primitive.values(curve.T.copy(), 0.0, 1)[:, 0]
            return enclosed_area(form, curve[1])
        return sum(enclosed_area(curve[p], curve[q]) for q, p in self.plane.pairs)
