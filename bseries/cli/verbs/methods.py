"""`bseries methods`: the catalogue, and one method's tableau with its source."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import takes_method
from bseries.cli.output import takes_output

if TYPE_CHECKING:
    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output
    from bseries.table import Table


@click.command()
@takes_method(required=False)
@takes_output
def methods(method: Method | None, output: Output) -> Table:
    """The catalogue of methods, or the tableau of one.

    With METHOD, its tableau and its source. A name that ends in {s} is a family: write the number of stages in its
    place, as in gauss3. JSON of one method is a tableau file, which every verb reads back. CSV and LaTeX round to
    floats where a method has irrational entries and more than three stages.

    \b
    Examples:
      bseries methods
      bseries methods dormand-prince54
      bseries methods gauss2 --format latex
      bseries methods --format csv -o methods.csv
      bseries methods rk4 -o mine.json
    """
    from bseries.cli.listings import method_table, methods_table

    if method is None:
        return methods_table()
    table = method_table(method)
    if not table.columns and output.format not in table.own:
        raise Refusal(f"format must be table or markdown for {method.name}, not a tableau, but was {output.format}")
    return table
