"""The mathematical pendulum."""

from __future__ import annotations

from .base import Scene
from .effects import Effect

SUMMARY = "the mathematical pendulum"
REFERENCE = "HLW, section I.1.2; E. Hairer, lecture on long-time behaviour, example 4 and section 4"


def pendulum() -> Scene:
    """H = p²/2 − cos q, with mass, length and gravity 1."""
    return Scene(
        {"p": 1, "q": 1},
        hamiltonian="p^2/2 - cos(q)",
        start={"p": [0], "q": ["-3/2"]},
        effects={
            "asymmetry": Effect(
                hamiltonian="epsilon*sin(2*q)",
                parameters={"epsilon": "1/5"},
                summary="a second harmonic that is not symmetric in q: energy drifts where it did not",
            ),
            "damping": Effect(field={"p": "-gamma*p"}, parameters={"gamma": "1/10"}, summary="friction, −γp"),
            "drive": Effect(
                field={"p": "amplitude*cos(omega*t)"},
                parameters={"amplitude": "1/2", "omega": "2/3"},
                summary="a periodic force, a cos(ωt)",
            ),
        },
        name="pendulum",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("pendulum", pendulum, SUMMARY, REFERENCE),)
