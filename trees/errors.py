"""The error that every misuse of this package raises."""

from bseries_base.errors import BSeriesError


class TreeError(BSeriesError):
    """A tree, a text for a tree, or a request about trees that cannot be served.

    The message names the argument, what it must be, and what it was.
    """
