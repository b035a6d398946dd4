"""Flows of linear pieces with constant coefficients: sparse products with φ-functions of h times a matrix."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from math import factorial
from typing import TYPE_CHECKING, Any, NamedTuple

from ..scenes.degrees import degree
from ..scenes.local_terms import output_formula
from .nodes import fraction
from .phi_functions import doubles, fixed_point, phi_functions, product

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from ..scenes.local_terms import LocalTerm, Output
    from .plan import Call
    from .structure import Structure

MOST_VARIABLES = 128
"""Of a matrix without blocks; beyond, its φ-functions would take minutes."""
MOST_ROWS = 50_000


class AffineSystem(NamedTuple):
    """x' = L x + b, exactly: elements by row and column, and by row."""

    matrix: dict[tuple[int, int], Fraction]
    constants: dict[int, Fraction]


def constant_system(structure: Structure, piece: int, cells: Iterable[int]) -> AffineSystem | None:
    """What a piece of the field does in some cells; None if it is not linear with constant coefficients."""
    import sympy

    system = AffineSystem({}, {})
    for term, output in structure.outputs(piece, cells):
        variables = [sympy.Symbol(f"x{k}") for k in range(len(term.arguments))]
        formula = output_formula(term, output)
        if degree(formula, variables) not in (0, 1) or term.sites.size > MOST_ROWS:
            return None
        constant: Any = formula.xreplace(dict.fromkeys(variables, sympy.Integer(0)))
        _add(system, term, output, [formula.diff(x) for x in variables], constant)
    return system


def _add(
    system: AffineSystem, term: LocalTerm, output: Output, factors: Sequence[sympy.Expr], constant: sympy.Expr
) -> None:
    """Add a term at all rows of its sites."""
    import sympy

    zero = Fraction(0)
    for row in term.sites.rows():
        data: dict[Any, Any] = {sympy.Symbol(f"d{k}"): d.values[row[d.role]] for k, d in enumerate(term.data)}
        i = output.place.at(row)
        if constant != 0:
            system.constants[i] = system.constants.get(i, zero) + fraction(constant.xreplace(data))
        for (plus, minus), factor in zip(term.arguments, factors, strict=True):
            value = fraction(factor.xreplace(data)) if factor != 0 else zero
            for place, x in ((plus, value), (minus, -value)):
                if place is not None and x:
                    key = i, place.at(row)
                    system.matrix[key] = system.matrix.get(key, zero) + x


def is_diagonal(structure: Structure, piece: int, cells: Iterable[int]) -> bool:
    """Whether in x_i' = a_i x_i + b_i, for all variables of some cells, a_i and b_i hold no variable of these cells."""
    import sympy

    moving = set(cells)
    for term, output in structure.outputs(piece, moving):
        formula, own = output_formula(term, output), []
        for k, argument in enumerate(term.arguments):
            x = sympy.Symbol(f"x{k}")
            for place in argument:
                if place is not None and formula.has(x) and structure.cells_at(place, term.sites) & moving:
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

    Args:
        system: L and b.
        call: What is wanted.
        structure: The cells.

    Attributes:
        rows: The entries that are wanted.
        starts: Where the elements of each row begin, and where those of the last one end.
        columns: The column of each element; all matrices have elements at the same places.
        time: The duration, in steps.
        forcing: The number of forcing terms.
        largest: The size of the largest block.
    """

    def __init__(self, system: AffineSystem, call: Call, structure: Structure):
        self._system, self._dimension = system, structure.scene.dimension
        self.time, self.forcing = Fraction(call.node.detail), len(call.node.points) - 1
        self.rows = [i for cell in call.cells for a, b in structure.cells[cell] for i in range(a, b)]
        blocks = _blocks(system.matrix, self.rows)
        self._blocks = [(block, [i for i in self.rows if i in set(block)]) for block in blocks]
        self.rows = [i for _, rows in self._blocks for i in rows]
        self.columns = [j for block, rows in self._blocks for _ in rows for j in block]
        self.starts = [0]
        for block, rows in self._blocks:
            self.starts += [self.starts[-1] + len(block) * (k + 1) for k in range(len(rows))]
        self.largest = max(map(len, blocks))

    @property
    def constants(self) -> list[Fraction]:
        """time · b; empty if it is zero."""
        b = self._system.constants
        return [self.time * b.get(i, Fraction(0)) for i in range(self._dimension)] if any(b.values()) else []

    @property
    def matrices(self) -> int:
        """How many there are: for z(0), for each forcing term, and for b."""
        return 1 + self.forcing + bool(self.constants)

    def numbers(self, h: float) -> np.ndarray:
        """The elements of each matrix, heads and then tails."""
        import numpy as np

        known: dict[tuple[tuple[Fraction, ...], ...], list[np.ndarray] | None] = {}
        parts: list[list[np.ndarray]] = [[] for _ in range(self.matrices)]
        for block, rows in self._blocks:
            matrix = tuple(tuple(self._system.matrix.get((i, j), Fraction(0)) for j in block) for i in block)
            if matrix not in known:
                known[matrix] = self._matrices(matrix, Fraction(h))
            chosen = [block.index(i) for i in rows]
            for part, found in zip(parts, known[matrix] or [None] * self.matrices, strict=True):
                empty = np.full((2, len(chosen) * len(block)), np.nan)
                part.append(empty if found is None else doubles(found[chosen].ravel()))
        return np.concatenate([np.hstack(part).ravel() for part in parts])

    def _matrices(self, matrix: Sequence[Sequence[Fraction]], h: Fraction) -> list[np.ndarray] | None:
        """The matrices of a block in fixed-point numbers; None if they are no doubles."""
        slope = fixed_point([[self.time * x for x in row] for row in matrix])
        phi = phi_functions(fixed_point([[h * self.time * x for x in row] for row in matrix]), max(1, self.forcing))
        if phi is None:
            return None
        forced = [phi[j] * factorial(j) * h.denominator // h.numerator for j in range(self.forcing)]
        return [product(slope, phi[0]), *forced, *([phi[0]] if self.constants else [])]


def _blocks(pairs: Iterable[tuple[int, int]], wanted: Iterable[int]) -> list[list[int]]:
    """Variables that have to do with one another, as far as some of them are wanted."""
    import networkx as nx

    graph = nx.Graph()
    graph.add_nodes_from(wanted)
    graph.add_edges_from(pairs)
    rows = set(wanted)
    found = (sorted(component) for component in nx.connected_components(graph))
    return sorted(block for block in found if not rows.isdisjoint(block))
