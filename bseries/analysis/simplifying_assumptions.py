"""Simplifying assumptions B(p), C(q), D(r): which of them hold, the order they prove, the conditions they imply.

    B(p): Σ b_i c_i^(k−1) = 1/k                         for k = 1, …, p
    C(q): Σ_j a_ij c_j^(k−1) = c_i^k / k                for k = 1, …, q
    D(r): Σ_i b_i c_i^(k−1) a_ij = b_j (1 − c_j^k) / k  for k = 1, …, r

The number of order conditions grows exponentially with the order; a ten-stage Gauss method needs only these. B(p),
C(q), D(r) with p ≤ q + r + 1 and p ≤ 2q + 2 imply order p, and order p implies B(p) (Butcher 1964; HLW, theorem II.1.8;
Hairer–Nørsett–Wanner, theorem II.7.4).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

from bseries.analysis.stability.field_elements import dot, stage_matrix
from bseries.exceptions import SeriesError
from integrators import RungeKutta
from integrators.exact.polynomials import power, to_flint_matrix
from trees.tree import Tree

ONE_OF_THEM = r"([A-Za-z])(?:([0-9]{1,3})|\(([0-9]{1,3})\))"
TEXT = re.compile(rf"{ONE_OF_THEM}(?:[\s,]+{ONE_OF_THEM})*")
"""Such as B5 C2 or B(5), C(2)."""


class Assumptions(NamedTuple):
    """The simplifying assumptions B(p), C(q), D(r), by their p, q and r; 0 for none."""

    B: int = 0
    C: int = 0
    D: int = 0

    def __str__(self) -> str:
        return ", ".join(f"{name}({k})" for name, k in zip("BCD", self, strict=True) if k)

    def order(self, method: RungeKutta) -> int | None:
        """The order that the assumptions prove for their method; None where they leave it open.

        The order of a symmetric method is even (HLW, theorem II.3.2).
        """
        proved = min(self.B, self.C + self.D + 1, 2 * self.C + 2)
        if proved % 2 and proved < self.B and method.is_symmetric:
            proved += 1
        return proved if proved == self.B else None

    def implies(self, tree: Tree) -> bool:
        """Whether the tree's condition follows from the assumptions and from conditions of simpler trees.

        B gives the conditions of the bushy trees [τ^(k−1)]. C replaces a subtree [τ^(k−1)] by k leaves on its parent;
        weight and 1/γ are both divided by k. D applies to a root with k−1 leaves and one more subtree t: the weight is
        (a(t) − a(t'))/k, where t' is t with k more leaves on its root, and 1/γ likewise; for t = τ it states
        (k + 1) a([τ^k]) = a(τ). The new trees have fewer inner nodes and no more nodes, so by induction the trees for
        which this is False suffice (Butcher 1964; Hairer–Nørsett–Wanner, section II.7).
        """
        if _is_bush(tree) and (tree.order <= self.B or 2 <= tree.order <= self.D + 1):
            return True
        if any(_is_bush(t) and 2 <= t.order <= self.C for level, t in tree.preorder() if level > 0):
            return True
        inner = [child for child in tree.children if child.children]
        return len(inner) == 1 and len(tree.children) <= self.D

    @classmethod
    def read(cls, given: str | Mapping[str, int] | Assumptions | None) -> Assumptions:
        """Read a text such as ``"B5 C2 D1"`` or ``"B(5), C(2)"``, or a mapping such as {"C": 2}.

        Raises:
            SeriesError: It denotes no assumptions.
        """
        if given is None or isinstance(given, Assumptions):
            return given or cls()
        pairs = list[tuple[str, int]]()
        if isinstance(given, str) and TEXT.fullmatch(given.strip()):
            pairs = [(name, int(k or number)) for name, k, number in re.findall(ONE_OF_THEM, given)]
        elif isinstance(given, Mapping):
            pairs = list(given.items())
        found = {str(name).upper(): k for name, k in pairs}
        numbers = all(type(k) is int and 0 <= k < 1000 for k in found.values())
        if not (found and numbers and found.keys() <= set(cls._fields) and len(found) == len(pairs)):
            raise SeriesError(
                f"assumptions must be like 'B5 C2 D1' or {{'B': 5, 'C': 2, 'D': 1}}, but were {given!r:.60}"
            )
        return cls(**found)


def _is_bush(tree: Tree) -> bool:
    return not any(child.children for child in tree.children)


@lru_cache(maxsize=64)
def simplifying_assumptions(method: RungeKutta, limit: int) -> Assumptions:
    """The largest p, q, r ≤ `limit` for which B(p), C(q), D(r) hold for a method with rational stage vectors.

    The nodes are the row sums, the only ones that matter for autonomous equations. With the matrix X of the
    multiplication of stage vectors by the nodes, B(k) is k b X^(k−1) 1 = 1, C(k) is k A X^(k−1) 1 = X^k 1, and D(k) is
    k b X^(k−1) A = b − b X^k.
    """
    rows, weights, vector = stage_matrix(method)
    size = len(rows)
    nodes = [dot(row, vector) for row in rows]
    if method.algebra is None:
        columns = [[c if i == j else Fraction(0) for i in range(size)] for j, c in enumerate(nodes)]
    else:
        products = (method.algebra.multiply(tuple(nodes), power(k)) for k in range(size))
        columns = [[*product, *[Fraction(0)] * (size - len(product))] for product in products]
    A, X, b, one = (
        to_flint_matrix(matrix) for matrix in (rows, zip(*columns, strict=True), [weights], [[x] for x in vector])
    )
    right, left = [one], [b]
    while len(right) <= limit:
        right.append(X * right[-1])
        left.append(left[-1] * X)
    return Assumptions(
        _largest(lambda k: (b * right[k - 1] * k)[0, 0] == 1, limit),
        _largest(lambda k: A * right[k - 1] * k == right[k], limit),
        _largest(lambda k: left[k - 1] * A * k == b - left[k], limit),
    )


def _largest(holds: Callable[[int], bool], limit: int) -> int:
    """The largest k ≤ `limit` such that a property holds for 1, …, k."""
    return next((k for k in range(limit) if not holds(k + 1)), limit)
