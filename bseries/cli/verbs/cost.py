"""`bseries cost`: what accuracy costs on a scene, and which method and step to take."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import is_tableau_file, read_method
from bseries.cli.options.numbers import read_float
from bseries.cli.options.scene_argument import read_start, takes_scene
from bseries.cli.output import NO_LATEX, takes_output

if TYPE_CHECKING:
    from bseries.advice.prediction.run_prediction import Prediction
    from bseries.advice.work_precision.candidates import Candidate
    from bseries.advice.work_precision.precision_curves import WorkPrecision
    from bseries.advice.work_precision.recommendation import Recommendation
    from bseries.cli.output import Output
    from bseries.table import Table
    from integrators import Scene


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
) -> Table:
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
    if output.has_records:
        return found.to_table()
    goals = goals or [error for error in USUAL if limits[1] <= error <= limits[0]] or [limits[0]]
    choices = {error: _choice(found, error, longer) for error in goals}
    return found.to_table(choices, _predictions(found, choices) if predict else {})


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
    from bseries.advice.prediction.run_prediction import predict_run, time_only

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
