"""A charged particle in a magnetic field B and a potential U: x' = v, v' = v × B(x) − ∇U(x)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError
from integrators.scenes.catalogue.registry import SceneEntry
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.model.terms import Effect, Term
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import sympy

PLACE = ("x", "y", "z")


def _structure(magnetic: Sequence[Any]) -> list[list[Any]]:
    """The Poisson matrix in the variables (v, x): {v_i, v_j} = ε_ijk B_k and {x_i, v_i} = 1."""
    bx, by, bz = magnetic
    velocities = [[0, bz, -by], [-bz, 0, bx], [by, -bx, 0]]
    unit = [[int(i == j) for j in range(3)] for i in range(3)]
    return [
        *([*row, *(-x for x in one)] for row, one in zip(velocities, unit, strict=True)),
        *([*one, 0, 0, 0] for one in unit),
    ]


def _read_magnetic_field(magnetic: Any) -> list[sympy.Expr]:
    """The components of B; B must be free of sources, as the brackets of velocities satisfy Jacobi's identity then."""
    import sympy

    given = items(magnetic, "magnetic")
    if len(given) != 3:
        raise IntegratorError(f"magnetic must be the three components of B, but had {len(given)}")
    components = [read_formula(x, PLACE, f"magnetic[{i}]") for i, x in enumerate(given, 1)]
    sources = sympy.Add(*(b.diff(name) for b, name in zip(components, PLACE, strict=True)))
    if sources.equals(0) is not True:
        raise IntegratorError(f"magnetic must be divergence-free, but its divergence was {sources}")
    return components


def charged_particle(
    *, magnetic: Any = ("0", "0", "sqrt(x^2 + y^2)"), potential: Any = "1/(100*sqrt(x^2 + y^2))"
) -> Scene:
    """B = (0, 0, r) and U = 1/(100 r) with r² = x² + y², from (0, −1, 0) with the velocity (1/10, 1/100, 0).

    Args:
        magnetic: The components of B, three formulas in x, y, z with divergence 0.
        potential: U, a formula in x, y, z.

    Raises:
        IntegratorError: One is not a formula in x, y, z, or the divergence of B is not 0.

    Example:
        >>> charged_particle(magnetic=[0, 0, "1 + x^2"], potential="x^2/2").field
        (vy*x**2 + vy - x, -vx*x**2 - vx, 0, vx, vy, vz)
    """
    return Scene(
        {"v": ["vx", "vy", "vz"], "x": list(PLACE)},
        hamiltonian="(vx^2 + vy^2 + vz^2)/2",
        terms=[Term(hamiltonian=read_formula(potential, PLACE, "potential"))],
        poisson=_structure(_read_magnetic_field(magnetic)),
        start={"v": ["1/10", "1/100", 0], "x": [0, -1, 0]},
    )


def magnetic_dipole() -> Scene:
    """B = μ (3xz, 3yz, 2z² − x² − y²)/r⁵ with μ = 1: the scaled Störmer problem, on a trapped orbit."""
    import sympy

    mu, x, y, z = sympy.symbols("mu x y z")
    square = x**2 + y**2 + z**2
    magnetic = [mu * b / square ** sympy.Rational(5, 2) for b in (3 * x * z, 3 * y * z, 3 * z**2 - square)]
    return Scene(
        {"v": ["vx", "vy", "vz"], "x": list(PLACE)},
        hamiltonian="(vx^2 + vy^2 + vz^2)/2",
        poisson=_structure(magnetic),
        parameters={"mu": 1},
        invariants={"momentum": "x*vy - y*vx + mu*(x^2 + y^2)/(x^2 + y^2 + z^2)^(3/2)"},
        start={"v": [0, "1/20", "1/20"], "x": ["1/2", 0, 0]},
        effects={
            "attraction": Effect(
                hamiltonian="-k/sqrt(x^2 + y^2 + z^2)",
                parameters={"k": "1/500"},
                summary="gravity of the planet, or its charge: the potential −k/r",
            ),
        },
        positive=["x^2 + y^2 + z^2"],
    )


SCENES = (
    SceneEntry("charged-particle", charged_particle, "a charged particle in a magnetic field B(x) and a potential U(x)",
        "H. Qin et al., Phys. Plasmas 20 (2013) 084503, doi:10.1063/1.4818428; "
        "E. Hairer, C. Lubich, BIT 58 (2018) 969–979, doi:10.1007/s10543-018-0713-1"),
    SceneEntry("magnetic-dipole", magnetic_dipole,
        "Störmer's problem: a charged particle in the field of a magnetic dipole, such as the Earth",
        "C. Störmer, Arch. Sci. Phys. Nat. 24 (1907) 5; "
        "H. R. Dullin, M. Horányi, J. E. Howard, Physica D 171 (2002) 178, doi:10.1016/S0167-2789(02)00550-X",
        aliases=("stormer-problem", "störmer-problem")),
)  # fmt: skip
