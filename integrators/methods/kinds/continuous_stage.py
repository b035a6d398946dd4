"""Continuous-stage Runge–Kutta methods: averages of the field along a polynomial path."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from integrators.core.arguments import items
from integrators.exact.entries import sum_entries
from integrators.methods.program.evaluations import combination
from integrators.methods.program.program_method import ProgramMethod
from integrators.methods.tableaux.tableau_input import read_matrix, read_row

if TYPE_CHECKING:
    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import ProgramBuilder
    from integrators.methods.tableaux.tableau_input import EntryRow, Matrix


class ContinuousStageRungeKutta(ProgramMethod):
    """A Runge–Kutta method with a stage for every τ in [0, 1], given by polynomials.

    The stages are Y_τ = y0 + h ∫₀¹ A_τσ f(Y_σ) dσ with A_τσ = Σ_ij M[i][j] τ^i σ^j, and y1 = y0 + h ∫₀¹ B_σ f(Y_σ) dσ
    with B_σ = Σ_j B[j] σ^j. By default y1 = Y_1, so B_σ = A_1σ.

    Args:
        M: the coefficients of A_τσ: rows are powers of τ, columns powers of σ, both from 0.
        B: the coefficients of B_σ; the column sums of M if None.
        parameters: the symbols allowed in formulas.
        name: the name in messages.
        reference: the source.
        digits: the number of correct significant digits of decimal coefficients.

    Raises:
        IntegratorError: sizes that do not match, or an invalid entry.

    Example:
        The averaged vector field method, y1 = y0 + h ∫ f((1−θ) y0 + θ y1) dθ, has A_τσ = τ:

        >>> print(ContinuousStageRungeKutta([[0], [1]]))
        k1 = ∫ h f(y + θ (k1)) dθ
        y1 = y + k1

    References:
        E. Hairer, JNAIAM 5 (2010) 73–84 (energy-preserving variant of collocation methods);
        Y. Miyatake, J. C. Butcher, SIAM J. Numer. Anal. 54 (2016) 1993–2013, doi:10.1137/15M1020861.
    """

    M: Matrix
    B: EntryRow

    def __init__(
        self,
        M: Any,
        B: Any = None,
        *,
        parameters: Iterable[str] = (),
        name: str | None = None,
        reference: str | None = None,
        digits: int | None = None,
    ) -> None:
        symbols = tuple(parameters)
        rows = items(M, "M")
        columns = len(items(rows[0], "M[1]")) if rows else 0
        matrix = read_matrix(rows, "M", symbols, rows=max(len(rows), 1), columns=columns)
        weights = map(sum_entries, zip(*matrix, strict=True)) if B is None else read_row(B, "B", symbols, count=columns)
        self._set({"M": matrix, "B": tuple(weights)}, name=name, reference=reference, digits=digits)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        averages = builder.unknowns(len(self.B))
        start, *path = (combination(row, averages) for row in self.M)
        for power, average in enumerate(averages):
            builder.average([builder.y + start, *path], power=power, into=average)
        return builder.y + combination(self.B, averages)
