"""Fixed-point iteration for slopes that depend on one another, until nothing but rounding is left."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from integrators.compile.particle_loops import indented
from integrators.steppers.forms import scaled, tidy

if TYPE_CHECKING:
    from integrators.steppers.plan import Group
    from integrators.steppers.writer import StepWriter

MOST_SWEEPS = 100


def fixed_point_lines(group: Group, writer: StepWriter) -> list[str]:
    """Sweeps over a group until the increments stop falling.

    A sweep computes all slopes from those of the sweep before. Stopping earlier, at a tolerance, would leave errors
    that all have the same sign, and a drift of the energy.

    References:
        HLW, section VIII.6 (starting values); Hairer, McLachlan, Razakarivony, BIT 48 (2008) 231–243,
        doi:10.1007/s10543-008-0170-3 (iteration until stagnation).
    """
    forms = writer.forms
    forms.forget()
    forms.in_group = True
    new = {e: writer.array(f"n{k}") for k, e in enumerate(sorted({e for e, _ in group.unknowns}))}
    sweep = _sweep_lines(group, new, writer)
    forms.in_group = False
    forms.forget()
    cells = sorted({cell for _, cell in group.unknowns})
    compare = [f"change{cell} = 0" for cell in cells]
    for cell in cells:
        lines = ["most = 0"]  # of one entry; one maximum over all entries can be taken of vectors first
        for e in (e for e, c in group.unknowns if c == cell):
            lines += [f"x = {new[e]}[i]", f"most = max(most, bits(abs(x - k{e}[i])))", f"k{e}[i] = x"]
        lines.append(f"change{cell} = max(change{cell}, most)")
        compare += forms.loop(cell, lines)
    return [
        *start_values(group, writer),
        *(f"before{cell} = 0" for cell in cells),
        "settled, stalls = False, 0",
        f"for sweep in range({MOST_SWEEPS}):",
        *indented(sweep + compare),
        *indented(_ending(group, cells, writer)),
        "if not settled:",
        "    break",
    ]


def _sweep_lines(group: Group, new: Mapping[int, str], writer: StepWriter) -> list[str]:
    """Statements that compute all slopes from those of the sweep before.

    Points that depend on nothing else are made in one loop, which reads the slopes once for all of them.
    """
    calls = [call for call in group.calls if not writer.is_inlined(call)]
    if any(call.node.kind != "field" or call.evaluation not in new for call in calls):
        return [line for call in group.calls for line in writer.call_lines(call, new.get(call.evaluation))]
    points: dict[int, list[str]] = {}
    slopes: list[str] = []
    for call in group.calls:
        if writer.is_inlined(call):
            writer.call_lines(call)
            continue
        array = writer.array(f"z{call.evaluation}")
        for cell, line in writer.forms.assignments(call.node.points[0], array):
            points.setdefault(cell, []).append(line)
        slopes.append(f"{writer.functions.field(call.node.piece, call.cells)}({array}, {new[call.evaluation]})")
    return [*(line for cell, lines in points.items() for line in writer.forms.loop(cell, lines)), *slopes]


def _ending(group: Group, cells: Sequence[int], writer: StepWriter) -> list[str]:
    """Statements that leave the loop over sweeps."""
    small = [text for cell in cells for text in negligible_changes(cell, group, writer)]
    return [
        f"if {' and '.join(f'change{cell} == 0' for cell in cells)}:",
        "    settled = True",
        "    break",
        f"if {' or '.join(f'failed(change{cell})' for cell in cells)}:",
        "    break",
        f"if sweep > 1 and {' and '.join(f'change{cell} >= before{cell}' for cell in cells)}:",
        "    stalls += 1",
        f"    settled = {' and '.join(small)}",
        "    if stalls >= STALLS:",
        f"        settled |= {rounding(cells, writer)}",
        "    if settled:",
        "        break",
        # the least so far: rounding errors of several cells may come and go in turn for ever
        *(f"before{c} = min(before{c}, change{c}) if sweep > 1 else change{c}" for c in cells),
    ]


def negligible_changes(cell: int, group: Group, writer: StepWriter) -> Iterator[str]:
    """The conditions that changes in the variables of a cell are small."""
    for a, b in writer.structure.cells[cell]:
        sizes = [f"largest(k{e}, {a}, {b})" for e, c in group.unknowns if c == cell]
        size = f"max({', '.join(sizes)})" if len(sizes) > 1 else sizes[0]
        yield f"negligible(change{cell}, {size}, h, y, {a}, {b})"


def rounding(cells: Sequence[int], writer: StepWriter) -> str:
    """The condition that all changes are what rounding errors of the state may do."""
    dimension = writer.structure.scene.dimension
    return " and ".join(f"within_rounding(change{cell}, h, y, {dimension})" for cell in cells)


def start_values(group: Group, writer: StepWriter) -> list[str]:
    """The polynomial through the slopes of the last step, at the nodes of this one."""
    lines: list[str] = []
    for cell in sorted({cell for _, cell in group.unknowns}):
        own = [e for e, c in group.unknowns if c == cell]
        nodes = [writer.nodes.abscissa(e) for e in own]
        if len(own) > 1 and len(set(nodes)) == len(nodes):
            body = []
            for k, node in enumerate(nodes):
                terms = (scaled(f"k{e}[i]", _basis(nodes, j, 1 + node)) for j, e in enumerate(own))
                body.append(tidy(f"s{k} = {' + '.join(terms)}"))
            body += [f"k{e}[i] = s{k}" for k, e in enumerate(own)]
            lines += writer.forms.loop(cell, body)
    return lines


def _basis(nodes: Sequence[Fraction], j: int, x: Fraction) -> Fraction:
    """The j-th basis polynomial of interpolation at the nodes, at x."""
    value = Fraction(1)
    for k, node in enumerate(nodes):
        if k != j:
            value *= (x - node) / (nodes[j] - node)
    return value


def first_values(group: Group, writer: StepWriter) -> list[str]:
    """Statements for the slopes before the first step: those at y."""
    lines = []
    for e, cell in group.unknowns:
        piece = next(call.node.piece for call in group.calls if call.evaluation == e and cell in call.cells)
        lines.append(f"{writer.functions.field(piece, (cell,))}(y, k{e})")
    return lines
