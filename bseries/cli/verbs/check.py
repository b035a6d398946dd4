"""`bseries check`: order, principal error, structure and stability."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.values import WholeNumber
from bseries.cli.output import Output, PlotFile, takes_output, takes_plot
from bseries_base.table import Table

if TYPE_CHECKING:
    from integrators import Method


@click.command()
@takes_method()
@click.option(
    "--order", type=WholeNumber(), help="The largest number of nodes to test; by default slightly more than needed."
)
@click.option("--nonzero", is_flag=True, help="Leave out error coefficients that are zero.")
@takes_plot
@takes_output
def check(method: Method, order: int | None, nonzero: bool, plot: PlotFile, output: Output) -> Table:
    """Order, principal error, structure and stability of a method.

    A property such as symplectic holds up to some number of nodes, and the first tree that breaks it is named; what the
    tableau alone decides, for all orders and all values of symbols, is yes or no. The principal error coefficients are
    e(τ) = (a(τ) - 1/γ(τ))/σ(τ) for the trees with p+1 nodes, p being the order; the norm is the square root of the sum
    of their squares. --plot draws the region of stability.

    \b
    Examples:
      bseries check rk4
      bseries check gauss3 --format json
      bseries check dormand-prince54 --nonzero --plot stability.pdf
      bseries check --A "0,0;2/3,0" --b "1/4,3/4"
    """
    from bseries.analysis.report import check
    from bseries.analysis.stability.criteria import checked_method, stability_function
    from trees.counting import check_order

    table = check(method, None if order is None else check_order(order)).to_table(nonzero=nonzero)
    plot.save(lambda: stability_function(checked_method(method)).plot())
    return table
