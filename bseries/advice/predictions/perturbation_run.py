"""Perturbation run: the exact flow and a solution of the modified equation over a part of a run.

The numerical solution follows y' = f(y) + r(y) with r = h^p f_{p+1} + … This equation is solved by a splitting: the
exact flow of f between equidistant times, and an impulse Δt · r(y) at each of them, half of it before and half after
the state is recorded. These are trapezoidal sums for r, which suffice for smooth functions along an orbit. The states
at which r is evaluated are found by iteration, block by block, so that r is evaluated at many states at once. If the
effect of r would be lost in rounding errors, r is multiplied by a factor, and the difference of the solutions is
divided by it; the difference is then still small enough to be proportional to r.
"""

from __future__ import annotations

import math
from functools import cache
from time import thread_time
from typing import Any, NamedTuple

import numpy as np

from bseries.advice.measures import NOISE, largest_size, norms, without_time
from bseries.advice.predictions.modified_terms import Gradient, ModifiedTerms
from bseries.exceptions import SeriesError
from bseries.fields.modified_fields import SceneSeries, modified_field
from bseries.fields.truncation import Reach
from integrators.scenes.scene import Scene
from integrators.steppers.states import State, StepError
from integrators.steppers.stepping import Stepper, stepper

METHOD, SUBSTEPS = "dop853", 3
"""The method for the exact flow and its steps between impulses: with steps of τ/18 its error is near rounding."""
DISTANCE = 1e-9
"""Least relative effect of r over a time scale: its square and 2^-53 are both below 10^-6 of it."""
SECONDS = 4.0
"""CPU time for large scenes; small ones need about a second for all impulses."""
MOST_POINTS = 2**14
"""The most impulses: about 400 periods."""


class Impulses(NamedTuple):
    """The time between impulses."""

    per_scale: int = 6
    """In a time scale τ, τ² = |f|/|f'f'f + f"(f, f)/4|: for an oscillator τ = 1/ω, with 38 impulses per period."""
    first: int = 256
    """States from which the time scale is computed: several periods."""
    wide: float = 1.5
    """Factor by which the spacing may be too wide before it is reduced."""
    narrow: float = 4.0
    """Factor by which the spacing may be too narrow before it is multiplied by it, as at a start from rest."""
    trials: int = 24
    """Changes of the spacing: 4^24 suffices in double precision."""


class Iteration(NamedTuple):
    """The iteration for the states of a block of impulses.

    It multiplies the error by about the effect of r over a block; a few passes suffice unless that is large, and then
    the series in h is of no use.
    """

    block: int = 32
    """Impulses in a block."""
    passes: int = 10
    """Most passes."""
    change: float = 1e-4
    """Relative change at which it ends."""


IMPULSES, ITERATION = Impulses(), Iteration()


class PerturbationRun(NamedTuple):
    """Results at n equidistant times."""

    t: np.ndarray  # the times since the start
    y: np.ndarray  # the states of the exact flow, (variables, n)
    errors: np.ndarray  # the difference of the other solution and `y`, (variables, n); zero for the time
    changes: np.ndarray | None  # the changes of the energy by power of h, (powers, n); None without an energy
    powers: tuple[int, ...]  # the powers of h used
    factor: float  # the factor of r: if it exceeds 1, errors are proportional to r while they are small
    is_complete: bool  # whether the other solution was computed at all these times


def perturbation_run(
    terms: ModifiedTerms, energy_gradient: Gradient | None, y0: np.ndarray, h: float, span: float, t0: float = 0.0
) -> PerturbationRun | None:
    """Compute the exact flow and the modified equation over a span, or over the part that the CPU time allows.

    `energy_gradient` is ∇H as a function of states, and `span` has the sign of h. There is no result if the span is
    shorter than the time scale and all effects are below the rounding of a step.
    """
    scene = terms.field.scene
    total = max(1, math.ceil(span / _spacing(terms, y0, span, t0)))
    spacing = span / total
    first = _exact_states(scene, y0, spacing, min(IMPULSES.first, total), t0)
    powers, effect = _powers(terms, first, h)
    size = largest_size(without_time(scene, first))
    if not effect or (total <= IMPULSES.per_scale and abs(span) * effect < 2.0**-53 * size):
        return None
    factor = max(1.0, DISTANCE * size / (abs(spacing) * IMPULSES.per_scale * effect))

    effects = _Effects(terms, powers, h, factor * spacing / 2)
    flow, count = stepper(METHOD, scene), min(total, MOST_POINTS)
    exact, other = (flow.start(y0, h=spacing / SUBSTEPS, t0=t0) for _ in range(2))
    y, z = [y0[:, None]], [y0[:, None]]
    other.values += effects.impulses(y[0])[:, 0]
    done, began, is_complete = 0, math.inf, True  # the first block compiles
    while done < count and thread_time() - began < SECONDS:
        points = min(ITERATION.block, count - done)
        y.append(_recorded(flow, exact, np.zeros((len(y0), points))))
        found = effects.solution(flow, other, y[-1])
        if found is None:
            is_complete = False
            del y[-1]
            break
        z.append(found)
        began, done = min(began, thread_time()), done + points
    states, others = np.concatenate(y, axis=1), np.concatenate(z, axis=1)
    t = np.linspace(0.0, span * (done / total), done + 1)  # ends exactly with the run
    changes = None if energy_gradient is None else effects.energy_changes(energy_gradient, others, spacing)
    return PerturbationRun(t, states, (others - states) / factor, changes, powers, factor, is_complete)


class _Effects:
    """Effects of r = h^p f_{p+1} + …: impulses, the solution with them, and changes of the energy."""

    def __init__(self, terms: ModifiedTerms, powers: tuple[int, ...], h: float, weight: float):
        self._terms, self._weight = terms, weight
        self._scales = h ** np.array(powers)[:, None, None]

    def _values(self, y: np.ndarray) -> np.ndarray:
        """The terms of r, (powers, variables, n)."""
        return self._terms.values(y)[: len(self._scales)] * self._scales

    def impulses(self, y: np.ndarray) -> np.ndarray:
        """Half of the impulses at some states, (variables, n)."""
        return self._weight * self._values(y).sum(axis=0)

    def solution(self, flow: Stepper, state: State, y: np.ndarray) -> np.ndarray | None:
        """The solution with impulses from a state, which is replaced by the last one; None if no solution is found.

        Impulses are evaluated at the states of the previous iteration, at first at those without impulses.
        """
        begin, impulses, before = state.copy(), 0 * y, None
        for _ in range(ITERATION.passes):
            state.assign(begin)
            try:
                found = _recorded(flow, state, impulses)
            except StepError:
                return None
            if before is not None and abs(found - before).max() <= ITERATION.change * abs(found - y).max():
                return found
            before, impulses = found, self.impulses(found)
        return None

    def energy_changes(self, gradient: Gradient, y: np.ndarray, spacing: float) -> np.ndarray:
        """∫ ∇H · r dt by power of h along a solution, (powers, n)."""
        products = gradient(y) * self._values(y)
        rates = products.sum(axis=1)
        rates[abs(rates) <= NOISE * abs(products).sum(axis=1)] = 0.0  # where the energy is conserved
        changes = np.zeros(rates.shape)
        changes[:, 1:] = np.cumsum((rates[:, 1:] + rates[:, :-1]) * (spacing / 2), axis=1)
        return changes


def _exact_states(scene: Scene, y0: np.ndarray, spacing: float, points: int, t0: float) -> np.ndarray:
    """The exact flow at y0 and later equidistant times."""
    from integrators import integrate

    step = spacing / SUBSTEPS
    return integrate(METHOD, scene, h=step, steps=SUBSTEPS * points, save_every=SUBSTEPS, y0=y0, t0=t0).y


def _recorded(flow: Stepper, state: State, impulses: np.ndarray) -> np.ndarray:
    """The states in the middle of impulses, (variables, n); half of these are given."""
    rows = np.empty((impulses.shape[1], len(impulses) + 1))
    rows[:, 0], rows[:, 1:] = len(impulses), impulses.T
    flow.record(state, SUBSTEPS * len(rows), o_every=SUBSTEPS, observer=_add_impulse().address, o_rows=rows)
    return rows[:, 1:].T


@cache
def _add_impulse() -> Any:
    """Compiled observer that adds half of an impulse to the state before and after recording it."""
    from numba import types

    from bseries_base.machine_code import cfunc
    from integrators.compile.machine import DOUBLE, DOUBLES, OPTIONS

    def add(t: Any, y: Any, row: Any) -> None:
        """Read the number of variables and half an impulse from a row, and write the state between the halves to it.

        Solvers without memory from step to step allow the state to be changed.
        """
        for i in range(int(row[0])):
            impulse = row[i + 1]
            row[i + 1] = y[i] + impulse
            y[i] = row[i + 1] + impulse

    return cfunc(types.void(DOUBLE, DOUBLES, DOUBLES), **OPTIONS)(add)


def _powers(terms: ModifiedTerms, y: np.ndarray, h: float) -> tuple[tuple[int, ...], float]:
    """The powers of h whose terms decrease, two or more if there are, and the mean size of their sum."""
    means, each = np.zeros(terms.field.order), np.array([norms(values) for values in terms.values(y)])
    means[0] = norms(terms.field.terms(y)[0]).mean()
    means[list(terms.powers)] = each.mean(axis=1)
    if not np.isfinite(means).all():
        raise SeriesError("y0 must be a state at which the terms of the modified equation are finite, but some are not")
    if not each.any():
        raise SeriesError("y0 must be a state at which the modified equation has terms other than f, but all vanish")
    reach = Reach("", h, tuple(means.tolist()))
    powers = tuple(k for k in terms.powers if k <= reach.optimal_power)
    if len(powers) < min(2, len(terms.powers)):  # a single one has no estimate of its error
        before, power = [(0, *terms.powers)[len(powers) + i] for i in (0, 1)]
        if reach.sizes[power]:
            raise _too_large(h, "", before, power, reach.sizes[power] / reach.sizes[before])
    if len(each) > 1:
        first, second = each[:2, each[0].argmax()]
        ratio = second / first * np.float64(abs(h)) ** (terms.powers[1] - terms.powers[0])
        if ratio > 1:
            raise _too_large(h, " where they are largest", terms.powers[0], terms.powers[1], ratio)
    return powers, sum(reach.sizes[k] for k in powers)


def _too_large(h: float, where: str, before: int, power: int, ratio: float) -> SeriesError:
    return SeriesError(
        f"h must be small enough for the terms of the modified equation to shrink{where}, but was {h:g}, where the one "
        f"with h^{power} is {ratio:.1g} times that with h^{before}"
    )


def _spacing(terms: ModifiedTerms, y0: np.ndarray, span: float, t0: float) -> float:
    """The time between impulses: a fraction of the time scale along the beginning of the orbit."""
    from integrators import method

    field, whole = modified_field(method("explicit-euler"), terms.field.scene, 3), abs(span)
    spacing, was_reduced = min(whole, _time_scale(field, y0[:, None], all_terms=True) / IMPULSES.per_scale), False
    for _ in range(IMPULSES.trials):
        points = min(IMPULSES.first, math.ceil(whole / spacing))
        states = _exact_states(field.scene, y0, math.copysign(spacing, span), points, t0)
        wanted = _time_scale(field, states) / IMPULSES.per_scale
        if spacing > IMPULSES.wide * wanted:
            spacing, was_reduced = wanted, True
        elif was_reduced or wanted < IMPULSES.narrow * spacing or points < IMPULSES.first:
            return math.copysign(spacing, span)
        else:
            spacing *= IMPULSES.narrow
    raise SeriesError("scene must have a solution whose time scale does not tend to zero, but that of this one does")


def _time_scale(field: SceneSeries, y: np.ndarray, all_terms: bool = False) -> float:
    """The least τ of some points, from f and f'f'f/3 + f"(f, f)/12, the terms of the explicit Euler method."""
    f, once, twice = (norms(term) for term in field.terms(y))
    least = np.sqrt(f[twice > 0] / (3 * twice[twice > 0])).min(initial=math.inf)
    return float((f[once > 0] / (2 * once[once > 0])).min(initial=least) if all_terms else least)
