"""`bseries modified`, `modifying` and `series`: the coefficients of a method, tree by tree."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli import table
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.trees import takes_max_children
from bseries.cli.output import WholeNumber, names_or_none, takes_output
from bseries.cli.table import Column

if TYPE_CHECKING:
    from bseries.algebra.bseries import BSeries
    from bseries.algebra.presentation import SeriesTerm
    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output

FIELDS = ("tree", "levels", "colors", "order", "symmetry", "density", "coefficient", "weight", "differential")
COLUMNS = (Column("|τ|", True), Column("tree τ"), Column("coefficient"), Column("weight"), Column("F(τ)"))


def takes_series_options(verb: Callable[..., Any]) -> Callable[..., Any]:
    """The options that all verbs about series share."""
    options = (
        click.option("--order", type=WholeNumber(), default=5, show_default=True, help="Largest number of nodes."),
        takes_max_children,
        click.option("--nonzero", is_flag=True, help="Leave out trees whose coefficient is zero."),
        click.option("--float", "as_float", is_flag=True, help="Round the exact coefficients to floats."),
        takes_output,
    )
    return functools.reduce(lambda command, option: option(command), reversed(options), verb)


@click.command()
@takes_method()
@takes_series_options
def modified(method: Method, **options: Any) -> Iterable[str]:
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

    LaTeX is the sum written out, without zeros. CSV is for large orders: it is written as it is made.
    """
    from bseries.algebra.modified import modified_equation

    return of_method(method, modified_equation, "modified", **options)


@click.command()
@takes_method()
@takes_series_options
def modifying(method: Method, **options: Any) -> Iterable[str]:
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

    return of_method(method, modifying_integrator, "modifying", **options)


@click.command()
@takes_method()
@takes_series_options
def series(method: Method, **options: Any) -> Iterable[str]:
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

    return of_method(method, series, "series", **options)


def of_method(
    method: Method, compute: Callable[..., BSeries], kind: str, *, order: int, max_children: Any, **options: Any
) -> Iterable[str]:
    """Compute a series of a method and lay it out."""
    from bseries.algebra.stages import own_trees

    max_children = own_trees(method) if max_children is None else max_children
    options["output"].check_rows(count_rows(order, len(method.names), max_children))
    return answer(compute(method, order, max_children=max_children), kind, method.issues, **options)


def count_rows(order: int, colors: int, max_children: Any) -> int:
    """How many trees there will be."""
    from trees import count_trees

    return sum(count_trees(order, colors, max_children))


def answer(
    s: BSeries, kind: str, issues: Sequence[str], *, nonzero: bool, as_float: bool, output: Output
) -> Iterable[str]:
    """Lay out a series; `issues` are what a reader must beware of."""
    if as_float:
        s = s.to_float()
    if output.format == "json":
        data = s.to_dict(kind, nonzero=nonzero)
        if issues:
            data["issues"] = list(issues)
        return [table.json(data, "terms")]
    if output.format == "latex":
        return [s.to_latex(nonzero=True) + "\n"]
    if output.format == "csv":
        return table.csv(FIELDS, _csv_rows(s, _terms(s, nonzero, output)))
    title, notes = _title(s, kind), _notes(s, issues, kind, nonzero=nonzero, rounded=as_float)
    rows = _table_rows(s, _terms(s, nonzero, output))
    if output.format == "markdown":
        return [table.markdown(COLUMNS, rows, title=title, notes=notes)]
    text = table.text(COLUMNS, table.sections(rows, 0), output.width)
    return [table.paragraphs([title, ""], output.width), text, table.paragraphs(["", *notes], output.width)]


def _terms(s: BSeries, nonzero: bool, output: Output) -> Iterator[SeriesTerm]:
    return output.track(s.terms(nonzero=nonzero), len(s))


def _table_rows(s: BSeries, terms: Iterable[SeriesTerm]) -> Iterator[table.Row]:
    names = names_or_none(s.names)
    for term in terms:
        tree = term.tree
        yield str(tree.order), tree.text(names), term.coefficient_text, term.weight_text, tree.differential(names=names)


def _csv_rows(s: BSeries, terms: Iterable[SeriesTerm]) -> Iterator[table.Row]:
    names = names_or_none(s.names)
    for term in terms:
        tree = term.tree
        lists = (" ".join(map(str, numbers)) for numbers in (tree.levels, tree.colors))
        counts = map(str, (tree.order, tree.symmetry, tree.density))
        yield tree.text(names), *lists, *counts, term.coefficient_text, term.weight_text, tree.differential(names=names)


def _title(s: BSeries, kind: str) -> str:
    what = {"modified": "Modified equation", "modifying": "Modifying integrator", "series": "B-series"}[kind]
    nodes = f"1 to {s.order} nodes" if s.order > 1 else "1 node"
    least, most = (1, s.order) if kind == "series" else (0, s.order - 1)
    powers = f"h^{least} to h^{most}" if most > least else f"h^{least}"
    return f"{what} of {s.label}: trees with {nodes}, powers {powers}"


def _notes(s: BSeries, issues: Iterable[str], kind: str, *, nonzero: bool, rounded: bool) -> list[str]:
    """What a reader must know about the numbers."""
    field = "y' = f_h(y) with f_h = Σ h^(|τ|-1) · weight(τ) · F(τ); weight = coefficient/σ"
    formula = {
        "modified": field,
        "modifying": f"{field}; the method applied to it follows the exact flow of y' = f(y)",
        "series": "y1 = y0 + Σ h^|τ| · weight(τ) · F(τ)(y0); weight = coefficient/σ",
    }
    notes = [formula[kind]]
    if rounded:
        notes.append("Floating point (RR): exact coefficients, each rounded to the nearest float.")
    elif not s.is_exact:
        notes.append("Floating point (RR): the tableau holds floats, so the coefficients carry rounding errors.")
    elif s.digits is None:
        notes.append(f"Exact coefficients, in {s.domain}.")
    if s.digits is not None:
        notes.append(
            f"The tableau is published as decimals with {s.digits} digits: numbers are rounded to what these tell, and "
            "what they cannot tell from zero is 0."
        )
    if nonzero:
        notes.append("Trees whose coefficient is zero are left out.")
    notes += [f"Beware: {issue}." for issue in issues]
    return notes
