"""Van der Pol's equation, stiff."""

from __future__ import annotations

from .base import Scene

SUMMARY = "Van der Pol's equation ε y'' = (1 − y²) y' − y, stiff"
REFERENCE = "HW, sections IV.1 (this form, time scaled to the period) and IV.10 (ε = 10⁻⁶)"


def van_der_pol() -> Scene:
    """y1' = y2, y2' = ((1 − y1²) y2 − y1)/ε, from (2, 0), with ε = 10⁻⁶.

    In units of √ε for the time this is the other usual form, y'' = μ (1 − y²) y' − y with μ = 1/√ε = 1000.
    """
    return Scene(
        {"y": 2},
        field={"y1": "y2", "y2": "((1 - y1^2)*y2 - y1)/epsilon"},
        parameters={"epsilon": "1/1000000"},
        start={"y": [2, 0]},
        name="van-der-pol",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("van-der-pol", van_der_pol, SUMMARY, REFERENCE),)
