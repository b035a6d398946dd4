"""Scenes from right-hand sides written in Python, by running them once on symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter
from typing import TYPE_CHECKING, Any

from integrators.core.arguments import FAILURES, items, parameters_of, required
from integrators.core.errors import IntegratorError, shown
from integrators.scenes.model.blocks import TIME, read_blocks
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    from inspect import Parameter

    import sympy


def scene_from_function(
    function: Callable[..., Any], y0: Sequence[Any], *, variables: Mapping[str, Any] | None = None,
    hamiltonian: bool = False, name: str | None = None,
) -> Scene:  # fmt: skip
    """The scene of a right-hand side ``f(t, y)`` or ``f(y)``, or of a Hamiltonian ``H(p, q)``, written in Python.

    The function is called once with symbols in place of numbers; what it returns becomes the formulas of the scene. It
    may use arithmetic, NumPy's elementary functions, roots, sums, dot products and norms, ``np.abs``, ``np.sign``,
    ``np.minimum``, ``np.maximum``, ``np.where`` with inequalities, ``scipy.special.erf``, loops and indices; it must
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
    import sympy

    from integrators.scenes.traced import Formula, FormulaArray

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
    symbols = np.array([Formula(sympy.Symbol(name)) for name in names], dtype=object).view(FormulaArray)
    if hamiltonian:
        if required(_signature(function)) != 2:
            raise IntegratorError("function must take the momenta p and the positions q where hamiltonian is true")
        arguments = [symbols[block.offset : block.end] for block in blocks if block.name != TIME]
    else:
        arguments = [symbols] if _required(function) == 1 else [Formula(sympy.Symbol(TIME)), symbols]
    parameters = _parameters(function, len(arguments))
    found = _called(function, arguments, {key: Formula(sympy.Symbol(key)) for key in parameters})
    if hamiltonian:
        value = found.item() if getattr(found, "size", 0) == 1 else found  # of p**2/2, where p is an array of one
        formulas: dict[str, Any] = {"hamiltonian": _formula(value, "function")}
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
    count = required(_signature(function))
    if count not in (1, 2):
        raise IntegratorError(f"function must take y, or t and y, but took {count} arguments without defaults")
    return count


def _signature(function: Callable[..., Any]) -> list[Parameter]:
    found = parameters_of(function)
    if found is None:
        raise IntegratorError("function must be one of Python, with named arguments, but was not")
    return found


def _parameters(function: Callable[..., Any], used: int) -> dict[str, Any]:
    """Arguments with numbers as defaults, after the first `used` ones."""
    from integrators.scenes.traced import exact_number

    given = {p.name: exact_number(p.default) for p in _signature(function)[used:]}
    return {key: value for key, value in given.items() if value is not None}


def _called(function: Callable[..., Any], arguments: Sequence[Any], parameters: Mapping[str, Any]) -> Any:
    """The function's result on symbols."""
    try:
        return function(*arguments, **parameters)
    except FAILURES as error:
        if isinstance(error, IntegratorError):
            raise
        text = str(error)
        hint = ""
        if "real number" in text or "float" in text:
            hint = "; use NumPy's functions, and np.zeros_like(y) or a list for the result"
        raise IntegratorError(f"function must run on symbols, but failed: {text}{hint}") from error


def _formula(value: Any, what: str) -> sympy.Expr:
    """A result of the function as a formula."""
    from integrators.scenes.traced import operand

    found = operand(value)
    if found is None:
        raise IntegratorError(f"{what} must be a formula or a number, but was {shown(value)}")
    return found
