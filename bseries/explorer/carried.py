"""States and clouds of points carried along: by steps of a method, or by the flow of a field."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np

from integrators import integrate, method, stepper
from integrators.methods.programs.program import Method
from integrators.scenes.scene import Scene
from integrators.steppers.states import StepError

FLOW = "dop853"
"""The method for exact and modified flows."""
FAR = 1e6
"""Curves end where a variable is as large: a page cannot draw them."""


@contextmanager
def quiet() -> Iterator[None]:
    """Without warnings of overflow, which a page shows as a curve that ends."""
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        yield


def orbit(
    method: Method, scene: Scene, y0: np.ndarray, h: float, steps: int, every: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Times and states of a run, up to a failure or a state that is too far to be drawn.

    Example:
        >>> from integrators import method, scene
        >>> t, y = orbit(method("explicit-euler"), scene("riccati"), [1.0], 0.5, 20)
        >>> y.shape[1] < 20, bool(y.max() < FAR)
        (True, True)
    """
    with quiet():
        try:
            run = integrate(method, scene, h=h, steps=steps, y0=y0, save_every=every)
        except StepError as error:
            run = error.trajectory
        near = np.logical_and.accumulate((abs(run.y) < FAR).all(axis=0))
    return run.t[near], run.y[:, near].copy()


def by_steps(method: Method | str, scene: Scene, points: np.ndarray, h: float, counts: Sequence[int]) -> np.ndarray:
    """Points (variables, points) moved by steps of a method: (times, variables, points), not numbers after a failure.

    The first of the times is that of the starts; `counts` are the steps between them.
    """
    steps, moved = stepper(method, scene), np.full((len(counts) + 1, *points.shape), np.nan)
    moved[0] = points
    for k, point in enumerate(points.T):
        state = steps.start(point, h=h)
        try:
            for j, count in enumerate(counts, 1):
                steps.advance(state, count)
                moved[j, :, k] = state.y
        except StepError:
            continue
    return np.where(abs(moved) < FAR, moved, np.nan)


def by_field(field: Callable[[Any, float], Any], h: float, points: np.ndarray, times: Any, longest: float) -> Any:
    """Points moved by the flow of y' = field(y, h), with explicit steps of order 8 for all points at once.

    The result has the shape (times, variables, points), with the starts (variables, points) first; it is not numbers
    after a failure. `longest` is the longest step.

    Example:
        >>> import numpy as np
        >>> rotation = lambda y, h: np.array([-y[1], y[0]])
        >>> moved = by_field(rotation, 0.0, np.array([[1.0], [0.0]]), np.array([0, np.pi]), 0.1)
        >>> moved[1].round(9).ravel().tolist()
        [-1.0, 0.0]
    """
    (A, b), shape = _tableau(), points.shape
    moved = np.full((len(times), *shape), np.nan)
    moved[0] = points
    y, slopes = points.ravel(), np.empty((len(b), points.size))
    with quiet():
        for j, length in enumerate(np.diff(times), 1):
            parts = max(1, math.ceil(length / longest - 1e-9))
            step = length / parts
            for _ in range(parts):
                for i in range(len(b)):
                    stage = y + step * (A[i, :i] @ slopes[:i])
                    slopes[i] = field(stage.reshape(shape), h).ravel()
                y = y + step * (b @ slopes)
            if not (abs(y) < FAR).any():
                break
            moved[j] = y.reshape(shape)
    return np.where(abs(moved) < FAR, moved, np.nan)


@cache
def _tableau() -> tuple[Any, Any]:
    tableau: Any = method(FLOW)
    tableau = tableau.to_float()
    return np.array(tableau.A, float), np.array(tableau.b, float)


def crossings(states: np.ndarray, through: int) -> np.ndarray:
    """The points where an orbit crosses the zero of a variable upwards, by linear interpolation, (variables, points).

    Example:
        >>> import numpy as np
        >>> crossings(np.array([[-1.0, 3.0, -1.0], [0.0, 1.0, 2.0]]), 0).tolist()
        [[0.0], [0.25]]
    """
    before, after = states[through, :-1], states[through, 1:]
    at = np.flatnonzero((before < 0) & (after >= 0))
    part = before[at] / (before[at] - after[at])
    return (1 - part) * states[:, at] + part * states[:, at + 1]


def padded(values: np.ndarray, count: int) -> np.ndarray:
    """The array with nan behind its last axis, up to a length."""
    return np.concatenate([values, np.full((*values.shape[:-1], count - values.shape[-1]), np.nan)], axis=-1)
