"""The page of a method and a scene: one template for the file and for the server."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.explorer.stability_shapes import stability_shapes
from foundation.extras import optional_module
from integrators import RungeKutta
from integrators.core.errors import IntegratorError

if TYPE_CHECKING:
    from bseries.explorer.flows import SceneShape
    from bseries.explorer.method_facts import MethodFacts
    from bseries.explorer.stability_shapes import StabilityShapes
    from integrators.methods.programs.program import Method


@cache
def template() -> Any:
    """The template of pages, in which text is escaped."""
    jinja2 = optional_module("jinja2", "explore")
    text = Path(__file__).with_name("page.html").read_text(encoding="utf-8")
    return jinja2.Environment(autoescape=True).from_string(text)


def region_of(method: Method) -> StabilityShapes | str:
    """The stability region of a method, or a sentence on why there is none."""
    if not isinstance(method, RungeKutta):
        return f"There is no stability region of {method.name}, which is not given by one tableau."
    try:
        return stability_shapes(method)
    except (IntegratorError, SeriesError) as error:
        return f"There is no stability region: {error}."


def method_variables(facts: MethodFacts, region: StabilityShapes | str) -> dict[str, Any]:
    """What the template says about a method."""
    title = f"{facts.name}: order {facts.order}"
    if isinstance(region, str):
        return {"title": title, "facts": facts, "stability_sentence": region}
    return {"title": title, "facts": facts, "stability_formula": region.formula}


def scene_variables(scene: SceneShape, pictures: Sequence[str]) -> dict[str, Any]:
    """What the template says about a scene."""
    notes = [f"Start: {scene.start}. Times to {scene.span:g}."]
    if not scene.energy_terms:
        notes.append("The scene has no Hamiltonian, so no energy is shown.")
    elif scene.energy_terms == 1:
        notes.append("The method has no modified Hamiltonian on this scene: H̃ is shown for one term only, as H.")
    elif scene.energy_terms < scene.terms:
        notes.append(f"The modified Hamiltonian ends: H̃ is shown for up to {scene.energy_terms} terms.")
    if scene.area:
        notes.append(f"The area is {scene.area}; it is left out where the boundary is too long for its points.")
    notes.append(
        "The modified equation is a truncated asymptotic series: more terms help for small h only, and where h "
        "sweeps into chaos none do."
    )
    return {"scene": scene.title, "pictures": list(pictures), "scene_notes": notes}
