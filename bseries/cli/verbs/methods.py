"""`bseries methods`: the catalogue, and one method's tableau with its source."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.plot import PlotFile, takes_plot
from bseries.cli.output import Output, takes_output, takes_text
from foundation.table import Table

if TYPE_CHECKING:
    from bseries.cli.options.method_argument import Method


HINT = "`bseries methods NAME` shows a tableau and its source; --format csv and json list all sources."


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
    from bseries.cli.listings import method_table
    from integrators import catalogue
    from integrators.methods import export_tableau

    if language is not None:
        if method is None:
            raise Refusal(f"METHOD must be given where --as is, but only {language!r:.60} was")
        return export_tableau(method, language)
    if method is None:
        if plot.path is not None:
            raise Refusal("METHOD must be given with --plot, but was not")
        return catalogue().to_table().extended(notes=[HINT])
    plot.save(method.plot)
    return method_table(method)
