"""The Sun and the outer planets, each of which is an effect."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction
from operator import mul, sub

from .base import Scene
from .n_body import gravity

SUMMARY = "the Sun and the five outer planets (with Pluto) from September 5, 1994, in three dimensions"
REFERENCE = "HLW, section I.2.4, with data of the Ahnerts Kalender für Sternfreunde 1994"

# Solar masses, astronomical units and days; the Sun's mass includes the inner planets.
GRAVITATION = "2.95912208286e-4"
BODIES = {
    "sun": ("1.00000597682", ("0", "0", "0"), ("0", "0", "0")),
    "jupiter": (
        "0.000954786104043",
        ("-3.5023653", "-3.8169847", "-1.5507963"),
        ("0.00565429", "-0.00412490", "-0.00190589"),
    ),
    "saturn": (
        "0.000285583733151",
        ("9.0755314", "-3.0458353", "-1.6483708"),
        ("0.00168318", "0.00483525", "0.00192462"),
    ),
    "uranus": (
        "0.0000437273164546",
        ("8.3101420", "-16.2901086", "-7.2521278"),
        ("0.00354178", "0.00137102", "0.00055029"),
    ),
    "neptune": (
        "0.0000517759138449",
        ("11.4707666", "-25.7294829", "-10.8169456"),
        ("0.00288930", "0.00114527", "0.00039677"),
    ),
    "pluto": (
        "1/130000000",
        ("-15.5387357", "-25.2225594", "-3.1902382"),
        ("0.00276725", "-0.00170702", "-0.00136504"),
    ),
}
EFFECTS = {name: f"{name.title()}, of mass {mass}" for name, (mass, _, _) in BODIES.items() if name != "sun"}


def outer_solar_system(*, effects: Collection[str] = tuple(EFFECTS)) -> Scene:
    """Gravity among the Sun and the planets that are on, in the frame where their barycentre rests at the origin.

    Masses are in solar masses, lengths in astronomical units, times in days, and momenta are p = m v.

    Args:
        effects: The planets; all of them by default.

    Example:
        >>> outer_solar_system(effects=["jupiter"]).parameters["m"]
        (50000298841/50000000000, 954786104043/1000000000000000)
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
        name="outer-solar-system",
        summary=f"the Sun with {', '.join(planets)}" if planets else "the Sun alone",
        reference=REFERENCE,
    )


def bodies(effects: Collection[str]) -> tuple[str, ...]:
    """The Sun and the planets that are on, in the order in which the scene has them."""
    return tuple(name for name in BODIES if name in ("sun", *effects))


def _about_the_mean(rows: Sequence[Sequence[str]], masses: Sequence[Fraction]) -> list[list[Fraction]]:
    """Vectors less their mean, weighted by the masses: exactly, as all of this is rational."""
    vectors = [[Fraction(x) for x in row] for row in rows]
    zero, columns = Fraction(0), zip(*vectors, strict=True)
    mean = [sum(map(mul, masses, column), zero) / sum(masses, zero) for column in columns]
    return [list(map(sub, vector, mean)) for vector in vectors]


SCENES = (("outer-solar-system", outer_solar_system, SUMMARY, REFERENCE, (), EFFECTS, bodies),)
