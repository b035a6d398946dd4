"""Order conditions of weights, order by order, as arrays of stage vectors.

A rooted tree with children τ₁, …, τₘ has the stage vector Φ = ∏ A Φ(τⱼ) and the number e = ∏ e(τⱼ)/|τⱼ|. Weights b
have order p if b·Φ = e/k for all trees with k ≤ p nodes (HNW I, Theorem II.2.13). The vectors of forests are products
of those of their trees, the largest last, so trees as objects are not needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count, islice
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import numpy as np

    Array = np.ndarray[Any, Any]

MAX_ORDER = 13
"""There are 12,486 trees with this number of nodes; higher orders are not distinguished."""
ROUNDING = 1e-9
"""In doubles, residuals over the catalogue are below 2e-14 for satisfied conditions, above 1e-2 for failed ones."""


class Conditions(NamedTuple):
    """The order conditions ``vectors @ weights == values`` of one order k.

    Attributes:
        vectors: one stage vector for each tree with k nodes.
        values: 1/γ of each tree.
    """

    vectors: Array
    values: Array


def weight_conditions(A: Array) -> Iterator[Conditions]:
    """The order conditions of a stage matrix for orders 1, 2, 3, ….

    Example:
        >>> import numpy as np
        >>> from itertools import islice
        >>> [len(found.values) for found in islice(weight_conditions(np.zeros((1, 1))), 8)]
        [1, 1, 2, 4, 9, 20, 48, 115]
    """
    import numpy as np

    one = A[0, 0] * 0 + 1
    # Rows are Φ followed by e; forests[k] are those with k nodes, ordered by the index of their largest tree.
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
    """The order of the weights, at most `MAX_ORDER`; in doubles up to rounding.

    Example:
        >>> import numpy as np
        >>> order_of_weights(np.array([[0, 0], [1, 0.0]]), np.array([0.5, 0.5]))
        2
    """
    return _orders_without_residual(A, weights, 1)


def order_of_difference(A: Array, difference: Array) -> int:
    """The largest k ≤ `MAX_ORDER` for which the results of two rows of weights differ by O(h^(k+1))."""
    return _orders_without_residual(A, difference, 0)


def _orders_without_residual(A: Array, weights: Array, factor: int) -> int:
    """The largest order up to which weights·Φ = factor/γ for all trees."""
    tolerance = 0 if A.dtype == object else ROUNDING
    for k, (vectors, values) in enumerate(islice(weight_conditions(A), MAX_ORDER)):
        size = abs(vectors) @ abs(weights) + factor * values
        if (abs(vectors @ weights - factor * values) > tolerance * size).any():
            return k
    return MAX_ORDER
