"""Two-derivative Runge–Kutta methods, with stages of y' = f(y) and y'' = f'(y) f(y)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from integrators.methods.program.evaluations import combination
from integrators.methods.program.program_method import ProgramMethod
from integrators.methods.tableaux.tableau_input import read_matrix, read_row

if TYPE_CHECKING:
    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import ProgramBuilder
    from integrators.methods.tableaux.tableau_input import EntryRow, Matrix


class TwoDerivativeRungeKutta(ProgramMethod):
    """A two-derivative Runge–Kutta method.

    With g = f' f, the second derivative of solutions, the stages are
    Y_i = y + h Σ_j a_ij f(Y_j) + h² Σ_j â_ij g(Y_j), and y1 = y + h Σ_i b_i f(Y_i) + h² Σ_i b̂_i g(Y_i).

    Args:
        A: the matrix a_ij by rows.
        A_hat: the matrix â_ij by rows.
        b: the weights b_i.
        b_hat: the weights b̂_i.
        parameters: the symbols allowed in formulas.
        name: the name in messages.
        reference: the source.
        digits: the number of correct significant digits of decimal coefficients.

    Raises:
        IntegratorError: sizes that do not match, or an invalid entry.

    Example:
        Taylor's method of order 2:

        >>> print(TwoDerivativeRungeKutta([[0]], [[0]], [1], ["1/2"]))
        k1 = h f(y)
        k2 = h f'(y) (k1)
        y1 = y + k1 + 1/2*k2

    References:
        R. P. K. Chan, A. Y. J. Tsai, Numer. Algorithms 53 (2010) 171–194, doi:10.1007/s11075-009-9349-1.
    """

    A: Matrix
    A_hat: Matrix
    b: EntryRow
    b_hat: EntryRow

    def __init__(
        self,
        A: Any,
        A_hat: Any,
        b: Any,
        b_hat: Any,
        *,
        parameters: Iterable[str] = (),
        name: str | None = None,
        reference: str | None = None,
        digits: int | None = None,
    ) -> None:
        symbols = tuple(parameters)
        weights = read_row(b, "b", symbols)
        stages = len(weights)
        coefficients = {
            "A": read_matrix(A, "A", symbols, rows=stages, columns=stages),
            "A_hat": read_matrix(A_hat, "A_hat", symbols, rows=stages, columns=stages),
            "b": weights,
            "b_hat": read_row(b_hat, "b_hat", symbols, count=stages),
        }
        self._set(coefficients, name=name, reference=reference, digits=digits)

    @property
    def stages(self) -> int:
        """The number of stages."""
        return len(self.b)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        registers = builder.unknowns(2 * self.stages)
        first, second = registers[::2], registers[1::2]
        for i, (k, derivative) in enumerate(zip(first, second, strict=True)):
            at = builder.y + combination(self.A[i], first) + combination(self.A_hat[i], second)
            builder.field(at, into=k)
            builder.derivative(at, k, into=derivative)
        return builder.y + combination(self.b, first) + combination(self.b_hat, second)
