"""The free rigid body: Euler's equations, a Lie–Poisson system."""

from __future__ import annotations

from .base import Scene

SUMMARY = "the free rigid body: Euler's equations for its angular momentum"
REFERENCE = "HLW, section IV.1 and figure IV.1.1 (moments of inertia, start), section VII.5 (the Lie–Poisson structure)"


def rigid_body() -> Scene:
    """y' = y × ∇H, H = Σ y_k²/(2 I_k): the angular momentum y in the body, its length a Casimir function."""
    return Scene(
        {"y": 3},
        hamiltonian="y1^2/(2*I1) + y2^2/(2*I2) + y3^2/(2*I3)",
        poisson=[[0, "-y3", "y2"], ["y3", 0, "-y1"], ["-y2", "y1", 0]],
        parameters={"I1": 2, "I2": 1, "I3": "2/3"},
        invariants={"casimir": "y1^2 + y2^2 + y3^2"},
        start={"y": ["cos(11/10)", 0, "sin(11/10)"]},
        name="rigid-body",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("rigid-body", rigid_body, SUMMARY, REFERENCE, ("euler-top",)),)
