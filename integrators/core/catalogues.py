"""Catalogues: the entries that the files of a folder declare."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Any


def declared_entries(package: str, name: str) -> list[Any]:
    """The entries of all modules of a package that declare some, in alphabetical order of the modules.

    Args:
        package: The package, a folder in which a new file adds its entries without being listed anywhere.
        name: The name under which a module declares a sequence of entries, such as ``METHODS``.
    """
    folder = import_module(package).__path__
    modules = [import_module(f"{package}.{module.name}") for module in iter_modules(folder)]
    return [entry for module in modules for entry in getattr(module, name, ())]
