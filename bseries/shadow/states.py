"""Mass-weighted states at full steps of kick–drift–kick, with diagnoses of states that are no consecutive steps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, NoReturn

import numpy as np

from bseries.exceptions import SeriesError
from bseries.shadow.sources import Columns, Source

FULL, BEHIND, AHEAD, MIDDLE = "full", "half-behind", "half-ahead", "drift-kick-drift"
LAYOUTS = (FULL, BEHIND, AHEAD, MIDDLE)
"""Storage of momenta: with their positions; half a step before or after them; or for the other kind of step."""


class States(NamedTuple):
    """Consecutive states: arrays (coordinates, steps), and (steps,) for u.

    They are mass-weighted, q̂ = M^(1/2) q, p̂ = M^(−1/2) p, ĝ = M^(−1/2) ∇U, so that masses do not appear.
    """

    q: np.ndarray
    p: np.ndarray
    g: np.ndarray
    u: np.ndarray


class Masses:
    """The kinetic energy, as the factor L of M⁻¹ = L Lᵀ, for M⁻¹ or its diagonal: mass-weighted momenta are Lᵀp."""

    def __init__(self, inverse: np.ndarray):
        if inverse.ndim == 2 and not np.any(inverse - np.diag(np.diag(inverse))):
            inverse = np.diag(inverse)
        try:
            if inverse.ndim == 1 and not (np.all(inverse > 0) and np.all(np.isfinite(inverse))):
                raise np.linalg.LinAlgError
            self._factor = np.sqrt(inverse) if inverse.ndim == 1 else np.linalg.cholesky(inverse)
        except np.linalg.LinAlgError:
            raise SeriesError("mass must be positive, but that of some coordinate was not") from None
        self._inverse = 1 / self._factor if inverse.ndim == 1 else np.linalg.inv(self._factor)

    def of_momenta(self, rows: np.ndarray) -> np.ndarray:
        """Momenta or gradients (steps, coordinates) as columns, mass-weighted."""
        return _weighted(rows, self._factor)

    def of_positions(self, rows: np.ndarray) -> np.ndarray:
        """Positions or velocities (steps, coordinates) as columns, mass-weighted."""
        return _weighted(rows, self._inverse.T)

    def positions(self, columns: np.ndarray) -> np.ndarray:
        """Rows of positions from mass-weighted columns."""
        return _weighted(columns.T, self._factor.T).T


def _weighted(rows: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """The columns of rows times a factor, which is a matrix or its diagonal."""
    if factor.ndim == 1:
        return np.multiply(rows.T, factor[:, None], order="C")
    return np.ascontiguousarray((rows @ factor).T)


def read_states(
    blocks: Iterator[Columns], masses: Masses, h: float, source: Source, layout: str, period: Any
) -> Iterator[States]:
    """The states of successive blocks of columns; `period` is the box for each coordinate, or None."""
    last, crossings = None, 0.0
    for columns in blocks:
        p = masses.of_momenta(columns["p"]) if "p" in columns else masses.of_positions(columns["v"])
        q = columns["q"]
        if period is not None:  # positions continue where they jump to the other side of the box
            jumps = np.round(np.diff(q, axis=0, prepend=q[:1] if last is None else last) / period)
            crossings = np.cumsum(jumps, axis=0) + crossings
            last, q, crossings = q[-1:].copy(), q - period * crossings, crossings[-1:]
        weighted = masses.of_positions(q)
        if layout == MIDDLE:
            weighted += 0.5 * h * p
            q = masses.positions(weighted)
        if source.forces is not None:
            gradients, u = source.forces(np.ascontiguousarray(q))
        else:
            gradients, u = columns["gradU"] if "gradU" in columns else -columns["F"], columns["U"]
        g = masses.of_momenta(gradients)
        if layout != FULL:
            p += (0.5 if layout == AHEAD else -0.5) * h * g
        yield States(weighted, p, g, u)


def longest(columns: np.ndarray) -> float:
    """The length of the longest column, without overflow."""
    most = float(np.max(np.abs(columns)))
    return most * float(np.sqrt(np.max(np.sum((columns / most) ** 2, axis=0)))) if most else 0.0


def positive_numbers(value: Any, argument: str, dimension: int) -> np.ndarray:
    """One positive number, or one for each particle, dimension of space or coordinate."""
    try:
        values = np.asarray(value, dtype=float).reshape(-1)
    except (TypeError, ValueError, OverflowError):
        raise SeriesError(f"{argument} must be numbers, but was {value!r:.60}") from None
    if not len(values) or dimension % len(values):
        raise SeriesError(
            f"{argument} must be one number, or one for each particle or coordinate, but there were {len(values)} for "
            f"{dimension} coordinates"
        )
    wrong = values[~((values > 0) & np.isfinite(values))]
    if len(wrong):
        raise SeriesError(f"{argument} must be positive, but one was {wrong[0]:g}")
    return values


CLOSE, ROUGH, EXACT = 1e-4, 0.03, 1e-9
"""Largest unexplained part of a step for a valid diagnosis: for ratios, for long steps, and for exact definitions."""
RARE, MANY, FAR = 0.05, 10.0, 0.3
"""Share of steps with a cause of their own; factor of a jump; error of the ratio of potential and work."""
ROUNDING = 1e-4
"""Largest relative distance from a step that rounding of the data may explain."""
PLURALS = {"t": "times", "q": "positions", "p": "momenta", "v": "velocities", "U": "potentials"}
"""Names of columns in messages about infinite values; the others are forces."""


def check_columns(
    columns: Columns, before: float | None, h: float, first: int, tolerance: float, source: Source
) -> None:
    """Check that columns are finite and times advance by h."""
    for role, rows in columns.items():
        check_finite(rows.T, PLURALS.get(role, "forces"), first, source)
    if "t" not in columns:
        return
    t = columns["t"] if before is None else np.concatenate(([before], columns["t"]))
    steps = np.diff(t)
    wrong = np.flatnonzero(~(np.abs(steps - h) <= 1e-3 * abs(h) + 2 * tolerance * np.max(np.abs(t))))
    if len(wrong):
        k, step = first + int(wrong[0]) + (before is None), float(steps[wrong[0]])
        ratio = step / h
        if np.isfinite(ratio) and round(ratio) > 1 and abs(ratio - round(ratio)) < CLOSE * ratio:
            refuse_thinned(source, f"are {round(ratio)} steps of size {h:g} apart")
        distance = float(np.max(np.abs(steps - h)) / (2 * np.max(np.abs(t))))
        raise SeriesError(
            f"t must advance by one step, {h:g}, each time, but from state {k} to {k + 1} it advanced by {step:g}"
            f"{_on_rounding(distance)}"
        )


def check_finite(array: np.ndarray, name: str, first: int, source: Source) -> None:
    """Check that numbers are finite."""
    finite = np.isfinite(array)
    if not finite.all():
        n = int(np.argmin(finite.reshape(-1, array.shape[-1]).all(axis=0)))
        raise SeriesError(f"{source.label} must have finite {name}, but those of state {first + n + 1} are not")


def refuse_thinned(source: Source, what: str) -> NoReturn:
    """Report missing steps."""
    raise SeriesError(f"{source.label} must contain every step, but its states {what}")


def check_steps(states: States, h: float, first: int, tolerance: float, source: Source, layout: str) -> float:
    """Check that states, from number `first` on, are consecutive steps; returns the energy of the largest distance."""
    q, p, g, u = states
    for array, name in ((q, "positions"), (p, "momenta"), (g, "forces"), (u, "potentials")):
        check_finite(array, name, first, source)
    if q.shape[1] < 2:
        return 0.0
    moved, drift, changed, impulse = _steps(states, h)
    of_q, of_p = np.max(np.abs(moved - drift), axis=0), np.max(np.abs(changed - impulse), axis=0)
    size_p = float(np.max(np.abs(p))) + abs(h) * float(np.max(np.abs(g)))
    size_q = float(np.max(np.abs(q))) + abs(h) * size_p
    wrong_q, wrong_p = ~(of_q <= tolerance * size_q), ~(of_p <= tolerance * size_p)  # includes nan
    if wrong_q.any() or wrong_p.any():
        n = int(np.argmax(wrong_q | wrong_p))
        by = f", made by {source.method}," if source.method else ""
        must = f"{source.label}{by} must have consecutive steps of Störmer–Verlet (kick–drift–kick) with h = {h:g}"
        holds = not wrong_q[n], bool(wrong_p.mean() < RARE)
        reason = _diagnosis(states, h, layout, n, *holds, f"from state {first + n + 1} to {first + n + 2}")
        distance = max(float(np.max(of_q)) / (size_q or 1), float(np.max(of_p)) / (size_p or 1))
        raise SeriesError(f"{must}, but {reason}{_on_rounding(distance)}")
    return float(np.max(of_q)) * longest(g) + float(np.max(of_p)) * longest(p)


def _steps(states: States, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The changes of positions and of momenta from state to state, each with what a step makes of it."""
    q, p, g, _ = states
    return np.diff(q), h * (p[:, :-1] - 0.5 * h * g[:, :-1]), np.diff(p), -0.5 * h * (g[:, 1:] + g[:, :-1])


def _on_rounding(distance: float) -> str:
    """The tolerance that accepts states at a relative distance, if numbers with few digits may explain it."""
    return f"; if it is rounding, tolerance must be {2 * distance:.0e}" if distance < ROUNDING else ""


def check_potential(states: States, tolerance: float, source: Source) -> None:
    """Check that the potential changes by the work of the forces."""
    work = 0.5 * np.sum((states.g[:, 1:] + states.g[:, :-1]) * np.diff(states.q), axis=0)
    size = float(np.sqrt(work @ work))
    if not size:
        return
    ratio = float(work @ np.diff(states.u)) / size**2
    rounding = tolerance * (float(np.max(np.abs(states.u))) + longest(states.q) * longest(states.g))
    if not abs(ratio - 1) <= FAR + rounding * len(work) ** 0.5 / size:
        raise SeriesError(
            f"{source.label} must have the potential of its forces, but it changes by {ratio:.4g} times their work"
        )


def _diagnosis(states: States, h: float, layout: str, n: int, q_holds: bool, p_holds: bool, step: str) -> str:
    """The likely cause of states that are no steps of size h, where step n is the first wrong one."""
    _, p, g, _ = states
    moved, drift, changed, impulse = _steps(states, h)
    jump = abs(moved[:, n] - drift[:, n]).max()
    if jump > MANY * abs(drift).max() and abs(changed[:, n]).max() <= MANY * abs(impulse).max():
        return f"{step} positions jump by {jump:.6g}, as if wrapped into a box (period unwraps them)"
    stored = p - {FULL: 0.0, AHEAD: 0.5, BEHIND: -0.5, MIDDLE: 0.0}[layout] * h * g
    one, other = h * stored[:, :-1], h * stored[:, 1:]
    for name, expected in ((AHEAD, one), (BEHIND, other), (MIDDLE, 0.5 * (one + other))):
        if MIDDLE != layout != name and _unexplained(moved, expected) < EXACT:
            return f"they are of the layout {name!r}"
    found = _ratios(moved, drift) if p_holds and not q_holds else None
    if found is not None:
        k = int(abs(found - 1).argmax())
        return f"coordinate {k + 1} moves {found[k]:.6g} times as far as its mass implies"
    average = 0.5 * h * (p[:, 1:] + p[:, :-1])  # for steps of another length
    found = None if q_holds or p_holds else _ratios(moved, average)
    if found is not None and abs(found - found.mean()).max() < ROUGH * abs(found.mean()):
        times = float(found.mean())
        whole = round(times)
        kept = f", as if only one in {whole} states was kept" if whole > 1 and abs(times - whole) < ROUGH else ""
        return f"positions move {times:.4g} times as far as h implies{kept}"
    found = _ratios(changed, impulse) if q_holds or not p_holds else None
    if found is not None:
        return f"momenta change by {found.mean():.6g} times the impulse of the forces: units, sign or masses are wrong"
    if q_holds:
        return f"{step} momenta change by more than the forces: a thermostat, constraints or another potential"
    return f"{step} there is no such step: states are missing, or the scene, the method, h or masses are wrong"


def _unexplained(found: np.ndarray, expected: np.ndarray) -> float:
    """The median of the unexplained part of differences, relative to that of the differences."""
    size = float(np.median(np.abs(found)))
    return float(np.median(np.abs(found - expected))) / size if size else float("inf")


def _ratios(found: np.ndarray, expected: np.ndarray) -> np.ndarray | None:
    """The factor for each coordinate; None if factors do not explain the differences."""
    squares, products = np.sum(expected * expected, axis=1), np.sum(found * expected, axis=1)
    if not (np.all(squares > 0) and np.all(products)):
        return None
    ratios = products / squares
    explained = _unexplained(found, ratios[:, None] * expected) < ROUGH and np.max(np.abs(ratios - 1)) > ROUGH
    return ratios if explained else None
