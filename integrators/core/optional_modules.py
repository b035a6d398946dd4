"""Import of optional packages."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from integrators.core.errors import IntegratorError, shorten


def optional_module(module: str, user: str) -> Any:
    """Import a module; the error names its `user` and how to install it."""
    try:
        return import_module(module)
    except ImportError as error:
        raise IntegratorError(
            f"{module} must be installed for {user} (pip install {module}), but was not: {shorten(str(error))}"
        ) from None
