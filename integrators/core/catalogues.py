"""Catalogues: entries declared by the files of a folder, and their index by name."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

_SPELLING = str.maketrans({"-": None, "–": None, "_": None, " ": None, "ö": "o"})


def declared_entries(package: str, name: str) -> list[Any]:
    """The entries that the modules of a package declare under a name, such as ``METHODS``, in alphabetical order."""
    modules = [import_module(f"{package}.{module.name}") for module in iter_modules(import_module(package).__path__)]
    return [entry for module in modules for entry in getattr(module, name, ())]


def spelling(name: str) -> str:
    """The normalised spelling of a name: lower case, without hyphens, underscores and spaces."""
    return name.lower().translate(_SPELLING)


def index_by_name(entries: Iterable[Any]) -> dict[str, tuple[Any, str]]:
    """The entry and the customary spelling of each normalised name and alias."""
    return {spelling(name): (entry, name) for entry in entries for name in (entry.name, *entry.aliases)}
