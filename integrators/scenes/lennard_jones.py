"""Atoms with the Lennard-Jones potential, in a line, the plane or space."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from typing import TYPE_CHECKING, Any

from .base import Scene
from .blocks import AXES, MAX_VARIABLES
from .effects import Effect
from .expansion import as_float
from .options import read_count, read_positive
from .particles import kinetic_energy, momentum_names, squared_distance, squared_norm, symmetry_integrals
from .terms import Term

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
    confinement = Effect(
        terms=[Term(over="each", hamiltonian=f"k*({squared_norm('q', dimension)})/2")],
        parameters={"k": "1/100"},
        breaks=[name for name in momentum_names(dimension) if name in integrals],
        summary="a spring k|q|²/2 that holds every atom to the origin",
    )
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
        effects={"confinement": confinement},
        name="lennard-jones",
        summary=SUMMARY,
        reference=REFERENCE,
    )


def cluster(particles: int, dimension: int) -> np.ndarray:
    """The points of a close-packed lattice nearest to one of them, with neighbours 1 apart and their mean at 0.

    The lattice is A_d: integers x_k stand for the point Σ x_k a_k with |a_k| = 1 and a_k·a_l = 1/2. Twice the square of
    its norm is Σ x_k² + (Σ x_k)², so no |x_k| exceeds the root of that. Points of equal norm are taken in falling
    lexicographic order, which puts neighbours next to each other.

    Returns:
        An array with a row for each particle.
    """
    import numpy as np

    def norm(point: tuple[int, ...]) -> int:  # twice its square
        return sum(x * x for x in point) + sum(point) ** 2

    reach, points = 0, []
    while len(points) < particles:
        reach += 1
        box = product(range(reach, -reach - 1, -1), repeat=dimension)
        points = [point for point in box if norm(point) <= reach**2]
    chosen = np.array(sorted(points, key=norm)[:particles])
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
