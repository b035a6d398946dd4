"""The error that every misuse of this package raises."""

from bseries_base.errors import BSeriesError


class SeriesError(BSeriesError):
    """A request about series that cannot be served.

    The message names the argument, what it must be, and what it was.
    """
