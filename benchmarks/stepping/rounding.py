"""What rounding does to energy in a long run of Kepler's problem, beside the same map in higher precision.

A random walk is what Brouwer's law promises: the rms over many starts grows as √n and the mean stays at zero. A bias,
as rounded coefficients cause it, grows as n.

References:
    HLW, section VIII.5; Hairer, McLachlan, Razakarivony, Achieving Brouwer's law with implicit Runge–Kutta methods,
    BIT 48 (2008), DOI 10.1007/s10543-008-0170-3.
"""

from __future__ import annotations

import ctypes
import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from math import cos, pi, sin, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import bseries as bs

from ..timing import run as run_process
from .c_steps import SOURCES, gauss_coefficients, scratch_folder

if TYPE_CHECKING:
    import numpy as np

ECCENTRICITY = 0.6
STEP = 2 * pi / 200
STARTS, POINTS, DECADES = 24, 12, 3
"""How many starts, and how often each is looked at: at step numbers in geometric progression, over the last decades."""
DIGITS = 40


class Rounding(NamedTuple):
    """Relative changes of energy that rounding has caused, a row for each start, and the numbers of steps."""

    steps: np.ndarray
    changes: np.ndarray

    @property
    def rms(self) -> np.ndarray:
        """The root mean square over the starts, for each number of steps."""
        import numpy as np

        return np.sqrt((self.changes**2).mean(axis=0))

    @property
    def exponent(self) -> float:
        """How the rms grows: the slope of the straight line nearest to it in the logarithms."""
        import numpy as np

        return float(np.polyfit(np.log(self.steps), np.log(self.rms), 1)[0])

    @property
    def bias(self) -> float:
        """The size of the mean at the end, in standard errors."""
        last = self.changes[:, -1]
        return float(abs(last.mean()) / (last.std(ddof=1) / sqrt(len(last))))


def rounding(method: str, steps: int, *, starts: int = STARTS, **options: Any) -> Rounding:
    """Run a method on Kepler's problem from random starts, on all cores.

    Args:
        method: ``stormer-verlet-kdk`` or ``gauss3``: those that `c/precise_kepler.c` has.
        steps: The number of steps, 1000 at least.
        starts: How many starts.
        **options: Of `bseries.stepper`.
    """
    import numpy as np

    stepper = bs.stepper(method, bs.scene("kepler"), **options)
    numbers = np.unique(np.geomspace(steps / 10**DECADES, steps, POINTS).round().astype(np.int64))
    stepper.advance(stepper.start(h=STEP), 1)  # compiles, before there are threads, as the next line does
    _library()

    def changes(start: list[float]) -> np.ndarray:
        state = stepper.start(start, h=STEP)
        rows = [np.concatenate([state.y, state.carry])]
        for n in numbers.tolist():
            stepper.advance(state, n - state.n)
            rows.append(np.concatenate([state.y, state.carry]))
        return energy_changes(method, np.array(rows))[1:]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return Rounding(numbers, np.array(list(pool.map(changes, random_starts(starts)))))


def random_starts(count: int) -> list[list[float]]:
    """States (p, q) on ellipses of semi-axis 1: turned by a random angle, at a random time since perihelion."""
    import numpy as np

    angles = np.random.default_rng(1).uniform(-pi, pi, (count, 2))
    return [_on_ellipse(*pair) for pair in angles.tolist()]


def _on_ellipse(turn: float, anomaly: float) -> list[float]:
    e, E = ECCENTRICITY, anomaly
    for _ in range(50):
        E -= (E - e * sin(E) - anomaly) / (1 - e * cos(E))  # Kepler's equation
    b, rate = sqrt(1 - e * e), 1 / (1 - e * cos(E))
    p, q = (-sin(E) * rate, b * cos(E) * rate), (cos(E) - e, b * sin(E))
    c, s = cos(turn), sin(turn)
    return [c * p[0] - s * p[1], s * p[0] + c * p[1], c * q[0] - s * q[1], s * q[0] + c * q[1]]


def energy_changes(method: str, rows: np.ndarray) -> np.ndarray:
    """The relative change of energy since the first of these states, along the exact map that the method is.

    Args:
        method: Its name.
        rows: A row for each state: y, and what is to be added to it.
    """
    import numpy as np

    function = getattr(_library(), f"energy_changes_{method.replace('-', '_')}")
    function.argtypes = [ctypes.c_void_p, ctypes.c_long, ctypes.c_double, ctypes.c_void_p]
    function.restype = None
    states, changes = np.ascontiguousarray(rows), np.empty(len(rows))
    function(states.ctypes.data, len(states), STEP, changes.ctypes.data)
    return changes


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    import mpmath

    folder = Path(scratch_folder().name)
    with mpmath.workdps(DIGITS):
        arrays = [_array(f"gauss3_{name}", values) for name, values in gauss_coefficients("gauss3").items()]
    (folder / "precise_coefficients.h").write_text("".join(arrays))
    target = folder / "precise_kepler.so"
    source = SOURCES / "precise_kepler.c"
    run_process(["gcc", "-O2", "-Wall", "-shared", "-fPIC", f"-I{folder}", str(source), "-o", str(target), "-lm"])
    return ctypes.CDLL(str(target))


def _array(name: str, values: list[Any]) -> str:
    import mpmath

    numbers = [f"{mpmath.nstr(mpmath.mpf(x), DIGITS)}L" for x in values]
    return f"static const long double {name}[] = {{{', '.join(numbers)}}};\n"
