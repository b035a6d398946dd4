"""The shadow energy of a finished trajectory: is the step too large, and does the energy drift?"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.shadow.checks import (
    check_columns,
    check_finite,
    check_potential,
    check_steps,
    finite_number,
    refuse_thinned,
)
from bseries.shadow.files import open_source
from bseries.shadow.formulas import check_order
from bseries.shadow.measurement import LEAST_VALUES, Measurement
from bseries.shadow.roundings import DOUBLE, Roundings
from bseries.shadow.scene_forces import SceneForces
from bseries.shadow.sources import inverse_masses
from bseries.shadow.states import LAYOUTS, MIDDLE, Masses, Reader

if TYPE_CHECKING:
    import numpy as np

    from bseries.shadow.report import ShadowReport
    from bseries.shadow.sources import Columns, Source
    from bseries.shadow.states import Reader, States

CHUNK_NUMBERS = 2**17
"""How many numbers of one kind are worked on at a time: what a processor's cache holds."""
TOLERANCE = 1e-9


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
    """Modified energies of order 2, 4, …, measured along a trajectory that any program computed.

    Steps must be those of the Störmer–Verlet method, kick–drift–kick ("velocity Verlet"), for pᵀM⁻¹p/2 + U(q), and
    every step must be there. A shadow energy of order 2k is constant up to O(h^2k), while the energy itself (order 2)
    goes up and down by O(h²), which hides a drift. Everything streams: memory does not depend on the length.

    Args:
        trajectory: A `Trajectory`; arrays by name, (steps, …) each; or the path of a file: one of this package, any
            NPZ, or text with the names of columns in its first line. It has positions q, momenta p or velocities v,
            the potential U and its gradient gradU or forces F; t, h and mass if they are known.
        scene: A `Scene`, which supplies masses, potentials and forces. Trajectories of this package know theirs.
        order: The largest order, 2 to 24; by default 16, or what a short trajectory allows.
        h: The step size, if neither times nor the file tell it.
        mass: A mass, one for each particle, or one for each coordinate; by default that of the file, or 1.
        columns: What the columns or arrays are called, as in ``{"q": "x*", "U": "PotEng"}``.
        layout: Where momenta are stored: ``full``; ``half-behind`` or ``half-ahead`` of their positions by half a step
            ("leapfrog"); or ``drift-kick-drift`` for states of that method, which needs a scene.
        period: The edge of a periodic box, or one for each coordinate, that positions are wrapped into.
        tolerance: How far a state may be from a step of the method, relative to the largest numbers; by default 1e-9,
            or what the digits of the data show.
        keep: Whether the values themselves are kept, in `ShadowReport.values`.
        progress: Called with the number of states done and of all.

    Returns:
        The report.

    Raises:
        SeriesError: Data are missing, or no consecutive steps of this method; the message says what they seem to be.
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

    measurement = Measurement(reader.states(blocks), order, step, source, keep)
    for done in measurement.advance(check):
        if progress is not None:
            progress(done, source.states or done)
    return measurement.report(start, reader.roundings.energy)


def _reader(source: Source, h: float, mass: Any, layout: str, period: Any) -> Reader:
    """What makes states of the columns of a source, as users say."""

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
    """A number that is not negative."""
    number = finite_number(value, "tolerance")
    if number < 0:
        raise SeriesError(f"tolerance must be 0 or more, but was {value!r:.60}")
    return number


def _timed(source: Source, h: float | None) -> tuple[Iterator[Columns], float, float, float]:
    """The columns of a source, looked at on the way, the step size, how far it may be off, and the first time."""
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
    """The step size of times that may be off, and how far it may be: not at all if they are even."""
    import numpy as np

    step = float(t[-1] - t[0]) / (len(t) - 1)
    is_even = np.all(np.abs(np.diff(t) - step) <= 4 * DOUBLE * np.max(np.abs(t)))
    return step, 0.0 if is_even else 2 * off / (len(t) - 1)
