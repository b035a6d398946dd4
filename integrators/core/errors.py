"""The error that every misuse of this package raises."""

from typing import Any


class IntegratorError(ValueError):
    """A tableau, file, formula or method name that cannot be used.

    The message names the argument, what it must be, and what it was.
    """


def shorten(text: str, length: int = 60) -> str:
    """The text, truncated to fit a message."""
    return text if len(text) <= length else text[: length - 3] + "..."


def shown(value: Any) -> str:
    """A value as text for a message; Python refuses to print integers of more than 4300 digits."""
    try:
        return shorten(repr(value))
    except ValueError:
        return "too long to be printed"
