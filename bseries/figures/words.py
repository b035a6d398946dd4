"""Words of captions, legends and columns: numbers, powers, states and names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import pi
from typing import TYPE_CHECKING

from integrators.runs.titles import printed_name

if TYPE_CHECKING:
    from integrators import Method


def power(variable: str, exponent: float) -> str:
    """A fitted power for captions.

    Example:
        >>> power("t", 1.9249), power("t", -0.001)
        ('t^1.92', 't^0.00')
    """
    return f"{variable}^{exponent:.2f}".replace("-0.00", "0.00")


def superscript(number: int) -> str:
    """A whole number as a superscript in captions.

    Example:
        >>> "h" + superscript(4), "10" + superscript(-6)
        ('h⁴', '10⁻⁶')
    """
    return str(number).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def subscript(number: int) -> str:
    """A whole number as a subscript in captions."""
    return str(number).translate(str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉"))


def power_of_h(exponent: int) -> str:
    """h, h², h³, … in captions."""
    return "h" + (superscript(exponent) if exponent > 1 else "")


def scientific(value: float, digits: int = 3) -> str:
    """A number for captions, with a power of ten where it is small.

    Example:
        >>> scientific(0.000123456), scientific(-1.5), scientific(2210), scientific(0.0)
        ('1.23·10⁻⁴', '−1.5', '2.21·10³', '0')
    """
    if not value or 1e-3 <= abs(value) < 10**digits:
        return f"{value:.{digits}g}".replace("-", "−")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}·10{superscript(int(exponent))}".replace("-", "−")


def state(values: Iterable[float]) -> str:
    """A state in captions and legends, with −π as such.

    Example:
        >>> state((2.5, 0.0)), state((1.5, -pi))
        ('(2.5, 0)', '(1.5, −π)')
    """
    names = {pi: "π", -pi: "−π"}
    return f"({', '.join(names.get(value, f'{value:g}'.replace('-', '−')) for value in values)})"


def listed(words: Sequence[str]) -> str:
    """Words in a sentence.

    Example:
        >>> listed(["1"]), listed(["1", "2", "3"])
        ('1', '1, 2 and 3')
    """
    return " and ".join([*filter(None, [", ".join(words[:-1])]), words[-1]])


def name_of(method: Method) -> str:
    """The name of a method in captions and legends."""
    return printed_name(method.name or "method")


def short_names(methods: Sequence[Method]) -> list[str]:
    """The names of methods in titles and legends, without what is in brackets as long as they differ.

    Example:
        >>> import bseries as bs
        >>> short_names([bs.method("stormer-verlet"), bs.method("symplectic-euler-p")])
        ['Störmer–Verlet', 'symplectic Euler']
    """
    names = [name_of(method) for method in methods]
    short = [name.partition(" (")[0] for name in names]
    return short if len(set(short)) == len(short) else names


def column_names(methods: Sequence[Method]) -> list[str]:
    """The names of methods in names of columns, all different.

    Example:
        >>> import bseries as bs
        >>> column_names([bs.method("symplectic-euler-p"), bs.method("rk4")])
        ['symplectic_euler_p', 'rk4']
        >>> column_names([bs.method("rk4"), bs.method("rk4")])
        ['rk4_1', 'rk4_2']
    """
    names = [(method.name or f"method{k}").replace("-", "_") for k, method in enumerate(methods, 1)]
    return names if len(set(names)) == len(names) else [f"{name}_{k}" for k, name in enumerate(names, 1)]
