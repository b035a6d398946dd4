"""The scene that a verb works on: a name, a file, standard input or text, with its effects and parameters."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, NoReturn, TypeAlias

import click

from bseries.cli.application import Refusal, standard_input
from bseries.cli.options.values import Decorator, T, completions, is_file, read_assignments
from integrators.core.arguments import split_row

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from integrators import Method, Scene

Values: TypeAlias = dict[str, str | list[str] | list[list[str]]]
"""Values of parameters by name: numbers as text, lists of them, or lists of rows."""
KEYWORDS = ("self", "effects")
"""Reserved names; effects are switched on by --effect."""
SUFFIXES = (".toml",)


def complete_scene(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completions of SCENE: names of built-in scenes, and files."""
    from integrators import scene_catalogue

    names = ((name, entry.summary) for entry in scene_catalogue() for name in (entry.name, *entry.aliases))
    return completions(names, incomplete, SUFFIXES)


def complete_effect(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completions of --effect: effects of the given scene, or of all scenes."""
    from integrators import scene_catalogue

    typed = ctx.params.get("scene_source")
    entries = [entry for entry in scene_catalogue() if typed is None or typed in (entry.name, *entry.aliases)]
    return completions({name: text for entry in entries for name, text in entry.effects.items()}.items(), incomplete)


def takes_scene(
    *, as_argument: bool = False, required: bool = True, compare: bool = False, named: bool = False
) -> Decorator[T]:
    """Add the option --scene, or the argument SCENE, and its options to a verb.

    The verb receives `scene` (None if not given) and `effects`, the names of the active effects. If `named`, it also
    receives `named`: for a Hamiltonian with functions that are only named, its text, blocks and parameters, else None.
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
        def read(
            *, scene_source: str | None, ode: str | None, hamiltonian: str | None, effects: tuple[str, ...],
            parameters: tuple[str, ...], blocks: str | None, **options: object,
        ) -> T:  # fmt: skip
            ways = {"--scene": scene_source, "--ode": ode, "--hamiltonian": hamiltonian}
            given = [(way, text) for way, text in ways.items() if text is not None]
            if len(given) > 1:
                raise Refusal(f"SCENE must be given in one way, but was by {' and '.join(way for way, _ in given)}")
            way, text = given[0] if given else (None, "")
            values = _read_values(parameters)
            if blocks is not None and way in (None, "--scene"):
                raise Refusal(f"blocks must come with --ode or --hamiltonian, but was {blocks!r:.60} without")
            if way is None and (effects or values):
                raise Refusal("effect and parameter must come with a SCENE that has them, but there was none")
            if way is None and required:
                raise Refusal(f"SCENE must be given: a {where}; or --ode or --hamiltonian")
            if compare:
                plain = _plain_scene(way, text, blocks, values)
                return verb(scene=plain, effects=effects, parameters=values, **options)
            if named:
                options["named"] = _named(text, blocks, effects, values) if way == "--hamiltonian" else None
                if options["named"]:
                    return verb(scene=None, effects=(), **options)
            scene = None if way is None else _scene(way, text, blocks, effects, values)
            on = () if scene is None else scene.active or tuple(dict.fromkeys(effects))
            return verb(scene=scene, effects=on, **options)

        return read

    return decorate


def _named(text: str, blocks: str | None, effects: Sequence[str], values: Values) -> dict[str, object] | None:
    """A Hamiltonian with functions that are only named."""
    from bseries.hamiltonians.named_functions import named_functions

    if not named_functions(text):
        return None
    if effects:
        raise Refusal(f"effect must come with a SCENE that has it, but was {effects[0]!r:.60} for named functions")
    return {"text": text, "blocks": blocks, "parameters": values}


def _plain_scene(way: str | None, text: str, blocks: str | None, values: Values) -> Scene | str:
    """The scene of a file or of equations, without changes; or the name of a built-in scene."""
    from integrators import parse_hamiltonian, parse_scene

    if way == "--scene":
        return read_scene(text)
    return (parse_scene if way == "--ode" else parse_hamiltonian)(text, blocks, values)


def _scene(way: str, text: str, blocks: str | None, effects: Sequence[str], values: Values) -> Scene:
    """The scene with its effects and parameters."""
    from integrators import scene

    found = _plain_scene(way, text, blocks, values)
    if isinstance(found, str):
        return scene(found, effects=effects or None, **values)
    return found.with_effects(*(effects or found.active), **(values if way == "--scene" else {}))


def _read_values(parameters: Iterable[str]) -> Values:
    """The values of parameters: numbers or formulas as text; with commas lists; with semicolons lists of rows."""
    values: Values = {}
    for name, text in read_assignments(parameters, "parameter", "mu=1/2").items():
        rows = [split_row(row) for row in text.split(";")]
        values[name] = rows if len(rows) > 1 else rows[0] if len(rows[0]) > 1 else text
    for name in KEYWORDS:
        if name in values:
            raise Refusal(f"parameter must be one of the scene's, but was {name!r}")
    return values


def read_scene(source: str) -> Scene | str:
    """The scene of a file or of standard input, or the name of a built-in scene."""
    if not is_file(source, SUFFIXES):
        return source
    from integrators import load_scene

    if source == "-" and click.get_current_context().params.get("source") == "-":
        raise Refusal("METHOD and SCENE must not both be -, since there is one standard input, but were")
    return load_scene(standard_input().buffer if source == "-" else source)


def takes_start(verb: Callable[..., T]) -> Callable[..., T]:
    """Add the option --start to a verb, which receives the start values by block; None if they are not given."""

    @click.option("--start", metavar="TEXT", help='Start values by block, as in "p=0;q=-3/2".')
    @functools.wraps(verb)
    def read(*, start: str | None, **options: object) -> T:
        given = read_assignments(filter(str.strip, (start or "").split(";")), "start", '"p=0;q=-3/2"')
        blocks = None if start is None else {name: split_row(values) for name, values in given.items()}
        return verb(start=blocks, **options)

    return read


def takes_parts(verb: Callable[..., T], *, check: bool = True) -> Callable[..., T]:
    """Add the option --parts to a verb: the blocks or parts of a scene for each part of the method."""

    @click.option(
        "--parts", metavar="TEXT", help='Blocks or parts of the scene for the parts of the method, as in "a=q;b=p".'
    )
    @functools.wraps(verb)
    def read(*, parts: str | None, method: Method, scene: Scene | None, **options: object) -> T:
        if check and scene is not None:
            _check_parts(parts, method, scene)
        given = read_assignments(filter(str.strip, (parts or "").split(";")), "parts", "a=q;b=p")
        names = {name: [piece.strip() for piece in value.split(",")] for name, value in given.items()}
        return verb(parts=None if parts is None else names, method=method, scene=scene, **options)

    return read


def _check_parts(text: str | None, method: Method, scene: Scene) -> None:
    """Refuse --parts for a method without parts, and its absence if names do not determine the parts."""
    from integrators.scenes.particles.parts import default_pieces

    if text is not None and len(method.names) == 1:
        raise Refusal(f"parts must be left out for {method.name}, which has none, but was {text!r:.60}")
    if text is None and default_pieces(method.names, scene) is None and not method.program.auxiliary:
        _refuse_parts(method, scene)  # the library refuses auxiliary parts in any scene


def _refuse_parts(method: Method, scene: Scene) -> NoReturn:
    """Raise an error that shows the option by which the parts of a method are assigned."""
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
