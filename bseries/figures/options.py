"""Readers of the options of figures: numbers, starts, methods and scenes, as objects or as text."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from numbers import Rational
from typing import TYPE_CHECKING

import bseries as bs
from bseries.algebra.stages import check_method
from bseries.exceptions import SeriesError
from bseries_base.errors import shown
from bseries_base.extras import np
from integrators.core.arguments import as_lists, is_listed, split_row
from integrators.exact.expressions import parse_constant
from integrators.methods.catalogue.registry import as_method
from integrators.scenes.text import read_values

if TYPE_CHECKING:
    from integrators import Method, Scene


def read_number(value: object, argument: str, least: float, most: float) -> float:
    """A number within bounds as a double, given as a number or as text.

    Example:
        >>> read_number("1/50", "h", 0, 1), read_number(0.5, "h", 0, 1)
        (0.02, 0.5)
    """
    number = _number(value, argument)
    try:
        number = nan if isinstance(number, bool) else float(number)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError, OverflowError):
        number = nan
    if not least <= number <= most:
        raise SeriesError(f"{argument} must be a number from {least:g} to {most:g}, but was {value!r:.60}")
    return number


def read_numbers(value: object, argument: str, counts: Sequence[int], least: float, most: float) -> tuple[float, ...]:
    """Some numbers within bounds, given as a sequence or as text with commas.

    Example:
        >>> read_numbers("1/5, 0.3", "h", [2], 0, 1)
        (0.2, 0.3)
    """
    entries = _entries(value)
    if len(entries) not in counts:
        raise SeriesError(f"{argument} must be {_counted(counts, 'number')}, but was {shown(value)}")
    return tuple(read_number(entry, argument, least, most) for entry in entries)


def read_count(value: object, argument: str, least: int, most: int) -> int:
    """A whole number within bounds, given as a number or as text."""
    number = _number(value, argument)
    whole = None
    if isinstance(number, Rational) and number.denominator == 1 and not isinstance(number, bool):
        whole = int(number.numerator)
    if whole is None or not least <= whole <= most:
        raise SeriesError(f"{argument} must be a whole number from {least} to {most}, but was {value!r:.60}")
    return whole


def _number(value: object, argument: str) -> object:
    """The number that a text stands for; other values unchanged."""
    return parse_constant(value, argument=argument) if isinstance(value, str) else value


def _entries(value: object) -> list[object]:
    """The entries of a row, or a single value."""
    if isinstance(value, str):
        return [entry.strip() for entry in split_row(value)]
    value = as_lists(value)
    return list(value) if is_listed(value) else [value]


def _counted(counts: Sequence[int], what: str) -> str:
    """How many there must be, in words."""
    few, many = min(counts), max(counts)
    return (f"{few} " if few == many else f"{few} to {many} ") + what + "s" * (many != 1)


def read_methods(value: object, count: int) -> tuple[Method, ...]:
    """As many methods as wanted, given by names in a row, or as objects."""
    entries = _entries(value)
    if len(entries) != count:
        raise SeriesError(f"methods must be {_counted([count], 'name')}, but was {shown(value)}")
    return tuple(read_method(entry) for entry in entries)


def read_method(value: object) -> Method:
    """A method, given by its name or as an object."""
    return check_method(as_method(value))


def read_starts(value: object, scene: Scene, counts: Sequence[int]) -> tuple[tuple[float, ...], ...]:
    """States at which the field of a scene is finite, in the order of its variables.

    They are given as rows, or as text: rows with semicolons between them, or one start by blocks, ``p=0; q=-3/2``.

    Example:
        >>> from integrators import scene
        >>> read_starts("2,2; 7/2,2", scene("lotka-volterra"), [1, 2])
        ((2.0, 2.0), (3.5, 2.0))
    """
    if isinstance(value, str) and "=" in value:
        rows = [scene.with_start(**read_values(value, "y0")).y0.tolist()]
    elif isinstance(value, str):
        rows = [_entries(row) for row in value.split(";")]
    else:
        given = as_lists(value)
        rows = list(given) if is_listed(given) and given and all(map(is_listed, given)) else [given]
    if len(rows) not in counts:
        raise SeriesError(f"y0 must be {_counted(counts, 'start')}, but was {shown(value)}")
    return tuple(_start(row, scene) for row in rows)


def read_start(value: object, scene: Scene) -> tuple[float, ...]:
    """One state at which the field of a scene is finite."""
    return read_starts(value, scene, [1])[0]


def _start(row: object, scene: Scene) -> tuple[float, ...]:
    """A state of the scene, checked."""
    names = ", ".join(scene.variables)
    if not is_listed(row) or len(row) != scene.dimension:
        raise SeriesError(f"y0 must have numbers for {names} of {scene.name}, but was {shown(row)}")
    state = tuple(read_number(entry, "y0", -1e9, 1e9) for entry in row)
    with np.errstate(all="ignore"):
        velocity = bs.integrators.right_hand_side(scene)(0.0, np.array(state))
    if not np.isfinite(velocity).all():
        raise SeriesError(f"y0 must be a state at which the field of {scene.name} is finite, but was {shown(state)}")
    return state
