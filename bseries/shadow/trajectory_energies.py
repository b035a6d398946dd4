"""Shadow energies of a finished trajectory: is the step too large, and does the energy drift?

States become mass-weighted and are taken to full steps of kick–drift–kick; those that are no consecutive steps of it
are refused with a diagnosis. The energies of all orders are then computed in one pass.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from bseries.exceptions import SeriesError
from bseries.shadow.formulas import LEAST_ORDER, ShadowFormula, check_order, shadow_formula
from bseries.shadow.report import ShadowReport, Statistics
from bseries.shadow.sources import Columns, SceneForces, Source, open_source
from bseries_base.kernels import float_kernel
from integrators.core.arguments import check_progress
from integrators.exact.arguments import read_number
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.scene import Scene

CHUNK_NUMBERS = 2**17
"""Numbers of one kind processed at a time, for the processor's cache."""
TOLERANCE = 1e-9
PRECISION = 16 * 2.0**-52
"""Relative error of the numbers of a state."""
USUAL_ORDER = 16
LEAST_VALUES = 16
"""Least number of shadow energies."""
FULL, BEHIND, AHEAD, MIDDLE = "full", "half-behind", "half-ahead", "drift-kick-drift"
LAYOUTS = (FULL, BEHIND, AHEAD, MIDDLE)
"""Storage of momenta: with their positions; half a step before or after them; or for the other kind of step."""
CLOSE, ROUGH, EXACT = 1e-4, 0.03, 1e-9
"""Largest unexplained part of a step for a valid diagnosis: for ratios, for long steps, and for exact definitions."""
RARE, MANY, FAR = 0.05, 10.0, 0.3
"""Share of steps with a cause of their own; factor of a jump; error of the ratio of potential and work."""
ROUNDING = 1e-4
"""Largest relative distance from a step that rounding of the data may explain."""
PLURALS = {"t": "times", "q": "positions", "p": "momenta", "v": "velocities", "U": "potentials"}
"""Names of columns in messages about infinite values; the others are forces."""


def shadow_energy(
    trajectory: Any,
    scene: Scene | str | None = None,
    *,
    order: int | None = None,
    h: float | None = None,
    mass: ArrayLike | None = None,
    columns: Mapping[str, str] | None = None,
    layout: str = "full",
    period: ArrayLike | None = None,
    tolerance: float | None = None,
    keep: bool = False,
    progress: Callable[[int, int], object] | bool | None = None,
) -> ShadowReport:
    """Modified energies of order 2, 4, …, measured along a trajectory computed by any program.

    Steps must be consecutive steps of the Störmer–Verlet method, kick–drift–kick ("velocity Verlet"), for
    pᵀM⁻¹p/2 + U(q). A shadow energy of order 2k is constant up to O(h^2k), while the energy itself (order 2) oscillates
    by O(h²), which hides a drift. Memory does not depend on the length of the trajectory.

    Args:
        trajectory: A `Trajectory`; arrays by name, (variables, times) or (times, …) each, also as a frame of pandas or
            xarray; or the path of a file: one of this package, NPZ, NPY, or text with the names of columns in its first
            line. It has positions q (or q1, q2, …), momenta p or velocities v, the potential U and its gradient gradU
            or forces F; and optionally t, h and mass.
        scene: A `Scene` or the name of one, which supplies masses, potentials and forces. Trajectories of this package
            contain theirs.
        order: The largest order, 2 to 24; by default 16, or what a short trajectory allows.
        h: The step size, if neither times nor the file contain it.
        mass: A mass, one for each particle, or one for each coordinate; by default that of the file, or 1.
        columns: The columns of each role that have other names: names, patterns, or places from 0 on, as in
            ``{"q": "x*", "U": "PotEng"}`` or ``{"t": 0, "p": "1:3", "q": "3:5"}``.
        layout: The storage layout of momenta: ``full``; ``half-behind`` or ``half-ahead`` of their positions by half a
            step ("leapfrog"); or ``drift-kick-drift`` for states of that method, which needs a scene.
        period: The edge of the periodic box of wrapped positions, or one for each coordinate.
        tolerance: The largest distance of a state from a step of the method, relative to the largest numbers. Arrays in
            single precision and text with few digits need more than 1e-9.
        keep: Whether to keep the values, in `ShadowReport.values`.
        progress: Called with the number of states done and of all.

    Raises:
        SeriesError: Data are missing, or not consecutive steps of this method; the message contains a diagnosis.
        IntegratorError: A file, a scene, a number or `progress` cannot be used.

    Example:
        >>> import bseries as bs
        >>> run = bs.integrate("stormer-verlet", bs.scene("pendulum"), h=0.1, steps=2000)
        >>> report = bs.shadow_energy(run, order=6)
        >>> print(*(f"{row.order}: {row.deviation:.0e}" for row in report.rows))
        2: 1e-03 4: 5e-06 6: 3e-08

    References:
        Skeel, Hardy, SIAM J. Sci. Comput. 23 (2001) 1172, doi:10.1137/S106482750138318X; Engle, Skeel, Drees, J.
        Comput. Phys. 206 (2005) 432, doi:10.1016/j.jcp.2004.12.009.
    """
    if order is not None:
        check_order(order)
    show = check_progress(progress)
    h = read_number(h, "h") if isinstance(h, str) else h
    allowed = TOLERANCE if tolerance is None else read_number(tolerance, "tolerance")
    if allowed < 0:
        raise SeriesError(f"tolerance must be 0 or more, but was {tolerance!r:.60}")
    source = open_source(trajectory, columns, None if scene is None else SceneForces(as_scene(scene)))
    blocks = source.blocks(max(256, CHUNK_NUMBERS // source.dimension))
    head = next(blocks, None)
    if head is None or len(head["q"]) < 2:
        raise SeriesError(f"{source.label} must have at least {LEAST_VALUES + 2} states, but has fewer than 2")
    run = _Run(source, _step(source, head.get("t"), h), allowed, layout)
    if layout not in LAYOUTS:
        raise SeriesError(f"layout must be one of {', '.join(LAYOUTS)}, but was {layout!r:.60}")
    if layout == MIDDLE and source.forces is None:
        raise SeriesError("scene must be given for the layout drift-kick-drift, whose forces are at half steps")
    edges = None if period is None else _positive_numbers(period, "period", source.dimension, np.tile)
    states = run.states(chain([head], blocks), _mass_factors(_inverse_masses(source, mass)), edges)
    start = float(head["t"][0]) if "t" in head else 0.0
    with np.errstate(all="ignore"):  # numbers that overflow are refused where they are found
        return _measure(run, states, order, start, keep, show)


def _step(source: Source, t: np.ndarray | None, h: float | None) -> float:
    """The step size: as given, stored, or between the first times."""
    if source.every != 1:
        _refuse_thinned(source, f"are every {source.every}th of a run" if source.every else "are its start and end")
    if h is not None:
        step = read_number(h, "h")
    elif source.h is not None:
        step = source.h
    elif t is not None:
        _check_finite(t, "times", 0, source)
        step = float(t[-1] - t[0]) / (len(t) - 1)
    else:
        raise SeriesError(f"h must be given where there are no times, but {source.label} has none")
    if step == 0 or not math.isfinite(step):
        raise SeriesError(f"h must be a finite number other than 0, but was {step:g}")
    return step


def _inverse_masses(source: Source, mass: ArrayLike | None) -> np.ndarray:
    """M⁻¹ or its diagonal: of a scene, or from the masses given or stored with the columns."""
    if source.forces is None:
        given = next((masses for masses in (mass, source.mass) if masses is not None), 1.0)
        return 1 / _positive_numbers(given, "mass", source.dimension, np.repeat)
    if mass is not None:
        raise SeriesError("mass must be left out where a scene is given, which has masses, but was given")
    inverse = source.forces.inverse_masses
    if len(inverse) != source.dimension:
        raise SeriesError(
            f"q must have the shape (states, {len(inverse)}), as the scene has {len(inverse)} positions, but has "
            f"{source.dimension} numbers for each state"
        )
    return inverse


def _mass_factors(inverse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """L with M⁻¹ = L Lᵀ, and L⁻¹: matrices, or their diagonals. Mass-weighted momenta are Lᵀp, positions L⁻¹q."""
    if inverse.ndim == 2 and not np.any(inverse - np.diag(np.diag(inverse))):
        inverse = np.diag(inverse)
    try:
        if inverse.ndim == 2:
            factor = np.linalg.cholesky(inverse)
            return factor, np.linalg.inv(factor)
        if not (np.all(inverse > 0) and np.all(np.isfinite(inverse))):
            raise np.linalg.LinAlgError
    except np.linalg.LinAlgError:
        raise SeriesError("mass must be positive, but that of some coordinate was not") from None
    return np.sqrt(inverse), 1 / np.sqrt(inverse)


def _measure(
    run: _Run,
    pieces: Iterator[_States],
    order: int | None,
    start: float,
    keep: bool,
    progress: Callable[[int, int], object] | None,
) -> ShadowReport:
    """The report on a run, in one pass over its states."""
    head = next(pieces)
    orders = _orders(order, head.u.size, run.source)
    statistics, offset, kept = Statistics(orders), float(head.u[0]), list[np.ndarray]()
    weights, works, products = formula_arrays([shadow_formula(order) for order in orders])
    halo = 2 * (weights.shape[1] - 1)
    done, most_rounding = 0, 0.0
    states = _States(*(array[..., :0] for array in head))
    for piece in chain([head], pieces):
        fresh = piece._replace(u=piece.u - offset)  # reduces rounding
        states = _States(*(np.concatenate(pair, axis=-1) for pair in zip(states, fresh, strict=True)))
        steps = states.u.size
        rounding = run.check_steps(states, done - (steps - piece.u.size))
        if done == 0:
            run.check_potential(states)
        rounding += PRECISION * (float(np.max(np.abs(piece.u))) + _longest(piece.p) * _longest(piece.p))
        most_rounding, done = max(most_rounding, rounding), done + piece.u.size
        if steps > halo:
            work = np.empty((works.shape[1], steps)), np.empty((products.shape[1], steps))
            out = np.empty((len(orders), steps - halo))
            shadow_values.compiled(run.h, states.p, states.g, states.u, weights, works, products, *work, out)
            middle = done - steps + halo // 2
            _check_finite(out, "shadow energies", middle, run.source)  # squares of finite numbers may overflow
            statistics.add(out)
            if keep:
                kept.append(out + offset)
            states = _States(*(array[..., steps - halo :] for array in states))
        if progress is not None:
            progress(done, run.source.states or done)
    values = dict(zip(orders, np.concatenate(kept, axis=1), strict=True)) if keep else None
    return ShadowReport(run.source.label, run.h, start, done, statistics, offset, most_rounding, values)


@float_kernel
def shadow_values(h, p, g, u, weights, works, products, power, product, out):
    """Write the shadow energies at all steps but the first and last few to out, (orders, steps − 2 reach).

    The formulas are rows: weights of potentials and `works` from the middle outwards, and for each lag the factors of
    g_i·g_(i + lag) from i = −reach to reach. Scalar products are computed once for all orders, in `power` (shifts,
    steps) and `product` (lags, steps).
    """
    coordinates, steps = p.shape
    orders, reach = weights.shape[0], weights.shape[1] - 1
    power[:, :] = 0.0
    product[:, :] = 0.0
    for d in range(coordinates):
        for n in range(steps):
            power[0, n] += 0.5 * p[d, n] * p[d, n]
        for i in range(1, power.shape[0]):
            for n in range(i, steps - i):
                power[i, n] += p[d, n] * (g[d, n + i] - g[d, n - i])
        for lag in range(product.shape[0]):
            for n in range(steps - lag):
                product[lag, n] += g[d, n] * g[d, n + lag]
    width = steps - 2 * reach
    for order in range(orders):
        row = out[order]
        for n in range(width):
            row[n] = power[0, n + reach] + weights[order, 0] * u[n + reach]
        for i in range(1, reach + 1):
            weight = weights[order, i]
            if weight != 0.0:
                for n in range(width):
                    row[n] += weight * (u[n + reach + i] + u[n + reach - i])
        for i in range(1, power.shape[0]):
            factor = h * works[order, i]
            if factor != 0.0:
                for n in range(width):
                    row[n] += factor * power[i, n + reach]
        for lag in range(product.shape[0]):
            for i in range(2 * reach + 1):
                factor = h * h * products[order, lag, i]
                if factor != 0.0:
                    for n in range(width):
                        row[n] += factor * product[lag, n + i]


def formula_arrays(formulas: Sequence[ShadowFormula]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The arrays `weights`, `works` and `products` of `shadow_values` for several orders."""
    reach = max(1, *(formula.reach for formula in formulas))  # at least 1, so that neighbouring pieces overlap
    shifts = max(len(formula.works) for formula in formulas) + 1
    lags = max((j - i for formula in formulas for i, j in formula.products), default=0) + 1
    weights, works = np.zeros((len(formulas), reach + 1)), np.zeros((len(formulas), shifts))
    products = np.zeros((len(formulas), lags, 2 * reach + 1))
    for k, formula in enumerate(formulas):
        weights[k, : len(formula.potentials)] = [float(x) for x in formula.potentials]
        works[k, 1 : len(formula.works) + 1] = [float(x) for x in formula.works]
        for (i, j), value in formula.products.items():
            products[k, j - i, i + reach] = float(value)
    return weights, works, products


def _orders(order: int | None, states: int, source: Source) -> tuple[int, ...]:
    """The orders to measure; `states` is the number of states in the first piece."""
    wanted = range(LEAST_ORDER, (order or USUAL_ORDER) + 1, 2)
    there = tuple(k for k in wanted if states - 2 * max(1, k // 4) >= LEAST_VALUES)
    if not there:
        raise SeriesError(f"{source.label} must have at least {LEAST_VALUES + 2} states, but has {states}")
    if order is not None and there[-1] != order:
        raise SeriesError(f"order must be at most {there[-1]} for {states} states, but was {order}")
    return there


class _States(NamedTuple):
    """Consecutive states: arrays (coordinates, steps), and (steps,) for u.

    They are mass-weighted, q̂ = M^(1/2) q, p̂ = M^(−1/2) p, ĝ = M^(−1/2) ∇U, so that masses do not appear.
    """

    q: np.ndarray
    p: np.ndarray
    g: np.ndarray
    u: np.ndarray


def _weighted(rows: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """The columns of rows times a factor, which is a matrix or its diagonal."""
    if factor.ndim == 1:
        return np.multiply(rows.T, factor[:, None], order="C")
    return np.ascontiguousarray((rows @ factor).T)


def _longest(columns: np.ndarray) -> float:
    """The length of the longest column, without overflow."""
    most = float(np.max(np.abs(columns)))
    return most * float(np.sqrt(np.max(np.sum((columns / most) ** 2, axis=0)))) if most else 0.0


def _positive_numbers(value: ArrayLike, argument: str, dimension: int, spread: Callable[..., np.ndarray]) -> np.ndarray:
    """Positive numbers for all coordinates, from one, or one for each particle, dimension of space or coordinate."""
    try:
        values = np.asarray(value, dtype=float).reshape(-1)
    except (TypeError, ValueError, OverflowError):
        raise SeriesError(f"{argument} must be numbers, but was {value!r:.60}") from None
    if not len(values) or dimension % len(values):
        raise SeriesError(
            f"{argument} must be one number, or one for each particle or coordinate, but there were {len(values)} for "
            f"{dimension} coordinates"
        )
    wrong = values[~((values > 0) & np.isfinite(values))]
    if len(wrong):
        raise SeriesError(f"{argument} must be positive, but one was {wrong[0]:g}")
    return spread(values, dimension // len(values))


def _check_finite(array: np.ndarray, name: str, first: int, source: Source) -> None:
    """Check that numbers are finite."""
    finite = np.isfinite(array)
    if not finite.all():
        n = int(np.argmin(finite.reshape(-1, array.shape[-1]).all(axis=0)))
        raise SeriesError(f"{source.label} must have finite {name}, but those of state {first + n + 1} are not")


def _refuse_thinned(source: Source, what: str) -> NoReturn:
    """Report missing steps."""
    raise SeriesError(f"{source.label} must contain every step, but its states {what}")


class _Run(NamedTuple):
    """A trajectory, its step size, and how its states are checked."""

    source: Source
    h: float
    tolerance: float
    layout: str

    def states(
        self, blocks: Iterator[Columns], masses: tuple[np.ndarray, np.ndarray], period: np.ndarray | None
    ) -> Iterator[_States]:
        """The states of blocks of columns; `masses` are L and L⁻¹, `period` is the box for each coordinate."""
        factor, inverse = masses
        first, time, last, crossings = 0, None, None, 0.0
        for columns in blocks:
            self._check_columns(columns, time, first)
            q, first, time = columns["q"], first + len(columns["q"]), columns["t"][-1] if "t" in columns else None
            p = _weighted(columns["p"], factor) if "p" in columns else _weighted(columns["v"], inverse.T)
            if period is not None:  # positions continue where they jump to the other side of the box
                jumps = np.round(np.diff(q, axis=0, prepend=q[:1] if last is None else last) / period)
                crossings = np.cumsum(jumps, axis=0) + crossings
                last, q, crossings = q[-1:].copy(), q - period * crossings, crossings[-1:]
            weighted = _weighted(q, inverse.T)
            if self.layout == MIDDLE:
                weighted += 0.5 * self.h * p
                q = _weighted(weighted.T, factor.T).T
            if self.source.forces is not None:
                gradients, u = self.source.forces(np.ascontiguousarray(q))
            else:
                gradients, u = columns["gradU"] if "gradU" in columns else -columns["F"], columns["U"]
            g = _weighted(gradients, factor)
            if self.layout != FULL:
                p += (0.5 if self.layout == AHEAD else -0.5) * self.h * g
            yield _States(weighted, p, g, u)

    def _check_columns(self, columns: Columns, before: float | None, first: int) -> None:
        """Check that columns are finite and times, after that `before` them, advance by h."""
        for role, rows in columns.items():
            _check_finite(rows.T, PLURALS.get(role, "forces"), first, self.source)
        if "t" not in columns:
            return
        h, t = self.h, columns["t"] if before is None else np.concatenate(([before], columns["t"]))
        steps = np.diff(t)
        wrong = np.flatnonzero(~(np.abs(steps - h) <= 1e-3 * abs(h) + 2 * self.tolerance * np.max(np.abs(t))))
        if len(wrong):
            k, step = first + int(wrong[0]) + (before is None), float(steps[wrong[0]])
            ratio = step / h
            if np.isfinite(ratio) and round(ratio) > 1 and abs(ratio - round(ratio)) < CLOSE * ratio:
                _refuse_thinned(self.source, f"are {round(ratio)} steps of size {h:g} apart")
            distance = float(np.max(np.abs(steps - h)) / (2 * np.max(np.abs(t))))
            raise SeriesError(
                f"t must advance by one step, {h:g}, each time, but from state {k} to {k + 1} it advanced by {step:g}"
                f"{_on_rounding(distance)}"
            )

    def check_steps(self, states: _States, first: int) -> float:
        """Check that states, from number `first` on, are consecutive steps; returns the energy of their distance."""
        q, p, g, u = states
        for array, name in ((q, "positions"), (p, "momenta"), (g, "forces"), (u, "potentials")):
            _check_finite(array, name, first, self.source)
        if q.shape[1] < 2:
            return 0.0
        moved, drift, changed, impulse = _steps(states, self.h)
        of_q, of_p = np.max(np.abs(moved - drift), axis=0), np.max(np.abs(changed - impulse), axis=0)
        size_p = float(np.max(np.abs(p))) + abs(self.h) * float(np.max(np.abs(g)))
        size_q = float(np.max(np.abs(q))) + abs(self.h) * size_p
        wrong_q, wrong_p = ~(of_q <= self.tolerance * size_q), ~(of_p <= self.tolerance * size_p)  # includes nan
        if wrong_q.any() or wrong_p.any():
            n = int(np.argmax(wrong_q | wrong_p))
            by = f", made by {self.source.method}," if self.source.method else ""
            holds = not wrong_q[n], bool(wrong_p.mean() < RARE)
            reason = self._diagnosis(states, n, *holds, f"from state {first + n + 1} to {first + n + 2}")
            distance = max(float(np.max(of_q)) / (size_q or 1), float(np.max(of_p)) / (size_p or 1))
            raise SeriesError(
                f"{self.source.label}{by} must have consecutive steps of Störmer–Verlet (kick–drift–kick) with "
                f"h = {self.h:g}, but {reason}{_on_rounding(distance)}"
            )
        return float(np.max(of_q)) * _longest(g) + float(np.max(of_p)) * _longest(p)

    def check_potential(self, states: _States) -> None:
        """Check that the potential changes by the work of the forces."""
        work = 0.5 * np.sum((states.g[:, 1:] + states.g[:, :-1]) * np.diff(states.q), axis=0)
        size = float(np.sqrt(work @ work))
        if not size:
            return
        ratio = float(work @ np.diff(states.u)) / size**2
        rounding = self.tolerance * (float(np.max(np.abs(states.u))) + _longest(states.q) * _longest(states.g))
        if not abs(ratio - 1) <= FAR + rounding * len(work) ** 0.5 / size:
            raise SeriesError(
                f"{self.source.label} must have the potential of its forces, but it changes by {ratio:.4g} times "
                "their work"
            )

    def _diagnosis(self, states: _States, n: int, q_holds: bool, p_holds: bool, step: str) -> str:
        """The likely cause of states that are no steps of size h, where step n is the first wrong one."""
        h, p = self.h, states.p
        moved, drift, changed, impulse = _steps(states, h)
        jump = abs(moved[:, n] - drift[:, n]).max()
        if jump > MANY * abs(drift).max() and abs(changed[:, n]).max() <= MANY * abs(impulse).max():
            return f"{step} positions jump by {jump:.6g}, as if wrapped into a box (period unwraps them)"
        stored = p - {FULL: 0.0, AHEAD: 0.5, BEHIND: -0.5, MIDDLE: 0.0}[self.layout] * h * states.g
        one, other = h * stored[:, :-1], h * stored[:, 1:]
        for name, expected in ((AHEAD, one), (BEHIND, other), (MIDDLE, 0.5 * (one + other))):
            if MIDDLE != self.layout != name and _unexplained(moved, expected) < EXACT:
                return f"they are of the layout {name!r}"
        found = _ratios(moved, drift) if p_holds and not q_holds else None
        if found is not None:
            k = int(abs(found - 1).argmax())
            return f"coordinate {k + 1} moves {found[k]:.6g} times as far as its mass implies"
        average = 0.5 * h * (p[:, 1:] + p[:, :-1])  # for steps of another length
        found = None if q_holds or p_holds else _ratios(moved, average)
        if found is not None and abs(found - found.mean()).max() < ROUGH * abs(found.mean()):
            times, whole = float(found.mean()), round(float(found.mean()))
            kept = f", as if only one in {whole} states was kept" if whole > 1 and abs(times - whole) < ROUGH else ""
            return f"positions move {times:.4g} times as far as h implies{kept}"
        found = _ratios(changed, impulse) if q_holds or not p_holds else None
        if found is not None:
            factor = f"{found.mean():.6g} times the impulse of the forces"
            return f"momenta change by {factor}: units, sign or masses are wrong"
        if q_holds:
            return f"{step} momenta change by more than the forces: a thermostat, constraints or another potential"
        return f"{step} there is no such step: states are missing, or the scene, the method, h or masses are wrong"


def _steps(states: _States, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The changes of positions and of momenta from state to state, each with what a step makes of it."""
    q, p, g, _ = states
    return np.diff(q), h * (p[:, :-1] - 0.5 * h * g[:, :-1]), np.diff(p), -0.5 * h * (g[:, 1:] + g[:, :-1])


def _on_rounding(distance: float) -> str:
    """The tolerance that accepts states at a relative distance, if numbers with few digits may explain it."""
    return f"; if it is rounding, tolerance must be {2 * distance:.0e}" if distance < ROUNDING else ""


def _unexplained(found: np.ndarray, expected: np.ndarray) -> float:
    """The median of the unexplained part of differences, relative to that of the differences."""
    size = float(np.median(np.abs(found)))
    return float(np.median(np.abs(found - expected))) / size if size else float("inf")


def _ratios(found: np.ndarray, expected: np.ndarray) -> np.ndarray | None:
    """The factor for each coordinate; None if factors do not explain the differences."""
    squares, products = np.sum(expected * expected, axis=1), np.sum(found * expected, axis=1)
    if not (np.all(squares > 0) and np.all(products)):
        return None
    ratios = products / squares
    explained = _unexplained(found, ratios[:, None] * expected) < ROUGH and np.max(np.abs(ratios - 1)) > ROUGH
    return ratios if explained else None
