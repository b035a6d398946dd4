"""Symmetric compositions that raise the order: the triple jump and Suzuki's fractal."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from .compositions import composition
from .entries import multiply_entries, read_entry, sum_entries
from .errors import IntegratorError
from .expressions import shorten

if TYPE_CHECKING:
    from .entries import Entry
    from .program import Program
    from .program_method import Method
    from .splitting import Splitting

MAX_ORDER = 30


def triple_jump(method: Method, order: int, *, name: str | None = None) -> Program | Splitting:
    """Three steps of γh, (1−2γ)h, γh with γ = 1/(2 − 2^(1/(p+1))).

    Args:
        method: a method of even order p.
        order: its order p.
        name: what messages call the result.

    Returns:
        A method of order p + 1; if the method is symmetric, it is so, too, and has order p + 2.

    Raises:
        IntegratorError: `method` is no method, or `order` is no even number.

    Example:
        >>> from integrators import method
        >>> [round(float(x), 4) for _, x in triple_jump(method("strang"), 2).flows]
        [0.6756, 1.3512, -0.1756, -1.7024, -0.1756, 1.3512, 0.6756]

    References:
        M. Suzuki, Phys. Lett. A 146 (1990) 319–323, doi:10.1016/0375-9601(90)90962-N; H. Yoshida, Phys. Lett. A 150
        (1990) 262–268, doi:10.1016/0375-9601(90)90092-3; Hairer, Lubich, Wanner, *Geometric Numerical Integration*,
        formula (II.4.4).
    """
    gamma = _inverse_of_difference(2, _even(order) + 1)
    return composition([(method, x) for x in _around(gamma, 1)], name=name or f"triple jump of {_name(method)}")


def suzuki_fractal(method: Method, order: int, *, name: str | None = None) -> Program | Splitting:
    """Five steps of γh, γh, (1−4γ)h, γh, γh with γ = 1/(4 − 4^(1/(p+1))), which stay close to the step itself.

    Args:
        method: a method of even order p.
        order: its order p.
        name: what messages call the result.

    Returns:
        A method of order p + 1; if the method is symmetric, it is so, too, and has order p + 2.

    Raises:
        IntegratorError: `method` is no method, or `order` is no even number.

    Example:
        >>> from integrators import method
        >>> [round(float(x), 4) for _, x in suzuki_fractal(method("strang"), 2).flows]
        [0.2072, 0.4145, 0.4145, 0.4145, -0.1217, -0.658, -0.1217, 0.4145, 0.4145, 0.4145, 0.2072]

    References:
        M. Suzuki, Phys. Lett. A 146 (1990) 319–323, doi:10.1016/0375-9601(90)90962-N; Hairer, Lubich, Wanner,
        *Geometric Numerical Integration*, formula (II.4.5).
    """
    gamma = _inverse_of_difference(4, _even(order) + 1)
    return composition([(method, x) for x in _around(gamma, 2)], name=name or f"Suzuki's fractal of {_name(method)}")


def _inverse_of_difference(m: int, degree: int) -> Entry:
    """1/(m − m^(1/n)) = Σ_k m^(n−1−k) x^k / (m^n − m) with x = m^(1/n): a normal form without roots in denominators."""
    import sympy

    x = sympy.root(m, degree)
    terms = (sympy.Rational(m ** (degree - 1 - k), m**degree - m) * x**k for k in range(degree))
    return read_entry(sympy.Add(*terms), "gamma")


def _around(gamma: Entry, count: int) -> list[Entry]:
    """`count` times γ before and after the rest of the step."""
    rest = sum_entries((Fraction(1), multiply_entries(gamma, Fraction(-2 * count))))
    return [*[gamma] * count, rest, *[gamma] * count]


def _even(order: Any) -> int:
    if isinstance(order, bool) or not isinstance(order, int) or order % 2 or not 2 <= order <= MAX_ORDER:
        raise IntegratorError(f"order must be an even number from 2 to {MAX_ORDER}, but was {shorten(repr(order))}")
    return order


def _name(method: Any) -> str:
    return shorten(str(getattr(method, "name", method)))
