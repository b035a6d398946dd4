"""The Brusselator, a chemical reaction that oscillates."""

from __future__ import annotations

from .base import Scene

SUMMARY = "the Brusselator, a chemical reaction with a limit cycle (where B > 1 + A²)"
REFERENCE = "R. Lefever, G. Nicolis, J. Theor. Biol. 30 (1971) 267; HNW, sections I.16 (the form) and II.4 (the start)"


def brusselator() -> Scene:
    """u' = A + u² v − (B + 1) u, v' = B u − u² v, with A = 1, B = 3."""
    return Scene(
        {"u": 1, "v": 1},
        field={"u": "A + u^2*v - (B + 1)*u", "v": "B*u - u^2*v"},
        parameters={"A": 1, "B": 3},
        start={"u": ["3/2"], "v": [3]},
        name="brusselator",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("brusselator", brusselator, SUMMARY, REFERENCE),)
