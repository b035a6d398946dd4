"""Shadow energies of a finished trajectory: is the step too large, and does the energy drift?"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from bseries.exceptions import SeriesError
from bseries.shadow.formulas import LEAST_ORDER, ShadowFormula, check_order, shadow_formula
from bseries.shadow.report import ShadowReport, Statistics
from bseries.shadow.sources import Columns, SceneForces, Source, open_source
from bseries.shadow.states import (
    LAYOUTS,
    MIDDLE,
    Masses,
    States,
    check_columns,
    check_finite,
    check_potential,
    check_steps,
    longest,
    positive_numbers,
    read_states,
    refuse_thinned,
)
from integrators.core.arguments import check_progress
from integrators.exact.arguments import read_number
from integrators.scenes.catalogue.registry import as_scene
from trees.compiled import float_kernel

CHUNK_NUMBERS = 2**17
"""Numbers of one kind processed at a time, for the processor's cache."""
TOLERANCE = 1e-9
ROUNDING = 16 * 2.0**-52
"""Relative error of the numbers of a state."""
USUAL_ORDER = 16
LEAST_VALUES = 16
"""Least number of shadow energies."""


def shadow_energy(
    trajectory: Any,
    scene: Any = None,
    *,
    order: int | None = None,
    h: float | None = None,
    mass: Any = None,
    columns: Mapping[str, str] | None = None,
    layout: str = "full",
    period: Any = None,
    tolerance: float | None = None,
    keep: bool = False,
    progress: Callable[[int, int], object] | None = None,
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
        >>> from integrators import integrate, scene
        >>> run = integrate("stormer-verlet", scene("pendulum"), h=0.1, steps=2000)
        >>> report = shadow_energy(run, order=6)
        >>> print(*(f"{row.order}: {row.deviation:.0e}" for row in report.rows))
        2: 1e-03 4: 5e-06 6: 3e-08

    References:
        Skeel, Hardy, SIAM J. Sci. Comput. 23 (2001) 1172, doi:10.1137/S106482750138318X; Engle, Skeel, Drees, J.
        Comput. Phys. 206 (2005) 432, doi:10.1016/j.jcp.2004.12.009.
    """
    if order is not None:
        check_order(order)
    check_progress(progress)
    h = read_number(h, "h") if isinstance(h, str) else h
    allowed = TOLERANCE if tolerance is None else read_number(tolerance, "tolerance")
    if allowed < 0:
        raise SeriesError(f"tolerance must be 0 or more, but was {tolerance!r:.60}")
    source = open_source(trajectory, columns, None if scene is None else SceneForces(as_scene(scene)))
    blocks, step, start = _timed(source, h, allowed)
    if layout not in LAYOUTS:
        raise SeriesError(f"layout must be one of {', '.join(LAYOUTS)}, but was {layout!r:.60}")
    if layout == MIDDLE and source.forces is None:
        raise SeriesError("scene must be given for the layout drift-kick-drift, whose forces are at half steps")
    edges, masses = _edges(period, source.dimension), _masses(source, mass)
    states = read_states(blocks, masses, step, source, layout, edges)

    def check(states: States, first: int) -> float:
        rounding = check_steps(states, step, first, allowed, source, layout)
        if first == 0:
            check_potential(states, allowed, source)
        return rounding

    with np.errstate(all="ignore"):  # numbers that overflow are refused where they are found
        return _measure(states, order, step, start, source, check, keep, progress)


def _masses(source: Source, mass: Any) -> Masses:
    """The masses of a scene, or those given or stored with the columns."""
    dimension = source.dimension
    if source.forces is None:
        given = next((masses for masses in (mass, source.mass) if masses is not None), 1.0)
        masses = positive_numbers(given, "mass", dimension)
        return Masses(np.repeat(1 / masses, dimension // len(masses)))
    if mass is not None:
        raise SeriesError("mass must be left out where a scene is given, which has masses, but was given")
    inverse = source.forces.inverse_masses
    if len(inverse) != dimension:
        raise SeriesError(
            f"q must have the shape (states, {len(inverse)}), as the scene has {len(inverse)} positions, but has "
            f"{dimension} numbers for each state"
        )
    return Masses(inverse)


def _edges(period: Any, dimension: int) -> np.ndarray | None:
    """The edge of the box for each coordinate; None if positions are not wrapped."""
    if period is None:
        return None
    edges = positive_numbers(period, "period", dimension)
    return np.tile(edges, dimension // len(edges))


def _timed(source: Source, h: float | None, tolerance: float) -> tuple[Iterator[Columns], float, float]:
    """The checked columns of a source, the step size, and the first time."""
    blocks = source.blocks(max(256, CHUNK_NUMBERS // source.dimension))
    head = next(blocks, None)
    if head is None or len(head["q"]) < 2:
        raise SeriesError(f"{source.label} must have at least {LEAST_VALUES + 2} states, but has fewer than 2")
    if source.every != 1:
        refuse_thinned(source, f"are every {source.every}th of a run" if source.every else "are its start and end")
    t = head.get("t")
    if h is not None:
        step = read_number(h, "h")
    elif source.h is not None:
        step = source.h
    elif t is not None:
        check_finite(t, "times", 0, source)
        step = float(t[-1] - t[0]) / (len(t) - 1)
    else:
        raise SeriesError(f"h must be given where there are no times, but {source.label} has none")
    if step == 0 or not math.isfinite(step):
        raise SeriesError(f"h must be a finite number other than 0, but was {step:g}")

    def checked() -> Iterator[Columns]:
        first, before = 0, None
        for columns in chain([head], blocks):
            check_columns(columns, before, step, first, tolerance, source)
            first, before = first + len(columns["q"]), None if t is None else float(columns["t"][-1])
            yield columns

    return checked(), step, 0.0 if t is None else float(t[0])


def _measure(
    pieces: Iterator[States],
    order: int | None,
    h: float,
    start: float,
    source: Source,
    check: Callable[[States, int], float],
    keep: bool,
    progress: Callable[[int, int], object] | None,
) -> ShadowReport:
    """The report on states, in one pass; `check` refuses wrong ones and returns the energy's rounding error."""
    head = next(pieces)
    orders = _orders(order, head.u.size, source)
    statistics, offset, kept = Statistics(orders), float(head.u[0]), list[np.ndarray]()
    weights, works, products = formula_arrays([shadow_formula(order) for order in orders])
    halo = 2 * (weights.shape[1] - 1)
    done, most_rounding = 0, 0.0
    before: States | None = None
    for piece in chain([head], pieces):
        fresh = piece._replace(u=piece.u - offset)  # reduces rounding
        states = (
            fresh if before is None else States(*(np.concatenate(x, axis=-1) for x in zip(before, fresh, strict=True)))
        )
        steps = states.u.size
        rounding = check(states, done - (steps - piece.u.size))
        rounding += ROUNDING * (float(np.max(np.abs(piece.u))) + longest(piece.p) * longest(piece.p))
        most_rounding, done = max(most_rounding, rounding), done + piece.u.size
        if steps > halo:
            work = np.empty((works.shape[1], steps)), np.empty((products.shape[1], steps))
            out = np.empty((len(orders), steps - halo))
            shadow_values.compiled(h, states.p, states.g, states.u, weights, works, products, *work, out)
            middle = done - steps + halo // 2
            check_finite(out, "shadow energies", middle, source)  # squares of finite numbers may overflow
            statistics.add(out)
            if keep:
                kept.append(out + offset)
            states = States(*(array[..., steps - halo :] for array in states))
        before = states
        if progress is not None:
            progress(done, source.states or done)
    values = dict(zip(orders, np.concatenate(kept, axis=1), strict=True)) if keep else None
    return ShadowReport(source.label, h, start, done, statistics, offset, most_rounding, values)


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
