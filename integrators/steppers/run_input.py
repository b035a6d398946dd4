"""What users give a stepper: parts, numbers, and arrays for compiled code to write to."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError, shown

if TYPE_CHECKING:
    import numpy as np

MOST_STEPS = 2**53
"""Beyond, a double does not hold the number of a step."""


def check_rows(rows: Any, times: Any, count: int, width: int | None, name: str) -> None:
    """Refuse arrays that compiled code would write beyond."""
    import numpy as np

    for array, dimensions, argument in ((rows, 2, f"{name}_rows"), (times, 1, f"{name}_times")):
        if array is None:
            if count and argument.endswith("rows"):
                raise IntegratorError(f"{argument} must be given with {name}_every, but was not")
            continue
        fits = isinstance(array, np.ndarray) and array.dtype == np.float64 and array.ndim == dimensions
        fits = fits and array.flags.c_contiguous and array.flags.writeable
        if not fits or len(array) < count or (dimensions == 2 and width not in (None, array.shape[1])):
            raise IntegratorError(
                f"{argument} must be a contiguous array of doubles with {count} rows"
                f"{f' of {width}' if dimensions == 2 and width else ''}, but was {shown(array)}"
            )


def rows_from(
    every: int, rows: np.ndarray | None, times: np.ndarray | None, n: int, first: int
) -> tuple[int, np.ndarray, np.ndarray]:
    """What `recorded` takes to store every so many steps after step n, if rows begin after step `first`."""
    import numpy as np

    row = n // every - first // every if every else 0
    return every, np.empty((0, 0)) if rows is None else rows[row:], np.empty(0) if times is None else times[row:]


def parts_key(parts: Any) -> Any:
    """What parts are said to be, in a form that can be looked up."""
    if parts is None:
        return None
    if isinstance(parts, Mapping):
        values = list(parts.values())
        if all(isinstance(v, str) or (isinstance(v, Sequence) and all(isinstance(x, str) for x in v)) for v in values):
            return tuple((name, v if isinstance(v, str) else tuple(v)) for name, v in parts.items())
    raise IntegratorError(f"parts must map the method's parts to names of blocks or parts, but was {shown(parts)}")


def read_number(value: Any, argument: str) -> float:
    """A finite number."""
    import math

    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise IntegratorError(f"{argument} must be a finite number, but was {shown(value)}")
    return number


def read_positive(value: Any, argument: str) -> float:
    """A finite number that is positive."""
    number = read_number(value, argument)
    if number <= 0:
        raise IntegratorError(f"{argument} must be positive, but was {number:g}")
    return number


def check_progress(progress: Any) -> None:
    """Refuse what cannot be called with the number of steps made and of all."""
    if progress is not None and not callable(progress):
        raise IntegratorError(f"progress must be a function of two numbers, but was {shown(progress)}")


def read_whole(value: Any, argument: str, what: str, least: int, most: int) -> int:
    """A whole number within limits, which messages describe as `what`."""
    try:
        number = least - 1 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = least - 1
    if not least <= number <= most:
        raise IntegratorError(f"{argument} must be {what}, but was {shown(value)}")
    return number


def read_steps(value: Any, argument: str, least: int) -> int:
    """A number of steps."""
    return read_whole(value, argument, f"a whole number from {least} to 2^53", least, MOST_STEPS)


def check_end(t0: float, h: float, steps: int) -> None:
    """Refuse steps to times that no double holds."""
    import math

    if not math.isfinite(t0 + steps * h):
        raise IntegratorError(
            f"h must be small enough for a finite time after {steps} steps from t = {t0:g}, but was {h:g}"
        )


def read_array(values: Any) -> np.ndarray:
    """Real numbers as an array of doubles; nan where they are none."""
    import numpy as np

    try:
        if np.iscomplexobj(values) or np.ma.is_masked(values):
            raise TypeError
        return np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return np.array(np.nan)


def read_vector(values: Any, dimension: int) -> np.ndarray:
    """The start of a run."""
    import numpy as np

    vector = read_array(values)
    if vector.shape != (dimension,) or not np.isfinite(vector).all():
        raise IntegratorError(f"y0 must hold {dimension} finite numbers, but was {shown(values)}")
    return vector
