"""Checks that states are consecutive steps of kick–drift–kick, with diagnoses of those that are not."""

from __future__ import annotations

import math
from numbers import Real
from typing import TYPE_CHECKING, Any, NoReturn

from bseries.exceptions import SeriesError
from bseries.shadow import kernels
from bseries.shadow.states import AHEAD, BEHIND, FULL, MIDDLE, States, longest

if TYPE_CHECKING:
    import numpy as np

    from bseries.shadow.roundings import Roundings
    from bseries.shadow.sources import Columns, Source

CLOSE, ROUGH, EXACT = 1e-4, 0.03, 1e-9
"""Largest unexplained part of a step for a valid diagnosis: for ratios, for long steps, and for exact definitions."""
RARE, MANY, FAR = 0.05, 10.0, 0.3


NAMES = {"t": "times", "q": "positions", "p": "momenta", "v": "velocities", "U": "potentials"}
"""Names of columns in messages about infinite values; the others are forces."""


def check_columns(columns: Columns, before: float | None, h: float, first: int, source: Source) -> None:
    """Check that columns are finite and times advance by h."""
    import numpy as np

    for role, rows in columns.items():
        check_finite(rows.T, NAMES.get(role, "forces"), first, source)
    if "t" not in columns:
        return
    t = columns["t"] if before is None else np.concatenate(([before], columns["t"]))
    steps = np.diff(t)
    wrong = np.flatnonzero(~(np.abs(steps - h) <= 1e-3 * abs(h) + 2 * source.off("t", t)))
    if len(wrong):
        k, step = first + int(wrong[0]) + (before is None), float(steps[wrong[0]])
        ratio = step / h
        if np.isfinite(ratio) and round(ratio) > 1 and abs(ratio - round(ratio)) < CLOSE * ratio:
            refuse_thinned(source, f"are {round(ratio)} steps of size {h:g} apart")
        raise SeriesError(
            f"t must advance by one step, {h:g}, each time, but from state {k} to {k + 1} it advanced by {step:g}"
        )


def check_finite(array: np.ndarray, name: str, first: int, source: Source) -> None:
    """Check that numbers are finite."""
    import numpy as np

    finite = np.isfinite(array)
    if not finite.all():
        n = int(np.argmin(finite.reshape(-1, array.shape[-1]).all(axis=0)))
        raise SeriesError(f"{source.label} must have finite {name}, but those of state {first + n + 1} are not")


def refuse_thinned(source: Source, what: str) -> NoReturn:
    """Report missing steps."""
    raise SeriesError(f"{source.label} must have every step, one after the other, but its states {what}")


def check_steps(
    states: States, h: float, first: int, tolerance: float, off: Roundings, source: Source, layout: str
) -> None:
    """Check that states are consecutive steps of kick–drift–kick.

    Args:
        states: Consecutive states.
        h: The step size.
        first: The number of the first state.
        tolerance: Largest distance of a state from a step, relative to the largest numbers.
        off: Bounds of rounding errors, which are added.
        source: The source of the states.
        layout: The storage layout of momenta.
    """
    import numpy as np

    q, p, g, u = states
    for array, name in ((q, "positions"), (p, "momenta"), (g, "forces"), (u, "potentials")):
        check_finite(array, name, first, source)
    if q.shape[1] < 2:
        return
    of_q, of_p = np.empty(q.shape[1] - 1), np.empty(q.shape[1] - 1)
    sizes = kernels.step_residuals.compiled(h, q, p, g, of_q, of_p)
    speed = sizes[1] + abs(h) * sizes[2]
    size = abs(h)
    rounded_q = 2 * off.q + size * (off.p + 0.5 * size * off.g) + off.h * speed
    rounded_p = 2 * off.p + size * off.g + off.h * sizes[2]
    wrong_q = ~(of_q <= tolerance * (sizes[0] + size * speed) + rounded_q)  # includes nan
    wrong_p = ~(of_p <= tolerance * speed + rounded_p)
    if wrong_q.any() or wrong_p.any():
        n = int(np.argmax(wrong_q | wrong_p))
        by = f", made by {source.method}," if source.method else ""
        must = f"{source.label}{by} must have consecutive steps of Störmer–Verlet (kick–drift–kick) with h = {h:g}"
        holds = not wrong_q[n], bool(wrong_p.mean() < RARE)
        reason = _Steps(states, h, layout).explanation(n, *holds, f"from state {first + n + 1} to {first + n + 2}")
        raise SeriesError(f"{must}, but {reason}")


def check_potential(states: States, off: Roundings, source: Source) -> None:
    """Check that the potential changes by the work of the forces."""
    import numpy as np

    work = 0.5 * np.sum((states.g[:, 1:] + states.g[:, :-1]) * np.diff(states.q), axis=0)
    squares = float(work @ work)
    ratio = float(work @ np.diff(states.u)) / squares if squares else 1.0
    hidden = (off.energy + off.q * longest(states.g) * len(work) ** 0.5) / squares**0.5 if squares else 0.0
    if not abs(ratio - 1) <= FAR + hidden:
        raise SeriesError(
            f"{source.label} must have the potential of its forces, but it changes by {ratio:.4g} times what they say"
        )


class _Steps:
    """Differences of consecutive states, and those of a step of size h, as columns of arrays."""

    def __init__(self, states: States, h: float, layout: str):
        import numpy as np

        self.h, self.layout, self.q, self.p, self.g = h, layout, states.q, states.p, states.g
        self.of_q, self.of_p = np.diff(self.q), np.diff(self.p)
        self.drift = h * (self.p[:, :-1] - 0.5 * h * self.g[:, :-1])
        self.impulse = -0.5 * h * (self.g[:, 1:] + self.g[:, :-1])

    def explanation(self, n: int, q_holds: bool, p_holds: bool, step: str) -> str:
        """A diagnosis of the states, where step n is the first wrong one."""
        jump, most = abs(self.of_q[:, n] - self.drift[:, n]).max(), abs(self.drift).max()
        if jump > MANY * most and abs(self.of_p[:, n]).max() <= MANY * abs(self.impulse).max():
            return f"{step} positions jump by {jump:.6g}, as if wrapped into a box (period unwraps them)"
        other = self._other_layout()
        if other is not None:
            return f"they are of the layout {other!r}"
        found = _ratios(self.of_q, self.drift) if p_holds and not q_holds else None
        if found is not None:
            return self._on_masses(found)
        average = 0.5 * self.h * (self.p[:, 1:] + self.p[:, :-1])  # for steps of another length
        found = None if q_holds or p_holds else _ratios(self.of_q, average)
        if found is not None and abs(found - found.mean()).max() < ROUGH * abs(found.mean()):
            return self._on_step(float(found.mean()))
        found = _ratios(self.of_p, self.impulse) if q_holds or not p_holds else None
        if found is not None:
            return f"momenta change by {found.mean():.6g} times what the forces say: units, sign or masses are others"
        if q_holds:
            return f"{step} momenta change by more than the forces: a thermostat, constraints or another potential"
        return f"{step} there is no such step: states were left out, or the scene, the method, h or masses are others"

    def _other_layout(self) -> str | None:
        """Another layout of momenta that the positions suggest."""
        half = 0.5 * self.h * self.g
        if self.layout == MIDDLE:
            return None
        raw = self.p - {FULL: 0.0, AHEAD: 1.0, BEHIND: -1.0}[self.layout] * half
        one, other = self.h * raw[:, :-1], self.h * raw[:, 1:]
        candidates = (AHEAD, one), (BEHIND, other), (MIDDLE, 0.5 * (one + other))
        return next((name for name, x in candidates if name != self.layout and _rest(self.of_q, x) < EXACT), None)

    def _on_masses(self, ratios: np.ndarray) -> str:
        """A diagnosis for ratios of displacements to momenta, if momenta agree with the forces."""
        if abs(ratios - ratios.mean()).max() < CLOSE * abs(ratios.mean()):
            return f"positions move {ratios.mean():.6g} times as far as masses say"
        k = int(abs(ratios - 1).argmax())
        return f"coordinate {k + 1} moves {ratios[k]:.6g} times as far as its mass says"

    def _on_step(self, times: float) -> str:
        """A diagnosis for displacements that are all larger or smaller by one factor."""
        whole = round(times)
        kept = f", as if only one in {whole} states was kept" if whole > 1 and abs(times - whole) < ROUGH else ""
        return f"positions move {times:.4g} times as far as h says{kept}"


def _rest(found: np.ndarray, expected: np.ndarray) -> float:
    """The median of the unexplained part, relative to that of the differences."""
    import numpy as np

    size = float(np.median(np.abs(found)))
    return float(np.median(np.abs(found - expected))) / size if size else float("inf")


def _ratios(found: np.ndarray, expected: np.ndarray) -> np.ndarray | None:
    """The factor for each coordinate; None if factors do not explain the differences."""
    import numpy as np

    squares, products = np.sum(expected * expected, axis=1), np.sum(found * expected, axis=1)
    if not (np.all(squares > 0) and np.all(products)):
        return None
    ratios = products / squares
    explained = _rest(found, ratios[:, None] * expected) < ROUGH and np.max(np.abs(ratios - 1)) > ROUGH
    return ratios if explained else None


def finite_number(value: Any, argument: str) -> float:
    """A finite number as a double.

    Raises:
        SeriesError: It is not a number, or not a finite double.
    """
    try:
        number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise SeriesError(f"{argument} must be a finite number, but was {value!r:.60}")
    return number
