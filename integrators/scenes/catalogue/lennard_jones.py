"""Lennard-Jones atoms in one, two or three dimensions."""

from __future__ import annotations

from fractions import Fraction
from math import ceil, gamma, pi
from typing import TYPE_CHECKING, Any

from integrators.scenes.catalogue.particles import (
    kinetic_energy,
    momentum_names,
    read_count,
    read_positive,
    squared_distance,
    squared_norm,
    symmetry_integrals,
)
from integrators.scenes.catalogue.registry import SceneEntry
from integrators.scenes.model.blocks import AXES, MAX_VARIABLES
from integrators.scenes.model.formulas import as_float
from integrators.scenes.model.terms import Effect, Term
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import numpy as np


def lennard_jones(
    *, particles: Any = 9, dimension: Any = 2, temperature: Any = "1/10", seed: Any = 0, sigma: Any = 1, m: Any = 1
) -> Scene:  # fmt: skip
    """H = Σ |p_i|²/(2m) + Σ_{i<j} 4ε((σ/r_ij)¹² − (σ/r_ij)⁶).

    The atoms start as a close-packed cluster, hexagonal in the plane and face-centred cubic in space, whose nearest
    neighbours are 2^(1/6)σ apart, where the pair potential has its minimum; its centre of mass is at the origin.
    Momenta are drawn from the Maxwell–Boltzmann distribution (with Boltzmann's constant 1), conditioned on a zero sum:
    the mean kinetic energy is d(N − 1)T/2. The angular momentum is not corrected. Start values are decimals, and the
    momenta sum to zero exactly.

    Args:
        particles: The number N of atoms.
        dimension: The dimension d of space: 1, 2 or 3.
        temperature: The temperature T, in units of energy.
        seed: The seed of NumPy's random generator.
        sigma: The length σ of the potential, which scales the cluster too; its depth ε = 1 is a parameter.
        m: The mass of an atom, which scales the momenta too.

    Raises:
        IntegratorError: An option is not a number, or beyond its limits.

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
        effects={
            "confinement": Effect(
                terms=[Term(over="each", hamiltonian=f"k*({squared_norm('q', dimension)})/2")],
                parameters={"k": "1/100"},
                breaks=[name for name in momentum_names(dimension) if name in integrals],
                summary="a spring k|q|²/2 that holds every atom to the origin",
            ),
        },
    )


def cluster(particles: int, dimension: int) -> np.ndarray:
    """The points of a close-packed lattice nearest to one of them, at unit spacing, shifted to mean 0; one row each.

    The lattice is A_d: integers x_k stand for the point Σ x_k a_k with |a_k| = 1 and a_k·a_l = 1/2. Twice its squared
    norm is Σ x_k² + (Σ x_k)², which bounds every |x_k|. Points of equal norm are sorted in decreasing lexicographic
    order, which puts neighbours next to each other.

    The covering radius of the lattice is at most 1/√2, and its cells have volume √((d + 1)/2^d). A ball around a point
    therefore holds N points if the ball whose radius is smaller by 1/√2 has the volume of N cells.
    """
    import numpy as np

    unit_ball = pi ** (dimension / 2) / gamma(dimension / 2 + 1)
    bound = ceil((particles * (dimension + 1) ** 0.5 / unit_ball) ** (1 / dimension) + 1)  # √2 times the radius
    box = bound - np.indices((2 * bound + 1,) * dimension).reshape(dimension, -1).T
    norms = (box**2).sum(axis=1) + box.sum(axis=1) ** 2
    chosen = box[np.argsort(norms, kind="stable")[:particles]]
    basis = np.linalg.cholesky((np.ones((dimension, dimension)) + np.eye(dimension)) / 2)
    return (chosen - chosen.mean(axis=0)) @ basis


def thermal_momenta(particles: int, dimension: int, variance: float, seed: int) -> np.ndarray:
    """Independent normal components, conditioned on a zero sum over the particles."""
    import numpy as np

    momenta = np.sqrt(variance) * np.random.default_rng(seed).standard_normal((particles, dimension))
    return momenta - momenta.mean(axis=0)


def _balanced(values: np.ndarray) -> list[list[Fraction]]:
    """The decimals that doubles print as, with the last row changed so that the rows sum to zero exactly."""
    rows = [[Fraction(repr(x)) for x in row] for row in values.tolist()]
    return [*rows[:-1], [-sum(column, Fraction(0)) for column in zip(*rows[:-1], strict=True)]]


SCENES = (
    SceneEntry("lennard-jones", lennard_jones,
        "atoms with the Lennard-Jones potential, a cluster at a given temperature",
        "J. E. Jones, Proc. R. Soc. London A 106 (1924) 463–477; HLW, section I.4; "
        "E. Hairer, lecture on long-time behaviour, figure 8"),
)  # fmt: skip
