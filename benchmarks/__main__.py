"""`python -m benchmarks`: measure, print, keep the figures; compare two results; write the page."""

from __future__ import annotations

import json
import os
from pathlib import Path

import click
from click.core import ParameterSource

from . import comparison
from .report import pictures, show, to_markdown, to_summary
from .results import KEPT, ROOT, Result, file_name, kept_results, to_json
from .rivals import DEFAULT
from .running import is_empty, run

FILE = click.Path(path_type=Path, dir_okay=False)
PAGE = Path("build", "benchmarks.md")
"""All rows of a result, made when wanted."""
SUMMARY_PAGE = ROOT / "docs" / "benchmarks.md"
"""The summary of the last result that was kept."""


@click.group(invoke_without_command=True)
@click.option("--only", "pattern", default="", help="Only rows whose name contains this; * and ? are wildcards.")
@click.option("--rounds", default=5, show_default=True, type=click.IntRange(1), help="How often each row is sampled.")
@click.option("--full", is_flag=True, help="Also what takes minutes: order 20, with 9 GB of memory, and 10⁸ steps.")
@click.option("--json", "json_file", type=FILE, help="Write all figures to this file.")
@click.option("--output", "page", type=FILE, help="Write the tables to this file as Markdown, with pictures beside it.")
@click.option("--keep", is_flag=True, help="Keep all figures in benchmarks/results.")
@click.option("--rivals", default=DEFAULT, type=click.Path(path_type=Path), help="Where other packages are installed.")
@click.pass_context
def main(
    context: click.Context,
    pattern: str,
    rounds: int,
    full: bool,
    json_file: Path | None,
    page: Path | None,
    keep: bool,
    rivals: Path,
) -> None:
    """Measure what everything costs, beside other packages timed in the same run.

    Every row is the best of several rounds; in each round every row has its turn.
    """
    if context.invoked_subcommand:
        if any(context.get_parameter_source(name) is not ParameterSource.DEFAULT for name in context.params):
            raise click.UsageError(
                f"options must stand behind {context.invoked_subcommand!r}, but some stood before it"
            )
        return
    from rich.console import Console

    from integrators.core.text_files import atomic_write

    for path in filter(None, (json_file, page)):
        check_folder(path)
    if is_empty(pattern, full):
        raise click.BadParameter(f"no row has a name like {pattern!r}", param_hint="--only")
    if keep and pattern:
        raise click.UsageError("--keep must stand without --only, since results are kept as a whole")
    console, result = Console(), run(pattern, full, rounds, rivals)
    show(result, console)
    if json_file:
        atomic_write(json_file, to_json(result))
    if keep:
        earlier = kept_results()
        KEPT.mkdir(exist_ok=True)
        atomic_write(KEPT / file_name(result), to_json(result))
        atomic_write(SUMMARY_PAGE, to_summary(json.loads(to_json(result))))
        if earlier:
            comparison.show(comparison.compare(_loaded(earlier[-1], "the result kept last"), result), console)
    if page:
        write_page(json.loads(to_json(result)), page)
    if failed := result.get("failed"):
        raise click.ClickException(f"every part must be measured, but {', '.join(failed)} failed")


@main.command()
@click.argument("old", required=False, type=FILE)
@click.argument("new", required=False, type=FILE)
def compare(old: Path | None, new: Path | None) -> None:
    """What has changed from one result to another.

    OLD and NEW are files that `--json` or `--keep` wrote: by default, the last two that were kept. Ratios of times are
    divided by those of the calibration loops, so that they tell what the code does, and not the machine.
    """
    from rich.console import Console

    kept = kept_results()
    if len(kept) < 2 - (old is not None) - (new is not None):
        raise click.UsageError("OLD and NEW must be given where fewer than two results are kept")
    before = _loaded(old or kept[-2], "OLD")
    after = _loaded(new or kept[-1], "NEW")
    comparison.show(comparison.compare(before, after), Console())


@main.command("page")
@click.argument("file", metavar="RESULT", required=False, type=FILE)
@click.option("--output", "output", type=FILE, default=PAGE, show_default=True, help="The page.")
def page_command(file: Path | None, output: Path) -> None:
    """Write the page of a result, by default of the last that was kept, with pictures beside it."""
    kept = kept_results()
    if output == PAGE:
        PAGE.parent.mkdir(exist_ok=True)
    if file is None and not kept:
        raise click.UsageError("RESULT must be given where none is kept")
    write_page(_loaded(file or kept[-1], "RESULT"), check_folder(output))


def _loaded(path: Path, argument: str) -> Result:
    try:
        return comparison.load_result(path, argument)
    except comparison.ResultError as error:
        raise click.UsageError(str(error)) from None


def check_folder(path: Path) -> Path:
    """See to it that a file can be written, before minutes of work."""
    if not os.access(path.absolute().parent, os.W_OK):
        raise click.BadParameter(f"file must lie in a writable folder, but was {str(path)!r}")
    return path


def write_page(result: Result, page: Path) -> None:
    """Write the page and its pictures."""
    from bseries_base.plotting import picture
    from integrators.core.text_files import atomic_write

    for name, drawn in pictures(result).items():
        file = page.parent / name
        file.parent.mkdir(exist_ok=True)
        atomic_write(file, picture(drawn, "svg"))
    atomic_write(page, to_markdown(result))


if __name__ == "__main__":
    main(prog_name="python -m benchmarks")
