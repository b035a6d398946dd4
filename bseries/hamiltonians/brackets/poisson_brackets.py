"""Modified Hamiltonians of splitting methods on scenes, by exact evaluation of nested Poisson brackets.

For any Poisson structure B(y) the bracket {A,X} = ∇Aᵀ B ∇X is the derivative of X along −B∇A, the reversed field of A.
Thus only the fields of the parts are needed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cache
from itertools import chain
from typing import cast

import sympy

from bseries.algebra.stages import is_chain
from bseries.exceptions import SeriesError
from bseries.fields.differential_rings import DifferentialRing
from bseries.fields.elementary_differentials import FLOAT_DIGITS
from bseries.fields.polynomials import Element
from bseries.hamiltonians.brackets.bracket_series import Bracket, BracketSeries
from bseries.hamiltonians.brackets.campbell_hausdorff import (
    check_parts,
    in_brackets,
    kinetic_of,
    shown_names,
)
from integrators.methods.programs.program import Method
from integrators.scenes.particles.expansion import flat_hamiltonian, hamiltonian_field
from integrators.scenes.particles.parts import Parts, Piece, check_kind, degrees, pieces_of
from integrators.scenes.scene import Scene

MOST_SIMPLIFIED = 2000  # formulas with more monomials are not simplified: it would take longer than computing them


def bracket_terms(method: Method, scene: Scene, order: int, parts: Parts | None = None) -> tuple[sympy.Expr, ...]:
    """The modified Hamiltonian of a splitting method on a scene, by power of h; see `bracket_hamiltonian`."""
    check_parts(method.names, method.name)
    pieces = pieces_of(method.names, scene, parts)
    own = method.max_children
    check_kind(method.name, own, pieces, scene)
    bounds = degrees(scene, pieces)
    kinetic = kinetic_of(bounds if own is None else own, len(pieces))
    if kinetic is None and not is_chain(method) and any(row[k] != 0 for k, row in enumerate(bounds)):
        raise SeriesError(
            f"scene must be separable for {method.name}, which is no chain of flows, but {scene.name} is not"
        )
    energies = dict(zip(shown_names(method.names), part_hamiltonians(scene, pieces), strict=True))
    return _evaluated(in_brackets(method, order, kinetic), scene, energies)


def part_hamiltonians(scene: Scene, pieces: Sequence[Piece]) -> list[sympy.Expr]:
    """The Hamiltonians of the pieces of the field."""
    energy = scene.hamiltonian
    if energy is None:
        raise SeriesError(f"scene must be Hamiltonian or Poisson, but {scene.name} has no Hamiltonian")
    if all(piece.blocks is None for piece in pieces):
        summands = [[x for x in scene.summands if x.part == piece.part] for piece in pieces]
        return [flat_hamiltonian(of_part, scene) or sympy.Integer(0) for of_part in summands]
    found = _sorted_terms(energy, pieces, scene) or _sorted_terms(energy.expand(), pieces, scene)
    if found is None:
        raise SeriesError(f"scene must be a sum of Hamiltonians of the method's parts, but {scene.name} is not")
    return found


def _sorted_terms(energy: sympy.Expr, pieces: Sequence[Piece], scene: Scene) -> list[sympy.Expr] | None:
    """The terms of a Hamiltonian by the piece of their field; None if a field has several pieces."""
    blocks = [block.name for block in scene.blocks for _ in block.variables]
    found: list[list[sympy.Expr]] = [[] for _ in pieces]
    for term in sympy.Add.make_args(energy):
        field = hamiltonian_field(cast("sympy.Expr", term), scene)
        moved = {block for block, entry in zip(blocks, field, strict=True) if entry}
        at = next((k for k, piece in enumerate(pieces) if moved <= (piece.blocks or frozenset())), None)
        if at is None:
            return None
        found[at].append(cast("sympy.Expr", term))
    return [sympy.Add(*terms) for terms in found]


def _evaluated(brackets: BracketSeries, scene: Scene, energies: Mapping[str, sympy.Expr]) -> tuple[sympy.Expr, ...]:
    """Evaluate a sum of brackets for given Hamiltonians of the parts, by power of h."""
    numbers = [x for x in brackets.values() if not isinstance(x, Fraction)]
    flows = {name: hamiltonian_field(energy, scene) for name, energy in energies.items()}
    formulas = [*energies.values(), *chain.from_iterable(flows.values()), *numbers]
    digits = None if brackets.digits is None else max(1, min(brackets.digits - 1, FLOAT_DIGITS))
    ring = DifferentialRing(formulas, scene.symbols, digits=digits)
    backwards = {
        name: [(i, -ring.element(entry)) for i, entry in enumerate(flow) if entry] for name, flow in flows.items()
    }

    @cache
    def nested(word: Bracket) -> Element:
        if len(word) == 1:
            return ring.element(energies[word[0]])
        inner = nested(word[1:])
        return ring.dot((ring.derivative(inner, i), entry) for i, entry in backwards[word[0]])

    def term(k: int) -> sympy.Expr:
        terms = brackets.term(k).items()
        if k == 0 and all(x == 1 for _, x in terms):
            return sympy.Add(*energies.values())  # without expansion
        weights = (x if isinstance(x, Fraction) else ring.element(sympy.sympify(x, strict=True)) for _, x in terms)
        element = ring.dot(zip(weights, map(nested, brackets.term(k)), strict=True))
        return ring.to_expression(element, simplify=element.size <= MOST_SIMPLIFIED)

    return tuple(map(term, range(brackets.order)))
