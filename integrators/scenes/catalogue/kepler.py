"""The planar Kepler problem, unperturbed and with an inverse-cube perturbation."""

from __future__ import annotations

from typing import Any

from integrators.core.errors import IntegratorError, shorten
from integrators.scenes.catalogue.entry import SceneEntry
from integrators.scenes.model.effects import Effect
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.scene import Scene

SQUARED_MOMENTUM = "(p1^2 + p2^2)"
DISTANCE = "sqrt(q1^2 + q2^2)"
ANGULAR_MOMENTUM = "(q1*p2 - q2*p1)"


def kepler(*, eccentricity: Any = "3/5") -> Scene:
    """H = |p|²/2 − μ/|q|, from the perihelion of an ellipse with semi-major axis 1 (for μ = 1).

    Args:
        eccentricity: The eccentricity of the ellipse, at least 0 and less than 1.

    Raises:
        IntegratorError: `eccentricity` is outside this range.

    Example:
        >>> kepler(eccentricity="1/2").start
        (0, sqrt(3), 1/2, 0)
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


def perturbed_kepler(*, eccentricity: Any = "3/5") -> Scene:
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


def _perihelion(eccentricity: Any) -> dict[str, Any]:
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
    SceneEntry(
        "kepler",
        kepler,
        "a planet about the sun, with eccentricity 3/5 and period 2π",
        "HLW, section I.2 and exercise I.6.9 (the Runge–Lenz vector)",
    ),
    SceneEntry(
        "perturbed-kepler",
        perturbed_kepler,
        "a planet whose perihelion advances, V(r) = −1/r − μ/(3 r³)",
        "HLW, exercise I.6.12 and section VIII.1 (μ = 0.015); E. Hairer, lecture on long-time behaviour, example 8",
    ),
)
