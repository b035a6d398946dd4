"""Arithmetic of sums as dictionaries from tuples of factors to coefficients, which may be zero."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import mul
from typing import Any, TypeAlias

from trees.errors import TreeError
from trees.tree import Tree

Terms: TypeAlias = Mapping[Any, Any]

MOST_PRODUCTS = 2**20
"""Limit of the pairs of terms multiplied in one operation: about ten seconds and half a gigabyte."""

KEPT = 1024
"""Cached results of each operation, more than there are uncoloured trees with up to nine nodes."""


def add_terms(total: dict[Any, Any], terms: Terms, scale: Any = 1) -> dict[Any, Any]:
    """Add scale · terms to `total`, in place."""
    for factors, coefficient in terms.items():
        total[factors] = total.get(factors, 0) + scale * coefficient
    return total


def multiply_terms(left: Terms, right: Terms) -> dict[Any, Any]:
    """The product of two sums, factor by factor."""
    check_work(len(left) * len(right))
    total: dict[Any, Any] = {}
    for f, a in left.items():
        for g, b in right.items():
            factors = tuple(map(mul, f, g))
            total[factors] = total.get(factors, 0) + a * b
    return total


def check_work(products: int) -> None:
    """Refuse operations that would take too long."""
    if products > MOST_PRODUCTS:
        raise TreeError(f"order must be smaller: this takes more than {MOST_PRODUCTS} products of terms")


def work_of(left: Terms, right: Terms, nodes: int) -> int:
    """The number of products of terms in a multiplication, weighted by the size of the forests."""
    return len(left) * len(right) * (1 + nodes // 50)


def fold(
    tree: Tree,
    unit: Terms,
    lift: Callable[[Tree, Terms], Terms],
    multiply: Callable[[Terms, Terms], Terms] = multiply_terms,
) -> Terms:
    """The value of a tree: lift(tree, unit · the product of its children's values).

    It is computed from the leaves up, without recursion, and once for equal subtrees.
    """
    values: dict[Tree, Terms] = {}
    work = 0
    for _, subtree in reversed(list(tree.preorder())):
        if subtree not in values:
            value = unit
            for child in subtree.children:
                work += work_of(value, values[child], tree.order)
                check_work(work)
                value = multiply(value, values[child])
            values[subtree] = lift(subtree, value)
    return values[tree]
