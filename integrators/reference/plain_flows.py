"""Flows, averages and fixed points, computed numerically to rounding error."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError
from integrators.reference.plain_arithmetic import add, size

if TYPE_CHECKING:
    from integrators.reference.plain_arithmetic import Arithmetic, Vector

    Map = Callable[[Vector], Vector]


MOST_HALVINGS = 12
MOST_DEGREE = 6
"""Gauss rules of mpmath have 3 · 2^(degree − 1) nodes."""


def flow_increment(right: Callable[[Any, Vector], Vector], start: Vector, arithmetic: Arithmetic) -> Vector:
    """z(1) − z(0) for z′(θ) = right(θ, z) and z(0) = start.

    Extrapolation of the explicit midpoint rule; an interval without convergence is halved. Increments, unlike end
    values, have rounding errors that are small against z.

    Args:
        right: The right-hand side, a function of θ and z.
        start: z(0).
        arithmetic: The arithmetic.

    Raises:
        IntegratorError: No convergence, as z leaves the domain of the field, or the problem is too stiff.

    Example:
        >>> import mpmath
        >>> from integrators.reference.plain_arithmetic import Arithmetic
        >>> arithmetic = Arithmetic(40)
        >>> with arithmetic.working():
        ...     increment = flow_increment(lambda t, z: z, arithmetic.vector([1]), arithmetic)
        ...     print(abs(increment[0] + 1 - mpmath.e) < 1e-45)
        True

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.9 (the method of Gragg, Bulirsch and
        Stoer).
    """

    def over(begin: Any, end: Any, passed: Vector, halvings: int) -> Vector:
        found = _extrapolated(right, begin, end, start + passed, arithmetic)
        if found is not None:
            return found
        if halvings == 0:
            raise IntegratorError(f"flow must converge to {arithmetic.decimals} digits, but did not, or does not exist")
        middle = (begin + end) / 2
        first = over(begin, middle, passed, halvings - 1)
        return first + over(middle, end, passed + first, halvings - 1)

    return over(arithmetic.number(0, "θ"), arithmetic.number(1, "θ"), 0 * start, MOST_HALVINGS)


def _extrapolated(
    right: Callable[[Any, Vector], Vector], begin: Any, end: Any, z: Vector, arithmetic: Arithmetic
) -> Vector | None:
    """The increment of z from θ = begin to end, extrapolated from n = 2, 4, 6, … steps; None without convergence.

    The error of n steps has an expansion in 1/n², whose terms the Aitken–Neville tableau eliminates one by one. With
    more columns its factors would amplify rounding errors.
    """
    columns = 7 if arithmetic.digits is None else 6 + arithmetic.decimals // 5
    row: list[Vector] = []
    for k in range(1, columns + 1):
        new = [_midpoint_steps(right, begin, end, z, 2 * k)]
        if not arithmetic.is_finite(new[0]):
            return None
        for j, old in enumerate(row, 1):
            new.append(new[-1] + (new[-1] - old) * (k - j) ** 2 / (k**2 - (k - j) ** 2))
        row = new
        if k > 1 and size(row[-1] - row[-2]) <= 4 * arithmetic.rounding * size(z, row[-1]):
            return row[-1]
    return None


def _midpoint_steps(right: Callable[[Any, Vector], Vector], begin: Any, end: Any, z: Vector, n: int) -> Vector:
    """The increment of z by n steps of the explicit midpoint rule, the first of them Euler's."""
    width = (end - begin) / n
    before, now = 0 * z, right(begin, z) * width
    for i in range(1, n):
        before, now = now, before + right(begin + i * width, z + now) * (2 * width)
    return now


def average(integrand: Callable[[Any], Vector], scale: Any, arithmetic: Arithmetic) -> Vector:
    """∫₀¹ integrand(θ) dθ by Gauss quadrature, with more and more nodes until the result no longer changes.

    Args:
        integrand: A smooth function.
        scale: The size that rounding errors are relative to, besides the integral.
        arithmetic: The arithmetic.

    Returns:
        The integral, or its first approximation that is not finite.

    Raises:
        IntegratorError: No convergence.
    """
    found: Vector | None = None
    for degree in range(1, MOST_DEGREE + 1):
        nodes = _gauss_nodes(degree, arithmetic.decimals)
        terms = [integrand(arithmetic.number(x, "θ")) * arithmetic.number(weight, "weight") for x, weight in nodes]
        new = add(terms)
        if not arithmetic.is_finite(new):
            return new
        if found is not None and size(new - found) <= 4 * arithmetic.rounding * max(scale, size(new)):
            return new
        found = new
    raise IntegratorError(f"average of field must converge to {arithmetic.decimals} digits, but did not")


@cache
def _gauss_nodes(degree: int, decimals: int) -> list[tuple[Any, Any]]:
    """Nodes in [0, 1] and weights of a Gauss rule, with guard digits."""
    import mpmath
    from mpmath.calculus.quadrature import GaussLegendre

    with mpmath.workdps(decimals + 10):
        return GaussLegendre(mpmath.mp).get_nodes(0, 1, degree, mpmath.mp.prec)


MOST_ITERATIONS = 200
PATIENCE = 3
"""Iterations without a smaller increment after which the iteration has stagnated or diverges."""


def fixed_point(g: Map, start: Vector, scale: Any, arithmetic: Arithmetic) -> Vector | None:
    """The solution of x = g(x) by fixed-point iteration from `start`; None without convergence.

    Args:
        g: The map.
        start: The first x.
        scale: The size that rounding errors are relative to, besides x.
        arithmetic: The arithmetic.

    Example:
        >>> from integrators.reference.plain_arithmetic import Arithmetic
        >>> import numpy as np
        >>> print(fixed_point(np.cos, np.array([1.0]), 1, Arithmetic()))
        [0.73908513]
        >>> print(fixed_point(lambda x: 2 - 2 * x, np.array([1.0]), 1, Arithmetic()))
        None

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, VIII.6: iteration until stagnation.
    """
    return _iterated(g, start, scale, arithmetic)


def newton(g: Map, start: Vector, scale: Any, arithmetic: Arithmetic) -> Vector | None:
    """The solution of x = g(x) by Newton's method, with a difference Jacobian in each iteration.

    Arguments and result are those of `fixed_point`.

    Example:
        >>> from integrators.reference.plain_arithmetic import Arithmetic
        >>> import numpy as np
        >>> print(newton(lambda x: 2 - 2 * x**3, np.array([1.0]), 1, Arithmetic()))
        [0.83512235]
    """

    def improved(x: Vector) -> Vector:
        value = g(x)
        width = arithmetic.rounding**0.5 * (max(scale, size(x)) or 1)
        matrix = arithmetic.zeros(len(x), len(x))
        for j in range(len(x)):
            moved = x.copy()
            moved[j] += width
            matrix[:, j] = -(g(moved) - value) / width
            matrix[j, j] += 1
        correction = arithmetic.solve(matrix, value - x)
        return value * float("nan") if correction is None else x + correction

    return _iterated(improved, start, scale, arithmetic)


def _iterated(advance: Map, x: Vector, scale: Any, arithmetic: Arithmetic) -> Vector | None:
    """Iterate until the increments stagnate; None if they are not small then, or not finite."""
    least, failures = None, 0
    for _ in range(MOST_ITERATIONS):
        before, x = x, advance(x)
        if not arithmetic.is_finite(x):
            return None
        increment = size(x - before)
        if least is None or increment < least:
            least, failures = increment, 0
        else:
            failures += 1
        if increment == 0 or failures == PATIENCE:
            return x if increment <= arithmetic.rounding**0.75 * max(scale, size(x)) else None
    return None
