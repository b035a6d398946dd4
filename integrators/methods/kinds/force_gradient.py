"""Splitting methods for second order equations whose kicks also use the gradient of the force."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from integrators.methods.program.program_method import ProgramMethod, read_parts
from integrators.methods.tableaux.tableau_input import read_row

if TYPE_CHECKING:
    from integrators.methods.program.child_bounds import ChildBounds
    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import ProgramBuilder
    from integrators.methods.tableaux.tableau_input import EntryRow


class ForceGradient(ProgramMethod):
    """A force-gradient method for q'' = g(q), as a system p' = g(q), q' = p.

    A step is q += a_1 h p, p += b_1 h g(q) + c_1 h³ g'(q) g(q), q += a_2 h p, … and ends with q += a_(s+1) h p. For
    g = −∇U a kick is the exact flow of b h U − c h³/2 ‖∇U‖², so the method is symplectic. With the gradients order 4 is
    possible without steps backwards in time.

    The part q of the field must be linear, q' = p (or q' = M⁻¹p with a constant matrix, then g' M⁻¹ g takes the place
    of g' g): trees are those of `RungeKuttaNystrom`.

    Args:
        drifts: the s + 1 numbers a_i.
        kicks: the s numbers b_i.
        gradients: the s numbers c_i.
        parts: the names of the parts for momenta and positions.
        parameters: the symbols that formulas in text may use.
        name: what messages call the method.
        reference: where the method was published.

    Raises:
        IntegratorError: the numbers are not as many as they must be, or one is none.

    Example:
        >>> print(ForceGradient(["1/2", "1/2"], [1], ["1/24"]))
        k1 = h f_q(y)
        k2 = h f_p(y + 1/2*k1)
        k3 = h f_q'(y + 1/2*k1) (k2)
        k4 = h f_p'(y + 1/2*k1) (k3)
        k5 = h f_q(y + 1/2*k1 + k2 + 1/24*k4)
        y1 = y + 1/2*k1 + k2 + 1/24*k4 + 1/2*k5

    References:
        S. A. Chin, Phys. Lett. A 226 (1997) 344–348, doi:10.1016/S0375-9601(97)00003-0.
    """

    drifts: EntryRow
    kicks: EntryRow
    gradients: EntryRow

    def __init__(
        self,
        drifts: Any,
        kicks: Any,
        gradients: Any,
        *,
        parts: Sequence[str] = ("p", "q"),
        parameters: Iterable[str] = (),
        name: str | None = None,
        reference: str | None = None,
    ) -> None:
        symbols = tuple(parameters)
        strengths = read_row(kicks, "kicks", symbols)
        coefficients = {
            "drifts": read_row(drifts, "drifts", symbols, count=len(strengths) + 1),
            "kicks": strengths,
            "gradients": read_row(gradients, "gradients", symbols, count=len(strengths)),
        }
        self._set(coefficients, parts=read_parts(parts, count=2), name=name, reference=reference)

    @property
    def stages(self) -> int:
        """The number of kicks."""
        return len(self.kicks)

    @cached_property
    def max_children(self) -> ChildBounds:
        """How often each part can be differentiated along p and along q: g depends on q, and q' is linear in p."""
        return (0, None), (1, 0)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        momentum, position = self.names
        y = builder.y
        for a, b, c in zip(self.drifts, self.kicks, self.gradients, strict=False):
            if a != 0:
                y = y + builder.field(y, position).times(a)
            force = builder.field(y, momentum)
            kick = force.times(b)
            if c != 0:
                shift = builder.derivative(y, force, position)  # h² g(q) in the positions
                kick = kick + builder.derivative(y, shift, momentum).times(c)
            y = y + kick
        last = self.drifts[-1]
        return y if last == 0 else y + builder.field(y, position).times(last)
