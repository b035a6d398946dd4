"""Formulas as functions of numbers: the one place where SymPy turns formulas into code."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from typing import TYPE_CHECKING, Any, SupportsAbs, TypeAlias

from bseries_base.errors import shorten
from integrators.core.errors import IntegratorError
from integrators.exact.arithmetic import LARGEST_NUMBER, in_sympy

if TYPE_CHECKING:
    import sympy


Function: TypeAlias = Callable[..., Any]  # of numbers, or of arrays


def as_function(symbols: Iterable[sympy.Symbol], formulas: Any, numbers: str) -> Function:
    """A function of numbers, or of arrays, that computes a formula, or a list or rows of them.

    The code is generated in names of its own, so that it does not depend on those of users: a variable ``e`` would hide
    the number e, and ``mpf`` and ``lambda`` would be no code at all.

    Args:
        symbols: The arguments.
        formulas: The formulas, in these symbols only.
        numbers: The module whose functions compute: ``"math"``, ``"mpmath"`` or ``"numpy"``.

    Raises:
        IntegratorError: A formula has another symbol. With ``"mpmath"`` the function itself raises it where a part of
            the formula is beyond 10^1000.

    Example:
        >>> import sympy
        >>> e = sympy.Symbol("e")
        >>> as_function([e], [e + sympy.exp(1), e**2], "math")(1)
        [3.718281828459045, 1]
    """
    import sympy

    known = list(symbols)
    arguments = [sympy.Symbol(f"argument_{k}") for k in range(len(known))]
    own = dict(zip(known, arguments, strict=True))

    def power(part: sympy.Basic) -> sympy.Expr:
        return sympy.Function("power")(*part.args)

    def renamed(formula: object) -> Any:
        if isinstance(formula, list | tuple):
            return list(map(renamed, formula))
        formula = in_sympy(formula)
        for other in sorted(map(str, formula.free_symbols - own.keys())):
            names = shorten(", ".join(map(str, known)))
            raise IntegratorError(f"formula must use the names {names}, but has {shorten(other)!r}")
        formula = formula.xreplace(own)
        varies = numbers == "mpmath" and (lambda part: part.is_Pow and not part.exp.is_Rational)
        return formula.replace(varies, power) if varies else formula

    modules = [_bounded(), "mpmath"] if numbers == "mpmath" else numbers
    # not lambdify's dummify: the names of a formula's symbols still hide functions and constants of the module
    return sympy.lambdify(arguments, renamed(formulas), modules, cse=True)


@cache
def _bounded() -> dict[str, Function]:
    """The functions of mpmath that take long for large numbers, refusing these."""
    import mpmath

    def bounded(function: Function) -> Function:
        def found(*numbers: SupportsAbs[float]) -> object:
            if any(abs(number) > LARGEST_NUMBER for number in numbers):
                raise IntegratorError("numbers in a formula must be at most 10^1000 in size, but one was larger")
            return function(*numbers)

        return found

    names = "exp", "sin", "cos", "tan", "sinh", "cosh", "tanh", "erf", "power"
    return {name: bounded(getattr(mpmath, name)) for name in names}
