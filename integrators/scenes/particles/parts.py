"""Assignment of the parts of a method to blocks of variables or parts of the field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from integrators.core.errors import IntegratorError
from integrators.methods.program.child_bounds import ChildBounds
from integrators.scenes.model.system import System
from integrators.scenes.particles.degrees import Piece, degrees

UNNAMED = ("a", "b")
"""The names that splitting methods give to two arbitrary parts."""


def pieces_of(names: Sequence[str], scene: System, parts: Any = None) -> tuple[Piece, ...]:
    """The pieces of a scene's field that correspond to the colours of a method or series.

    Args:
        names: The names of the colours; a single colour is the whole field.
        scene: The scene.
        parts: Maps every name to a block, a part of the field, or a list of blocks. None if the names are those of
            blocks (the time variable is added to the last block) or of parts; or if they are a, b and the scene has two
            blocks: then a advances the positions (drift) and b the momenta (kick), the convention for splitting
            methods. If the blocks are not canonical, a advances the second block and b the first.

    Raises:
        IntegratorError: A colour is ambiguous, or the pieces do not sum to the whole field.
    """
    blocks = [block.name for block in scene.blocks]
    if len(names) == 1:
        if parts is not None:
            raise IntegratorError(f"parts must be None where the whole field is one part, but was {parts!r:.60}")
        return (Piece(),)
    if parts is None and set(names) <= set(blocks) and set(blocks) - set(names) <= {"t"}:
        rest = [name for name in blocks if name not in names]
        last = max(names, key=blocks.index)
        return tuple(Piece(frozenset([name, *rest] if name == last else [name])) for name in names)
    if parts is None and set(names) == set(UNNAMED) and len(blocks) == 2 and not scene.parts:
        kicked, drifting = (block.name for block in scene.canonical_pair or scene.blocks)
        return tuple(Piece(frozenset([drifting if name == UNNAMED[0] else kicked])) for name in names)
    if parts is None and set(names) == set(scene.parts):
        _check_complete(scene)
        return tuple(Piece(part=name) for name in names)
    if parts is None and len(blocks) == 1 and not scene.parts:
        raise IntegratorError(
            f"scene must have blocks or parts for {', '.join(names)}, which the method treats differently, but "
            f"{scene.name} has the block {blocks[0]} only"
        )
    if parts is None:
        known = f"blocks {', '.join(blocks)}" + (f", parts {', '.join(scene.parts)}" if scene.parts else "")
        raise IntegratorError(
            f"parts must say what the method's parts {', '.join(names)} are in {scene.name} ({known}), as in "
            f"parts={{{names[0]!r}: {blocks[-1]!r}, …}}, but was None"
        )
    return _named_pieces(names, scene, parts)


def check_kind(name: str, bounds: ChildBounds | None, pieces: Sequence[Piece], scene: System) -> None:
    """Refuse a scene whose field is not of the special form that a method requires.

    Args:
        name: The name of the method.
        bounds: The degrees of the parts of the field that the method allows; None for any field.
        pieces: The pieces of the field that correspond to the parts.
        scene: The scene.

    Raises:
        IntegratorError: The method would not attain its order.
    """
    if bounds is None:
        return
    for mine, theirs in zip(bounds, degrees(scene, pieces), strict=True):
        for allowed, found in zip(mine, theirs, strict=False):
            if allowed is not None and (found is None or found > allowed):
                raise IntegratorError(
                    f"scene must be of the kind that {name} is meant for, such as q'' = g(q), but {scene.name} depends "
                    "on more"
                )


def _named_pieces(names: Sequence[str], scene: System, parts: Any) -> tuple[Piece, ...]:
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
