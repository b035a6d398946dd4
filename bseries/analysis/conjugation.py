"""Lie bracket, conjugation, effective order, and conjugate symplecticity.

A method has the long-time behaviour of its conjugates: n steps of χ⁻¹ ∘ Φ ∘ χ are χ⁻¹ ∘ Φⁿ ∘ χ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from bseries.algebra.bseries import BSeries, check_field, check_flow
from bseries.algebra.composition import compose, lie_derivative
from bseries.analysis.homological_equation import ConjugateSymplectic, EffectiveOrder, ProcessorTerm
from bseries.analysis.verdicts import failing, flows_of, has_blocks
from bseries.exact.domains import RingValues, divided, make_values, ring_element
from bseries.exceptions import SeriesError

if TYPE_CHECKING:
    from bseries.analysis.verdicts import Coloring
    from integrators.methods.program.program import Method
    from trees.tree import Tree


def bracket(b: BSeries, c: BSeries) -> BSeries:
    """Lie bracket of two fields: ∂_b c − ∂_c b.

    With B and C the vector fields of the series, it is the series of [B, C] = C'B − B'C: the derivative of C along B
    minus that of B along C.

    Args:
        b: A field.
        c: A field on the same trees.

    Returns:
        A field.

    Raises:
        SeriesError: An argument is no field, or the trees differ.

    Example:
        >>> import bseries as bs
        >>> f = bs.exact_flow(3).log()
        >>> tall = bs.BSeries.from_rule(lambda tree: int(str(tree) == "[τ]"), 3, empty=0)
        >>> [(str(tree), str(value)) for tree, value in bracket(f, tall).nonzero()]
        [('[τ,τ]', '2')]

    References:
        HLW, section III.5.1 and lemma IX.9.1.
    """
    check_field(b, "b")
    check_field(c, "c")
    return lie_derivative(b, c) - lie_derivative(c, b)


def conjugate(a: BSeries, c: BSeries) -> BSeries:
    """Conjugate method χ⁻¹ ∘ Φ ∘ χ: first c, then a, then the inverse of c.

    With Φ and χ the maps of a and c, this is compose(compose(c, a), c.inverse()), Butcher's product c a c⁻¹: c is the
    starting method, its inverse the finishing method. n steps of the conjugate method are c, n steps of a, and the
    inverse of c.

    Args:
        a: A flow.
        c: The flow to conjugate with.

    Returns:
        A flow.

    Raises:
        SeriesError: An argument is no flow, or the trees differ.

    Example:
        The trapezoidal rule and the implicit midpoint rule are conjugate by half a step of the explicit Euler method:

        >>> import bseries as bs
        >>> half = bs.series(bs.method("explicit-euler"), 6).scale_step(Fraction(1, 2))
        >>> midpoint = bs.series(bs.method("implicit-midpoint"), 6)
        >>> conjugate(midpoint, half) == bs.series(bs.method("trapezoidal"), 6)
        True

    References:
        HLW, section VI.8; J. C. Butcher, *Numerical Methods for Ordinary Differential Equations*, section 389.
    """
    check_flow(a, "a")
    check_flow(c, "c")
    return compose(compose(c, a), c.inverse())


class ConjugateVerdict(NamedTuple):
    """The order up to which a method is conjugate to one with a property.

    Attributes:
        order: The largest k ≤ `tested_to` such that a conjugate method has the property for all trees to k nodes.
        breaks: The first tree for which no processor gives the property, or None.
        tested_to: The largest number of nodes tested.
        processor: The flow c such that conjugate(a, c) has the property up to `order`.

    Example:
        >>> import bseries as bs
        >>> verdict = bs.effective_order(bs.method("trapezoidal"), 4)
        >>> verdict.order, verdict.holds
        (2, False)
    """

    order: int
    breaks: Tree | None
    tested_to: int
    processor: BSeries

    @property
    def holds(self) -> bool:
        """Whether no tree violates the property."""
        return self.breaks is None


def effective_order(method: Method | BSeries, order: int | None = None) -> ConjugateVerdict:
    """Effective order: the largest order of accuracy of a conjugate method, with the processor that gives it.

    Order by order, [f, g_n] = b_{n+1} is solved for the next term of g, the logarithm of the processor, with b the
    modified equation of the method conjugated by the terms found so far. The solution is unique up to multiples of f in
    g₁, which are time shifts and have no effect.

    Args:
        method: A method, or a flow.
        order: The largest number of nodes; by default the order of a series, and for a method that of `check`.

    Returns:
        A `ConjugateVerdict`: conjugate(a, processor) has the order found.

    Raises:
        SeriesError: `method` is neither a method nor a flow, `order` exceeds the order of the series, or its trees are
            neither all trees nor those of separable or of Nyström systems.

    Example:
        For separable systems the symplectic Euler method is conjugate to the Störmer–Verlet method, of order 2:

        >>> import bseries as bs
        >>> euler = bs.series(bs.method("symplectic-euler-p"), 5, max_children=[[0, None], [None, 0]])
        >>> verdict = effective_order(euler)
        >>> bs.order_of(euler), verdict.order, bs.order_of(conjugate(euler, verdict.processor))
        (1, 2, 2)

    References:
        J. C. Butcher, *The effective order of Runge–Kutta methods*, Lecture Notes in Mathematics 109 (1969),
        doi:10.1007/BFb0060019; S. Blanes, F. Casas, A. Murua, SIAM J. Numer. Anal. 42 (2004), 531–552 (processing).
    """
    flows = flows_of(method, order)
    table = flows[0].table
    node = _inconsistent(flows)
    if node is not None:
        return ConjugateVerdict(0, table[node], table.max_order, flows[0] ** 0)
    return _solve(flows, EffectiveOrder(table))


def conjugate_symplecticity(
    method: Method | BSeries, order: int | None = None, *, colors_are: Coloring = None
) -> ConjugateVerdict:
    """Order to which a method is conjugate to a symplectic one, by a map with a B-series.

    Order by order, the next term g_n of the processor's logarithm makes b_{n+1} + [g_n, f] Hamiltonian. It is
    determined up to Hamiltonian fields, which conjugate symplectic methods to symplectic ones. (With ρ(u, v) =
    g(u ∘ v) + g(v ∘ u) the equations read Σ ρ(u without a leaf, v) + Σ ρ(u, v without a leaf) = r(u, v). They determine
    ρ, and any symmetric function ρ belongs to some g.)

    Args:
        method: A consistent method, or its flow.
        order: The largest number of nodes; by default the order of a series, and for a method that of `check`.
        colors_are: As for `symplecticity`.

    Returns:
        A `ConjugateVerdict`: conjugate(a, processor) is symplectic up to the order found.

    Raises:
        SeriesError: `method` is neither a method nor a flow, or is inconsistent; `order` exceeds the order of the
            series; or its trees are neither all trees nor those of a separable system.

    Example:
        >>> import bseries as bs
        >>> conjugate_symplecticity(bs.method("trapezoidal"), 6).holds
        True
        >>> conjugate_symplecticity(bs.method("rk4"), 6).order
        4

    References:
        E. Hairer, C. J. Zbinden, *On conjugate symplecticity of B-series integrators*, IMA J. Numer. Anal. 33 (2013).
        P. Chartier, E. Faou, A. Murua, Numer. Math. 103 (2006), 575–590.
    """
    flows = flows_of(method, order)
    table = flows[0].table
    node = _inconsistent(flows)
    if node is not None:
        found = flows[0].stored[node]
        raise SeriesError(f"method must be consistent, with the coefficient 1 of {table[node]}, but has {found!s:.60}")
    return _solve(flows, ConjugateSymplectic(table, has_blocks(flows[0], colors_are)))


class _Problem(Protocol):
    def step(self, n: int, b: list[Any], number: Callable[[Fraction], Any]) -> ProcessorTerm: ...


def _solve(flows: Sequence[BSeries], problem: _Problem) -> ConjugateVerdict:
    """Find the logarithm g of the processor order by order, for a flow and its samples."""
    table = flows[0].table
    logarithms: list[list[Any]] = [[Fraction(0)] * len(table) for _ in flows]
    order, violating = table.max_order, None
    for n in range(1, table.max_order):
        steps, outs = [], []
        for s, g in zip(flows, logarithms, strict=True):
            b, number, public = field_elements(conjugate(s.truncate(n + 1), _processor(s, g, n + 1)).log())
            steps.append(problem.step(n, b, number))
            outs.append(public)
        residuals, *nearby = (step.residuals for step in steps)
        violating = min((steps[0].breaks[k] for k in failing(residuals, nearby)), default=None)
        if violating is not None:
            order = n
            break
        for step, g, public in zip(steps, logarithms, outs, strict=True):
            for tree, value in step.term.items():
                g[tree] = _rounded(public(value), flows[0].digits)
    breaks = None if violating is None else table[violating]
    return ConjugateVerdict(order, breaks, table.max_order, _processor(flows[0], logarithms[0], table.max_order))


def _rounded(value: Any, digits: int | None) -> Any:
    """A coefficient of the processor; for a method in decimals rounded to ten digits more than it has."""
    return value if digits is None else Fraction(round(value * 10 ** (digits + 10)), 10 ** (digits + 10))


def _inconsistent(flows: Sequence[BSeries]) -> int | None:
    """The first single node whose coefficient is not 1."""
    nodes = range(flows[0].table.colors)
    residuals, *nearby = ([s.stored[node] - 1 for node in nodes] for s in flows)
    return next(failing(residuals, nearby), None)


def _processor(s: BSeries, g: Sequence[Any], order: int) -> BSeries:
    """The flow exp g on the trees of a series, up to some order."""
    table = s.truncate(order).table
    return BSeries(table, make_values(table, g[: len(table)]), 0, names=s.names).exp()


def field_elements(b: BSeries) -> tuple[list[Any], Callable[[Fraction], Any], Callable[[Any], Any]]:
    """Coefficients in a field, the conversion of a Fraction to the field, and that of an element to a coefficient."""
    values: Any = b.stored
    if isinstance(values, RingValues):
        values = divided(values)
        return list(values.elements), partial(ring_element, values.ring), values.ring.to_sympy
    return values.coefficients(), Fraction, Fraction
