"""The base class of the errors of all packages, and the parts of their messages."""

from collections.abc import Iterable
from numbers import Rational


class BSeriesError(ValueError):
    """What cannot be done with some arguments: base class of TreeError, IntegratorError and SeriesError.

    The message names the argument, what it must be, and what it was.

    Example:
        >>> import bseries as bs
        >>> try:
        ...     bs.scene("keppler")
        ... except bs.integrators.BSeriesError as error:
        ...     print(error)
        scene must be one of the catalogue, but was 'keppler'; did you mean kepler?
    """


def shorten(text: str, length: int = 60) -> str:
    """The text, truncated to fit a message."""
    return text if len(text) <= length else text[: length - 3] + "..."


def shown(value: object) -> str:
    """A value as text for a message; Python refuses to print integers of more than 4300 digits."""
    try:
        return shorten(str(value) if isinstance(value, Rational) else repr(value))
    except ValueError:
        return "too long to be printed"


def similar(name: str, known: Iterable[str], count: int = 3, cutoff: float = 0.6) -> list[str]:
    """Known names of a similar spelling, the nearest first, each once."""
    from difflib import get_close_matches

    return list(dict.fromkeys(get_close_matches(name, list(known), n=count, cutoff=cutoff)))


def suggestion(name: str, known: Iterable[str]) -> str:
    """The end of a message on an unknown name: known names of a similar spelling, if any."""
    near = similar(name, known)
    return f"; did you mean {' or '.join(near)}?" if near else ""


def not_one_of(known: Iterable[str], argument: str, name: object) -> str:
    """The message on a name that is not one of some, with those of a similar spelling.

    Example:
        >>> not_one_of(["html", "pdf"], "format", "hmtl")
        "format must be one of html, pdf, but was 'hmtl'; did you mean html?"
    """
    names = list(known)
    return f"{argument} must be one of {', '.join(names)}, but was {name!r:.60}{suggestion(str(name), names)}"
