"""Modifying integrators run as methods: the basic method applied to the modifying field."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.fields.scene_series import modifying_field
from integrators.reference.plain_arithmetic import Arithmetic
from integrators.reference.plain_steps import block_parts, plain_steps

if TYPE_CHECKING:
    import numpy as np

    from bseries.fields.scene_series import SceneSeries
    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene


def modifying_steps(
    method: Method,
    scene: Scene,
    order: int,
    y: Sequence[Any],
    h: Any,
    steps: int,
    *,
    parts: Any = None,
    digits: int | None = None,
) -> np.ndarray:
    """Steps of a method on its modifying field: a method of higher order that keeps the basic method's geometry.

    As plain as possible: stages are solved for in Python, only the field is compiled.

    Args:
        method: The basic method, which treats the whole field alike, or blocks of variables.
        scene: The scene.
        order: The order to raise it to.
        y: The start.
        h: The step size.
        steps: How many steps.
        parts: As for `modified_field`.
        digits: None for doubles; else the number of digits to compute with, in the interpreter.

    Returns:
        An array with one row for each variable, and one column for the start and each step.

    Raises:
        SeriesError: The method's parts are not clear, or are not blocks of variables.
        IntegratorError: An argument does not fit, or stages cannot be solved for.

    Example:
        >>> import bseries as bs
        >>> run = bs.modifying_steps(bs.method("implicit-midpoint"), bs.scene("riccati"), 8, [1.0], 0.05, 10)
        >>> print(abs(run[0, -1] - 2) < 1e-8)
        True

    References:
        P. Chartier, E. Hairer, G. Vilmart, *Numerical integrators based on modified differential equations*,
        Math. Comp. 76 (2007), doi:10.1090/S0025-5718-07-01967-9.
    """

    f = modifying_field(method, scene, order, parts=parts)
    field = _bound(f, h, digits)
    if len(method.names) > 1:
        return plain_steps(method, block_parts(field, _places(f, method)), y, h, steps, digits=digits)
    return plain_steps(method, field, y, h, steps, digits=digits)


def _bound(f: SceneSeries, h: Any, digits: int | None) -> Callable[[Any], Any]:
    """The field for one step size, as a function of the state."""

    arithmetic = Arithmetic(digits)
    with arithmetic.working():
        step = arithmetic.number(h, "h")
    if digits is None:
        return lambda y: f(y, step)
    from bseries.fields.any_precision import PreciseSeries

    precise = PreciseSeries(f, digits)
    return lambda y: precise(y, step)


def _places(f: SceneSeries, method: Method) -> dict[str, list[int]]:
    """For each part of the method the numbers of its variables."""
    places: dict[str, list[int]] = {}
    for name, piece in zip(method.names, f.trees.pieces, strict=True):
        if piece.blocks is None:
            raise SeriesError(f"method must treat blocks of variables, but {method.name} treats parts of the field")
        chosen = [block for block in f.scene.blocks if block.name in piece.blocks]
        places[name] = [k for block in chosen for k in range(block.offset, block.end)]
    return places
