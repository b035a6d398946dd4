"""Functions that have values but no formulas, as parts of formulas.

A compiled function f of a state with n variables stands in the formulas of a scene as n entries f(…)[1], …, f(…)[n].
Formulas keep exact numbers, parameters and dependences; what needs more than values, such as a derivative, meets an
entry and is refused there. This module imports SymPy, and is itself imported where a scene has such a function.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from hashlib import sha256
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn, TypeVar
from uuid import uuid4
from weakref import WeakKeyDictionary, WeakValueDictionary

import sympy
from sympy.printing.printer import Printer

from bseries_base.machine_code import Compiled
from integrators.core.errors import IntegratorError

T = TypeVar("T")

_KEYS: WeakKeyDictionary[object, str] = WeakKeyDictionary()
_BOXES: WeakValueDictionary[str, BlackBox] = WeakValueDictionary()


class BoxArgument(NamedTuple):
    """An argument of a function: its keyword, empty for one by position, and the length of an array, 0 for a number."""

    keyword: str
    length: int


class BlackBox(sympy.Atom):
    """A function compiled by numba, as a constant in formulas.

    Two are equal if they are the same function of numba, called with the same arguments. Functions of the user with the
    same text and the same frozen values share one, see `integrators.compile.function_keys`.
    """

    function: Compiled  # the function, as a dispatcher of numba
    name: str  # its name in messages
    arguments: tuple[BoxArgument, ...]
    shape: tuple[int, ...]  # the shape of its value, (n,) or (n, n)
    key: str  # the name of all this in generated code; no two processes use the same
    jacobian: BlackBox | None  # the function of its derivatives ∂f_i/∂y_k by its array argument, or None

    def __new__(  # noqa: D102
        cls, function: object, name: str, arguments: Iterable[BoxArgument], shape: Sequence[int],
        jacobian: BlackBox | None = None, function_key: str | None = None,
    ) -> BlackBox:  # fmt: skip
        arguments, shape = tuple(arguments), tuple(shape)
        function_key = _KEYS.setdefault(function, function_key or uuid4().hex)
        text = repr((function_key, name, arguments, shape, jacobian and jacobian.key))
        key = sha256(text.encode()).hexdigest()[:16]
        known = _BOXES.get(key)
        if known is None:
            known = _BOXES[key] = super().__new__(cls)
            known.__dict__.update(
                function=function, name=name, arguments=arguments, shape=shape, key=key, jacobian=jacobian
            )
        return known

    def __reduce_ex__(self, protocol: object) -> tuple[object, ...]:
        # numba pickles its functions by value; the key keeps copies equal
        return BlackBox, (
            self.function, self.name, self.arguments, self.shape, self.jacobian, _KEYS[self.function],
        )  # fmt: skip

    def _hashable_content(self) -> tuple[Any, ...]:
        return (self.key,)

    def _sympystr(self, printer: object) -> str:
        return self.name

    @property
    def size(self) -> int:
        """The number of values."""
        return prod(self.shape)

    @property
    def total(self) -> int:
        """The number of values that it takes and gives."""
        return self.inputs + self.size

    @property
    def inputs(self) -> int:
        """The number of values that it takes."""
        return sum(max(1, argument.length) for argument in self.arguments)

    def bound(self, read: Callable[[int, int], T]) -> tuple[list[T], dict[str, T]]:
        """The arguments by position, and those by keyword; `read` gives one from its place and length."""
        given, named, place = list[T](), dict[str, T](), 0
        for keyword, length in self.arguments:
            value = read(place, length)
            if keyword:
                named[keyword] = value
            else:
                given.append(value)
            place += max(1, length)
        return given, named

    def entries(self, values: Sequence[object]) -> list[sympy.Expr]:
        """All entries of its value at formulas or numbers, one for each that it takes."""
        return [Entry(self, sympy.Integer(k), *values) for k in range(self.size)]


def refuse(entry: Entry, need: str) -> NoReturn:
    """Refuse what a compiled function does not have."""
    raise IntegratorError(
        f"scene must be given by formulas for {need}, but {entry.args[0].name!r} is a compiled function"
    )


class Entry(sympy.Function):
    """One entry of the value of a black box: Entry(box, k, *values)."""

    is_real = True
    if TYPE_CHECKING:
        args: tuple[Any, ...]  # type: ignore[override]

        def __new__(cls, *args: object) -> Entry: ...  # noqa: D102

    def _eval_derivative(self, s: object) -> sympy.Expr:
        """The derivative by the chain rule, from entries of the Jacobian."""
        box, k, *values = self.args
        total: sympy.Expr = sympy.Integer(0)
        inner = [value.diff(s) for value in values]
        place, column, columns = 0, 0, sum(argument.length for argument in box.arguments)
        for _, length in box.arguments:
            for _ in range(max(1, length)):
                if inner[place] != 0:
                    if box.jacobian is None or not length:
                        refuse(self, "derivatives of its field")
                    total += Entry(box.jacobian, k * columns + column, *values) * inner[place]
                place, column = place + 1, column + bool(length)
        return total

    def _sympystr(self, printer: Printer) -> str:
        box, k, *values = self.args
        return f"{box.name}({', '.join(map(printer.doprint, values))})[{k + 1}]"

    def _latex(self, printer: Printer, exp: str | None = None) -> str:
        box, k, *values = self.args
        text = rf"\mathrm{{{box.name}}}_{{{k + 1}}}\left({', '.join(map(printer.doprint, values))}\right)"
        return text if exp is None else rf"{text}^{{{exp}}}"

    def _pythoncode(self, printer: object) -> NoReturn:
        refuse(self, "other arithmetic than doubles")

    _mpmathcode = _numpycode = _pythoncode


def check_formulas(formulas: Iterable[sympy.Expr], need: str) -> None:
    """Refuse entries of black boxes."""
    for formula in formulas:
        for entry in formula.atoms(Entry):
            refuse(entry, need)


def box_of(key: str) -> BlackBox:
    """The black box with a key in generated code."""
    return _BOXES[key]
