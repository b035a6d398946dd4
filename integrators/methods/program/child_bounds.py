"""Bounds on the children of nodes in trees, beyond which elementary differentials vanish."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from numbers import Real
from typing import Any, TypeAlias

from integrators.core.errors import IntegratorError, shown

ChildBounds: TypeAlias = tuple[tuple[int | None, ...], ...]
"""For each part the largest orders of its derivatives with respect to each part and, as optional last entry, in all."""

INFINITE = float("inf")


def read_child_bounds(bounds: Any, parts: int, argument: str = "max_children") -> ChildBounds | None:
    """Bounds in normal form: a row for each part, with a last entry for all children if it is a bound.

    Args:
        bounds: None (no bound), one number (for all children of every node), or for each part a row with a bound for
            each part and optionally one for all children. None and ``inf`` mean unbounded.
        parts: the number of parts.
        argument: their name in messages.

    Returns:
        The rows; None if nothing is bounded.

    Raises:
        IntegratorError: a bound is not a whole number, 0 or more, or the rows have the wrong number or length.

    Example:
        >>> read_child_bounds([[1, 1, 1], [None, None, None]], 2)
        ((1, 1, 1), (None, None))
        >>> read_child_bounds(3, 1)
        ((None, 3),)
    """
    given = _plain(bounds)
    rows = list(map(_plain, given)) if _is_listed(given) else [[None] * parts + [given]] * parts
    if len(rows) != parts or not all(_is_row(row, parts) for row in rows):
        raise IntegratorError(
            f"{argument} must be one bound or {parts} row{'s' * (parts > 1)} of {parts} or {parts + 1} bounds, each a "
            f"whole number, 0 or more, or None, but was {shown(bounds)}"
        )
    read = tuple(tuple(map(_bound, row)) for row in rows)
    read = tuple(row[:parts] if row[parts:] == (None,) else row for row in read)
    return read if any(bound is not None for row in read for bound in row) else None


def common_bounds(first: ChildBounds | None, second: ChildBounds | None) -> ChildBounds | None:
    """The bounds that hold for the fields of both of two methods."""
    if first is None or second is None:
        return first or second
    rows = (zip_longest(a, b) for a, b in zip(first, second, strict=True))
    return tuple(tuple(min((x for x in pair if x is not None), default=None) for pair in row) for row in rows)


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else value


def _is_listed(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _is_row(row: Any, parts: int) -> bool:
    return _is_listed(row) and len(row) in (parts, parts + 1) and all(map(_is_bound, row))


def _is_bound(bound: Any) -> bool:
    if isinstance(bound, bool) or not isinstance(bound, Real):
        return bound is None
    number: Any = bound
    return number >= 0 and number in (INFINITE, number // 1)


def _bound(bound: Any) -> int | None:
    return None if bound in (None, INFINITE) else int(bound)
