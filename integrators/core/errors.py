"""The error that every misuse of this package raises."""

from bseries_base.errors import BSeriesError as BSeriesError  # a stub of lazy_loader names modules of its package only


class IntegratorError(BSeriesError):
    """A tableau, file, formula or method name that cannot be used.

    The message names the argument, what it must be, and what it was.
    """
