"""The base class of the errors of all packages, and the parts of their messages."""

import warnings
from collections.abc import Iterable
from numbers import Rational
from sys import _getframe

PACKAGES = ("bseries", "integrators", "trees", "bseries_base")
MOST = 1000
"""Characters of a sentence; a longer one loses its middle."""


def plain(text: str) -> str:
    """Text in one line: spaces in place of line ends, escapes in place of what cannot be shown.

    Example:
        >>> print(plain("name must be text,\\nbut was \\x1b[31m, \\ud800"))
        name must be text, but was \\x1b[31m, \\ud800
    """
    return "".join(x if x.isprintable() else " " if x.isspace() else ascii(x)[1:-1] for x in text)


class BSeriesError(ValueError):
    """What cannot be done with some arguments: base class of TreeError, IntegratorError and SeriesError.

    The message names the argument, what it must be, and what it was. It is one sentence that every terminal and every
    encoding can show, whatever text of users it quotes.

    Example:
        >>> import bseries as bs
        >>> try:
        ...     bs.scene("keppler")
        ... except bs.integrators.BSeriesError as error:
        ...     print(error)
        scene must be one of the catalogue, but was 'keppler'; did you mean kepler?
    """

    def __init__(self, sentence: str = "") -> None:
        text = plain(str(sentence))
        super().__init__(text if len(text) <= MOST else f"{text[: MOST // 2]} ... {text[-MOST // 3 :]}")


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


def as_sentence(message: object) -> str:
    """A message with the full stop that an error does without; questions have their mark.

    Example:
        >>> as_sentence("h must be positive, but was -1"), as_sentence("did you mean kepler?")
        ('h must be positive, but was -1.', 'did you mean kepler?')
    """
    text = str(message)
    return text if text.endswith("?") else f"{text}."


def warn_user(message: str, category: type[Warning]) -> None:
    """Warn at the line that called these packages, however deep below it the reason was found."""
    level, frame = 2, _getframe(1)
    while frame.f_back is not None and str(frame.f_globals.get("__name__")).partition(".")[0] in PACKAGES:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, category, stacklevel=level)
