"""Derivatives of pieces of the field: along a vector, and as matrices."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

from ..codegen import gathered
from ..scenes.local_terms import VALUE, Argument, LocalTerm, Output, Place, output_formula
from ..site_loops import INDICES

if TYPE_CHECKING:
    import sympy

    from ..codegen import ModuleText
    from .plan import Call
    from .source import StepperSource

    Outputs = Callable[[LocalTerm], Iterable[Output]]


def derivative_lines(call: Call, target: str, writer: StepperSource) -> list[str]:
    """Statements for the derivative at a point along a vector, which lie one behind the other in one array."""
    at, along = call.node.points
    dimension = writer.structure.scene.dimension
    tangent = writer.array("tangent", 2 * dimension)
    name = writer.functions.derivative(call.node.piece, call.cells)
    return [
        *writer.forms.point(at, tangent, copied=True)[0],
        f"along = shifted({tangent}, {dimension})",
        *writer.forms.point(along, "along", copied=True)[0],
        f"{name}({tangent}, {target})",
    ]


def tangent_terms(terms: Iterable[LocalTerm], outputs: Outputs, dimension: int) -> Iterator[LocalTerm]:
    """The terms of (y, v) ↦ f′(y)v, where v comes behind y: Σ ∂φ/∂x_k v_k for each output φ of a term.

    Args:
        terms: The terms of the field.
        outputs: Which outputs of a term belong to the piece.
        dimension: The dimension of y, and of v.
    """
    import sympy

    for term in terms:
        count = len(term.arguments)
        arguments = (*term.arguments, *(_moved(argument, dimension) for argument in term.arguments))
        for output in outputs(term):
            partial = _partial_derivatives(term, output)
            formula = sympy.Add(*(formula * sympy.Symbol(f"x{count + k}") for k, formula in partial))
            yield LocalTerm(formula, arguments, term.data, (Output(VALUE, output.place, 1),), term.sites, term.part)


def _moved(argument: Argument, by: int) -> Argument:
    """The argument for a state that lies further behind."""
    plus, minus = (x and x._replace(offset=x.offset + by) for x in argument)
    assert plus is not None
    return Argument(plus, minus)


def _partial_derivatives(term: LocalTerm, output: Output) -> Iterator[tuple[int, sympy.Expr]]:
    """The derivatives by local variables that are not zero."""
    import sympy

    formula = output_formula(term, output)
    for k in range(len(term.arguments)):
        derivative = formula.diff(sympy.Symbol(f"x{k}"))
        if derivative != 0:
            yield k, derivative


def jacobian_lines(terms: Iterable[LocalTerm], outputs: Outputs, dimension: int, module: ModuleText) -> list[str]:
    """Statements for the Jacobian matrix of a piece of the field, a full one by rows.

    Args:
        terms: The terms of the field.
        outputs: Which outputs of a term belong to the piece.
        dimension: The number of rows and columns.
        module: The module that the lines are for.
    """

    def entries(term: LocalTerm) -> Iterator[tuple[tuple[Place, Place], sympy.Expr]]:
        for output in outputs(term):
            for k, formula in _partial_derivatives(term, output):
                plus, minus = term.arguments[k]
                yield (output.place, plus), formula
                if minus is not None:
                    yield (output.place, minus), -formula

    lines = [f"for i in range({dimension**2}):", f"    out[i] = {module.zero}"]
    for total in gathered(terms, entries):
        targets = {
            (row, column): f"out[{_position(row, column, dimension)}] +=" for row, column in sorted(total.outputs)
        }
        lines += total.lines(targets, module)
    return lines


def _position(row: Place, column: Place, dimension: int) -> str:
    """The index of a matrix element whose row and column are places in the state."""
    strides: dict[int, int] = {}
    for place, factor in ((row, dimension), (column, 1)):
        strides[place.role] = strides.get(place.role, 0) + place.stride * factor
    offset = row.offset * dimension + column.offset
    return " + ".join(
        [str(offset), *(f"{stride}*{INDICES[role]}" for role, stride in sorted(strides.items()) if stride)]
    )
