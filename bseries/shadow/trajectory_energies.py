"""Shadow energies of a finished trajectory: is the step too large, and does the energy drift?"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.shadow import kernels
from bseries.shadow.checks import (
    check_columns,
    check_finite,
    check_potential,
    check_steps,
    finite_number,
    refuse_thinned,
)
from bseries.shadow.files import open_source
from bseries.shadow.formulas import LEAST_ORDER, ShadowFormula, check_order, shadow_formula
from bseries.shadow.report import ShadowReport
from bseries.shadow.roundings import DOUBLE, Roundings
from bseries.shadow.scene_forces import SceneForces
from bseries.shadow.sources import inverse_masses
from bseries.shadow.states import LAYOUTS, MIDDLE, Masses, Reader, States
from bseries.shadow.statistics import Statistics

if TYPE_CHECKING:
    import numpy as np

    from bseries.shadow.sources import Columns, Source

CHUNK_NUMBERS = 2**17
"""Numbers of one kind processed at a time, for the processor's cache."""
TOLERANCE = 1e-9
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
        trajectory: A `Trajectory`; arrays by name, (steps, …) each; or the path of a file: one of this package, any
            NPZ, or text with the names of columns in its first line. It has positions q, momenta p or velocities v,
            the potential U and its gradient gradU or forces F; and optionally t, h and mass.
        scene: A `Scene`, which supplies masses, potentials and forces. Trajectories of this package contain theirs.
        order: The largest order, 2 to 24; by default 16, or what a short trajectory allows.
        h: The step size, if neither times nor the file contain it.
        mass: A mass, one for each particle, or one for each coordinate; by default that of the file, or 1.
        columns: The names of columns or arrays, as in ``{"q": "x*", "U": "PotEng"}``.
        layout: The storage layout of momenta: ``full``; ``half-behind`` or ``half-ahead`` of their positions by half a
            step ("leapfrog"); or ``drift-kick-drift`` for states of that method, which needs a scene.
        period: The edge of the periodic box of wrapped positions, or one for each coordinate.
        tolerance: The largest distance of a state from a step of the method, relative to the largest numbers; by
            default 1e-9, or according to the digits of the data.
        keep: Whether to keep the values, in `ShadowReport.values`.
        progress: Called with the number of states done and of all.

    Returns:
        The report.

    Raises:
        SeriesError: Data are missing, or not consecutive steps of this method; the message contains a diagnosis.
        IntegratorError: A file or a scene cannot be used.

    Example:
        >>> from integrators import integrate, scene
        >>> run = integrate(scene("pendulum"), "stormer-verlet", h=0.1, steps=2000)
        >>> report = shadow_energy(run, order=6)
        >>> print(*(f"{row.order}: {row.deviation:.0e}" for row in report.rows))
        2: 1e-03 4: 5e-06 6: 3e-08

    References:
        Skeel, Hardy, SIAM J. Sci. Comput. 23 (2001) 1172, doi:10.1137/S106482750138318X; Engle, Skeel, Drees, J.
        Comput. Phys. 206 (2005) 432, doi:10.1016/j.jcp.2004.12.009.
    """
    if order is not None:
        check_order(order)
    allowed = None if tolerance is None else _tolerance(tolerance)
    if progress is not None and not callable(progress):
        raise SeriesError(f"progress must be a function of two numbers, but was {progress!r:.60}")
    source = open_source(trajectory, columns, None if scene is None else SceneForces(scene))
    blocks, step, off_h, start = _timed(source, h)
    reader = _reader(source, step, mass, layout, period)

    def check(states: States, first: int) -> None:
        off = reader.roundings._replace(h=off_h)
        usual = (TOLERANCE, off) if allowed is None else (allowed, Roundings())
        check_steps(states, step, first, *usual, source, layout)
        if first == 0:
            check_potential(states, off, source)

    measurement = _Measurement(reader.states(blocks), order, step, source, keep)
    for done in measurement.advance(check):
        if progress is not None:
            progress(done, source.states or done)
    return measurement.report(start, reader.roundings.energy)


def _reader(source: Source, h: float, mass: Any, layout: str, period: Any) -> Reader:
    """The conversion of the columns of a source to states, according to the options."""
    if layout not in LAYOUTS:
        raise SeriesError(f"layout must be one of {', '.join(LAYOUTS)}, but was {layout!r:.60}")
    edges = _box_edges(period, source.dimension)
    if source.forces is None:
        if layout == MIDDLE:
            raise SeriesError("scene must be given for the layout drift-kick-drift, whose forces are at half steps")
        inverse = inverse_masses(source.mass if mass is None else mass, source.dimension)
    elif mass is None:
        inverse = source.forces.inverse_masses
        if len(inverse) != source.dimension:
            raise SeriesError(
                f"q must have the shape (states, {len(inverse)}), as the scene has {len(inverse)} positions, but has "
                f"{source.dimension} numbers for each state"
            )
    else:
        raise SeriesError("mass must be left out where a scene is given, which has masses, but was given")
    return Reader(Masses(inverse), h, source, layout, edges)


def _box_edges(period: Any, dimension: int) -> np.ndarray | None:
    """The edges of a periodic box, one for each coordinate; None if there is no box."""
    if period is None:
        return None
    import numpy as np

    try:
        edges = np.asarray(period, dtype=float).reshape(-1)
    except (TypeError, ValueError, OverflowError):
        raise SeriesError(f"period must be numbers, but was {period!r:.60}") from None
    if not len(edges) or dimension % len(edges) or not (np.all(edges > 0) and np.all(np.isfinite(edges))):
        raise SeriesError(
            f"period must be a positive number, or one for each dimension or coordinate, but was {period!r:.60}"
        )
    return np.tile(edges, dimension // len(edges))


def _tolerance(value: Any) -> float:
    """A nonnegative number."""
    number = finite_number(value, "tolerance")
    if number < 0:
        raise SeriesError(f"tolerance must be 0 or more, but was {value!r:.60}")
    return number


def _timed(source: Source, h: float | None) -> tuple[Iterator[Columns], float, float, float]:
    """The checked columns of a source, the step size, its rounding bound, and the first time."""
    import numpy as np

    blocks = source.blocks(max(256, CHUNK_NUMBERS // source.dimension))
    head = next(blocks, None)
    if head is None or len(head["q"]) < 2:
        raise SeriesError(f"{source.label} must have at least {LEAST_VALUES + 2} states, but has fewer than 2")
    if source.every != 1:
        refuse_thinned(source, f"are every {source.every}th of a run" if source.every else "are its start and end")
    t = head.get("t")
    if h is not None:
        step, off = finite_number(h, "h"), 0.0
    elif source.h is not None:
        step, off = source.h, float(source.off("h", np.array([source.h])))
    elif t is not None:
        check_finite(t, "times", 0, source)
        step, off = _step_of(t, float(source.off("t", t)))
    else:
        raise SeriesError(f"h must be given where there are no times, but {source.label} has none")
    if step == 0 or not math.isfinite(step):
        raise SeriesError(f"h must be a finite number other than 0, but was {step:g}")

    def checked() -> Iterator[Columns]:
        first, before = 0, None
        for columns in chain([head], blocks):
            check_columns(columns, before, step, first, source)
            first, before = first + len(columns["q"]), None if t is None else float(columns["t"][-1])
            yield columns

    return checked(), step, off, 0.0 if t is None else float(t[0])


def _step_of(t: np.ndarray, off: float) -> tuple[float, float]:
    """The step size of times with rounding errors, and its rounding bound; 0 if they are equidistant."""
    import numpy as np

    step = float(t[-1] - t[0]) / (len(t) - 1)
    is_even = np.all(np.abs(np.diff(t) - step) <= 4 * DOUBLE * np.max(np.abs(t)))
    return step, 0.0 if is_even else 2 * off / (len(t) - 1)


class _Measurement:
    """One pass over states.

    Args:
        pieces: The states, in pieces.
        order: The largest order; None for the usual one, or the largest that a short trajectory allows.
        h: The step size.
        source: The source of the states.
        keep: Whether values are kept.
    """

    def __init__(self, pieces: Iterator[States], order: int | None, h: float, source: Source, keep: bool):
        self._pieces, self._h, self._source, self._kept = pieces, h, source, [] if keep else None
        self._head = next(pieces)
        self.orders = _orders(order, self._head.u.size, source)
        self._offset = float(self._head.u[0])
        self.statistics, self.done = Statistics(self.orders), 0

    def advance(self, check: Callable[[States, int], None]) -> Iterator[int]:
        """Process the states; after each piece, yield the number of states so far."""
        import numpy as np

        weights, works, products = formula_arrays([shadow_formula(order) for order in self.orders])
        halo = 2 * (weights.shape[1] - 1)
        before: States | None = None
        for piece in chain([self._head], self._pieces):
            fresh = piece._replace(u=piece.u - self._offset)  # reduces rounding
            states = fresh if before is None else States(*map(_joined, before, fresh))
            steps = states.u.size
            check(states, self.done - (steps - piece.u.size))
            self.done += piece.u.size
            if steps > halo:
                work = np.empty((works.shape[1], steps)), np.empty((products.shape[1], steps))
                out = np.empty((len(self.orders), steps - halo))
                kernels.shadow_values.compiled(
                    self._h, states.p, states.g, states.u, weights, works, products, *work, out
                )
                middle = self.done - steps + halo // 2
                check_finite(out, "shadow energies", middle, self._source)  # squares of finite numbers may overflow
                self.statistics.add(out)
                if self._kept is not None:
                    self._kept.append(out + self._offset)
                states = States(*(array[..., steps - halo :] for array in states))
            before = states
            yield self.done

    def report(self, start: float, rounding: float) -> ShadowReport:
        """The report, with the time of the first state and the bound of rounding errors of energies."""
        import numpy as np

        values = None
        if self._kept is not None:
            values = dict(zip(self.orders, np.concatenate(self._kept, axis=1), strict=True))
        known = self._offset, rounding, values
        return ShadowReport(self._source.label, self._h, start, self.done, self.statistics, *known)


def _joined(before: np.ndarray, piece: np.ndarray) -> np.ndarray:
    import numpy as np

    return np.concatenate((before, piece), axis=-1)


def formula_arrays(formulas: Sequence[ShadowFormula]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The arrays `weights`, `works` and `products` of `kernels.shadow_values` for several orders."""
    import numpy as np

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
