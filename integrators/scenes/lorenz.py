"""Lorenz's model of convection."""

from __future__ import annotations

from .base import Scene

SUMMARY = "Lorenz's model of convection: a strange attractor"
REFERENCE = "E. N. Lorenz, J. Atmos. Sci. 20 (1963) 130; HNW, section I.16"


def lorenz() -> Scene:
    """x' = σ(y − x), y' = x(ρ − z) − y, z' = xy − βz, with σ = 10, ρ = 28, β = 8/3, from (0, 1, 0)."""
    return Scene(
        {"x": ["x", "y", "z"]},
        field={"x": "sigma*(y - x)", "y": "x*(rho - z) - y", "z": "x*y - beta*z"},
        parameters={"sigma": 10, "rho": 28, "beta": "8/3"},
        start={"x": [0, 1, 0]},
        name="lorenz",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("lorenz", lorenz, SUMMARY, REFERENCE),)
