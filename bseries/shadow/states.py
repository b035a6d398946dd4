"""Mass-weighted states at full steps of kick–drift–kick, from the columns of a trajectory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exceptions import SeriesError
from bseries.shadow.roundings import Roundings

if TYPE_CHECKING:
    import numpy as np

    from bseries.shadow.sources import Columns, Source

FULL, BEHIND, AHEAD, MIDDLE = "full", "half-behind", "half-ahead", "drift-kick-drift"
LAYOUTS = (FULL, BEHIND, AHEAD, MIDDLE)
"""Storage of momenta: with their positions; half a step before or after them; or for the other kind of step."""
AGREES = 1e-9
"""Largest relative difference of two columns for the same quantity."""


class States(NamedTuple):
    """Consecutive states, mass-weighted as in `kernels`: arrays (coordinates, steps), and (steps,) for u."""

    q: np.ndarray
    p: np.ndarray
    g: np.ndarray
    u: np.ndarray


class Masses:
    """The kinetic energy, as the factor L of M⁻¹ = L Lᵀ: mass-weighted momenta are Lᵀp.

    Args:
        inverse: The matrix M⁻¹, or its diagonal.

    Raises:
        SeriesError: It is not positive definite.
    """

    def __init__(self, inverse: np.ndarray):
        import numpy as np

        if inverse.ndim == 2 and not np.any(inverse - np.diag(np.diag(inverse))):
            inverse = np.diag(inverse)
        try:
            if inverse.ndim == 1 and not (np.all(inverse > 0) and np.all(np.isfinite(inverse))):
                raise np.linalg.LinAlgError
            self._factor = np.sqrt(inverse) if inverse.ndim == 1 else np.linalg.cholesky(inverse)
        except np.linalg.LinAlgError:
            raise SeriesError("mass must be positive, but that of some coordinate was not") from None
        self._inverse = 1 / self._factor if inverse.ndim == 1 else np.linalg.inv(self._factor)

    def of_momenta(self, rows: np.ndarray) -> np.ndarray:
        """Momenta or gradients (steps, coordinates) as columns, mass-weighted."""
        return _weighted(rows, self._factor)

    def of_positions(self, rows: np.ndarray) -> np.ndarray:
        """Positions or velocities (steps, coordinates) as columns, mass-weighted."""
        return _weighted(rows, self._inverse.T)

    def off_momenta(self, off: np.ndarray) -> np.ndarray:
        """Rounding bounds of mass-weighted momenta, from those of each coordinate."""
        return _weighted(off[None], abs(self._factor))[:, 0]

    def off_positions(self, off: np.ndarray) -> np.ndarray:
        """Rounding bounds of mass-weighted positions, from those of each coordinate."""
        return _weighted(off[None], abs(self._inverse.T))[:, 0]

    def positions(self, columns: np.ndarray) -> np.ndarray:
        """Rows of positions from mass-weighted columns."""
        factor = self._factor
        return (columns * factor[:, None]).T if factor.ndim == 1 else columns.T @ factor.T


def _weighted(rows: np.ndarray, factor: np.ndarray) -> np.ndarray:
    import numpy as np

    if factor.ndim == 1:
        return np.multiply(rows.T, factor[:, None], order="C")
    return np.ascontiguousarray((rows @ factor).T)


class Reader:
    """Conversion of columns to states.

    Args:
        masses: The masses.
        h: The step size.
        source: The source of the columns, with forces of its own unless it has a scene.
        layout: The storage layout of momenta.
        period: The edge of a periodic box, or one for each coordinate; None if positions are not wrapped.

    Attributes:
        roundings: Rounding bounds of the states read so far.
    """

    def __init__(self, masses: Masses, h: float, source: Source, layout: str, period: Any):
        self._masses, self._h, self._source, self._layout, self._period = masses, h, source, layout, period
        self._last: Any = None
        self._crossings: Any = 0.0
        self.roundings = Roundings()

    def states(self, blocks: Iterator[Columns]) -> Iterator[States]:
        """The states of all columns, block by block."""
        return map(self._read, blocks)

    def _read(self, columns: Columns) -> States:
        import numpy as np

        masses, half = self._masses, 0.5 * self._h
        q = columns["q"] if self._period is None else self._unwrapped(columns["q"])
        p, off_p = self._weighted_role(columns, "p", "v", "p = M v")
        weighted = masses.of_positions(q)
        off_q = masses.off_positions(self._source.off("q", columns["q"]))
        if self._layout == MIDDLE:
            weighted += half * p
            q = masses.positions(weighted)
        if self._source.forces is not None:
            gradients, u = self._source.forces(np.ascontiguousarray(q))
            g = masses.of_momenta(gradients)
            off_g = _steepness(weighted, g) * np.max(off_q)
        else:
            g, off_g = self._weighted_role(columns, "gradU", "F", "gradU = -F")
            u = columns["U"]
        if self._layout != FULL:
            p += half * g if self._layout == AHEAD else -half * g
        states = States(weighted, p, g, u)
        self._note(states, off_q, off_p, off_g)
        return states

    def _weighted_role(self, columns: Columns, one: str, other: str, relation: str) -> tuple[np.ndarray, np.ndarray]:
        """Mass-weighted momenta or gradients from the available role, with their rounding bounds."""
        import numpy as np

        found = []
        for role in (one, other):
            if role in columns:
                is_velocity, rows = role == "v", columns[role]
                weigh = self._masses.of_positions if is_velocity else self._masses.of_momenta
                spread = self._masses.off_positions if is_velocity else self._masses.off_momenta
                found.append((weigh(-rows if role == "F" else rows), spread(self._source.off(role, rows))))
        if len(found) == 2:
            (first, off), (second, more) = found
            allowed = AGREES * np.max(np.abs(first)) + off + more
            if not np.all(np.abs(first - second) <= allowed[:, None]):
                label = self._source.label
                raise SeriesError(
                    f"{label} must have {relation}, but its {one} and {other} differ (columns chooses one)"
                )
        return found[0]

    def _note(self, states: States, off_q: np.ndarray, off_p: np.ndarray, off_g: Any) -> None:
        """Update the rounding bounds of states and of their energies, whose contributions may have any sign."""
        import numpy as np

        off_u, forces = self._source.off("U", states.u), self._source.forces
        half, q, p, g = 0.5 * abs(self._h), *(float(np.max(off)) for off in (off_q, off_p, off_g))
        energy = float(off_u) + p * longest(states.p) + (0.0 if forces is None else q * longest(states.g))
        fresh = Roundings(
            q + (half * p if self._layout == MIDDLE else 0.0),
            p + (half * g if self._layout != FULL else 0.0),
            g,
            energy,
        )
        self.roundings = Roundings(*map(max, self.roundings, fresh))

    def _unwrapped(self, q: np.ndarray) -> np.ndarray:
        """Positions that continue where they jump to the other side of the box."""
        import numpy as np

        before = q[:1] if self._last is None else self._last
        self._crossings = self._crossings + np.cumsum(
            np.round(np.diff(q, axis=0, prepend=before) / self._period), axis=0
        )
        self._last, shifted = q[-1:].copy(), q - self._period * self._crossings
        self._crossings = self._crossings[-1:]
        return shifted


def longest(columns: np.ndarray) -> float:
    """The length of the longest column, without overflow."""
    import numpy as np

    most = float(np.max(np.abs(columns)))
    return most * float(np.sqrt(np.max(np.sum((columns / most) ** 2, axis=0)))) if most else 0.0


def _steepness(q: np.ndarray, g: np.ndarray) -> float:
    """The largest change of gradients relative to that of positions."""
    import numpy as np

    moved, changed = (np.max(np.abs(np.diff(array)), axis=0) for array in (q, g))
    return float(np.max(changed[moved > 0] / moved[moved > 0], initial=0.0))
