"""`bseries scenes`: the built-in scenes, one scene in detail, and scene files."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli import table
from bseries.cli.application import Refusal
from bseries.cli.options.scene_argument import takes_scene
from bseries.cli.output import takes_output
from bseries.cli.scene_latex import latex_formula, latex_words
from bseries.cli.table import Column
from integrators.core.errors import shorten

if TYPE_CHECKING:
    import sympy

    from integrators import Scene
    from integrators.scenes.catalogue.entry import SceneEntry
    from integrators.scenes.model.terms import Summand

    Value = str | Sequence[sympy.Expr]

    from bseries.cli.output import Output


SUMS = {
    "each": "each site",
    "chain": "neighbours in a chain",
    "ring": "neighbours in a ring",
    "pairs": "pairs of sites",
}


def fact_rows(scene: Scene) -> list[tuple[str, str]]:
    """The facts as text."""

    def text(value: Value) -> str:
        from integrators.scenes.model.formulas import formula_text

        return value if isinstance(value, str) else ", ".join(_decimal(x) or formula_text(x) for x in value)

    return [(what, text(value)) for what, value in _facts(scene)]


def latex_rows(scene: Scene) -> list[tuple[str, str]]:
    """The facts as LaTeX."""

    def latex(value: Value) -> str:
        if isinstance(value, str):
            return latex_words(value)
        return ", ".join(f"${_decimal(x) or latex_formula(x, scene)}$" for x in value)

    return [(latex_words(what), latex(value)) for what, value in _facts(scene)]


def _decimal(number: Any) -> str | None:
    """The decimal of a rational number, if that is shorter than the fraction; else None."""
    from fractions import Fraction

    from integrators.exact.expressions import decimal_text

    if not number.is_Rational:
        return None
    decimal = decimal_text(Fraction(int(number.p), int(number.q)))
    return decimal if len(decimal) < len(str(number)) else None


def _facts(scene: Scene) -> Iterator[tuple[str, Value]]:
    """What is known: text, or formulas."""
    entry = _entry_of(scene)
    yield "variables", ", ".join(scene.variables)
    yield "blocks", ", ".join(f"{block.name} of {block.dimension}" for block in scene.blocks)
    for summand in scene.summands:
        yield _place(summand), [summand.formula]
    for k, row in enumerate(scene.poisson or (), 1):
        yield f"Poisson matrix, row {k}", row
    for name, value in scene.parameters.items():
        yield f"parameter {name}", value if isinstance(value, tuple) else [value]
    for name, value in entry.options.items() if entry else ():
        if name not in scene.parameters:
            yield f"option {name}", f"by default {_typed(value)}"
    yield from _effects(scene, entry)
    for name, formula in scene.invariants.items():
        yield f"invariant {name}", [formula]
    if scene.positive:
        yield "positive", scene.positive
    if scene.start is not None:
        yield from ((f"start {block.name}", scene.start[block.offset : block.end]) for block in scene.blocks)
    if entry and entry.aliases:
        yield "also called", ", ".join(entry.aliases)
    if scene.reference:
        yield "reference", scene.reference


def _entry_of(scene: Scene) -> SceneEntry | None:
    """What the catalogue says about scenes of this name; None if it has none."""
    from integrators import scene_catalogue

    return next((entry for entry in scene_catalogue() if entry.name == scene.name), None)


def _place(summand: Summand) -> str:
    """Where a formula goes: H or a derivative, over which sites, and in which part of the field."""
    target = "H" if summand.target is None else f"{summand.target}'"
    listed = "; ".join(" ".join(str(site + 1) for site in row) for row in summand.sites.table)
    where = f"sites {shorten(listed)}" if listed else SUMS.get(summand.sites.kind)
    part = summand.part and f"part {summand.part}"
    return ", ".join(filter(None, [target, where, part]))


def _effects(scene: Scene, entry: SceneEntry | None) -> Iterator[tuple[str, str]]:
    """The effects with their summaries; those that are off with the parameters that they would bring."""
    for name, effect in scene.effects.items():
        state, parameters = ("on", {}) if name in scene.active else ("off", effect.parameters)
        values = (f"{key} = {_typed(value)}" for key, value in parameters.items())
        yield f"effect {name} ({state})", "; ".join(filter(None, [effect.summary, *values]))
    for name, summary in ((entry and entry.built_in_effects) or {}).items():
        yield f"effect {name}", summary


def _typed(value: Any) -> str:
    """A value as it is typed behind --parameter NAME=."""
    if not isinstance(value, tuple):
        return str(value)
    return (";" if isinstance(value[0], tuple) else ",").join(map(_typed, value))


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
        return [table.json({"schema": 1, "kind": "scenes", "scenes": records}, "scenes")]
    if output.format == "csv":
        return table.csv(FIELDS, map(_csv_row, records))
    if output.format == "latex":
        from bseries.cli.scene_latex import latex_words

        return [table.latex(COLUMNS, ([latex_words(cell.replace("\n", "; ")) for cell in _row(r)] for r in records))]
    notes = ["`bseries scenes NAME` shows one in detail; --format csv and json list all sources."]
    if output.format == "markdown":
        return [table.markdown(COLUMNS, map(_row, records), title="Scenes", notes=notes)]
    return [table.text(COLUMNS, map(_row, records), output.width), table.paragraphs(["", *notes], output.width)]


def _record(entry: SceneEntry) -> dict[str, Any]:
    """What is known of a scene before it is chosen; its dimension is that with default options."""
    return {field: entry.build().dimension if field == "dimension" else getattr(entry, field) for field in FIELDS}


def _csv_row(record: dict[str, Any]) -> table.Row:
    return [str(value) if isinstance(value, str | int) else " ".join(value) for value in record.values()]


def _row(record: dict[str, Any]) -> table.Row:
    lists = (("also", record["aliases"]), ("options", record["options"]))
    description = [record["summary"], *(f"{what}: {', '.join(names)}" for what, names in lists if names)]
    return record["name"], str(record["dimension"]), ", ".join(record["effects"]), "\n".join(description)


def _details(scene: Scene, effects: Sequence[str], output: Output) -> Iterable[str]:
    """One scene in any format."""
    from integrators.core.errors import shorten

    if output.format == "json":
        return [table.json({"schema": 1, "kind": "scene", "dimension": scene.dimension, **scene.to_dict()})]
    if output.format == "latex":
        return [table.latex(FACTS, latex_rows(scene))]
    rows = fact_rows(scene)
    if output.format == "csv":
        return table.csv([column.heading for column in FACTS], rows)
    rows = [(what, shorten(value, MOST_CHARACTERS)) for what, value in rows]
    title = scene.name + " with " * bool(effects) + ", ".join(effects) + (f": {scene.summary}" if scene.summary else "")
    notes = [f"{note[0].upper()}{note[1:]}." for note in scene.notes]
    if output.format == "markdown":
        return [table.markdown(FACTS, rows, title=title, notes=notes)]
    text = table.text(FACTS, rows, output.width)
    return [table.paragraphs([title, ""], output.width), text, table.paragraphs(_below(notes), output.width)]


def _below(notes: Sequence[str]) -> list[str]:
    """Notes under an empty line, if there are any."""
    return ["", *notes] if notes else []
