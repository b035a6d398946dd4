"""What a page draws of a scene: a plane of two variables, angles, areas, and the range of step sizes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import sympy

from integrators.scenes.scene import Scene

OSCILLATION = 2.0
"""The largest h is this over the size of the Jacobian at the start: where Störmer–Verlet becomes unstable."""
RESOLVED = 1e-3
"""Of a resolved curve, coefficients in the upper third of frequencies are as much smaller than the largest."""


class Plane(NamedTuple):
    """Two variables of a scene, by their indices: `x` is None for the time.

    Attributes:
        x, y: The variables on the axes of orbits.
        conjugate: The pair (q, p) in whose plane a patch of initial values lies; None in scenes of one variable.
        pairs: All pairs (q, p), over which areas are summed; none where areas have no meaning.
    """

    x: int | None
    y: int
    conjugate: tuple[int, int] | None
    pairs: tuple[tuple[int, int], ...]


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


def area_primitive(scene: Scene) -> Any:
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

    Args:
        form: Values at points with equal differences of the curve's parameter.
        q: Values of the variable there.

    Example:
        >>> import numpy as np
        >>> angle = np.arange(16) * np.pi / 8
        >>> round(enclosed_area(3 * np.sin(angle), np.cos(angle)) / np.pi, 12)
        -3.0
    """
    waves = np.fft.rfft([form, q])
    sizes = abs(waves[:, 1:])
    if not (sizes[:, 2 * sizes.shape[1] // 3 :].max() <= RESOLVED * sizes.max()):
        return math.nan
    slope = np.fft.irfft(1j * np.arange(waves.shape[1]) * waves[1], n=len(q))
    return float(2 * math.pi * np.mean(form * slope))


def largest_step(jacobian: np.ndarray) -> float:
    """The largest step size of a page, of one digit, from the Jacobian of the field at the start."""
    size = max(abs(np.linalg.eigvals(jacobian))) if np.isfinite(jacobian).all() else 1.0
    return float(f"{min(OSCILLATION / max(size, 1e-3), 2.0):.1g}")
