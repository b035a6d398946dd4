"""Motion in a central field, in polar coordinates."""

from __future__ import annotations

from typing import Any

from .base import Scene
from .effects import Effect
from .formulas import read_formula
from .terms import Term

SUMMARY = "motion in a central field V(r), in polar coordinates"
REFERENCE = "HLW, section X.1; E. Hairer, lecture on long-time behaviour, example 8 and exercises 3, 4"


def central_field(*, potential: Any = "-1/r") -> Scene:
    """H = (p_r² + p_φ²/r²)/2 + V(r), from the perihelion of `kepler` (r = 2/5, p_φ = 4/5).

    Args:
        potential: V, a formula in r.

    Raises:
        IntegratorError: `potential` is no formula in r.

    Example:
        >>> central_field(potential="r^2/2").field
        (p_phi**2/r**3 - r, 0, p_r, p_phi/r**2)
    """
    return Scene(
        {"p": ["p_r", "p_phi"], "q": ["r", "phi"]},
        hamiltonian="(p_r^2 + p_phi^2/r^2)/2",
        terms=[Term(hamiltonian=read_formula(potential, ("r",), "potential"))],
        invariants={"angular_momentum": "p_phi"},
        start={"p": [0, "4/5"], "q": ["2/5", 0]},
        effects={
            "perturbation": Effect(
                hamiltonian="-mu/(3*r^3)",
                parameters={"mu": "3/200"},
                summary="an inverse cube, −μ/(3 r³): the perihelion of the Kepler problem advances",
            ),
        },
        positive=["r"],
        name="central-field",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("central-field", central_field, SUMMARY, REFERENCE),)
