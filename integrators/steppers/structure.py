"""Structure of a scene for a method: blocks of variables, their dependences, and pieces of the field as functions.

A block is a set of variables of one declared block of the scene in which the same pieces of the field have entries.
Steps are planned block by block, so that a change of velocities does not cause an evaluation of the force.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import groupby
from typing import NamedTuple, TypeAlias, cast

import sympy

from integrators.compile.printer import Assign, ModuleText
from integrators.compile.scene_source import INDICES, field_lines, gathered
from integrators.core.immutable import cached_method
from integrators.scenes.model.system import VALUE, Argument, LocalTerm, Output, Place, System, output_formula
from integrators.scenes.model.terms import Sites
from integrators.scenes.particles.parts import Piece, degree

Range: TypeAlias = tuple[int, int]


class Dependence(NamedTuple):
    """The blocks on which a piece of the field in one block depends, and whether linearly, without a constant."""

    blocks: frozenset[int]
    is_linear: bool


class Structure:
    """Blocks of variables of a scene, and dependences between them."""

    def __init__(self, scene: System, pieces: Sequence[Piece]):
        self.scene, self.pieces = scene, tuple(pieces)

    @cached_property
    def blocks(self) -> tuple[tuple[Range, ...], ...]:
        """The blocks as ranges of indices."""
        found: dict[int, list[Range]] = {}
        for block, run in groupby(range(self.scene.dimension), key=self.block_of.__getitem__):
            first, *others = run
            found.setdefault(block, []).append((first, first + len(others) + 1))
        return tuple(tuple(found[block]) for block in sorted(found))

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
        places = {(output.place, term.sites) for term in self.scene.numeric_terms for output in term.outputs}
        parts = [entries(place, sites) for place, sites in places]
        # Repeated, because merging the blocks at one place may split those at another.
        while partly := [part for part in parts if len({frozenset(writers[index]) for index in part}) > 1]:
            for part in partly:
                common = set().union(*(writers[index] for index in part))
                for index in part:
                    writers[index] |= common
        known: dict[tuple[str, frozenset[int]], int] = {}
        return [
            known.setdefault((declared.name, frozenset(writers[index])), len(known))
            for declared in self.scene.blocks
            for index in range(declared.offset, declared.end)
        ]

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
            places = (place for k in used for place in term.arguments[k] if place is not None)
            blocks.update(*(self.blocks_at(place, term.sites) for place in places))
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


Outputs = Callable[[LocalTerm], Iterable[Output]]


class Functions:
    """Functions of a step's module, each named at its first use and written at the end."""

    def __init__(self, structure: Structure, module: ModuleText):
        self.structure, self.module = structure, module
        self._names: dict[tuple[str, int, tuple[int, ...]], str] = {}

    def field(self, piece: int, blocks: Sequence[int], kind: str = "f") -> str:
        """The name of f(y, out), a piece of the field in some blocks."""
        return self._names.setdefault((kind, piece, tuple(blocks)), f"{kind}{len(self._names)}")

    def derivative(self, piece: int, blocks: Sequence[int]) -> str:
        """The name of df(y, out), the derivative f'(y)v of a piece in some blocks; v follows y in memory."""
        return self.field(piece, blocks, "df")

    def jacobian(self, piece: int, blocks: Sequence[int]) -> str:
        """The name of jf(y, out), the Jacobian matrix of a piece in some blocks, with zeros elsewhere."""
        return self.field(piece, blocks, "jf")

    def update(self, piece: int, blocks: Sequence[int]) -> str:
        """The name of uf(y, out, a, b), which puts a · out + b · (a piece of the field in some blocks) in out."""
        return self.field(piece, blocks, "uf")

    def reads_first(self, piece: int, blocks: Sequence[int]) -> bool:
        """Whether a piece of the field in some blocks is computed from values read before any is written."""
        lines = self._lines("f", piece, tuple(blocks))
        writes = next((k for k, line in enumerate(lines) if line.startswith("out[")), 0)
        return not any("y[" in line for line in lines[writes:]) and not any(" in range(" in line for line in lines)

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
        lines = field_lines(terms, outputs, indices, self.module)
        return list(map(_updating, lines)) if kind == "uf" else lines

    def write(self) -> None:
        """Add all functions to the module."""
        for key, name in self._names.items():
            arguments = "y, out, a, b" if key[0] == "uf" else "y, out"
            self.module.function(f"{name}({arguments})", "A piece of the field.", self._lines(*key))


def _updating(line: str) -> str:
    """A statement for an entry of a field, changed so that a · out + b · field is computed."""
    found = re.fullmatch(r"( *)(out\[.*?\]) ([+-]?=) (.*)", line)
    if found is None:
        return line
    space, target, op, value = found.groups()
    if value == "0.0":
        return f"{space}{target} = a*{target}"
    return f"{space}{target} = a*{target} + b*({value})" if op == "=" else f"{space}{target} {op} b*({value})"


MOST_ENTRIES = 100_000


class Diagonal(NamedTuple):
    """Entries factors[i − first] · y[i − shift], first ≤ i < end, of a field that reads block `source` of y.

    There is one factor for each entry, or a single one for all.
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
        moved = ([x and x._replace(offset=x.offset + dimension) for x in argument] for argument in term.arguments)
        arguments = (*term.arguments, *(Argument(cast("Place", plus), minus) for plus, minus in moved))
        for output in outputs(term):
            partial = _partial_derivatives(term, output._replace(sign=1))  # equal up to sign for both of a pair
            formula = sympy.Add(*(formula * sympy.Symbol(f"x{count + k}") for k, formula in partial))
            made = (output._replace(derivative=VALUE),)
            yield LocalTerm(formula, arguments, term.data, made, term.sites, term.part)


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
        statements: dict[tuple[Place, Place], Assign[sympy.Expr]] = {}
        for row, column in sorted(total.outputs):
            strides = Counter({row.role: row.stride * dimension}) + Counter({column.role: column.stride})
            indices = (f"{stride}*{INDICES[role]}" for role, stride in sorted(strides.items()))
            index = " + ".join([str(row.offset * dimension + column.offset), *indices])
            statements[row, column] = Assign(f"out[{index}]", "+=", total.outputs[row, column])
        lines += total.lines(statements, module)
    return lines
