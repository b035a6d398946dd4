"""Numbers and arrays that a Python function computes with while it is traced: formulas in place of values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NoReturn

import numpy as np
import sympy

from integrators.core.errors import IntegratorError
from integrators.exact.branches import Absolute, Sign, compare, extreme

METHODS = {
    **{name: name for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "cbrt")},
    **{f"arc{name}": f"a{name}" for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
}
"""NumPy's functions that call methods of objects, and SymPy's names for them."""


def exact_number(value: Any) -> Any:
    """A number as Python's exact one, a float as the decimal that it prints as; None for what is no number."""
    if hasattr(value, "item") and getattr(value, "shape", None) == ():
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, int | float | Fraction):
        return None
    try:
        return Fraction(repr(value)) if isinstance(value, float) else Fraction(value)
    except ValueError:
        raise IntegratorError(f"numbers in function must be finite, but one was {value}") from None


def operand(value: Any) -> Any:
    """A formula, or a number as one; None for something else."""
    if isinstance(value, np.ndarray) and value.shape == ():
        value = value.item()
    if isinstance(value, Formula):
        return value.expression
    if isinstance(value, sympy.Expr):
        return value
    number = exact_number(value)
    return None if number is None else sympy.Rational(number.numerator, number.denominator)


def traced(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of SymPy expressions as one of formulas and numbers."""

    def apply(*values: Any) -> Formula:
        found = [operand(value) for value in values]
        if any(value is None for value in found):
            raise TypeError(f"{function.__name__} takes formulas and numbers")
        return Formula(function(*found))

    return apply


def heaviside(x: Any, at_zero: Any) -> Any:
    """0 below zero, 1 above, and `at_zero` at zero."""
    return compare(x, ">", 0, 1, compare(x, "<", 0, 0, at_zero))


class Condition:
    """An inequality, which `np.where` chooses by."""

    def __init__(self, choose: Callable[[Any, Any], Any]):
        self.choose = choose

    def __and__(self, other: Condition) -> Condition:
        return Condition(lambda a, b: self.choose(other.choose(a, b), b))

    def __or__(self, other: Condition) -> Condition:
        return Condition(lambda a, b: self.choose(a, other.choose(a, b)))

    def __invert__(self) -> Condition:
        return Condition(lambda a, b: self.choose(b, a))

    def __bool__(self) -> NoReturn:
        raise IntegratorError(
            "function must be a formula in its arguments, but it looks at their values; for a choice use np.where, "
            "np.minimum or np.maximum"
        )

    def __array_function__(self, function: Any, types: Any, values: Any, options: Any) -> Any:
        return where(*values) if function is np.where and len(values) == 3 and not options else NotImplemented


def _compared(relation: str) -> Callable[[Any, Any], Any]:
    def comparison(left: Any, right: Any) -> Condition:
        x, y = operand(left), operand(right)
        if x is None or y is None:
            raise TypeError("comparisons take formulas and numbers")
        return Condition(traced(lambda a, b: compare(x, relation, y, a, b)))

    return comparison


def _choice(condition: Any, a: Any, b: Any) -> Any:
    return condition.choose(a, b) if isinstance(condition, Condition) else a if condition else b


def where(condition: Any, a: Any, b: Any) -> Any:
    """`np.where` on conditions, formulas and numbers, or arrays of them."""
    return _elementwise(_choice, (condition, a, b))


def _elementwise(function: Callable[..., Any], values: Sequence[Any]) -> Any:
    found = np.frompyfunc(function, len(values), 1)(*(np.asarray(value, dtype=object) for value in values))
    return found.view(FormulaArray) if isinstance(found, np.ndarray) else found


ELEMENTWISE: dict[str, Callable[..., Any]] = {
    "sign": traced(Sign),
    "erf": traced(sympy.erf),
    "heaviside": traced(heaviside),
    **dict.fromkeys(("absolute", "fabs"), traced(Absolute)),
    **dict.fromkeys(("maximum", "fmax"), traced(lambda x, y: extreme("max", [x, y]))),
    **dict.fromkeys(("minimum", "fmin"), traced(lambda x, y: extreme("min", [x, y]))),
    "greater": _compared(">"),
    "less": _compared("<"),
    "greater_equal": _compared(">="),
    "less_equal": _compared("<="),
}
"""Functions of NumPy and SciPy that have no method on objects, or would look at truth values."""
REDUCED = {"maximum", "minimum", "fmax", "fmin"}


def _apply(ufunc: Any, method: str, values: Sequence[Any], options: dict[str, Any]) -> Any:
    """A universal function of NumPy or SciPy on formulas and arrays of them."""
    if ufunc.__name__ in ELEMENTWISE:
        if method == "__call__" and not options:
            return _elementwise(ELEMENTWISE[ufunc.__name__], values)
        if method == "reduce" and ufunc.__name__ in REDUCED and all(map(_is_default, options.items())):
            return _extremes("max" if "max" in ufunc.__name__ else "min", values[0], options.get("axis", 0))
    plain = [np.asarray(value, dtype=object) if isinstance(value, Formula) else np.asarray(value) for value in values]
    if "out" in options:
        options = options | {"out": tuple(map(np.asarray, options["out"]))}
    found = getattr(ufunc, method)(*plain, **options)
    return found.view(FormulaArray) if isinstance(found, np.ndarray) and found.dtype == object else found


def _is_default(option: tuple[str, Any]) -> bool:
    """Whether an option of a reduction, other than its axis, is as if it had not been given."""
    name, value = option
    return (
        name == "axis"
        or value in (None, (None,))
        or value is (name == "where")
        or type(value).__name__ == "_NoValueType"
    )


def _extremes(name: str, values: Any, axis: Any) -> Any:
    """The least or the largest entries along an axis, or of all for None."""
    array = np.asarray(values, dtype=object)
    rows = array.reshape(-1) if axis is None else np.moveaxis(array, axis, -1)
    found = np.empty(rows.shape[:-1], dtype=object)
    for place in np.ndindex(found.shape):
        found[place] = traced(lambda *row: extreme(name, row))(*rows[place])
    return found.view(FormulaArray) if found.ndim else found.item()


class FormulaArray(np.ndarray):
    """An array of formulas."""

    def __array_ufunc__(self, ufunc: Any, method: str, *values: Any, **options: Any) -> Any:
        return _apply(ufunc, method, values, options)

    def __array_function__(self, function: Any, types: Any, values: Any, options: Any) -> Any:
        if function is np.where and len(values) == 3 and not options:
            return where(*values)
        return super().__array_function__(function, types, values, options)


class Formula:
    """A number that the function computes, as a SymPy expression; NumPy calls its methods."""

    __slots__ = ("expression",)

    def __init__(self, expression: sympy.Expr):
        self.expression = expression

    def __array_ufunc__(self, ufunc: Any, method: str, *values: Any, **options: Any) -> Any:
        return _apply(ufunc, method, values, options)

    def _with(self, other: Any, operation: Callable[[Any, Any], Any]) -> Any:
        found = operand(other)
        return NotImplemented if found is None else Formula(operation(self.expression, found))

    def __add__(self, other: Any) -> Any:
        return self._with(other, lambda a, b: a + b)

    def __sub__(self, other: Any) -> Any:
        return self._with(other, lambda a, b: a - b)

    def __rsub__(self, other: Any) -> Any:
        return self._with(other, lambda a, b: b - a)

    def __mul__(self, other: Any) -> Any:
        return self._with(other, lambda a, b: a * b)

    def __truediv__(self, other: Any) -> Any:
        return self._with(other, lambda a, b: a / b)

    def __rtruediv__(self, other: Any) -> Any:
        return self._with(other, lambda a, b: b / a)

    def __pow__(self, other: Any) -> Any:
        return self._with(other, lambda a, b: a**b)

    def __rpow__(self, other: Any) -> Any:
        return self._with(other, lambda a, b: b**a)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Formula:
        return Formula(-self.expression)

    def __pos__(self) -> Formula:
        return self

    def __abs__(self) -> Formula:
        return Formula(Absolute(self.expression))

    def conjugate(self) -> Formula:
        """The formula itself, which is real."""
        return self

    def __getattr__(self, name: str) -> Callable[[], Formula]:
        if name not in METHODS:  # NumPy asks for many attributes
            raise AttributeError(f"formulas have {', '.join(METHODS)}, but not {name}")
        return lambda: Formula(getattr(sympy, METHODS[name])(self.expression))

    def __gt__(self, other: Any) -> Any:
        return ELEMENTWISE["greater"](self, other)

    def __lt__(self, other: Any) -> Any:
        return ELEMENTWISE["less"](self, other)

    def __ge__(self, other: Any) -> Any:
        return ELEMENTWISE["greater_equal"](self, other)

    def __le__(self, other: Any) -> Any:
        return ELEMENTWISE["less_equal"](self, other)

    def _look(self, *_: Any) -> NoReturn:
        raise IntegratorError("function must be a formula in its arguments, but it looks at their values")

    __bool__ = __eq__ = __ne__ = _look  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return str(self.expression)
