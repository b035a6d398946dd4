"""The Lotka–Volterra model of prey and predators, a Poisson system."""

from __future__ import annotations

from .base import Scene

SUMMARY = "prey p and predators q: closed orbits of a Poisson system"
REFERENCE = "HLW, sections I.1.1 and VII.2; E. Hairer, lecture on long-time behaviour, example 2 and exercise 2"


def lotka_volterra() -> Scene:
    """p' = p (β − q), q' = q (p − α): the structure B = p q [[0, −1], [1, 0]] and H = p − α ln p + q − β ln q."""
    return Scene(
        {"p": 1, "q": 1},
        hamiltonian="p - alpha*log(p) + q - beta*log(q)",
        poisson=[[0, "-p*q"], ["p*q", 0]],
        parameters={"alpha": 1, "beta": 2},
        start={"p": [2], "q": [2]},
        positive=["p", "q"],
        name="lotka-volterra",
        summary=SUMMARY,
        reference=REFERENCE,
    )


SCENES = (("lotka-volterra", lotka_volterra, SUMMARY, REFERENCE, ("predator-prey",)),)
