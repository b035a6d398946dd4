"""The modified loss of an optimiser: the part of the modified equation that is a gradient for every loss.

With f = −∇L, moving the root of a tree to another node of the same free tree does not change the scalar that is
differentiated: the gradient of the full contraction G(t) of the derivatives of L along the edges of the free tree t is
the sum of the elementary differentials over all choices of the root, up to the sign (−1)^|t|. So the field of a series
b is a gradient for all L if and only if b is the same for all rootings of each free tree.
"""

from __future__ import annotations

from typing import Any

import sympy

from bseries.algebra.bseries import BSeries
from bseries.algebra.modified import modified_equation
from bseries.exceptions import SeriesError
from integrators.methods.programs.program import Method
from trees.free_trees import FreeTree, free_tree_classes
from trees.tree import Tree


def gradient_order(method: Method | BSeries | str, order: int) -> int:
    """The number of nodes up to which the modified field of a method is a gradient for every loss.

    Args:
        method: A method for y' = −∇L(y), its name, or its flow as a series.
        order: The largest number of nodes to test.

    Raises:
        TreeError: `order` is not a whole number ≥ 1.

    Example:
        >>> import bseries as bs
        >>> bs.memory.gradient_order(bs.memory.momentum("9/10"), 4), bs.memory.gradient_order("implicit-midpoint", 4)
        (2, 2)
    """
    b = modified_equation(method, order)
    return min(
        (free.representative.order - 1 for free in free_tree_classes(order) if _differing(b, free)), default=order
    )


def modified_loss(method: Method | BSeries | str, order: int = 2) -> dict[Tree, Any]:
    """The coefficients c of the loss L̃ = Σ h^(|t|−1) c(t) G(t) whose gradient flow is the modified equation.

    G(t) is the contraction of the derivatives of L along the edges of the free tree t: G(τ) = L, G([τ]) = |∇L|².

    Args:
        method: A method for y' = −∇L(y), its name, or its flow as a series.
        order: The largest number of nodes.

    Returns:
        c by a rooting of each free tree.

    Raises:
        SeriesError: The modified field is no gradient up to `order` nodes.
        TreeError: `order` is not a whole number ≥ 1.

    Example:
        >>> import bseries as bs
        >>> loss = bs.memory.modified_loss(bs.memory.momentum("9/10"))
        >>> {str(tree): str(c) for tree, c in loss.items()}
        {'τ': '10', '[τ]': '475'}

    References:
        D. G. T. Barrett, B. Dherin, *Implicit gradient regularization*, ICLR 2021, for β = 0.
    """
    b = modified_equation(method, order)
    found = {}
    for free in free_tree_classes(order):
        if differing := _differing(b, free):
            raise SeriesError(
                f"order must be at most {free.representative.order - 1}, where the modified field is a gradient, but "
                f"was {order}: coefficients of {free.representative} and {differing} differ"
            )
        c = b[free.representative] * (-1) ** (free.representative.order - 1) / free.symmetry
        found[free.representative] = sympy.factor(c) if isinstance(c, sympy.Expr) else c
    return found


def _differing(b: BSeries, free: FreeTree) -> Tree | None:
    """A rooting with another coefficient than the representative."""
    value = b[free.representative]
    trees = (rooting.tree for rooting in free.rootings)
    return next((tree for tree in trees if sympy.cancel(b[tree] - value) != 0), None)
