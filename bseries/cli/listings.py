"""Tables of methods and scenes with their entries in the catalogues."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from bseries.scene_text import with_effects
from foundation.table import Table, paragraphs
from integrators import PartitionedRungeKutta, RungeKutta, catalogue, scene_catalogue
from integrators.scenes.scene import Scene, typed_value

if TYPE_CHECKING:
    from integrators import Method


def method_table(method: Method) -> Table:
    """The tableau, the flows or the program of a method, with its entry in the catalogue."""
    table = method.to_table()
    facts = [*_entry_facts(method), *table.notes]
    if not isinstance(method, RungeKutta | PartitionedRungeKutta):
        return table._replace(notes=facts)
    own = {
        "table": lambda width: f"{method.name}\n\n{method}\n\n" + paragraphs(facts, width),
        "markdown": lambda width: f"{method.name}\n\n```text\n{method}\n```\n\n" + "".join(f"- {x}\n" for x in facts),
    }
    return table._replace(notes=facts, own={**table.own, **own})


def _entry_facts(method: Method) -> Iterator[str]:
    """The entry of a method in the catalogue, in sentences."""
    found = (e for e in catalogue() if method.name == (f"{e.name}{method.stages}" if e.is_family else e.name))
    entry = next(found, None)
    if entry is not None:
        order = f"{entry.order} with s stages" if entry.is_family else str(entry.order)
        yield entry.description
        yield f"kind: {entry.kind}, stages: {method.stages}, order: {order}"
        if entry.aliases:
            yield f"aliases: {', '.join(entry.aliases)}"


def scene_table(scene: Scene, effects: Sequence[str] | None = None) -> Table:
    """The table of a scene, with its entry in the catalogue."""
    table = scene.to_table()
    title = with_effects(scene.name, scene.active if effects is None else effects)
    rows = [*table.rows, *_scene_entry_facts(scene)]
    records = table.records and table.records._replace(rows=rows)
    return table._replace(title=table.title.replace(scene.title, title, 1), rows=rows, records=records)


def _scene_entry_facts(scene: Scene) -> Iterator[tuple[str, str]]:
    """Options, built-in effects and aliases of a scene of the catalogue."""
    entry = next((entry for entry in scene_catalogue() if entry.name == scene.name), None)
    if entry is None:
        return
    for name, value in entry.options.items():
        if name not in scene.parameters:
            yield f"option {name}", f"by default {typed_value(value)}"
    yield from ((f"effect {name}", summary) for name, summary in (entry.built_in_effects or {}).items())
    if entry.aliases:
        yield "also called", ", ".join(entry.aliases)
