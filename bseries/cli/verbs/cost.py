"""`bseries cost`: what accuracy costs on a scene, and which method and step to take."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.advice.measures import ENERGY, MODIFIED_ENERGY, duration
from bseries.cli import table
from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import is_tableau_file, read_method
from bseries.cli.options.numbers import read_float
from bseries.cli.options.scene_argument import read_start, takes_scene
from bseries.cli.output import NO_LATEX, takes_output
from bseries.cli.table import Column

if TYPE_CHECKING:
    from bseries.advice.prediction.prediction import Prediction
    from bseries.advice.work_precision.candidates import Candidate
    from bseries.advice.work_precision.precision_curves import WorkPrecision
    from bseries.advice.work_precision.recommendation import Recommendation
    from bseries.cli.output import Output
    from integrators import Scene


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


def csv_rows(found: WorkPrecision) -> Iterator[table.Row]:
    """All runs, one a row."""
    for curve in found.curves:
        for row in curve.rows:
            costs = (None,) * 4 if row.cost is None else row.cost
            errors = (getattr(row.errors, name) for name in CSV[-5:])
            yield table.values(curve.candidate.name, row.h, row.steps, *costs, row.seconds, *errors)


def _short(error: float) -> str:
    """A wanted error with the digits that it was given with."""
    return next(text for digits in range(17) if float(text := f"{error:.{digits}e}") == error)


PICTURES = (".png", ".svg", ".pdf")
USUAL = (1e-3, 1e-6, 1e-9)
"""The errors that methods are recommended for where none is given."""
OF_MODIFYING = "the field of a modifying integrator changes with the step"
"""Why nothing is expected of these."""


def takes_picture(write: Callable[..., None]) -> Callable[..., None]:
    """Let -o FILE.png, .svg or .pdf be a picture; then the text goes to stdout all the same."""

    @functools.wraps(write)
    def call(*, path: str | None, format_: str | None, **options: Any) -> None:
        from bseries.plotting import check_place
        from integrators.core.optional_modules import optional_module

        is_picture = path is not None and os.path.splitext(path)[1].lower() in PICTURES
        if is_picture:
            optional_module("matplotlib", "pictures")
            check_place(str(path), "output")
        text_path = None if is_picture else path
        write(path=text_path, format_=format_, picture=path if is_picture else None, **options)

    return call


@click.command()
@takes_scene(as_argument=True)
@click.option(
    "--methods",
    metavar="NAMES",
    help="Names or tableau files with commas between, or all; by default, those known to be good.",
)  # fmt: skip
@click.option("--span", metavar="T", help="How long runs are; by default, some turns of the motion.")
@click.option("--start", metavar="TEXT", help='Start values by block, as in "p=0;q=-3/2".')
@click.option("--errors", metavar="A:B", default="1e-3:1e-12", show_default=True, help="The errors of interest.")
@click.option("--measure", metavar="NAME", default="all", help="solution, energy, or modified-energy; by default, all.")
@click.option(
    "--error", "wanted", metavar="E", multiple=True, help="An accuracy to recommend a method for; repeatable."
)
@click.option("--for", "length", metavar="T", help="Recommend for runs of this length, longer than those measured.")
@click.option(
    "--predict/--no-predict", default=True, help="Whether to compare with what the modified equation lets expect."
)
@takes_picture
@functools.partial(takes_output, formats=NO_LATEX, also=PICTURES)
def cost(
    scene: Scene,
    effects: Sequence[str],
    methods: str | None,
    span: str | None,
    start: str | None,
    errors: str,
    measure: str,
    wanted: Sequence[str],
    length: str | None,
    predict: bool,
    picture: str | None,
    output: Output,
) -> Iterable[str]:
    """What accuracy costs on a scene: CPU time against errors, for many methods and steps.

    Runs methods that suit the scene over a range of steps, measures errors of the solution (against a reference), of
    the energy and of the modified energy, and times steps apart from that. Prints the CPU time for each power of ten
    of the error (empty where a method does not reach it), the cheapest one with *, and recommends a method and a step
    for each --error. -o FILE.png, .svg or .pdf draws the diagram; --format csv and json have all runs.

    modifying-midpoint4 and 6 are modifying integrators: the implicit midpoint rule on its modifying field.

    \b
    Examples:
      bseries cost kepler
      bseries cost kepler --error 1e-8 -o kepler.png
      bseries cost pendulum --methods stormer-verlet,rk4,gauss3 --span 100 --errors 1e-2:1e-8
      bseries cost henon-heiles --measure energy --error 1e-6 --for 1e6
      bseries cost kepler --effect relativity --format json -o kepler.json
      bseries cost --hamiltonian "p^2/2 + q^4/4" --start "p=0;q=1" --methods stormer-verlet,gauss4,mine.toml
    """
    from bseries.advice.work_precision.dense_reference import reference_compiled_ahead
    from bseries.advice.work_precision.precision_curves import work_precision

    if start is not None:
        scene = read_start(start, scene)
    limits = _errors(errors)
    goals = [_positive(text, "error") for text in wanted]
    measured, longer = (
        None if text is None else _positive(text, option) for text, option in ((span, "span"), (length, "for"))
    )
    _check_length(longer, measured)
    with reference_compiled_ahead():
        found = work_precision(
            scene,
            _methods(methods),
            span=measured,
            errors=limits,
            measure=measure,
            progress=output.progress.update,
        )
    _check_length(longer, found.span)
    if picture is not None:
        _draw(found, picture)
    if output.format == "csv":
        return table.csv(CSV, csv_rows(found))
    goals = goals or [error for error in USUAL if limits[1] <= error <= limits[0]] or [limits[0]]
    choices = {error: _choice(found, error, longer) for error in goals}
    predictions = _predictions(found, choices) if predict else {}
    if output.format == "json":
        return [table.json({**found.to_dict(), "choices": choice_facts(choices, predictions)}, "methods")]
    return written(found, choices, predictions, output)


def _methods(text: str | None) -> list[Any] | str | None:
    """The methods of a list: names, or files with tableaux."""
    if text is None or text.strip() == "all":
        return text and "all"
    names = (name.strip() for name in text.split(",") if name.strip())
    return [read_method(name, {}, ()) if is_tableau_file(name) else name for name in names]


def _positive(text: str, option: str) -> float:
    number = read_float(text, option)
    if not number > 0:
        raise Refusal(f"{option} must be positive, but was {text!r:.60}")
    return number


def _errors(text: str) -> tuple[float, float]:
    """The two errors of A:B, the larger one first."""
    from bseries.advice.work_precision.precision_curves import check_errors

    pieces = text.split(":")
    if len(pieces) != 2:
        raise Refusal(f"errors must be A:B, as in 1e-3:1e-12, but was {text!r:.60}")
    first, second = sorted((read_float(piece, "errors") for piece in pieces), reverse=True)
    return check_errors((first, second))


def _check_length(length: float | None, span: float | None) -> None:
    if length is not None and span is not None and length < span:
        raise Refusal(f"for must be at least the span measured, {span:g}, but was {length:g}")


def _choice(found: WorkPrecision, error: float, length: float | None) -> Recommendation | str:
    """The recommendation for an error, or why there is none."""
    from integrators import IntegratorError

    try:
        return found.best(error, length, found.measures[0])
    except IntegratorError as refusal:
        return str(refusal)


def _predictions(found: WorkPrecision, choices: dict[float, Recommendation | str]) -> dict[float, Prediction]:
    """What the modified equation lets expect of the recommended runs, by the wanted errors."""
    candidates = {curve.candidate.name: curve.candidate for curve in found.curves}
    return {
        error: _prediction(candidates[choice.method], choice)
        for error, choice in choices.items()
        if not isinstance(choice, str)
    }


def _prediction(candidate: Candidate, choice: Recommendation) -> Prediction:
    """What the modified equation lets expect of a recommended run, or why that is unknown."""
    from bseries import errors
    from bseries.advice.prediction.prediction import predict_run, time_only

    if candidate.is_modifying:
        return time_only(choice.h, choice.steps, OF_MODIFYING, choice.seconds)
    try:
        return predict_run(
            candidate.scene,
            candidate.method,
            h=choice.h,
            steps=choice.steps,
            seconds_per_step=choice.seconds / choice.steps,
            solver=candidate.solver,
        )
    except errors as error:
        return time_only(choice.h, choice.steps, str(error), choice.seconds)


def _draw(found: WorkPrecision, path: str) -> None:
    from bseries.advice.work_precision.diagram import draw
    from bseries.plotting import picture, picture_format
    from integrators.core.text_files import atomic_write

    atomic_write(path, picture(draw(found), picture_format(path)))
