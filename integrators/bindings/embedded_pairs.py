"""Explicit methods with embedded weights, prepared for steps whose length is chosen by the estimated error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.core.errors import IntegratorError, shorten
from integrators.exact.entries import round_entry, sum_entries
from integrators.methods.catalogue.registry import catalogue
from integrators.methods.tableaux.elementary_weights import MAX_ORDER, order_of_difference, order_of_weights

if TYPE_CHECKING:
    import numpy as np

    from integrators.exact.entries import Entry
    from integrators.methods.tableaux.runge_kutta import RungeKutta

    Array = np.ndarray[Any, Any]

MOST_ESTIMATES = 2


class EmbeddedPair(NamedTuple):
    """A pair in doubles, whose last stage is the derivative at the end of the step: one is added where it is missing.

    Attributes:
        A: The stage matrix; its last row is `b`.
        b: The weights.
        c: The nodes.
        errors: What the embedded weights differ by from the weights: one row, or two, the first of the higher order.
        order: The order of the weights.
        error_order: The order k of the estimated error, O(h^(k+1)).
    """

    A: Array
    b: Array
    c: Array
    errors: tuple[Array, ...]
    order: int
    error_order: int


def embedded_pair(method: RungeKutta) -> EmbeddedPair:
    """The pair of a method, its orders found from its order conditions.

    Two estimates E of order k and E' of a lower order k' make one, E²/√(E² + (0.1 E')²), of order 2k − k'.

    Raises:
        IntegratorError: The method has symbols, is implicit, inconsistent, or has no embedded weights of use.

    Example:
        >>> from integrators import method
        >>> [embedded_pair(method(name))[-2:] for name in ("fehlberg45", "cash-karp45", "dop853")]
        [(4, 4), (5, 4), (8, 7)]

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.4 (embedded weights) and II.10 (two
        estimates).
    """
    import numpy as np

    _check(method)
    rounded = method.to_float()
    A, b, c = np.array(rounded.A), np.array(rounded.b), np.array(rounded.c)
    errors = [_rounded_difference(method.b, row) for row in method.embedded]
    if not np.array_equal(A[-1], b):
        A = np.pad(np.vstack([A, b]), ((0, 0), (0, 1)))
        b, c, errors = np.append(b, 0.0), np.append(c, 1.0), [np.append(row, 0.0) for row in errors]
    orders = [order_of_difference(A, row) for row in errors]
    if max(orders) == MAX_ORDER:
        raise IntegratorError(
            f"embedded weights must give another result than b, but those of {shorten(method.name)} do not"
        )
    if len(orders) > 1 and orders[0] < orders[1]:
        errors, orders = errors[::-1], orders[::-1]
    error_order = orders[0] if len(orders) == 1 else 2 * orders[0] - orders[1]
    return EmbeddedPair(A, b, c, tuple(errors), order_of_weights(A, b), error_order)


def _check(method: RungeKutta) -> None:
    """Refuse what cannot estimate its errors, or is not explicit."""
    name = shorten(method.name)
    if method.parameters:
        raise IntegratorError(f"parameters of {name} must have values, but {', '.join(method.parameters)} had none")
    if not method.is_explicit:
        raise IntegratorError(f"method must be explicit, but {name} is implicit: SciPy has Radau and BDF of its own")
    if not method.embedded:
        known = ", ".join(entry.name for entry in catalogue() if entry.kind == "embedded pair")
        raise IntegratorError(
            f"method must have embedded weights to estimate errors, but {name} has none; of the catalogue have {known}"
        )
    if len(method.embedded) > MOST_ESTIMATES:
        raise IntegratorError(
            f"method must have one or two rows of embedded weights, but {name} has {len(method.embedded)}"
        )
    if method.issues:
        raise IntegratorError(f"method must be consistent, but {method.issues[0]}")


def _rounded_difference(weights: Sequence[Entry], others: Sequence[Entry]) -> Array:
    """The differences of two rows of weights, subtracted exactly before they are rounded."""
    import numpy as np

    return np.array([round_entry(sum_entries((x, -y))) for x, y in zip(weights, others, strict=True)])
