"""Runge–Kutta–Nyström methods for second-order differential equations."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from integrators.methods.program.evaluations import combination
from integrators.methods.program.program_method import ProgramMethod, read_parts
from integrators.methods.tableaux.tableau_input import read_matrix, read_row

if TYPE_CHECKING:
    from integrators.methods.program.child_bounds import ChildBounds
    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import ProgramBuilder
    from integrators.methods.tableaux.tableau_input import EntryRow, Matrix


class RungeKuttaNystrom(ProgramMethod):
    """A Runge–Kutta–Nyström method for q'' = g(q), or q'' = g(q, q'), as a system p' = g, q' = p.

    With k_i = g(q + c_i h p + h² Σ_j ā_ij k_j, p + h Σ_j a_ij k_j) the step is
    q1 = q + h p + h² Σ_i b̄_i k_i, p1 = p + h Σ_i b_i k_i; for q'' = g(q) the matrix a is not needed.

    The part q of the field must be linear, q' = p (or q' = M⁻¹p with a constant matrix). Nodes q of trees therefore
    have no child or one child p, and if g does not depend on p, nodes p have only children q: all other elementary
    differentials vanish, as stated by `max_children`.

    Args:
        A_bar: the matrix ā_ij of positions, by rows.
        b_bar: the weights b̄_i of the position.
        b: the weights b_i of the momentum.
        c: the nodes c_i.
        A: the matrix a_ij of momenta, for g(q, q'); None for g(q).
        parts: the names of the parts for momenta and positions.
        parameters: the symbols allowed in formulas.
        name: the name in messages.
        reference: the source.
        digits: the number of correct significant digits of decimal coefficients.

    Raises:
        IntegratorError: sizes that do not match, or an invalid entry.

    Example:
        The Störmer–Verlet method, as a Nyström method with two stages:

        >>> verlet = RungeKuttaNystrom([[0, 0], ["1/2", 0]], ["1/2", 0], ["1/2", "1/2"], [0, 1])
        >>> print(verlet)
        k1 = h f_q(y)
        k2 = h f_p(y)
        k3 = h f_q'(y) (1/2*k2)
        k4 = h f_p(y + k1 + k3)
        k5 = h f_q'(y) (1/2*k2)
        y1 = y + k1 + 1/2*k2 + 1/2*k4 + k5

    References:
        E. J. Nyström, Acta Soc. Sci. Fennicae 50 (1925) 1–55; Hairer, Nørsett, Wanner, *Solving Ordinary Differential
        Equations I*, II.14.
    """

    A_bar: Matrix
    b_bar: EntryRow
    b: EntryRow
    c: EntryRow
    A: Matrix | None

    def __init__(
        self,
        A_bar: Any,
        b_bar: Any,
        b: Any,
        c: Any,
        *,
        A: Any = None,
        parts: Sequence[str] = ("p", "q"),
        parameters: Iterable[str] = (),
        name: str | None = None,
        reference: str | None = None,
        digits: int | None = None,
    ) -> None:
        symbols = tuple(parameters)
        weights = read_row(b, "b", symbols)
        stages = len(weights)
        coefficients = {
            "A_bar": read_matrix(A_bar, "A_bar", symbols, rows=stages, columns=stages),
            "b_bar": read_row(b_bar, "b_bar", symbols, count=stages),
            "b": weights,
            "c": read_row(c, "c", symbols, count=stages),
            "A": None if A is None else read_matrix(A, "A", symbols, rows=stages, columns=stages),
        }
        self._set(coefficients, parts=read_parts(parts, count=2), name=name, reference=reference, digits=digits)

    @property
    def stages(self) -> int:
        """The number of stages."""
        return len(self.b)

    @cached_property
    def max_children(self) -> ChildBounds:
        """The degree of each part in p and in q: f^q is linear in p."""
        return (None if self.A else 0, None), (1, 0)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        momentum, position = self.names
        y = builder.y
        drift = builder.field(y, position)
        # A shift is h² Σ_j x_j k_j in the positions; zero rows need none.
        slots = [builder.unknowns(2 if any(x != 0 for x in row) else 1) for row in self.A_bar]
        k = [slot[-1] for slot in slots]
        for i, (*shift, increment) in enumerate(slots):
            at = y + drift.times(self.c[i])
            if shift:
                at = at + builder.derivative(y, combination(self.A_bar[i], k), position, into=shift[0])
            if self.A is not None:
                at = at + combination(self.A[i], k)
            builder.field(at, momentum, into=increment)
        return y + drift + builder.derivative(y, combination(self.b_bar, k), position) + combination(self.b, k)
