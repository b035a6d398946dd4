"""The error that every misuse of this package raises, and the parts of its messages."""

from bseries_base.errors import BSeriesError as BSeriesError
from bseries_base.errors import not_one_of as not_one_of
from bseries_base.errors import shorten as shorten
from bseries_base.errors import shown as shown
from bseries_base.errors import suggestion as suggestion


class IntegratorError(BSeriesError):
    """A tableau, file, formula or method name that cannot be used.

    The message names the argument, what it must be, and what it was.
    """
