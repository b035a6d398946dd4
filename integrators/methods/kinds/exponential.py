"""Lawson (integrating factor) methods: a Runge–Kutta method in variables transformed by the linear flow."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any

from integrators.core.errors import IntegratorError, shown
from integrators.exact.entries import Entry, multiply_entries, sum_entries
from integrators.methods.programs.builder import ProgramBuilder, ProgramMethod, read_parts
from integrators.methods.programs.evaluations import LinearForm
from integrators.methods.programs.program import ChildBounds
from integrators.methods.tableaux.runge_kutta import RungeKutta


class LawsonMethod(ProgramMethod):
    """A Lawson method (integrating factor method) for y' = L y + N(y).

    It applies a Runge–Kutta method to v(t) = exp(−tL) y(t). In terms of y:
    Y_i = exp(c_i h L) y0 + h Σ_j a_ij exp((c_i − c_j) h L) N(Y_j), and
    y1 = exp(h L) y0 + h Σ_j b_j exp((1 − c_j) h L) N(Y_j).

    The first part of the field must be linear: its nodes in trees have at most one child.

    Args:
        tableau: an explicit Runge–Kutta method.
        parts: the names of the linear and of the nonlinear part.
        name: the name in messages.
        reference: the source.

    Raises:
        IntegratorError: `tableau` is not an explicit `RungeKutta`, or a name is invalid.

    Example:
        The Lawson–Euler method y1 = exp(hL) (y0 + h N(y0)):

        >>> print(LawsonMethod(RungeKutta([[0]], [1])))
        k1 = h f_N(y)
        k2 = z(1) - z(0), z' = h f_L(z), z(0) = y + k1
        y1 = y + k1 + k2

    References:
        J. D. Lawson, SIAM J. Numer. Anal. 4 (1967) 372–380, doi:10.1137/0704033; M. Hochbruck, A. Ostermann,
        Acta Numerica 19 (2010) 209–286, doi:10.1017/S0962492910000048.
    """

    tableau: RungeKutta

    def __init__(
        self, tableau: RungeKutta, *, parts: Sequence[str] = ("L", "N"), name: str | None = None,
        reference: str | None = None,
    ) -> None:  # fmt: skip
        if not isinstance(tableau, RungeKutta) or not tableau.is_explicit:
            raise IntegratorError(f"tableau must be an explicit RungeKutta, but was {shown(tableau)}")
        labels = {"name": name, "reference": reference, "digits": tableau.digits}
        self._set({"tableau": tableau}, parts=read_parts(parts, count=2), **labels)

    @property
    def stages(self) -> int:
        """The number of stages."""
        return self.tableau.stages

    @cached_property
    def max_children(self) -> ChildBounds:
        """The degree of each part in the two parts and in total: L y is linear."""
        return (1, 1, 1), (None, None, None)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        tableau = self.tableau
        propagator = _Propagator(builder, self.names[0])
        k: list[LinearForm] = []
        for row, c in zip(tableau.A, tableau.c, strict=True):
            k.append(builder.field(propagator.point(c, row, tableau.c, k), self.names[1]))
        return propagator.point(Fraction(1), tableau.b, tableau.c, k)


class _Propagator:
    """Propagation of points and vectors by the flow of the linear part."""

    def __init__(self, builder: ProgramBuilder, part: str) -> None:
        self._builder, self._part = builder, part
        self._known: dict[tuple[LinearForm, Entry], LinearForm] = {}

    def point(
        self, time: Entry, weights: Sequence[Entry], nodes: Sequence[Entry], k: Sequence[LinearForm]
    ) -> LinearForm:
        """exp(time·hL) y + Σ_j weights[j] exp((time − nodes[j])·hL) k_j, one flow for each node."""
        vectors: dict[Entry, LinearForm] = {}
        for x, node, vector in zip(weights, nodes, k, strict=False):
            if x != 0:
                vectors[node] = vectors.get(node, 0) + vector.times(x)
        y = self._builder.y
        total = self._flow(y + vectors.pop(Fraction(0), 0 * y), time)
        for node, vector in vectors.items():
            elapsed = sum_entries((time, multiply_entries(node, Fraction(-1))))
            # exp(tL) v = exp(tL) (y + v) − exp(tL) y, as L is linear
            total = total + self._flow(y + vector, elapsed) - self._flow(y, elapsed)
        return total

    def _flow(self, at: LinearForm, time: Any) -> LinearForm:
        """exp(time·hL) at."""
        if time == 0:
            return at
        if (at, time) not in self._known:
            self._known[at, time] = self._builder.flow(at, self._part, time=time)
        return at + self._known[at, time]
