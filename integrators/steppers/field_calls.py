"""Calls of pieces of the field."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .diagonals import diagonal

if TYPE_CHECKING:
    from .plan import Call
    from .source import StepperSource


def field_call_lines(call: Call, target: str, writer: StepperSource) -> list[str]:
    """A piece of the field at a point; cells where it only scales are written as loops, or not before they are read."""
    point, piece, forms = call.node.points[0], call.node.piece, writer.forms
    scaling = {cell: diagonal(writer.structure, piece, cell) for cell in call.cells}
    if len(call.cells) == 1 and (call.evaluation, call.cells[0]) in writer.once and forms.in_group:
        chosen = scaling[call.cells[0]]
        assert chosen is not None  # read_once has found it
        text = forms.entry(chosen.source, dict(point)[chosen.source])
        forms.inlined[call.evaluation, call.cells[0]] = chosen.scaled(text, writer)
        return []
    lines, at = forms.point(point, "z")
    others = []
    for cell, chosen in scaling.items():
        if chosen is None:
            others.append(cell)
            continue
        text = chosen.scaled(f"{at}[i]", writer)
        if (call.evaluation, cell) in writer.once:
            forms.inlined[call.evaluation, cell] = text
        else:
            lines += forms.loop(cell, [f"{target}[i] = {text}"])
    if others:
        lines.append(f"{writer.functions.field(piece, others)}({at}, {target})")
    return lines
