"""Names of the colours of nodes in texts and formulas."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from trees.errors import TreeError

_LETTERS = "abcdefghijklmnorsuvwxyz"  # t is the uncoloured node; p and q are the two blocks of a partitioned system


def default_names(colors: int) -> tuple[str, ...]:
    """The default names of colours: "" for one colour, p and q for two, for more the other letters except t.

    Example:
        >>> default_names(1), default_names(2), default_names(3)
        (('',), ('p', 'q'), ('a', 'b', 'c'))
    """
    return tuple(_default_name(color, colors - 1) for color in range(colors))


def _default_name(color: int, largest: int) -> str:
    if largest <= 1:
        return "pq"[color] if largest else ""
    cycle, letter = divmod(color, len(_LETTERS))
    return _LETTERS[letter] + (str(cycle) if cycle else "")


def default_color(name: str) -> int | None:
    """The colour with a default name among three or more colours; None if there is none.

    Example:
        >>> default_color("c"), default_color("a1"), default_color("p")
        (2, 23, None)
    """
    letter, cycle = _LETTERS.find(name[0]), name[1:]
    if letter < 0 or cycle.startswith("0") or not is_number(cycle or "0"):
        return None
    return int(cycle or "0") * len(_LETTERS) + letter


def is_name(word: str) -> bool:
    """Whether a word can name a colour: a letter, then letters, digits and ``_``; not ``t``, and without ``τ``."""
    return word[:1].isalpha() and word != "t" and all(c.isalnum() or c == "_" for c in word) and "τ" not in word


def is_number(word: str) -> bool:
    """Whether a word is a decimal number of at most nine digits."""
    return word.isascii() and word.isdigit() and len(word) < 10


def check_names(names: Iterable[str]) -> tuple[str, ...]:
    """The names of colours as a tuple: different words, or the single name "" of uncoloured trees."""
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
    """The name of each node's colour, by default the default name.

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
