"""The logarithmic Hamiltonian of Field and Nijhoff, whose modified Hamiltonian is known in closed form."""

from __future__ import annotations

from .base import Scene

SUMMARY = "H = ln(α + p) + ln(β + q): the modified Hamiltonian of symplectic Euler is known in closed form"
REFERENCE = (
    "C. M. Field, F. W. Nijhoff, Nonlinearity 16 (2003) 1673; E. Hairer, lecture on long-time behaviour, exercise 5"
)


def field_nijhoff() -> Scene:
    """H = ln(α + p) + ln(β + q), from p = q = 1 with α = β = 1."""
    return Scene(
        {"p": 1, "q": 1},
        hamiltonian="log(alpha + p) + log(beta + q)",
        parameters={"alpha": 1, "beta": 1},
        invariants={"product": "(alpha + p)*(beta + q)"},
        start={"p": [1], "q": [1]},
        positive=["alpha + p", "beta + q"],
        name="field-nijhoff",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("field-nijhoff", field_nijhoff, SUMMARY, REFERENCE),)
