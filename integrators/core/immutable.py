"""Immutable values, compared and hashed by their data, and methods that cache their results."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar, cast


class ImmutableValue:
    """Base class of values whose attributes are set once, by the constructor, through ``__dict__``.

    Lazily computed attributes are ``functools.cached_property``, which writes to ``__dict__`` too.
    """

    @property
    def _data(self) -> tuple[object, ...]:
        """The data by which values of one class are compared."""
        raise NotImplementedError

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return self is other or self._data == other._data  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        known = self.__dict__.get("_hash")
        if known is None:
            known = self.__dict__["_hash"] = hash((type(self).__name__, self._data))
        return known

    def __getstate__(self) -> dict[str, object]:
        """All attributes but the hash: hashes of text differ between processes."""
        return {name: value for name, value in self.__dict__.items() if name != "_hash"}

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable: {name} cannot be set")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable: {name} cannot be deleted")


Function = TypeVar("Function", bound=Callable[..., object])


def cached_method(function: Function) -> Function:
    """Cache the results of a method in its object; `functools.cache` would keep the object alive."""
    name = f"_cached_{function.__name__}"

    @wraps(function)
    def known(owner: object, *arguments: object) -> object:
        values = owner.__dict__.setdefault(name, {})
        if arguments not in values:  # of several threads, all take the result of the first
            return values.setdefault(arguments, function(owner, *arguments))
        return values[arguments]

    return cast(Function, known)
