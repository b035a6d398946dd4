"""Scenes of many particles: chains and Lennard-Jones atoms, and what they share with gravity."""

from __future__ import annotations

from fractions import Fraction
from math import ceil, cos, gamma, pi
from typing import TYPE_CHECKING

from bseries_base.errors import shorten
from integrators.core.arguments import items
from integrators.core.errors import IntegratorError
from integrators.scenes.catalogue.registry import SceneEntry
from integrators.scenes.model.blocks import AXES, MAX_VARIABLES
from integrators.scenes.model.formulas import as_float, read_formula
from integrators.scenes.model.terms import Effect, Term
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import numpy as np
    import sympy

LARGEST = 10**100


def read_count(value: object, argument: str, least: int, most: int) -> int:
    """A whole number within limits, given as a number or as text."""
    number = read_formula(value, (), argument)
    if not (number.is_Integer and least <= number <= most):
        raise IntegratorError(f"{argument} must be an integer from {least} to {most}, but was {shorten(str(value))}")
    return int(number)


def read_positive(value: object, argument: str, *, or_zero: bool = False) -> sympy.Expr:
    """An exact positive number, or zero where allowed, whose squares and products are in the range of doubles."""
    number = read_formula(value, (), argument)
    if not (1 <= number * LARGEST <= LARGEST**2 or (or_zero and number == 0)):
        raise IntegratorError(
            f"{argument} must be {'0 or ' * or_zero}a number from 1e-100 to 1e100, but was {shorten(str(value))}"
        )
    return number


def read_rows(value: object, argument: str, count: int) -> list[tuple[sympy.Expr, ...]]:
    """A row of exact numbers for each of `count` bodies."""
    rows = [items(row, f"row {k} of {argument}") for k, row in enumerate(items(value, argument), 1)]
    if len(rows) != count:
        raise IntegratorError(f"{argument} must have a row for each of the {count} bodies, but had {len(rows)} rows")
    return [
        tuple(read_formula(x, (), f"{argument}[{k}][{i}]") for i, x in enumerate(row, 1))
        for k, row in enumerate(rows, 1)
    ]


FLAT_SITES = 100
"""The largest number of particles for which integrals are declared; their formulas name every particle."""


def squared_norm(block: str, dimension: int) -> str:
    """The squared norm of a block's vector at one particle."""
    return " + ".join(f"{block}{axis}_i^2" for axis in AXES[:dimension])


def squared_distance(dimension: int) -> str:
    """The squared distance of two particles."""
    return " + ".join(f"(q{axis}_i - q{axis}_j)^2" for axis in AXES[:dimension])


def kinetic_energy(dimension: int, mass: str) -> Term:
    """The kinetic energy, Σ |p_i|²/(2m)."""
    return Term(over="each", hamiltonian=f"({squared_norm('p', dimension)})/(2*{mass})")


def symmetry_integrals(sites: int, dimension: int) -> dict[str, sympy.Expr]:
    """Total momentum Σ p and angular momentum Σ q × p (one number in the plane, three in space).

    They are left out beyond `FLAT_SITES` particles.
    """
    import sympy

    if sites > FLAT_SITES:
        return {}
    numbers = range(1, sites + 1)
    p = {axis: [sympy.Symbol(f"p{axis}{k}") for k in numbers] for axis in AXES}
    q = {axis: [sympy.Symbol(f"q{axis}{k}") for k in numbers] for axis in AXES}

    def moment(a: str, b: str) -> sympy.Expr:
        return sympy.Add(*(x * v - y * u for x, y, u, v in zip(q[a], q[b], p[a], p[b], strict=True)))

    integrals = {f"momentum_{axis}": sympy.Add(*p[axis]) for axis in AXES[:dimension]}
    if dimension == 2:
        integrals["angular_momentum"] = moment("x", "y")
    if dimension == 3:
        integrals |= {f"angular_momentum_{c}": moment(a, b) for a, b, c in ("yzx", "zxy", "xyz")}
    return integrals


def toda(*, n: object = 3) -> Scene:
    """H = Σ p_k²/2 + exp(q_k − q_{k+1}) with q_{n+1} = q_1.

    For n = 3 the start is taken from figure 9 of the lecture; for other n it is q = 0, p_k = cos(2πk/n), rounded to 12
    decimals.

    Args:
        n: The number of particles.
    """
    n = read_count(n, "n", 2, MAX_VARIABLES)
    wave = {"p": [round(cos(2 * pi * k / n), 12) for k in range(1, n + 1)], "q": [0] * n}
    return Scene(
        {"p": n, "q": n},
        terms=[Term(over="each", hamiltonian="p_i^2/2"), Term(over="ring", hamiltonian="exp(q_i - q_j)")],
        invariants=_integrals(n) if n <= FLAT_SITES else {},
        start={"p": ["-3/2", 1, "1/2"], "q": [1, 2, -1]} if n == 3 else wave,
    )


def _integrals(n: int) -> dict[str, str]:
    """The total momentum and, up to a constant, the trace of L³.

    L is Flaschka's periodic Jacobi matrix with diagonal a_k = −p_k/2 and off-diagonal b_k = exp((q_k − q_{k+1})/2)/2,
    whose eigenvalues are first integrals. tr L = −Σ p_k/2, tr L² = H/2, and tr L³ = Σ a_k³ + 3(a_k + a_{k+1}) b_k²,
    plus 6 b_1 b_2 b_3 = 3/4 if n = 3. For n = 3 these traces form a complete set of first integrals.
    """
    ring = [(k, k % n + 1) for k in range(1, n + 1)]
    cubes = " + ".join(f"p{k}^3 + 3*(p{k} + p{j})*exp(q{k} - q{j})" for k, j in ring)
    return {"momentum": " + ".join(f"p{k}" for k, _ in ring), "trace_of_cube": f"-({cubes})/8"}


def fermi_pasta_ulam(*, m: object = 3, omega: object = 50) -> Scene:
    """H = Σ (y_0² + y_1² + ω² x_1²)/2 + Σ (elongation of a soft spring)⁴/4.

    The coordinates are those of HLW: for the i-th stiff spring, ``qx`` is x_{0,i}, its scaled displacement, ``qy`` is
    x_{1,i}, its scaled expansion, and ``px``, ``py`` are the velocities y_{0,i}, y_{1,i}. Quadratic terms form the part
    ``linear``, quartic terms the part ``nonlinear``. The start is that of HLW's figures, x_{0,1} = y_{0,1} = y_{1,1} =
    1, x_{1,1} = 1/ω, and zero elsewhere.

    The stiff springs exchange their oscillatory energies I_i = (y_{1,i}² + ω² x_{1,i}²)/2 slowly. The sum of the I_i
    stays close to its initial value 1 over very long times, but is not a first integral.

    Args:
        m: The number of stiff springs.
        omega: Their frequency ω.
    """
    m, omega = read_count(m, "m", 1, MAX_VARIABLES // 2), read_positive(omega, "omega")
    rest = [[0, 0]] * (m - 1)
    return Scene(
        {"p": [m, 2], "q": [m, 2]},
        terms=[
            Term(over="each", hamiltonian="(px_i^2 + py_i^2 + omega^2*qy_i^2)/2", part="linear"),
            Term(over=[(1,)], hamiltonian="(qx_i - qy_i)^4/4", part="nonlinear"),
            Term(over="chain", hamiltonian="(qx_j - qy_j - qx_i - qy_i)^4/4", part="nonlinear"),
            Term(over=[(m,)], hamiltonian="(qx_i + qy_i)^4/4", part="nonlinear"),
        ],
        parameters={"omega": omega},
        start={"p": [[1, 1], *rest], "q": [[1, 1 / omega], *rest]},
    )


def lennard_jones(
    *, particles: object = 9, dimension: object = 2, temperature: object = "1/10", seed: object = 0, sigma: object = 1,
    m: object = 1,
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
                breaks=[name for name in integrals if name.startswith("momentum_")],
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
    SceneEntry("toda", toda, "the periodic Toda lattice of n particles, completely integrable",
        "M. Toda, J. Phys. Soc. Japan 22 (1967) 431–436; H. Flaschka, Phys. Rev. B 9 (1974) 1924–1925; "
        "HLW, section X.1.5; E. Hairer, lecture on long-time behaviour, example 9",
        aliases=("toda-lattice",), title="Toda"),
    SceneEntry("fermi-pasta-ulam", fermi_pasta_ulam,
        "2m masses joined by soft quartic and stiff linear springs in turn; oscillatory energies over long times",
        "L. Galgani, A. Giorgilli, A. Martinoli, S. Vanzini, Physica D 59 (1992) 334–348; HLW, section I.5.1",
        aliases=("fpu",), title="Fermi–Pasta–Ulam"),
    SceneEntry("lennard-jones", lennard_jones,
        "atoms with the Lennard-Jones potential, a cluster at a given temperature",
        "J. E. Jones, Proc. R. Soc. London A 106 (1924) 463–477; HLW, section I.4; "
        "E. Hairer, lecture on long-time behaviour, figure 8", title="Lennard-Jones"),
)  # fmt: skip
