"""What to do where an optional package is missing."""

from __future__ import annotations


def how_to_install(extra: str) -> str:
    """How a user of a clone installs the packages of an extra.

    Example:
        >>> how_to_install("plot")
        "pip install '.[plot]' in the clone of bseries-engine"
    """
    return f"pip install '.[{extra}]' in the clone of bseries-engine"
