"""The operations on series, all of them Lie derivatives (idea: HLW, Lemma IX.9.1).

exp b = Σ ∂_b^j id / j!; log solves that order by order; compose(a, c) = Σ ∂_{log a}^j c / j!, because the flow of log a
is a; inverse and powers follow. The cost is n² per tree with n nodes, where sums over subtrees would be exponential.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from bseries.algebra.bseries import BSeries, fewest_digits
from bseries.exact import recursions
from bseries.exact.domains import alike, apply, exact_number
from bseries.exact.operations import Operation
from bseries.exact.rationals import RationalValues, lcm_up_to, primes_up_to, primorial
from bseries.exceptions import SeriesError


def check_flow(a: BSeries, name: str = "series") -> None:
    """Refuse what is no flow series."""
    if not isinstance(a, BSeries):
        raise SeriesError(f"{name} must be a BSeries, but was {a!r:.60}")
    if a.empty != 1:
        raise SeriesError(f"{name} must be a flow, with the coefficient 1 of the empty tree, but has {a.empty} there")


def check_field(b: BSeries, name: str = "series") -> None:
    """Refuse what is no field series."""
    if not isinstance(b, BSeries):
        raise SeriesError(f"{name} must be a BSeries, but was {b!r:.60}")
    if b.empty != 0:
        raise SeriesError(f"{name} must be a field, with the coefficient 0 of the empty tree, but has {b.empty} there")


def _result(operation: Operation, empty: Any, *operands: BSeries) -> BSeries:
    first = operands[0]
    for other in operands[1:]:
        first.check_same_trees(other)
    values = apply(first.table, alike([operand._values for operand in operands]), operation)
    return BSeries(first.table, values, empty, names=first.names, digits=fewest_digits(*operands))


def log_claim(n: int, step: int) -> int:
    """Denominators of log a for trees with n nodes (see `bseries.exact.operations`)."""
    return lcm_up_to(n) * step**n


def wider_step(order: int, step: int) -> int:
    """An L for denominators that divide n! step^n."""
    return step * primorial(order)


def log(a: BSeries) -> BSeries:
    """The field b whose exact flow is a given flow: its modified equation.

    Args:
        a: A series with a(∅) = 1.

    Returns:
        b with b(∅) = 0 and exp b = a.

    Raises:
        SeriesError: a(∅) is not 1.

    Example:
        >>> import bseries as bs
        >>> log(bs.exact_flow(4)) == bs.BSeries.from_rule(lambda tree: int(tree.order == 1), 4, empty=0)
        True

    References:
        HLW, theorem IX.9.2.
    """
    check_flow(a)

    def expression(arithmetic: Any, target: Any) -> Any:
        return recursions.logarithm(target(field=True), a.table, arithmetic)

    return _result(Operation(expression, log_claim, wider_step, field=True), 0, a)


def exp(b: BSeries) -> BSeries:
    """The exact flow, over one step, of a field.

    Args:
        b: A series with b(∅) = 0.

    Returns:
        a with a(∅) = 1 and log a = b.

    Raises:
        SeriesError: b(∅) is not 0.

    Example:
        >>> import bseries as bs
        >>> exp(bs.BSeries.from_rule(lambda tree: int(tree.order == 1), 4, empty=0)) == bs.exact_flow(4)
        True

    References:
        HLW, lemma IX.9.1 and equation (IX.9.7).
    """
    check_field(b)

    def expression(arithmetic: Any, field: Any) -> Any:
        return recursions.lie_series(field(field=True), None, 1, b.table, arithmetic)

    return _result(Operation(expression, lambda n, step: math.factorial(n) * step**n, wider_step, field=False), 1, b)


def compose(a: BSeries, c: BSeries) -> BSeries:
    """The series of a map followed by another: first a, then c.

    B(compose(a, c), y) = B(c, B(a, y)), which HLW and Butcher write as the product a · c.

    Args:
        a: A flow, applied first.
        c: A flow, or any series (a field c gives c evaluated at the image of a).

    Returns:
        The composition, on the same trees.

    Raises:
        SeriesError: a(∅) is not 1, or the trees differ.

    Example:
        Half a step of the implicit Euler method and half a step of the explicit one are the midpoint rule:

        >>> import bseries as bs
        >>> half = Fraction(1, 2)
        >>> implicit = bs.series(bs.method("implicit-euler"), 5).scale_step(half)
        >>> explicit = bs.series(bs.method("explicit-euler"), 5).scale_step(half)
        >>> compose(implicit, explicit) == bs.series(bs.method("implicit-midpoint"), 5)
        True

    References:
        HLW, theorem III.1.10 (there by ordered subtrees).
    """
    check_flow(a, "a")
    if not isinstance(c, BSeries):
        raise SeriesError(f"c must be a BSeries, but was {c!r:.60}")
    if c.empty not in (0, 1):  # by linearity in c: c = c(∅) ∅ + the rest
        return a * c.empty + compose(a, c.with_empty(0))

    def expression(arithmetic: Any, first: Any, second: Any) -> Any:
        field = recursions.logarithm(first(field=True), a.table, arithmetic)
        return recursions.lie_series(field, second(field=False), c.empty, a.table, arithmetic)

    bounds = None
    if isinstance(a._values, RationalValues) and isinstance(c._values, RationalValues):
        # At most 2^n ordered subtrees, and no product exceeds 2^(κ n).
        growth = max(a._values.growth, c._values.growth)
        bounds = [(growth + 1) * n for n in range(1, a.order + 1)]
    operation = Operation(expression, lambda n, step: step**n, lambda _, step: step, field=False, bounds=bounds)
    return _result(operation, c.empty, a, c)


def inverse(a: BSeries) -> BSeries:
    """The series of the inverse map.

    Raises:
        SeriesError: a(∅) is not 1.

    Example:
        >>> import bseries as bs
        >>> a = bs.series(bs.method("rk4"), 5)
        >>> compose(a, inverse(a)) == bs.BSeries.from_rule(lambda tree: 0, 5)
        True
    """
    return power(a, -1)


def adjoint(a: BSeries) -> BSeries:
    """The series of the adjoint method Φ*_h = (Φ_{−h})^{−1}.

    Raises:
        SeriesError: a(∅) is not 1.

    Example:
        >>> import bseries as bs
        >>> adjoint(bs.series(bs.method("explicit-euler"), 4)) == bs.series(bs.method("implicit-euler"), 4)
        True

    References:
        HLW, definition II.3.1.
    """
    return inverse(a.scale_step(-1))


def power(a: BSeries, exponent: object) -> BSeries:
    """a^s = exp(s log a): s steps of a method, for any real number (or symbol) s.

    Args:
        a: A flow.
        exponent: An integer, a Fraction, a SymPy expression, or a float.

    Returns:
        The flow a^s; a^(1/2) is half a step in the sense that two of it make one.

    Raises:
        SeriesError: a(∅) is not 1, or the exponent is no number.

    Example:
        >>> import bseries as bs
        >>> a = bs.series(bs.method("rk4"), 5)
        >>> a ** 2 == compose(a, a), (a ** Fraction(1, 2)) ** 2 == a
        (True, True)
    """
    check_flow(a)
    s: Any = exact_number(exponent, "exponent")
    if not isinstance(s, Fraction):
        return exp(log(a) * s)
    # binom(p/q, k) has the denominator q^k times, for every prime r that divides q, fewer than k times r (from k!).
    q = s.denominator
    factor = q * math.prod(r for r in primes_up_to(a.order) if q % r == 0)

    def expression(arithmetic: Any, first: Any) -> Any:
        field = recursions.logarithm(first(field=True), a.table, arithmetic)
        return recursions.lie_series(field, None, 1, a.table, arithmetic, s)

    operation = Operation(
        expression, lambda n, step: (factor * step) ** n, lambda _, step: factor * step, field=False, units=q
    )
    return _result(operation, 1, a)


def lie_derivative(b: BSeries, c: BSeries) -> BSeries:
    """∂_b c: the derivative of the series c along the field b.

    (∂_b c)(τ) = c(∅) b(τ) + Σ c(trunk) b(branch), over all ways to cut one edge of τ.

    Args:
        b: A field.
        c: Any series.

    Returns:
        A field (its coefficient of the empty tree is 0).

    Raises:
        SeriesError: b(∅) is not 0, or the trees differ.

    Example:
        >>> import bseries as bs
        >>> f = bs.BSeries.from_rule(lambda tree: int(tree.order == 1), 3, empty=0)
        >>> second = lie_derivative(f, f)
        >>> [str(tree) for tree, value in second.items() if value]
        ['[τ]']

    References:
        HLW, lemma IX.9.1.
    """
    check_field(b, "b")
    if not isinstance(c, BSeries):
        raise SeriesError(f"c must be a BSeries, but was {c!r:.60}")
    if c.empty not in (0, 1):
        return b * c.empty + lie_derivative(b, c.with_empty(0))

    def expression(arithmetic: Any, field: Any, base: Any) -> Any:
        once = arithmetic.factors([0, 1] + [0] * b.order)
        return recursions.derivatives(field(field=True), base(field=False), c.empty, once, b.table, arithmetic)

    operation = Operation(expression, lambda n, step: step**n, lambda _, step: step, field=True)
    return _result(operation, 0, b, c)
