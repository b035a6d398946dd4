"""Work–precision measurements: errors and CPU times of all suitable methods over a range of step sizes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from typing import TYPE_CHECKING, Any

from bseries.advice.measures import ENERGY, MEASURES, MODIFIED_ENERGY, SOLUTION, check_measure, duration
from bseries.advice.prediction.run_prediction import predict_run
from bseries.advice.timing import machine
from bseries.advice.work_precision.candidates import Candidate, Candidates, candidates
from bseries.advice.work_precision.dense_reference import affordable_span
from bseries.advice.work_precision.recommendation import Recommendation, choose
from bseries.advice.work_precision.run_errors import Judge
from bseries.advice.work_precision.sweeps import sweep, time_scale, timed_curves
from bseries.table import Column, Table, as_html, as_text
from integrators.core.arguments import MOST_STEPS, check_progress, read_number, read_positive
from integrators.core.errors import IntegratorError, shorten
from integrators.scenes.catalogue.registry import scene as built_in
from integrators.scenes.scene import Scene
from integrators.steppers.states import StepError

if TYPE_CHECKING:
    from bseries.advice.prediction.run_prediction import Prediction
    from bseries.advice.work_precision.candidates import Methods
    from bseries.advice.work_precision.curves import Curve, Row

BUDGET = 0.2
"""CPU seconds for the longest run of a method."""
TRIAL_STEP = 1e-9
"""Step size for compilation."""
LOOSEST, FINEST = 1.0, 1e-15
SPAN = 200.0
"""Default length of runs, as a multiple of `time_scale`."""
REFERENCE_SECONDS = 10.0
"""CPU time for the reference solution over the default span."""
SHORTER, TRIALS = 2.2, 8
"""Factor by which the default span is shortened while there is no reference solution, and most times."""


class WorkPrecision:
    """Work–precision measurements on a scene; made by `work_precision`.

    Attributes:
        judge: Measures the errors of runs on the scene.
        scene: The scene.
        span: The length of all runs.
        errors: The largest and the smallest error of interest.
        measures: The errors measured, of ``solution``, ``energy`` and ``modified-energy``.
        curves: The methods with their rows.
        left_out: Requested methods that do not fit, with the reason.
        notes: Remarks on the measurement, in sentences.
        machine: The machine and software versions.

    Example:
        >>> import bseries as bs
        >>> found = bs.work_precision(bs.scene("pendulum"), ["rk4"], span=10, errors=(1e-2, 1e-4), measure="energy")
        >>> found.measures, [curve.candidate.name for curve in found.curves]
        (('energy',), ['rk4'])
    """

    def __init__(self, judge: Judge, errors: tuple[float, float], curves: Sequence[Curve], left_out: dict[str, str]):
        self.judge, self.errors, self.curves, self.left_out = judge, errors, tuple(curves), left_out
        self.scene, self.span, self.measures = judge.scene, judge.span, judge.available
        self.machine = machine()

    def __repr__(self) -> str:
        rows = sum(len(curve.rows) for curve in self.curves)
        return f"<WorkPrecision of {len(self.curves)} methods on {self.scene.title}: {rows} runs over {self.span:g}>"

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the measurement."""
        return tuple(_notes(self))

    def best(self, error: float, span: float | None = None, measure: str | None = None) -> Recommendation:
        """The cheapest method for an error, and the largest step that meets it.

        The step is interpolated from the rows and refined by bisection: it is, within some per cent, the largest one
        that meets the error as all smaller ones tried do. All methods near the cheapest are treated alike and timed
        again in interleaved rounds.

        Args:
            error: The error tolerance.
            span: The length of the run, at least the length measured, which is the default. Errors of longer runs are
                extrapolated.
            measure: The name of the error; by default the first of `measures`.

        Raises:
            IntegratorError: An argument cannot be used, or no method is known to meet the error.
        """
        return choose(self.judge, self.curves, error, span, measure, predict_run)

    def to_dict(self) -> dict[str, Any]:
        """The measurements as JSON-ready data."""
        return {
            "schema": 1,
            "kind": "work-precision",
            "scene": self.scene.name,
            "effects": list(self.scene.active),
            "span": self.span,
            "errors": list(self.errors),
            "measures": list(self.measures),
            "machine": self.machine,
            "notes": list(self.notes),
            "left_out": self.left_out,
            "methods": [
                {"method": curve.candidate.name, "rows": [_row_dict(row) for row in curve.rows]}
                for curve in self.curves
            ],
        }

    def to_table(
        self,
        choices: Mapping[float, Recommendation | str] | None = None,
        predictions: Mapping[float, Prediction] | None = None,
    ) -> Table:
        """CPU times by powers of ten of the error as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            choices: For wanted errors what `best` recommends, or why it refuses; sentences below the table say so.
            predictions: What the modified equation lets expect of these runs.
        """
        return _table(self, choices or {}, predictions or {})

    __str__, _repr_html_ = as_text, as_html


def _row_dict(row: Row) -> dict[str, Any]:
    cost = (
        {} if row.cost is None else {"seconds_per_step": row.cost.seconds, "quartiles": [row.cost.low, row.cost.high]}
    )
    found = row.errors._asdict()
    kept = ("solution", "energy", "modified_energy", "modified_order", "failure")
    return {"h": row.h, "steps": row.steps, **cost, "seconds": row.seconds, **{key: found[key] for key in kept}}


def work_precision(
    scene: Scene | str,
    methods: Methods = None,
    *,
    span: float | None = None,
    errors: tuple[float, float] = (1e-3, 1e-12),
    measure: str = "all",
    budget: float = BUDGET,
    progress: Callable[[int, int], object] | None = None,
) -> WorkPrecision:
    """Errors and CPU times of methods on a scene, from its start, for a range of step sizes.

    Errors and times are measured in separate runs: the timed ones observe nothing, are compiled and warm, and are
    interleaved. Steps shrink until the error is below the range, stops falling, or the budget is spent.

    Args:
        scene: The scene, with a start, or the name of a built-in one.
        methods: Methods or their names, or one; ``modifying-midpoint4`` and others with an even number behind are
            modifying integrators; ``"all"`` for all of the catalogue that fit, which takes minutes. By default those
            known to be good on scenes of this structure.
        span: The length of runs; by default about two hundred times |y|/|f| at the start, or less if the reference
            solution ends before or would take too long.
        errors: The largest and the smallest error of interest.
        measure: ``"solution"`` (against the reference), ``"energy"``, ``"modified-energy"``, or ``"all"`` of them.
        budget: CPU seconds for the longest run of a method.
        progress: Called with the number of parts of the work that are done and of all.

    Returns:
        The measurements; `WorkPrecision.best` recommends a method.

    Raises:
        IntegratorError: An argument cannot be used, no method fits, or none of the errors can be measured.

    Example:
        >>> import bseries as bs
        >>> found = bs.work_precision("pendulum", ["stormer-verlet", "rk4"], span=10, errors=(1e-2, 1e-4))
        >>> found
        <WorkPrecision of 2 methods on pendulum: ... runs over 10>
        >>> found.best(1e-3).method
        'rk4'

    References:
        E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, section II.10 (diagrams of
        work and precision).
    """
    if isinstance(scene, str):
        scene = built_in(scene)
    elif not isinstance(scene, Scene):
        raise IntegratorError(f"scene must be a Scene or the name of one, but was {shorten(repr(scene))}")
    _ = scene.y0  # refuses a scene without a start before anything is compiled
    loosest, finest = check_errors(errors)
    limit = read_number(budget, "budget")
    if limit <= 0:
        raise IntegratorError(f"budget must be a positive number of seconds, but was {limit:g}")
    check_progress(progress)
    measures = MEASURES if measure == "all" else (check_measure(measure, MEASURES),)
    if SOLUTION not in measures and not scene.is_hamiltonian:
        raise _unmeasurable(scene, measures, "it has no energy that is conserved")
    length = None if span is None else read_positive(span, "span")
    if length is not None and not length < (longest := MOST_STEPS * time_scale(scene)):
        raise IntegratorError(
            f"span must be below {longest:.3g} for {scene.name}, whose f is so large, but was {length:g}"
        )
    chosen = candidates(scene, methods)
    total = 2 * len(chosen.found)
    report = progress or (lambda done, total: None)
    for k, candidate in enumerate(chosen.found):
        report(k, total)
        _compile(candidate, scene)
    judge = _judge(scene, length, measures)
    if not judge.available:
        raise _unmeasurable(scene, measures, judge.problem or "it has no energy that is conserved")
    found, left_out = _measurable(judge, chosen)
    swept = []
    for k, candidate in enumerate(found):
        report(len(chosen.found) + k, total)
        swept.append(sweep(judge, candidate, finest, limit))
    return WorkPrecision(judge, (loosest, finest), timed_curves(judge, swept), left_out)


def _measurable(judge: Judge, chosen: Candidates) -> tuple[list[Candidate], dict[str, str]]:
    """The methods with an error that can be measured; for modified energies alone, those that have one."""
    if judge.available != (MODIFIED_ENERGY,):
        return chosen.found, chosen.left_out
    found = [candidate for candidate in chosen.found if judge.modified_energy(candidate) is not None]
    if not found:
        raise _unmeasurable(judge.scene, judge.available, "none of the methods has a modified Hamiltonian there")
    without = [candidate.name for candidate in chosen.found if candidate not in found]
    return found, chosen.left_out | dict.fromkeys(without, f"it has no modified Hamiltonian on {judge.scene.name}")


def _unmeasurable(scene: Scene, measures: tuple[str, ...], reason: str) -> IntegratorError:
    wanted = " and ".join(measures)
    return IntegratorError(f"measure must be one that can be had on {scene.name}, but {wanted} cannot: {reason}")


def _compile(candidate: Candidate, scene: Scene) -> None:
    """Compile the steps of a method by making one."""
    steps = candidate.stepper()
    with suppress(StepError):
        steps.advance(steps.start(candidate.start(scene.y0, TRIAL_STEP), h=TRIAL_STEP), 1)


def check_errors(errors: Any) -> tuple[float, float]:
    """The largest and the smallest error of interest."""
    try:
        loosest, finest = (read_number(error, "errors") for error in errors)
    except (TypeError, ValueError):
        loosest = finest = math.nan
    if not LOOSEST >= loosest > finest >= FINEST:
        raise IntegratorError(
            f"errors must be two numbers from {LOOSEST:g} to {FINEST:g}, the larger one first, but was "
            f"{shorten(repr(errors))}"
        )
    return loosest, finest


def _judge(scene: Scene, span: float | None, measures: tuple[str, ...]) -> Judge:
    """The measurement of errors; the default span is shortened until there is a reference solution."""
    if span is not None:
        return Judge(scene, span, measures)
    length = _rounded(SPAN * time_scale(scene))
    if SOLUTION in measures:
        length = _rounded(affordable_span(scene, length, REFERENCE_SECONDS))
    judge = Judge(scene, length, measures)
    for _ in range(TRIALS):
        if judge.problem is None:
            break
        length = _rounded(length / SHORTER)
        judge = Judge(scene, length, measures)
    return judge


def _rounded(value: float) -> float:
    """The nearest of 1, 2 and 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    nearest = min((1, 2, 5, 10), key=lambda digit: abs(math.log(value / (digit * power))))
    return float(f"{nearest * power:.0e}")


def _notes(found: WorkPrecision) -> list[str]:
    """Remarks on the measurement, in sentences."""
    rows = [row for curve in found.curves for row in curve.rows]
    spreads = sorted(row.cost.spread for row in rows if row.cost is not None)
    notes = [f"Measured {found.machine['date']}: {found.machine['processor']}; {found.machine['versions']}."]
    if spreads:
        middle, widest = spreads[len(spreads) // 2], spreads[-1]
        notes.append(
            f"CPU time of steps, compiled and warm, medians of interleaved rounds; distance of the quartiles: "
            f"{middle:.0%} in the middle, {widest:.0%} at most."
        )
    failed = sum(row.errors.failure is not None for row in rows)
    if failed:
        notes.append(f"{failed} of {len(rows)} runs failed, with steps too large for the method.")
    if found.judge.problem:
        notes.append(f"The solution was not measured: {found.judge.problem}.")
    return notes


RECORDS = (
    *("method", "h", "steps", "seconds_per_step", "low", "high", "rounds", "seconds"),
    *("solution", "energy", "modified_energy", "modified_order", "failure"),
)
"""The columns of CSV, which has a line for each run."""


def _table(
    found: WorkPrecision, choices: Mapping[float, Recommendation | str], predictions: Mapping[float, Prediction]
) -> Table:
    measure, decades = found.measures[0], _decades(found.errors)
    times = [times_of(found, error, measure, choices.get(error)) for error in decades]
    names = [curve.candidate.name for curve in found.curves]
    advice = [sentence for error in choices for sentence in _advice(error, choices[error], predictions.get(error))]
    left_out = [f"Left out: {name}: {reason}." for name, reason in found.left_out.items()]
    about = f"CPU time against the error of the {measure.replace('-', ' ')}"

    def data() -> dict[str, Any]:
        return {**found.to_dict(), "choices": list(_choice_facts(choices, predictions))}

    return Table(
        f"{found.scene.title}, t = 0 to {found.span:g}: {about}",
        [Column("method"), *(Column(f"{error:.0e}", True) for error in decades)],
        [[name, *(_cell(name, *column) for column in times)] for name in names],
        [*advice, *found.notes, *left_out],
        data=data,
        items="methods",
        records=Table("", list(map(Column, RECORDS)), list(_records(found))),
    )


def _decades(errors: tuple[float, float]) -> list[float]:
    """The powers of ten among the errors of interest; the errors themselves if there are none."""
    first, last = (math.log10(error) for error in errors)
    return [float(f"1e{k}") for k in range(math.floor(first + 1e-9), math.ceil(last - 1e-9) - 1, -1)] or list(errors)


def times_of(
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
    wanted = next(text for digits in range(17) if float(text := f"{error:.{digits}e}") == error)
    if isinstance(choice, str):
        yield f"Error {wanted}: {choice}."
        return
    others = ", ".join(f"{name} {duration(t)}" for name, t in sorted(choice.examined.items(), key=lambda x: x[1]))
    yield (
        f"Error {wanted}: {choice.method} with h = {choice.h:.6g}, {choice.steps:,} steps over {choice.span:g}, "
        f"{duration(choice.seconds)}, error {choice.error:.1e} ({choice.basis})"
        + (f"; next {others}." if others else ".")
    )
    if prediction is not None and choice.measure != MODIFIED_ENERGY:
        expected = prediction.energy if choice.measure == ENERGY else prediction.solution
        yield f"    expected of the modified equation: {'' if expected.value is None else 'error '}{expected}."


def _choice_facts(
    choices: Mapping[float, Recommendation | str], predictions: Mapping[float, Prediction]
) -> Iterator[dict[str, Any]]:
    """The recommendations as JSON-ready data."""
    for error, choice in choices.items():
        facts = {"reason": choice} if isinstance(choice, str) else choice.to_dict()
        prediction = predictions.get(error)
        yield {"wanted": error, **facts, "prediction": None if prediction is None else prediction.to_dict()}


def _records(found: WorkPrecision) -> Iterator[tuple[Any, ...]]:
    """All runs."""
    for curve in found.curves:
        for row in curve.rows:
            costs = (None,) * 4 if row.cost is None else row.cost
            errors = (getattr(row.errors, name) for name in RECORDS[-5:])
            yield (curve.candidate.name, row.h, row.steps, *costs, row.seconds, *errors)
