"""`bseries course`: slides, a handout with all proofs, and exercises, as HTML and PDF."""

from __future__ import annotations

from collections.abc import Sequence

import click

from bseries.cli.application import Refusal
from bseries.cli.output import make_folder
from bseries.cli.progress import Progress


@click.command()
@click.option("-o", "--output", "path", metavar="FOLDER", help="The folder, which is made if it is not there.")
@click.option(
    "--document", "documents", metavar="NAME", multiple=True,
    help="slides, handout, exercises or solutions; repeatable. By default, all.",
)  # fmt: skip
@click.option("--format", "format_", metavar="FORMAT", help="html or pdf; by default, both.")
def course(path: str | None, documents: Sequence[str], format_: str | None) -> None:
    """A course on backward error analysis, after the lecture that this project grew from.

    Slides, a handout with all proofs, and exercises without and with solutions, each as one HTML file that needs no
    network and as PDF. Formulas are computed and figures drawn when the course is made, in one to three minutes. Files
    of the same names are replaced.

    \b
    Examples:
      bseries course -o course
      bseries course -o course --document slides --format pdf
    """
    from bseries.course.documents import DOCUMENTS, FORMATS, make_course

    if path is None:
        raise Refusal("output must be given, as in -o course, but was not")
    make_folder(path, "output")
    with Progress() as progress:
        formats = FORMATS if format_ is None else [format_.lower()]
        make_course(path, documents or DOCUMENTS, formats, progress=progress.update)
