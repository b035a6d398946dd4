"""`bseries course`: slides, a handout with all proofs, and exercises, as HTML and PDF."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from bseries.cli.application import Refusal, standard_input
from bseries.cli.output import Output, Progress, complete_file, make_folder, takes_output
from bseries_base.table import Table

if TYPE_CHECKING:
    from bseries.course.answers import CheckedAnswers


@click.command()
@click.option(
    "-o", "--output", "path", metavar="FOLDER", shell_complete=complete_file,
    help="The folder, which is made if it is not there.",
)  # fmt: skip
@click.option(
    "--document", "documents", metavar="NAME", multiple=True,
    help="slides, handout, exercises or solutions; repeatable. By default, all.",
)  # fmt: skip
@click.option(
    "--format", "format_", metavar="FORMAT", help="html or pdf; by default, both. With --check a format of tables."
)
@click.option(
    "--check", "answers", metavar="ANSWERS", help="Check a file of answers to the exercises, or - for standard input."
)
def course(path: str | None, documents: Sequence[str], format_: str | None, answers: str | None) -> None:
    """A course on backward error analysis, after the lecture that this project grew from.

    Slides, a handout with all proofs, and exercises without and with solutions, each as one HTML file that needs no
    network and as PDF. Formulas are computed and figures drawn when the course is made, in one to three minutes. Files
    of the same names are replaced. With the exercises comes answers.txt, a file to fill in; one that is there stays.

    --check compares answers with what the engine computes, and makes no course. The exit code is 1 if one is wrong.

    \b
    Examples:
      bseries course -o course
      bseries course -o course --document slides --format pdf
      bseries course --check answers.txt
    """
    if answers is not None:
        check(answers, path, documents, format_)
        return
    from bseries.course.documents import DOCUMENTS, FORMATS, make_course

    if path is None:
        raise Refusal("output must be given, as in -o course, but was not")
    make_folder(path, "output")
    with Progress() as progress:
        formats = FORMATS if format_ is None else [format_.lower()]
        make_course(path, documents or DOCUMENTS, formats, progress=progress.update)
    if not documents or "exercises" in documents:
        write_template(path)


def write_template(folder: str) -> None:
    """Write a file of answers to fill in, unless there is one, which may hold answers."""
    from bseries.course.answers import answer_template
    from integrators.core.text_files import atomic_write

    path = os.path.join(folder, "answers.txt")
    if not os.path.lexists(path):
        atomic_write(path, answer_template())


def check(answers: str, path: str | None, documents: Sequence[str], format_: str | None) -> None:
    """Write the verdicts on a file of answers, and exit with code 1 unless all are right."""
    from bseries.course.answers import MOST_BYTES, check_answers
    from integrators.core.text_files import read_text

    if documents:
        raise Refusal(f"document must be left out where --check is given, but was {documents[0]!r:.60}")
    text, _ = read_text(standard_input().buffer if answers == "-" else answers, MOST_BYTES)
    checked = check_answers(text)
    write_answers(path=path, format_=format_, checked=checked)
    if not checked.all_right:
        raise click.exceptions.Exit(1)


@takes_output
def write_answers(checked: CheckedAnswers, output: Output) -> Table:
    """The verdicts as a table."""
    return checked.to_table()
