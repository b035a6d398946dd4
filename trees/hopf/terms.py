"""Sums as plain dictionaries, from tuples of factors to coefficients: what formal sums compute with.

Terms that cancel may stay, with coefficient 0; the factors multiply, and the coefficients are numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import mul
from typing import TYPE_CHECKING, Any, TypeAlias

from trees.errors import TreeError

if TYPE_CHECKING:
    from trees.tree import Tree

    Terms: TypeAlias = Mapping[Any, Any]

MOST_PRODUCTS = 2**20
"""No operation multiplies more pairs of terms than this: some ten seconds of work, half a gigabyte for the result."""

KEPT = 1024
"""Results kept for each operation: those for every tree of one colour with up to nine nodes, and more."""


def add_terms(total: dict[Any, Any], terms: Terms, scale: Any = 1) -> dict[Any, Any]:
    """Add scale · terms to `total`, in place."""
    for factors, coefficient in terms.items():
        total[factors] = total.get(factors, 0) + scale * coefficient
    return total


def multiply_terms(left: Terms, right: Terms) -> dict[Any, Any]:
    """The products of all terms with all terms, factor by factor."""
    check_work(len(left) * len(right))
    total: dict[Any, Any] = {}
    for f, a in left.items():
        for g, b in right.items():
            factors = tuple(map(mul, f, g))
            total[factors] = total.get(factors, 0) + a * b
    return total


def check_work(products: int) -> None:
    """Refuse work that would seem to hang."""
    if products > MOST_PRODUCTS:
        raise TreeError(f"order must be smaller: this takes more than {MOST_PRODUCTS} products of terms")


def work_of(left: Terms, right: Terms, nodes: int) -> int:
    """The products of terms that a multiplication takes; large forests count for more, as they take longer."""
    return len(left) * len(right) * (1 + nodes // 50)


def fold(
    tree: Tree,
    unit: Terms,
    lift: Callable[[Tree, Terms], Terms],
    multiply: Callable[[Terms, Terms], Terms] = multiply_terms,
) -> Terms:
    """The value of a tree: lift(tree, unit · the product of its children's values).

    It goes up from the leaves without recursion, so that a tall tree does not run out of stack, and once for equal
    subtrees.

    Args:
        tree: The tree.
        unit: The value of no children.
        lift: Gives the value of a subtree from the product of the values of its children.
        multiply: The product of two values.

    Returns:
        The value of the whole tree.

    Raises:
        TreeError: If it would take too many products of terms.
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
