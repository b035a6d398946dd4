"""The error that every misuse of this package raises."""


class IntegratorError(ValueError):
    """A tableau, file, formula or method name that cannot be used.

    The message names the argument, what it must be, and what it was.
    """
