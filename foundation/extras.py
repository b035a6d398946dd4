"""Installation hints for optional packages."""

from __future__ import annotations


def how_to_install(extra: str) -> str:
    """The command that installs the packages of an extra.

    Example:
        >>> how_to_install("plot")
        "pip install '.[plot]' in the clone of bseries-engine"
    """
    return f"pip install '.[{extra}]' in the clone of bseries-engine"
