"""Williamson's conditions: which Runge–Kutta methods have a form in 2N storage."""

from __future__ import annotations

from fractions import Fraction

from bseries_base.errors import shorten, shown
from integrators.core.errors import IntegratorError
from integrators.exact import entries
from integrators.exact.entries import Entry, EntryRow
from integrators.exact.expressions import format_number
from integrators.methods.tableaux.runge_kutta import RungeKutta


def to_2n(method: RungeKutta) -> tuple[EntryRow, EntryRow]:
    """The coefficients A and B of Williamson's form in 2N storage, from which `RungeKutta.from_2n` makes the method.

    With the rows a_i of the tableau, of which the last is b, the conditions are a_(i+1)j − a_ij = B_i A_i ⋯ A_(j+1).

    Args:
        method: an explicit Runge–Kutta method.

    Returns:
        The rows A and B.

    Raises:
        IntegratorError: the method is implicit, or does not satisfy a condition, which is named.

    Example:
        >>> import bseries as bs
        >>> A, B = bs.methods.to_2n(bs.method("williamson3"))
        >>> [str(a) for a in A], [str(b) for b in B]
        (['0', '-5/9', '-153/128'], ['1/3', '15/16', '8/15'])

    References:
        J. H. Williamson, J. Comput. Phys. 35 (1980) 48–56, doi:10.1016/0021-9991(80)90033-9.
    """
    if not isinstance(method, RungeKutta) or not method.is_explicit:
        raise IntegratorError(f"method must be an explicit RungeKutta, but was {shown(method)}")
    rows, precision = (*method.A, method.b), method.precision
    A: list[Entry] = [Fraction(0)]
    B = [rows[i + 1][i] for i in range(method.stages)]
    for i, last in enumerate(B):
        if entries.cancels((last,), precision) is not False:
            place = f"a_({i + 2},{i + 1})" if i + 1 < method.stages else f"b_{i + 1}"
            raise IntegratorError(f"method must have B_{i + 1} = {place} other than 0 for a 2N form, but it was {last}")
        product = last
        for j in reversed(range(i)):
            change = entries.sum_entries((rows[i + 1][j], -rows[i][j]))
            if j == i - 1:
                A.append(entries.divide_entries(change, last))
            product = entries.multiply_entries(product, A[j + 1])
            if entries.cancels((rows[i + 1][j], -rows[i][j], -product), precision) is not True:
                left, right = (shorten(format_number(x)) for x in (change, product))
                raise IntegratorError(
                    "method must satisfy Williamson's conditions a_(i+1)j - a_ij = B_i A_i ... A_(j+1), but for "
                    f"i = {i + 1}, j = {j + 1} the left side was {left} and the right {right}"
                )
    return tuple(A), tuple(B)
