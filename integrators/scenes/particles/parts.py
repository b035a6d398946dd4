"""Pieces of a field: their polynomial degrees, and their assignment to the parts of a method.

Degrees bound the trees with nonzero elementary differentials: a node has at most as many children of a colour as its
field has nonzero derivatives in that direction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from bseries_base.child_bounds import ChildBounds
from integrators.core.arguments import canonical_names
from integrators.core.errors import IntegratorError
from integrators.scenes.model.blocks import canonical_blocks
from integrators.scenes.model.system import LocalTerm, Output, Place, System, output_formula

if TYPE_CHECKING:
    import sympy


Family: TypeAlias = tuple[str, int]
"""A class of variables: the name of a block and an index in it."""


class Piece(NamedTuple):
    """The contribution of the terms of a part (None: all) to the variables of some blocks (None: all)."""

    blocks: frozenset[str] | None = None
    part: str | None = None

    def outputs(self, term: LocalTerm, scene: System) -> list[Output]:
        """The outputs of a term that belong to the piece."""
        if self.part is not None and term.part != self.part:
            return []
        return [x for x in term.outputs if self.blocks is None or family_of(x.place, scene)[0] in self.blocks]


def family_of(place: Place, scene: System) -> Family:
    """The block of a place, and its component there (the same for all sites)."""
    block = next(block for block in scene.blocks if block.offset <= place.offset < block.end)
    entry = place.offset - block.offset
    return block.name, entry % len(block.components) if block.components else entry


def supports(scene: System, pieces: Sequence[Piece]) -> list[frozenset[Family]]:
    """The families of variables in which each piece of the field has entries."""
    return [
        frozenset(family_of(x.place, scene) for term in scene.local_terms for x in piece.outputs(term, scene))
        for piece in pieces
    ]


def degrees(scene: System, pieces: Sequence[Piece]) -> list[list[int | None]]:
    """The degree of each piece of the field in the variables of every piece, and in all of these together.

    A degree is None if the piece is not a polynomial; the format is that of `max_children` of a table of trees.
    """
    where = supports(scene, pieces)
    rows: list[list[int | None]] = []
    for piece in pieces:
        outputs = [(term, output) for term in scene.local_terms for output in piece.outputs(term, scene)]
        row: list[int | None] = []
        for families in (*where, frozenset().union(*where)):
            found = [_degree(term, output, families, scene) for term, output in outputs]
            row.append(None if None in found else max(filter(None, found), default=0))
        rows.append(row)
    return rows


def _degree(term: LocalTerm, output: Output, families: frozenset[Family], scene: System) -> int | None:
    """The degree of an output of a term in its local variables of these families."""
    import sympy

    used = [k for k, argument in enumerate(term.arguments) if family_of(argument.plus, scene) in families]
    return degree(output_formula(term, output), [sympy.Symbol(f"x{k}") for k in used])


def degree(formula: sympy.Expr, variables: Sequence[sympy.Symbol]) -> int | None:
    """The total degree of a formula in some variables; None if it is not a polynomial in them."""
    import sympy

    free = formula.free_symbols
    used = [variable for variable in variables if variable in free]
    if not used:
        return 0
    return sympy.Poly(formula, *used).total_degree() if formula.is_polynomial(*used) else None


Parts: TypeAlias = Mapping[str, str | Sequence[str]]
"""The blocks of a scene, or its part, for each part of a method."""

UNNAMED = ("a", "b")
"""The names that splitting methods give to two arbitrary parts."""


def pieces_of(names: Sequence[str], scene: System, parts: Parts | None = None) -> tuple[Piece, ...]:
    """The pieces of a scene's field that correspond to the colours of a method or series."""
    if parts is not None:
        if len(names) == 1:
            raise IntegratorError(f"parts must be None where the whole field is one part, but was {parts!r:.60}")
        return _named_pieces(names, scene, parts)
    pieces = default_pieces(names, scene)
    if pieces is not None:
        return pieces
    blocks = ", ".join(block.name for block in scene.blocks)
    if len(scene.blocks) == 1 and not scene.parts:
        raise IntegratorError(
            f"scene must have blocks or parts for {', '.join(names)}, which the method treats differently, but "
            f"{scene.name} has the block {blocks} only"
        )
    known = f"blocks {blocks}" + (f", parts {', '.join(scene.parts)}" if scene.parts else "")
    raise IntegratorError(
        f"parts must say what the method's parts {', '.join(names)} are in {scene.name} ({known}), as in "
        f"parts={{{names[0]!r}: {scene.blocks[-1].name!r}, …}}, but was None"
    )


def default_pieces(names: Sequence[str], scene: System) -> tuple[Piece, ...] | None:
    """The pieces that names stand for where they are not assigned; None if they must be."""
    blocks = [block.name for block in scene.blocks]
    if len(names) == 1:
        return (Piece(),)
    if set(names) <= set(blocks) and set(blocks) - set(names) <= {"t"}:
        rest = [name for name in blocks if name not in names]
        last = max(names, key=blocks.index)
        return tuple(Piece(frozenset([name, *rest] if name == last else [name])) for name in names)
    told, pair = canonical_names(names), canonical_blocks(scene.blocks)
    if told is not None and pair is not None and len(names) == len(blocks) == 2:
        meant = dict(zip(told, pair, strict=True))
        return tuple(Piece(frozenset([meant[name].name])) for name in names)
    if set(names) == set(UNNAMED) and len(blocks) == 2 and not scene.parts:
        kicked, drifting = (block.name for block in scene.canonical_pair or scene.blocks)
        return tuple(Piece(frozenset([drifting if name == UNNAMED[0] else kicked])) for name in names)
    if set(names) == set(scene.parts):
        _check_complete(scene)
        return tuple(Piece(part=name) for name in names)
    return None


def check_kind(name: str, bounds: ChildBounds | None, pieces: Sequence[Piece], scene: System) -> None:
    """Refuse a scene whose field exceeds the degrees that a method allows, so that it would not attain its order."""
    if bounds is None:
        return
    for mine, theirs in zip(bounds, degrees(scene, pieces), strict=True):
        for allowed, found in zip(mine, theirs, strict=False):
            if allowed is not None and (found is None or found > allowed):
                raise IntegratorError(
                    f"scene must be of the kind that {name} is meant for, such as q'' = g(q), but the field "
                    f"of {scene.name} is more general"
                )


def _named_pieces(names: Sequence[str], scene: System, parts: Parts) -> tuple[Piece, ...]:
    if not isinstance(parts, Mapping) or set(parts) != set(names):
        raise IntegratorError(
            f"parts must map {', '.join(names)} to blocks or parts of the scene, but was {parts!r:.60}"
        )
    blocks = [block.name for block in scene.blocks]
    pieces = []
    for name in names:
        given = parts[name]
        chosen = [given] if isinstance(given, str) else list(given) if isinstance(given, Sequence) else []
        if len(chosen) == 1 and chosen[0] in scene.parts and chosen[0] not in blocks:
            pieces.append(Piece(part=chosen[0]))
        elif chosen and all(block in blocks for block in chosen):
            pieces.append(Piece(frozenset(chosen)))
        else:
            known = ", ".join([*blocks, *scene.parts])
            raise IntegratorError(f"parts.{name} must be of the scene's {known}, but was {parts[name]!r:.60}")
    covered = [block for piece in pieces for block in piece.blocks or ()]
    if all(piece.part for piece in pieces):
        _check_complete(scene, {piece.part for piece in pieces})
        if len(pieces) > len({piece.part for piece in pieces}):
            raise IntegratorError(f"parts must take each part of {', '.join(scene.parts)} once, but took one twice")
    elif sorted(covered) != sorted(blocks) or any(piece.part for piece in pieces):
        raise IntegratorError(f"parts must take each block of {', '.join(blocks)} once, but took {', '.join(covered)}")
    return tuple(pieces)


def _check_complete(scene: System, parts: set[str | None] | None = None) -> None:
    """Refuse parts that do not sum to the whole field."""
    left = {term.part for term in scene.local_terms} - set(parts or scene.parts)
    if left:
        named = ", ".join(sorted(str(part) for part in left if part)) or "terms without a part"
        raise IntegratorError(f"parts must be the whole field of {scene.name}, but {named} belong to none of them")
