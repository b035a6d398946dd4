"""Resolvents (I − hγ F′)⁻¹, the linear systems of Rosenbrock methods and W-methods."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..entries import round_entry

if TYPE_CHECKING:
    from .plan import Call
    from .source import StepperSource


def resolvent_lines(call: Call, target: str, writer: StepperSource) -> list[str]:
    """Statements for s = (I − hγ F′)⁻¹ r. Equal matrices are factorized once in a step.

    References:
        E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, section IV.7.
    """
    at, right = call.node.points
    n, piece, own = writer.structure.scene.dimension, call.node.piece, call.node.detail
    key = piece, at, own
    is_new = key not in writer.matrices
    name = writer.matrices.setdefault(key, str(len(writer.matrices)))
    matrix, pivots = writer.array(f"matrix{name}", n * n), writer.array(f"pivots{name}", n)
    lines: list[str] = []
    if is_new:
        lines, point = writer.forms.point(at, "z")
        jacobian = writer.functions.jacobian(piece, writer.structure.writes(piece))
        lines.append(f"{jacobian}({point}, {matrix})")
        lines.append(f"subtract_from_identity({matrix}, {n}, h*{round_entry(own)!r})")
        lines.append(f"factorize({matrix}, {pivots}, {n})")
    for cell, form in right:
        lines += writer.forms.loop(cell, [f"{target}[i] = {writer.forms.sum(cell, form.terms) or '0.0'}"])
    return [*lines, f"solve({matrix}, {pivots}, {n}, {target})"]
