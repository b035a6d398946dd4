"""The flow of Arnold, Beltrami and Childress, which preserves volume."""

from __future__ import annotations

from .base import Scene
from .terms import Term

SUMMARY = "the Arnold–Beltrami–Childress flow in space: divergence-free, a sum of three shears"
REFERENCE = (
    "T. Dombre et al., J. Fluid Mech. 167 (1986) 353, doi:10.1017/S0022112086002859; "
    "E. Hairer, lecture on long-time behaviour, exercise 6"
)


def abc_flow() -> Scene:
    """x' = A sin z + C cos y, y' = B sin x + A cos z, z' = C sin y + B cos x, with A = B = C = 1.

    The parts a, b, c are these three equations: each changes one variable and does not depend on it, so that it
    preserves volume and Euler's method solves it.
    """
    return Scene(
        {"x": ["x", "y", "z"]},
        terms=[
            Term(field={"x": "A*sin(z) + C*cos(y)"}, part="a"),
            Term(field={"y": "B*sin(x) + A*cos(z)"}, part="b"),
            Term(field={"z": "C*sin(y) + B*cos(x)"}, part="c"),
        ],
        parameters={"A": 1, "B": 1, "C": 1},
        start={"x": [1, 2, 3]},
        name="abc-flow",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("abc-flow", abc_flow, SUMMARY, REFERENCE, ("abc",)),)
