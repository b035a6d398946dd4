"""The double pendulum, in canonical variables."""

from __future__ import annotations

from .base import Scene

SUMMARY = "two pendulums, one hanging from the other: chaotic at large angles"
REFERENCE = "L. D. Landau, E. M. Lifshitz, Mechanics, §5, problem 1 (the Lagrangian)"
KINETIC = (
    "(m2*l2^2*p1^2 - 2*m2*l1*l2*cos(q1 - q2)*p1*p2 + (m1 + m2)*l1^2*p2^2) / (2*m2*l1^2*l2^2*(m1 + m2*sin(q1 - q2)^2))"
)
POTENTIAL = "-(m1 + m2)*g*l1*cos(q1) - m2*g*l2*cos(q2)"


def double_pendulum() -> Scene:
    """Angles q from the vertical and their momenta p; masses, lengths and gravity are 1; from rest at right angles."""
    return Scene(
        {"p": 2, "q": 2},
        hamiltonian=f"{KINETIC} + {POTENTIAL}",
        parameters={"m1": 1, "m2": 1, "l1": 1, "l2": 1, "g": 1},
        start={"p": [0, 0], "q": ["pi/2", "pi/2"]},
        positive=["m1", "m2", "l1", "l2"],
        name="double-pendulum",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("double-pendulum", double_pendulum, SUMMARY, REFERENCE),)
