"""The page of a method and a scene: one template for the file and for the server."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foundation.extras import optional_module

if TYPE_CHECKING:
    from bseries.explorer.flows import SceneShape
    from bseries.explorer.method_facts import MethodFacts
    from bseries.explorer.stability_shapes import StabilityShapes


@cache
def template() -> Any:
    """The template of pages, in which text is escaped."""
    jinja2 = optional_module("jinja2", "explore")
    text = Path(__file__).with_name("page.html").read_text(encoding="utf-8")
    return jinja2.Environment(autoescape=True).from_string(text)


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
