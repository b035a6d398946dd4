"""Newton's iteration for slopes that depend on one another in stiff systems, until nothing but rounding is left."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..site_loops import indented
from .fixed_point import MOST_SWEEPS, negligible_changes, rounding, start_values
from .slope_matrix import SlopeMatrix

if TYPE_CHECKING:
    from .plan import Group
    from .source import StepperSource

PATIENCE = 50
"""After so many sweeps the iteration begins anew."""
SLOW = 8
"""Changes that fall by a smaller factor call for a new matrix."""
STALLED = 2
"""Changes that fall by a smaller factor are rounding errors, if they are small: the last bits may creep for long."""


def newton_lines(group: Group, writer: StepperSource) -> list[str]:
    """Sweeps k ← k + (I − G′)⁻¹ (G(k) − k) over a group until the increments stop falling.

    The Jacobians are those at the points that the starting values lead to, and the matrix is kept until the iteration
    slows down. If it diverges, or takes long, it begins anew at k = 0, this time with a new matrix in each sweep.

    References:
        E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, section IV.8.
    """
    forms = writer.forms
    forms.forget()
    matrix = SlopeMatrix(group, writer)
    right = writer.array("right", matrix.size)
    new = {e: writer.array(f"n{k}") for k, e in enumerate(sorted({e for e, _ in group.unknowns}))}
    # the points of the matrix need the slopes that are computed on the way
    inner = (call for call in group.calls if call.evaluation not in new)
    making = [*(line for call in inner for line in writer.call_lines(call)), *matrix.lines()]
    forms.forget()
    sweep = [line for call in group.calls for line in writer.call_lines(call, new.get(call.evaluation))]
    forms.forget()
    for stretch in matrix.stretches:
        e = stretch.evaluation
        sweep += stretch.loop(f"{stretch.entry(right)} = {new[e]}[i] - k{e}[i]")
    sweep.append(f"solve(matrix, pivots, {matrix.size}, {right})")
    cells = sorted({cell for _, cell in group.unknowns})
    sweep += [f"change{cell} = 0" for cell in cells]
    for stretch in matrix.stretches:
        change, x = f"change{stretch.cell}", stretch.entry(right)
        sweep += stretch.loop(f"k{stretch.evaluation}[i] += {x}", f"{change} = max({change}, bits(abs({x})))")
    return [
        *start_values(group, writer),
        *(f"before{cell} = BITS_OF_INFINITY" for cell in cells),
        "settled, again, stale, stalls = False, False, True, 0",
        f"for sweep in range({MOST_SWEEPS}):",
        *indented(["if stale:", *indented(making), *sweep, *_ending(group, writer)]),
        "if not settled:",
        "    break",
    ]


def _ending(group: Group, writer: StepperSource) -> list[str]:
    """Statements that leave the loop over sweeps, or say how it goes on."""
    cells = sorted({cell for _, cell in group.unknowns})
    lines = [f"small{cell} = {' and '.join(negligible_changes(cell, group, writer))}" for cell in cells]
    over = (f"small{c} and (change{c} == 0 or not falls(change{c}, before{c}, {STALLED}))" for c in cells)
    slow = (f"not (small{c} or falls(change{c}, before{c}, {SLOW}))" for c in cells)
    zeros = [line for e, cell in group.unknowns for line in writer.forms.loop(cell, [f"k{e}[i] = 0.0"])]
    falling = " or ".join(f"falls(change{cell}, before{cell}, {STALLED})" for cell in cells)
    return [
        *lines,
        f"stalls += not ({falling})",
        f"if {' and '.join(over)} or stalls >= STALLS and {rounding(cells, writer)}:",
        "    settled = True",
        "    break",
        f"if sweep == {PATIENCE} or {' or '.join(f'failed(change{cell})' for cell in cells)}:",
        "    if again:",
        "        break",
        "    again, stale = True, True",
        *indented(zeros),
        *(f"    before{cell} = BITS_OF_INFINITY" for cell in cells),
        "    continue",
        f"stale = again or {' or '.join(slow)}",
        # the least so far: rounding errors of several cells may come and go in turn for ever
        *(f"before{cell} = min(before{cell}, change{cell})" for cell in cells),
    ]
