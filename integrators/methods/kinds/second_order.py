"""Methods for second-order equations q'' = g(q): Runge–Kutta–Nyström, force-gradient and Takahashi–Imada."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Unpack

from bseries_base.errors import shown
from integrators.core.errors import IntegratorError
from integrators.exact.entries import Entry, EntryRow, Matrix, read_entry
from integrators.methods.programs import builder as read
from integrators.methods.programs.builder import SECOND_ORDER, Labels, ProgramBuilder, ProgramMethod
from integrators.methods.programs.evaluations import LinearForm, combination


class RungeKuttaNystrom(ProgramMethod):
    """A Runge–Kutta–Nyström method for q'' = g(q), or q'' = g(q, q'), as a system p' = g, q' = p.

    With k_i = g(q + c_i h p + h² Σ_j ā_ij k_j, p + h Σ_j a_ij k_j) the step is
    q1 = q + h p + h² Σ_i b̄_i k_i, p1 = p + h Σ_i b_i k_i; for q'' = g(q) the matrix a is not needed.

    The part q of the field must be linear, q' = p (or q' = M⁻¹p with a constant matrix). Nodes q of trees therefore
    have no child or one child p, and if g does not depend on p, nodes p have only children q: all other elementary
    differentials vanish, as stated by `max_children`.

    Args:
        A_bar, A: the matrices ā_ij of positions and a_ij of momenta, by rows; for g(q) `A` is None.
        b_bar, b: the weights b̄_i of the position and b_i of the momentum.
        c: the nodes c_i.
        parts: the names of the parts for momenta and positions.
        parameters, name, reference, digits: as for `Splitting`.

    Raises:
        IntegratorError: sizes that do not match, or an invalid entry.

    Example:
        The Störmer–Verlet method, as a Nyström method with two stages:

        >>> import bseries as bs
        >>> verlet = bs.methods.RungeKuttaNystrom([[0, 0], ["1/2", 0]], ["1/2", 0], ["1/2", "1/2"], [0, 1])
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
        self, A_bar: object, b_bar: object, b: object, c: object, *, A: object = None,
        parts: Sequence[str] = ("p", "q"), **labels: Unpack[Labels],
    ) -> None:  # fmt: skip
        coefficients = read.read_stages({"b": b, "b_bar": b_bar, "c": c}, {"A_bar": A_bar, "A": A}, labels)
        self._set(coefficients, parts=read.read_parts(parts, count=2), **labels)
        self.__dict__["max_children"] = SECOND_ORDER if A is None else ((None, None), (1, 0))

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


class ForceGradient(ProgramMethod):
    """A force-gradient method for q'' = g(q), as a system p' = g(q), q' = p.

    A step is q += a_1 h p, p += b_1 h g(q) + c_1 h³ g'(q) g(q), q += a_2 h p, … and ends with q += a_(s+1) h p. For
    g = −∇U a kick is the exact flow of b h U − c h³/2 ‖∇U‖², so the method is symplectic. The gradient terms allow
    order 4 with positive coefficients.

    The part q of the field must be linear, q' = p (or q' = M⁻¹p with a constant matrix, with g' M⁻¹ g in place of
    g' g). The trees are those of `RungeKuttaNystrom`.

    Args:
        drifts, kicks, gradients: the s + 1 numbers a_i, the s numbers b_i, and the s numbers c_i.
        parts: the names of the parts for momenta and positions.
        parameters, name, reference, digits: as for `Splitting`.

    Raises:
        IntegratorError: the numbers of coefficients do not match, or a coefficient is invalid.

    Example:
        >>> import bseries as bs
        >>> print(bs.methods.ForceGradient(["1/2", "1/2"], [1], ["1/24"]))
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
        self, drifts: object, kicks: object, gradients: object, *, parts: Sequence[str] = ("p", "q"),
        **labels: Unpack[Labels],
    ) -> None:  # fmt: skip
        labels["parameters"] = tuple(labels.get("parameters", ()))
        coefficients = read.read_stages({"kicks": kicks, "gradients": gradients}, {}, labels)
        most = len(coefficients["kicks"]) + 1
        coefficients["drifts"] = read.read_row(drifts, "drifts", labels["parameters"], count=most)
        self._set(coefficients, parts=read.read_parts(parts, count=2), **labels)

    max_children = SECOND_ORDER

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


class TakahashiImada(ProgramMethod):
    """The Takahashi–Imada method for q'' = f(q), as a system p' = f(q), q' = p: Störmer–Verlet with a modified force.

    With F(q) = (I + α h² f'(q)) f(q) the step is p½ = p + h/2 F(q), q1 = q + h p½, p1 = p½ + h/2 F(q1). For f = −∇U it
    is symplectic: the Störmer–Verlet method for the potential U − α h²/2 ‖∇U‖². With α = 1/12 it has order 2 and is
    conjugate to a method of order 4. The simplified form F(q) = f(q + α h² f(q)) needs no derivative of the force; it
    preserves volume, but is symplectic for one degree of freedom only.

    The part q of the field must be linear, q' = p (or q' = M⁻¹p with a constant matrix, then F = (I + α h² f' M⁻¹) f).
    The trees are those of `RungeKuttaNystrom`.

    Args:
        alpha: the number α.
        simplified: whether to use the simplified form.
        parts: the names of the parts for momenta and positions.
        parameters, name, reference: as for `Splitting`.

    Raises:
        IntegratorError: α is not a number or formula, or a name is invalid.

    Example:
        >>> import bseries as bs
        >>> print(bs.methods.TakahashiImada(simplified=True))
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
        self, alpha: object = "1/12", *, simplified: bool = False, parts: Sequence[str] = ("p", "q"),
        parameters: Iterable[str] = (), name: str | None = None, reference: str | None = None,
    ) -> None:  # fmt: skip
        if not isinstance(simplified, bool):
            raise IntegratorError(f"simplified must be True or False, but was {shown(simplified)}")
        coefficients = {"alpha": read_entry(alpha, "alpha", tuple(parameters)), "simplified": simplified}
        self._set(coefficients, parts=read.read_parts(parts, count=2), name=name, reference=reference)

    @property
    def symplectic_form(self) -> TakahashiImada:
        """The form with the derivative of the force, symplectic and O(h⁵) from the simplified form."""
        if not self.simplified:
            return self
        return TakahashiImada(self.alpha, parts=self.names, name="takahashi-imada", reference=self.reference)

    @property
    def stages(self) -> int:
        """The number of force evaluations in a step, one at each end."""
        return 2

    max_children = SECOND_ORDER

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
