"""Relative distances of solutions and relative changes of quantities."""

from __future__ import annotations

from typing import TYPE_CHECKING

from integrators.runs.observers import observers
from integrators.scenes.model.blocks import TIME

if TYPE_CHECKING:
    import numpy as np

    from integrators.scenes.scene import Scene

SHIFT, NOISE = 2.0**-20, 2.0**-46
"""Relative shift of variables for derivatives, and the relative size at which an energy is only rounding."""


def without_time(scene: Scene, y: np.ndarray) -> np.ndarray:
    """The rows of states (variables, n) except that of the time, which has no error."""
    import numpy as np

    return y if TIME not in scene.places else np.delete(y, scene.places[TIME], axis=0)


def norms(y: np.ndarray) -> np.ndarray:
    """The Euclidean norms of states (variables, n), without overflow or underflow.

    Example:
        >>> import numpy as np
        >>> norms(np.array([[3e-200, 0.0], [4e-200, 1e200]])).tolist()
        [5e-200, 1e+200]
    """
    import numpy as np

    scales = np.abs(y).max(axis=0)
    scales[scales == 0] = 1.0
    return np.linalg.norm(y / scales, axis=0) * scales


def largest_size(y: np.ndarray) -> float:
    """The largest Euclidean norm of states (variables, n) without the time; 1 if all are 0."""
    return float(norms(y).max()) or 1.0


def relative_distances(y: np.ndarray, reference: np.ndarray, size: float | None = None) -> np.ndarray:
    """Distances of states (variables, n) without the time from reference states, relative to a size.

    Args:
        y: The states.
        reference: The reference states, at the same times.
        size: The size; by default the largest norm of the reference.

    Example:
        >>> import numpy as np
        >>> relative_distances(np.array([[3.0, 0.0], [4.0, 1.0]]), np.array([[0.0, 0.0], [4.0, 2.0]])).tolist()
        [0.75, 0.25]
    """
    import numpy as np

    return np.linalg.norm((y - reference) / (largest_size(reference) if size is None else size), axis=0)


def relative_distance(y: np.ndarray, reference: np.ndarray) -> float:
    """The largest of `relative_distances`."""
    return float(relative_distances(y, reference).max())


def energy_size(scene: Scene, y0: np.ndarray) -> float:
    """The scale of relative energy changes: |H(y0)|, or 1 if that is zero up to rounding.

    H(y0) is rounding where |H| is far below Σ |∂H/∂y_i · y_i|, so that the last bits of y0 decide about it.

    Example:
        >>> import bseries as bs, numpy as np
        >>> [energy_size(bs.scene("pendulum"), np.array([0.0, q])) for q in (np.pi / 3, np.pi / 2)]
        [0.5000000000000001, 1.0]
    """
    import numpy as np

    energy = observers(scene, "energy")
    start = float(energy(0.0, y0)[0])
    with np.errstate(over="ignore", invalid="ignore"):
        shifted = y0 + np.diag(y0 * SHIFT)
        slopes = [abs(float(energy(0.0, y)[0]) - start) / SHIFT for y in shifted]
    return 1.0 if abs(start) <= NOISE * sum(slopes) else abs(start)


def relative_change(values: np.ndarray, size: float, reference: np.ndarray | None = None) -> float:
    """The largest change of a quantity, or its largest distance from a reference, relative to a size.

    Args:
        values: The values, (n,).
        size: The size.
        reference: The reference values, at the same times; by default the first value.

    Example:
        >>> import numpy as np
        >>> relative_change(np.array([-2.0, -2.5, -1.0]), 2.0)
        0.5
    """
    return float(abs(values - (values[0] if reference is None else reference)).max()) / size
