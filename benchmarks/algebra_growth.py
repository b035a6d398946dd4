"""What the algebra costs by order: the modified equation of one method in numbers of four kinds."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from .fresh_growth import DOMAINS
from .kinds import Figure, Row, Study, Table
from .texts import duration, megabytes
from .timing import ROOT, run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture

LIMIT = 1.0
"""Seconds that the highest order takes."""
LABELS = {"float": "floats", "exact": "fractions", "algebraic": "a + b√3", "symbolic": "polynomials in γ"}
COLOURS = {"float": "#0072B2", "exact": "#000000", "algebraic": "#D55E00", "symbolic": "#009E73"}
MARKERS = {"float": "o", "exact": "s", "algebraic": "^", "symbolic": "D"}
ABOUT = """\
The modified equation of the two-stage method sdirk2, whose tableau has a parameter γ: in floats and in fractions for
γ = 1/3, in algebraic numbers for γ = (3 + √3)/6 (crouzeix3), and as polynomials in γ. CPU time with trees and splits at
hand; the peak memory of the process with them, above that of order 1. Digits are those of the largest numerator or
denominator in a coefficient of this order; of floats, those that are right in the worst coefficient."""


def grown(*arguments: str, limit: float, **variables: str) -> list[Row]:
    """What `fresh_growth.py` prints."""
    command = [sys.executable, "-m", "benchmarks.fresh_growth", *arguments, str(limit)]
    return json.loads(run(command, {"PYTHONPATH": str(ROOT), **variables})[1])


def measure(rivals: Path | None = None, *, limit: float = LIMIT) -> list[Row]:
    """Every kind of numbers, up to the order that takes longer than the limit."""
    return [row for domain in DOMAINS for row in grown("algebra", domain, limit=limit)]


def tables(rows: list[Row]) -> list[Table]:
    """Time, and memory with digits, a row for each order."""
    return [
        _table(rows, "Time", {"": lambda row: duration(row["seconds"]), ", per tree": per_tree}),
        _table(
            rows,
            "Peak memory, and digits",
            {", memory": lambda row: megabytes(row["bytes"]), ", digits": lambda row: f"{row['digits']:.3g}"},
        ),
    ]


def per_tree(row: Row) -> str:
    """Time for each tree."""
    return duration(row["seconds"] / row["trees"])


def _table(rows: list[Row], title: str, columns: dict[str, Callable[[Row], str]]) -> Table:
    found = {(row["domain"], row["order"]): row for row in rows}
    trees = {row["order"]: row["trees"] for row in rows}
    places = [(domain, what) for what in columns for domain in by_domain(rows)]
    cells = [
        [columns[what](found[domain, order]) if (domain, order) in found else "" for domain, what in places]
        for order in trees
    ]
    lines = [[str(order), f"{count:,}", *line] for (order, count), line in zip(trees.items(), cells, strict=True)]
    return Table(title, ["order", "trees", *(f"{LABELS[domain]}{what}" for domain, what in places)], lines)


def by_domain(rows: list[Row]) -> dict[str, list[Row]]:
    """The rows of each kind of numbers."""
    return {domain: [row for row in rows if row["domain"] == domain] for domain in LABELS}


def figures(rows: list[Row]) -> list[Figure]:
    """All times."""
    return [
        Figure(
            f"modified equation of sdirk2 in {LABELS[row['domain']]}, order {row['order']}", row["seconds"], unit="s"
        )
        for row in rows
    ]


def draw(rows: list[Row]) -> Picture:
    """Time per tree, and digits, against the order."""
    from bseries_base.plotting import new_figure, print_style

    with print_style():
        figure = new_figure((18, 8))
        left, right = figure.subplots(1, 2)
        _curves(left, rows, lambda row: row["seconds"] / row["trees"] * 1e6)
        _curves(right, rows, lambda row: row["digits"])
        left.set(yscale="log", ylabel="CPU time per tree in µs")
        right.set(ylabel="digits of the largest number\n(of floats, those that are right)")
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _curves(panel: Axes, rows: list[Row], height: Callable[[Row], float]) -> None:
    for domain, own in by_domain(rows).items():
        orders, heights = [row["order"] for row in own], [height(row) for row in own]
        panel.plot(orders, heights, color=COLOURS[domain], marker=MARKERS[domain], label=LABELS[domain])
    against_order(panel)


def against_order(panel: Axes) -> None:
    """Whole orders from left to right, and lines behind the curves."""
    from matplotlib.ticker import MaxNLocator

    panel.set(xlabel="order")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.grid(color="#dddddd", linewidth=0.5)


STUDY = Study("algebra-growth", ABOUT, measure, tables, figures, draw)
