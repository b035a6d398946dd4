"""The functions that a generated stepper calls: pieces of the field and their derivatives, written for pointers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..codegen import ModuleText, field_lines
from .derivatives import jacobian_lines, tangent_terms
from .structure import Structure

if TYPE_CHECKING:
    from ..scenes.local_terms import LocalTerm, Output


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
