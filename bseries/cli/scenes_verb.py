"""`bseries scenes`: the built-in scenes, one scene in detail, and scene files."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import click

from . import layout
from .application import Refusal
from .layout import Column
from .output import takes_output
from .scene_argument import takes_scene

if TYPE_CHECKING:
    from integrators import Scene
    from integrators.scenes.registry import SceneEntry

    from .output import Output

COLUMNS = (Column("name"), Column("variables", True), Column("effects"), Column("description"))
FIELDS = ("name", "dimension", "effects", "options", "aliases", "summary", "reference")
FACTS = (Column("what"), Column("value"))
MOST_CHARACTERS = 300
"""Longer formulas and lists are cut in tables for readers: they are those of many particles."""


def takes_toml(write: Callable[..., None]) -> Callable[..., None]:
    """Give a verb the option --toml, which a file ending in .toml stands for, too; then there is no other format."""

    @click.option("--toml", is_flag=True, help="Write the scene as a file; so does -o FILE.toml.")
    @functools.wraps(write)
    def call(*, toml: bool, format_: str | None, path: str | None, **options: Any) -> None:
        toml = toml or (path or "").lower().endswith(".toml")
        if toml and format_ is not None:
            raise Refusal(f"format must be left out where a TOML file is written, but was {format_!r:.60}")
        write(toml=toml, format_="table" if toml else format_, path=path, **options)

    return call


@click.command()
@takes_scene(as_argument=True, required=False)
@takes_toml
@takes_output
def scenes(scene: Scene | None, effects: Sequence[str], toml: bool, output: Output) -> Iterable[str]:
    """The built-in scenes, or one scene in detail.

    With SCENE (a name, a .toml file, or - for one on standard input), or with --ode or --hamiltonian: its variables,
    formulas, parameters, effects, first integrals and start. --toml writes it as a file, which every verb reads.

    \b
    Examples:
      bseries scenes
      bseries scenes kepler
      bseries scenes pendulum --effect damping --parameter gamma=1/5
      bseries scenes lennard-jones --parameter particles=20 --toml
      bseries scenes --hamiltonian "p^2/2 - mu*cos(q)" --parameter mu=2 --toml
      bseries scenes toda --format latex
    """
    if scene is None and toml:
        raise Refusal("SCENE must be given where a TOML file is written, but was not")
    if scene is None:
        return _catalogue(output)
    return [scene.to_toml()] if toml else _details(scene, effects, output)


def _catalogue(output: Output) -> Iterable[str]:
    """All built-in scenes in any format."""
    from integrators import scene_catalogue

    records = list(map(_record, scene_catalogue()))
    if output.format == "json":
        return [layout.json({"schema": 1, "kind": "scenes", "scenes": records}, "scenes")]
    if output.format == "csv":
        return layout.csv(FIELDS, map(_csv_row, records))
    if output.format == "latex":
        from .scene_latex import latex_words

        return [layout.latex(COLUMNS, ([latex_words(cell.replace("\n", "; ")) for cell in _row(r)] for r in records))]
    notes = ["`bseries scenes NAME` shows one in detail; --format csv and json list all sources."]
    if output.format == "markdown":
        return [layout.markdown(COLUMNS, map(_row, records), title="Scenes", notes=notes)]
    return [layout.table(COLUMNS, map(_row, records), output.width), layout.paragraphs(["", *notes], output.width)]


def _record(entry: SceneEntry) -> dict[str, Any]:
    """What is known of a scene before it is chosen; its dimension is that with default options."""
    return {field: entry.build().dimension if field == "dimension" else getattr(entry, field) for field in FIELDS}


def _csv_row(record: dict[str, Any]) -> layout.Row:
    return [str(value) if isinstance(value, str | int) else " ".join(value) for value in record.values()]


def _row(record: dict[str, Any]) -> layout.Row:
    lists = (("also", record["aliases"]), ("options", record["options"]))
    description = [record["summary"], *(f"{what}: {', '.join(names)}" for what, names in lists if names)]
    return record["name"], str(record["dimension"]), ", ".join(record["effects"]), "\n".join(description)


def _details(scene: Scene, effects: Sequence[str], output: Output) -> Iterable[str]:
    """One scene in any format."""
    from integrators.expressions import shorten

    from . import scene_facts

    if output.format == "json":
        from integrators.scenes.files import scene_table

        return [layout.json({"schema": 1, "kind": "scene", "dimension": scene.dimension, **scene_table(scene)})]
    if output.format == "latex":
        return [layout.latex(FACTS, scene_facts.latex_rows(scene))]
    rows = scene_facts.rows(scene)
    if output.format == "csv":
        return layout.csv([column.heading for column in FACTS], rows)
    rows = [(what, shorten(value, MOST_CHARACTERS)) for what, value in rows]
    title = scene.name + " with " * bool(effects) + ", ".join(effects) + (f": {scene.summary}" if scene.summary else "")
    notes = [f"{note[0].upper()}{note[1:]}." for note in scene.notes]
    if output.format == "markdown":
        return [layout.markdown(FACTS, rows, title=title, notes=notes)]
    text = layout.table(FACTS, rows, output.width)
    return [layout.paragraphs([title, ""], output.width), text, layout.paragraphs(_below(notes), output.width)]


def _below(notes: Sequence[str]) -> list[str]:
    """Notes under an empty line, if there are any."""
    return ["", *notes] if notes else []
