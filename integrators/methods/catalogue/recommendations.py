"""Recommended splitting and composition methods for each order."""

from __future__ import annotations

from integrators.core.errors import IntegratorError

RECOMMENDED = {
    "splitting": {
        4: "blanes-moan4",
        6: "blanes-moan6",
        8: "sofroniou-spaletta8",
        10: "sofroniou-spaletta10",
    },
    "nystrom splitting": {4: "blanes-moan-rkn4", 6: "blanes-moan-rkn6", 8: "blanes-casas-rkn8"},
    "composition": {
        4: "suzuki4",
        6: "sofroniou-spaletta6",
        8: "sofroniou-spaletta8",
        10: "sofroniou-spaletta10",
    },
}


def recommended(order: int, kind: str = "splitting") -> str:
    """The method of the catalogue with the smallest effective error.

    The effective error is s ‖e‖^(1/p) for a method of order p with s stages (flows of the part with fewer flows). The
    leading errors e are the coefficients minus those of the exact flow, at all words in two letters or at all trees of
    a second-order equation. Methods of equal order and effective error are equally accurate for equal work. The errors
    for a given problem also depend on which part begins.

    Args:
        order: The order: 4, 6, 8, or 10.
        kind: ``"splitting"`` for two arbitrary parts, ``"nystrom splitting"`` for q'' = g(q), ``"composition"`` for the
            schemes of `symmetric_composition`.

    Returns:
        Its name.

    Raises:
        IntegratorError: The kind is unknown, or the catalogue has no such method of that order.

    Example:
        >>> recommended(6), recommended(6, "nystrom splitting")
        ('blanes-moan6', 'blanes-moan-rkn6')

    References:
        S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313–330, doi:10.1016/S0377-0427(01)00492-7.
    """
    if not isinstance(kind, str) or kind not in RECOMMENDED:
        raise IntegratorError(f"kind must be one of {', '.join(RECOMMENDED)}, but was {kind!r:.60}")
    names = RECOMMENDED[kind]
    if isinstance(order, bool) or not isinstance(order, int) or order not in names:
        raise IntegratorError(f"order must be one of {', '.join(map(str, names))}, but was {order!r:.60}")
    return names[order]
