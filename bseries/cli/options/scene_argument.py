"""The scene that a verb works on: a name, a file, standard input or text, with its effects and parameters."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import click

from bseries.cli.application import Refusal, standard_input
from integrators.core.arguments import split_row

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from bseries.cli.options.method_argument import Method
    from integrators import Scene

T = TypeVar("T")

WAYS = ("--scene", "--ode", "--hamiltonian")
KEYWORDS = ("self", "effects")
"""Reserved names; effects are switched on by --effect."""


def complete_scene(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completions of SCENE: names of built-in scenes, and files."""
    from click.shell_completion import CompletionItem

    from integrators import scene_catalogue

    if is_path(incomplete) or incomplete.startswith("."):
        return [CompletionItem(incomplete, type="file")]
    names = ((name, entry.summary) for entry in scene_catalogue() for name in (entry.name, *entry.aliases))
    return [CompletionItem(name, help=summary) for name, summary in names if name.startswith(incomplete)]


def complete_effect(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completions of --effect: effects of the given scene, or of all scenes."""
    from click.shell_completion import CompletionItem

    from integrators import scene_catalogue

    typed = ctx.params.get("scene_source")
    entries = [entry for entry in scene_catalogue() if typed is None or typed in (entry.name, *entry.aliases)]
    effects = {name: summary for entry in entries for name, summary in entry.effects.items()}
    return [CompletionItem(name, help=summary) for name, summary in effects.items() if name.startswith(incomplete)]


def takes_scene(
    *, as_argument: bool = False, required: bool = True, compare: bool = False
) -> Callable[[Callable[..., T]], Callable[..., T]]:
    """Add the option --scene, or the argument SCENE, and its options to a verb.

    The verb receives `scene` (None if not given) and `effects`, the names of the active effects.
    """
    where = "name from `bseries scenes`, a .toml file, or - for one on standard input"
    if as_argument:
        metavar = "SCENE" if required else "[SCENE]"
        source = click.argument("scene_source", metavar=metavar, required=False, shell_complete=complete_scene)
    else:
        source = click.option(
            "--scene", "scene_source", metavar="SCENE", help=f"The problem: a {where}.", shell_complete=complete_scene
        )

    def decorate(verb: Callable[..., T]) -> Callable[..., T]:
        @source
        @click.option("--ode", metavar="TEXT", help="The problem as equations, \"p' = -sin(q); q' = p\".")
        @click.option("--hamiltonian", metavar="TEXT", help='The problem as a Hamiltonian, "p^2/2 - cos(q)".')
        @click.option("--blocks", metavar="TEXT", help='Blocks of variables in such text, as in "p=x,u;q=y".')
        @click.option(
            "--effect", "effects", metavar="NAME", multiple=True, shell_complete=complete_effect,
            help="An effect to examine; repeatable; by default, all." if compare
            else "An effect of the scene to switch on; repeatable.",
        )  # fmt: skip
        @click.option(
            "--parameter", "parameters", metavar="NAME=VALUE", multiple=True,
            help="Value of a parameter or option of the scene; repeatable.",
        )  # fmt: skip
        @functools.wraps(verb)
        def read(*, effects: tuple[str, ...], parameters: tuple[str, ...], blocks: str | None, **options: Any) -> T:
            way, text = _chosen_way(*(options.pop(name) for name in ("scene_source", "ode", "hamiltonian")))
            values = read_values(parameters)
            if blocks is not None and way in (None, "--scene"):
                raise Refusal(f"blocks must come with --ode or --hamiltonian, but was {blocks!r:.60} without")
            if way is None and (effects or values):
                raise Refusal("effect and parameter must come with a SCENE that has them, but there was none")
            if way is None and required:
                raise Refusal(f"SCENE must be given: a {where}; or --ode or --hamiltonian")
            if compare:
                scene = text if way == "--scene" and not is_path(text) else _plain_scene(way, text, blocks, values)
                return verb(scene=scene, effects=effects, parameters=values, **options)
            scene = None if way is None else _scene(way, text, blocks, effects, values)
            on = () if scene is None else scene.active or tuple(dict.fromkeys(effects))
            return verb(scene=scene, effects=on, **options)

        return read

    return decorate


def _chosen_way(*texts: str | None) -> tuple[str | None, str]:
    """The option that defines the scene, and its text; None if not given."""
    given = [(way, text) for way, text in zip(WAYS, texts, strict=True) if text is not None]
    if len(given) > 1:
        raise Refusal(f"SCENE must be given in one way, but was by {' and '.join(way for way, _ in given)}")
    return given[0] if given else (None, "")


def _plain_scene(way: str | None, text: str, blocks: str | None, values: dict[str, Any]) -> Scene:
    """The scene of a file or of equations, without changes."""
    from integrators import parse_hamiltonian, parse_scene

    if way == "--scene":
        return load_file(text)
    return (parse_scene if way == "--ode" else parse_hamiltonian)(text, blocks, values)


def _scene(way: str, text: str, blocks: str | None, effects: Sequence[str], values: dict[str, Any]) -> Scene:
    """The scene with its effects and parameters."""
    from integrators import scene

    if way == "--scene" and not is_path(text):
        return scene(text, effects=effects or None, **values)
    found = _plain_scene(way, text, blocks, values)
    return found.with_effects(*(effects or found.active), **(values if way == "--scene" else {}))


def read_values(parameters: Iterable[str]) -> dict[str, Any]:
    """The values of parameters from text such as ``mu=1/2``."""
    values = {name: _read_value(text) for name, text in read_assignments(parameters, "parameter", "mu=1/2").items()}
    for name in KEYWORDS:
        if name in values:
            raise Refusal(f"parameter must be one of the scene's, but was {name!r}")
    return values


def is_path(source: str) -> bool:
    """Whether a SCENE is a file, or standard input."""
    return source == "-" or "/" in source or "\\" in source or source.lower().endswith(".toml")


def load_file(source: str) -> Scene:
    """The scene of a file, or of standard input."""
    from integrators import load_scene

    if source == "-" and click.get_current_context().params.get("source") == "-":
        raise Refusal("METHOD and SCENE must not both be -, since there is one standard input, but were")
    return load_scene(standard_input().buffer if source == "-" else source)


def _read_value(text: str) -> Any:
    """A number or formula as text; with commas a list; with semicolons a list of rows."""
    rows = [split_row(row) for row in text.split(";")]
    if len(rows) > 1:
        return rows
    return rows[0] if len(rows[0]) > 1 else text


def read_assignments(texts: Iterable[str], option: str, example: str) -> dict[str, str]:
    """The values of ``NAME=VALUE`` by name."""
    values: dict[str, str] = {}
    for text in texts:
        name, _, value = (part.strip() for part in text.partition("="))
        if not (name and value):
            raise Refusal(f"{option} must be NAME=VALUE, as in {example}, but was {text!r:.60}")
        if name in values:
            raise Refusal(f"{option} must give each name once, but gave {name!r:.60} twice")
        values[name] = value
    return values


def read_start(text: str, scene: Scene) -> Scene:
    """The scene with start values from text such as ``p=0;q=-3/2``."""
    return scene.with_start(**read_start_values(text))


def read_start_values(text: str) -> dict[str, list[str]]:
    """Start values by block, from text such as ``p=0;q=-3/2``."""
    given = read_assignments(filter(str.strip, text.split(";")), "start", '"p=0;q=-3/2"')
    return {name: split_row(values) for name, values in given.items()}


def takes_parts(verb: Callable[..., T]) -> Callable[..., T]:
    """Add the option --parts to a verb: blocks or parts of a scene for the parts of a method."""
    text = 'Blocks or parts of the scene for the parts of the method, as in "a=q;b=p".'
    return click.option("--parts", metavar="TEXT", help=text)(verb)


def read_parts(text: str | None, method: Method, scene: Scene) -> dict[str, list[str]] | None:
    """The blocks or parts of the scene for the parts of a method; None if they follow from the names."""
    from integrators.scenes.particles.parts import default_pieces

    if text is not None and len(method.names) == 1:
        raise Refusal(f"parts must be left out for {method.name}, which has none, but was {text!r:.60}")
    if text is not None:
        return read_part_names(text)
    if not method.program.auxiliary and default_pieces(method.names, scene) is None:
        _refuse_parts(method, scene)  # the library refuses auxiliary parts in any scene
    return None


def read_part_names(text: str) -> dict[str, list[str]]:
    """Blocks or parts of a scene by the part of the method, from text such as ``a=q;b=p,s``."""
    found = read_assignments(filter(str.strip, text.split(";")), "parts", "a=q;b=p")
    return {name: [piece.strip() for piece in value.split(",")] for name, value in found.items()}


def _refuse_parts(method: Method, scene: Scene) -> NoReturn:
    """Refuse, with the option that assigns the parts of a method."""
    from integrators.scenes.scene import UNNAMED

    blocks = [block.name for block in scene.blocks]
    count, names, known = len(method.names), ", ".join(method.names), f"blocks {', '.join(blocks)}"
    known += f", parts {', '.join(scene.parts)}" if scene.parts else ""
    variables = [name for name in scene.variables if name != "t"]
    if len(scene.parts) == count or len(blocks) >= count:
        pieces = scene.parts if len(scene.parts) == count else blocks
    elif scene.name == UNNAMED and len(variables) >= count and not scene.parts:
        example = ";".join(f"{name}=…" for name in method.names)
        raise Refusal(
            f"blocks must say which of {', '.join(variables)} the parts {names} of {method.name} are, as in "
            f'--blocks "{example}", but were not given'
        )
    else:
        raise Refusal(f"scene must have blocks or parts for {names} of {method.name}, but {scene.name} has {known}")
    values = [*pieces[: count - 1], ",".join(pieces[count - 1 :])]
    example = ";".join(f"{name}={value}" for name, value in zip(method.names, values, strict=True))
    raise Refusal(
        f"parts must say what {names} of {method.name} are in {scene.name} ({known}), as in "
        f'--parts "{example}", but were not given'
    )
