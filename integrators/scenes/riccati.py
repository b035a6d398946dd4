"""The scalar equation y' = y², whose solutions run to infinity."""

from __future__ import annotations

from .base import Scene

SUMMARY = "y' = y², with the solution 1/(1 − t)"
REFERENCE = "HLW, example IX.1.1; E. Hairer, lecture on long-time behaviour, example 1 and figure 1"


def riccati() -> Scene:
    """y' = y², y(0) = 1."""
    return Scene(
        {"y": 1},
        field={"y": "y^2"},
        start={"y": [1]},
        name="riccati",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("riccati", riccati, SUMMARY, REFERENCE),)
