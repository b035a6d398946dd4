"""The Hénon–Heiles model of a star in a galaxy."""

from __future__ import annotations

from typing import Any

from ..errors import IntegratorError
from ..expressions import shorten
from .base import Scene
from .formulas import read_formula

SUMMARY = "the Hénon–Heiles model: regular orbits at low energies, chaos towards 1/6"
REFERENCE = "M. Hénon, C. Heiles, Astron. J. 69 (1964) 73, doi:10.1086/109234; HLW, section I.3"
LEAST_ENERGY = "7/1500"
"""The potential where orbits start, at q = (0, 1/10)."""


def henon_heiles(*, energy: Any = "1/12") -> Scene:
    """H = (|p|² + |q|²)/2 + q1² q2 − q2³/3, from q = (0, 1/10) in the direction of q1.

    Args:
        energy: H at the start, which orbits below 1/6 cannot leave for infinity.

    Raises:
        IntegratorError: `energy` is no number, or less than the potential at the start.

    Example:
        >>> henon_heiles(energy="1/8").start
        (19*sqrt(15)/150, 0, 0, 1/10)
    """
    import sympy

    kinetic = read_formula(energy, (), "energy") - sympy.Rational(LEAST_ENERGY)
    if not kinetic >= 0:
        raise IntegratorError(f"energy must be at least {LEAST_ENERGY}, but was {shorten(str(energy))}")
    return Scene(
        {"p": 2, "q": 2},
        hamiltonian="(p1^2 + p2^2 + q1^2 + q2^2)/2 + q1^2*q2 - q2^3/3",
        start={"p": [sympy.sqrt(2 * kinetic), 0], "q": [0, "1/10"]},
        name="henon-heiles",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("henon-heiles", henon_heiles, SUMMARY, REFERENCE, ("hénon-heiles",)),)
