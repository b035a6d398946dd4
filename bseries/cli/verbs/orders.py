"""`bseries check`, `conditions` and `trees`: the properties of a method, order conditions, and rooted trees."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.values import WholeNumber, takes_max_children
from bseries.cli.output import Output, PlotFile, takes_output, takes_plot, takes_text
from foundation.table import Table

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


@click.command()
@click.argument("kind", metavar="KIND")
@click.option("--order", type=WholeNumber(), default=4, show_default=True, help="Order of the methods.")
@click.option("--stages", type=WholeNumber(), help="Number of stages, for code.")
@click.option("--colors", type=WholeNumber(), help="Number of parts, for kinds that have parts.")
@click.option("--explicit", is_flag=True, help="Explicit methods: short for --structure explicit.")
@click.option("--structure", metavar="NAMES", help="full, explicit or diagonally-implicit; for each matrix, by commas.")
@click.option("--assume", metavar="TEXT", help='Simplifying assumptions that hold, as in "B5 C2 D1".')
@click.option(
    "--scalar",
    is_flag=False,
    flag_value="autonomous",
    metavar="[WHICH]",
    help="Only for scalar equations: autonomous y' = f(y), or nonautonomous.",
)
@click.option("--symmetric", is_flag=True, help="Symmetric methods: only conditions for odd numbers of nodes.")
@takes_max_children
@takes_text("--code", "LANGUAGE", "Source of residual and Jacobian: numpy, c or julia.")
@takes_output
def conditions(
    kind: str,
    order: int,
    *,
    explicit: bool,
    structure: str | None,
    assume: str | None,
    scalar: str | None,
    language: str | None,
    output: Output,
    **options: Any,
) -> Table | str:
    """The order conditions of a kind of methods.

    KIND is runge-kutta, partitioned, additive, nystrom (y'' = g(y)), general-nystrom (y'' = g(y, y')), rosenbrock or
    splitting. With --code comes source code of two functions, residual and jacobian, in numpy, c or julia.

    \b
    Examples:
      bseries conditions runge-kutta --order 4
      bseries conditions runge-kutta --order 5 --assume "C2 D1"
      bseries conditions runge-kutta --order 5 --scalar
      bseries conditions runge-kutta --order 3 --explicit --stages 3 --code c -o conditions.c
      bseries conditions partitioned --order 3 --format latex
      bseries conditions splitting --order 4 --symmetric --format json
    """
    from bseries.conditions.listing import order_conditions

    if explicit and structure is not None:
        raise Refusal(f"structure must be left out where --explicit is given, but was {structure!r:.60}")
    names = (structure or "full").split(",")
    given = names[0] if len(names) == 1 else names
    options |= {"explicit": explicit, "structure": given, "assumptions": assume, "scalar": scalar or False}
    found = order_conditions(kind, order, **options)
    if language is not None:
        return found.code(language)
    output.check_rows(len(found))
    return found.to_table()


@click.command()
@click.option("--order", type=WholeNumber(), default=5, show_default=True, help="Largest number of nodes.")
@click.option("--colors", type=WholeNumber(), default=1, show_default=True, help="Number of colours of the nodes.")
@takes_max_children
@click.option("--count", is_flag=True, help="Only count the trees, without listing them; to order 60.")
@takes_plot
@takes_output
def trees(order: int, colors: int, max_children: Any, count: bool, plot: PlotFile, output: Output) -> Table:
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
