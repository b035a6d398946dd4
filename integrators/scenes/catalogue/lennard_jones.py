"""Atoms with the Lennard-Jones potential, in a line, the plane or space."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from math import ceil, gamma, pi
from typing import TYPE_CHECKING, Any

from integrators.scenes.catalogue.options import read_count, read_positive
from integrators.scenes.catalogue.particles import (
    kinetic_energy,
    momentum_names,
    squared_distance,
    squared_norm,
    symmetry_integrals,
)
from integrators.scenes.model.blocks import AXES, MAX_VARIABLES
from integrators.scenes.model.effects import Effect
from integrators.scenes.model.terms import Term
from integrators.scenes.particles.expansion import as_float
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import numpy as np

SUMMARY = "atoms with the Lennard-Jones potential, a cluster at a given temperature"
REFERENCE = (
    "J. E. Jones, Proc. R. Soc. London A 106 (1924) 463–477; HLW, section I.4; "
    "E. Hairer, lecture on long-time behaviour, figure 8"
)


def lennard_jones(
    *,
    particles: Any = 9,
    dimension: Any = 2,
    temperature: Any = "1/10",
    seed: Any = 0,
    sigma: Any = 1,
    m: Any = 1,
) -> Scene:
    """H = Σ |p_i|²/(2m) + Σ_{i<j} 4ε((σ/r_ij)¹² − (σ/r_ij)⁶).

    The atoms start as a close-packed cluster, hexagonal in the plane and face-centred cubic in space, whose nearest
    neighbours are 2^(1/6)σ apart, where the potential of a pair has its minimum; its centre of mass is at the origin.
    Momenta are drawn from the Maxwell–Boltzmann distribution of the temperature (Boltzmann's constant is 1), under the
    condition that their sum is zero: d(N − 1)T/2 is the mean of the kinetic energy. The angular momentum is left as it
    was drawn. Start values are decimals, and the momenta add up to zero exactly.

    Args:
        particles: The number N of atoms.
        dimension: The dimension d of space: 1, 2 or 3.
        temperature: The temperature T, in units of energy.
        seed: Of NumPy's generator; the same seed gives the same momenta.
        sigma: The length σ of the potential, which scales the cluster too; its depth ε = 1 is a parameter.
        m: The mass of an atom, which scales the momenta too.

    Raises:
        IntegratorError: An option is no number, or beyond its limits.

    Example:
        >>> dimer = lennard_jones(particles=2, dimension=1, temperature=0)
        >>> dimer.hamiltonian
        px1**2/2 + px2**2/2 - 4/(qx1 - qx2)**6 + 4/(qx1 - qx2)**12
        >>> dimer.y0
        array([ 0. , 0. , -0.56123102, 0.56123102])
    """
    dimension = read_count(dimension, "dimension", 1, len(AXES))
    particles = read_count(particles, "particles", 2, MAX_VARIABLES // dimension)
    seed = read_count(seed, "seed", 0, 2**63)
    sigma, m = read_positive(sigma, "sigma"), read_positive(m, "m")
    temperature = read_positive(temperature, "temperature", or_zero=True)
    square, integrals = squared_distance(dimension), symmetry_integrals(particles, dimension)
    return Scene(
        {"p": [particles, dimension], "q": [particles, dimension]},
        terms=[
            kinetic_energy(dimension, "m"),
            Term(over="pairs", hamiltonian=f"4*epsilon*(sigma^12/({square})^6 - sigma^6/({square})^3)"),
        ],
        parameters={"m": m, "epsilon": 1, "sigma": sigma},
        invariants=integrals,
        start={
            "p": _balanced(thermal_momenta(particles, dimension, as_float(m * temperature), seed)),
            "q": _balanced(2 ** (1 / 6) * as_float(sigma) * cluster(particles, dimension)),
        },
        effects={"confinement": _confinement(dimension, [n for n in momentum_names(dimension) if n in integrals])},
        name="lennard-jones",
        summary=SUMMARY,
        reference=REFERENCE,
    )


def _confinement(dimension: int, breaks: Iterable[str]) -> Effect:
    return Effect(
        terms=[Term(over="each", hamiltonian=f"k*({squared_norm('q', dimension)})/2")],
        parameters={"k": "1/100"},
        breaks=breaks,
        summary="a spring k|q|²/2 that holds every atom to the origin",
    )


def cluster(particles: int, dimension: int) -> np.ndarray:
    """The points of a close-packed lattice nearest to one of them, with neighbours 1 apart and their mean at 0.

    The lattice is A_d: integers x_k stand for the point Σ x_k a_k with |a_k| = 1 and a_k·a_l = 1/2. Twice the square of
    its norm is Σ x_k² + (Σ x_k)², so no |x_k| exceeds the root of that. Points of equal norm are taken in falling
    lexicographic order, which puts neighbours next to each other.

    Every place is within 1/√2 of the lattice, whose cells have the volume √((d + 1)/2^d): so a ball around a point
    holds N points if a ball whose radius is less by 1/√2 has the volume of N cells.

    Returns:
        An array with a row for each particle.
    """
    import numpy as np

    unit_ball = pi ** (dimension / 2) / gamma(dimension / 2 + 1)
    reach = ceil((particles * (dimension + 1) ** 0.5 / unit_ball) ** (1 / dimension) + 1)  # √2 times the radius
    box = reach - np.indices((2 * reach + 1,) * dimension).reshape(dimension, -1).T
    norms = (box**2).sum(axis=1) + box.sum(axis=1) ** 2
    chosen = box[np.argsort(norms, kind="stable")[:particles]]
    basis = np.linalg.cholesky((np.ones((dimension, dimension)) + np.eye(dimension)) / 2)
    return (chosen - chosen.mean(axis=0)) @ basis


def thermal_momenta(particles: int, dimension: int, variance: float, seed: int) -> np.ndarray:
    """Independent normal components under the condition that their sum over particles is zero."""
    import numpy as np

    momenta = np.sqrt(variance) * np.random.default_rng(seed).standard_normal((particles, dimension))
    return momenta - momenta.mean(axis=0)


def _balanced(values: np.ndarray) -> list[list[Fraction]]:
    """The decimals that doubles print as, but for the last row, which makes the rows add up to zero exactly."""
    rows = [[Fraction(repr(x)) for x in row] for row in values.tolist()]
    return [*rows[:-1], [-sum(column, Fraction(0)) for column in zip(*rows[:-1], strict=True)]]


SCENES = (("lennard-jones", lennard_jones, SUMMARY, REFERENCE),)
