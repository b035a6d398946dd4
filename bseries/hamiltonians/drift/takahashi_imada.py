"""The integral over a period that decides whether the energy of the simplified Takahashi–Imada method drifts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.integration import antiderivative
from bseries.hamiltonians.drift.forms import common_period, rise

if TYPE_CHECKING:
    import sympy

    from integrators.scenes.scene import Scene


def takahashi_imada_integral(scene: Scene) -> sympy.Expr:
    """∫ U‴ U′² dq over a period of the potential U of a scene H = T(p) + U(q) with one degree of freedom.

    With f = −U′ the simplified method's force differs from the symplectic one's by h⁴α²/2 f″(f, f) = −h⁴α²/2 U‴U′². In
    every forward period the modified Hamiltonian of the symplectic method, and the energy, therefore gain −h⁴α²/2 times
    this integral to leading order. If it is not zero, the energy drifts on rotating orbits.

    Args:
        scene: The scene; parameters may be symbols (for a period 2π/k with k taken as positive).

    Returns:
        The integral, exact.

    Raises:
        SeriesError: The scene is not of this kind, or the formula cannot be integrated.

    Example:
        >>> import bseries as bs
        >>> takahashi_imada_integral(bs.scene("pendulum", effects=["asymmetry"]))
        6*pi/5
        >>> takahashi_imada_integral(bs.scene("pendulum", effects=["asymmetry"], epsilon="epsilon"))
        6*pi*epsilon
        >>> takahashi_imada_integral(bs.scene("pendulum"))
        0

    References:
        E. Hairer, R. I. McLachlan, R. D. Skeel, ESAIM: M2AN 43 (2009) 631–644, doi:10.1051/m2an/2009019.
    """
    potential, q = _potential(scene)
    period = common_period([potential], q)
    if period is None:
        raise SeriesError(
            f"scene must have a potential that is periodic in {q}, but {scene.name} has {potential!s:.60}"
        )
    found = antiderivative((potential.diff(q, 3) * potential.diff(q) ** 2).expand(), q)
    if found is None:
        raise SeriesError(f"scene must have a potential simple enough to integrate, but {scene.name} has not")
    return rise(found, q, period)


def _potential(scene: Scene) -> tuple[Any, sympy.Symbol]:
    """U and q."""
    energy = scene.hamiltonian
    if energy is None or scene.poisson is not None or scene.dimension != 2:
        raise SeriesError(f"scene must be canonical with one degree of freedom, but {scene.name} is not")
    p, q = scene.symbols
    potential = energy.subs(p, 0)
    if (energy - potential).expand().has(q):
        raise SeriesError(f"scene must have a Hamiltonian T(p) + U(q), but {scene.name} has {energy!s:.60}")
    return potential, q
