"""Values that are computed once for an object, and forgotten with it."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


def remembered(function: Function) -> Function:
    """A function that keeps its results in its first argument; `functools.cache` would keep that, too, for ever.

    Args:
        function: A method, or a function of an object and hashable positional arguments.

    Example:
        >>> class Squares:
        ...     @remembered
        ...     def of(self, x):
        ...         print("computing", x)
        ...         return x * x
        >>> squares = Squares()
        >>> squares.of(3), squares.of(3)
        computing 3
        (9, 9)
    """
    name = f"_remembered_{function.__name__}"

    @wraps(function)
    def known(owner: Any, *arguments: Any) -> Any:
        values = owner.__dict__.setdefault(name, {})
        if arguments not in values:
            values[arguments] = function(owner, *arguments)
        return values[arguments]

    return cast(Function, known)
