"""What a series on a scene costs by order: until it is ready, and per point."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from .algebra_growth import against_order, grown, per_tree
from .kinds import Figure, Row, Study, Table
from .texts import duration, megabytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

LIMIT = 2.0
"""Seconds until the series of the highest order is ready."""
SCENES = (
    ("pendulum", "rk4", "auto"),
    ("pendulum", "rk4", "towers"),
    ("kepler", "rk4", "auto"),
    ("lennard-jones", "stormer-verlet-kdk", "auto"),
)
"""Scenes with their methods and the routes by which values are computed."""
STYLES = (("#0072B2", "o"), ("#56B4E9", "s"), ("#D55E00", "^"), ("#009E73", "D"))
ABOUT = """\
f_h compiled: as formulas, summed up and simplified, or by towers of derivatives where these are too large. Only trees
whose elementary differentials need not vanish on the scene are there, of all that the method's colours give. CPU time
per point among 400; time from the method to the first value, with nothing of the scene compiled; peak memory above that
of order 1; the digits of a value that are right, in the worst component at h = 1, where terms of high order count."""


def measure(rivals: Path | None = None, *, limit: float = LIMIT) -> list[Row]:
    """Every scene, up to the order that takes longer than the limit to be ready."""
    with tempfile.TemporaryDirectory() as folder:
        return [row for task in SCENES for row in grown("scene", *task, limit=limit, BSERIES_CACHE=folder)]


def by_scene(rows: list[Row]) -> dict[str, list[Row]]:
    """The rows of every scene, under its name with those of the method and of a route that is asked for."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        route = "" if row["route"] == "auto" else f", by {row['route']}"
        found.setdefault(f"{row['method']} on {row['scene']}{route}", []).append(row)
    return found


def tables(rows: list[Row]) -> list[Table]:
    """A table for every scene."""
    headings = ["order", "trees", "of", "per point", "per point and tree", "ready after", "memory", "right digits"]
    return [Table(title, headings, [_cells(row) for row in own]) for title, own in by_scene(rows).items()]


def _cells(row: Row) -> list[str]:
    return [
        str(row["order"]),
        f"{row['trees']:,}",
        f"{row['of']:,}",
        duration(row["seconds"]),
        per_tree(row),
        duration(row["ready"]),
        megabytes(row["bytes"]),
        f"{row['digits']:.3g}",
    ]


def figures(rows: list[Row]) -> list[Figure]:
    """All times per point."""
    return [
        Figure(f"f_h of {title}, order {row['order']}, per point", row["seconds"], unit="s")
        for title, own in by_scene(rows).items()
        for row in own
    ]


def draw(rows: list[Row]) -> Picture:
    """Time per point, and until ready, against the order."""
    from bseries_base.plotting import new_figure, print_style

    with print_style():
        figure = new_figure((18, 8))
        panels = figure.subplots(1, 2)
        for panel, key, factor in zip(panels, ("seconds", "ready"), (1e6, 1.0), strict=True):
            for (title, own), (colour, marker) in zip(by_scene(rows).items(), STYLES, strict=False):
                heights = [row[key] * factor for row in own]
                panel.plot([row["order"] for row in own], heights, color=colour, marker=marker, label=title)
            panel.set(yscale="log")
            against_order(panel)
        panels[0].set(ylabel="CPU time per point in µs")
        panels[1].set(ylabel="CPU time until the first value in s")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


STUDY = Study("scene-growth", ABOUT, measure, tables, figures, draw)
