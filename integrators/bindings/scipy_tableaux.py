"""Tableaux read from SciPy's solver classes, exact where their doubles show it.

SciPy keeps doubles. One is taken for a fraction if it is the double nearest to a fraction with a denominator of at most
`LARGEST_DENOMINATOR`, as three of 100,000 doubles are by chance. Fractions are used only if all entries are such, and
if row sums and order conditions then hold exactly.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from math import isfinite
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.core.errors import IntegratorError, shorten
from integrators.methods.tableaux.elementary_weights import order_of_difference, order_of_weights
from integrators.methods.tableaux.runge_kutta import RungeKutta

if TYPE_CHECKING:
    Row = list[float]

LARGEST_DENOMINATOR = 10**6
DOUBLE_DIGITS = 16
RADAU_ROUNDING = 1e-13
"""SciPy's transformation of Radau's stages has 15 digits at least."""


def from_scipy(solver: type) -> RungeKutta:
    """The Runge–Kutta method of a solver class of SciPy.

    Args:
        solver: ``RK23``, ``RK45``, ``DOP853`` or ``Radau`` of ``scipy.integrate``; a class that has the attributes A,
            B, C, E, order and error_estimator_order of ``RK45``, where E is the embedded weights minus B; or what
            `scipy_solver` made.

    Returns:
        The method with its embedded weights. It is exact where fractions can be told from the doubles with certainty,
        as for ``RK23`` and ``RK45``; else its entries are the shortest decimals of the doubles, with 16 digits.
        ``Radau`` is the exact ``radau-iia3``; its error estimate involves the Jacobian and is no row of weights.

    Raises:
        IntegratorError: `solver` is no such class.

    Example:
        >>> from scipy.integrate import DOP853, RK45
        >>> from integrators import method
        >>> from_scipy(RK45) == method("dormand-prince54")
        True
        >>> dop853 = from_scipy(DOP853)
        >>> dop853.domain, dop853.digits, float(dop853.b[0]), len(dop853.embedded)
        ('decimal', 16, 0.054293734116568765, 2)
    """
    method = getattr(solver, "method", None)
    if isinstance(method, RungeKutta):
        return method
    integrate = sys.modules.get("scipy.integrate")
    if integrate is not None and solver is integrate.Radau:
        return _radau(sys.modules[solver.__module__])
    found = _read(solver)
    if all(float(_fraction(x)) == x for row in found.rows for x in row):
        exact = found.method(_fraction)
        if _is_confirmed(exact, found):
            return exact
    return found.method(lambda x: Fraction(Decimal(repr(x))), DOUBLE_DIGITS)


def _fraction(x: float) -> Fraction:
    """The nearest fraction of small size."""
    return Fraction(x).limit_denominator(LARGEST_DENOMINATOR)


class _Doubles(NamedTuple):
    """What a solver class keeps; the embedded weights by what they exceed the weights by."""

    name: str
    A: list[Row]
    b: Row
    c: Row
    differences: list[Row]
    order: int
    error_order: int

    @property
    def rows(self) -> list[Row]:
        return [*self.A, self.b, self.c, *self.differences]

    def method(self, number: Callable[[float], Fraction], digits: int | None = None) -> RungeKutta:
        """The method with a number for each double."""
        A = [list(map(number, row)) for row in self.A]
        b, c, *differences = (list(map(number, row)) for row in (self.b, self.c, *self.differences))
        embedded = [[x + y for x, y in zip(b, row, strict=True)] for row in differences]
        return RungeKutta(A, b, c, embedded=embedded, name=self.name, digits=digits, warn=False)


def _read(solver: Any) -> _Doubles:
    """The tableau of a class like ``RK45`` or ``DOP853``."""
    try:
        order, error_order = int(solver.order), int(solver.error_estimator_order)
        A = [_doubles(row) for row in solver.A]
        b, c = _doubles(solver.B), _doubles(solver.C)
        if hasattr(solver, "E5"):
            differences = [[-x for x in _doubles(row)] for row in (solver.E5, solver.E3)]
        else:
            differences = [_doubles(solver.E)]
        if any(len(row) != len(b) + 1 for row in differences):
            raise ValueError
    except (AttributeError, TypeError, ValueError):
        name = getattr(solver, "__name__", repr(solver))
        raise IntegratorError(
            f"solver must be a Runge–Kutta class of SciPy, such as RK45, but was {shorten(name)}"
        ) from None
    if any(row[-1] for row in differences):  # the estimate looks at the derivative at the end of the step
        A, b, c = [*A, b], [*b, 0.0], [*c, 1.0]
    stages = len(b)
    A = [row + [0.0] * (stages - len(row)) for row in A]
    return _Doubles(solver.__name__, A, b, c, [row[:stages] for row in differences], order, error_order)


def _doubles(values: Any) -> Row:
    row = [float(x) for x in values]
    if not all(map(isfinite, row)):
        raise ValueError
    return row


def _is_confirmed(method: RungeKutta, found: _Doubles) -> bool:
    """Whether row sums are the nodes and the orders are those of the class, all exactly."""
    import numpy as np

    A, b, embedded = (np.array(rows, dtype=object) for rows in (method.A, method.b, method.embedded))
    return (
        method.row_sums == method.c
        and order_of_weights(A, b) == found.order
        and all(order_of_difference(A, row - b) == found.error_order for row in embedded)
    )


def _radau(module: ModuleType) -> RungeKutta:
    """The method ``radau-iia3``, if it is what a module of SciPy works with: A⁻¹ = T Λ T⁻¹ and the nodes agree."""
    import numpy as np

    from integrators.methods.catalogue.registry import method

    known: Any = method("radau-iia3")
    rounded = known.to_float()
    try:
        pair = module.MU_COMPLEX
        blocks = np.array([[module.MU_REAL, 0, 0], [0, pair.real, -pair.imag], [0, pair.imag, pair.real]])
        A = module.T @ np.linalg.inv(blocks) @ module.TI
        agrees = abs(A - rounded.A).max() < RADAU_ROUNDING and abs(module.C - rounded.c).max() < RADAU_ROUNDING
    except (AttributeError, TypeError, ValueError):
        agrees = False
    if not agrees:
        raise IntegratorError("solver must be a class that this version can read, but SciPy's Radau has changed")
    return known
