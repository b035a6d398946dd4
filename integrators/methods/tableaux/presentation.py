"""Runge–Kutta methods as text, HTML, LaTeX, tables and pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bseries_base.extras import optional_module
from bseries_base.numbers import latex_number
from bseries_base.plotting import BLACK, drawing, fit_picture, in_centimetres
from bseries_base.table import Column, Table
from integrators.core.errors import IntegratorError
from integrators.core.text_files import LARGEST_NUMBER, json_text
from integrators.exact.expressions import format_number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DIGITS = 10
MOST_EXACT_STAGES = 3
"""Methods with irrational entries and more stages are shown in floats."""
FONT, GAP, LINE = 9.0, 7.0, 0.7
"""Font size, gaps around entries and line width of a picture, in points."""


def tableau_text(self: Any) -> str:
    """The tableau as text: nodes and stage matrix; below a line the weights and embedded weights."""
    rows = _cell_texts(self)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        " │ ".join((row[0].ljust(widths[0]), "  ".join(map(str.ljust, row[1:], widths[1:])))).rstrip() for row in rows
    ]
    lines.insert(self.stages, "─" * (widths[0] + 1) + "┼" + "─" * (sum(widths[1:]) + 2 * len(widths) - 3))
    return "\n".join(lines)


def tableau_html(self: Any) -> str:
    """The tableau as an HTML table."""
    rows = []
    for i, cells in enumerate(_cell_texts(self)):
        top = "border-top:1px solid;" if i == self.stages else ""
        first, *others = (f'<td style="{top}%stext-align:left">{cell}</td>' for cell in cells)
        rows.append("<tr>" + first % "border-right:1px solid;" + "".join(other % "" for other in others) + "</tr>")
    return f'<table style="border-collapse:collapse">{"".join(rows)}</table>'


def tableau_latex(method: Any) -> str:
    """The tableau as a LaTeX array."""
    lines = [" & ".join(row) + r" \\" for row in _latex_rows(method)]
    lines[method.stages - 1] += r" \hline"
    return "\n".join([f"\\begin{{array}}{{c|{'c' * method.stages}}}", *lines, r"\end{array}"])


def tableau_picture(self: Any, ax: Axes | None = None) -> Axes:
    r"""The tableau as a picture; those of several parts side by side. Long irrational entries are rounded to floats.

    Example:
        >>> from integrators import method
        >>> [text.get_text() for text in method("explicit-midpoint").plot().texts if text.get_text()]
        ['$0$', '$0$', '$0$', '$\\dfrac{1}{2}$', '$\\dfrac{1}{2}$', '$0$', '$0$', '$1$']
    """
    optional_module("matplotlib", "a plot")
    parts = zip(self.names, self.partitions, strict=True)
    tableaux = [_Picture(_latex_rows(part), part.stages, name) for name, part in parts]
    size = sum(t.width + 2 * GAP for t in tableaux), max(t.height for t in tableaux) + 2 * GAP
    with drawing(ax, IntegratorError, in_centimetres(size), frame=False) as axes:
        scale, left = fit_picture(axes, size), GAP
        for tableau in tableaux:
            tableau.draw(axes, left, GAP, scale)
            left += tableau.width + 2 * GAP
    return axes


class _Picture:
    """Rows of formulas in mathtext under a title, lines right of the first column and below the first rows."""

    def __init__(self, rows: Sequence[Sequence[str]], below: int, title: str):
        self._below, self._title = below, title
        self._rows = [[cell and f"${cell}$".replace(r"\frac", r"\dfrac") for cell in row] for row in rows]
        boxes = [[_extent(cell) for cell in row] for row in self._rows]
        columns = range(max(map(len, rows)))
        self._widths = [max(row[k][0] for row in boxes if k < len(row)) + 2 * GAP for k in columns]
        self._heights = [max(box[1] for box in row) + GAP for row in boxes]
        self._top = 2 * FONT if title else 0.0
        self.width, self.height = sum(self._widths), sum(self._heights) + self._top

    def draw(self, ax: Axes, left: float, top: float, scale: float) -> None:
        """Draw with the upper left corner at a point, in points; fonts are scaled."""
        text = {"fontsize": FONT * scale, "ha": "center", "va": "center"}
        if self._title:
            ax.text(left + self.width / 2, top + FONT / 2, self._title, **text)
        y = top + self._top
        for k, (row, height) in enumerate(zip(self._rows, self._heights, strict=True)):
            x = left
            if k == self._below:
                ax.plot([left, left + self.width], [y, y], color=BLACK, linewidth=LINE * scale)
            for cell, width in zip(row, self._widths, strict=False):
                ax.text(x + width / 2, y + height / 2, cell, **text)
                x += width
            y += height
        border = left + self._widths[0]
        ax.plot([border, border], [top + self._top, y], color=BLACK, linewidth=LINE * scale)


def _extent(cell: str) -> tuple[float, float]:
    """Width and height of a formula, in points."""
    from matplotlib.textpath import TextPath

    if not cell:
        return 0.0, FONT
    box = TextPath((0, 0), cell, size=FONT).get_extents()
    return box.width, max(box.height, FONT)


def _latex_rows(method: Any) -> list[list[str]]:
    """The entries as LaTeX, node first: the rows of A, b, and embedded weights."""
    part = _readable(method)
    rows = [[latex_number(x, part.digits) for x in (c, *row)] for c, row in zip(part.c, part.A, strict=True)]
    return rows + [["", *(latex_number(x, part.digits) for x in weights)] for weights in (part.b, *part.embedded)]


def plain_entries(values: Iterable[object], write: Callable[[Any], str] = format_number) -> list[float | str]:
    """Doubles unchanged, small integers as numbers, everything else as text."""
    return [
        value
        if isinstance(value, float)
        else int(value)
        if isinstance(value, Fraction) and value.denominator == 1 and abs(value) < LARGEST_NUMBER
        else write(value)
        for value in values
    ]


def tableau_table(method: Any, latex: Callable[[], str]) -> Table:
    """The tableaus of all parts as rows."""
    rows = [row for name, part in zip(method.names, method.partitions, strict=True) for row in _rows(name, part)]
    columns = [Column(heading) for heading in ("part", "row", "node", *map(str, range(1, method.stages + 1)))]
    own = {"latex": lambda width: latex() + "\n", "json": lambda width: json_text(method.to_dict()) + "\n"}
    return Table(method.name, columns, rows, method.remarks, own=own)


def _rows(name: str, method: Any) -> Iterator[tuple[object, ...]]:
    part = _readable(method)
    for i, row in enumerate(part.A):
        yield name, f"A{i + 1}", part.c[i], *row
    for label, weights in [("b", part.b), *(("embedded", row) for row in part.embedded)]:
        yield name, label, "", *weights


def _readable(method: Any) -> Any:
    """The method, in floats if its exact entries are roots of high degree, which are very long."""
    is_long = method.algebra is not None and method.domain != "QQ" and method.stages > MOST_EXACT_STAGES
    return method.to_float() if is_long else method


def _cell_texts(method: Any) -> list[list[str]]:
    """The entries as text, node first; explicit methods without zeros on and above the diagonal.

    Published decimals, and roots of polynomials of degree above three, have ten digits.
    """
    rounds = method.digits is not None or (method.algebra is not None and method.stages > 3)
    shown = method.to_float() if rounds else method
    rows = [*zip(shown.c, shown.A, strict=True), *(("", row) for row in (shown.b, *shown.embedded))]
    cells = [[_cell_text(value) for value in (first, *row)] for first, row in rows]
    if method.is_explicit:
        for i in range(method.stages):
            cells[i][i + 1 :] = [""] * (method.stages - i)
    return cells


def _cell_text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.{DIGITS}g}"
    return value if isinstance(value, str) else format_number(value)
