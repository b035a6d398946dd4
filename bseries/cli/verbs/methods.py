"""`bseries methods`: the catalogue, and one method's tableau with its source."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import TYPE_CHECKING, Any

import click

from bseries.cli import table
from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import takes_method
from bseries.cli.output import takes_output
from bseries.cli.table import Column

if TYPE_CHECKING:
    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output
    from integrators import PartitionedRungeKutta, RungeKutta
    from integrators.methods.catalogue.entry import MethodEntry

COLUMNS = (Column("name"), Column("stages", True), Column("order", True), Column("description"))
FIELDS = ("name", "kind", "stages", "order", "description", "aliases", "parameters", "reference")
MOST_EXACT_STAGES = 3
"""Roots of higher degree fill pages; beyond, methods with irrational entries are shown in floats."""


@click.command()
@takes_method(required=False)
@takes_output
def methods(method: Method | None, output: Output) -> Iterable[str]:
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
    return _catalogue(output) if method is None else _tableau(method, output)


def _catalogue(output: Output) -> Iterable[str]:
    from integrators import catalogue

    entries = catalogue()
    if output.format == "json":
        records = [_record(entry) for entry in entries]
        return [table.json({"schema": 1, "kind": "methods", "methods": records}, "methods")]
    if output.format == "csv":
        return table.csv(FIELDS, (_csv_row(_record(entry)) for entry in entries))
    if output.format == "latex":
        cells = ([table.latex_text(cell.replace("\n", "; ")) for cell in _row(entry)] for entry in entries)
        return [table.latex(COLUMNS, cells)]
    notes = ["`bseries methods NAME` shows a tableau and its source; --format csv and json list all sources."]
    if output.format == "markdown":
        return [table.markdown(COLUMNS, map(_row, entries), title="Methods", notes=notes)]
    rows: list[table.Row | None] = []
    for kind, group in groupby(entries, key=lambda entry: entry.kind):
        rows += [None, (kind.upper(), "", "", ""), *map(_row, group)]
    return [table.text(COLUMNS, rows[1:], output.width), table.paragraphs(["", *notes], output.width)]


def _record(entry: MethodEntry) -> dict[str, Any]:
    record = {field: getattr(entry, field) for field in FIELDS}
    return {**record, "name": _name(entry), "stages": entry.stages or "s"}


def _name(entry: MethodEntry) -> str:
    return entry.name + "{s}" * entry.is_family


def _csv_row(record: dict[str, Any]) -> table.Row:
    return [" ".join(value) if isinstance(value, tuple) else str(value) for value in record.values()]


def _row(entry: MethodEntry) -> table.Row:
    stages = str(entry.stages) if entry.stages else f"s ≥ {entry.least_stages}" if entry.least_stages > 1 else "s"
    description = [entry.description]
    if entry.aliases:
        description.append(f"also: {', '.join(entry.aliases)}")
    if entry.parameters:
        description.append(f"parameters: {', '.join(entry.parameters)}")
    return _name(entry), stages, str(entry.order), "\n".join(description)


def _entry_of(method: Method) -> MethodEntry | None:
    """What the catalogue says about a method; None if it is not from there."""
    from integrators import catalogue

    found = (e for e in catalogue() if method.name == (f"{e.name}{method.stages}" if e.is_family else e.name))
    return next(found, None)


def _tableau(method: Method, output: Output) -> Iterable[str]:
    from integrators import PartitionedRungeKutta, RungeKutta

    if output.format in ("table", "markdown"):
        return _described(method, output)
    if not isinstance(method, RungeKutta | PartitionedRungeKutta):
        raise Refusal(f"format must be table or markdown for {method.name}, not a tableau, but was {output.format}")
    if output.format == "json":
        from integrators.methods.tableaux.files import dumps_method

        return [dumps_method(method, "json")]
    if output.format == "csv":
        return table.csv(("part", "row", "node", *map(str, range(1, method.stages + 1))), _csv_tableau(method))
    return [_latex_tableau(part) for part in method.partitions]


def _described(method: Method, output: Output) -> Iterable[str]:
    """The tableau or the program, and what is known about the method."""
    facts = list(_facts(method))
    if output.format == "markdown":
        return [f"{method.name}\n\n```text\n{method}\n```\n\n", *(f"- {fact}\n" for fact in facts)]
    return [f"{method.name}\n\n{method}\n\n", table.paragraphs(facts, output.width)]


def _facts(method: Method) -> Iterator[str]:
    """What is known about a method besides its tableau."""
    entry = _entry_of(method)
    if entry is not None:
        yield entry.description
        yield f"kind: {entry.kind}, stages: {method.stages}, order: {_shown_order(entry)}"
        if entry.aliases:
            yield f"aliases: {', '.join(entry.aliases)}"
    if method.parameters:
        yield f"parameters: {', '.join(method.parameters)}"
    if method.digits is not None:
        yield f"published as decimals with {method.digits} digits"
    if method.reference:
        yield f"reference: {method.reference}"


def _shown_order(entry: MethodEntry) -> str:
    return f"{entry.order} with s stages" if entry.is_family else str(entry.order)


def _shown(part: RungeKutta) -> RungeKutta:
    """The method, in floats if its exact entries fill pages."""
    too_long = part.algebra is not None and part.domain != "QQ" and part.stages > MOST_EXACT_STAGES
    return part.to_float() if too_long else part


def _csv_tableau(method: RungeKutta | PartitionedRungeKutta) -> Iterator[table.Row]:
    for part, name in zip(map(_shown, method.partitions), method.names, strict=True):
        for i, row in enumerate(part.A):
            yield name, f"A{i + 1}", str(part.c[i]), *map(str, row)
        for label, weights in [("b", part.b), *(("embedded", row) for row in part.embedded)]:
            yield name, label, "", *map(str, weights)


def _latex_tableau(method: RungeKutta) -> str:
    from bseries.algebra.presentation import latex_number

    part: Any = _shown(method)  # which has digits, all that `latex_number` asks of a series
    rows = [(c, *row) for c, row in zip(part.c, part.A, strict=True)]
    lines = [" & ".join(latex_number(x, part.digits) for x in row) + r" \\" for row in rows]
    lines[-1] += r" \hline"
    lines += [" & ".join(["", *(latex_number(x, part.digits) for x in w)]) + r" \\" for w in (part.b, *part.embedded)]
    return "\n".join([f"\\begin{{array}}{{c|{'c' * part.stages}}}", *lines, r"\end{array}"]) + "\n"
