"""Where the modified equation of a method converges: on linear systems, up to zeros and poles of R."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from bseries.analysis.stability.linear_stability import stability_function
from bseries.analysis.stability.rational_functions import StabilityFunction

if TYPE_CHECKING:
    from integrators import RungeKutta

COMMON = 1e-6
"""So near, relative to their size, a zero and a pole of an inexact function count as one root of both."""


class ConvergenceRadius(NamedTuple):
    """Where the modified equation of a method converges on y' = λy: for |hλ| < radius.

    Attributes:
        radius: The radius; infinite if the stability function has neither zeros nor poles.
        root: The nearest of them, with imaginary part ≥ 0.
        kind: Which it is: ``"zero"`` or ``"pole"``, or ``"none"``.

    Example:
        >>> import bseries as bs
        >>> found = bs.convergence_radius(bs.method("implicit-euler"))
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


def convergence_radius(method: RungeKutta) -> ConvergenceRadius:
    """The radius of convergence of log R(z), and so of the modified equation of a method on linear systems.

    With R the stability function, the modified equation of y' = Ay is y' = (1/h) log R(hA) y. The logarithm is analytic
    in the disk without zeros and poles of R.

    Args:
        method: A Runge–Kutta method.

    Returns:
        The absolute value of the zero or pole of R that is nearest to 0, and which this is.

    Raises:
        IntegratorError: The method is no `RungeKutta`, or has symbols.

    Example:
        >>> import bseries as bs
        >>> print(bs.convergence_radius(bs.method("rk4")))
        1.94454, from the zero -1.72944+0.888974j of the stability function
        >>> print(bs.convergence_radius(bs.method("implicit-midpoint")))
        2, from the zero -2 of the stability function

    References:
        HLW, section IX.1; E. Hairer, lecture on long-time behaviour, example 3.
    """

    R = stability_function(method)
    inverse = StabilityFunction.from_elements(R.q, R.p, floating=R.floating, digits=R.digits)
    zeros, poles = inverse.poles, R.poles
    if R.floating or R.digits is not None:
        zeros, poles = _without_common(zeros, poles), _without_common(poles, zeros)
    roots = [(abs(z), z, kind) for kind, places in (("zero", zeros), ("pole", poles)) for z in places]
    if not roots:
        return ConvergenceRadius(math.inf, None, "none")
    radius, root, kind = min(roots, key=lambda found: found[0])
    return ConvergenceRadius(radius, complex(root.real, abs(root.imag)), kind)


def _without_common(roots: Sequence[complex], others: Sequence[complex]) -> list[complex]:
    """The roots that none of the others cancels: reducible methods have factors in common, up to their digits."""
    return [z for z in roots if all(abs(z - other) > COMMON * abs(z) for other in others)]
