"""Structure of a scene for a method: blocks of variables and their dependences.

A block is a set of variables of one declared block of the scene in which the same pieces of the field have entries.
Steps are planned block by block, so that a change of velocities does not cause an evaluation of the force.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import groupby
from typing import NamedTuple, TypeAlias

import sympy

from integrators.core.immutable import cached_method
from integrators.scenes.model.system import LocalTerm, Output, Place, System, output_formula
from integrators.scenes.model.terms import Sites
from integrators.scenes.particles.parts import Piece, degree

Range: TypeAlias = tuple[int, int]


class Dependence(NamedTuple):
    """Arguments of a piece of the field in one block.

    Attributes:
        blocks: The blocks that it depends on.
        is_linear: Whether it is a linear function of these, without a constant.
    """

    blocks: frozenset[int]
    is_linear: bool


class Structure:
    """Blocks of variables of a scene, and dependences between them."""

    def __init__(self, scene: System, pieces: Sequence[Piece]):
        self.scene, self.pieces = scene, tuple(pieces)

    @cached_property
    def blocks(self) -> tuple[tuple[Range, ...], ...]:
        """The blocks as ranges of indices."""
        number = self.block_of
        found: dict[int, list[int]] = {}
        for index in range(self.scene.dimension):
            found.setdefault(number[index], []).append(index)
        return tuple(tuple(_ranges(found[block])) for block in sorted(found))

    @cached_property
    def block_of(self) -> list[int]:
        """The block of each variable."""
        dimension = self.scene.dimension
        writers: list[set[int]] = [set() for _ in range(dimension)]
        for k, piece in enumerate(self.pieces):
            for term in self.scene.numeric_terms:
                for output in piece.outputs(term, self.scene):
                    for index in entries(output.place, term.sites):
                        writers[index].add(k)
        # Repeated, because merging the blocks at one place may split those at another.
        while partly := list(self._partly_written(writers)):
            for place, sites in partly:
                common = set().union(*(writers[index] for index in entries(place, sites)))
                for index in entries(place, sites):
                    writers[index] |= common
        known: dict[tuple[str, frozenset[int]], int] = {}
        return [
            known.setdefault((declared.name, frozenset(writers[index])), len(known))
            for declared in self.scene.blocks
            for index in range(declared.offset, declared.end)
        ]

    def _partly_written(self, writers: Sequence[set[int]]) -> Iterable[tuple[Place, Sites]]:
        """Places of terms over particles whose entries are written by different sets of pieces."""
        for term in self.scene.numeric_terms:
            for output in term.outputs:
                if len({frozenset(writers[index]) for index in entries(output.place, term.sites)}) > 1:
                    yield output.place, term.sites

    def blocks_at(self, place: Place, sites: Sites) -> frozenset[int]:
        """The blocks of the entries at a place of a term."""
        return frozenset(self.block_of[index] for index in entries(place, sites))

    def outputs(self, piece: int, blocks: Iterable[int]) -> Iterator[tuple[LocalTerm, Output]]:
        """Terms and outputs of a piece of the field in some blocks."""
        wanted = set(blocks)
        for term in self.scene.numeric_terms:
            for output in self.pieces[piece].outputs(term, self.scene):
                if self.blocks_at(output.place, term.sites) <= wanted:
                    yield term, output

    @cached_method
    def writes(self, piece: int) -> tuple[int, ...]:
        """The blocks in which a piece of the field has entries."""
        outputs = self.outputs(piece, range(len(self.blocks)))
        return tuple(sorted({block for term, x in outputs for block in self.blocks_at(x.place, term.sites)}))

    @cached_method
    def dependence(self, piece: int, block: int) -> Dependence:
        """Arguments of a piece of the field in one block."""
        blocks: set[int] = set()
        is_linear = True
        for term, output in self.outputs(piece, (block,)):
            formula = output_formula(term, output)
            free = formula.free_symbols
            used = [k for k in range(len(term.arguments)) if sympy.Symbol(f"x{k}") in free]
            blocks |= self._read(term, used)
            variables = [sympy.Symbol(f"x{k}") for k in used]
            zero = dict.fromkeys(variables, sympy.Integer(0))
            is_linear &= degree(formula, variables) == 1 and formula.xreplace(zero) == 0
        return Dependence(frozenset(blocks), is_linear)

    def reach(self, piece: int, block: int) -> frozenset[int]:
        """The blocks on which the flow of a piece of the field in a block depends, that block included."""
        found, waiting = {block}, [block]
        while waiting:
            new = self.dependence(piece, waiting.pop()).blocks - found
            found |= new
            waiting += new
        return frozenset(found)

    def _read(self, term: LocalTerm, arguments: Iterable[int]) -> frozenset[int]:
        places = (place for k in arguments for place in term.arguments[k] if place is not None)
        return frozenset[int]().union(*(self.blocks_at(place, term.sites) for place in places))


def entries(place: Place, sites: Sites) -> Sequence[int]:
    """Indices of the state at a place, over all rows of sites."""
    if place.stride == 0:
        return (place.offset,)
    if sites.kind == "table":
        particles = sorted({row[place.role] for row in sites.table})
    elif sites.kind in ("pairs", "chain"):
        particles = range(place.role, sites.count - 1 + place.role)
    else:
        particles = range(sites.count)
    return [place.offset + place.stride * particle for particle in particles]


def _ranges(indices: Sequence[int]) -> Iterable[Range]:
    """Ranges of ascending indices."""
    for _, run in groupby(enumerate(indices), key=lambda pair: pair[1] - pair[0]):
        members = [index for _, index in run]
        yield members[0], members[-1] + 1
