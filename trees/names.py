"""Names of colours: trees hold colours as numbers, texts and formulas call them by name."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from trees.errors import TreeError

_LETTERS = "abcdefghijklmnorsuvwxyz"  # t is the uncoloured node; p and q are the two blocks of a partitioned system


def default_names(colors: int) -> tuple[str, ...]:
    """The names of so many colours where nobody chose any.

    Args:
        colors: The number of colours.

    Returns:
        One empty name for one colour, p and q for two, and letters beyond. The letters leave out p, q and t, so that
        a text tells by itself which names it uses.

    Example:
        >>> default_names(1), default_names(2), default_names(3)
        (('',), ('p', 'q'), ('a', 'b', 'c'))
    """
    return tuple(_default_name(color, colors - 1) for color in range(colors))


def _default_name(color: int, largest: int) -> str:
    if largest <= 1:
        return "pq"[color] if largest else ""
    lap, letter = divmod(color, len(_LETTERS))
    return _LETTERS[letter] + (str(lap) if lap else "")


def default_color(name: str) -> int | None:
    """The colour among three or more that has this name by default, if any.

    Args:
        name: A letter, followed by a number for colours beyond the letters.

    Returns:
        The colour, or None if no colour is called so.

    Example:
        >>> default_color("c"), default_color("a1"), default_color("p")
        (2, 23, None)
    """
    letter, lap = _LETTERS.find(name[0]), name[1:]
    if letter < 0 or lap.startswith("0") or not is_number(lap or "0"):
        return None
    return int(lap or "0") * len(_LETTERS) + letter


def is_name(word: str) -> bool:
    """Whether a word may name a colour: a letter, then letters, digits and ``_``; neither ``t`` nor with a ``τ``."""
    return word[:1].isalpha() and word != "t" and all(c.isalnum() or c == "_" for c in word) and "τ" not in word


def is_number(word: str) -> bool:
    """Whether a word is a number in digits, short enough for anything a tree can have."""
    return word.isascii() and word.isdigit() and len(word) < 10


def check_names(names: Iterable[str]) -> tuple[str, ...]:
    """The names of colours as a tuple, if each can be told apart and read back.

    Args:
        names: One name per colour. A single empty name means trees of one colour, written without it.

    Returns:
        The names.

    Raises:
        TreeError: If a name is repeated, reserved, or no word that `is_name` accepts.
    """
    checked = tuple(names) if hasattr(names, "__iter__") else ()
    if checked == ("",):
        return checked
    for name in checked:
        if not isinstance(name, str) or not is_name(name):
            raise TreeError(f"names must be words that start with a letter, none t or τ, but one was {name!r:.60}")
    if not checked or len(set(checked)) < len(checked):
        raise TreeError(f"names must be different words, one per colour, but were {names!r:.60}")
    return checked


def node_names(colors: Sequence[int], names: Iterable[str] | None = None) -> list[str]:
    """The name of each node's colour.

    Args:
        colors: The colour of each node.
        names: One name per colour; None for the default names of as many colours as occur.

    Returns:
        The names; empty ones for trees of one colour that nobody named.

    Raises:
        TreeError: If a name is unusable or a colour has none.

    Example:
        >>> node_names((0, 1, 0)), node_names((0, 0))
        (['p', 'q', 'p'], ['', ''])
    """
    largest = max(colors)
    if names is None:
        return [_default_name(color, largest) for color in colors]
    checked = check_names(names)
    if largest >= len(checked):
        raise TreeError(f"names must name the colours 0 to {largest}, but were {checked!r:.60}")
    return [checked[color] for color in colors]
