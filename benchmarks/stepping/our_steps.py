"""Our own side: compiled steppers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bseries as bs

if TYPE_CHECKING:
    import numpy as np

    from .c_steps import Run

LIKE_C: dict[str, Any] = {"compensated": False, "split": False}
"""The options with which a stepper does the same arithmetic as the C program."""


def our_steps(scene: str, method: str, **options: Any) -> Run:
    """The stepper of a scene and a method, with options of `bseries.stepper`."""
    stepper = bs.stepper(bs.method(method), bs.scene(scene), **options)

    def run(y: np.ndarray, h: float, steps: int) -> None:
        state = stepper.start(y.tolist(), h=h)
        stepper.advance(state, steps)
        y[:] = state.y

    return run


def our_steps_like_c(scene: str, method: str) -> Run:
    """The stepper that computes what the C program computes."""
    return our_steps(scene, method, **LIKE_C)
