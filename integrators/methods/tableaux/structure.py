"""What the tableau alone decides: consistency, symmetry and symplecticity.

A method given by a stage algebra is decided by rational bilinear forms wherever possible, its roots never computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import mul
from typing import TYPE_CHECKING

from integrators.core.errors import shorten
from integrators.exact import polynomials
from integrators.exact.entries import cancels, is_sympy, round_entry
from integrators.exact.expressions import format_number

if TYPE_CHECKING:
    from integrators.exact.entries import Entry
    from integrators.methods.tableaux.runge_kutta import RungeKutta
    from integrators.methods.tableaux.stage_algebra import StageAlgebra


def find_issues(method: RungeKutta) -> tuple[str, ...]:
    """One sentence for each row sum that is not its node, and one if the weights do not sum to 1."""
    algebra = method.algebra
    if algebra is None:
        agree = [cancels((*row, -node), method.precision) for row, node in zip(method.A, method.c, strict=True)]
    elif algebra.row_sums == polynomials.remainder(polynomials.X, algebra.polynomial):
        agree = []
    else:
        gap = polynomials.add(algebra.row_sums, polynomials.scale(polynomials.X, -1))
        agree = [value == 0 for value in algebra.values(gap)]
    found = [
        f"row {i + 1} of A sums to {_shown(method.row_sums[i])}, but c[{i + 1}] is {_shown(method.c[i])}"
        for i, agrees in enumerate(agree)
        if agrees is False
    ]
    consistent = cancels((*method.b, -1), method.precision) if algebra is None else algebra.b[0] == 1
    if consistent is False:
        found.append(f"weights b sum to {_shown(method.weight_sum)}, not 1: the method is inconsistent")
    return tuple(found)


def _shown(value: Entry) -> str:
    return shorten(format_number(value))


def is_symplectic_pair(first: RungeKutta, second: RungeKutta) -> bool:
    """Whether b_i = b̂_i and b_i â_ij + b̂_j a_ji = b_i b̂_j for all i and j (HLW, Theorems VI.4.3 and VI.4.6)."""
    one, other = first.algebra, second.algebra
    if one is not None and other is not None and one.polynomial == other.polynomial:
        return _is_symplectic_algebra(one, other)
    precision = max(first.precision, second.precision)
    b, b_hat, stages = first.b, second.b, range(first.stages)
    return all(cancels((b[i], -b_hat[i]), precision) for i in stages) and all(
        cancels((b[i] * second.A[i][j], b_hat[j] * first.A[j][i], -b[i] * b_hat[j]), precision)
        for i in stages
        for j in stages
    )


def _is_symplectic_algebra(first: StageAlgebra, second: StageAlgebra) -> bool:
    """The same for all stage values f and g at once, on the basis 1, x, …: b(f · Âg) + b(Af · g) = b(f) b(g)."""
    b, basis = first.b, range(first.stages)
    moments = first.moments(2 * len(b) - 1)  # the matrix of b(f · g) has the entries b(x^(k+l))
    left, right = (
        [[sum(map(mul, moments[k : k + len(b)], column)) for column in zip(*algebra.A, strict=True)] for k in basis]
        for algebra in (second, first)
    )
    return b == second.b and all(left[k][j] + right[j][k] == b[k] * b[j] for k in basis for j in basis)


def is_symmetric(parts: Sequence[RungeKutta]) -> bool:
    """Whether all parts satisfy a_σ(i)σ(j) + a_ij = b_j for one reversal σ of the stages (HLW, Theorem V.2.3).

    The reversal is that of the stages as they stand or, should they not be in order of their nodes, sorted by row sums.
    That b_σ(j) = b_j follows.
    """
    algebras = [part.algebra for part in parts if part.algebra is not None and _has_symmetric_nodes(part.algebra)]
    if len(algebras) == len(parts):
        return all(map(_is_symmetric_algebra, algebras))
    stages = list(range(parts[0].stages))
    orders = [stages]
    if not any(part.parameters for part in parts):
        sums = [[round_entry(x) if is_sympy(x) else x for x in part.row_sums] for part in parts]
        orders.append(sorted(stages, key=lambda i: [row[i] for row in sums]))
    return any(all(_is_reversible(part, order) for part in parts) for order in orders)


def _is_reversible(method: RungeKutta, order: Sequence[int]) -> bool:
    a, b = method.A, method.b
    partner = dict(zip(order, reversed(order), strict=True))
    return all(cancels((a[partner[i]][partner[j]], a[i][j], -b[j]), method.precision) for i in order for j in order)


def _has_symmetric_nodes(algebra: StageAlgebra) -> bool:
    sign = -1 if algebra.stages % 2 else 1
    return polynomials.scale(_reflect(algebra.polynomial), sign) == algebra.polynomial


def _is_symmetric_algebra(algebra: StageAlgebra) -> bool:
    """The reversal of symmetric nodes is x → 1 − x, so the condition reads ρAρ g + A g = b(g) on the basis."""
    basis = [polynomials.power(k) for k in range(algebra.stages)]
    return all(
        polynomials.add(_reflect(algebra.apply(_reflect(g))), algebra.apply(g)) == polynomials.trim([algebra.weigh(g)])
        for g in basis
    )


def _reflect(p: polynomials.Polynomial) -> polynomials.Polynomial:
    """The polynomial p(1 − x)."""
    return polynomials.compose(p, polynomials.trim([1, -1]))


def is_acyclic(sparsities: Sequence[Sequence[Sequence[bool]]]) -> bool:
    """Whether stages can be computed in some order if the field of a part depends on the other parts only.

    Stage i of part ν needs, for each a^ν_ij ≠ 0, the field of ν at stage j, hence stage j of all other parts.
    """
    parts = range(len(sparsities))
    needs = {
        (part, i): {(other, j) for j, used in enumerate(row) if used for other in parts if other != part}
        for part, rows in enumerate(sparsities)
        for i, row in enumerate(rows)
    }
    while needs:
        ready = {stage for stage, needed in needs.items() if not needed & needs.keys()}
        if not ready:
            return False
        for stage in ready:
            del needs[stage]
    return True
