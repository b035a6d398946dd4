"""Mechanical systems with up to three degrees of freedom, and charged particles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from bseries_base.errors import shorten
from integrators.core.arguments import items
from integrators.core.errors import IntegratorError
from integrators.scenes.catalogue.registry import SceneEntry
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.model.terms import Effect, Term
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import sympy


def harmonic_oscillator() -> Scene:
    """H = (p² + ω² q²)/2, from (p, q) = (0, 1) with ω = 1: q = cos t."""
    return Scene(
        {"p": 1, "q": 1},
        hamiltonian="(p^2 + omega^2*q^2)/2",
        parameters={"omega": 1},
        start={"p": [0], "q": [1]},
    )


def pendulum() -> Scene:
    """H = p²/2 − cos q, with mass, length and gravity 1."""
    return Scene(
        {"p": 1, "q": 1},
        hamiltonian="p^2/2 - cos(q)",
        start={"p": [0], "q": ["-3/2"]},
        effects={
            "asymmetry": Effect(
                hamiltonian="epsilon*sin(2*q)",
                parameters={"epsilon": "1/5"},
                summary="a second harmonic that is not symmetric in q: energy drifts where it did not",
            ),
            "damping": Effect(field={"p": "-gamma*p"}, parameters={"gamma": "1/10"}, summary="friction, −γp"),
            "drive": Effect(
                field={"p": "amplitude*cos(omega*t)"},
                parameters={"amplitude": "1/2", "omega": "2/3"},
                summary="a periodic force, a cos(ωt)",
            ),
        },
    )


KINETIC = (
    "(m2*l2^2*p1^2 - 2*m2*l1*l2*cos(q1 - q2)*p1*p2 + (m1 + m2)*l1^2*p2^2) / (2*m2*l1^2*l2^2*(m1 + m2*sin(q1 - q2)^2))"
)
POTENTIAL = "-(m1 + m2)*g*l1*cos(q1) - m2*g*l2*cos(q2)"


def double_pendulum() -> Scene:
    """Angles q from the vertical and their momenta p; masses, lengths and gravity are 1; from rest at right angles."""
    return Scene(
        {"p": 2, "q": 2},
        hamiltonian=f"{KINETIC} + {POTENTIAL}",
        parameters={"m1": 1, "m2": 1, "l1": 1, "l2": 1, "g": 1},
        start={"p": [0, 0], "q": ["pi/2", "pi/2"]},
        positive=["m1", "m2", "l1", "l2"],
    )


LEAST_ENERGY = "7/1500"
"""The potential at the start q = (0, 1/10)."""


def henon_heiles(*, energy: object = "1/12") -> Scene:
    """H = (|p|² + |q|²)/2 + q1² q2 − q2³/3, from q = (0, 1/10) in the direction of q1.

    Args:
        energy: The value of H at the start; below 1/6 orbits are bounded.
    """
    import sympy

    kinetic = read_formula(energy, (), "energy") - sympy.Rational(LEAST_ENERGY)
    if not kinetic >= 0:
        raise IntegratorError(f"energy must be at least {LEAST_ENERGY}, but was {shorten(str(energy))}")
    return Scene(
        {"p": 2, "q": 2},
        hamiltonian="(p1^2 + p2^2 + q1^2 + q2^2)/2 + q1^2*q2 - q2^3/3",
        start={"p": [sympy.sqrt(2 * kinetic), 0], "q": [0, "1/10"]},
    )


def central_field(*, potential: object = "-1/r") -> Scene:
    """H = (p_r² + p_φ²/r²)/2 + V(r), from the perihelion of `kepler` (r = 2/5, p_φ = 4/5).

    Args:
        potential: V, a formula in r.
    """
    return Scene(
        {"p": ["p_r", "p_phi"], "q": ["r", "phi"]},
        hamiltonian="(p_r^2 + p_phi^2/r^2)/2",
        terms=[Term(hamiltonian=read_formula(potential, ("r",), "potential"))],
        invariants={"angular_momentum": "p_phi"},
        start={"p": [0, "4/5"], "q": ["2/5", 0]},
        effects={
            "perturbation": Effect(
                hamiltonian="-mu/(3*r^3)",
                parameters={"mu": "3/200"},
                summary="an inverse cube, −μ/(3 r³): the perihelion of the Kepler problem advances",
            ),
        },
        positive=["r"],
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
    )


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


def _read_magnetic_field(magnetic: object) -> list[sympy.Expr]:
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
    *, magnetic: object = ("0", "0", "sqrt(x^2 + y^2)"), potential: object = "1/(100*sqrt(x^2 + y^2))"
) -> Scene:
    """B = (0, 0, r) and U = 1/(100 r) with r² = x² + y², from (0, −1, 0) with the velocity (1/10, 1/100, 0).

    Args:
        magnetic: The components of B, three formulas in x, y, z with divergence 0.
        potential: U, a formula in x, y, z.
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
    SceneEntry("harmonic-oscillator", harmonic_oscillator, "the harmonic oscillator with the frequency ω",
        "L. D. Landau, E. M. Lifshitz, Mechanics, §21; HLW, section I.5.2 (its integrators)",
        title="harmonic oscillator"),
    SceneEntry("pendulum", pendulum, "the mathematical pendulum",
        "HLW, section I.1.3; E. Hairer, lecture on long-time behaviour, example 4 and section 4"),
    SceneEntry("double-pendulum", double_pendulum, "two pendulums, one hanging from the other: chaotic at large angles",
        "L. D. Landau, E. M. Lifshitz, Mechanics, §5, problem 1 (the Lagrangian)", title="double pendulum"),
    SceneEntry("henon-heiles", henon_heiles,
        "the Hénon–Heiles model: regular orbits at low energies, chaos towards 1/6",
        "M. Hénon, C. Heiles, Astron. J. 69 (1964) 73, doi:10.1086/109234; HLW, section I.3",
        aliases=("hénon-heiles",), title="Hénon–Heiles"),
    SceneEntry("central-field", central_field, "motion in a central field V(r), in polar coordinates",
        "HLW, section X.1; E. Hairer, lecture on long-time behaviour, example 8 and exercises 3, 4",
        title="central field"),
    SceneEntry("field-nijhoff", field_nijhoff,
        "H = ln(α + p) + ln(β + q): the modified Hamiltonian of symplectic Euler is known in closed form",
        "C. M. Field, F. W. Nijhoff, Nonlinearity 16 (2003) 1673; "
        "E. Hairer, lecture on long-time behaviour, exercise 5", title="Field–Nijhoff"),
    SceneEntry("charged-particle", charged_particle, "a charged particle in a magnetic field B(x) and a potential U(x)",
        "H. Qin et al., Phys. Plasmas 20 (2013) 084503, doi:10.1063/1.4818428; "
        "E. Hairer, C. Lubich, BIT 58 (2018) 969–979, doi:10.1007/s10543-018-0713-1", title="charged particle"),
    SceneEntry("magnetic-dipole", magnetic_dipole,
        "Störmer's problem: a charged particle in the field of a magnetic dipole, such as the Earth",
        "C. Störmer, Arch. Sci. Phys. Nat. 24 (1907) 5; "
        "H. R. Dullin, M. Horányi, J. E. Howard, Physica D 171 (2002) 178, doi:10.1016/S0167-2789(02)00550-X",
        aliases=("stormer-problem", "störmer-problem"), title="magnetic dipole"),
)  # fmt: skip
