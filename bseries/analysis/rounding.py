"""The order of a method whose entries may be rounded numbers, found from the residuals of the order conditions."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, NamedTuple, cast

from bseries.algebra.modified import series
from bseries.algebra.stages import FlowChain, auxiliary_colors, check_method, inputs_of
from bseries.algebra.uncertainty import rough_series
from bseries.analysis.order import affordable_order, basis_of_conditions, exact_values_of, order_of, trusted
from bseries.exact.domains import alike
from bseries_base.table import Table, as_html, fact_table
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.methods.catalogue.registry import as_method
from integrators.methods.kinds.memory import MethodWithMemory
from integrators.methods.programs.program import Method

LEAST_DIGITS = 6
"""Residuals that rounding to fewer digits explains are taken as those of the method."""
MOST_DIGITS = 200


class RoundedOrder(NamedTuple):
    """The order that a method has if its entries are numbers rounded to some significant digits.

    Attributes:
        order: The order.
        digits: The largest number of digits for which all residuals up to this order are within the worst case.

    Example:
        >>> import bseries as bs
        >>> str(bs.analysis.RoundedOrder(4, 15))
        'order 4 to 15 digits'
    """

    order: int
    digits: int

    def __str__(self) -> str:
        return f"order {self.order} to {self.digits} digits"

    def to_dict(self) -> dict[str, int]:
        """The order and the digits as plain data."""
        return self._asdict()

    def to_table(self) -> Table:
        """The order and the digits as a table."""
        return fact_table(str(self), self.to_dict().items())

    _repr_html_ = as_html


def rounded_order(method: Method | str) -> RoundedOrder | None:
    """The order of a method if its entries are rounded numbers, and to how many digits they are.

    Decimals with 15 digits, floats of single precision, and rational approximations of roots violate the order
    conditions, and their exact order is 0 or 1. This is the order that they are meant to have: the largest one whose
    residuals are what entries rounded to a number of digits, at least 6, can leave in the worst case. The answer does
    not depend on how numbers are written: as text, fractions, or floats.

    Args:
        method: A method.

    Returns:
        The order and the digits; None where the residuals show no rounding, as for exact methods.

    Raises:
        SeriesError: `method` is no method.

    Example:
        >>> import bseries as bs
        >>> sdirk = bs.RungeKutta(
        ...     [["0.292893218813452", 0], ["0.707106781186548", "0.292893218813452"]],
        ...     ["0.707106781186548", "0.292893218813452"],
        ... )
        >>> bs.order_of(sdirk), str(bs.analysis.rounded_order(sdirk)), bs.analysis.rounded_order("rk4")
        (1, 'order 2 to 15 digits', None)
    """
    method = check_method(as_method(method))
    order = order_of(method)
    found = hidden_order(method, order)
    decimals = _as_decimals(method)
    if found is not None or decimals is None or order > affordable_order(len(method.names)):
        return found
    return (
        RoundedOrder(order, _digits_shown(decimals, order)) if order_of(_with_digits(decimals, None)) < order else None
    )


def hidden_order(method: Method, order: int, most: int | None = None, least: int = LEAST_DIGITS) -> RoundedOrder | None:
    """The rounded order of a method, up to one and to some digits, if it is larger than the order decided for it."""
    decimals, found, digits = _as_decimals(method), order, 0
    while decimals is not None and found < (most or affordable_order(len(method.names))):
        shown = _digits_shown(decimals, found + 1)
        if shown < least:
            break
        found, digits = found + 1, shown
    return RoundedOrder(found, digits) if found > order else None


def _digits_shown(decimals: Method, nodes: int) -> int:
    """The largest number of digits for which all residuals up to a number of nodes are within the worst case."""
    import numpy as np

    table, auxiliary = basis_of_conditions(decimals, nodes), auxiliary_colors(decimals)
    exact = exact_values_of(table, auxiliary)
    values, sizes = rough_series(decimals, cast(Any, inputs_of(decimals, nodes)), table)
    # A coefficient of a tree with n nodes changes by at most n times the relative error of the entries.
    most = nodes * 5 * 10.0**-LEAST_DIGITS
    if (abs(values - np.array(list(map(float, exact.coefficients())))) > 2 * most * sizes).any():
        return 0
    s = series(decimals, table)
    uncertainty, digits = s.uncertainty, decimals.digits
    assert uncertainty is not None
    assert digits is not None
    mine, others = alike([s.stored, exact])
    residuals = {at: abs(mine[at] - others[at]) for at in range(len(s)) if not mine.equals_at(others, at)}
    for at, x in residuals.items():
        bound = Fraction(uncertainty(at))
        if x > bound:  # with one digit less the bound is ten times as large
            digits = min(digits, (decimals.digits or 0) - math.ceil(math.log10(x / bound) if bound else MOST_DIGITS))
    return digits


def _as_decimals(method: Method) -> Method | None:
    """The method with as many digits as are written, `MOST_DIGITS` for other fractions; None if it has none."""
    method = trusted(method)
    if isinstance(method, MethodWithMemory) or method.domain not in ("QQ", "decimal"):
        return None
    plain = _with_digits(method, MOST_DIGITS)
    inputs: Any = inputs_of(plain, 1)
    numbers = inputs.times if isinstance(inputs, FlowChain) else [*inputs.stages.a, *inputs.stages.b]
    digits = max(map(_significant, numbers))
    return None if digits < LEAST_DIGITS else _with_digits(plain, digits)


def _significant(x: Fraction) -> int:
    """The number of significant digits of a decimal; `MOST_DIGITS` for other fractions."""
    power = 10 ** (x.denominator.bit_length() - 1)  # divisible by all denominators of decimals with so many bits
    numerator, rest = divmod(abs(x.numerator) * power, x.denominator)
    return MOST_DIGITS if rest else min(MOST_DIGITS, len(str(numerator).rstrip("0")))


def _with_digits(method: Method, digits: int | None) -> Method:
    """The method with another number of digits."""
    if isinstance(method, RungeKutta):
        return method.with_digits(digits)
    if isinstance(method, PartitionedRungeKutta):
        parts: Any = {n: x.with_digits(digits) for n, x in zip(method.names, method.partitions, strict=True)}
        return PartitionedRungeKutta(parts, name=method.name, warn=False)
    return method.program.changed(digits=digits)
