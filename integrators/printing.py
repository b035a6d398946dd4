"""A Butcher tableau as text and as HTML."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .expressions import format_number

if TYPE_CHECKING:
    from .tableau import RungeKutta

DIGITS = 10


def tableau_text(method: RungeKutta) -> str:
    """The nodes, a bar, the stage matrix; below a line the weights, and the embedded weights."""
    rows = _cells(method)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        " │ ".join((row[0].ljust(widths[0]), "  ".join(map(str.ljust, row[1:], widths[1:])))).rstrip() for row in rows
    ]
    lines.insert(method.stages, "─" * (widths[0] + 1) + "┼" + "─" * (sum(widths[1:]) + 2 * len(widths) - 3))
    return "\n".join(lines)


def tableau_html(method: RungeKutta) -> str:
    """The same as an HTML table."""
    rows = []
    for i, cells in enumerate(_cells(method)):
        top = "border-top:1px solid;" if i == method.stages else ""
        first, *others = (f'<td style="{top}%stext-align:left">{cell}</td>' for cell in cells)
        rows.append("<tr>" + first % "border-right:1px solid;" + "".join(other % "" for other in others) + "</tr>")
    return f'<table style="border-collapse:collapse">{"".join(rows)}</table>'


def _cells(method: RungeKutta) -> list[list[str]]:
    """The tableau as text, node first; zeros on and above the diagonal of an explicit method are left out.

    Published decimals, and roots of polynomials of degree above three, are shown with ten digits.
    """
    rounds = method.digits is not None or (method.algebra is not None and method.stages > 3)
    shown = method.to_float() if rounds else method
    rows = [*zip(shown.c, shown.A, strict=True), *(("", row) for row in (shown.b, *shown.embedded))]
    cells = [[_cell(value) for value in (first, *row)] for first, row in rows]
    if method.is_explicit:
        for i in range(method.stages):
            cells[i][i + 1 :] = [""] * (method.stages - i)
    return cells


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.{DIGITS}g}"
    return value if isinstance(value, str) else format_number(value)
