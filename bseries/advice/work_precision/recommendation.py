"""The cheapest method for an error tolerance, and the largest step that meets it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.measures import MEASURES, check_measure, whole_steps
from bseries.advice.work_precision.curves import ROUNDING
from bseries.advice.work_precision.extrapolation import Goal, best_extrapolation, growth_factor
from bseries.advice.work_precision.step_costs import SAMPLE, step_costs
from integrators.core.arguments import read_number, read_positive
from integrators.core.errors import IntegratorError

if TYPE_CHECKING:
    from bseries.advice.work_precision.curves import Curve, Extrapolation
    from bseries.advice.work_precision.extrapolation import Predict
    from bseries.advice.work_precision.run_errors import Judge, RunErrors

NEAR = 1.6
"""Methods with interpolated times within this factor of the least are examined."""
MOST_EXAMINED = 4
NARROW = 1.02
"""Accuracy of the largest step, as a factor."""
FINER = tuple(1.01**k for k in range(1, 21))
"""Factors of the number of steps at which the error is checked as well."""
CHECKS, MET = 3, 0.9
"""Most updates of the error growth factor, and the part of the tolerance that an error must use to end them."""


class Recommendation(NamedTuple):
    """A method and a step for an error tolerance.

    Attributes:
        method: The name of the method.
        h: The step size.
        steps: The number of steps.
        seconds: CPU seconds for all steps.
        error: The error: measured, or extrapolated to a longer span.
        measure: The name of the error.
        span: The length of the run.
        basis: The origin of these values, in words.
        examined: CPU seconds of the other methods examined.

    Example:
        >>> import bseries as bs
        >>> found = bs.work_precision(bs.scene("pendulum"), ["rk4"], span=10, errors=(1e-2, 1e-4))
        >>> choice = found.best(1e-3)
        >>> choice.method, choice.basis, choice.error <= 1e-3
        ('rk4', 'measured over 10', True)
    """

    method: str
    h: float
    steps: int
    seconds: float
    error: float
    measure: str
    span: float
    basis: str
    examined: dict[str, float]

    def to_dict(self) -> dict[str, Any]:
        """The recommendation as JSON-ready data."""
        return {"schema": 1, "kind": "recommendation", **self._asdict()}


class Step(NamedTuple):
    """The largest step of a method that meets an error tolerance."""

    curve: Curve
    extrapolation: Extrapolation
    steps: int
    error: float


def choose(
    judge: Judge, curves: Sequence[Curve], error: float, span: float | None, measure: str | None, predict: Predict
) -> Recommendation:
    """The cheapest method for an error tolerance; see `WorkPrecision.best`."""
    measure = judge.available[0] if measure is None else check_measure(measure, MEASURES)
    if measure not in judge.available:
        raise IntegratorError(f"measure must be one of {', '.join(judge.available)}, which were had, but was {measure}")
    wanted = read_positive(error, "error")
    length = judge.span if span is None else read_number(span, "span")
    if length < judge.span:
        raise IntegratorError(f"span must be at least the one measured, {judge.span:g}, but was {length:g}")
    goal = Goal(judge, predict, length, wanted, measure)
    extrapolated = _extrapolated(goal, curves)
    able = [each for each in extrapolated if _bracket_of_rows(*each, wanted, measure)[0] is not None]
    steps = [_checked_step(goal, *near) for near in _near(able, wanted, measure)]
    met = {step.curve.candidate.name: step for step in steps if step is not None}
    if not met:
        raise _refusal(goal, [extrapolation for _, extrapolation in extrapolated])
    seconds = _seconds(judge, list(met.values()))
    name = min(seconds, key=seconds.__getitem__)
    step = met[name]
    h, times = judge.span / step.steps, goal.times
    return Recommendation(
        method=name,
        h=h,
        steps=whole_steps(length, h),
        seconds=seconds[name] * times,
        error=step.error,
        measure=measure,
        span=length,
        basis=f"measured over {judge.span:g}"
        + (f"; extrapolated, as {step.extrapolation.description(measure)}" if times > 1 else ""),
        examined={other: time * times for other, time in seconds.items() if other != name},
    )


def _extrapolated(goal: Goal, curves: Sequence[Curve]) -> list[tuple[Curve, Extrapolation]]:
    """The methods with extrapolations, without those that would be slower even if errors did not grow."""
    error, measure = goal.error, goal.measure
    optimistic = ((curve.seconds(error, measure), curve) for curve in curves)
    chosen, least = [], math.inf
    for seconds, curve in sorted(((t, c) for t, c in optimistic if t is not None), key=lambda pair: pair[0]):
        if seconds <= NEAR * least:
            extrapolation = best_extrapolation(goal, curve)
            chosen.append((curve, extrapolation))
            if _bracket_of_rows(curve, extrapolation, error, measure)[0] is not None:  # and not by luck
                least = min(least, curve.seconds(error, measure, extrapolation) or math.inf)
    return chosen


def _checked_step(goal: Goal, curve: Curve, extrapolation: Extrapolation) -> Step | None:
    """The largest step, with the growth factor of this step."""
    judge, error, measure = goal.judge, goal.error, goal.measure
    step = largest_step(judge, curve, extrapolation, error, measure)
    for _ in range(CHECKS):
        if step is None or step.extrapolation.factor is None:
            break
        measured = step.error / step.extrapolation.factor
        found = growth_factor(goal, curve, step.steps, measured)
        if found is None or MET * error <= found * measured <= error:
            break
        step = largest_step(judge, curve, extrapolation._replace(factor=found), error, measure)
    return step


def _refusal(goal: Goal, extrapolations: list[Extrapolation]) -> IntegratorError:
    """The error for no recommendation: no method is precise enough, or the growth of errors is unknown."""
    error, name, span = goal.error, goal.judge.scene.name, goal.judge.span
    if goal.length <= span or not extrapolations:
        return IntegratorError(
            f"error must be one that a method reaches on {name} within its budget, but was {error:g}"
        )
    is_possible = any(extrapolation.is_possible(goal.measure) for extrapolation in extrapolations)
    reason = "" if is_possible else ", since the motion turned too seldom"
    return IntegratorError(
        f"span must be one for which a method is known to reach {error:g} on {name}, but was {goal.length:g}: "
        f"how errors grow on from {span:g} to {goal.length:g} may be unknown{reason}"
    )


def _near(curves: list[tuple[Curve, Extrapolation]], error: float, measure: str) -> list[tuple[Curve, Extrapolation]]:
    """The curves near the cheapest one, the cheapest first."""
    timed = ((curve.seconds(error, measure, extrapolation), (curve, extrapolation)) for curve, extrapolation in curves)
    reached = sorted(((seconds, pair) for seconds, pair in timed if seconds is not None), key=lambda entry: entry[0])
    return [pair for seconds, pair in reached if seconds <= NEAR * reached[0][0]][:MOST_EXAMINED]


def largest_step(judge: Judge, curve: Curve, extrapolation: Extrapolation, error: float, measure: str) -> Step | None:
    """The largest step that meets an error tolerance as all smaller ones of the rows do, found by bisection.

    Slightly smaller steps are run as well: if the error is not monotonic, the step may have met the tolerance by
    chance. Only errors of these that are dominated by rounding, or cannot be extrapolated, may exceed it.

    Args:
        judge: Runs methods.
        curve: The method and its rows.
        extrapolation: To a longer run whose error is to meet the tolerance.
        error: The tolerance.
        measure: The name of the error.
    """
    good, bad = _bracket_of_rows(curve, extrapolation, error, measure)
    if good is None:
        return None
    tries = _sizes(curve, extrapolation, measure)

    def meets(steps: int) -> bool:
        tries[steps] = _size(extrapolation, judge.run(curve.candidate, steps), measure)
        return tries[steps] <= error

    while bad == 0 and good > 1:
        half = good // 2
        good, bad = (half, 0) if meets(half) else (good, half)
    while True:
        while bad and good > max(bad + 1, NARROW * bad):
            middle = min(max(bad + 1, round(math.sqrt(good * bad))), good - 1)
            good, bad = (middle, bad) if meets(middle) else (good, middle)
        later = sorted(n for n in {round(good * factor) for factor in FINER} if n > good)
        failed = [n for n in later if not (tries[n] <= error if n in tries else meets(n))]
        is_known = {n: extrapolation.times <= 1 or math.isfinite(tries[n]) for n in failed}
        missed = [n for n in failed if tries[n] >= ROUNDING and is_known[n]]
        if not missed:
            return Step(curve, extrapolation, good, tries[good])
        beyond = [n for n, size in tries.items() if n > missed[-1] and size <= error]
        if not beyond:
            return None
        good, bad = min(beyond), missed[-1]


def bracket(sizes: Mapping[int, float], error: float, rounded: Collection[int] = ()) -> tuple[int | None, int]:
    """The least number of steps that meets a tolerance as all larger ones tried do, and the next smaller one.

    Args:
        sizes: Errors by numbers of steps, infinite where unknown.
        error: The tolerance.
        rounded: Numbers of steps whose errors may be dominated by rounding. If the largest ones do not meet the
            tolerance they are ignored: rounding has increased the error, or invalidates its extrapolation.

    Returns:
        Both numbers: None if the largest number that counts does not meet the tolerance, and 0 if all meet it.

    Example:
        >>> bracket({10: 5e-3, 20: 2e-5, 40: 3e-4, 80: 4e-5, 160: 6e-6}, 1e-4)
        (80, 40)
        >>> found = {10: 5e-3, 20: 5e-12, 40: 2e-13, 80: 3e-13}
        >>> bracket(found, 2e-13, rounded={20, 40, 80}), bracket(found, 2e-13)
        ((40, 20), (None, 0))
    """
    good, bad = None, 0
    for steps in sorted(sizes, reverse=True):
        if sizes[steps] <= error:
            good = steps
        elif good is not None:
            bad = steps
            break
        elif steps not in rounded:
            break
    return good, bad


def _bracket_of_rows(curve: Curve, extrapolation: Extrapolation, error: float, measure: str) -> tuple[int | None, int]:
    """`bracket` of the rows of a method."""
    return bracket(_sizes(curve, extrapolation, measure), error, curve.rounded(measure))


def _sizes(curve: Curve, extrapolation: Extrapolation, measure: str) -> dict[int, float]:
    """The errors of the rows by number of steps."""
    return {row.steps: _size(extrapolation, row.errors, measure) for row in curve.rows}


def _size(extrapolation: Extrapolation, errors: RunErrors, measure: str) -> float:
    """The extrapolated error of a run; infinite if unknown."""
    found = extrapolation.error(errors, measure)
    return math.inf if found is None else found


def _seconds(judge: Judge, steps: list[Step]) -> dict[str, float]:
    """CPU seconds over the span, timed in interleaved rounds."""
    work = {step.curve.candidate.name: judge.work(step.curve.candidate, step.steps) for step in steps}
    costs = step_costs(work, sample=SAMPLE)
    return {name: costs[name].seconds * step.steps for name, step in zip(work, steps, strict=True)}
