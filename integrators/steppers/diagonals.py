"""Pieces of the field that only scale: q' = M⁻¹ p with a diagonal M, written as part of the sums that need it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ..number_text import literal
from ..operation_graph import simplest
from ..remembering import remembered
from ..scenes.local_terms import LocalTerm, Output, output_formula
from .forms import grouped
from .structure import entries

if TYPE_CHECKING:
    import sympy

    from .source import StepperSource
    from .structure import Structure

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

    def scaled(self, text: str, writer: StepperSource) -> str:
        """The entry i, if the text is that of y[i]."""
        moved = text.replace("[i]", f"[i - {self.shift}]" if self.shift > 0 else f"[i + {-self.shift}]")
        if self.factors == (1,):
            return moved
        if len(self.factors) == 1:
            return f"{literal(simplest(self.factors[0]))}*{grouped(moved)}"
        return f"{writer.constants(self.factors)}[i - {self.first}]*{grouped(moved)}"


@remembered
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
