"""The cheapest method for a wanted accuracy, and its largest step that reaches it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.measures import MEASURES, check_measure, whole_steps
from bseries.advice.work_precision.extrapolation import best_outlook, factor
from bseries.advice.work_precision.outlooks import Outlook
from bseries.advice.work_precision.step_costs import SAMPLE, step_costs
from bseries.advice.work_precision.sweeps import ROUNDING
from integrators.core.arguments import read_number, read_positive
from integrators.core.errors import IntegratorError

if TYPE_CHECKING:
    from bseries.advice.work_precision.run_errors import Judge, RunErrors
    from bseries.advice.work_precision.sweeps import Curve

NEAR = 1.6
"""Methods whose interpolated times are within this factor of the least are examined."""
MOST_EXAMINED = 4
NARROW = 1.02
"""The largest step is known within this factor."""
FINER = tuple(1.01**k for k in range(1, 21))
"""By what factors more steps are tried, to see that they meet the error as well."""
CHECKS, MET = 3, 0.9
"""How often the factor by which errors grow is found anew, and how much of the error may be used up until it is not."""


class Recommendation(NamedTuple):
    """A method and a step for an accuracy.

    Attributes:
        method: The name of the method.
        h: The step size.
        steps: How many steps.
        seconds: CPU seconds for them.
        error: The error: measured, or for a longer span than that, extrapolated.
        measure: Which error.
        span: For how long.
        basis: On what this rests, in a sentence.
        examined: The CPU seconds of the other methods that were examined.

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
        """The choice as JSON-ready data."""
        return {"schema": 1, "kind": "recommendation", **self._asdict()}


class Step(NamedTuple):
    """The largest step of a method that meets an error."""

    curve: Curve
    ahead: Outlook
    steps: int
    error: float


def choose(
    judge: Judge, curves: Sequence[Curve], error: float, span: float | None, measure: str | None
) -> Recommendation:
    """The cheapest method for an error; see `WorkPrecision.best`."""
    measure = judge.available[0] if measure is None else check_measure(measure, MEASURES)
    if measure not in judge.available:
        raise IntegratorError(f"measure must be one of {', '.join(judge.available)}, which were had, but was {measure}")
    wanted = read_positive(error, "error")
    length = judge.span if span is None else read_number(span, "span")
    if length < judge.span:
        raise IntegratorError(f"span must be at least the one measured, {judge.span:g}, but was {length:g}")
    times = length / judge.span
    ahead = _ahead(judge, curves, wanted, length, measure)
    able = [each for each in ahead if _bracket_of_rows(*each, wanted, measure)[0] is not None]
    steps = [_checked_step(judge, *near, wanted, length, measure) for near in _near(able, wanted, measure)]
    met = {step.curve.candidate.name: step for step in steps if step is not None}
    if not met:
        raise _refusal(judge, [until for _, until in ahead], wanted, length, measure)
    seconds = _seconds(judge, list(met.values()))
    name = min(seconds, key=seconds.__getitem__)
    step = met[name]
    h = judge.span / step.steps
    return Recommendation(
        method=name,
        h=h,
        steps=whole_steps(length, h),
        seconds=seconds[name] * times,
        error=step.error,
        measure=measure,
        span=length,
        basis=f"measured over {judge.span:g}" + (f"; extrapolated, as {step.ahead.law(measure)}" if times > 1 else ""),
        examined={other: time * times for other, time in seconds.items() if other != name},
    )


def _ahead(
    judge: Judge, curves: Sequence[Curve], error: float, length: float, measure: str
) -> list[tuple[Curve, Outlook]]:
    """The methods with their outlooks, but for those that would be dearer even if errors did not grow."""
    optimistic = ((curve.seconds(error, measure), curve) for curve in curves)
    chosen, least = [], math.inf
    for seconds, curve in sorted(((t, c) for t, c in optimistic if t is not None), key=lambda pair: pair[0]):
        if seconds <= NEAR * least:
            until = best_outlook(judge, curve, length, error, measure)
            chosen.append((curve, until))
            if _bracket_of_rows(curve, until, error, measure)[0] is not None:  # and not by luck
                least = min(least, curve.seconds(error, measure, until) or math.inf)
    return chosen


def _checked_step(judge: Judge, curve: Curve, ahead: Outlook, error: float, length: float, measure: str) -> Step | None:
    """The largest step, with an outlook that is the one for this step."""
    step = largest_step(judge, curve, ahead, error, measure)
    for _ in range(CHECKS):
        if step is None or step.ahead.factor is None:
            break
        measured = step.error / step.ahead.factor
        found = factor(judge, curve, step.steps, measured, length, measure)
        if found is None or MET * error <= found * measured <= error:
            break
        step = largest_step(judge, curve, ahead._replace(factor=found), error, measure)
    return step


def _refusal(judge: Judge, ahead: list[Outlook], error: float, length: float, measure: str) -> IntegratorError:
    """Why no method is recommended: none is so precise, or how errors grow on in a longer run is not known."""
    if length <= judge.span or not ahead:
        return IntegratorError(
            f"error must be one that a method reaches on {judge.scene.name} within its budget, but was {error:g}"
        )
    reason = "" if any(until.tells(measure) for until in ahead) else ", since the motion turned too seldom"
    return IntegratorError(
        f"span must be one for which a method is known to reach {error:g} on {judge.scene.name}, but was {length:g}: "
        f"how errors grow on from {judge.span:g} to {length:g} may be unknown{reason}"
    )


def _near(curves: list[tuple[Curve, Outlook]], error: float, measure: str) -> list[tuple[Curve, Outlook]]:
    """The curves that are near the cheapest, the cheapest first."""
    seconds = ((curve.seconds(error, measure, ahead), curve, ahead) for curve, ahead in curves)
    reached = sorted(((t, curve, ahead) for t, curve, ahead in seconds if t is not None), key=lambda entry: entry[0])
    return [(curve, ahead) for t, curve, ahead in reached if t <= NEAR * reached[0][0]][:MOST_EXAMINED]


def largest_step(judge: Judge, curve: Curve, ahead: Outlook, error: float, measure: str) -> Step | None:
    """The largest step that meets an error as all smaller ones of the rows do, bisected by runs.

    Steps that are a little smaller are tried, too: where errors go up and down, that one met it by luck. Only rounding
    may make them larger again, and how they grow in longer runs may be unknown.

    Args:
        judge: What makes runs.
        curve: The method and its rows.
        ahead: On runs that are longer than those of the judge, if these are to meet the error.
        error: The error.
        measure: Which error.
    """
    good, bad = _bracket_of_rows(curve, ahead, error, measure)
    if good is None:
        return None
    tries = _sizes(curve, ahead, measure)

    def meets(steps: int) -> bool:
        tries[steps] = _size(ahead, judge.run(curve.candidate, steps), measure)
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
        missed = [n for n in failed if tries[n] >= ROUNDING and (ahead.times <= 1 or math.isfinite(tries[n]))]
        if not missed:
            return Step(curve, ahead, good, tries[good])
        beyond = [n for n, size in tries.items() if n > missed[-1] and size <= error]
        if not beyond:
            return None
        good, bad = min(beyond), missed[-1]


def bracket(sizes: Mapping[int, float], error: float, rounded: Collection[int] = ()) -> tuple[int | None, int]:
    """The fewest steps from which on, among those tried, an error is met, and the next fewer that do not meet it.

    Args:
        sizes: Errors by numbers of steps, infinite where they are not known.
        error: The error.
        rounded: Numbers of steps whose errors rounding may decide. Those beyond all others do not count if they do not
            meet the error: rounding has made it larger again there, or keeps it from growing by a law.

    Returns:
        Both; None if no number of steps meets it as all larger ones that count do, and 0 if all do.

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


def _bracket_of_rows(curve: Curve, ahead: Outlook, error: float, measure: str) -> tuple[int | None, int]:
    """The bracket among the rows of a method."""
    return bracket(_sizes(curve, ahead, measure), error, curve.rounded(measure))


def _sizes(curve: Curve, ahead: Outlook, measure: str) -> dict[int, float]:
    """The errors of the rows by their numbers of steps."""
    return {row.steps: _size(ahead, row.errors, measure) for row in curve.rows}


def _size(ahead: Outlook, errors: RunErrors, measure: str) -> float:
    """The error that a run leads to; infinite if that is not known."""
    found = ahead.error(errors, measure)
    return math.inf if found is None else found


def _seconds(judge: Judge, steps: list[Step]) -> dict[str, float]:
    """CPU seconds for the span, timed in turn."""
    work = {step.curve.candidate.name: judge.work(step.curve.candidate, step.steps) for step in steps}
    costs = step_costs(work, sample=SAMPLE)
    return {name: costs[name].seconds * step.steps for name, step in zip(work, steps, strict=True)}
