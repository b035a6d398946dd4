"""Gravity: N-body problems, the outer solar system, and the planar Kepler problem, unperturbed and perturbed."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction
from operator import mul, sub

from bseries_base.errors import shorten
from integrators.core.arguments import items
from integrators.core.errors import IntegratorError
from integrators.scenes.catalogue import particles
from integrators.scenes.catalogue.registry import SceneEntry
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.model.terms import Effect, Term
from integrators.scenes.scene import Scene

# The digits are C. Simó's, as printed by Chenciner and Montgomery; with G = 1 the period is 6.32591398.
FIGURE_EIGHT = (("0.97000436", "-0.24308753"), ("-0.97000436", "0.24308753"), (0, 0))
FIGURE_EIGHT_VELOCITIES = (("0.466203685", "0.43236573"),) * 2 + (("-0.93240737", "-0.86473146"),)


def n_body(
    *, masses: object = (1, 1, 1), positions: object = FIGURE_EIGHT, velocities: object = FIGURE_EIGHT_VELOCITIES,
    effects: Collection[str] = (),
) -> Scene:  # fmt: skip
    """H = Σ |p_i|²/(2m_i) − Σ_{i<j} G m_i m_j / r_ij, with p_i = m_i v_i; G = 1 is a parameter.

    Args:
        masses: A number for each body.
        positions: A row of 2 or 3 numbers for each body.
        velocities: A row of the same length for each body.
        effects: ``softening`` replaces the distance r by sqrt(r² + epsilon²), with the parameter epsilon = 1/10.
    """
    return gravity(masses, positions, velocities, softened="softening" in effects)


def gravity(
    masses: object, positions: object, velocities: object, *, constant: object = 1, softened: bool = False,
    summary: str | None = None,
) -> Scene:  # fmt: skip
    """Bodies with given masses, positions and velocities; `constant` is the gravitational constant."""
    m = [particles.read_positive(mass, f"masses[{k}]") for k, mass in enumerate(items(masses, "masses"), 1)]
    q = particles.read_rows(positions, "positions", len(m))
    v = particles.read_rows(velocities, "velocities", len(m))
    lengths = [{len(row) for row in rows} for rows in (q, v)]
    if lengths not in ([{2}, {2}], [{3}, {3}]):
        found = " and of ".join(" and ".join(map(str, sorted(n))) or "none" for n in lengths)
        raise IntegratorError(
            f"positions and velocities must be rows of 2 numbers, or rows of 3, but had rows of {found}"
        )
    dimension = lengths[0].pop()
    square = particles.squared_distance(dimension) + " + epsilon^2" * softened
    return Scene(
        {"p": [len(m), dimension], "q": [len(m), dimension]},
        terms=[
            particles.kinetic_energy(dimension, "m_i"),
            Term(over="pairs", hamiltonian=f"-G*m_i*m_j/sqrt({square})"),
        ],
        parameters={"G": constant, "m": m, **({"epsilon": "1/10"} if softened else {})},
        invariants=particles.symmetry_integrals(len(m), dimension),
        start={"p": [[mass * x for x in row] for mass, row in zip(m, v, strict=True)], "q": q},
        summary=summary or f"gravity among {len(m)} bodies{', softened' * softened}",
    )


# Solar masses, astronomical units and days; the Sun's mass includes the inner planets.
GRAVITATION = "2.95912208286e-4"
BODIES = {
    "sun": ("1.00000597682", ("0", "0", "0"), ("0", "0", "0")),
    "jupiter": ("0.000954786104043", ("-3.5023653", "-3.8169847", "-1.5507963"),
        ("0.00565429", "-0.00412490", "-0.00190589")),
    "saturn": ("0.000285583733151", ("9.0755314", "-3.0458353", "-1.6483708"),
        ("0.00168318", "0.00483525", "0.00192462")),
    "uranus": ("0.0000437273164546", ("8.3101420", "-16.2901086", "-7.2521278"),
        ("0.00354178", "0.00137102", "0.00055029")),
    "neptune": ("0.0000517759138449", ("11.4707666", "-25.7294829", "-10.8169456"),
        ("0.00288930", "0.00114527", "0.00039677")),
    "pluto": ("1/130000000", ("-15.5387357", "-25.2225594", "-3.1902382"),
        ("0.00276725", "-0.00170702", "-0.00136504")),
}  # fmt: skip
OUTER_SOLAR_SYSTEM_EFFECTS = {
    name: f"{name.title()}, of mass {mass}" for name, (mass, _, _) in BODIES.items() if name != "sun"
}


def outer_solar_system(*, effects: Collection[str] = tuple(OUTER_SOLAR_SYSTEM_EFFECTS)) -> Scene:
    """The Sun and the chosen planets, in the frame where their barycentre rests at the origin.

    Masses are in solar masses, lengths in astronomical units, times in days, and momenta are p = m v.

    Args:
        effects: The planets; all of them by default.
    """
    names = bodies(effects)
    chosen = [BODIES[name] for name in names]
    masses = [Fraction(mass) for mass, _, _ in chosen]
    planets = [name.title() for name in names if name != "sun"]
    return gravity(
        masses,
        _about_the_mean([position for _, position, _ in chosen], masses),
        _about_the_mean([velocity for _, _, velocity in chosen], masses),
        constant=GRAVITATION,
        summary=f"the Sun with {', '.join(planets)}" if planets else "the Sun alone",
    )


def bodies(effects: Collection[str]) -> tuple[str, ...]:
    """The names of the Sun and of the planets among the effects, in the order of the scene."""
    return tuple(name for name in BODIES if name in ("sun", *effects))


def _about_the_mean(rows: Sequence[Sequence[str]], masses: Sequence[Fraction]) -> list[list[Fraction]]:
    """The vectors minus their mass-weighted mean, exactly."""
    vectors = [[Fraction(x) for x in row] for row in rows]
    zero, columns = Fraction(0), zip(*vectors, strict=True)
    mean = [sum(map(mul, masses, column), zero) / sum(masses, zero) for column in columns]
    return [list(map(sub, vector, mean)) for vector in vectors]


SQUARED_MOMENTUM = "(p1^2 + p2^2)"
DISTANCE = "sqrt(q1^2 + q2^2)"
ANGULAR_MOMENTUM = "(q1*p2 - q2*p1)"


def kepler(*, eccentricity: object = "3/5") -> Scene:
    """H = |p|²/2 − μ/|q|, from the perihelion of an ellipse with semi-major axis 1 (for μ = 1).

    Args:
        eccentricity: The eccentricity of the ellipse, at least 0 and less than 1.
    """
    runge_lenz = {
        "runge_lenz_1": f"p2*{ANGULAR_MOMENTUM} - mu*q1/{DISTANCE}",
        "runge_lenz_2": f"-p1*{ANGULAR_MOMENTUM} - mu*q2/{DISTANCE}",
    }
    return Scene(
        {"p": 2, "q": 2},
        hamiltonian=f"{SQUARED_MOMENTUM}/2 - mu/{DISTANCE}",
        parameters={"mu": 1},
        invariants={"angular_momentum": ANGULAR_MOMENTUM, **runge_lenz},
        start=_perihelion(eccentricity),
        effects=_effects("mu", *runge_lenz),
        positive=["q1^2 + q2^2"],
    )


def perturbed_kepler(*, eccentricity: object = "3/5") -> Scene:
    """H = |p|²/2 − 1/|q| − μ/(3 |q|³), with the start of `kepler`."""
    return Scene(
        {"p": 2, "q": 2},
        hamiltonian=f"{SQUARED_MOMENTUM}/2 - 1/{DISTANCE} - mu/(3*{DISTANCE}^3)",
        parameters={"mu": "3/200"},
        invariants={"angular_momentum": ANGULAR_MOMENTUM},
        start=_perihelion(eccentricity),
        effects=_effects("1"),
        positive=["q1^2 + q2^2"],
    )


def _perihelion(eccentricity: object) -> dict[str, object]:
    """Start at the perihelion of an ellipse with semi-major axis 1 (HLW, section I.2.3)."""
    import sympy

    e = read_formula(eccentricity, (), "eccentricity")
    if not 0 <= e < 1:
        raise IntegratorError(f"eccentricity must be at least 0 and less than 1, but was {shorten(str(e))}")
    return {"p": [0, sympy.sqrt((1 + e) / (1 - e))], "q": [1 - e, 0]}


def _effects(gravity: str, *directions: str) -> dict[str, Effect]:
    """Perturbations of the Kepler problem with gravitational parameter `gravity`.

    Relativity is the first post-Newtonian Hamiltonian of a test particle, in isotropic coordinates (P. Saha,
    S. Tremaine, Astron. J. 108 (1994) 1962, doi:10.1086/117210). Oblateness is the second zonal harmonic in the
    equatorial plane (J. M. A. Danby, Fundamentals of Celestial Mechanics). To first order the perihelion advances by
    6πμ/(c² a(1 − e²)) and 3π J₂ (R/(a(1 − e²)))² in each revolution. `directions` are the invariants that fix the
    perihelion.
    """
    relativity = f"-{SQUARED_MOMENTUM}^2/8 - 3*{gravity}*{SQUARED_MOMENTUM}/(2*{DISTANCE}) + ({gravity}/{DISTANCE})^2/2"
    return {
        "relativity": Effect(
            hamiltonian=f"({relativity})/c^2",
            parameters={"c": 100},
            breaks=directions,
            summary="the first post-Newtonian term, with the speed of light c (Mercury: about 6260)",
        ),
        "oblateness": Effect(
            hamiltonian=f"-{gravity}*J2*R^2/(2*{DISTANCE}^3)",
            parameters={"J2": "1/1000", "R": "1/4"},
            breaks=directions,
            summary="a flattened centre of radius R, −μ J₂ R²/(2 r³) in the plane of its equator",
        ),
        "drag": Effect(
            field={"p1": "-gamma*p1", "p2": "-gamma*p2"},
            parameters={"gamma": "1/1000"},
            breaks=("angular_momentum", *directions),
            summary="linear drag, −γp: the orbit shrinks",
        ),
    }


SCENES = (
    SceneEntry("n-body", n_body,
        "bodies that attract each other by gravity; by default, three that follow each other along a figure eight",
        "A. Chenciner, R. Montgomery, Annals of Mathematics 152 (2000) 881–901, doi:10.2307/2661357; HLW, section I.2",
        built_in_effects={"softening": "sqrt(r² + epsilon²) in place of the distance r, so that forces stay finite"}),
    SceneEntry("outer-solar-system", outer_solar_system,
        "the Sun and the five outer planets (with Pluto) from September 5, 1994, in three dimensions",
        "HLW, section I.2.4, with data of the Ahnerts Kalender für Sternfreunde 1994",
        built_in_effects=OUTER_SOLAR_SYSTEM_EFFECTS, bodies=bodies, title="outer solar system"),
    SceneEntry("kepler", kepler, "a planet about the sun, with eccentricity 3/5 and period 2π",
        "HLW, section I.2 and exercise I.6.9 (the Runge–Lenz vector)", title="Kepler"),
    SceneEntry("perturbed-kepler", perturbed_kepler, "a planet whose perihelion advances, V(r) = −1/r − μ/(3 r³)",
        "HLW, exercise I.6.12 and section VIII.1 (μ = 0.015); E. Hairer, lecture on long-time behaviour, example 8",
        title="perturbed Kepler"),
)  # fmt: skip
