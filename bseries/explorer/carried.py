"""States and clouds of points carried along: by steps of a method, or by the flow of a field."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bseries_base.machine_code import njit
from integrators import method
from integrators.steppers.states import StepError

if TYPE_CHECKING:
    from integrators.steppers.stepping import Stepper

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


def orbit(stepper: Stepper, y0: Sequence[float] | np.ndarray, h: float, steps: int, every: int = 1) -> np.ndarray:
    """The start and each `every`-th state of a run, (states, variables).

    They are not numbers after a failure, or after a state that is too far to be drawn.

    Example:
        >>> from integrators import method, scene, stepper
        >>> y = orbit(stepper(method("explicit-euler"), scene("riccati")), [1.0], 0.5, 20)
        >>> len(y), bool(np.nanmax(y) < FAR), bool(np.isnan(y[-1]).all())
        (21, True, True)
    """
    states = np.full((steps // every + 1, stepper.scene.dimension), np.nan)
    states[0] = y0
    with quiet(), suppress(StepError):
        stepper.record(stepper.start(y0, h=h), steps, y_every=every, y_rows=states[1:])
    states[~np.logical_and.accumulate((abs(states) < FAR).all(axis=1))] = np.nan
    return states


def by_steps(stepper: Stepper, points: np.ndarray, h: float, counts: Sequence[int]) -> np.ndarray:
    """Points (variables, points) moved by steps of a method: (times, variables, points), not numbers after a failure.

    The first of the times is that of the starts; `counts` are the steps between them.
    """
    every = math.gcd(*counts)
    places = np.cumsum([0, *counts]) // every
    return np.stack([orbit(stepper, point, h, sum(counts), every)[places] for point in points.T], axis=2)


def by_field(
    field: Callable[[np.ndarray, float], np.ndarray], h: float, points: np.ndarray, times: np.ndarray, longest: float
) -> np.ndarray:
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
    moved = np.full((len(times), *points.T.shape), np.nan)
    moved[0] = points.T
    parts = np.maximum(1, np.ceil(np.diff(times) / longest - 1e-9)).astype(int)
    steps = np.diff(times) / parts
    formulas = getattr(getattr(field, "evaluator", None), "formulas", None)
    with quiet():
        if formulas is not None:
            _compiled_steps()(formulas.module.many, h, moved, parts, steps, *_tableau())
        else:
            _steps(field, h, moved, parts, steps, *_tableau())
    return np.where(abs(moved) < FAR, moved, np.nan).swapaxes(1, 2)


@cache
def _tableau() -> tuple[np.ndarray, np.ndarray]:
    """The matrix and the weights of the method for flows."""
    tableau: Any = method(FLOW)
    tableau = tableau.to_float()
    return np.array(tableau.A, float), np.array(tableau.b, float)


def _steps(
    field: Callable[[np.ndarray, float], np.ndarray], h: float, moved: np.ndarray, parts: np.ndarray, steps: np.ndarray,
    A: np.ndarray, b: np.ndarray,
) -> None:  # fmt: skip
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
def _compiled_steps() -> Callable[..., None]:
    """`_steps` of a compiled function (y, h, out) of rows of points."""
    from numba import types

    rows, numbers = types.Array(types.float64, 2, "C"), types.Array(types.float64, 1, "C")
    field = types.FunctionType(types.void(rows, types.float64, rows))
    cube, counts = types.Array(types.float64, 3, "C"), types.Array(types.int64, 1, "C")

    @njit(types.void(field, types.float64, cube, counts, numbers, rows, numbers), error_model="numpy")
    def compiled_steps(
        field: Callable[..., None], h: float, moved: np.ndarray, parts: np.ndarray, steps: np.ndarray,
        A: np.ndarray, b: np.ndarray,
    ) -> None:  # fmt: skip
        stage, slopes = np.empty(moved.shape[1:]), np.empty((len(b), *moved.shape[1:]))
        path, y_stage, flat = moved.reshape(len(moved), stage.size), stage.ravel(), slopes.reshape(len(b), stage.size)
        y = path[0].copy()
        for j in range(len(steps)):
            for _ in range(parts[j]):
                for i in range(len(b)):
                    for n in range(y.size):  # loops, which numba compiles six times faster than sums of arrays
                        slope = 0.0
                        for k in range(i):
                            slope += A[i, k] * flat[k, n]
                        y_stage[n] = y[n] + steps[j] * slope
                    field(stage, h, slopes[i])
                for n in range(y.size):
                    for i in range(len(b)):
                        y[n] += steps[j] * b[i] * flat[i, n]
            is_near = False
            for n in range(y.size):
                path[j + 1, n] = y[n]
                is_near = is_near or abs(y[n]) < FAR
            if not is_near:
                return

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
