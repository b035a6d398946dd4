"""Fields of plain steps: a function for each part, its derivative, and its flow."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten
from integrators.reference.plain_arithmetic import add, size

if TYPE_CHECKING:
    from integrators.reference.plain_arithmetic import Arithmetic, Vector

    Function = Callable[..., Any]
    ByPart = Function | Mapping[str, Function] | Sequence[Function]

COMPLEX_STEP = 1e-50


def block_parts(function: Function, blocks: Mapping[str, Iterable[int]]) -> dict[str, Function]:
    """Split a field, or its derivative, into parts by blocks of variables.

    Args:
        function: The whole field y ↦ f(y), or its derivative (y, v) ↦ f′(y)v.
        blocks: The indices of the components of each part, from 0, by name of part.

    Returns:
        For each part the function that is zero outside its block.

    Raises:
        IntegratorError: The blocks do not hold the indices 0, 1, … once each.

    Example:
        >>> parts = block_parts(lambda y: [-y[1], y[0]], {"p": [0], "q": [1]})
        >>> parts["p"]([3, 4]), parts["q"]([3, 4])
        ([-4, 0], [0, 3])
    """
    if not callable(function) or not isinstance(blocks, Mapping):
        raise IntegratorError(f"blocks must map parts to components, but was {shorten(repr(blocks))}")
    numbers = {name: items(block, f"blocks[{name}]") for name, block in blocks.items()}
    together = [i for block in numbers.values() for i in block]
    if not all(isinstance(i, int) for i in together) or sorted(together) != list(range(len(together))):
        raise IntegratorError(f"blocks must hold 0, 1, … once each, but were {shorten(repr(numbers))}")

    def part(block: list[int]) -> Function:
        def restricted(*arguments: Any) -> list[Any]:
            values = items(function(*arguments), "field")
            if len(values) != len(together):
                raise IntegratorError(f"blocks must hold {len(values)} components, but held {len(together)}")
            return [x if i in block else 0 for i, x in enumerate(values)]

        return restricted

    return {name: part(block) for name, block in numbers.items()}


def read_functions(given: Any, names: Sequence[str], argument: str, *, partial: bool = False) -> list[Function | None]:
    """A function for each part, in their order, from a mapping, a sequence, or a single function.

    Args:
        given: The argument of the user.
        names: The names of the parts.
        argument: The name of the argument in messages.
        partial: Whether parts may be left out; they give None.

    Raises:
        IntegratorError: A function is missing, is not callable, or belongs to no part.
    """
    if given is None and partial:
        return [None] * len(names)
    wanted = f"a function for each of the parts {', '.join(names)}" if len(names) > 1 else "a function"
    if callable(given) and len(names) == 1:
        return [given]
    if isinstance(given, Mapping):
        for name in given:
            if name not in names:
                raise IntegratorError(f"{argument} must be {wanted}, but has one for {shorten(repr(name))}")
        functions = [given.get(name) for name in names]
    elif isinstance(given, Sequence) and not isinstance(given, str) and len(given) == len(names):
        functions = list(given)
    else:
        hint = "; block_parts makes them from one" if callable(given) else ""
        raise IntegratorError(f"{argument} must be {wanted}, but was {shorten(repr(given))}{hint}")
    for name, function in zip(names, functions, strict=True):
        if not (callable(function) or (partial and function is None)):
            raise IntegratorError(f"{argument} must be {wanted}, but for {name} was {shorten(repr(function))}")
    return functions


class Fields:
    """The parts of a field, as functions of vectors."""

    def __init__(
        self,
        arithmetic: Arithmetic,
        names: Sequence[str],
        field: ByPart,
        derivative: ByPart | None,
        flows: ByPart | None,
        dimension: int,
    ) -> None:
        self._arithmetic = arithmetic
        self._dimension = dimension
        self._fields = read_functions(field, names, "field")
        self._derivatives = read_functions(derivative, names, "derivative", partial=True)
        self._flows = read_functions(flows, names, "flows", partial=True)

    def _parts(self, part: int | None) -> Iterable[int]:
        return range(len(self._fields)) if part is None else (part,)

    def value(self, part: int | None, y: Vector) -> Vector:
        """f^[part](y); the sum of all parts if None."""
        return add([self._call(self._fields[number], "field", y) for number in self._parts(part)])

    def derivative(self, part: int | None, y: Vector, v: Vector) -> Vector:
        """(f^[part])′(y) v."""
        values = []
        for number in self._parts(part):
            function = self._derivatives[number]
            if function is None:
                values.append(self._difference(number, y, v))
            else:
                values.append(self._call(function, "derivative", y, v))
        return add(values)

    def exact_flow(self, part: int | None, y: Vector, time: Any) -> Vector | None:
        """The flow of a part, if the user gave it."""
        function: Any = None if part is None else self._flows[part]
        return None if function is None else self._call(lambda y: function(y, time), "flows", y)

    def _call(self, function: Any, argument: str, *vectors: Vector) -> Vector:
        """The value of a function of the user; arithmetic errors give NaN."""
        try:
            return self._arithmetic.received(function(*(v.copy() for v in vectors)), self._dimension, argument)
        except ArithmeticError:
            return self._arithmetic.vector([float("nan")] * self._dimension)

    def _difference(self, number: int, y: Vector, v: Vector) -> Vector:
        """The derivative along v, computed numerically in two ways that must agree."""
        length = size(v)
        if length == 0:
            return v * 0
        direction = v / length
        rule = self._complex_step if self._arithmetic.digits is None else self._central_differences
        found, check, tolerance = rule(number, y, direction)
        if self._arithmetic.is_finite(found, check) and size(found - check) > tolerance:
            raise IntegratorError(
                "derivative must be given for this field: two ways of computing it numerically do not agree"
            )
        return found * length

    def _complex_step(self, number: int, y: Vector, v: Vector) -> tuple[Vector, Vector, Any]:
        """Im f(y + iεv) / ε: without cancellation, so a tiny ε leaves rounding errors only.

        Wrong for fields that are not analytic, or drop imaginary parts: hence the check by a difference.
        """
        function: Any = self._fields[number]
        try:
            values = [complex(x).imag / COMPLEX_STEP for x in function(y + 1j * COMPLEX_STEP * v)]
        except Exception as error:  # a field not made for complex numbers may raise anything
            raise IntegratorError(
                f"derivative must be given, as field does not take complex numbers: {shorten(str(error))}"
            ) from None
        found = self._arithmetic.received(values, self._dimension, "field")
        width = 1e-5 * max(1.0, size(y))
        check = self._central_difference(number, y, v, width)
        return found, check, 1e-4 * size(found) + 1e-12 * size(self._call(function, "field", y)) / width

    def _central_difference(self, number: int, y: Vector, v: Vector, width: Any) -> Vector:
        ends = [self._call(self._fields[number], "field", y + v * (sign * width)) for sign in (1, -1)]
        return (ends[0] - ends[1]) / (2 * width)

    def _central_differences(self, number: int, y: Vector, v: Vector) -> tuple[Vector, Vector, Any]:
        """(f(y + εv) − f(y − εv)) / 2ε with twice the digits: ε = 10^−(⅔ digits) gives far more digits than needed.

        Not all functions of mpmath accept complex numbers, but all accept more digits. Fields that ignore them would
        give noise: hence the check by another ε.
        """
        import mpmath

        arithmetic = self._arithmetic
        with arithmetic.working(2):
            found, check = (
                self._central_difference(number, y, v, mpmath.mpf(10) ** -(arithmetic.decimals * 2 // k))
                for k in (3, 4)
            )
        return found, check, (1 + size(found)) * arithmetic.rounding**0.75
