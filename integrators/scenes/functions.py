"""Scenes from right-hand sides written in Python, by running them once on symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any, NoReturn

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shown
from integrators.scenes.model.blocks import TIME, read_blocks
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import sympy

FUNCTIONS = {
    **{name: name for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "cbrt")},
    **{f"arc{name}": f"a{name}" for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
}
"""NumPy's functions and SymPy's names for them."""


def scene_from_function(
    function: Callable[..., Any], y0: Sequence[Any], *, variables: Mapping[str, Any] | None = None,
    hamiltonian: bool = False, name: str | None = None,
) -> Scene:  # fmt: skip
    """The scene of a right-hand side ``f(t, y)`` or ``f(y)``, or of a Hamiltonian ``H(p, q)``, written in Python.

    The function is called once with symbols in place of numbers; what it returns becomes the formulas of the scene. It
    may use arithmetic, NumPy's elementary functions, roots, sums, dot products and norms, loops and indices; it must
    not look at values. `y` is an array. Arguments with numbers as defaults become parameters of the scene. Floats are
    the decimals that they print as.

    Args:
        function: The function; a right-hand side returns as many values as there are variables.
        y0: The start, one number for each variable: numbers, fractions or text. For a Hamiltonian first p, then q.
        variables: The blocks of the state, as for `Scene`; by default one block y, for a Hamiltonian p and q.
        hamiltonian: Whether the function is a Hamiltonian of the blocks p and q.
        name: The name of the scene; by default that of the function.

    Returns:
        The scene.

    Raises:
        IntegratorError: The function fails on symbols, or returns something else.

    Example:
        >>> import numpy as np
        >>> def pendulum(t, y, g=9.81):
        ...     angle, speed = y
        ...     return [speed, -g * np.sin(angle)]
        >>> scene_from_function(pendulum, [1, 0]).field
        (y2, -981*sin(y1)/100)
        >>> def kepler(p, q):
        ...     return p @ p / 2 - 1 / np.linalg.norm(q)
        >>> scene_from_function(kepler, [0, 2, "2/5", 0], hamiltonian=True).hamiltonian
        p1**2/2 + p2**2/2 - 1/sqrt(q1**2 + q2**2)
    """
    import numpy as np

    if not callable(function):
        raise IntegratorError(f"function must be a function such as f(t, y), but was {shown(function)}")
    start = items(y0, "y0")
    if variables is None:
        half, odd = divmod(len(start), 2)
        if hamiltonian and odd:
            raise IntegratorError(f"y0 must hold as many momenta as positions, but held {len(start)} numbers")
        variables = {"p": half, "q": half} if hamiltonian else {"y": len(start)}
    blocks = read_blocks(variables, "variables")
    names = [variable for block in blocks for variable in block.variables]
    if len(names) != len(start):
        raise IntegratorError(f"y0 must hold {len(names)} numbers, one for each variable, but held {len(start)}")
    symbols = np.array([_symbol(name) for name in names], dtype=object)
    if hamiltonian:
        arguments = [symbols[block.offset : block.end] for block in blocks if block.name != TIME]
    else:
        arguments = [symbols] if _required(function) == 1 else [_symbol(TIME), symbols]
    parameters = _parameters(function, len(arguments))
    found = _called(function, arguments, {key: _symbol(key) for key in parameters})
    if hamiltonian:
        formulas: dict[str, Any] = {"hamiltonian": _formula(found, "function")}
    else:
        values = np.ravel(np.array(found, dtype=object)) if found is not None else []
        if len(values) != len(names):
            raise IntegratorError(
                f"function must return {len(names)} derivatives, one for each variable, but returned {shown(found)}"
            )
        pairs = zip(names, values, strict=True)
        formulas = {"field": {key: _formula(value, f"derivative of {key}") for key, value in pairs}}
    label = name if name is not None else getattr(function, "__name__", "<lambda>")
    return Scene(
        variables, **formulas, parameters=parameters, name=None if label == "<lambda>" else label,
        start={block.name: start[block.offset : block.end] for block in blocks},
    )  # fmt: skip


def _required(function: Callable[..., Any]) -> int:
    """The number of arguments without defaults."""
    count = sum(p.default is p.empty and p.kind <= Parameter.POSITIONAL_OR_KEYWORD for p in _signature(function))
    if count not in (1, 2):
        raise IntegratorError(f"function must take y, or t and y, but took {count} arguments without defaults")
    return count


def _signature(function: Callable[..., Any]) -> list[Parameter]:
    try:
        return list(signature(function).parameters.values())
    except (TypeError, ValueError):
        raise IntegratorError("function must be one of Python, with named arguments, but was not") from None


def _parameters(function: Callable[..., Any], used: int) -> dict[str, Any]:
    """Arguments with numbers as defaults, after the first `used` ones."""
    given = {p.name: p.default for p in _signature(function)[used:]}
    return {key: _exact(value) for key, value in given.items() if _exact(value) is not None}


def _called(function: Callable[..., Any], arguments: Sequence[Any], parameters: Mapping[str, Any]) -> Any:
    """The function's result on symbols."""
    try:
        return function(*arguments, **parameters)
    except (TypeError, AttributeError, ValueError) as error:
        if isinstance(error, IntegratorError):
            raise
        text = str(error)
        hint = ""
        if "real number" in text or "float" in text:
            hint = "; use NumPy's functions, and np.zeros_like(y) or a list for the result"
        raise IntegratorError(f"function must run on symbols, but failed: {text}{hint}") from error


def _exact(value: Any) -> Any:
    """A number as Python's exact one, a float as the decimal that it prints as; None for what is no number."""
    if hasattr(value, "item") and getattr(value, "shape", None) == ():
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, int | float | Fraction):
        return None
    try:
        return Fraction(repr(value)) if isinstance(value, float) else Fraction(value)
    except ValueError:
        raise IntegratorError(f"numbers in function must be finite, but one was {value}") from None


def _symbol(name: str) -> Formula:
    import sympy

    return Formula(sympy.Symbol(name))


def _formula(value: Any, what: str) -> sympy.Expr:
    """A result of the function as a formula."""
    if getattr(value, "shape", None) == ():
        value = value.item()
    found = _operand(value)
    if found is None:
        raise IntegratorError(f"{what} must be a formula or a number, but was {shown(value)}")
    return found


def _operand(value: Any) -> Any:
    """A formula, or a number as one; None for something else."""
    import sympy

    if isinstance(value, Formula):
        return value.expression
    if isinstance(value, sympy.Expr):
        return value
    number = _exact(value)
    return None if number is None else sympy.Rational(number.numerator, number.denominator)


class Formula:
    """A number that the function computes, as a SymPy expression; NumPy calls its methods."""

    __slots__ = ("expression",)

    def __init__(self, expression: sympy.Expr):
        self.expression = expression

    def _with(self, other: Any, operation: Callable[[Any, Any], Any]) -> Any:
        found = _operand(other)
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

    def conjugate(self) -> Formula:
        """The formula itself, which is real."""
        return self

    def __getattr__(self, name: str) -> Callable[[], Formula]:
        if name not in FUNCTIONS:  # NumPy asks for many attributes
            raise AttributeError(f"formulas have {', '.join(FUNCTIONS)}, but not {name}")
        import sympy

        return lambda: Formula(getattr(sympy, FUNCTIONS[name])(self.expression))

    def _look(self, *_: Any) -> NoReturn:
        raise IntegratorError("function must be a formula in its arguments, but it looks at their values")

    __bool__ = __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = __abs__ = _look  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return str(self.expression)
