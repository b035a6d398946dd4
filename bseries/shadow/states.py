"""Mass-weighted states at full steps of kick–drift–kick, from the columns of a trajectory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from bseries.exceptions import SeriesError
from bseries.shadow.sources import Columns, Source

FULL, BEHIND, AHEAD, MIDDLE = "full", "half-behind", "half-ahead", "drift-kick-drift"
LAYOUTS = (FULL, BEHIND, AHEAD, MIDDLE)
"""Storage of momenta: with their positions; half a step before or after them; or for the other kind of step."""


class States(NamedTuple):
    """Consecutive states: arrays (coordinates, steps), and (steps,) for u.

    They are mass-weighted, q̂ = M^(1/2) q, p̂ = M^(−1/2) p, ĝ = M^(−1/2) ∇U, so that masses do not appear.
    """

    q: np.ndarray
    p: np.ndarray
    g: np.ndarray
    u: np.ndarray


class Masses:
    """The kinetic energy, as the factor L of M⁻¹ = L Lᵀ, for M⁻¹ or its diagonal: mass-weighted momenta are Lᵀp."""

    def __init__(self, inverse: np.ndarray):
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

    def positions(self, columns: np.ndarray) -> np.ndarray:
        """Rows of positions from mass-weighted columns."""
        return _weighted(columns.T, self._factor.T).T


def _weighted(rows: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """The columns of rows times a factor, which is a matrix or its diagonal."""
    if factor.ndim == 1:
        return np.multiply(rows.T, factor[:, None], order="C")
    return np.ascontiguousarray((rows @ factor).T)


def read_states(
    blocks: Iterator[Columns], masses: Masses, h: float, source: Source, layout: str, period: Any
) -> Iterator[States]:
    """The states of successive blocks of columns; `period` is the box for each coordinate, or None."""
    last, crossings = None, 0.0
    for columns in blocks:
        p = masses.of_momenta(columns["p"]) if "p" in columns else masses.of_positions(columns["v"])
        q = columns["q"]
        if period is not None:  # positions continue where they jump to the other side of the box
            jumps = np.round(np.diff(q, axis=0, prepend=q[:1] if last is None else last) / period)
            crossings = np.cumsum(jumps, axis=0) + crossings
            last, q, crossings = q[-1:].copy(), q - period * crossings, crossings[-1:]
        weighted = masses.of_positions(q)
        if layout == MIDDLE:
            weighted += 0.5 * h * p
            q = masses.positions(weighted)
        if source.forces is not None:
            gradients, u = source.forces(np.ascontiguousarray(q))
        else:
            gradients, u = columns["gradU"] if "gradU" in columns else -columns["F"], columns["U"]
        g = masses.of_momenta(gradients)
        if layout != FULL:
            p += (0.5 if layout == AHEAD else -0.5) * h * g
        yield States(weighted, p, g, u)


def longest(columns: np.ndarray) -> float:
    """The length of the longest column, without overflow."""
    most = float(np.max(np.abs(columns)))
    return most * float(np.sqrt(np.max(np.sum((columns / most) ** 2, axis=0)))) if most else 0.0


def positive_numbers(value: Any, argument: str, dimension: int) -> np.ndarray:
    """One positive number, or one for each particle, dimension of space or coordinate."""
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
    return values
