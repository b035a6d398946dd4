"""Values that never change: compared, hashed and pickled by their data."""

from __future__ import annotations

from typing import Any


class Frozen:
    """A value whose attributes are set once, by its constructor, through ``__dict__``.

    Lazily computed attributes are ``functools.cached_property``, which writes to ``__dict__`` too.
    """

    @property
    def _data(self) -> tuple[Any, ...]:
        """What makes two values of the same class equal."""
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

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the hash: that of a text is another in every process."""
        return {name: value for name, value in self.__dict__.items() if name != "_hash"}

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable: {name} cannot be set")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable: {name} cannot be deleted")
