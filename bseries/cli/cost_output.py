"""What `bseries cost` writes: the table for readers with its recommendations, the runs as CSV."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from ..advice.durations import duration
from ..advice.measures import ENERGY, MODIFIED_ENERGY
from . import layout
from .layout import Column

if TYPE_CHECKING:
    from ..advice.precision_curves import WorkPrecision
    from ..advice.prediction import Prediction
    from ..advice.recommendation import Recommendation
    from .output import Output

CSV = (
    *("method", "h", "steps", "seconds_per_step", "low", "high", "rounds", "seconds"),
    *("solution", "energy", "modified_energy", "modified_order", "failure"),
)


def written(
    found: WorkPrecision,
    choices: dict[float, Recommendation | str],
    predictions: dict[float, Prediction],
    output: Output,
) -> Iterable[str]:
    """The table for readers, and the notes below it."""
    measure = found.measures[0]
    decades = _decades(found.errors)
    columns = [Column("method"), *(Column(f"{error:.0e}", True) for error in decades)]
    times = [_times(found, error, measure, choices.get(error)) for error in decades]
    names = [curve.candidate.name for curve in found.curves]
    rows = [[name, *(_cell(name, *column) for column in times)] for name in names]
    title = f"{found.scene.title}, t = 0 to {found.span:g}: CPU time against the error of the {_spoken(measure)}"
    notes = [sentence for error in choices for sentence in _advice(error, choices[error], predictions.get(error))]
    left_out = [f"Left out: {name}: {reason}." for name, reason in found.left_out.items()]
    return output.listing(columns, rows, title, [*notes, *found.notes, *left_out])


def _spoken(measure: str) -> str:
    return measure.replace("-", " ")


def _decades(errors: tuple[float, float]) -> list[float]:
    """The powers of ten among the errors of interest; the errors themselves if there are none."""
    first, last = (math.log10(error) for error in errors)
    return [float(f"1e{k}") for k in range(math.floor(first + 1e-9), math.ceil(last - 1e-9) - 1, -1)] or list(errors)


def _times(
    found: WorkPrecision, error: float, measure: str, choice: Recommendation | str | None
) -> tuple[dict[str, float], str | None]:
    """CPU seconds for an error by method, and the cheapest: where there is a recommendation, by the times behind it."""
    interpolated = {curve.candidate.name: curve.seconds(error, measure) for curve in found.curves}
    times = {name: seconds for name, seconds in interpolated.items() if seconds is not None}
    if isinstance(choice, str):
        return times, None
    if choice is not None and choice.span == found.span:
        return {**times, **choice.examined, choice.method: choice.seconds}, choice.method
    return times, min(times, key=times.__getitem__, default=None)


def _cell(name: str, times: dict[str, float], cheapest: str | None) -> str:
    return duration(times[name]) + "*" * (name == cheapest) if name in times else ""


def _advice(error: float, choice: Recommendation | str, prediction: Prediction | None) -> Iterator[str]:
    """The recommendation for an error, in sentences."""
    if isinstance(choice, str):
        yield f"Error {_short(error)}: {choice}."
        return
    others = ", ".join(f"{name} {duration(t)}" for name, t in sorted(choice.examined.items(), key=lambda x: x[1]))
    yield (
        f"Error {_short(error)}: {choice.method} with h = {choice.h:.6g}, {choice.steps:,} steps over {choice.span:g}, "
        f"{duration(choice.seconds)}, error {choice.error:.1e} ({choice.basis})"
        + (f"; next {others}." if others else ".")
    )
    if prediction is not None and choice.measure != MODIFIED_ENERGY:
        expected = prediction.energy if choice.measure == ENERGY else prediction.solution
        yield f"    expected of the modified equation: {'' if expected.value is None else 'error '}{expected}."


def choice_facts(
    choices: dict[float, Recommendation | str], predictions: dict[float, Prediction]
) -> list[dict[str, Any]]:
    """The recommendations for JSON."""
    facts = []
    for error, choice in choices.items():
        found = {"reason": choice} if isinstance(choice, str) else choice.to_dict()
        prediction = predictions.get(error)
        facts.append({"wanted": error, **found, "prediction": None if prediction is None else prediction.to_dict()})
    return facts


def csv_rows(found: WorkPrecision) -> Iterator[layout.Row]:
    """All runs, one a row."""
    for curve in found.curves:
        for row in curve.rows:
            costs = (None,) * 4 if row.cost is None else row.cost
            errors = (getattr(row.errors, name) for name in CSV[-5:])
            yield layout.values(curve.candidate.name, row.h, row.steps, *costs, row.seconds, *errors)


def _short(error: float) -> str:
    """A wanted error with the digits that it was given with."""
    return next(text for digits in range(17) if float(text := f"{error:.{digits}e}") == error)
