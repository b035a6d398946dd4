"""A report on shadow energies for readers: rows of a table, and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from .statistics import OrderStatistics

if TYPE_CHECKING:
    from .report import ShadowReport

HEADINGS = ("order", "mean", "±", "scatter", "drift", "± drift")
LIMITS = {
    "rounding": "what is left is rounding",
    "order": "higher orders may show less",
    "step": "higher orders scatter more, since the step is large",
    "slow": "what is left no order explains: sums of roundings, or forces that jump",
}
COMFORTABLE, LARGE = 0.25, 0.5
"""Parts of the largest step up to which a step is small, and from which on it is large."""
KEY = (
    "±: half of the range. scatter: standard deviation from a straight line. drift: the line's slope, energy per time, "
    "and its standard error."
)


def title(report: ShadowReport) -> str:
    """What was measured."""
    end = report.start + report.h * (report.states - 1)
    return f"{report.label}: {report.states:,} states, h = {report.h:g}, t = {report.start:g} to {end:g}"


def cells(row: OrderStatistics) -> list[str]:
    """A row of the table."""
    digits = 15 if row.scatter == 0 else max(4, min(16, 3 - math.floor(math.log10(row.scatter / (abs(row.mean) or 1)))))
    numbers = (row.deviation, row.scatter, row.drift, row.drift_error)
    return [str(row.order), f"{row.mean:.{digits}g}", *(f"{number:.2e}" for number in numbers)]


def sentences(report: ShadowReport, bound: float | None = None) -> Iterator[str]:
    """What follows from the table.

    Args:
        report: The report.
        bound: A bound on the energy's deviation that a step is wanted for.
    """
    yield f"Best order: {report.best.order}, scatter {report.best.scatter:.2g}; {LIMITS[report.limit]}."
    yield _on_drift(report)
    yield _on_step(report)
    if bound is not None:
        yield f"The energy stays within ±{bound:g} with steps up to h = {report.step_for(bound):.3g}."


def _on_drift(report: ShadowReport) -> str:
    best, energy = report.best, report.rows[0]
    change = best.drift * report.h * (report.states - 1)
    drift = f"{best.drift:.2g} ± {best.drift_error:.1g}"
    if not report.has_drift:
        return (
            f"No drift: {drift} is zero within 3 standard errors (the energy alone tells ± {energy.drift_error:.1g})."
        )
    return f"Drift: {drift} energy per time, {change:.2g} in all (the energy alone tells ± {energy.drift_error:.1g})."


def _on_step(report: ShadowReport) -> str:
    most = report.largest_step
    if most is None and report.best.order > 2:
        return "Step: order 4 already shows what there is to see; the step is small."
    if most is None and report.limit == "rounding":
        return "Step: the energy does not change by more than rounding, which tells nothing of the step."
    if most is None:
        return "Step: no order is steadier than the energy; the step is too large, or forces are not smooth."
    part = report.h / most
    size = "small" if part <= COMFORTABLE else "moderate" if part <= LARGE else "large"
    return f"Step: h = {report.h:g} is {size}, {part:.2g} of {most:.3g}, where order 4 is no steadier than the energy."


def report_text(report: ShadowReport) -> str:
    """All of it as plain text."""
    rows = [list(HEADINGS), *map(cells, report.rows)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([title(report), "", *lines, "", *sentences(report)])
