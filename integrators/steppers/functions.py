"""Functions of a generated step: pieces of the field, their directional derivatives and Jacobians."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple, cast

import sympy

from integrators.compile.particle_loops import INDICES
from integrators.compile.printer import ModuleText
from integrators.compile.scene_source import field_lines, gathered
from integrators.core.immutable import cached_method
from integrators.scenes.model.system import VALUE, Argument, LocalTerm, Output, Place, output_formula
from integrators.steppers.structure import Structure, entries

Outputs = Callable[[LocalTerm], Iterable[Output]]


class Functions:
    """Functions of a step's module, each named at its first use and written at the end."""

    def __init__(self, structure: Structure, module: ModuleText):
        self.structure, self.module = structure, module
        self._names: dict[tuple[str, int, tuple[int, ...]], str] = {}

    def field(self, piece: int, blocks: Sequence[int]) -> str:
        """The name of f(y, out), a piece of the field in some blocks."""
        return self._name("f", piece, blocks)

    def derivative(self, piece: int, blocks: Sequence[int]) -> str:
        """The name of d(y, out), the derivative f'(y)v of a piece in some blocks; v follows y in memory."""
        return self._name("df", piece, blocks)

    def jacobian(self, piece: int, blocks: Sequence[int]) -> str:
        """The name of j(y, out), the Jacobian matrix of a piece in some blocks, with zeros elsewhere."""
        return self._name("jf", piece, blocks)

    def _name(self, kind: str, piece: int, blocks: Sequence[int]) -> str:
        key = kind, piece, tuple(blocks)
        return self._names.setdefault(key, f"{kind}{len(self._names)}")

    def _lines(self, kind: str, piece: int, blocks: tuple[int, ...]) -> list[str]:
        structure, dimension = self.structure, self.structure.scene.dimension
        chosen = structure.pieces[piece]

        def outputs(term: LocalTerm) -> list[Output]:
            found = chosen.outputs(term, structure.scene)
            return [x for x in found if structure.blocks_at(x.place, term.sites) <= set(blocks)]

        terms = structure.scene.numeric_terms
        if kind == "jf":
            return jacobian_lines(terms, outputs, dimension, self.module)
        indices = [i for block in blocks for first, end in structure.blocks[block] for i in range(first, end)]
        if kind == "df":
            tangent = tangent_terms(terms, outputs, dimension)
            return field_lines(tangent, lambda term: term.outputs, indices, self.module)
        return field_lines(terms, outputs, indices, self.module)

    def write(self) -> None:
        """Add all functions to the module."""
        for key, name in self._names.items():
            self.module.function(f"{name}(y, out)", "A piece of the field.", self._lines(*key))


MOST_ENTRIES = 100_000


class Diagonal(NamedTuple):
    """Entries factors[i − first] · y[i − shift], first ≤ i < end, of a field.

    Attributes:
        source: The block of y that is read.
        factors: One number for each entry, or a single number for all.
    """

    first: int
    end: int
    source: int
    shift: int
    factors: tuple[sympy.Expr, ...]


@cached_method
def diagonal(structure: Structure, piece: int, block: int) -> Diagonal | None:
    """A piece of the field in a block, if it is a diagonal matrix times another block."""
    dependence = structure.dependence(piece, block)
    ranges = structure.blocks[block]
    if not dependence.is_linear or len(dependence.blocks) != 1 or len(ranges) != 1:
        return None
    first, end = ranges[0]
    if end - first > MOST_ENTRIES:
        return None
    found: dict[int, tuple[int, sympy.Expr]] = {}
    for term, output in structure.outputs(piece, (block,)):
        for index, source, factor in _entries(term, output):
            if index in found or factor is None:
                return None
            found[index] = source, factor
    shifts = {index - source for index, (source, _) in found.items()}
    if sorted(found) != list(range(first, end)) or len(shifts) != 1:
        return None
    factors = tuple(found[index][1] for index in range(first, end))
    (source,), (shift,) = dependence.blocks, shifts
    return Diagonal(first, end, source, shift, factors[:1] if len(set(factors)) == 1 else factors)


def _entries(term: LocalTerm, output: Output) -> list[tuple[int, int, sympy.Expr | None]]:
    """Triples (entry written, entry read, factor) of a term; the factor is None if it reads several entries."""
    formula = output_formula(term, output)
    used = [k for k in range(len(term.arguments)) if formula.has(sympy.Symbol(f"x{k}"))]
    if len(used) != 1 or term.arguments[used[0]].minus is not None or term.sites.roles > 1:
        return [(-1, -1, None)]
    factor = formula.diff(sympy.Symbol(f"x{used[0]}"))
    source = entries(term.arguments[used[0]].plus, term.sites)
    factors = [cast("sympy.Expr", factor.xreplace(term.data_at(row))) for row in term.sites.rows()]
    return list(zip(entries(output.place, term.sites), source, factors, strict=True))


def tangent_terms(terms: Iterable[LocalTerm], outputs: Outputs, dimension: int) -> Iterator[LocalTerm]:
    """The terms of f′(y)v, Σ ∂φ/∂x_k v_k for each output φ of a term, where v follows y in memory."""
    for term in terms:
        count = len(term.arguments)
        arguments = (*term.arguments, *(_moved(argument, dimension) for argument in term.arguments))
        for output in outputs(term):
            partial = _partial_derivatives(
                term, output._replace(sign=1)
            )  # equal up to sign for both particles of a pair
            formula = sympy.Add(*(formula * sympy.Symbol(f"x{count + k}") for k, formula in partial))
            made = (output._replace(derivative=VALUE),)
            yield LocalTerm(formula, arguments, term.data, made, term.sites, term.part)


def _moved(argument: Argument, by: int) -> Argument:
    """The same argument of a state with an offset in memory."""
    plus, minus = (x and x._replace(offset=x.offset + by) for x in argument)
    assert plus is not None
    return Argument(plus, minus)


def _partial_derivatives(term: LocalTerm, output: Output) -> Iterator[tuple[int, sympy.Expr]]:
    """Nonzero derivatives by local variables."""
    formula = output_formula(term, output)
    for k in range(len(term.arguments)):
        derivative = formula.diff(sympy.Symbol(f"x{k}"))
        if derivative != 0:
            yield k, derivative


def jacobian_lines(terms: Iterable[LocalTerm], outputs: Outputs, dimension: int, module: ModuleText) -> list[str]:
    """Statements for the dense Jacobian matrix of a piece of the field, by rows."""

    def entries(term: LocalTerm) -> Iterator[tuple[tuple[Place, Place], sympy.Expr]]:
        for output in outputs(term):
            for k, formula in _partial_derivatives(term, output):
                plus, minus = term.arguments[k]
                yield (output.place, plus), formula
                if minus is not None:
                    yield (output.place, minus), -formula

    lines = [f"for i in range({dimension**2}):", "    out[i] = 0.0"]
    for total in gathered(terms, entries):
        targets = {
            (row, column): f"out[{_position(row, column, dimension)}] +=" for row, column in sorted(total.outputs)
        }
        lines += total.lines(targets, module)
    return lines


def _position(row: Place, column: Place, dimension: int) -> str:
    """The index of a matrix element, from the places of its row and column in the state."""
    strides: dict[int, int] = {}
    for place, factor in ((row, dimension), (column, 1)):
        strides[place.role] = strides.get(place.role, 0) + place.stride * factor
    offset = row.offset * dimension + column.offset
    return " + ".join(
        [str(offset), *(f"{stride}*{INDICES[role]}" for role, stride in sorted(strides.items()) if stride)]
    )
