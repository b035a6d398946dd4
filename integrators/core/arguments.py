"""Checks of arguments: sequences, labels, names and numbers of digits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from integrators.core.errors import IntegratorError, shorten


def items(value: Any, argument: str) -> list[Any]:
    """The entries of a sequence or array."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, str | bytes | Mapping | set | frozenset) or not isinstance(value, Iterable):
        raise IntegratorError(f"{argument} must be a sequence, but was {shorten(repr(value))}")
    return list(value)


def check_digits(digits: object) -> None:
    """Refuse a number of significant digits that is none."""
    if digits is not None and (isinstance(digits, bool) or not isinstance(digits, int) or not 1 <= digits <= 1000):
        raise IntegratorError(f"digits must be an integer from 1 to 1000, but was {shorten(repr(digits))}")


def check_label(value: object, argument: str) -> None:
    """Refuse a name or reference that is not text."""
    if value is not None and not isinstance(value, str):
        raise IntegratorError(f"{argument} must be text, but was {shorten(repr(value))}")


def check_partition_names(names: Iterable[Any]) -> None:
    """Refuse names of parts that formulas and trees could not tell apart."""
    for name in names:
        if not isinstance(name, str) or not name.isidentifier() or name[0] == "_" or name == "t" or "τ" in name:
            raise IntegratorError(
                "names of partitions must start with a letter, hold letters, digits and _ only, and not be t or hold "
                f"τ, but one was {shorten(repr(name))}"
            )
