"""A rotation whose speed depends on the radius."""

from __future__ import annotations

from .base import Scene

SUMMARY = "a rotation with angular velocity 1/|u|², which keeps |u|²"
REFERENCE = "H. Ranocha, D. I. Ketcheson, SIAM J. Numer. Anal. 58 (2020), doi:10.1137/19M1290346"


def nonlinear_oscillator() -> Scene:
    """u1' = −u2/|u|², u2' = u1/|u|², from (1, 0)."""
    return Scene(
        {"u": 2},
        field={"u1": "-u2/(u1^2 + u2^2)", "u2": "u1/(u1^2 + u2^2)"},
        invariants={"squared_norm": "u1^2 + u2^2"},
        start={"u": [1, 0]},
        positive=["u1^2 + u2^2"],
        name="nonlinear-oscillator",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("nonlinear-oscillator", nonlinear_oscillator, SUMMARY, REFERENCE),)
