"""The cheapest method for an error tolerance, and the largest step that meets it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.measures import ROUNDING, check_measure
from bseries.advice.timing import step_costs
from bseries_base.table import Table, as_html, as_text, fact_table
from integrators.core.errors import IntegratorError
from integrators.exact.arguments import read_positive

if TYPE_CHECKING:
    from bseries.advice.work_precision.sweeps import Curve, Judge


class Search(NamedTuple):
    """Limits of the search for the cheapest method: recommendations may exceed the least time by 10 %."""

    near: float = 1.6
    """Methods whose interpolated times are within this factor of the least are examined: interpolation between rows,
    whose steps differ by √2 or 2, may be wrong by this factor where the convergence is irregular."""
    most: int = 4
    """Methods examined: each takes about fifty runs; the fifth was never the cheapest."""
    narrow: float = 1.02
    """Accuracy of the largest step, as a factor: a fifth of the 10 %."""
    finer: tuple[float, ...] = tuple(1.01**k for k in range(1, 21))
    """Factors of the number of steps at which the error is also checked: up to 1.22, over most of the distance to the
    next row."""


SEARCH = Search()


class Recommendation(NamedTuple):
    """A method and a step for an error tolerance.

    Attributes:
        method: The name of the method.
        h: The step size.
        steps: The number of steps.
        seconds: CPU seconds for all steps.
        error: The error.
        measure: The name of the error.
        span: The length of the run.
        basis: The origin of these values: over what span they were measured.
        examined: CPU seconds of the other methods examined.

    Example:
        >>> import bseries as bs
        >>> found = bs.work_precision(["rk4"], bs.scene("pendulum"), span=10, errors=(1e-2, 1e-4))
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

    def to_table(self) -> Table:
        """The recommendation as a table."""
        facts = [(name, value) for name, value in self._asdict().items() if name != "examined"]
        return fact_table(f"Cheapest method: {self.method}", facts)._replace(data=self.to_dict)

    __str__, _repr_html_ = as_text, as_html

    def __repr__(self) -> str:
        return f"<Recommendation: {self.method}, h = {self.h:.6g}, {self.measure} error {self.error:.1e}>"

    def to_dict(self) -> dict[str, Any]:
        """The recommendation as JSON-ready data."""
        return {"schema": 1, "kind": "recommendation", **self._asdict()}


class Step(NamedTuple):
    """The largest step of a method that meets an error tolerance."""

    curve: Curve
    steps: int
    error: float


def choose(judge: Judge, curves: Sequence[Curve], error: float, measure: str | None) -> Recommendation:
    """The cheapest method for an error tolerance; see `WorkPrecision.best`."""
    measure = check_measure(judge.available[0] if measure is None else measure, judge.available)
    wanted = read_positive(error, "error")
    able = [curve for curve in curves if bracket(curve.sizes(measure), wanted)[0] is not None]
    times = sorted(((curve.seconds(wanted, measure) or math.inf, curve) for curve in able), key=lambda entry: entry[0])
    near = [curve for seconds, curve in times if seconds <= SEARCH.near * times[0][0]][: SEARCH.most]
    steps = (largest_step(judge, curve, wanted, measure) for curve in near)
    met = {step.curve.candidate.name: step for step in steps if step is not None}
    if not met:
        raise IntegratorError(
            f"error must be one that a method reaches on {judge.scene.name} within its budget, but was {wanted:g}"
        )
    costs = step_costs({name: judge.work(step.curve.candidate, step.steps) for name, step in met.items()})
    seconds = {name: costs[name].seconds * step.steps for name, step in met.items()}
    name = min(seconds, key=seconds.__getitem__)
    return Recommendation(
        method=name,
        h=judge.span / met[name].steps,
        steps=met[name].steps,
        seconds=seconds.pop(name),
        error=met[name].error,
        measure=measure,
        span=judge.span,
        basis=f"measured over {judge.span:g}",
        examined=seconds,
    )


def largest_step(judge: Judge, curve: Curve, error: float, measure: str) -> Step | None:
    """The largest step that meets an error tolerance together with all smaller steps tried, found by bisection.

    Slightly smaller steps are run as well: if the error is not monotonic, the step may have met the tolerance by
    chance. Their errors may exceed the tolerance only if they are dominated by rounding.
    """
    tries = curve.sizes(measure)
    good, bad = bracket(tries, error)
    if good is None:
        return None

    def meets(steps: int) -> bool:
        found = judge.run(curve.candidate, steps).error(measure)
        tries[steps] = math.inf if found is None else found
        return tries[steps] <= error

    while bad == 0 and good > 1:
        half = good // 2
        good, bad = (half, 0) if meets(half) else (good, half)
    while True:
        while bad and good > max(bad + 1, SEARCH.narrow * bad):
            middle = min(max(bad + 1, round(math.sqrt(good * bad))), good - 1)
            good, bad = (middle, bad) if meets(middle) else (good, middle)
        later = sorted(n for n in {round(good * factor) for factor in SEARCH.finer} if n > good)
        missed = [n for n in later if not (tries[n] <= error if n in tries else meets(n)) and tries[n] >= ROUNDING]
        if not missed:
            return Step(curve, good, tries[good])
        beyond = [n for n, size in tries.items() if n > missed[-1] and size <= error]
        if not beyond:
            return None
        good, bad = min(beyond), missed[-1]


def bracket(sizes: Mapping[int, float], error: float) -> tuple[int | None, int]:
    """The least number of steps that meets a tolerance together with all larger ones, and the next smaller one.

    The largest numbers are ignored if their errors exceed the tolerance but are below `ROUNDING`: these are rounding
    errors. The first result is None if the largest remaining number does not meet the tolerance; the second is 0 if all
    meet it.

    Example:
        >>> bracket({10: 5e-3, 20: 2e-5, 40: 3e-4, 80: 4e-5, 160: 6e-6}, 1e-4)
        (80, 40)
        >>> bracket({10: 5e-3, 20: 5e-12, 40: 2e-13, 80: 3e-13}, 2e-13)
        (40, 20)
    """
    good, bad = None, 0
    for steps in sorted(sizes, reverse=True):
        if sizes[steps] <= error:
            good = steps
        elif good is not None:
            bad = steps
            break
        elif sizes[steps] >= ROUNDING:
            break
    return good, bad
