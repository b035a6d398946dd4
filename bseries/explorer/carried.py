"""States and clouds of points carried along: by steps of a method, or by the flow of a field."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np

from foundation.machine_code import njit
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
    after a failure. `longest` is the longest step. Formulas that are compiled are called by compiled steps.

    Example:
        >>> import numpy as np
        >>> rotation = lambda y, h: np.array([-y[1], y[0]])
        >>> moved = by_field(rotation, 0.0, np.array([[1.0], [0.0]]), np.array([0, np.pi]), 0.1)
        >>> moved[1].round(9).ravel().tolist()
        [-1.0, 0.0]
    """
    tableau: Any = method(FLOW)
    A, b = (np.array(entries, float) for entries in (tableau.to_float().A, tableau.to_float().b))
    moved = np.full((len(times), *points.T.shape), np.nan)
    moved[0] = points.T
    parts = np.maximum(1, np.ceil(np.diff(times) / longest - 1e-9)).astype(int)
    steps = np.diff(times) / parts
    evaluator = getattr(field, "evaluator", None)
    with quiet():
        if evaluator is not None and evaluator.route == "symbolic":
            _compiled_steps()(evaluator.formulas.module.many, h, moved, parts, steps, A, b)
        else:
            _steps(field, h, moved, parts, steps, A, b)
    return np.where(abs(moved) < FAR, moved, np.nan).swapaxes(1, 2)


def _steps(field: Any, h: float, moved: Any, parts: Any, steps: Any, A: Any, b: Any) -> None:
    """Fill `moved`, rows of points at times, from its first entry on, as long as a point is near."""
    y, slopes = moved[0].ravel(), np.empty((len(b), moved[0].size))
    for j, step in enumerate(steps):
        for _ in range(parts[j]):
            for i in range(len(b)):
                stage = y + step * (A[i, :i] @ slopes[:i])
                slopes[i] = field(stage.reshape(moved[0].shape).T, h).T.ravel()
            y = y + step * (b @ slopes)
        if not (abs(y) < FAR).any():
            return
        moved[j + 1] = y.reshape(moved[0].shape)


@cache
def _compiled_steps() -> Any:
    """`_steps` of a compiled function (y, h, out) of rows of points."""
    from numba import types

    rows, numbers = types.Array(types.float64, 2, "C"), types.Array(types.float64, 1, "C")
    field = types.FunctionType(types.void(rows, types.float64, rows))
    cube, counts = types.Array(types.float64, 3, "C"), types.Array(types.int64, 1, "C")

    @njit(types.void(field, types.float64, cube, counts, numbers, rows, numbers), error_model="numpy")
    def compiled_steps(field: Any, h: float, moved: Any, parts: Any, steps: Any, A: Any, b: Any) -> None:
        y, stage = moved[0].copy(), np.empty_like(moved[0])
        slopes = np.empty((len(b), *y.shape))
        for j in range(len(steps)):
            for _ in range(parts[j]):
                for i in range(len(b)):
                    stage[:] = y
                    for k in range(i):
                        if A[i, k] != 0:
                            stage += (steps[j] * A[i, k]) * slopes[k]
                    field(stage, h, slopes[i])
                for i in range(len(b)):
                    y += (steps[j] * b[i]) * slopes[i]
            if not (np.abs(y) < FAR).any():
                return
            moved[j + 1] = y

    return compiled_steps


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
