"""The functions that a generated stepper calls: pieces of the field and their derivatives, written for pointers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from integrators.compile.particle_loops import INDICES
from integrators.compile.scene_source import ModuleText, field_lines, gathered
from integrators.core.immutable import cached_method
from integrators.scenes.model.local_terms import VALUE, Argument, LocalTerm, Output, Place, output_formula
from integrators.steppers.structure import Structure, entries

if TYPE_CHECKING:
    import sympy

    from integrators.compile.scene_source import ModuleText
    from integrators.scenes.model.local_terms import LocalTerm, Output
    from integrators.steppers.structure import Structure

    Outputs = Callable[[LocalTerm], Iterable[Output]]


class Functions:
    """The functions of a stepper's module, each made when it is first asked for.

    Args:
        structure: What the pieces of the field are like.
        module: The module that they go to.
    """

    def __init__(self, structure: Structure, module: ModuleText):
        self.structure, self.module = structure, module
        self._names: dict[tuple[str, int, tuple[int, ...]], str] = {}

    def field(self, piece: int, cells: Sequence[int]) -> str:
        """The name of the function f(y, out) that puts a piece of the field in some cells."""
        return self._name("f", piece, cells)

    def derivative(self, piece: int, cells: Sequence[int]) -> str:
        """The name of the function d(y, out) that puts the derivative f'(y)v of a piece in some cells; v follows y."""
        return self._name("df", piece, cells)

    def jacobian(self, piece: int, cells: Sequence[int]) -> str:
        """The name of the function j(y, out) for the Jacobian matrix of a piece in some cells, among zeros."""
        return self._name("jf", piece, cells)

    def _name(self, kind: str, piece: int, cells: Sequence[int]) -> str:
        key = kind, piece, tuple(cells)
        return self._names.setdefault(key, f"{kind}{len(self._names)}")

    def _lines(self, kind: str, piece: int, cells: tuple[int, ...]) -> list[str]:
        structure, dimension = self.structure, self.structure.scene.dimension
        chosen = structure.pieces[piece]

        def outputs(term: LocalTerm) -> list[Output]:
            found = chosen.outputs(term, structure.scene)
            return [x for x in found if structure.cells_at(x.place, term.sites) <= set(cells)]

        terms = structure.scene.numeric_terms
        if kind == "jf":
            return jacobian_lines(terms, outputs, dimension, self.module)
        indices = [i for cell in cells for first, end in structure.cells[cell] for i in range(first, end)]
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
    """Entries first ≤ i < end of a field that are factors[i − first] · y[i − shift].

    Attributes:
        source: The cell of y that is read.
        factors: One number for each entry, or a single one for all.
    """

    first: int
    end: int
    source: int
    shift: int
    factors: tuple[sympy.Expr, ...]


@cached_method
def diagonal(structure: Structure, piece: int, cell: int) -> Diagonal | None:
    """What a piece of the field puts into a cell, if that is a diagonal matrix times another cell.

    Args:
        structure: What the pieces are like.
        piece: The piece.
        cell: The cell.
    """
    flow = structure.flow(piece, cell)
    ranges = structure.cells[cell]
    if not flow.is_linear or len(flow.cells) != 1 or len(ranges) != 1 or ranges[0][1] - ranges[0][0] > MOST_ENTRIES:
        return None
    found: dict[int, tuple[int, sympy.Expr]] = {}
    for term, output in structure.outputs(piece, (cell,)):
        for index, source, factor in _entries(term, output):
            if index in found or factor is None:
                return None
            found[index] = source, factor
    first, end = ranges[0]
    shifts = {index - source for index, (source, _) in found.items()}
    if sorted(found) != list(range(first, end)) or len(shifts) != 1:
        return None
    factors = tuple(found[index][1] for index in range(first, end))
    (source,), (shift,) = flow.cells, shifts
    return Diagonal(first, end, source, shift, factors[:1] if len(set(factors)) == 1 else factors)


def _entries(term: LocalTerm, output: Output) -> list[tuple[int, int, sympy.Expr | None]]:
    """Entries that a term writes, each with the entry that it reads and its factor; None: it reads several."""
    import sympy

    formula = output_formula(term, output)
    used = [k for k in range(len(term.arguments)) if formula.has(sympy.Symbol(f"x{k}"))]
    if len(used) != 1 or term.arguments[used[0]].minus is not None or term.sites.roles > 1:
        return [(-1, -1, None)]
    slope = formula.diff(sympy.Symbol(f"x{used[0]}"))
    source = entries(term.arguments[used[0]].plus, term.sites)
    factors = [
        slope.xreplace({sympy.Symbol(f"d{k}"): data.values[row[data.role]] for k, data in enumerate(term.data)})
        for row in term.sites.rows()
    ]
    return list(zip(entries(output.place, term.sites), source, factors, strict=True))


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
