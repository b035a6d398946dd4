"""Simplifying assumptions B(p), C(q), D(r), and the order they prove without looking at a single tree.

Order conditions grow exponentially in number, but a ten-stage Gauss method needs only these (Butcher 1964; HLW,
theorem II.1.8 and Hairer–Nørsett–Wanner, theorem II.7.4): B(p), C(q), D(r) with p ≤ q + r + 1 and p ≤ 2q + 2 imply
order p; and order p implies B(p).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from integrators import RungeKutta

Vector = Sequence[Any]


class StageSpace(NamedTuple):
    """The stage vectors of a method: their product, the stage matrix, the weights, a basis, and the vector 1."""

    multiply: Callable[[Any, Any], Vector]
    apply: Callable[[Any], Vector]
    weigh: Callable[[Any], Any]
    basis: Sequence[Vector]
    one: Vector


def stage_space(method: RungeKutta) -> StageSpace:
    """Stage vectors by components, or as polynomials where the method is given by its nodes' polynomial."""
    size = method.stages
    basis = [tuple(Fraction(int(i == j)) for i in range(size)) for j in range(size)]
    if method.algebra is not None:
        algebra = method.algebra
        return StageSpace(algebra.multiply, algebra.apply, algebra.weigh, basis, basis[0])
    return StageSpace(
        lambda x, y: tuple(u * v for u, v in zip(x, y, strict=True)),
        lambda x: tuple(_dot(row, x) for row in method.A),
        lambda x: _dot(method.b, x),
        basis,
        (Fraction(1),) * size,
    )


def _dot(x: Vector, y: Vector) -> Any:
    return sum((u * v for u, v in zip(x, y, strict=True)), start=Fraction(0))


class Assumptions(NamedTuple):
    """The largest p, q, r for which B(p), C(q), D(r) hold (at most `limit`)."""

    quadrature: int
    stage: int
    dual: int

    def order(self, method: RungeKutta) -> int | None:
        """The order that they prove for their method, exactly; None where they leave it open.

        The order of a symmetric method is even (HLW, theorem II.3.2).
        """
        proved = min(self.quadrature, self.stage + self.dual + 1, 2 * self.stage + 2)
        if proved % 2 and proved < self.quadrature and method.is_symmetric:
            proved += 1
        return proved if proved == self.quadrature else None


@lru_cache(maxsize=64)
def simplifying_assumptions(method: RungeKutta, limit: int) -> Assumptions:
    """How far B, C and D hold for a method with rational (or rationally represented) stages.

    B(p): Σ b_i c_i^(k−1) = 1/k; C(q): Σ_j a_ij c_j^(k−1) = c_i^k / k; D(r): Σ_i b_i c_i^(k−1) a_ij = b_j (1 − c_j^k)/k.
    The nodes are the row sums: an autonomous equation sees no others.
    """
    space = stage_space(method)
    nodes = space.apply(space.one)
    powers = [space.one]  # c^0, c^1, …
    while len(powers) <= limit + 1:
        powers.append(space.multiply(powers[-1], nodes))

    def b(k: int) -> bool:
        return space.weigh(powers[k - 1]) * k == 1

    def c(k: int) -> bool:
        return all(x * k == y for x, y in zip(space.apply(powers[k - 1]), powers[k], strict=True))

    def d(k: int) -> bool:
        return all(
            space.weigh(space.multiply(powers[k - 1], space.apply(e))) * k
            == space.weigh(e) - space.weigh(space.multiply(powers[k], e))
            for e in space.basis
        )

    return Assumptions(_largest(b, limit), _largest(c, limit), _largest(d, limit))


def _largest(holds: Callable[[int], bool], limit: int) -> int:
    k = 0
    while k < limit and holds(k + 1):
        k += 1
    return k
