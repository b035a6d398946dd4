"""`bseries scenes`: the built-in scenes, one scene in detail, and scene files."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.scene_argument import takes_scene
from bseries.cli.output import Output, takes_output
from foundation.table import Table

if TYPE_CHECKING:
    from integrators import Scene


HINT = "`bseries scenes NAME` shows one in detail; --format csv and json list all sources."


def takes_toml(write: Callable[..., None]) -> Callable[..., None]:
    """Add the option --toml to a verb; an output file that ends in .toml implies it, and --format excludes it."""

    @click.option("--toml", is_flag=True, help="Write the scene as a TOML file; implied by -o FILE.toml.")
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
    from bseries.cli.listings import scene_table
    from integrators import scene_catalogue

    if scene is None and toml:
        raise Refusal("SCENE must be given where a TOML file is written, but was not")
    if scene is None:
        return scene_catalogue().to_table().extended(notes=[HINT])
    return scene.to_toml() if toml else scene_table(scene, effects)
