"""The argument METHOD or the option --method of verbs: a name, a file, standard input, or a tableau inline."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

import click

from bseries.cli.application import Refusal, say, standard_input
from bseries.cli.options.values import Decorator, T, completions, is_file, read_assignments
from integrators.core.arguments import split_row

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from integrators.methods.programs.program import Method as Method

INLINE = ("A", "b", "c", "symbols")
SUFFIXES = (".json", ".toml")


def complete_method(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completions of METHOD: names of the catalogue, families with numbers of stages, and files."""
    from integrators import catalogue

    found = list[tuple[str, str]]()
    for entry in catalogue():
        stages = range(entry.least_stages, entry.least_stages + 6) if entry.is_family else [""]
        found += [(f"{name}{s}", entry.description) for name in (entry.name, *entry.aliases) for s in stages]
    return completions(found, incomplete, SUFFIXES)


def takes_method(*, as_option: bool = False, required: bool = True) -> Decorator[T]:
    """Add the argument METHOD or the option --method to a verb, which receives `method` (None if not given)."""
    if as_option:
        text = "A name, a tableau file, or -."
        source = click.option("--method", "source", metavar="METHOD", help=text, shell_complete=complete_method)
        missing = "method must be given: --method with a name such as rk4 or a tableau file, or --A and --b"
    else:
        metavar = "METHOD" if required else "[METHOD]"
        source = click.argument("source", metavar=metavar, required=False, shell_complete=complete_method)
        missing = "METHOD must be given: a name such as rk4, a tableau file, - or --A and --b"

    def decorate(verb: Callable[..., T]) -> Callable[..., T]:
        @source
        @click.option("--A", "A", metavar="ROWS", help='Stage matrix inline, as in "0,0;1/2,0".')
        @click.option("--b", "b", metavar="ROW", help='Weights inline, as in "0,1".')
        @click.option("--c", "c", metavar="ROW", help="Nodes inline; by default the row sums of A.")
        @click.option("--symbols", metavar="NAMES", help='Symbols in the inline tableau, as in "alpha,beta".')
        @click.option(
            "--set", "settings", metavar="NAME=VALUE", multiple=True, help="Value of a parameter; repeatable."
        )
        @click.option(
            "--digits", type=int, metavar="N", help="Correct digits of decimals, inline or in a file; by default exact."
        )
        @functools.wraps(verb)
        def read(
            *, source: str | None, A: str | None, b: str | None, c: str | None, symbols: str | None,
            settings: tuple[str, ...], digits: int | None, **options: object,
        ) -> T:  # fmt: skip
            given = {"A": A, "b": b, "c": c, "symbols": symbols}
            inline = {name: value for name, value in given.items() if value is not None}
            method = read_method(source, inline, settings, digits)
            if method is None and required:
                raise Refusal(missing)
            return verb(method=method, **options)

        return read

    return decorate


def read_method(
    source: str | None, inline: Mapping[str, str] = {}, settings: Iterable[str] = (), digits: int | None = None
) -> Method | None:
    """The method of the command line; inconsistencies of a tableau are printed as warnings."""
    from integrators import PartitionedRungeKutta, RungeKutta, TableauWarning, load_method
    from integrators import method as catalogue_method

    values = read_assignments(settings, "set", "gamma=1/4")
    if source is None and not inline:
        if values:
            raise Refusal("set must come with a METHOD that has parameters, but there was none")
        if digits is not None:
            raise Refusal("digits must come with a tableau, but there was none")
        return None
    if source is not None and inline:
        raise Refusal(f"METHOD must be left out where --A gives a tableau, but was {source!r:.60}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TableauWarning)  # `issues` below includes those of the values set
        if source is None:
            names = [name.strip() for name in inline.get("symbols", "").split(",") if name.strip()]
            rows = [split_row(row) for row in inline.get("A", "").split(";")] if inline.get("A", "").strip() else []
            nodes = split_row(inline["c"]) if "c" in inline else None
            tableau = RungeKutta(rows, split_row(inline.get("b", "")), nodes, parameters=names, digits=digits)
        elif is_file(source, SUFFIXES):
            tableau = load_method(standard_input().buffer if source == "-" else source, digits=digits)
        elif digits is not None:
            raise Refusal(f"digits must be left out for a method of the catalogue, but was {digits}")
        else:
            return catalogue_method(source, **values)
        if isinstance(tableau, RungeKutta | PartitionedRungeKutta):
            tableau = tableau.substitute(values)
        elif values:
            raise Refusal("set must come with a tableau or a method of the catalogue, but the file has another kind")
    for issue in tableau.issues:
        say("warning", issue)
    return tableau
