"""`bseries methods` and `bseries scenes`: the catalogues, one method or one scene in detail, and scene files."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.scene_argument import takes_scene
from bseries.cli.output import Output, PlotFile, takes_output, takes_plot, takes_text
from bseries_base.table import Table, paragraphs

if TYPE_CHECKING:
    from integrators import Method, Scene

METHODS_HINT = "`bseries methods NAME` shows a tableau and its source; --format csv and json list all sources."
SCENES_HINT = "`bseries scenes NAME` shows one in detail; --format csv and json list all sources."


@click.command()
@takes_method(required=False)
@takes_text("--as", "PACKAGE", "Source text for nodepy, diffrax, scipy, sundials, petsc, rungekutta.jl or sciml.")
@takes_plot
@takes_output
def methods(method: Method | None, language: str | None, plot: PlotFile, output: Output) -> Table | str:
    """The catalogue of methods, or the tableau of one.

    With METHOD, its tableau and its source. A name that ends in {s} is a family: write the number of stages in its
    place, as in gauss3. JSON of one method is a tableau file, which every verb reads back. CSV and LaTeX round to
    floats where a method has irrational entries and more than three stages. --plot draws the tableau.

    \b
    Examples:
      bseries methods
      bseries methods dormand-prince54
      bseries methods gauss2 --format latex
      bseries methods --format csv -o methods.csv
      bseries methods rk4 -o mine.json
      bseries methods tsit5 --as diffrax -o tsit5.py
    """
    from integrators import catalogue
    from integrators.methods import export_tableau

    if language is not None:
        if method is None:
            raise Refusal(f"METHOD must be given where --as is, but only {language!r:.60} was")
        return export_tableau(method, language)
    if method is None:
        if plot.path is not None:
            raise Refusal("METHOD must be given with --plot, but was not")
        return catalogue().to_table().extended(notes=[METHODS_HINT])
    plot.save(method.plot)
    return _method_table(method)


def _method_table(method: Method) -> Table:
    """The tableau, the flows or the program of a method, with its entry in the catalogue."""
    from integrators import PartitionedRungeKutta, RungeKutta, catalogue

    table = method.to_table()
    found = (e for e in catalogue() if method.name == (f"{e.name}{method.stages}" if e.is_family else e.name))
    facts = list(table.notes)
    if (entry := next(found, None)) is not None:
        order = f"{entry.order} with s stages" if entry.is_family else str(entry.order)
        own_facts = [entry.description, f"kind: {entry.kind}, stages: {method.stages}, order: {order}"]
        facts = [*own_facts, *([f"aliases: {', '.join(entry.aliases)}"] if entry.aliases else []), *facts]
    if not isinstance(method, RungeKutta | PartitionedRungeKutta):
        return table._replace(notes=facts)
    own = {
        "table": lambda width: f"{method.name}\n\n{method}\n\n" + paragraphs(facts, width),
        "markdown": lambda width: f"{method.name}\n\n```text\n{method}\n```\n\n" + "".join(f"- {x}\n" for x in facts),
    }
    return table._replace(notes=facts, own={**table.own, **own})


def takes_toml(write: Callable[..., None]) -> Callable[..., None]:
    """Add the option --toml to a verb; an output file that ends in .toml implies it, and --format excludes it."""

    @click.option("--toml", is_flag=True, help="Write the scene as a TOML file; implied by -o FILE.toml.")
    @functools.wraps(write)
    def call(*, toml: bool, format_: str | None, path: str | None, **options: object) -> None:
        toml = toml or (path or "").lower().endswith(".toml")
        if toml and format_ is not None:
            raise Refusal(f"format must be left out where a TOML file is written, but was {format_!r:.60}")
        write(toml=toml, format_="table" if toml else format_, path=path, **options)

    return call


@click.command()
@takes_scene(as_argument=True, required=False)
@takes_toml
@takes_output
def scenes(scene: Scene | None, effects: Sequence[str], toml: bool, output: Output) -> Table | str:
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
    from integrators import scene_catalogue

    if scene is None and toml:
        raise Refusal("SCENE must be given where a TOML file is written, but was not")
    if scene is None:
        return scene_catalogue().to_table().extended(notes=[SCENES_HINT])
    return scene.to_toml() if toml else _scene_table(scene, effects)


def _scene_table(scene: Scene, effects: Sequence[str] | None = None) -> Table:
    """The table of a scene, with its entry in the catalogue."""
    from bseries.scene_text import with_effects

    table = scene.to_table()
    title = with_effects(scene.name, scene.active if effects is None else effects)
    rows = [*table.rows, *_scene_entry_facts(scene)]
    records = table.records and table.records._replace(rows=rows)
    return table._replace(title=table.title.replace(scene.title, title, 1), rows=rows, records=records)


def _scene_entry_facts(scene: Scene) -> Iterator[tuple[str, str]]:
    """Options, built-in effects and aliases of a scene of the catalogue."""
    from integrators import scene_catalogue
    from integrators.scenes.scene import typed_value

    entry = next((entry for entry in scene_catalogue() if entry.name == scene.name), None)
    if entry is None:
        return
    for name, value in entry.options.items():
        if name not in scene.parameters:
            yield f"option {name}", f"by default {typed_value(value)}"
    yield from ((f"effect {name}", summary) for name, summary in (entry.built_in_effects or {}).items())
    if entry.aliases:
        yield "also called", ", ".join(entry.aliases)
