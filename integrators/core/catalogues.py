"""Catalogues: entries declared by the files of a folder and by other distributions, and their index by name."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import cached_property
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, Generic, Protocol, TypeVar


class Named(Protocol):
    """An entry of a catalogue."""

    @property
    def name(self) -> str:
        """Its name."""
        ...

    @property
    def aliases(self) -> tuple[str, ...]:
        """Other names."""
        ...


E = TypeVar("E", bound=Named)
Index = Mapping[str, tuple[E, str]]
"""The entry and the customary spelling of each normalised name."""

_SPELLING = str.maketrans({"-": None, "–": None, "_": None, " ": None, "ö": "o"})


def declared_entries(package: str, name: str) -> list[Any]:
    """The entries that the modules of a package declare under a name, such as ``METHODS``, in alphabetical order."""
    modules = [import_module(f"{package}.{module.name}") for module in iter_modules(import_module(package).__path__)]
    return [entry for module in modules for entry in getattr(module, name, ())]


def plug_in_entries(group: str, kind: type[E], taken: Collection[str], check: Callable[[E], object]) -> list[E]:
    """The entries that other distributions add as entry points of a group.

    An entry point is a sequence of entries. If one of them cannot be used, all of its entries are left out with a
    warning that says why.
    """
    from importlib.metadata import entry_points

    found: list[E] = []
    for point in sorted(entry_points(group=group)):
        try:
            entries, known = point.load(), {*taken, *index_by_name(found)}
            if not isinstance(entries, tuple | list) or not all(isinstance(entry, kind) for entry in entries):
                raise TypeError(f"it must be a tuple or list of {kind.__name__}, but was {entries!r:.60}")
            for name, (entry, _) in index_by_name(entries).items():
                if name in known:
                    raise ValueError(f"its names must be new, but {entry.name!r:.60} was there already")
            for entry in entries:
                check(entry)
        except Exception as error:  # the code of others may raise anything
            origin = point.dist.name if point.dist else point.value
            message = f"entry point {point.name!r} of {group} in {origin} must be usable, but was left out: {error}"
            warnings.warn(message, RuntimeWarning, stacklevel=2)
        else:
            found += entries
    return found


class Register(Generic[E]):
    """The entries of a catalogue by name: those of the files of a package, and those of other distributions.

    The modules of `package` declare entries of the class `kind` under the name `variable`, other distributions as entry
    points of `group`, which are read only when all entries, or names that are not built in, are wanted. `check` refuses
    an entry of another distribution by an exception.
    """

    def __init__(self, package: str, variable: str, group: str, kind: type[E], check: Callable[[E], object]):
        self._package, self._variable = package, variable
        self._group, self._kind, self._check = group, kind, check

    @cached_property
    def declared(self) -> list[E]:
        """The entries of the package."""
        return declared_entries(self._package, self._variable)

    @cached_property
    def entries(self) -> list[E]:
        """All entries."""
        return [*self.declared, *plug_in_entries(self._group, self._kind, self._built_in, self._check)]

    @cached_property
    def _built_in(self) -> Index[E]:
        return index_by_name(self.declared)

    @cached_property
    def index(self) -> Index[E]:
        """All entries by name."""
        return index_by_name(self.entries)

    def index_with(self, *names: str) -> Index[E]:
        """The built-in entries by name if one of these names is among them, else all."""
        return self._built_in if any(name in self._built_in for name in names) else self.index


def spelling(name: str) -> str:
    """The normalised spelling of a name: lower case, without hyphens, underscores and spaces."""
    return name.lower().translate(_SPELLING)


def index_by_name(entries: Iterable[E]) -> Index[E]:
    """The entry and the customary spelling of each normalised name and alias."""
    return {spelling(name): (entry, name) for entry in entries for name in (entry.name, *entry.aliases)}
