"""`bseries modified`, `modifying`, `series` and `compose`: the coefficients of methods, tree by tree."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import complete_method, read_method, takes_method
from bseries.cli.options.values import WholeNumber, adds, takes_max_children
from bseries.cli.output import Output, takes_output
from foundation.table import Table
from integrators.core.arguments import split_row

if TYPE_CHECKING:
    from bseries.algebra.bseries import BSeries
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
    from bseries.algebra.products import modifying_integrator

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
    method: Method, compute: Callable[..., BSeries], *, order: int, max_children: Any, output: Output, **options: Any
) -> Table:
    """The table of a series of a method."""
    max_children = method.max_children if max_children is None else max_children
    output.check_rows(count_rows(order, len(method.names), max_children))
    return answer(compute(method, order, max_children=max_children), method.issues, **options)


def count_rows(order: int, colors: int, max_children: Any) -> int:
    """The number of trees."""
    from trees import count_trees

    return sum(count_trees(order, colors, max_children))


def answer(s: BSeries, issues: Sequence[str], *, nonzero: bool, as_float: bool) -> Table:
    """The table of a series, with the inconsistencies of the tableaux."""
    found = s.to_table(nonzero=nonzero, as_float=as_float)
    if not issues:
        return found
    return found.extended([f"Warning: {issue}." for issue in issues], issues=list(issues))


@click.command()
@click.argument("sources", metavar="METHOD METHOD...", nargs=-1, required=True, shell_complete=complete_method)
@click.option("--steps", metavar="ROW", help='Length of each step, in units of h, as in "1/2,1/2"; by default 1 each.')
@click.option("--modified", is_flag=True, help="The modified equation of the composition, not its B-series.")
@takes_series_options
def compose(
    sources: tuple[str, ...],
    steps: str | None,
    modified: bool,
    order: int,
    max_children: Any,
    output: Output,
    **options: Any,
) -> Table:
    """The B-series of a composition of methods; the first METHOD acts first.

    Where the steps add up to 1, the composition is a method for the step h. Each METHOD is a name or a file, as for the
    other verbs.

    \b
    Examples:
      bseries compose implicit-euler explicit-euler --steps 1/2,1/2
      bseries compose symplectic-euler-p symplectic-euler-q --steps 1/2,1/2 --modified --order 3
      bseries compose rk4 rk4 --steps 1/2,1/2 --order 6 --nonzero
    """
    from bseries.algebra.modified import series
    from bseries.algebra.products import compose as compose_series
    from integrators.exact.entries import read_entry

    methods: Any = [read_method(source) for source in sources]
    texts = split_row(steps) if steps is not None else ["1"] * len(methods)
    if len(texts) != len(methods):
        raise Refusal(f"steps must be as many as methods, {len(methods)}, but were {len(texts)}")
    lengths = [read_entry(text, f"steps[{i}]") for i, text in enumerate(texts, 1)]
    for other in methods[1:]:
        if other.names != methods[0].names:
            raise Refusal(f"METHODs must have the same parts, but {_parts(methods[0])} and {_parts(other)}")
    output.check_rows(count_rows(order, len(methods[0].names), max_children))

    def one(method: Any, length: Any) -> BSeries:
        return series(method, order, max_children=max_children).scale_step(length)

    s = functools.reduce(compose_series, map(one, methods, lengths))
    parts = (name.name if text == "1" else f"{name.name} ({text} h)" for name, text in zip(methods, texts, strict=True))
    s = (s.log() if modified else s).with_label(", then ".join(parts), "modified" if modified else "series")
    issues = list(dict.fromkeys(issue for method in methods for issue in method.issues))
    return answer(s, issues, **options)


def _parts(method: Any) -> str:
    return f"{method.name} has {', '.join(method.names)}" if any(method.names) else f"{method.name} has none"
