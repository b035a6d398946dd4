"""Averages of the field along polynomial paths, by Gauss quadrature with a fixed number of nodes."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import sympy

from integrators.compile.printer import indented
from integrators.exact.polynomials import gauss_legendre
from integrators.scenes.model.system import output_formula
from integrators.scenes.particles.parts import degree
from integrators.steppers.step_model import Call

if TYPE_CHECKING:
    from integrators.steppers.writer import StepWriter

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
    total = [
        "x = 0.0",
        f"for node in range(1, {len(rule)}):",
        f"    x += {weights}[node]*(values[i + {dimension}*node] - values[i])",
        f"{target}[i] = x + values[i]" + f"/{power + 1}.0" * (power > 0),
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
    polynomial = f"{arrays[-1]}[i]"
    for k, array in enumerate(arrays[-2::-1]):
        polynomial = f"{array}[i] + x*" + (f"({polynomial})" if k else polynomial)
    dimension, at = writer.structure.scene.dimension, writer.array("at")
    values = writer.array("values", dimension * len(rule))
    node = [f"x = {writer.module.numbers([θ for θ, _ in rule])}[node]"]
    for block, _ in path[0]:
        node += forms.loop(block, [f"{at}[i] = {polynomial}"])
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
