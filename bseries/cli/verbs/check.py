"""`bseries check`: order, principal error, and what the tableau tells."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

import click

from bseries.cli import table
from bseries.cli.options.method_argument import takes_method
from bseries.cli.output import WholeNumber, names_or_none, takes_output
from bseries.cli.table import Column

if TYPE_CHECKING:
    from bseries.analysis.order import ErrorCoefficients
    from bseries.analysis.report import Report
    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output

Number = Callable[[Any, Any], str]
"""How to write a number of a method."""

COLUMNS = (Column("quantity"), Column("value"))
_NAMES = {
    "i_stable": "I-stable",
    "a_stable": "A-stable",
    "l_stable": "L-stable",
    "stability_angle": "stability angle in degrees",
    "linear_ssp_coefficient": "linear SSP coefficient",
    "ssp_coefficient": "SSP coefficient",
}
"""Names of facts that are no plain words."""

MOST_TERMS = 50
"""More error coefficients than these are left to JSON and CSV."""


@click.command()
@takes_method()
@click.option("--order", type=WholeNumber(), help="How far to test; by default as far as needed, or a little beyond.")
@click.option("--nonzero", is_flag=True, help="Leave out error coefficients that are zero.")
@takes_output
def check(method: Method, order: int | None, nonzero: bool, output: Output) -> Iterable[str]:
    """Order, principal error, structure and stability of a method.

    A property such as symplectic holds up to some number of nodes, and the first tree that breaks it is named; what the
    tableau alone decides, for all orders and all values of symbols, is yes or no. The principal error coefficients are
    e(τ) = (a(τ) - 1/γ(τ))/σ(τ) for the trees with p+1 nodes, p being the order; the norm is the square root of the sum
    of their squares.

    \b
    Examples:
      bseries check rk4
      bseries check gauss3 --format json
      bseries check dormand-prince54 --nonzero
      bseries check --A "0,0;2/3,0" --b "1/4,3/4"
    """
    from bseries.analysis.report import check
    from trees.counting import check_order

    report = check(method, None if order is None else check_order(order))
    if output.format == "json":
        data = report.to_dict()
        if nonzero and "error" in data:
            data["error"]["terms"] = [term for term in data["error"]["terms"] if term["coefficient"] != "0"]
        return [table.json(data)]
    number = _latex_number if output.format == "latex" else _number
    facts, errors = list(_facts(report, number)), list(_errors(report, number, nonzero))
    if output.format == "csv":
        return table.csv([column.heading for column in COLUMNS], [*facts, *errors])
    notes = list(_notes(report))
    if len(errors) > MOST_TERMS:
        notes.append(f"The {len(errors)} principal error coefficients are listed by --format csv and json.")
        errors = []
    if output.format == "latex":
        rows = [(table.latex_text(name), v if v[0] == "$" else table.latex_text(v)) for name, v in [*facts, *errors]]
        return [table.latex(COLUMNS, rows)]
    title = f"Order and properties of {method.name}"
    if output.format == "markdown":
        return [table.markdown(COLUMNS, [*facts, *errors], title=title, notes=notes)]
    text = table.text(COLUMNS, [*facts, *([None] if errors else []), *errors], output.width)
    return [table.paragraphs([title, ""], output.width), text, table.paragraphs(["", *notes], output.width)]


def _facts(report: Report, number: Number) -> Iterator[tuple[str, str]]:
    """What the report says, as pairs of a name and a text."""
    method = report.method
    yield "order", str(report.order) if report.order < report.tested_to else f"at least {report.order}"
    yield "order conditions tested", f"to {report.tested_to} nodes"
    if report.embedded_orders:
        yield "order of embedded weights", ", ".join(map(str, report.embedded_orders))
    yield "stages", str(method.stages)
    for name, holds in report.properties.items():
        yield name.replace("_", " "), _answer(holds)
    yield from _structure(report)
    if report.assumptions is not None:
        yield "stage order", str(report.stage_order)
        yield "simplifying assumptions", ", ".join(f"{x}({k})" for x, k in zip("BCD", report.assumptions, strict=True))
    for name, value in report.stability.items():
        if value is not None and name != "undecided":
            yield _NAMES.get(name, name.replace("_", " ")), _answer(value) if isinstance(value, bool) else str(value)
    for sums, name in zip(report.row_sums, method.names, strict=False):  # only tableaux have row sums
        yield f"row sums of {name}" if name else "row sums", ", ".join(number(x, method) for x in sums)
    if report.error is not None:
        yield from _norms(report.error, method, number)


def _answer(holds: bool) -> str:
    return "yes" if holds else "no"


def _structure(report: Report) -> Iterator[tuple[str, str]]:
    """Up to which order each property holds."""
    names = names_or_none(report.method.names)
    for name, verdict in report.structure.items():
        tested = f"to all {verdict.tested_to} nodes tested"
        until = (
            f"to {verdict.order} nodes, not for {verdict.breaks.text(names)}" if verdict.breaks is not None else tested
        )
        yield name.replace("_", " "), until


def _norms(error: ErrorCoefficients, method: Method, number: Number) -> Iterator[tuple[str, str]]:
    if error.norm is not None:
        yield "principal error norm", number(error.norm, method)
        yield "largest error coefficient", number(error.largest, method)
    yield "square of the norm", number(error.norm_squared, method)


def _errors(report: Report, number: Number, nonzero: bool) -> Iterator[tuple[str, str]]:
    names = names_or_none(report.method.names)
    for tree, e in report.error.terms if report.error is not None else ():
        if e or not nonzero:
            yield f"e({tree.text(names)})", number(e, report.method)


def _number(value: Any, method: Any) -> str:
    """A number, rounded to the digits of a method published as decimals."""
    from bseries.algebra.presentation import number_text

    return number_text(value, method.digits)


def _latex_number(value: Any, method: Any) -> str:
    """The same as LaTeX."""
    from bseries.algebra.presentation import latex_number

    return f"${latex_number(value, method.digits)}$"


def _notes(report: Report) -> Iterator[str]:
    if report.error is not None:
        p = report.order
        yield f"e(τ) = (a(τ) - 1/γ(τ))/σ(τ): the error of a step is h^{p + 1} Σ e(τ) F(τ) + O(h^{p + 2})."
    if report.method.digits is not None:
        yield (
            f"The tableau is published as decimals with {report.method.digits} digits: numbers are rounded to as many, "
            "and residuals that these digits cannot tell from zero count as zero."
        )
    if getattr(report.method, "domain", "") == "float":
        yield "Floating point: an order condition counts as satisfied if its residual is within rounding errors."
    names = report.method.names
    if report.structure and len(names) > 1:
        if set(names) == {"p", "q"}:
            yield "Structure: p and q are taken as blocks of variables, p' = -H_q and q' = H_p."
        else:
            yield f"Structure: {', '.join(names)} are taken as parts of the field, each with the property itself."
    if not report.stability:
        yield "Linear stability is computed for Runge-Kutta tableaux only."
    if report.structure and max(v.tested_to for v in report.structure.values()) <= report.order:
        yield "Up to its order a method has every structure that the exact flow has; more nodes: --order N."
    undecided: dict[str, str] = report.stability.get("undecided", {})
    for reason in dict.fromkeys(undecided.values()):
        facts = ", ".join(_NAMES.get(name, name.replace("_", " ")) for name, why in undecided.items() if why == reason)
        yield f"Not decided: {facts}: {reason}."
    for issue in report.method.issues:
        yield f"Beware: {issue}."
