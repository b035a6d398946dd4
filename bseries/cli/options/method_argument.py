"""The argument METHOD of verbs: a name, a file, standard input, or a tableau inline."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from bseries.cli.application import Refusal, say, standard_input
from integrators.core.arguments import split_row

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from integrators import PartitionedRungeKutta, RungeKutta
    from integrators.methods.programs.program import Method as Method

T = TypeVar("T")


def complete_method(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completions of METHOD: names of the catalogue, families with numbers of stages, and files."""
    from click.shell_completion import CompletionItem

    from integrators import catalogue

    if is_tableau_file(incomplete) or incomplete.startswith("."):
        return [CompletionItem(incomplete, type="file")]
    found = []
    for entry in catalogue():
        stages = range(entry.least_stages, entry.least_stages + 6) if entry.is_family else [""]
        names = (f"{name}{s}" for name in (entry.name, *entry.aliases) for s in stages)
        found += [CompletionItem(name, help=entry.description) for name in names if name.startswith(incomplete)]
    return found


def takes_method(*, required: bool = True) -> Callable[[Callable[..., T]], Callable[..., T]]:
    """Add the argument METHOD and its options to a verb, which receives `method` (None if not given)."""

    def decorate(verb: Callable[..., T]) -> Callable[..., T]:
        @click.argument(
            "source", metavar="METHOD" if required else "[METHOD]", required=False, shell_complete=complete_method
        )
        @click.option("--A", "A", metavar="ROWS", help='Stage matrix inline, as in "0,0;1/2,0".')
        @click.option("--b", "b", metavar="ROW", help='Weights inline, as in "0,1".')
        @click.option("--c", "c", metavar="ROW", help="Nodes inline; by default the row sums of A.")
        @click.option("--symbols", metavar="NAMES", help='Symbols in the inline tableau, as in "alpha,beta".')
        @click.option(
            "--set", "settings", metavar="NAME=VALUE", multiple=True, help="Value of a parameter; repeatable."
        )
        @functools.wraps(verb)
        def read(*, source: Any, A: Any, b: Any, c: Any, symbols: Any, settings: Any, **options: Any) -> T:
            inline = {"A": A, "b": b, "c": c, "symbols": symbols}
            method = read_method(source, {key: value for key, value in inline.items() if value is not None}, settings)
            if method is None and required:
                raise Refusal("METHOD must be given: a name such as rk4, a tableau file, - or --A and --b")
            return verb(method=method, **options)

        return read

    return decorate


def takes_method_option(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Add the option --method and its options to a verb, which receives `method`."""

    @click.option(
        "--method", "source", metavar="METHOD", help="A name, a tableau file, or -.", shell_complete=complete_method
    )
    @click.option("--A", "A", metavar="ROWS", help='Stage matrix inline, as in "0,0;1/2,0".')
    @click.option("--b", "b", metavar="ROW", help='Weights inline, as in "0,1".')
    @click.option("--c", "c", metavar="ROW", help="Nodes inline; by default the row sums of A.")
    @click.option(
        "--set", "settings", metavar="NAME=VALUE", multiple=True, help="Value of a parameter of the method; repeatable."
    )
    @functools.wraps(verb)
    def read(*, source: Any, A: Any, b: Any, c: Any, settings: Any, **options: Any) -> Any:
        inline = {key: value for key, value in {"A": A, "b": b, "c": c}.items() if value is not None}
        method = read_method(source, inline, settings)
        if method is None:
            raise Refusal("method must be given: --method with a name such as rk4 or a tableau file, or --A and --b")
        return verb(method=method, **options)

    return read


def read_method(source: str | None, inline: dict[str, str], settings: Iterable[str]) -> Method | None:
    """The method of the command line; inconsistencies of a tableau are printed as warnings."""
    from integrators import TableauWarning
    from integrators import method as catalogue_method

    values = _read_settings(settings)
    if source is None and not inline:
        if values:
            raise Refusal("set must come with a METHOD that has parameters, but there was none")
        return None
    if source is not None and inline:
        raise Refusal(f"METHOD must be left out where --A gives a tableau, but was {source!r:.60}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TableauWarning)  # `issues` below includes those of the values set
        if source is not None and not is_tableau_file(source):
            return catalogue_method(source, **values)
        tableau = (_inline_method(**inline) if source is None else _load(source)).substitute(values)
    for issue in tableau.issues:
        say("warning", issue)
    return tableau


def is_tableau_file(source: str) -> bool:
    """Whether a METHOD is a file, or standard input."""
    return source == "-" or "/" in source or "\\" in source or source.lower().endswith((".json", ".toml"))


def _load(source: str) -> RungeKutta | PartitionedRungeKutta:
    from integrators import load_method

    return load_method(standard_input().buffer if source == "-" else source)


def _inline_method(A: str = "", b: str = "", c: str | None = None, symbols: str = "") -> RungeKutta:
    from integrators import RungeKutta

    names = [name.strip() for name in symbols.split(",") if name.strip()]
    rows = [split_row(row) for row in A.split(";")] if A.strip() else []
    return RungeKutta(rows, split_row(b), None if c is None else split_row(c), parameters=names)


def _read_settings(settings: Iterable[str]) -> dict[str, str]:
    values: dict[str, str] = {}
    for setting in settings:
        name, equals, value = (part.strip() for part in setting.partition("="))
        if not (name and equals and value):
            raise Refusal(f"set must be NAME=VALUE, as in gamma=1/4, but was {setting!r:.60}")
        if name in values:
            raise Refusal(f"set must give each parameter once, but gave {name!r:.60} twice")
        values[name] = value
    return values
