"""How a scene's field looks to a method: cells of the state, and what each piece of the field does to them.

A cell is a set of variables that a method never tells apart. Steps are planned cell by cell, so that a force is not
computed again because a velocity has changed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from integrators.core.immutable import cached_method
from integrators.scenes.model.local_terms import output_formula
from integrators.scenes.particles.degrees import Piece, degree
from integrators.scenes.particles.parts import check_kind, pieces_of

if TYPE_CHECKING:
    from integrators.methods.program.program import Method
    from integrators.scenes.model.local_terms import LocalTerm, Output, Place
    from integrators.scenes.model.system import System
    from integrators.scenes.model.terms import Sites
    from integrators.scenes.scene import Scene

Range: TypeAlias = tuple[int, int]


class Flow(NamedTuple):
    """What a piece of the field puts into a cell.

    Attributes:
        cells: The cells that it depends on.
        is_linear: Whether it is a linear function (without a constant) of these.
    """

    cells: frozenset[int]
    is_linear: bool


class Structure:
    """The cells of a scene for a method whose parts are these pieces of the field.

    Attributes:
        scene: The scene.
        pieces: The piece of the field for each part of the method.
    """

    def __init__(self, scene: System, pieces: Sequence[Piece]):
        self.scene, self.pieces = scene, tuple(pieces)

    @cached_property
    def cells(self) -> tuple[tuple[Range, ...], ...]:
        """The cells, as ranges of indices; each lies in one block and has the same pieces writing all of it."""
        number = self._cell_of
        found: dict[int, list[int]] = {}
        for index in range(self.scene.dimension):
            found.setdefault(number[index], []).append(index)
        return tuple(tuple(_ranges(found[cell])) for cell in sorted(found))

    @cached_property
    def _cell_of(self) -> list[int]:
        """The cell of each variable."""
        dimension = self.scene.dimension
        writers: list[set[int]] = [set() for _ in range(dimension)]
        for k, piece in enumerate(self.pieces):
            for term in self.scene.numeric_terms:
                for output in piece.outputs(term, self.scene):
                    for index in entries(output.place, term.sites):
                        writers[index].add(k)
        while partly := list(self._partly_written(writers)):  # what one place unites may part another
            for place, sites in partly:
                common = set().union(*(writers[index] for index in entries(place, sites)))
                for index in entries(place, sites):
                    writers[index] |= common
        known: dict[tuple[str, frozenset[int]], int] = {}
        return [
            known.setdefault((block.name, frozenset(writers[index])), len(known))
            for block in self.scene.blocks
            for index in range(block.offset, block.end)
        ]

    def _partly_written(self, writers: Sequence[set[int]]) -> Iterable[tuple[Place, Sites]]:
        """Places of terms over sites of which some entries are written by other pieces, too."""
        for term in self.scene.numeric_terms:
            for output in term.outputs:
                if len({frozenset(writers[index]) for index in entries(output.place, term.sites)}) > 1:
                    yield output.place, term.sites

    def cell_of(self, index: int) -> int:
        """The cell that a variable is in."""
        return self._cell_of[index]

    def cells_at(self, place: Place, sites: Sites) -> frozenset[int]:
        """The cells in which a term has entries at a place."""
        return frozenset(self._cell_of[index] for index in entries(place, sites))

    def outputs(self, piece: int, cells: Iterable[int]) -> Iterator[tuple[LocalTerm, Output]]:
        """What a piece of the field adds to some cells."""
        wanted = set(cells)
        for term in self.scene.numeric_terms:
            for output in self.pieces[piece].outputs(term, self.scene):
                if self.cells_at(output.place, term.sites) <= wanted:
                    yield term, output

    @cached_method
    def writes(self, piece: int) -> tuple[int, ...]:
        """The cells that a piece of the field has entries in."""
        return tuple(sorted({cell for cell, *_ in self._writings(piece)}))

    @cached_method
    def _writings(self, piece: int) -> tuple[tuple[int, LocalTerm, Output], ...]:
        return tuple(
            (cell, term, output)
            for term in self.scene.numeric_terms
            for output in self.pieces[piece].outputs(term, self.scene)
            for cell in self.cells_at(output.place, term.sites)
        )

    @cached_method
    def flow(self, piece: int, cell: int) -> Flow:
        """What a piece of the field puts into a cell."""
        import sympy

        cells: set[int] = set()
        is_linear = True
        for term, output in self.outputs(piece, (cell,)):
            formula = output_formula(term, output)
            used = [k for k in range(len(term.arguments)) if formula.has(sympy.Symbol(f"x{k}"))]
            cells |= self._read(term, used)
            variables = [sympy.Symbol(f"x{k}") for k in used]
            zero = dict.fromkeys(variables, sympy.Integer(0))
            is_linear &= degree(formula, variables) == 1 and formula.xreplace(zero) == 0
        return Flow(frozenset(cells), is_linear)

    def reach(self, piece: int, cell: int) -> frozenset[int]:
        """The cells whose values decide what the flow of a piece of the field does to a cell, this one among them."""
        found, waiting = {cell}, [cell]
        while waiting:
            new = self.flow(piece, waiting.pop()).cells - found
            found |= new
            waiting += new
        return frozenset(found)

    def _read(self, term: LocalTerm, arguments: Iterable[int]) -> frozenset[int]:
        places = (place for k in arguments for place in term.arguments[k] if place is not None)
        return frozenset[int]().union(*(self.cells_at(place, term.sites) for place in places))


def entries(place: Place, sites: Sites) -> Sequence[int]:
    """The indices of the state that a place stands for, over all rows of sites."""
    if place.stride == 0:
        return (place.offset,)
    return [place.offset + place.stride * site for site in sites_of_role(sites, place.role)]


def sites_of_role(sites: Sites, role: int) -> Sequence[int]:
    """The sites that rows have in one role."""
    if sites.kind == "table":
        return sorted({row[role] for row in sites.table})
    first = role if sites.kind in ("pairs", "chain") else 0
    last = sites.count - (1 - role) if sites.kind in ("pairs", "chain") else sites.count
    return range(first, last)


def _ranges(indices: Sequence[int]) -> Iterable[Range]:
    """Ascending indices as ranges."""
    for _, run in groupby(enumerate(indices), key=lambda pair: pair[1] - pair[0]):
        members = [index for _, index in run]
        yield members[0], members[-1] + 1


def method_pieces(method: Method, scene: Scene, parts: Any) -> list[Piece]:
    """The pieces of the field for the parts of a method; an auxiliary matrix is the Jacobian of the whole field."""
    auxiliary = method.program.auxiliary
    names = [name for name in method.names if name not in auxiliary]
    own = dict(zip(names, pieces_of(names, scene, parts), strict=True))
    pieces = [own.get(name, Piece()) for name in method.names]
    if not auxiliary:  # a matrix that is no part of the field has no series of its own
        check_kind(method.name, method.program.max_children, pieces, scene)
    return pieces if len(pieces) == 1 else [*pieces, Piece()]
