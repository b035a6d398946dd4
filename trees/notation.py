"""Notations of trees: names of colours, text, preorder sequences of levels and colours.

All notations are converted from and to levels and colours, without recursion, so trees can be arbitrarily tall.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache

from trees.errors import TreeError

_LETTERS = "abcdefghijklmnorsuvwxyz"  # t is the uncoloured node; p and q are the two blocks of a partitioned system

MAX_ORDER = 10_000
"""The largest number of nodes of one tree."""
TOKEN = re.compile(r"[^\W_τ][^\Wτ]*|\S")
"""A word, or a symbol."""
CONTROL = re.compile("[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029]")
"""Control characters other than tabs and ends of lines; Python takes some of them for spaces."""


@lru_cache(maxsize=64)
def default_names(colors: int) -> tuple[str, ...]:
    """The default names of colours: "" for one colour, p and q for two, for more the other letters except t.

    Example:
        >>> default_names(1), default_names(2), default_names(3)
        (('',), ('p', 'q'), ('a', 'b', 'c'))
    """
    if colors < 3:
        return ("p", "q") if colors == 2 else ("",)
    cycles = (divmod(color, len(_LETTERS)) for color in range(colors))
    return tuple(_LETTERS[letter] + (str(cycle) if cycle else "") for cycle, letter in cycles)


def default_color(name: str) -> int | None:
    """The colour with a default name among three or more colours; None if there is none."""
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
    """The name of each node's colour, by default the default name."""
    largest = max(colors)
    checked = default_names(largest + 1) if names is None else check_names(names)
    if largest >= len(checked):
        raise TreeError(f"names must name the colours 0 to {largest}, but were {checked!r:.60}")
    return [checked[color] for color in colors]


def parents_of(levels: Sequence[int]) -> list[int]:
    """The parent of each node, as index in preorder; −1 for the root."""
    path: list[int] = []  # the nodes from the root to the current one
    parents = []
    for node, level in enumerate(levels):
        path[level:] = [node]
        parents.append(path[level - 1] if level else -1)
    return parents


def nest(levels: Sequence[int], labels: Iterable[str], opening: str, closing: str) -> str:
    """A tree as nested text: each node's label, then its children in brackets, separated by commas."""
    parts = []
    for level, following, label in zip(levels, (*levels[1:], 0), labels, strict=True):
        parts.append(label + (opening if following > level else closing * (level - following) + ","))
    return "".join(parts)[:-1]


def tree_text(levels: Sequence[int], colors: Sequence[int], names: Iterable[str] | None = None) -> str:
    """A tree in bracket notation, which `parse` reads back.

    Example:
        >>> tree_text((0, 1, 1, 2), (0, 0, 0, 0)), tree_text((0, 1, 1, 2), (0, 1, 1, 0))
        ('[τ,[τ]]', 'p[q,q[p]]')
    """
    labels = node_names(colors, names)
    if not labels[0]:
        labels = ["" if following > level else "τ" for level, following in zip(levels, (*levels[1:], 0), strict=True)]
    return nest(levels, labels, "[", "]")


def parse(text: str, names: Iterable[str] | None = None) -> tuple[list[int], list[int]]:
    """The levels and colours, in preorder, of a tree in any notation, as for `Tree`.

    Siblings are in the order of the text, and sequences of numbers are not checked.

    Example:
        >>> parse("p[q^2]")
        ([0, 1, 1], [0, 1, 1])
    """
    checked = None if names is None else check_names(names)
    if control := CONTROL.search(text):
        raise _error(text, f"has the control character {control[0]!a} at position {control.start() + 1}")
    start = text.lstrip()
    if start.startswith("[") and start[1:].lstrip().startswith(tuple("-0123456789")):
        return _read_numbers(text)
    levels, words = _read_brackets(text)
    return levels, _resolve(text, words, checked)


def _error(text: str, problem: str) -> TreeError:
    return TreeError(f"text must be one tree such as [τ,[τ]] or p[q,q[p]], but {problem}: {text!r:.60}")


def _read_numbers(text: str) -> tuple[list[int], list[int]]:
    """A level sequence, optionally followed by a colon and the sequence of colours."""
    sequences = []
    position = 1
    for part in text.split(":", 1):
        inner = part.strip()
        if not (inner.startswith("[") and inner.endswith("]")):
            raise _error(text, f"lacks a sequence [0,1,…] in brackets at position {position}")
        position += part.index("[") + 1
        entries = []
        for entry in inner[1:-1].split(","):
            if not is_number(entry.strip()):
                raise _error(text, f"has {entry.strip()!r:.60} for a number at position {position}")
            entries.append(int(entry.strip()))  # str.strip takes more for a space than int does
            position += len(entry) + 1
        position += len(part) - len(part.rstrip()) + 1
        sequences.append(entries)
    return sequences[0], sequences[1] if len(sequences) > 1 else [0] * len(sequences[0])


def _read_brackets(text: str) -> tuple[list[int], list[tuple[int, str]]]:
    """The levels of the nodes of a tree in brackets, with the position and the name (or "") of each node's colour."""
    levels: list[int] = []
    words: list[tuple[int, str]] = []
    unclosed: list[tuple[int, int]] = []  # position and node of each bracket
    item, previous = 0, ""  # the root of the subtree read last, and the last token
    tokens = ((found.start() + 1, found[0]) for found in TOKEN.finditer(text))
    for position, token in tokens:
        problem, copies = "", 0  # of the last subtree, to be added
        if token in ("]", ",", "^") and (not unclosed or previous in ("[", ",")):
            problem = "empty brackets" if previous + token == "[]" else f"a stray '{token}'"
        elif token == "]":
            item = unclosed.pop()[1]
        elif token == "^":
            exponent = "" if previous == "^" else next(tokens, (0, ""))[1]
            if exponent.isascii() and exponent.isdigit() and exponent.strip("0"):
                copies = int(exponent) - 1 if is_number(exponent) else MAX_ORDER
            else:
                problem = "a '^' without one positive number"
        elif token == "[" and is_name(previous):
            unclosed.append((position, item))
        elif token != ",":
            if not is_name(token) and token not in ("[", "t", "τ"):
                problem = "the empty tree ∅, which is no tree," if token == "∅" else f"{token!r:.60}"
            elif levels and not unclosed:
                problem = "a second tree"
            item = len(levels)
            levels.append(len(unclosed))
            words.append((position, token if is_name(token) else ""))
            if token == "[":
                unclosed.append((position, item))
        if len(levels) + (len(levels) - item) * copies > MAX_ORDER:
            problem = problem or f"more than {MAX_ORDER} nodes"
        if problem:
            raise _error(text, f"has {problem} at position {position}")
        levels += levels[item:] * copies
        words += words[item:] * copies
        previous = token
    if unclosed:
        raise _error(text, f"has a bracket that is never closed at position {unclosed[-1][0]}")
    if not levels:
        raise _error(text, "is empty")
    return levels, words


def _resolve(text: str, words: Sequence[tuple[int, str]], names: Sequence[str] | None) -> list[int]:
    """The colours of the nodes, of which all or none must be named."""
    used = {word for _, word in words}
    if used == {""}:
        return [0] * len(words)
    if names is None and used <= {"", "p", "q"}:
        names = ("p", "q")
    known = {name: color for color, name in enumerate(names)} if names else {}
    colors = []
    for position, word in words:
        if not word:
            raise _error(text, f"has a node without a colour at position {position}")
        color = default_color(word) if names is None else known.get(word)
        if color is None:
            choice = "p, q alone or the other letters" if names is None else ", ".join(names)
            raise _error(text, f"has the colour {word!r:.40}, not one of {choice:.40}, at position {position}")
        colors.append(color)
    return colors
