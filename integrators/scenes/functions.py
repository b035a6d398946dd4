"""Scenes from right-hand sides written in Python: formulas if they run on symbols, else compiled functions."""

from __future__ import annotations

import dis
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from inspect import Parameter
from typing import Any, NamedTuple, NoReturn

import numpy as np
import sympy

from bseries_base.errors import shorten, shown
from integrators.core.arguments import items, parameters_of, required, without_axes
from integrators.core.errors import IntegratorError
from integrators.exact.arithmetic import in_sympy
from integrators.exact.branches import Absolute, Sign, compare, extreme
from integrators.scenes.model.black_boxes import BoxArgument
from integrators.scenes.model.blocks import TIME, Block, read_blocks
from integrators.scenes.scene import Scene


def scene_from_function(
    function: Callable[..., object] | Mapping[str, Callable[..., object]], y0: Sequence[object], *,
    variables: Mapping[str, object] | None = None, hamiltonian: bool = False, compiled: bool | None = None,
    jacobian: Callable[..., object] | None = None, name: str | None = None,
) -> Scene:  # fmt: skip
    """The scene of a right-hand side ``f(t, y)`` or ``f(y)``, or of a Hamiltonian ``H(p, q)``, written in Python.

    The function is called once with symbols in place of numbers; what it returns becomes the formulas of the scene. It
    may use arithmetic, NumPy's elementary functions, roots, sums, dot products and norms, ``np.abs``, ``np.sign``,
    ``np.minimum``, ``np.maximum``, ``np.where`` with inequalities, ``scipy.special.erf``, loops and indices; it must
    not look at values. `y` is an array. Arguments with numbers as defaults become parameters of the scene. Floats stand
    for the decimals that they print as.

    A right-hand side that does not run on symbols, because it branches, iterates or reads a table, is compiled by
    numba. Its scene can be integrated by every method that needs values of the field only, and measured; it has no
    modified equation, and nothing else that needs derivatives. The summary of the scene says so. Numba freezes the
    values of closures and global names, and does not check indices. Two such scenes are equal if their functions are
    the same object; they cannot be written to files.

    Args:
        function: The function; a right-hand side returns as many values as there are variables, best as a tuple. Or a
            function for each block of `variables`, whose arguments are named as the blocks that it depends on, for
            methods that treat blocks differently: ``{"v": force, "x": velocity}`` with ``force(x)``, ``velocity(v)``.
        y0: The start, one number for each variable: numbers, fractions or text. For a Hamiltonian first p, then q.
        variables: The blocks of the state, as for `Scene`; by default one block y, for a Hamiltonian p and q.
        hamiltonian: Whether the function is a Hamiltonian of the blocks p and q.
        compiled: Whether numba compiles the function (True), or it must run on symbols (False); by default the latter
            is tried first.
        jacobian: The derivatives of a compiled right-hand side, (n, n) with ∂f_i/∂y_k in row i, of the same arguments,
            for methods that need them.
        name: The name of the scene; by default that of the function.

    Raises:
        IntegratorError: The function neither runs on symbols nor compiles, fails at the start, or returns something
            else.

    Example:
        >>> import bseries as bs
        >>> import numpy as np
        >>> def pendulum(t, y, g=9.81):
        ...     angle, speed = y
        ...     return [speed, -g * np.sin(angle)]
        >>> bs.scene_from_function(pendulum, [1, 0]).field
        (y2, -981*sin(y1)/100)
        >>> def kepler(p, q):
        ...     return p @ p / 2 - 1 / np.linalg.norm(q)
        >>> bs.scene_from_function(kepler, [0, 2, "2/5", 0], hamiltonian=True).hamiltonian
        p1**2/2 + p2**2/2 - 1/sqrt(q1**2 + q2**2)
        >>> def bouncing(t, y, k=100.0):
        ...     height, speed = y
        ...     return speed, -1.0 if height > 0 else -k * height - 1.0
        >>> bs.scene_from_function(bouncing, [1, 0]).notes
        ('the compiled function bouncing has values, but neither formulas nor derivatives',)
    """
    start = items(y0, "y0")
    blocks = _blocks(function, start, variables, hamiltonian)
    _check_options(function, hamiltonian, compiled, jacobian)
    reasons: list[str] = []
    parameters: dict[str, Fraction] = {}
    if hamiltonian:
        signature = _signature(function)
        if required(signature) != 2:
            raise IntegratorError("function must take the momenta p and the positions q where hamiltonian is true")
        names = [block.variables for block in blocks if block.name != TIME]
        arguments = {p.name: value for p, value in zip(signature, names, strict=False)}
        parameters = _parameters(signature[2:])
        value = _called(_Call(function, arguments, parameters, ()))
        value = value.item() if getattr(value, "size", 0) == 1 else value  # p**2/2 is an array if p is one
        formulas: dict[str, Any] = {"hamiltonian": _formula(value, "function")}
    else:
        field: dict[str, sympy.Expr] = {}
        for call in _calls(function, blocks):
            field |= _derivatives(call, compiled, jacobian, reasons)
            parameters |= call.parameters
        formulas = {"field": field}
    label = name if name is not None else getattr(function, "__name__", "<lambda>")
    made = Scene(
        {block.name: block.size for block in blocks}, **formulas, parameters=parameters,
        name=None if label == "<lambda>" else label, summary="; ".join(reasons) or None,
        start={block.name: start[block.offset : block.end] for block in blocks},
    )  # fmt: skip
    if reasons:
        from integrators.compile.black_boxes import check_start

        check_start(made)
    return made


def _blocks(function: object, start: Sequence[object], variables: object, hamiltonian: bool) -> tuple[Block, ...]:
    """The blocks of the state, with as many variables as there are start values."""
    if variables is None:
        if isinstance(function, Mapping):
            raise IntegratorError("variables must be given for functions of blocks, but were not")
        half, odd = divmod(len(start), 2)
        if hamiltonian and odd:
            raise IntegratorError(f"y0 must hold as many momenta as positions, but held {len(start)} numbers")
        variables = {"p": half, "q": half} if hamiltonian else {"y": len(start)}
    blocks = read_blocks(variables, "variables")
    size = sum(block.dimension for block in blocks)
    if size != len(start):
        raise IntegratorError(f"y0 must hold {size} numbers, one for each variable, but held {len(start)}")
    return blocks


def _check_options(function: object, hamiltonian: bool, compiled: object, jacobian: object) -> None:
    """Refuse options that do not go together."""
    for one in function.values() if isinstance(function, Mapping) else [function]:
        if not callable(one):
            raise IntegratorError(f"function must be a function such as f(t, y), but was {shown(one)}")
    if compiled not in (None, True, False):
        raise IntegratorError(f"compiled must be True, False or None, but was {shown(compiled)}")
    if hamiltonian and (isinstance(function, Mapping) or compiled or jacobian is not None):
        raise IntegratorError("function must run on symbols where hamiltonian is true, as the field has derivatives")
    if jacobian is not None and (isinstance(function, Mapping) or not callable(jacobian)):
        raise IntegratorError(f"jacobian must be a function, of a single right-hand side, but was {shown(jacobian)}")


class _Call(NamedTuple):
    """A call of a function: its arguments as blocks of the state, or None for the time, and the names of its values."""

    function: Any
    arguments: Mapping[str, Sequence[str] | None]
    parameters: dict[str, Fraction]
    values: Sequence[str]

    @property
    def plain(self) -> Callable[..., Any]:
        """The Python function, even if numba has compiled it."""
        return getattr(self.function, "py_func", self.function)


def _calls(function: object, blocks: Sequence[Block]) -> Iterator[_Call]:
    """The calls whose values make up the field."""
    if not isinstance(function, Mapping):
        signature = _signature(function)
        count = required(signature)
        if count not in (1, 2):
            raise IntegratorError(f"function must take y, or t and y, but took {count} arguments without defaults")
        names = [variable for block in blocks for variable in block.variables]
        given = [names] if count == 1 else [None, names]
        arguments = {p.name: value for p, value in zip(signature, given, strict=False)}
        yield _Call(function, arguments, _parameters(signature[count:]), names)
        return
    known = {block.name: block.variables for block in blocks}
    if set(function) != set(known):
        given = shorten(", ".join(map(str, function)))
        raise IntegratorError(f"function must have one for each block of {', '.join(known)}, but had {given}")
    for name, one in function.items():
        signature = _signature(one)
        count = required(signature)
        arguments = {p.name: None if p.name == TIME else known.get(p.name, ()) for p in signature[:count]}
        if () in arguments.values():
            unknown = next(key for key, value in arguments.items() if value == ())
            raise IntegratorError(
                f"function of {name} must take blocks of {', '.join(known)} or the time t, but takes {unknown}"
            )
        yield _Call(one, arguments, _parameters(signature[count:]), known[name])


def _signature(function: Any) -> list[Parameter]:
    """The arguments of a function, also of one that numba has compiled."""
    found = parameters_of(getattr(function, "py_func", function))
    if found is None:
        raise IntegratorError("function must be one of Python, with named arguments, but was not")
    return found


def _parameters(signature: Sequence[Parameter]) -> dict[str, Fraction]:
    """Arguments with numbers as defaults."""
    given = {p.name: exact_number(p.default) for p in signature}
    return {key: value for key, value in given.items() if value is not None}


def _derivatives(call: _Call, compiled: bool | None, jacobian: object, reasons: list[str]) -> dict[str, sympy.Expr]:
    """The formulas of a right-hand side. If it is compiled instead, the reason is appended to `reasons`."""
    refused = ""
    if compiled is not True:
        try:
            found = _called(call)
        except IntegratorError as error:
            if compiled is False:
                raise
            refused = str(error)
        else:
            values = np.ravel(np.array(found, dtype=object)) if found is not None else []
            if len(values) != len(call.values):
                what = f"{len(call.values)} derivatives, one for each variable"
                raise IntegratorError(f"function must return {what}, but returned {shown(found)}")
            pairs = zip(call.values, values, strict=True)
            return {key: _formula(value, f"derivative of {key}") for key, value in pairs}
    try:
        entries = _compiled_entries(call, jacobian)
    except IntegratorError as error:
        if refused:
            raise IntegratorError(f"{error}; without numba, {refused}") from error
        raise
    reasons.append(f"no formulas, since {refused}" if refused else "compiled on request")
    return dict(zip(call.values, entries, strict=True))


def _called(call: _Call) -> Any:
    """The function's result on symbols."""

    def symbols(names: Sequence[str] | None) -> Formula | np.ndarray:
        if names is None:
            return Formula(sympy.Symbol(TIME))
        return np.array([Formula(sympy.Symbol(name)) for name in names], dtype=object).view(FormulaArray)

    try:
        parameters = {key: Formula(sympy.Symbol(key)) for key in call.parameters}
        return call.plain(*map(symbols, call.arguments.values()), **parameters)
    except IntegratorError:
        raise
    except Exception as error:  # functions of the user may raise any
        text = shorten(str(error) or type(error).__name__, 300)
        hint = ""
        if "real number" in text or "float" in text:
            hint = "; use NumPy's functions, and np.zeros_like(y) or a list for the result"
        raise IntegratorError(f"function must run on symbols, but failed: {text}{hint}") from error


def _compiled_entries(call: _Call, jacobian: Any) -> list[sympy.Expr]:
    """The derivatives of a compiled function, as entries of a black box."""
    from integrators.compile.black_boxes import black_box

    box_arguments: list[BoxArgument] = []
    symbols: list[sympy.Expr] = []
    for name, names in call.arguments.items():
        box_arguments.append(BoxArgument("", len(names or ())))
        if names is not None:
            symbols += map(sympy.Symbol, names)
        else:  # a time that the function does not read must not become a variable
            symbols.append(sympy.Symbol(TIME) if _reads(call.plain, name) else sympy.Integer(0))
    box_arguments += [BoxArgument(key, 0) for key in call.parameters]
    symbols += map(sympy.Symbol, call.parameters)
    name, n = getattr(call.plain, "__name__", "function"), len(call.values)
    derivative = None if jacobian is None else black_box(jacobian, "jacobian", box_arguments, (n, n))
    return black_box(call.function, name, box_arguments, (n,), derivative).entries(symbols)


def _reads(function: object, argument: str) -> bool:
    """Whether the code of a function reads an argument."""
    code = getattr(function, "__code__", None)
    if code is None or argument in code.co_cellvars:
        return True
    names = (x.argval for x in dis.get_instructions(code) if x.opname.startswith("LOAD_FAST"))
    return any(argument in (name if isinstance(name, tuple) else (name,)) for name in names)


def _formula(value: object, what: str) -> sympy.Expr:
    """A result of the function as a formula."""
    found = operand(value)
    if found is None:
        raise IntegratorError(f"{what} must be a formula or a number, but was {shown(value)}")
    return found


METHODS = {
    **{name: name for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "cbrt")},
    **{f"arc{name}": f"a{name}" for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
}
"""NumPy's functions that call methods of objects, and SymPy's names for them."""


def exact_number(value: Any) -> Fraction | None:
    """A number as a Fraction, a float as the decimal that it prints as; None for anything else."""
    value = without_axes(value)
    if isinstance(value, bool) or not isinstance(value, int | float | Fraction):
        return None
    try:
        return Fraction(repr(value)) if isinstance(value, float) else Fraction(value)
    except ValueError:
        raise IntegratorError(f"numbers in function must be finite, but one was {value}") from None


def operand(value: object) -> sympy.Expr | None:
    """A formula or a number as a SymPy expression; None for anything else."""
    value = without_axes(value)
    if isinstance(value, Formula):
        return value.expression
    if isinstance(value, sympy.Expr):
        return value
    number = exact_number(value)
    return None if number is None else in_sympy(number)


def traced(function: Callable[..., sympy.Expr]) -> Callable[..., Formula]:
    """A function of SymPy expressions as a function of formulas and numbers."""

    def apply(*values: object) -> Formula:
        found = [operand(value) for value in values]
        if any(value is None for value in found):
            raise TypeError(f"{function.__name__} takes formulas and numbers")
        return Formula(function(*found))

    return apply


class Condition:
    """An inequality, by which `np.where` chooses."""

    def __init__(self, choose: Callable[[object, object], object]):
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

    def __array_function__(self, function: object, types: object, values: Sequence[object], options: object) -> Any:
        return where(*values) if function is np.where and len(values) == 3 and not options else NotImplemented


def _compared(relation: str) -> Callable[[object, object], Condition]:
    def comparison(left: object, right: object) -> Condition:
        x, y = operand(left), operand(right)
        if x is None or y is None:
            raise TypeError("comparisons take formulas and numbers")
        return Condition(traced(lambda a, b: compare(x, relation, y, a, b)))

    return comparison


def _choice(condition: object, a: object, b: object) -> object:
    return condition.choose(a, b) if isinstance(condition, Condition) else a if condition else b


def where(condition: object, a: object, b: object) -> Any:
    """`np.where` on conditions, formulas and numbers, or arrays of them."""
    return _elementwise(_choice, (condition, a, b))


def _elementwise(function: Callable[..., object], values: Sequence[object]) -> Any:
    found = np.frompyfunc(function, len(values), 1)(*(np.asarray(value, dtype=object) for value in values))
    return found.view(FormulaArray) if isinstance(found, np.ndarray) else found


ELEMENTWISE: dict[str, Callable[..., object]] = {
    "sign": traced(Sign),
    "erf": traced(sympy.erf),
    "heaviside": traced(lambda x, at_zero: compare(x, ">", 0, 1, compare(x, "<", 0, 0, at_zero))),
    **dict.fromkeys(("absolute", "fabs"), traced(Absolute)),
    **dict.fromkeys(("maximum", "fmax"), traced(lambda x, y: extreme("max", [x, y]))),
    **dict.fromkeys(("minimum", "fmin"), traced(lambda x, y: extreme("min", [x, y]))),
    "greater": _compared(">"),
    "less": _compared("<"),
    "greater_equal": _compared(">="),
    "less_equal": _compared("<="),
}
"""Functions of NumPy and SciPy that call no method of objects, or would look at truth values."""
REDUCED = {"maximum", "minimum", "fmax", "fmin"}


def _apply(ufunc: np.ufunc, method: str, values: Sequence[object], options: dict[str, Any]) -> Any:
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


def _is_default(option: tuple[str, object]) -> bool:
    """Whether an option of a reduction has its default value, or is the axis."""
    name, value = option
    return (
        name == "axis"
        or value in (None, (None,))
        or value is (name == "where")
        or type(value).__name__ == "_NoValueType"
    )


def _extremes(name: str, values: object, axis: Any) -> Any:
    """The least or the largest entries along an axis, or of the whole array if the axis is None."""
    array = np.asarray(values, dtype=object)
    rows = array.reshape(-1) if axis is None else np.moveaxis(array, axis, -1)
    found = np.empty(rows.shape[:-1], dtype=object)
    for place in np.ndindex(found.shape):
        found[place] = traced(lambda *row: extreme(name, row))(*rows[place])
    return found.view(FormulaArray) if found.ndim else found.item()


class FormulaArray(np.ndarray):
    """An array of formulas."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *values: object, **options: Any) -> Any:
        return _apply(ufunc, method, values, options)

    def __array_function__(self, function: Any, types: Any, values: Any, options: Any) -> Any:
        if function is np.where and len(values) == 3 and not options:
            return where(*values)
        return super().__array_function__(function, types, values, options)


class Formula:
    """An intermediate value of the function, as a SymPy expression; NumPy calls its methods."""

    __slots__ = ("expression",)

    def __init__(self, expression: sympy.Expr):
        self.expression = expression

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *values: object, **options: Any) -> Any:
        return _apply(ufunc, method, values, options)

    def _operator(operation: Callable[[Any, Any], Any]) -> Any:  # type: ignore[misc]  # of the class body
        def apply(self: Formula, other: object) -> object:
            found = operand(other)
            return NotImplemented if found is None else Formula(operation(self.expression, found))

        return apply

    __add__ = __radd__ = _operator(operator.add)
    __mul__ = __rmul__ = _operator(operator.mul)
    __sub__, __rsub__ = _operator(operator.sub), _operator(lambda a, b: b - a)
    __truediv__, __rtruediv__ = _operator(operator.truediv), _operator(lambda a, b: b / a)
    __pow__, __rpow__ = _operator(operator.pow), _operator(lambda a, b: b**a)
    __gt__, __lt__, __ge__, __le__ = (ELEMENTWISE[name] for name in ("greater", "less", "greater_equal", "less_equal"))

    def __neg__(self) -> Formula:
        return Formula(-self.expression)

    def __pos__(self) -> Formula:
        return self

    def __abs__(self) -> Formula:
        return Formula(Absolute(self.expression))

    def conjugate(self) -> Formula:
        """The formula itself: formulas are real."""
        return self

    def __getattr__(self, name: str) -> Callable[[], Formula]:
        if name not in METHODS:  # NumPy asks for many attributes
            raise AttributeError(f"formulas have {', '.join(METHODS)}, but not {name}")
        return lambda: Formula(getattr(sympy, METHODS[name])(self.expression))

    def _look(self, *_: object) -> NoReturn:
        raise IntegratorError("function must be a formula in its arguments, but it looks at their values")

    __bool__ = __eq__ = __ne__ = _look  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return str(self.expression)
