"""Ingredients of scenes of particles: exact options, formulas, and first integrals of translations and rotations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten
from integrators.scenes.model.blocks import AXES
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.model.terms import Term

if TYPE_CHECKING:
    import sympy


LARGEST = 10**100


def read_count(value: Any, argument: str, least: int, most: int) -> int:
    """A whole number within limits, given as a number or as text.

    Example:
        >>> read_count("9", "particles", 2, 1000)
        9
    """
    number = read_formula(value, (), argument)
    if not (number.is_Integer and least <= number <= most):
        raise IntegratorError(f"{argument} must be an integer from {least} to {most}, but was {shorten(str(value))}")
    return int(number)


def read_positive(value: Any, argument: str, *, or_zero: bool = False) -> sympy.Expr:
    """An exact positive number, or zero where allowed, whose squares and products are in the range of doubles.

    Example:
        >>> read_positive(0.1, "sigma")
        1/10
    """
    number = read_formula(value, (), argument)
    if not (1 <= number * LARGEST <= LARGEST**2 or (or_zero and number == 0)):
        raise IntegratorError(
            f"{argument} must be {'0 or ' * or_zero}a number from 1e-100 to 1e100, but was {shorten(str(value))}"
        )
    return number


def read_rows(value: Any, argument: str, count: int) -> list[tuple[sympy.Expr, ...]]:
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

    They are left out beyond `FLAT_SITES` particles.

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
