"""Flows of pieces of the field that depend on the variables they move, and averages of pieces along paths.

The φ-functions φ_0(z) = e^z, φ_k(z) = ∫₀¹ e^((1−θ)z) θ^(k−1)/(k−1)! dθ solve linear equations z' = X z + Σ θ^j g_j by
z(1) = z(0) + φ_1(X) X z(0) + Σ j! φ_(j+1)(X) g_j. They are computed in balls, far beyond the precision of doubles.
Averages are computed by Gauss quadrature with a fixed number of nodes.

References:
    M. Hochbruck, A. Ostermann, Acta Numerica 19 (2010) 209–286, doi:10.1017/S0962492910000048, section 2.1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import accumulate
from math import factorial, inf
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import sympy

from integrators.compile.printer import Assign, indented
from integrators.exact.arithmetic import renamed
from integrators.exact.entries import round_entry
from integrators.exact.polynomials import gauss_legendre
from integrators.scenes.model.system import output_formula
from integrators.scenes.particles.parts import degree
from integrators.steppers.step_model import Call, fraction
from integrators.steppers.structure import Structure
from integrators.steppers.values import Entry, Index, Product, Sum, Value, entry

if TYPE_CHECKING:
    from integrators.steppers.writer import StepWriter

FlowKey = tuple[int, tuple[int, ...], Fraction | int, int]
"""The piece, the moving blocks, the time, the number of forcing terms."""


COLUMNS = 7
"""Columns of the extrapolation tableau; more of them would amplify rounding errors."""
WORK = COLUMNS + 4
"""Work arrays besides the forcing and one value of the field."""
MOST_HALVINGS = 12
EXTRAPOLATION = "Compute the mean derivative of the flow of a piece of the field; whether it converged."


def flow_lines(call: Call, target: str, writer: StepWriter) -> list[str]:
    """Statements for (z(1) − z(0))/h, where z′(θ) = time · h F(z(θ)) + Σ_j θ^j forcing_j.

    If F is linear with constant coefficients, they are products with matrices that depend on h only. If each variable
    has an equation x' = a x + b with constant a and b, they are exponentials of numbers. Other flows are extrapolated
    numerically up to rounding, with some 20 to 60 evaluations of F.
    """
    piece, (start, *forcing) = call.node.piece, call.node.points
    structure = writer.structure
    forced = {block for point in forcing for block, form in point if form.terms}
    moving = [block for block, _ in start if block in forced or block in structure.writes(piece)]
    system = None if writer.options.control is not None else constant_system(structure, piece, moving)
    if system is not None and (flow := LinearFlow(system, call, structure)).largest <= MOST_VARIABLES:
        return _linear_lines(call, target, flow, writer)
    if len(forcing) <= 1 and is_diagonal(structure, piece, moving):
        return _diagonal_lines(call, target, moving, writer)
    return _numerical_lines(call, target, moving, writer)


def _forcing_lines(call: Call, writer: StepWriter) -> tuple[list[str], list[str]]:
    """Statements for forcing terms, and their arrays, which are consecutive in memory."""
    lines: list[str] = []
    dimension, terms = writer.structure.scene.dimension, call.node.points[1:]
    arrays = [f"forcing{j}" for j in range(len(terms))]
    if terms:
        writer.array("forcing", dimension * len(terms))
    for j, (array, point) in enumerate(zip(arrays, terms, strict=True)):
        lines.append(f"{array} = shifted(forcing, {j * dimension})")
        lines += writer.forms.point(point, array)[0]
    return lines, arrays


def _linear_lines(call: Call, target: str, flow: LinearFlow, writer: StepWriter) -> list[str]:
    """Statements for products with φ-functions."""
    module, size = writer.module, len(flow.columns)
    lines, at = writer.forms.point(call.node.points[0], "z")
    made, vectors = _forcing_lines(call, writer)
    lines += made
    key = "linear", call.node.piece, call.blocks, flow.time, flow.forcing
    if key not in writer.known:
        writer.known[key] = writer.number_array(2 * size * flow.matrices, flow.numbers)
    for block in call.blocks:
        lines += writer.forms.assignments(block, [Assign(target, "=", Sum(()))])
    if flow.constants:
        vectors.append(module.numbers(flow.constants))
    lines.append(f"elements = {writer.known[key]}")
    pattern = ", ".join([str(len(flow.rows)), *map(module.integers, (flow.rows, flow.starts, flow.columns))])
    for k, vector in enumerate([at, *vectors]):
        heads, tails = (f"shifted(elements, {(2 * k + half) * size})" for half in (0, 1))
        lines.append(f"add_products({pattern}, {heads}, {tails}, {vector}, {target})")
    return lines


def _diagonal_lines(call: Call, target: str, moving: list[int], writer: StepWriter) -> list[str]:
    """Statements for (x(1) − x(0))/h = (time · F(x) + forcing/h) φ_1(time · h a), where a is F' times ones."""
    forms, functions, dimension = writer.forms, writer.functions, writer.structure.scene.dimension
    start, piece, time = call.node.points[0], call.node.piece, round_entry(call.node.detail)
    lines, array = forms.point(start, writer.array("growing", 2 * dimension), copied=True)
    made, vectors = _forcing_lines(call, writer)
    lines += made
    for block, _ in start:
        along = float(block in moving)
        lines += forms.loop(block, lambda i, along=along: [f"{entry(array, i, dimension)} = {along}"])
    value, rate = writer.array("field"), writer.array("rates")
    lines.append(f"{functions.field(piece, call.blocks)}({array}, {value})")
    lines.append(f"{functions.derivative(piece, call.blocks)}({array}, {rate})")

    def body(i: Index) -> list[str]:
        driven = f"{time!r}*{entry(value, i)}" + "".join(f" + {entry(vector, i)}/h" for vector in vectors)
        return [f"{entry(target, i)} = ({driven})*growth(h*{time!r}*{entry(rate, i)})"]

    for block in call.blocks:
        lines += forms.loop(block, body)
    return lines


def _numerical_lines(call: Call, target: str, moving: list[int], writer: StepWriter) -> list[str]:
    """Statements for the call of an extrapolated flow."""
    structure, forms = writer.structure, writer.forms
    dimension, powers = structure.scene.dimension, len(call.node.points) - 1
    indices = [i for block in moving for a, b in structure.blocks[block] for i in range(a, b)]
    lines, start = forms.point(call.node.points[0], writer.array("flowing"), copied=True)
    made, _ = _forcing_lines(call, writer)
    work = writer.array("rows", (powers + WORK) * len(indices) + dimension)
    mean = writer.array("mean")
    key = call.node.piece, tuple(moving), call.node.detail, powers
    if key not in writer.known:
        writer.known[key] = name = f"flow{len(writer.known)}"
        body = _extrapolation_lines(key, indices, writer)
        writer.module.function(f"{name}(start, forcing, h, work, out)", EXTRAPOLATION, body)
    arguments = f"{start}, {'forcing' if powers else start}, h, {work}, {mean}"
    lines += [*made, f"if not {writer.known[key]}({arguments}):", "    break"]
    for block in call.blocks:
        lines += forms.assignments(block, [Assign(target, "=", Entry(mean))])
    return lines


def _extrapolation_lines(key: FlowKey, indices: list[int], writer: StepWriter) -> list[str]:
    """The body of a function for a flow by extrapolation of the explicit midpoint rule.

    An interval without convergence is halved. The mean derivative is computed instead of the end, whose rounding errors
    would be larger.

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.9 (the method of Gragg, Bulirsch and
        Stoer).
    """
    piece, moving, time, powers = key
    n, index = len(indices), writer.module.integers(indices)
    sizes = {"drive": powers * n, "origin": n, "means": n, "table": COLUMNS * n, "before": n, "now": n, "value": 0}
    offsets = accumulate(sizes.values(), initial=0)
    dimension = writer.structure.scene.dimension
    return [
        *(f"{name} = shifted(work, {offset})" for name, offset in zip(sizes, offsets, strict=False)),
        f"begin_flow({n}, {index}, {powers}, {dimension}, start, forcing, h, drive, origin, means)",
        "position, level = 0, 0",
        "while position < 1 << level:",
        "    width = 1.0/(1 << level)",
        f"    for column in range({COLUMNS}):",
        "        steps = 2*column + 2",
        "        for m in range(steps):",
        f"            flow_point({n}, {index}, h, m == 0, origin, means, before, now, start)",
        f"            {writer.functions.field(piece, moving)}(start, value)",
        "            θ = (position + m/steps)*width",
        f"            midpoint_step({n}, {index}, {powers}, m == 0, θ, width/steps, {round_entry(time)!r}, drive, "
        "value, before, now)",
        f"        change, size = extrapolate({n}, column, h, origin, means, now, table)",
        "        if has_converged(column, change, size):",
        "            break",
        "    if has_converged(column, change, size):",
        f"        for i in range({n}):",
        f"            means[i] += table[column*{n} + i]",
        "        position, level = next_interval(position, level)",
        f"    elif level == {MOST_HALVINGS}:",
        "        return False",
        "    else:",
        "        position, level = 2*position, level + 1",
        f"end_flow({n}, {index}, origin, means, start, out)",
        "return True",
    ]


MOST_VARIABLES = 128
"""Size of a diagonal block of a matrix; beyond, its φ-functions would take more than ten seconds."""
MOST_ROWS = 50_000


class AffineSystem(NamedTuple):
    """Exact coefficients of x' = L x + b: elements of L by (row, column), and of b by row."""

    matrix: dict[tuple[int, int], Fraction]
    constants: dict[int, Fraction]


def constant_system(structure: Structure, piece: int, blocks: Iterable[int]) -> AffineSystem | None:
    """A piece of the field in some blocks; None if it is not affine with constant coefficients."""
    system, zero = AffineSystem({}, {}), Fraction(0)
    for term, output in structure.outputs(piece, blocks):
        variables = [sympy.Symbol(f"x{k}") for k in range(len(term.arguments))]
        formula = output_formula(term, output)
        if degree(formula, variables) not in (0, 1) or term.sites.size > MOST_ROWS:
            return None
        constant = renamed(formula, dict.fromkeys(variables, sympy.Integer(0)))
        factors = [formula.diff(x) for x in variables]
        for row in term.sites.rows():
            data, i = term.data_at(row), output.place.at(row)
            if constant != 0:
                system.constants[i] = system.constants.get(i, zero) + fraction(constant.xreplace(data))
            for (plus, minus), factor in zip(term.arguments, factors, strict=True):
                value = fraction(factor.xreplace(data)) if factor != 0 else zero
                for place, x in ((plus, value), (minus, -value)):
                    if place is not None and x:
                        key = i, place.at(row)
                        system.matrix[key] = system.matrix.get(key, zero) + x
    return system


def is_diagonal(structure: Structure, piece: int, blocks: Iterable[int]) -> bool:
    """Whether x_i' = a_i x_i + b_i in some blocks, where a_i and b_i hold no variable of these blocks."""
    moving = set(blocks)
    for term, output in structure.outputs(piece, moving):
        formula, own = output_formula(term, output), []
        for k, argument in enumerate(term.arguments):
            x = sympy.Symbol(f"x{k}")
            for place in argument:
                if place is not None and formula.has(x) and structure.blocks_at(place, term.sites) & moving:
                    own.append(x)
                    if place != output.place:
                        return False
        may_repeat = term.sites.kind in ("table", "ring")
        if degree(formula, own) not in (0, 1) or (
            may_repeat and any(len({*row}) < len(row) for row in term.sites.rows())
        ):
            return False
    return True


class LinearFlow:
    """(z(1) − z(0))/h for z' = time · h (L z + b) + Σ θ^j forcing_j, as products with matrices that depend on h.

    Attributes:
        rows: The rows of the sparse matrices, which all have the same pattern.
        starts: The index of the first element of each row, and the number of elements.
        columns: The column of each element.
        time: The duration, in steps.
        forcing: The number of forcing terms.
        largest: The size of the largest diagonal block.
    """

    def __init__(self, system: AffineSystem, call: Call, structure: Structure):
        self._system, self._dimension = system, structure.scene.dimension
        self.time, self.forcing = Fraction(call.node.detail), len(call.node.points) - 1
        self.rows = [i for block in call.blocks for a, b in structure.blocks[block] for i in range(a, b)]
        components = _components(system.matrix, self.rows)
        self._components = [(component, [i for i in self.rows if i in set(component)]) for component in components]
        self.rows = [i for _, rows in self._components for i in rows]
        self.columns = [j for component, rows in self._components for _ in rows for j in component]
        self.starts = [0]
        for component, rows in self._components:
            self.starts += [self.starts[-1] + len(component) * (k + 1) for k in range(len(rows))]
        self.largest = max(map(len, components))

    @property
    def constants(self) -> list[Fraction]:
        """time · b; empty if it is zero."""
        b = self._system.constants
        return [self.time * b.get(i, Fraction(0)) for i in range(self._dimension)] if any(b.values()) else []

    @property
    def matrices(self) -> int:
        """The number of matrices: for z(0), for each forcing term, and for b."""
        return 1 + self.forcing + bool(self.constants)

    def numbers(self, h: float) -> np.ndarray:
        """The elements of each matrix: heads, then tails."""
        known: dict[Any, list[Any] | None] = {}
        parts: list[list[np.ndarray]] = [[] for _ in range(self.matrices)]
        for component, rows in self._components:
            matrix = tuple(tuple(self._system.matrix.get((i, j), Fraction(0)) for j in component) for i in component)
            if matrix not in known:
                known[matrix] = self._matrices(matrix, Fraction(h))
            chosen = [component.index(i) for i in rows]
            for part, found in zip(parts, known[matrix] or [None] * self.matrices, strict=True):
                empty = np.full((2, len(chosen) * len(component)), np.nan)
                entries = [(i, j) for i in chosen for j in range(len(component))]
                part.append(empty if found is None else doubles([found[entry] for entry in entries]))
        return np.concatenate([np.hstack(part).ravel() for part in parts])

    def _matrices(self, matrix: Sequence[Sequence[Fraction]], h: Fraction) -> list[Any] | None:
        """The matrices of a diagonal block in balls; None beyond the range of doubles."""
        import flint

        phi = phi_functions([[h * self.time * x for x in row] for row in matrix], max(1, self.forcing))
        if phi is None:
            return None
        with flint.ctx.workprec(PRECISION):
            generator = flint.arb_mat([[_ball(self.time * x) for x in row] for row in matrix])
            forced = [phi[j] * _ball(factorial(j) / h) for j in range(self.forcing)]
            return [generator * phi[0], *forced, *([phi[0]] if self.constants else [])]


def _components(pairs: Iterable[tuple[int, int]], wanted: Iterable[int]) -> list[list[int]]:
    """Connected components of the variables that contain wanted ones."""
    import networkx as nx

    graph = nx.Graph()
    graph.add_nodes_from(wanted)
    graph.add_edges_from(pairs)
    rows = set(wanted)
    found = (sorted(component) for component in nx.connected_components(graph))
    return sorted(component for component in found if not rows.isdisjoint(component))


PRECISION = 256
"""Bits of balls; up to 16 times as many where errors accumulate."""
ACCURACY = 2.0**-120
"""Error of a φ-function, relative to its largest entry."""


def _ball(x: Fraction) -> Any:
    """A real ball around a fraction."""
    import flint

    return flint.arb(flint.fmpq(x.numerator, x.denominator))


def doubles(balls: Iterable[Any]) -> np.ndarray:
    """The midpoints of balls as two rows of doubles: rounded values and their rounding errors."""
    import flint

    with flint.ctx.workprec(PRECISION):
        heads = [float(x.mid()) for x in balls]
        return np.array([heads, [float((x - head).mid()) for x, head in zip(balls, heads, strict=True)]])


def phi_functions(matrix: Sequence[Sequence[Fraction]], count: int) -> list[Any] | None:
    """φ_1(X), …, φ_count(X) as matrices of balls; None beyond the range of doubles.

    They are blocks of an exponential: the first row of exp([[X, 1, 0], [0, 0, 1], [0, 0, 0]]) is e^X, φ_1(X), φ_2(X).

    Example:
        >>> (phi,) = phi_functions([[Fraction(1)]], 1)
        >>> print(doubles([phi[0, 0]])[0])  # e − 1
        [1.71828183]

    References:
        A. H. Al-Mohy, N. J. Higham, SIAM J. Sci. Comput. 33 (2011) 488–511, doi:10.1137/100788860, theorem 2.1.
    """
    import flint

    n, bits = len(matrix), PRECISION
    while True:
        with flint.ctx.workprec(bits):
            blocks = flint.arb_mat(n * (count + 1), n * (count + 1))
            for i in range(n * count):
                blocks[i, i + n] = 1
            for i, row in enumerate(matrix):
                for j, x in enumerate(row):
                    blocks[i, j] = _ball(x)
            first = blocks.exp().tolist()[:n]
            phi = [flint.arb_mat([row[k * n : (k + 1) * n] for row in first]) for k in range(1, count + 1)]
            largest = [max(float(abs(x.mid())) for x in found.entries()) for found in phi]
            errors = [max(float(x.rad()) for x in found.entries()) for found in phi]
        if all(error <= ACCURACY * size < inf for error, size in zip(errors, largest, strict=True)):
            return phi
        if inf in largest or bits == 16 * PRECISION:
            return None
        bits *= 2


Rule = tuple[tuple[Fraction, Fraction], ...]
"""Nodes and weights."""


NODES = 10
"""Default number of nodes for fields that are no polynomials.

A singularity at a distance r from the middle of a path of length L leaves an error near ρ^(−2·NODES) with
ρ = 2r/L + √(1 + 4r²/L²), which is below rounding for steps shorter than two thirds of r.
"""
MOST_NODES = 100


def average_lines(call: Call, target: str, writer: StepWriter) -> list[str]:
    """Statements for ∫₀¹ θ^power F(Σ θ^j path_j) dθ: exact up to rounding, so that energies are preserved as well.

    The sum is F(θ_1) / (power + 1) + Σ w_i θ_i^power (F(θ_i) − F(θ_1)), so that rounding errors of weights, equal in
    all steps, multiply small differences only. Averages with other powers share the values of F.
    """
    dimension, power = writer.structure.scene.dimension, int(call.node.detail)
    rule = gauss_legendre(_count(call, writer))
    lines = _value_lines(call, rule, writer)
    weights = writer.module.numbers([weight * θ**power for θ, weight in rule])

    def total(i: Index) -> list[str]:
        return [
            "x = 0.0",
            f"for node in range(1, {len(rule)}):",
            f"    x += {weights}[node]*(values[{i} + {dimension}*node] - values[{i}])",
            f"{entry(target, i)} = x + values[{i}]" + f"/{power + 1}.0" * (power > 0),
        ]

    return [*lines, *(line for block in call.blocks for line in writer.forms.loop(block, total))]


def _value_lines(call: Call, rule: Rule, writer: StepWriter) -> list[str]:
    """Statements for the values of the field at the nodes, unless an average before has computed them."""
    forms, path = writer.forms, call.node.points
    lines: list[str] = []
    arrays: list[str] = []
    for j, point in enumerate(path):
        made, array = forms.point(point, writer.array(f"path{j}"))
        lines += made
        arrays.append(array)
    content = call.node.piece, call.blocks, path
    if not lines and writer.averaged == content:
        return []
    writer.averaged = content
    polynomial: Value = Entry(arrays[-1])
    for array in arrays[-2::-1]:
        polynomial = Sum((Entry(array), Product("x", polynomial)))
    dimension, at = writer.structure.scene.dimension, writer.array("at")
    values = writer.array("values", dimension * len(rule))
    node = [f"x = {writer.module.numbers([θ for θ, _ in rule])}[node]"]
    for block, _ in path[0]:
        node += forms.assignments(block, [Assign(at, "=", polynomial)])
    field = writer.functions.field(call.node.piece, call.blocks)
    node.append(f"{field}({at}, shifted({values}, {dimension}*node))")
    return [*lines, f"for node in range({len(rule)}):", *indented(node)]


def _count(call: Call, writer: StepWriter) -> int:
    """The number of nodes: exact for polynomials, otherwise as requested."""
    length, highest = len(call.node.points) - 1, 0
    for term, output in writer.structure.outputs(call.node.piece, call.blocks):
        found = degree(output_formula(term, output), [sympy.Symbol(f"x{k}") for k in range(len(term.arguments))])
        if found is None:
            return writer.options.average_nodes or NODES
        highest = max(highest, found)
    return (highest * length + max(length - 1, int(call.node.detail))) // 2 + 1
