"""Warnings of the library, said as the command says them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from .application import say


@contextmanager
def said_warnings() -> Iterator[None]:
    """Say on stderr, one line each, what the library warns of."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        try:
            yield
        finally:
            for warning in found:
                say("warning", str(warning.message))
