"""Truncation of modified equations: radius of convergence, optimal order, remaining error.

On linear systems the modified equation converges up to the nearest zero or pole of the stability function.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bseries.analysis.stability.criteria import stability_function
from bseries.analysis.stability.rational_functions import StabilityFunction
from bseries.exceptions import SeriesError
from bseries.fields.inputs import read_states, read_step
from bseries.fields.modified_fields import SceneSeries, check_field, modified_field
from bseries.fields.term_sizes import Reach, TruncationWarning, term_norms, too_long
from bseries_base.errors import shown, warn_user
from integrators.methods.tableaux.runge_kutta import RungeKutta
from integrators.scenes.particles.parts import Piece, degrees

CANCELLATION = 1e-6  # relative distance below which a zero and a pole of an inexact function cancel


class ConvergenceRadius(NamedTuple):
    """Radius of convergence of the modified equation on y' = λy: it converges for |hλ| < radius.

    Attributes:
        radius: The radius, infinite if the stability function has neither zeros nor poles.
        root: The nearest zero or pole, with imaginary part ≥ 0.
        kind: ``"zero"``, ``"pole"`` or ``"none"``.

    Example:
        >>> import bseries as bs
        >>> found = bs.fields.convergence_radius(bs.method("implicit-euler"))
        >>> found.radius, found.root, found.kind
        (1.0, (1+0j), 'pole')
    """

    radius: float
    root: complex | None
    kind: str

    def __str__(self) -> str:
        if self.root is None:
            return "∞: the stability function has neither zeros nor poles"
        number = f"{self.root:.6g}" if self.root.imag else f"{self.root.real:.6g}"
        return f"{self.radius:.6g}, from the {self.kind} {number} of the stability function"


def convergence_radius(method: RungeKutta | str) -> ConvergenceRadius:
    """Radius of convergence of the modified equation of a method on linear systems.

    With the stability function R, the modified equation of y' = Ay is y' = (1/h) log R(hA) y. The logarithm is analytic
    in the largest disk without zeros or poles of R.

    Args:
        method: A Runge–Kutta method.

    Returns:
        The absolute value of the zero or pole of R nearest to 0, with that root.

    Raises:
        IntegratorError: The method is not a `RungeKutta`, or has symbols.

    Example:
        >>> import bseries as bs
        >>> print(bs.fields.convergence_radius(bs.method("rk4")))
        1.94454, from the zero -1.72944+0.888974j of the stability function
        >>> print(bs.fields.convergence_radius(bs.method("implicit-midpoint")))
        2, from the zero -2 of the stability function

    References:
        HLW, section IX.1; E. Hairer, lecture on long-time behaviour, example 3.
    """
    R = stability_function(method)
    inverse = StabilityFunction.from_elements(R.q, R.p, floating=R.floating, digits=R.digits)
    zeros, poles = inverse.poles, R.poles
    if R.floating or R.digits is not None:
        zeros, poles = _uncancelled(zeros, poles), _uncancelled(poles, zeros)
    roots = [(abs(z), z, kind) for kind, places in (("zero", zeros), ("pole", poles)) for z in places]
    if not roots:
        return ConvergenceRadius(math.inf, None, "none")
    radius, root, kind = min(roots, key=lambda found: found[0])
    return ConvergenceRadius(radius, complex(root.real, abs(root.imag)), kind)


def _uncancelled(roots: Sequence[complex], others: Sequence[complex]) -> list[complex]:
    """The roots that no other root cancels: reducible methods have common factors, up to rounding."""
    return [z for z in roots if all(abs(z - other) > CANCELLATION * abs(z) for other in others)]


def reach(f: SceneSeries, y: ArrayLike, h: float, *, method: RungeKutta | None = None) -> Reach:
    """Sizes of the terms of a truncated field at a point, its optimal truncation and its error.

    Args:
        f: A field such as a `modified_field`.
        y: The state.
        h: The step size.
        method: The method of a modified equation: on linear scenes `convergence_radius` then decides convergence
            instead of the sizes of terms.

    Returns:
        The sizes and the quantities derived from them. A `TruncationWarning` is given if the order exceeds the optimum.

    Raises:
        SeriesError: `f` is not a field, `h` is 0 or not a number, `y` has the wrong shape or is outside the domain of
            f, or `f` is not the modified equation of `method` (checked on linear scenes).
        IntegratorError: `method` is not a Runge–Kutta method.

    Example:
        >>> import bseries as bs
        >>> euler = bs.modified_field(bs.method("explicit-euler"), bs.scene("riccati"), 4)
        >>> print(bs.fields.reach(euler, [1.0], 0.1))
        the modified equation of explicit-euler on riccati, h = 0.1
        power   size
        h^0     1
        h^1     0.1
        h^2     0.015
        h^3     0.00267   optimal
        order 4: not beyond the optimum, next term about 4.7e-04; largest h for it: 0.612

    References:
        HLW, section IX.7 (the optimal truncation index).
    """
    states, shape = read_states(y, check_field(f).dimension)
    if shape != (f.dimension,):
        raise SeriesError(f"y must have the shape ({f.dimension},), but had {shape}")
    if not np.isfinite(states).all():
        raise SeriesError(f"y must be finite numbers, but was {shown(y)}")
    norms = term_norms(f, states)[0]
    for k, norm in enumerate(norms):
        if not math.isfinite(norm):
            raise SeriesError(f"y must be where all terms of f are finite, but that with h^{k} was {norm}")
    step = read_step(h)
    if step == 0:
        raise SeriesError(f"h must be a finite number other than 0, but was {h!r:.60}")
    found = Reach(f"{f.label} on {f.scene.name}", step, norms)
    if method is not None:
        radius, spectral = convergence_radius(method).radius, _spectral_radius(f, method)
        found = found._replace(spectral_radius=spectral, radius=None if spectral is None else radius)
    if not all(map(math.isfinite, found.sizes)):
        raise SeriesError(f"h must be small enough for finite terms, but was {step:g}")
    if found.is_beyond:
        if found.converges is None:
            message = too_long(found)
        else:
            product = abs(step) * (found.spectral_radius or 0.0)
            message = f"diverges: h times the spectral radius must be below {found.radius:.6g}, but was {product:g}"
        warn_user(f"{found.label} {message}", TruncationWarning)
    return found


def _spectral_radius(f: SceneSeries, method: RungeKutta) -> float | None:
    """The spectral radius of A on a scene y' = Ay + b; None for others. It checks that f belongs to the method."""
    degree = degrees(f.scene, [Piece()])[0][0]
    if degree is None or degree > 1:
        return None
    points = np.column_stack([np.zeros(f.dimension), np.eye(f.dimension)])
    values = f.terms(points)
    if not np.allclose(values, modified_field(method, f.scene, f.order).terms(points), rtol=1e-9):
        raise SeriesError(f"method must be the one that f is the modified equation of, but was {method.name}")
    matrix = values[0, :, 1:] - values[0, :, :1]
    return float(np.abs(np.linalg.eigvals(matrix)).max())
