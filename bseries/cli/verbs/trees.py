"""`bseries trees`: rooted trees with their numbers and formulas, or counts of trees."""

from __future__ import annotations

import click

from bseries.cli.application import Refusal
from bseries.cli.options.values import Limits, WholeNumber, takes_max_children
from bseries.cli.output import Output, PlotFile, takes_output, takes_plot
from bseries_base.table import Table


@click.command()
@click.option("--order", type=WholeNumber(), default=5, show_default=True, help="Largest number of nodes.")
@click.option("--colors", type=WholeNumber(), default=1, show_default=True, help="Number of colours of the nodes.")
@takes_max_children
@click.option("--count", is_flag=True, help="Only count the trees, without listing them; to order 60.")
@takes_plot
@takes_output
def trees(order: int, colors: int, max_children: Limits, count: bool, plot: PlotFile, output: Output) -> Table:
    """Rooted trees with their numbers and formulas.

    For each tree τ: symmetry σ, density γ, α = |τ|!/(σγ), elementary differential and elementary weight. With two
    colours p and q the trees are those of partitioned methods. CSV and JSON have levels, the distances of the nodes
    from the root.

    \b
    Examples:
      bseries trees --order 4
      bseries trees --order 3 --colors 2
      bseries trees --order 8 --colors 2 --max-children "0,inf;inf,0"
      bseries trees --order 5 --plot trees.svg
      bseries trees --order 40 --count
      bseries trees --order 15 --format csv -o trees.csv
    """
    from trees import TreeTable, count_trees
    from trees.counting import count_table

    counts = count_trees(order, colors, max_children)
    if count:
        if plot.path is not None:
            raise Refusal("count must be left out with --plot, which draws the trees, but was given")
        return count_table(counts, colors)
    output.check_rows(sum(counts))
    table = TreeTable(order, colors, max_children)
    plot.save(table.plot)
    return table.to_table()
