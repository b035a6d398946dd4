"""Structure of methods and series: each test gives the order up to which it holds, and the first tree that breaks it.

A structure is decided for all fields of its class at once: that a method is symplectic for one particular Hamiltonian
system is not asked here. For smaller classes there are series on restricted tables; methods for special systems, which
know their `max_children`, are decided on those. What a tableau alone decides for every order is in
`RungeKutta` and `PartitionedRungeKutta`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bseries.algebra.bseries import BSeries, check_field, check_flow
from bseries.algebra.stages import auxiliary_colors
from bseries.analysis.order import first_failure
from bseries.analysis.structure_conditions import (
    closure,
    cubic_conditions,
    energy_conditions,
    hamiltonian_conditions,
    symmetry_conditions,
    volume_conditions,
)
from bseries.analysis.verdicts import Verdict, decide, fields_of, flows_of, samples_of, series_of, verdict
from bseries.exceptions import SeriesError

if TYPE_CHECKING:
    from integrators.methods.program.program import Method

    Coloring = Literal["blocks", "parts"] | None


def has_blocks(s: BSeries, colors_are: Coloring) -> bool:
    """Whether the colours of a series are blocks of variables: by default if they are called p and q."""
    if colors_are not in (None, "blocks", "parts"):
        raise SeriesError(f"colors_are must be 'blocks' or 'parts', but was {colors_are!r:.60}")
    if colors_are == "blocks" and s.table.colors != 2:
        raise SeriesError(f"colors_are must be 'parts' unless there are two colours, but there are {s.table.colors}")
    return set(s.names) == {"p", "q"} if colors_are is None else colors_are == "blocks"


def accuracy(method: Method | BSeries, order: int | None = None) -> Verdict:
    """How far a method agrees with the exact flow: its order, seen from trees.

    Args:
        method: A method, or a flow.
        order: Up to how many nodes to look; None means the order of a series, and for a method as far as `check`.

    Returns:
        A `Verdict`; its order is the order of the method if a tree breaks it.

    Raises:
        SeriesError: `method` is neither a method nor a flow, or `order` exceeds the order of the series.

    Example:
        >>> import bseries as bs
        >>> accuracy(bs.method("rk4"), 6)[:2]
        (4, Tree('[[[[τ]]]]'))

    References:
        HLW, theorem III.1.5. `order_of` needs no trees where simplifying assumptions do.
    """
    s = series_of(method, order)
    check_flow(s, "method")
    auxiliary = frozenset() if isinstance(method, BSeries) else auxiliary_colors(method)
    return verdict(s.table, first_failure(s, auxiliary))


def symmetry(method: Method | BSeries, order: int | None = None) -> Verdict:
    """How far a method is symmetric: equal to its adjoint.

    The modified equation of a symmetric method has even powers of h only, its trees odd numbers of nodes.

    Args:
        method: A method, or a flow.
        order: Up to how many nodes to look; None means the order of a series, and for a method as far as `check`.

    Returns:
        A `Verdict`.

    Raises:
        SeriesError: `method` is neither a method nor a flow, or `order` exceeds the order of the series.

    Example:
        >>> import bseries as bs
        >>> symmetry(bs.method("trapezoidal"), 6).holds, symmetry(bs.method("heun2"), 6).order
        (True, 3)

    References:
        HLW, theorems II.3.2 and IX.2.2.
    """
    fields = [s.log() for s in flows_of(method, order)]
    return decide(symmetry_conditions(fields[0].table, False), fields)


def symplecticity(method: Method | BSeries, order: int | None = None, *, colors_are: Coloring = None) -> Verdict:
    """How far a method is symplectic on Hamiltonian systems, and conserves quadratic invariants of any system.

    The conditions are a(u ∘ v) + a(v ∘ u) = a(u) a(v) for all trees u and v. Where colours are blocks they are asked of
    roots u in p and v in q, and a must not depend on the colour of the root; then the invariants are those of the form
    pᵀ E q. For series on the trees of separable systems the second condition does not arise.

    Args:
        method: A method, or a flow.
        order: Up to how many nodes to look; None means the order of a series, and for a method as far as `check`.
        colors_are: ``"blocks"`` p and q of the variables of one Hamiltonian system, or ``"parts"`` of a sum of
            Hamiltonian systems, f = Σ f^[ν]. By default blocks if the colours are called p and q.

    Returns:
        A `Verdict`.

    Raises:
        SeriesError: `method` is neither a method nor a flow, `order` exceeds the order of the series, or colours are
            blocks on a restricted table of trees that are not those of separable systems.

    Example:
        >>> import bseries as bs
        >>> symplecticity(bs.method("implicit-midpoint"), 8).holds, symplecticity(bs.method("radau-iia2"), 8).order
        (True, 3)
        >>> symplecticity(bs.method("stormer-verlet"), 5).holds
        True

    References:
        HLW, section VI.7 (quadratic invariants first, symplecticity from them; B-series, then P-series).
        A. L. Araújo, A. Murua, J. M. Sanz-Serna, SIAM J. Numer. Anal. 34 (1997), 1926–1947 (parts).
    """
    flows = flows_of(method, order)
    table, blocks = flows[0].table, has_blocks(flows[0], colors_are)
    conditions = hamiltonian_conditions(table, blocks)
    if closure(table, blocks) == table:
        return decide(conditions, flows, flow=True)
    return decide(conditions, [s.log() for s in flows])


def hamiltonian_field(field: BSeries, order: int | None = None, *, colors_are: Coloring = None) -> Verdict:
    """How far a field is Hamiltonian whenever f is: b(u ∘ v) + b(v ∘ u) = 0.

    Args:
        field: A field series, such as a modified equation.
        order: Up to how many nodes to look; None means the order of the series.
        colors_are: As for `symplecticity`.

    Returns:
        A `Verdict`.

    Raises:
        SeriesError: `field` is no field, `order` exceeds its order, or its trees are refused as by `symplecticity`.

    Example:
        >>> import bseries as bs
        >>> hamiltonian_field(bs.modified_equation(bs.method("gauss2"), 7)).holds
        True
        >>> hamiltonian_field(bs.modified_equation(bs.method("lobatto-iiia3"), 7))[:2]
        (4, Tree('[τ,[[τ]]]'))

    References:
        HLW, section IX.9 on elementary Hamiltonians, section IX.10 for blocks.
    """
    check_field(field, "field")
    fields = samples_of(field, order)
    return decide(hamiltonian_conditions(fields[0].table, has_blocks(fields[0], colors_are)), fields)


def energy_preservation(method: Method | BSeries, order: int | None = None, *, colors_are: Coloring = None) -> Verdict:
    """How far a method conserves H on all systems y' = J ∇H(y) with a constant skew matrix J.

    With b the modified equation, Σ ± b(T without a leaf, rooted next to it) = 0 over the leaves of every free tree T
    that is not superfluous.

    Args:
        method: A method, a flow, or a field.
        order: Up to how many nodes to look; None means the order of a series, and for a method as far as `check`.
        colors_are: ``"blocks"``: p' = −H_q, q' = H_p; ``"parts"``: f = Σ J ∇H^[ν], and the sum of all H^[ν] is to be
            conserved. By default blocks if the colours are called p and q.

    Returns:
        A `Verdict`.

    Raises:
        SeriesError: `method` is neither a method nor a series, `order` exceeds the order of the series, or its trees
            are refused as by `symplecticity`.

    Example:
        >>> import bseries as bs
        >>> energy_preservation(bs.method("implicit-midpoint"), 7)[:2]
        (2, Tree('[τ,τ]'))

    References:
        E. Faou, E. Hairer, T.-L. Pham, BIT 44 (2004), 699–709; HLW, section IX.9.
        E. Celledoni, R. I. McLachlan, B. Owren, G. R. W. Quispel, Found. Comput. Math. 10 (2010), 673–693,
        doi:10.1007/s10208-010-9073-1.
    """
    fields = fields_of(method, order)
    return decide(energy_conditions(fields[0].table, has_blocks(fields[0], colors_are)), fields)


def volume_preservation(method: Method | BSeries, order: int | None = None, *, colors_are: Coloring = None) -> Verdict:
    """How far a method preserves volume for all divergence-free systems.

    With b the modified equation, Σ b(u₁ ∘ (u₂ ∘ (… ∘ u_m))) = 0 over the rotations of every cycle of m ≥ 2 trees.

    For one field f no B-series but that of the exact flow (of a multiple of f) satisfies all conditions: the order is
    that of accuracy. Splitting methods, compositions of the exact flows of divergence-free parts, satisfy them, and no
    other series does. In separable systems, p' = f(q) and q' = g(p), both blocks are such parts. For Hamiltonian
    systems symplectic methods preserve volume as well; that is a smaller class of systems, and not what is asked here.

    Args:
        method: A method, a flow, or a field.
        order: Up to how many nodes to look; None means the order of a series, and for a method as far as `check`.
        colors_are: ``"blocks"``: the whole field is divergence-free; ``"parts"``: each f^[ν] is. By default blocks if
            the colours are called p and q.

    Returns:
        A `Verdict`.

    Raises:
        SeriesError: `method` is neither a method nor a series, or `order` exceeds the order of the series.

    Example:
        >>> import bseries as bs
        >>> volume_preservation(bs.method("gauss2"), 6).order, volume_preservation(bs.exact_flow(6)).holds
        (4, True)
        >>> separable = bs.series(bs.method("symplectic-euler-p"), 6, max_children=[[0, None], [None, 0]])
        >>> volume_preservation(separable).holds, volume_preservation(bs.method("symplectic-euler-p"), 3).order
        (True, 1)

    References:
        A. Iserles, G. R. W. Quispel, P. S. P. Tse, BIT 47 (2007), 351–378.
        P. Chartier, A. Murua, IMA J. Numer. Anal. 27 (2007), 381–405, doi:10.1093/imanum/drl039.
    """
    fields = fields_of(method, order)
    return decide(volume_conditions(fields[0].table, has_blocks(fields[0], colors_are)), fields)


def cubic_invariants(method: Method | BSeries, order: int | None = None, *, colors_are: Coloring = None) -> Verdict:
    """How far a method conserves all polynomial invariants of degree up to three.

    With b the modified equation, b(u ∘ v) + b(v ∘ u) = 0 and b(u ∘ v ∘ w) + b(v ∘ w ∘ u) + b(w ∘ u ∘ v) = 0.

    For one field f no B-series but that of the exact flow (of a multiple of f) satisfies all conditions; for a sum of
    fields that share the invariants, compositions of their exact flows do, and no others. So a series that conserves
    cubic invariants conserves invariants of every degree.

    Args:
        method: A method, a flow, or a field.
        order: Up to how many nodes to look; None means the order of a series, and for a method as far as `check`.
        colors_are: ``"blocks"``: the whole field has the invariant; ``"parts"``: each f^[ν] has it. By default blocks
            if the colours are called p and q.

    Returns:
        A `Verdict`.

    Raises:
        SeriesError: `method` is neither a method nor a series, `order` exceeds the order of the series, or the series
            is on a restricted table.

    Example:
        >>> import bseries as bs
        >>> cubic_invariants(bs.method("gauss3"), 7)[:2]
        (6, Tree('[[[τ]],[[τ]]]'))

    References:
        P. Chartier, A. Murua, IMA J. Numer. Anal. 27 (2007), 381–405, doi:10.1093/imanum/drl039.
    """
    fields = fields_of(method, order)
    return decide(cubic_conditions(fields[0].table, has_blocks(fields[0], colors_are)), fields)
