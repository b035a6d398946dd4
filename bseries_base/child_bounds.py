"""Bounds on the children of nodes: of trees in a table, and by the derivatives of the field that a method allows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from numbers import Real
from typing import Any, TypeAlias

from bseries_base.errors import shown

ChildBounds: TypeAlias = tuple[tuple[int | None, ...], ...]
"""For each colour or part the most children of each colour and, last, in all; None if there is no bound.

These are the largest orders of the derivatives of each part of the field with respect to each part, and in all.
"""
GivenBounds: TypeAlias = "Iterable[Iterable[float | None]] | float | None"
"""Bounds as arguments; see `read_child_bounds`."""
UNBOUNDED = float("inf")


def read_child_bounds(bounds: object, colors: int, refusal: type[Exception]) -> ChildBounds:
    """Bounds as one row for each colour, with a last entry for all children.

    Args:
        bounds: None (no bound), one number (for all children of every node), or for each colour a row with a bound for
            each colour and optionally one for all children; None and ``inf`` mean unbounded.
        colors: The number of colours.
        refusal: The class of the error about what are no bounds.

    Example:
        >>> read_child_bounds([[1, 1, 1], [None, float("inf")]], 2, ValueError)
        ((1, 1, 1), (None, None, None))
        >>> read_child_bounds(3, 1, ValueError)
        ((None, 3),)
    """
    given = _listed(bounds)
    rows = [_listed(row) for row in given] if isinstance(given, list) else [[None] * colors + [given]] * colors
    if len(rows) != colors or not all(_is_row(row, colors) for row in rows):
        raise refusal(
            f"max_children must be one bound or {colors} row{'s' * (colors > 1)} of {colors} or {colors + 1} bounds, "
            f"each a whole number, 0 or more, or None, but was {shown(bounds)}"
        )
    read = (tuple(None if bound in (None, UNBOUNDED) else int(bound) for bound in row) for row in rows)
    return tuple(row if len(row) > colors else (*row, None) for row in read)


def _listed(value: Any) -> Any:
    """A row, or rows, as a list; other values unchanged, an array without axes as its number."""
    value = value.tolist() if hasattr(value, "tolist") else value
    is_row = isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping | Set)
    return list(value) if is_row else value


def _is_row(row: object, colors: int) -> bool:
    return isinstance(row, list) and len(row) in (colors, colors + 1) and all(map(_is_bound, row))


def _is_bound(bound: object) -> bool:
    if isinstance(bound, bool) or not isinstance(bound, Real):
        return bound is None
    return bound >= 0 and bound in (UNBOUNDED, bound // 1)  # type: ignore[operator]
