"""`bseries modified`, `modifying` and `series`: the coefficients of a method, tree by tree."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.values import Limits, WholeNumber, adds, takes_max_children
from bseries.cli.output import Output, takes_output
from bseries_base.table import Table

if TYPE_CHECKING:
    from bseries.algebra.bseries import BSeries
    from bseries_base.child_bounds import ChildBounds
    from integrators import Method


takes_series_options = adds(
    click.option("--order", type=WholeNumber(), default=5, show_default=True, help="Largest number of nodes."),
    takes_max_children,
    click.option("--nonzero", is_flag=True, help="Leave out trees whose coefficient is zero."),
    click.option("--float", "as_float", is_flag=True, help="Round the exact coefficients to floats."),
    takes_output,
)


@click.command()
@takes_method()
@takes_series_options
def modified(method: Method, **options: Any) -> Table:
    """The modified equation, which a method solves exactly.

    It is y' = f_h(y) with f_h = Σ h^(|τ|-1) weight(τ) F(τ). There is one line for each tree τ; weight = coefficient/σ
    is the number that textbooks print. --order N means trees with 1 to N nodes, hence powers h^0 to h^(N-1).

    \b
    Examples:
      bseries modified rk4 --order 6
      bseries modified stormer-verlet --order 3 --format latex
      bseries modified sdirk2 --set gamma=1/4 --nonzero
      bseries modified --A "0,0;1/2,0" --b "0,1" -o midpoint.json
      bseries modified ./tableau.toml --order 12 --format csv

    LaTeX is a sum of the nonzero terms. CSV suits large orders: rows are written as they are computed.
    """
    from bseries.algebra.modified import modified_equation

    return of_method(method, modified_equation, **options)


@click.command()
@takes_method()
@takes_series_options
def modifying(method: Method, **options: Any) -> Table:
    """The modifying integrator: the equation for which a method gives the exact solution of y' = f(y).

    It is y' = f_h(y) with f_h = Σ h^(|τ|-1) weight(τ) F(τ): the method with step h, applied to it, follows the exact
    flow of f. There is one line for each tree τ; weight = coefficient/σ. --order N means trees with 1 to N nodes.

    \b
    Examples:
      bseries modifying implicit-midpoint --order 5
      bseries modifying gauss2 --order 7 --nonzero --format latex
      bseries modifying sdirk2 --order 3
    """
    from bseries.algebra.substitution import modifying_integrator

    return of_method(method, modifying_integrator, **options)


@click.command()
@takes_method()
@takes_series_options
def series(method: Method, **options: Any) -> Table:
    """The B-series of a method: its elementary weights.

    The method is y1 = y0 + Σ h^|τ| weight(τ) F(τ)(y0), with weight = coefficient/σ; the exact flow has the coefficients
    1/γ(τ). There is one line for each tree τ.

    \b
    Examples:
      bseries series rk4
      bseries series gauss2 --order 6 --format json
      bseries series sdirk2 --order 3
      bseries methods heun2 --format json | bseries series -
    """
    from bseries.algebra.modified import series

    return of_method(method, series, **options)


def of_method(
    method: Method,
    compute: Callable[..., BSeries],
    *,
    order: int,
    max_children: Limits,
    output: Output,
    **options: Any,
) -> Table:
    """The table of a series of a method."""
    limits = method.max_children if max_children is None else max_children
    output.check_rows(count_rows(order, len(method.names), limits))
    return answer(compute(method, order, max_children=limits), method.issues, **options)


def count_rows(order: int, colors: int, max_children: Limits | ChildBounds) -> int:
    """The number of trees."""
    from trees import count_trees

    return sum(count_trees(order, colors, max_children))


def answer(s: BSeries, issues: Sequence[str], *, nonzero: bool, as_float: bool) -> Table:
    """The table of a series, with the inconsistencies of the tableaux."""
    found = s.to_table(nonzero=nonzero, as_float=as_float)
    if not issues:
        return found
    return found.extended([f"Warning: {issue}." for issue in issues], issues=list(issues))
