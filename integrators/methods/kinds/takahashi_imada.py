"""The method of Takahashi and Imada for second order equations, and its simplified form."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError, shorten
from integrators.exact.entries import read_entry
from integrators.methods.program.program_method import ProgramMethod, read_parts

if TYPE_CHECKING:
    from integrators.exact.entries import Entry
    from integrators.methods.program.child_bounds import ChildBounds
    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import ProgramBuilder


class TakahashiImada(ProgramMethod):
    """The Takahashi–Imada method for q'' = f(q), as a system p' = f(q), q' = p: Störmer–Verlet with a better force.

    With F(q) = (I + α h² f'(q)) f(q) the step is p½ = p + h/2 F(q), q1 = q + h p½, p1 = p½ + h/2 F(q1). For f = −∇U it
    is symplectic: the Störmer–Verlet method for the potential U − α h²/2 ‖∇U‖². With α = 1/12 it has order 2 and is
    conjugate to a method of order 4. The simplified form F(q) = f(q + α h² f(q)) needs no derivative of the force; it
    preserves volume, but is symplectic for one degree of freedom only.

    The part q of the field must be linear, q' = p (or q' = M⁻¹p with a constant matrix, then F = (I + α h² f' M⁻¹) f):
    trees are those of `RungeKuttaNystrom`.

    Args:
        alpha: the number α.
        simplified: whether to use the simplified form.
        parts: the names of the parts for momenta and positions.
        parameters: the symbols that a formula for α in text may use.
        name: what messages call the method.
        reference: where the method was published.

    Raises:
        IntegratorError: α is no number or formula, or a name is unusable.

    Example:
        >>> print(TakahashiImada(simplified=True))
        k1 = h f_p(y)
        k2 = h f_q'(y) (k1)
        k3 = h f_p(y + 1/12*k2)
        k4 = h f_q(y + 1/2*k3)
        k5 = h f_p(y + 1/2*k3 + k4)
        k6 = h f_q'(y + 1/2*k3 + k4) (k5)
        k7 = h f_p(y + 1/2*k3 + k4 + 1/12*k6)
        y1 = y + 1/2*k3 + k4 + 1/2*k7

    References:
        M. Takahashi, M. Imada, J. Phys. Soc. Japan 53 (1984) 3765–3769, doi:10.1143/JPSJ.53.3765;
        E. Hairer, R. I. McLachlan, R. D. Skeel, ESAIM: M2AN 43 (2009) 631–644, doi:10.1051/m2an/2009019.
    """

    alpha: Entry
    simplified: bool

    def __init__(
        self,
        alpha: Any = "1/12",
        *,
        simplified: bool = False,
        parts: Sequence[str] = ("p", "q"),
        parameters: Iterable[str] = (),
        name: str | None = None,
        reference: str | None = None,
    ) -> None:
        if not isinstance(simplified, bool):
            raise IntegratorError(f"simplified must be True or False, but was {shorten(repr(simplified))}")
        coefficients = {"alpha": read_entry(alpha, "alpha", tuple(parameters)), "simplified": simplified}
        self._set(coefficients, parts=read_parts(parts, count=2), name=name, reference=reference)

    @property
    def symplectic_form(self) -> TakahashiImada:
        """The method with the derivative of the force, of which the simplified form is a perturbation of order h⁵."""
        if not self.simplified:
            return self
        return TakahashiImada(self.alpha, parts=self.names, name="takahashi-imada", reference=self.reference)

    @property
    def stages(self) -> int:
        """The number of forces in a step: one at each end."""
        return 2

    @cached_property
    def max_children(self) -> ChildBounds:
        """How often each part can be differentiated along p and along q: f depends on q, and q' = p."""
        return (0, None), (1, 0)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        y = builder.y
        y = y + self._force(builder, y) / 2
        y = y + builder.field(y, self.names[1])
        return y + self._force(builder, y) / 2

    def _force(self, builder: ProgramBuilder, at: LinearForm) -> LinearForm:
        """h F at a point, a vector in the momenta."""
        momentum, position = self.names
        force = builder.field(at, momentum)
        shift = builder.derivative(at, force, position)  # h² f(q) in the positions
        if self.simplified:
            return builder.field(at + shift.times(self.alpha), momentum)
        return force + builder.derivative(at, shift, momentum).times(self.alpha)
