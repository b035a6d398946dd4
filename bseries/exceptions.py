"""The error that every misuse of this package raises."""

from foundation.sentences import SentenceError


class SeriesError(SentenceError):
    """A request about series that cannot be served.

    The message names the argument, what it must be, and what it was.
    """
