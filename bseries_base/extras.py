"""Import of optional packages, and of NumPy at its first use."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

EXTRAS = {
    "matplotlib": "plot", "imageio_ffmpeg": "animate", "scipy": "scipy", "pandas": "frames", "xarray": "frames",
    "distributed": "cluster", "bokeh": "explore", "jinja2": "explore", "pypandoc": "course", "typst": "course",
}  # fmt: skip
"""The extra of this distribution that installs a package."""


class MissingPackage(ImportError):
    """An optional package is not installed."""


def optional_module(module: str, user: str) -> ModuleType:
    """Import a module of an optional package, or raise MissingPackage and say what needs it and how to install it.

    Example:
        >>> optional_module("matplotlib.colors", "draw").to_hex("red")
        '#ff0000'
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise missing_package(module.partition(".")[0], user, error) from None


def missing_package(package: str, user: str, error: ImportError) -> MissingPackage:
    """The error that a package is missing, with the command that installs an optional one."""
    if package not in EXTRAS:
        return MissingPackage(f"{package} must be installed for {user}, but is missing ({error})")
    command = f"pip install '.[{EXTRAS[package]}]' in the clone of bseries-engine"
    return MissingPackage(f"{user} needs {package}: {command} ({error})")


def loaded_module(module: str) -> ModuleType | None:
    """A module that has been imported, else None; while another thread imports it, `sys.modules` has a part of it.

    Example:
        >>> loaded_module("math").pi, loaded_module("turtle")
        (3.141592653589793, None)
    """
    return None if sys.modules.get(module) is None else import_module(module)  # waits until it is complete


class LateModule:
    """A module that is imported at its first use, for files that are listed more often than run.

    Other lazy modules are in `sys.modules` before they are loaded, this one is not.

    Example:
        >>> LateModule("math").pi
        3.141592653589793
    """

    def __init__(self, module: str):
        self._module = module

    def __getattr__(self, name: str) -> Any:
        value = self.__dict__[name] = getattr(import_module(self._module), name)
        return value


if TYPE_CHECKING:
    import numpy as np
else:
    np = LateModule("numpy")
