"""The picture of a report on shadow energies: what each order gains, and two energies over time."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from ..figures.style import BLACK, BLUE, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .report import ShadowReport

SIZE = (17.0, 6.0)


def check_picture(path: Any) -> str:
    """The format of a picture, which the ending of its file tells; before much is computed for it.

    Raises:
        SeriesError: It is none that can be drawn, or there is no such folder.
        IntegratorError: It is no path, or matplotlib is not installed.
    """
    from integrators.optional_modules import optional_module
    from integrators.text_files import check_path

    from ..figures.saving import check_place, picture_format

    name = check_path(path, "plot")
    kind = picture_format(name, "plot")
    check_place(name, "plot")
    optional_module("matplotlib", "pictures")
    return kind


def save_picture(report: ShadowReport, path: str | os.PathLike[str]) -> None:
    """Write the picture.

    Args:
        report: The report.
        path: The file.

    Raises:
        SeriesError: The format is none of PNG, SVG and PDF, or there is no such folder.
        IntegratorError: The file cannot be written, or matplotlib is not installed.
    """
    from integrators.text_files import atomic_write

    from ..figures.saving import picture
    from ..figures.style import new_figure, print_style

    kind = check_picture(path)
    with print_style():
        figure = new_figure(SIZE)
        gains, energy, shadow = figure.subplots(1, 3)
        _draw_orders(report, gains)
        _draw_times(report, energy, 0, BLUE)
        _draw_times(report, shadow, report.rows.index(report.best), VERMILION)
        title = f"{os.path.basename(report.label)}: {report.states:,} states, h = {report.h:g}"
        figure.suptitle(title, fontsize="medium", parse_math=False)
    atomic_write(path, picture(figure, kind))


def _draw_orders(report: ShadowReport, ax: Axes) -> None:
    """Range and scatter of each order."""
    orders = [row.order for row in report.rows]
    for name, marker in (("deviation", "o"), ("scatter", "s")):
        values = [getattr(row, name) or None for row in report.rows]
        ax.plot(orders, values, marker=marker, color=BLUE, mfc="white" if marker == "o" else BLUE, label=name)  # type: ignore[arg-type]
    ax.axvline(report.best.order, color=VERMILION, linewidth=1, zorder=0)
    ticks = orders[:: max(1, len(orders) // 6)]
    ax.set(xlabel="order", yscale="log", title=f"constant up to (best: order {report.best.order})", xticks=ticks)
    ax.legend()


def _draw_times(report: ShadowReport, ax: Axes, k: int, color: str) -> None:
    """The energy of an order less its mean: means of blocks, the band that holds all values, and the drift."""
    t, blocks = report.blocks()
    row = report.rows[k]
    means, least, largest = (blocks[k] - blocks[k, :, 0].mean()).T
    ax.fill_between(t, least, largest, color=color, alpha=0.25, linewidth=0)
    ax.plot(t, means, color=color, linewidth=0.8)
    middle = 0.5 * (t[0] + t[-1])
    ax.plot(t[[0, -1]], row.drift * (t[[0, -1]] - middle), color=BLACK, linewidth=1, linestyle="--")
    name = "energy" if row.order == 2 else f"order {row.order}"
    ax.set(xlabel="t", title=f"{name}, less its mean")
    ax.ticklabel_format(axis="y", scilimits=(-2, 3))
