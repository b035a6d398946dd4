"""What the machine code of a function of the user depends on: its text, and the values that numba freezes in it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from hashlib import sha256
from types import CodeType, FunctionType, ModuleType


def function_key(function: Callable[..., object]) -> Hashable:
    """A key that is equal for functions with the same text and the same frozen values.

    These are the values in closures, of defaults, of global names, and of the attributes of modules. Where one cannot
    be pickled, the key is the function itself.

    Example:
        >>> def power(n):
        ...     return lambda t, y: y[0]**n
        >>> function_key(power(2)) == function_key(power(2)), function_key(power(2)) == function_key(power(3))
        (True, False)
    """
    from numba import cloudpickle

    plain: FunctionType = getattr(function, "py_func", function)  # of one that numba has compiled, with these options
    try:
        codes = list(_codes(plain.__code__.replace(co_filename="", co_firstlineno=1)))
        cells = [cell.cell_contents for cell in plain.__closure__ or ()]
        names = sorted({name for code in codes for name in code.co_names})
        frozen = {name: plain.__globals__[name] for name in names if name in plain.__globals__}
        modules = [value for value in (*frozen.values(), *cells) if isinstance(value, ModuleType)]
        for module in modules:
            found = {f"{module.__name__}.{name}": vars(module)[name] for name in names if name in vars(module)}
            modules += [x for key, x in found.items() if isinstance(x, ModuleType) and key not in frozen]
            frozen |= found
        options = getattr(function, "targetoptions", None)
        content = codes[0], cells, plain.__defaults__, plain.__kwdefaults__, frozen, options
        return sha256(cloudpickle.dumps(content)).digest()
    except Exception:  # objects of the user may raise anything
        return function


def _codes(code: CodeType) -> Iterator[CodeType]:
    """The code of a function, and of all functions in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)
