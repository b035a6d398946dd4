"""The error that every misuse of this package raises."""

from collections.abc import Iterable
from numbers import Rational
from typing import Any

from foundation.sentences import SentenceError


class IntegratorError(SentenceError):
    """A tableau, file, formula or method name that cannot be used.

    The message names the argument, what it must be, and what it was.
    """


def shorten(text: str, length: int = 60) -> str:
    """The text, truncated to fit a message."""
    return text if len(text) <= length else text[: length - 3] + "..."


def shown(value: Any) -> str:
    """A value as text for a message; Python refuses to print integers of more than 4300 digits."""
    try:
        return shorten(str(value) if isinstance(value, Rational) else repr(value))
    except ValueError:
        return "too long to be printed"


def suggestion(name: str, known: Iterable[str]) -> str:
    """The end of a message on an unknown name: known names of a similar spelling, if any."""
    from difflib import get_close_matches

    near = dict.fromkeys(get_close_matches(name, list(known), n=3, cutoff=0.6))
    return f"; did you mean {' or '.join(near)}?" if near else ""


def not_one_of(known: Iterable[str], argument: str, name: object) -> str:
    """The message on a name that is not one of some, with those of a similar spelling.

    Example:
        >>> not_one_of(["html", "pdf"], "format", "hmtl")
        "format must be one of html, pdf, but was 'hmtl'; did you mean html?"
    """
    names = list(known)
    return f"{argument} must be one of {', '.join(names)}, but was {name!r:.60}{suggestion(str(name), names)}"
