"""Error measures: their names, relative distances of solutions and relative changes of quantities."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np

from bseries_base.errors import shorten
from integrators.core.errors import IntegratorError
from integrators.runs.observers import observers
from integrators.scenes.model.blocks import TIME
from integrators.scenes.scene import Scene

SOLUTION, ENERGY = MEASURES = ("solution", "energy")
ROUNDING = 1e-9
"""Smaller errors of runs may be dominated by rounding: 10^6 or more steps each add some 10^-16."""
NOISE = 2.0**-46
"""Energies and their rates below this multiple of their absolute terms are zero up to rounding: 2^-53 for each of some
operations."""


def check_measure(measure: str, known: Sequence[str] = MEASURES) -> str:
    """The name of a measure, checked."""
    if measure not in known:
        raise IntegratorError(f"measure must be one of {', '.join(known)}, but was {shorten(repr(measure))}")
    return measure


def whole_steps(span: float, h: float) -> int:
    """The number of steps of size h that cover a span.

    Example:
        >>> whole_steps(1.0, 0.1), whole_steps(1.0, -0.3), whole_steps(1e-9, 0.1)
        (10, 4, 1)
    """
    return max(1, ceil(span / abs(h) * (1 - 1e-12)))  # h rounded from a decimal needs no further step


def without_time(scene: Scene, y: np.ndarray) -> np.ndarray:
    """The rows of states (variables, n) except that of the time, which has no error."""
    return y if TIME not in scene.places else np.delete(y, scene.places[TIME], axis=0)


def norms(y: np.ndarray) -> np.ndarray:
    """The Euclidean norms of states (variables, n), without overflow or underflow."""
    scales = np.abs(y).max(axis=0)
    return np.linalg.norm(y / np.where(scales == 0, 1.0, scales), axis=0) * scales


def largest_size(y: np.ndarray) -> float:
    """The largest Euclidean norm of states (variables, n) without the time; 1 if all are 0."""
    return float(norms(y).max()) or 1.0


def relative_distances(y: np.ndarray, reference: np.ndarray, size: float | None = None) -> np.ndarray:
    """Distances of states (variables, n) without the time from a reference, relative to its largest norm or a size.

    Example:
        >>> import numpy as np
        >>> relative_distances(np.array([[3.0, 0.0], [4.0, 1.0]]), np.array([[0.0, 0.0], [4.0, 2.0]])).tolist()
        [0.75, 0.25]
    """
    return np.linalg.norm((y - reference) / (largest_size(reference) if size is None else size), axis=0)


def relative_distance(y: np.ndarray, reference: np.ndarray) -> float:
    """The largest of `relative_distances`."""
    return float(relative_distances(y, reference).max())


def relative_change(values: np.ndarray, size: float, reference: np.ndarray | None = None) -> float:
    """The largest distance of values from reference values or from the first value, relative to a size."""
    return float(abs(values - (values[0] if reference is None else reference)).max()) / size


def energy_size(scene: Scene, y0: np.ndarray) -> float:
    """The scale of relative energy changes: |H(y0)|, or 1 if that is zero up to rounding.

    H(y0) counts as zero if |H| is far below Σ |∂H/∂y_i · y_i|, so that it depends on the last bits of y0.

    Example:
        >>> import bseries as bs, numpy as np
        >>> [energy_size(bs.scene("pendulum"), np.array([0.0, q])) for q in (np.pi / 3, np.pi / 2)]
        [0.5000000000000001, 1.0]
    """
    energy = observers(scene, "energy")
    start, shift = float(energy(0.0, y0)[0]), 2.0**-20  # slopes within a factor of two suffice
    with np.errstate(over="ignore", invalid="ignore"):
        shifted = y0 + np.diag(y0 * shift)
        slopes = [abs(float(energy(0.0, y)[0]) - start) / shift for y in shifted]
    return 1.0 if abs(start) <= NOISE * sum(slopes) else abs(start)
