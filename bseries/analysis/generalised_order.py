"""Generalised orders of splitting methods for perturbed systems y' = f^a(y) + ε f^b(y)."""

from __future__ import annotations

from bseries.algebra.modified import series
from bseries.algebra.stages import is_chain
from bseries.analysis.order import failures, order_of, trusted
from bseries.exceptions import SeriesError
from integrators import Method
from integrators.methods.catalogue.registry import as_method
from trees.words import Words

MOST_LETTERS = 14
"""The longest words tested: there are 32,766 up to this length."""


def generalised_order(method: Method | str, perturbation: str = "b") -> tuple[int, ...]:
    """The generalised order (r_1, r_2, …) of a splitting method where one part of the field is a small perturbation.

    On y' = f^a(y) + ε f^b(y) the error of a step is of the size Σ_j ε^j h^(r_j + 1). The last number is the order.

    The coefficient of a word with j letters b belongs to ε^j. So r_j is the largest n, and at most r_(j−1), for which
    all words of up to n letters with j letters b have the coefficient of the exact flow, 1/n!.

    Args:
        method: A splitting method for two parts, a product of their flows.
        perturbation: The part that is small.

    Returns:
        The numbers r_1 ≥ r_2 ≥ …, until they are the order; 14 means at least 14.

    Raises:
        SeriesError: `method` is no product of the flows of two parts, or has no part of this name.

    Example:
        >>> import bseries as bs
        >>> bs.analysis.generalised_order("strang"), bs.analysis.generalised_order("aba864")
        ((2,), (8, 6, 4))

    References:
        R. I. McLachlan, BIT 35 (1995) 258–268, doi:10.1007/BF01737165; J. Laskar, P. Robutel, Celest. Mech. Dyn.
        Astron. 80 (2001) 39–62, doi:10.1023/A:1012098603882.
    """
    method = as_method(method)
    if not is_product_of_two(method):
        raise SeriesError(f"method must be a product of the flows of two parts, but {method.name} is not")
    if perturbation not in method.names:
        raise SeriesError(f"perturbation must be one of {', '.join(method.names)}, but was {perturbation!r:.60}")
    return generalised_orders(method, order_of(method))[method.names.index(perturbation)]


def is_product_of_two(method: Method) -> bool:
    """Whether a step is a product of flows of two parts of the field."""
    return len(method.names) == 2 and is_chain(method)


def generalised_orders(method: Method, order: int) -> tuple[tuple[int, ...], ...]:
    """The generalised orders of a method with this order, where the one or the other part is small."""
    method, reached = trusted(method), []
    for most in range(order + 1, MOST_LETTERS + 1):
        reached = [[most] * (most + 1) for _ in range(2)]  # for each part, by its number of letters
        words = Words(most)
        for word in map(words.element, failures(series(method, words))):
            for letter, orders in enumerate(reached):
                small = word.count(letter)
                orders[small] = min(orders[small], len(word) - 1)
        if all(orders[1] < most for orders in reached):
            break
    return tuple(_until_the_order([min(orders[1:j]) for j in range(2, len(orders) + 1)], order) for orders in reached)


def _until_the_order(orders: list[int], order: int) -> tuple[int, ...]:
    """The first numbers of a sequence that does not grow, up to the order."""
    return (*(r for r in orders if r > order), order)
