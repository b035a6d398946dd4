"""Programs of tableaux with irrational stages, with rational numbers in their place."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from integrators.core.errors import IntegratorError, shorten
from integrators.methods.program.program import Method, Program
from integrators.methods.tableaux.partitioned import PartitionedRungeKutta
from integrators.methods.tableaux.runge_kutta import RungeKutta


def rational_program(method: Any, decimals: int) -> Program:
    """The program of a method; stages on roots of polynomials are replaced by rational numbers near them.

    The exact roots of a stage algebra are slow to write down, and only so many decimals of them are used.
    """
    if not isinstance(method, Method):
        raise IntegratorError(f"method must be a method, but was {shorten(repr(method))}")
    tableaux = method.partitions if isinstance(method, RungeKutta | PartitionedRungeKutta) else ()
    if all(tableau.algebra is None for tableau in tableaux):
        return method.program
    near = [_near(tableau, decimals) for tableau in tableaux]
    if len(near) == 1:
        return near[0].program
    return PartitionedRungeKutta(dict(zip(method.names, near, strict=True)), name=method.name, warn=False).program


def _near(tableau: RungeKutta, decimals: int) -> RungeKutta:
    """The tableau with rational numbers within 10^-decimals of its entries."""
    if tableau.algebra is None:
        return tableau
    from mpmath.libmp import to_rational

    A, b, c = tableau.algebra.tableau_decimal(decimals + 3)
    rows = [[Fraction(*map(int, to_rational(x._mpf_))) for x in row] for row in (*A, b, c)]
    return RungeKutta(rows[:-2], rows[-2], rows[-1], name=tableau.name, warn=False)
