"""Packages that only some functions need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from integrators.core.errors import IntegratorError, shorten


def optional_module(module: str, user: str) -> Any:
    """A module that only one function needs."""
    try:
        return import_module(module)
    except ImportError as error:
        raise IntegratorError(
            f"{module} must be installed for {user} (pip install {module}), but was not: {shorten(str(error))}"
        ) from None
