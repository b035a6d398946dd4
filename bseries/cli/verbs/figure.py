"""`bseries figure`: the lecture's figures, drawn, or their numbers."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import read_method
from bseries.cli.options.scene_argument import read_scene
from bseries.cli.options.values import completions, read_assignments
from bseries.cli.output import Output, Progress, complete_file, make_folder
from bseries_base.table import Column, Table, csv_lines, paragraphs
from integrators.core.arguments import split_row

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


COLUMNS = (Column("name"), Column("lecture", True), Column("what"), Column("options"))


PARTS = 1000
"""Number of parts of the progress bar for each of several figures."""


def complete_figure(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completions of the names of figures."""
    from bseries.figures.registry import figure_file, figure_names

    return completions(((name, figure_file(name).TITLE) for name in figure_names()), incomplete)


@click.command()
@click.argument("name", metavar="[NAME]", required=False, shell_complete=complete_figure)
@click.option(
    "-o", "--output", "path", metavar="FILE", shell_complete=complete_file,
    help="The picture: .png, .svg or .pdf. With --all, a folder.",
)  # fmt: skip
@click.option(
    "--data", metavar="FILE", shell_complete=complete_file,
    help="The numbers as CSV; - for standard output. With --all, a folder.",
)  # fmt: skip
@click.option("--set", "settings", metavar="NAME=VALUE", multiple=True, help="Value of an option; repeatable.")
@click.option(
    "--animate", metavar="FILE", shell_complete=complete_file,
    help="The figure in motion: .gif or .mp4, of at most 150 frames.",
)  # fmt: skip
@click.option("--list", "listed", is_flag=True, help="All figures with their options.")
@click.option("--all", "everything", is_flag=True, help="Draw all figures.")
@click.option("--format", "format_", metavar="FORMAT", help="With --all: png, svg or pdf; by default, png.")
def figure(
    name: str | None,
    path: str | None,
    data: str | None,
    settings: Sequence[str],
    animate: str | None,
    listed: bool,
    everything: bool,
    format_: str | None,
) -> None:
    """A figure of the lecture that this project grew from, or a further one.

    Pictures have their printed size; the caption is printed once a picture is drawn. Options are methods and scenes by
    name or file, numbers such as 1/20, and starts such as "2,2", or "2,2; 7/2,2" for several.
    --data writes the numbers of a figure, a column for each quantity; columns need not be of the same length.
    --animate writes a figure that moves as GIF or MP4, in about half a minute.
    --all -o DIR draws all of them to files NAME.png, and with --data DIR writes NAME.csv.

    \b
    Examples:
      bseries figure --list
      bseries figure riccati -o riccati.png
      bseries figure energy-error -o energy.pdf --data energy.csv
      bseries figure truncation --set h=1/20 --set terms=4 -o truncation.svg
      bseries figure large-steps --set method=stormer-verlet --set "y0=0,-2; 1,0" -o steps.pdf
      bseries figure area-patch --set methods=rk4,gauss2 --animate patch.gif
      bseries figure riccati --data -
    """
    given = [text for text, is_on in (("NAME", name), ("--list", listed), ("--all", everything)) if is_on]
    if len(given) != 1:
        raise Refusal(f"one of NAME, --list and --all must be given, but {' and '.join(given) or 'none'} were")
    if format_ is not None and not everything:
        raise Refusal(
            f"format must be left out without --all, as it follows from the suffix of FILE, but was {format_!r:.60}"
        )
    with Progress() as progress:
        if listed:
            from bseries.figures.registry import figure_file, figure_names, options_of

            files = {name: figure_file(name) for name in figure_names()}
            facts = ((name, file.NUMBER or "", file.TITLE, _shown(options_of(file))) for name, file in files.items())
            Output("table", None, progress).write(Table("Figures", COLUMNS, list(facts), titled=False))
        elif everything:
            if animate is not None:
                raise Refusal(f"animate must be left out with --all, but was {animate!r:.60}")
            _draw_all(path, data, settings, format_ or "png", progress)
        else:
            _draw_one(str(name), path, data, settings, animate, progress)


def _shown(options: Mapping[str, Any]) -> str:
    """Options with their defaults, as --list and messages show them."""
    return ", ".join(key if value is None else f"{key}={_written(value)}" for key, value in options.items())


def _written(value: Any) -> str:
    """A default as --set would give it."""
    if not isinstance(value, tuple):
        return f"{value:g}" if isinstance(value, float) else str(value)
    rows = [_written(entry) for entry in value]
    return (";" if isinstance(value[0], tuple) else ",").join(rows)


def _draw_one(
    name: str, path: str | None, data: str | None, settings: Sequence[str], animate: str | None, progress: Progress
) -> None:
    """One figure."""
    from bseries.figures import registry
    from bseries.picture_files import check_place, picture_format

    file = registry.figure_file(name)
    if path is None and data is None and animate is None:
        raise Refusal(f"output, data or animate must be given, as in -o {name}.png, but none was")
    if path is not None:
        picture_format(path)  # refuses others
    for place, argument in ((path, "output"), (data, "data")):
        if place not in (None, "-"):
            check_place(str(place), argument)
    if animate is not None:
        registry.check_moving(file)
        registry.check_animation(animate)
    numbers = _make(file, _options(file, name, settings), path, data, progress.update)
    if animate is not None:
        registry.animate(file, numbers, animate, progress=progress.update)
    if (path, animate) != (None, None) and data != "-":  # numbers on standard output stay alone
        output = Output("table", None, progress)
        output.write(paragraphs([file.caption(numbers)], output.width))


def _draw_all(path: str | None, data: str | None, settings: Sequence[str], format_: str, progress: Progress) -> None:
    """All figures, into folders."""
    from bseries.figures.registry import figure_file, figure_names
    from bseries.picture_files import check_format

    if path is None or data == "-":
        raise Refusal("output must be a folder with --all, and so must data if given, but one was not")
    if settings:
        raise Refusal(f"set must be left out with --all, but was {settings[0]!r:.60}")
    ending, names = check_format(format_, "format"), figure_names()
    for argument, folder in (("output", path), ("data", data)):
        if folder is not None:
            make_folder(folder, argument)
    for k, name in enumerate(names):

        def advance(done: int, total: int, k: int = k) -> None:
            progress.update(k * PARTS + done * PARTS // max(total, 1), len(names) * PARTS)

        advance(0, 1)
        target, rows = os.path.join(path, f"{name}.{ending}"), data and os.path.join(data, f"{name}.csv")
        _make(figure_file(name), {}, target, rows, advance)


def _make(
    file: ModuleType, options: dict[str, Any], path: str | None, data: str | None, advance: Callable[[int, int], None]
) -> Any:
    """Compute the numbers of a figure, and write them, their picture or both; the numbers."""
    from bseries.figures.registry import compute, drawn, takes_progress
    from bseries.picture_files import data_rows, picture_format
    from bseries_base.extras import optional_module
    from bseries_base.plotting import picture
    from integrators.core.text_files import atomic_write

    if path is not None:
        optional_module("matplotlib", "a figure")  # before the numbers, which may take minutes
    numbers = compute(file, {**options, "progress": advance} if takes_progress(file) else options)
    content = None if path is None else picture(drawn(file, numbers), picture_format(path))
    if data is not None:
        columns = file.columns(numbers)
        lines = csv_lines(list(columns), data_rows(columns))
        if data == "-":
            sys.stdout.writelines(lines)
        else:
            atomic_write(data, "".join(lines))
    if path is not None and content is not None:
        atomic_write(path, content)
    return numbers


def _options(file: ModuleType, name: str, settings: Sequence[str]) -> dict[str, Any]:
    """The options of --set; methods and scenes may be files."""
    from bseries.figures.registry import options_of

    known = options_of(file)
    values = read_assignments(settings, "set", "h=1/20")
    for option in values:
        if option not in known:
            raise Refusal(f"set must be one of {_shown(known)} for {name}, but was {option!r:.60}")
    return {option: READERS.get(option, str)(text) for option, text in values.items()}


READERS: dict[str, Callable[[str], Any]] = {
    "method": read_method,
    "methods": lambda text: [read_method(entry.strip()) for entry in split_row(text)],
    "scene": read_scene,
}
"""Readers of options that may be files; figures read all other text."""
