"""What `bseries effects` writes: influences or costs, as a table for readers and as numbers for machines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from . import layout
from .layout import Column

if TYPE_CHECKING:
    from ..advice.effect_cost_rows import CostRow, EffectCosts
    from ..advice.effect_report import EffectReport, EffectRow, Influence
    from ..advice.timing import Timing
    from .output import Output

COLUMNS = (
    Column("effect"),
    Column("solution", True),
    Column("energy", True),
    Column("alone", True),
    Column("step", True),
    Column("±", True),
    Column("advice"),
)
COST_COLUMNS = (
    Column("on", True),
    Column("effects"),
    Column("step", True),
    Column("±", True),
    Column("field", True),
    Column("±", True),
    Column("trees", True),
    Column("of", True),
)
EXPLANATION = (
    "solution, energy: what leaving an effect out of all changes, relative to the size of the state and to the energy "
    "at the start; alone: what it does to the solution by itself; step: CPU time that it adds to a step."
)
CSV = (
    *("effect", "solution", "energy", "alone_solution", "alone_energy"),
    *("seconds", "uncertainty", "leave_out"),
)
COST_CSV = (
    *("on", "effects", "step_seconds", "step_low", "step_high", "field_seconds", "field_low", "field_high"),
    *("trees", "all_trees"),
)


def write_report(report: EffectReport, output: Output) -> Iterable[str]:
    """Influences, their costs and the recommendation, in any format but JSON."""
    if output.format == "csv":
        return layout.csv(CSV, _report_values(report))
    title = f"Effects of {report.scene}, {report.method}: {report.steps:,} steps of {report.h:g}"
    return _written(output, COLUMNS, list(_rows(report)), title, [EXPLANATION, *_times(report), *report.advice()])


def write_costs(costs: EffectCosts, output: Output) -> Iterable[str]:
    """What effects cost, in any format but JSON."""
    if output.format == "csv":
        return layout.csv(COST_CSV, map(_cost_values, costs))
    notes = [
        "step, field: CPU time for a step and for an evaluation of the field; ±: half the distance of the quartiles.",
        f"trees: those to order {costs.order} that the modified equation of {costs.method} needs there.",
    ]
    title = f"Cost of effects of {costs.scene}, {costs.method}"
    return _written(output, COST_COLUMNS, list(map(_cost_row, costs)), title, notes)


def _written(
    output: Output, columns: Sequence[Column], rows: Sequence[layout.Row], title: str, notes: Sequence[str]
) -> Iterable[str]:
    if output.format == "latex":
        return [layout.latex(columns, (list(map(layout.latex_text, row)) for row in rows))]
    return output.listing(columns, rows, title, notes)


def _report_values(report: EffectReport) -> Iterator[layout.Row]:
    """The numbers of each effect, and in a row without a name the error of the method."""
    for row in report.rows:
        leave_out = str(row.name in report.leave_out).lower()
        yield layout.values(row.name, *row.left_out, *row.alone, row.seconds, row.uncertainty, leave_out)
    yield layout.values(None, *report.own_error, None, None, None, None, None)


def _cost_values(row: CostRow) -> layout.Row:
    """The numbers of some effects; names are separated by spaces."""
    times = (*row.step[:3], *row.field[:3])
    return layout.values(len(row.effects), " ".join(row.effects), *times, row.trees, row.all_trees)


def _rows(report: EffectReport) -> Iterator[layout.Row]:
    """A row for each effect, and one for the method itself."""
    for row in report.rows:
        kept = "leave out" if row.name in report.leave_out else "keep"
        yield [row.name, *_influence(row.left_out), f"{row.alone.solution:.2g}", *_added(row), kept]
    yield ["(error of the method)", *_influence(report.own_error), "", "", "", ""]


def _influence(found: Influence) -> list[str]:
    return [f"{found.solution:.2g}", "" if found.energy is None else f"{found.energy:.2g}"]


def _added(row: EffectRow) -> list[str]:
    return ["", ""] if row.seconds is None else [f"{row.seconds * 1e9:+.1f} ns", f"{(row.uncertainty or 0) * 1e9:.1f}"]


def _times(report: EffectReport) -> Iterator[str]:
    """What steps cost with no effects, all, and those that are recommended."""
    times = ((name, found) for name, found in report.times.items() if found is not None)
    yield "A step takes " + ", ".join(f"{found.seconds * 1e9:,.1f} ns with {name}" for name, found in times) + "."


def _cost_row(row: CostRow) -> layout.Row:
    trees = ["" if count is None else f"{count:,}" for count in (row.trees, row.all_trees)]
    return [str(len(row.effects)), ", ".join(row.effects), *_timing(row.step), *_timing(row.field), *trees]


def _timing(found: Timing) -> list[str]:
    return [f"{found.seconds * 1e9:,.1f} ns", f"{(found.high - found.low) / 2 * 1e9:.1f}"]
