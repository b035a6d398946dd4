"""Internal stability: how a step magnifies errors that its stages add."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from bseries.analysis.stability import criteria
from bseries.analysis.stability import field_elements as field
from bseries.analysis.stability.rational_functions import StabilityFunction
from integrators.core.errors import IntegratorError
from integrators.exact.polynomials import ONE, Polynomial, add, multiply
from integrators.methods.tableaux.registers import Combination, Slope
from integrators.methods.tableaux.runge_kutta import RungeKutta


def internal_stability_functions(method: RungeKutta | str) -> tuple[StabilityFunction, ...]:
    """The functions Q_j(z): for y' = λy and z = hλ, an error added to stage j changes the step by Q_j(z) times it.

    They depend on the form in which the method is given, which `RungeKutta.from_2n` and its like keep: an error of the
    vector at which slope j is evaluated enters this slope and all that the form computes from the vector later. Without
    a form the stages are those of the tableau, whose errors enter the slopes only.

    Args:
        method: a Runge–Kutta method, or its name.

    Returns:
        One function for each stage.

    Raises:
        IntegratorError: `method` is no `RungeKutta`, or has no form and is implicit.

    Example:
        >>> import bseries as bs
        >>> for Q in bs.stability.internal_stability_functions("ssprk33"):
        ...     print(Q)
        1 + z + z^2/2 + z^3/6
        1/6 + z/3 + z^2/6
        2/3 + 2*z/3
        >>> print(*bs.stability.internal_stability_functions("heun2"), sep=", ")
        z/2 + z^2/2, z/2

    References:
        D. I. Ketcheson, L. Lóczi, M. Parsani, SIAM J. Numer. Anal. 52 (2014) 2227–2249, doi:10.1137/130936245.
    """
    method = criteria.checked_method(method)
    values, precision = _values(method)
    terms = [pair for value in values if isinstance(value, Combination) for pair in value.terms]
    elements = iter(field.to_elements([x for _, x in terms], precision))
    known = [[next(elements) for _ in value.terms] if isinstance(value, Combination) else [] for value in values]
    # The derivative of y_(n+1) by each value, backwards from y_(n+1) itself.
    derivatives: list[Polynomial] = [()] * (len(values) - 1) + [ONE]
    for v in reversed(range(1, len(values))):
        value, own = values[v], derivatives[v]
        if isinstance(value, Slope):
            derivatives[value.at] = add(derivatives[value.at], (Fraction(0), *own))
        elif value is not None:
            for (u, _), x in zip(value.terms, known[v], strict=True):
                derivatives[u] = add(derivatives[u], multiply((x,), own))
    stages = [value.at for value in values if isinstance(value, Slope)]
    floating, digits = method.domain == "float", method.digits
    return tuple(StabilityFunction.from_elements(derivatives[v], ONE, floating=floating, digits=digits) for v in stages)


def _values(method: RungeKutta) -> tuple[Sequence[Slope | Combination | None], Fraction | float]:
    """The values of a step in the form of the method, or in the tableau, and the error of its coefficients."""
    if method.form is not None:
        return method.form.values, method.form.precision
    if not method.is_explicit:
        raise IntegratorError(f"method must be explicit or have a form, but was {method!r}")
    values: list[Slope | Combination | None] = [None]
    for row in (*method.A, method.b):
        slopes = [v for v, value in enumerate(values) if isinstance(value, Slope)]
        values.append(Combination(((0, Fraction(1)), *zip(slopes, row, strict=False))))
        values.append(Slope(len(values) - 1))
    return values[:-1], method.precision
