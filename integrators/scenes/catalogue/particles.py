"""Formulas over particles and the first integrals of translations and rotations."""

from __future__ import annotations

from typing import TYPE_CHECKING

from integrators.scenes.model.blocks import AXES
from integrators.scenes.model.terms import Term

if TYPE_CHECKING:
    import sympy

FLAT_SITES = 100
"""The largest number of particles for which integrals are declared; their formulas name every particle."""


def squared_norm(block: str, dimension: int) -> str:
    """The squared norm of a block's vector at one particle.

    Example:
        >>> squared_norm("p", 2)
        'px_i^2 + py_i^2'
    """
    return " + ".join(f"{block}{axis}_i^2" for axis in AXES[:dimension])


def squared_distance(dimension: int) -> str:
    """The squared distance of two particles.

    Example:
        >>> squared_distance(2)
        '(qx_i - qx_j)^2 + (qy_i - qy_j)^2'
    """
    return " + ".join(f"(q{axis}_i - q{axis}_j)^2" for axis in AXES[:dimension])


def kinetic_energy(dimension: int, mass: str) -> Term:
    """The kinetic energy, Σ |p_i|²/(2m)."""
    return Term(over="each", hamiltonian=f"({squared_norm('p', dimension)})/(2*{mass})")


def momentum_names(dimension: int) -> list[str]:
    """The names of the components of the total momentum."""
    return [f"momentum_{axis}" for axis in AXES[:dimension]]


def symmetry_integrals(sites: int, dimension: int) -> dict[str, sympy.Expr]:
    """Total momentum Σ p and angular momentum Σ q × p (one number in the plane, three in space).

    Args:
        sites: The number of particles; beyond `FLAT_SITES` the result is empty.
        dimension: The dimension of space.

    Example:
        >>> symmetry_integrals(2, 2)["momentum_y"], symmetry_integrals(1, 2)["angular_momentum"]
        (py1 + py2, -px1*qy1 + py1*qx1)
    """
    import sympy

    if sites > FLAT_SITES:
        return {}
    numbers = range(1, sites + 1)
    p = {axis: [sympy.Symbol(f"p{axis}{k}") for k in numbers] for axis in AXES}
    q = {axis: [sympy.Symbol(f"q{axis}{k}") for k in numbers] for axis in AXES}

    def moment(a: str, b: str) -> sympy.Expr:
        return sympy.Add(*(x * v - y * u for x, y, u, v in zip(q[a], q[b], p[a], p[b], strict=True)))

    integrals = {name: sympy.Add(*p[axis]) for name, axis in zip(momentum_names(dimension), AXES, strict=False)}
    if dimension == 2:
        integrals["angular_momentum"] = moment("x", "y")
    if dimension == 3:
        integrals |= {f"angular_momentum_{c}": moment(a, b) for a, b, c in ("yzx", "zxy", "xyz")}
    return integrals
