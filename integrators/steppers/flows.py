"""Flows of pieces of the field that feel what they move, such as linear ones, with forcing or without."""

from __future__ import annotations

from fractions import Fraction
from itertools import accumulate
from typing import TYPE_CHECKING

from ..entries import round_entry
from .linear_flows import MOST_VARIABLES, LinearFlow, constant_system, is_diagonal

if TYPE_CHECKING:
    from .plan import Call
    from .source import StepperSource
    from .structure import Structure

    FlowKey = tuple[int, tuple[int, ...], Fraction | int, int]
    """The piece, the cells that move, the time, the number of forcing terms."""

COLUMNS = 7
"""Of the extrapolation tableau; with more, its factors would blow up rounding errors."""
WORK = COLUMNS + 4
"""Arrays of work besides the forcing and one value of the field."""
MOST_HALVINGS = 12
EXTRAPOLATION = "The slopes of the flow of a piece of the field; whether they could be found."


def flow_lines(call: Call, target: str, writer: StepperSource) -> list[str]:
    """Statements for (z(1) − z(0))/h, where z′(θ) = time · h F(z(θ)) + Σ_j θ^j forcing_j.

    Where F is linear with constant coefficients, these are products with matrices that depend on h only; where each
    variable has an equation x' = a x + b with a and b that stay the same, exponentials of numbers; anything else is
    computed numerically up to rounding, with some 20 to 60 values of F.
    """
    piece, (start, *forcing) = call.node.piece, call.node.points
    structure = writer.structure
    forced = {cell for point in forcing for cell, form in point if form.terms}
    moving = [cell for cell, _ in start if cell in forced or cell in structure.writes(piece)]
    linear = None if writer.control is not None else _linear_flow(call, moving, structure)
    if linear is not None:
        return _linear_lines(call, target, linear, writer)
    if len(forcing) <= 1 and is_diagonal(structure, piece, moving):
        return _diagonal_lines(call, target, moving, writer)
    return _numerical_lines(call, target, moving, writer)


def _linear_flow(call: Call, moving: list[int], structure: Structure) -> LinearFlow | None:
    """The flow as products with matrices, if it is linear with constant coefficients and not too large."""
    system = constant_system(structure, call.node.piece, moving)
    flow = None if system is None else LinearFlow(system, call, structure)
    return flow if flow is not None and flow.largest <= MOST_VARIABLES else None


def _forcing_lines(call: Call, writer: StepperSource) -> tuple[list[str], list[str]]:
    """Statements for forcing terms, and the arrays of these, which lie one behind the other."""
    lines: list[str] = []
    dimension, terms = writer.structure.scene.dimension, call.node.points[1:]
    arrays = [f"forcing{j}" for j in range(len(terms))]
    if terms:
        writer.array("forcing", dimension * len(terms))
    for j, (array, point) in enumerate(zip(arrays, terms, strict=True)):
        lines.append(f"{array} = shifted(forcing, {j * dimension})")
        lines += writer.forms.point(point, array)[0]
    return lines, arrays


def _linear_lines(call: Call, target: str, flow: LinearFlow, writer: StepperSource) -> list[str]:
    """Statements for products with φ-functions."""
    import sympy

    module, size = writer.module, len(flow.columns)
    lines, at = writer.forms.point(call.node.points[0], "z")
    made, vectors = _forcing_lines(call, writer)
    lines += made
    key = "linear", call.node.piece, call.cells, flow.time, flow.forcing
    if key not in writer.known:
        writer.known[key] = writer.number_array(2 * size * flow.matrices, flow.numbers)
    for cell in call.cells:
        lines += writer.forms.loop(cell, [f"{target}[i] = 0.0"])
    if flow.constants:
        vectors.append(module.numbers([sympy.Rational(x.numerator, x.denominator) for x in flow.constants]))
    lines.append(f"elements = {writer.known[key]}")
    pattern = ", ".join([str(len(flow.rows)), *map(module.sites, (flow.rows, flow.starts, flow.columns))])
    for k, vector in enumerate([at, *vectors]):
        heads, tails = (f"shifted(elements, {(2 * k + half) * size})" for half in (0, 1))
        lines.append(f"add_products({pattern}, {heads}, {tails}, {vector}, {target})")
    return lines


def _diagonal_lines(call: Call, target: str, moving: list[int], writer: StepperSource) -> list[str]:
    """Statements for (x(1) − x(0))/h = (time · F(x) + forcing/h) φ_1(time · h a); a is F' times ones."""
    forms, functions, dimension = writer.forms, writer.functions, writer.structure.scene.dimension
    start, piece, time = call.node.points[0], call.node.piece, round_entry(call.node.detail)
    lines, array = forms.point(start, writer.array("growing", 2 * dimension), copied=True)
    made, vectors = _forcing_lines(call, writer)
    lines += made
    for cell, _ in start:
        lines += forms.loop(cell, [f"{array}[i + {dimension}] = {float(cell in moving)}"])
    slope, rate = writer.array("slope"), writer.array("rates")
    lines.append(f"{functions.field(piece, call.cells)}({array}, {slope})")
    lines.append(f"{functions.derivative(piece, call.cells)}({array}, {rate})")
    driven = f"{time!r}*{slope}[i]" + "".join(f" + {vector}[i]/h" for vector in vectors)
    for cell in call.cells:
        lines += forms.loop(cell, [f"{target}[i] = ({driven})*growth(h*{time!r}*{rate}[i])"])
    return lines


def _numerical_lines(call: Call, target: str, moving: list[int], writer: StepperSource) -> list[str]:
    """Statements for extrapolation."""
    structure, forms = writer.structure, writer.forms
    dimension, powers = structure.scene.dimension, len(call.node.points) - 1
    indices = [i for cell in moving for a, b in structure.cells[cell] for i in range(a, b)]
    lines, start = forms.point(call.node.points[0], writer.array("flowing"), copied=True)
    made, _ = _forcing_lines(call, writer)
    work = writer.array("rows", (powers + WORK) * len(indices) + dimension)
    slope = writer.array("slope")
    key = call.node.piece, tuple(moving), call.node.detail, powers
    if key not in writer.known:
        writer.known[key] = name = f"flow{len(writer.known)}"
        body = _extrapolation_lines(key, indices, writer)
        writer.module.function(f"{name}(start, forcing, h, work, out)", EXTRAPOLATION, body)
    arguments = f"{start}, {'forcing' if powers else start}, h, {work}, {slope}"
    lines += [*made, f"if not {writer.known[key]}({arguments}):", "    break"]
    for cell in call.cells:
        lines += forms.loop(cell, [f"{target}[i] = {slope}[i]"])
    return lines


def _extrapolation_lines(key: FlowKey, indices: list[int], writer: StepperSource) -> list[str]:
    """The body of a function for a flow by extrapolation of the explicit midpoint rule.

    An interval where it does not settle is halved. Slopes are computed, not ends: their rounding errors are small
    against those of the state.

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.9 (the method of Gragg, Bulirsch and
        Stoer).
    """
    piece, moving, time, powers = key
    n, index = len(indices), writer.module.sites(indices)
    sizes = {"drive": powers * n, "origin": n, "slopes": n, "table": COLUMNS * n, "before": n, "now": n, "value": 0}
    offsets = accumulate(sizes.values(), initial=0)
    dimension = writer.structure.scene.dimension
    return [
        *(f"{name} = shifted(work, {offset})" for name, offset in zip(sizes, offsets, strict=False)),
        f"begin_flow({n}, {index}, {powers}, {dimension}, start, forcing, h, drive, origin, slopes)",
        "position, level = 0, 0",
        "while position < 1 << level:",
        "    width = 1.0/(1 << level)",
        f"    for column in range({COLUMNS}):",
        "        steps = 2*column + 2",
        "        for m in range(steps):",
        f"            flow_point({n}, {index}, h, m == 0, origin, slopes, before, now, start)",
        f"            {writer.functions.field(piece, moving)}(start, value)",
        "            θ = (position + m/steps)*width",
        f"            midpoint_step({n}, {index}, {powers}, m == 0, θ, width/steps, {round_entry(time)!r}, drive, "
        "value, before, now)",
        f"        change, size = extrapolate({n}, column, h, origin, slopes, now, table)",
        "        if has_settled(column, change, size):",
        "            break",
        "    if has_settled(column, change, size):",
        f"        for i in range({n}):",
        f"            slopes[i] += table[column*{n} + i]",
        "        position, level = next_interval(position, level)",
        f"    elif level == {MOST_HALVINGS}:",
        "        return False",
        "    else:",
        "        position, level = 2*position, level + 1",
        f"end_flow({n}, {index}, origin, slopes, start, out)",
        "return True",
    ]
