"""The stage vectors of elementary weights, order by order, as arrays: what order conditions of weights are made of.

A rooted tree with children τ₁, …, τₘ stands for the stage vector Φ = ∏ A Φ(τⱼ) and the number e = ∏ e(τⱼ)/|τⱼ|, and
weights b have order p if b·Φ = e/k for all trees with k ≤ p nodes (HNW I, Theorem II.2.13). Trees as objects are not
needed for that: a forest is a product of what belongs to its trees, the largest last.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count, islice
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import numpy as np

    Array = np.ndarray[Any, Any]

MAX_ORDER = 13
"""There are 12,486 trees with so many nodes; higher orders count as this one."""
ROUNDING = 1e-9
"""In doubles conditions that hold are off by 2e-14 at most for all of the catalogue, the first that fail by 1e-2."""


class Conditions(NamedTuple):
    """The order conditions of one order k: weights satisfy them if ``vectors @ weights == values``.

    Attributes:
        vectors: one stage vector for each tree with k nodes.
        values: what the weights must make of it, 1/γ.
    """

    vectors: Array
    values: Array


def weight_conditions(A: Array) -> Iterator[Conditions]:
    """The order conditions of a stage matrix for orders 1, 2, 3, …, without end.

    Args:
        A: a square array of doubles, or of `Fraction`s as objects, which are kept exact.

    Example:
        >>> import numpy as np
        >>> from itertools import islice
        >>> [len(found.values) for found in islice(weight_conditions(np.zeros((1, 1))), 8)]
        [1, 1, 2, 4, 9, 20, 48, 115]
    """
    import numpy as np

    one = A[0, 0] * 0 + 1
    # Rows are Φ followed by e; forests[k] are those with k nodes, in the order of the index of their largest tree.
    forests = [np.full((1, len(A) + 1), one)]
    largest = [np.array([-1])]
    trees: list[tuple[int, Array]] = []
    for k in count(1):
        rooted = forests[k - 1]
        vectors, values = rooted[:, :-1], rooted[:, -1] / k
        yield Conditions(vectors, values)
        trees += [(k, tree) for tree in np.column_stack([vectors @ A.T, values])]
        before = [np.searchsorted(largest[k - size], i, side="right") for i, (size, _) in enumerate(trees)]
        products = [forests[k - size][:n] * tree for n, (size, tree) in zip(before, trees, strict=True)]
        forests.append(np.concatenate(products))
        largest.append(np.repeat(np.arange(len(trees)), before))


def order_of_weights(A: Array, weights: Array) -> int:
    """The largest order, at most `MAX_ORDER`, whose conditions hold: exactly, or for doubles up to rounding.

    Example:
        >>> import numpy as np
        >>> order_of_weights(np.array([[0, 0], [1, 0.0]]), np.array([0.5, 0.5]))
        2
    """
    return _orders_without_residual(A, weights, 1)


def order_of_difference(A: Array, difference: Array) -> int:
    """The largest order, at most `MAX_ORDER`, to which two rows of weights with this difference agree.

    Their results differ by O(h^(k+1)) if that order is k.
    """
    return _orders_without_residual(A, difference, 0)


def _orders_without_residual(A: Array, weights: Array, factor: int) -> int:
    """For how many orders weights·Φ = factor/γ holds for all trees."""
    tolerance = 0 if A.dtype == object else ROUNDING
    for k, (vectors, values) in enumerate(islice(weight_conditions(A), MAX_ORDER)):
        size = abs(vectors) @ abs(weights) + factor * values
        if (abs(vectors @ weights - factor * values) > tolerance * size).any():
            return k
    return MAX_ORDER
