"""Work–precision measurements and diagrams: errors and CPU times of all suitable methods over a range of step sizes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.measures import MEASURES, SOLUTION, check_measure
from bseries.advice.predictions.prediction import duration
from bseries.advice.timing import machine
from bseries.advice.work_precision.recommendation import Recommendation, bracket, choose
from bseries.advice.work_precision.sweeps import (
    LEAST_SECONDS,
    Curve,
    Judge,
    Methods,
    Row,
    candidates,
    sweep,
    time_scale,
    timed_curves,
)
from bseries_base.diagrams import MARKERS, draw_legend, line_style
from bseries_base.errors import as_sentence, shorten, shown
from bseries_base.plotting import drawing, new_figure, print_style
from bseries_base.table import Column, Table, as_frame, as_html, as_text, listed
from integrators.core.arguments import check_progress
from integrators.core.errors import IntegratorError
from integrators.exact.arguments import read_number, read_positive
from integrators.runs.titles import write_title
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.scene import Scene
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

BUDGET = 0.2
"""CPU seconds for the longest run of a method. All runs of a method take about twice as long as the longest, and those
of a dozen methods five seconds."""
LOOSEST, FINEST = 1.0, 1e-15
"""Bounds on the errors of interest, which are relative: no correct digit, and all digits of doubles."""
FINE = 100
"""Steps per time scale that the budget allows over the longest span: enough for about six digits with a method of order
4."""


class DefaultSpan(NamedTuple):
    """The length of runs if none is given."""

    scales: float = 200.0
    """As a multiple of `time_scale`: about thirty periods, which show the growth of errors."""
    shorter: float = 2.2
    """Factor by which it is shortened while there is no reference solution: from one of 1, 2, 5, 10, … to the next."""
    trials: int = 8


SPAN = DefaultSpan()
SECONDS = "seconds"
COSTS = {SECONDS: "CPU time in seconds", "evaluations": "evaluations of f"}
"""What errors are drawn against, with the label of the axis."""


class WorkPrecision:
    """Work–precision measurements on a scene; made by `work_precision`.

    Attributes:
        judge: Measures the errors of runs on the scene.
        scene: The scene.
        span: The length of all runs.
        errors: The largest and the smallest error of interest.
        measures: The errors measured, of ``solution`` and ``energy``.
        curves: The methods with their rows.
        left_out: Requested methods that do not fit, with the reason.
        notes: Remarks on the measurement, in sentences.
        machine: The machine and software versions.

    Example:
        >>> import bseries as bs
        >>> found = bs.work_precision(["rk4"], bs.scene("pendulum"), span=10, errors=(1e-2, 1e-4), measure="energy")
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

    @property
    def notes(self) -> list[str]:
        """Remarks on the measurement, in sentences."""
        rows = [row for curve in self.curves for row in curve.rows]
        spreads = sorted(row.cost.spread for row in rows if row.cost is not None)
        failed = sum(row.errors.failure is not None for row in rows)
        notes = [f"Measured {self.machine['date']}: {self.machine['processor']}; {self.machine['versions']}."]
        if spreads:
            notes.append(
                f"CPU time of steps, compiled and warm, medians of interleaved rounds; distance of the quartiles: "
                f"{spreads[len(spreads) // 2]:.0%} in the middle, {spreads[-1]:.0%} at most."
            )
        if failed:
            notes.append(f"{failed} of {len(rows)} runs failed, with steps too large for the method.")
        if self.scene.black_boxes and self.judge.reference is not None:
            notes.append(
                "Errors of the solution are distances from dop853 with halved steps, as there are no formulas."
            )
        if self.judge.problem:
            notes.append(f"The solution was not measured: {self.judge.problem}.")
        return notes

    def best(self, error: float, measure: str | None = None) -> Recommendation:
        """The cheapest method for an error, and the largest step that meets it.

        The step is interpolated from the rows and refined by bisection: within a few per cent it is the largest one
        that meets the error together with all smaller steps tried. The same is done for methods of nearly the
        same cost, and all of these are timed again in interleaved rounds.

        Args:
            error: The error tolerance.
            measure: The name of the error; by default the first of `measures`.

        Raises:
            IntegratorError: An argument cannot be used, or no method is known to meet the error.
        """
        return choose(self.judge, self.curves, error, measure)

    @property
    def title(self) -> str:
        """The scene and the length of the runs."""
        return f"{self.scene.title}, t = 0 to {self.span:g}"

    def plot(self, ax: Axes | None = None, *, measure: str | None = None, against: str = SECONDS) -> Axes:
        """The work–precision diagram: CPU time against error, strong curves for methods that are cheapest somewhere.

        Args:
            ax: The axes, which are returned; None for pyplot's current or new ones.
            measure: The name of the error; by default the first of `measures`.
            against: ``"seconds"`` of CPU time, or ``"evaluations"`` of f, in which methods that iterate have no curve.

        Raises:
            IntegratorError: The measure is none of `measures`, `against` is another word, or `ax` is no axes.
            ImportError: matplotlib is not installed.

        Example:
            >>> import bseries as bs
            >>> found = bs.work_precision(["rk4", "heun2"], "pendulum", span=10, errors=(1e-2, 1e-4), measure="energy")
            >>> axes = found.plot()
            >>> axes.get_xlabel(), axes.get_ylabel()
            ('largest error of the energy, relative to it', 'CPU time in seconds')
        """
        measure = check_measure(self.measures[0] if measure is None else measure, self.measures)
        with drawing(ax, IntegratorError, (WIDTH, HEIGHT)) as axes:
            draw_panel(axes, self.curves, self.errors, measure, against)
            write_title(axes, self.title)
        return axes

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
            "notes": self.notes,
            "left_out": self.left_out,
            "methods": [
                {"method": curve.candidate.name, "rows": [_row_dict(curve, row) for row in curve.rows]}
                for curve in self.curves
            ],
        }

    def to_table(self, choices: Mapping[float, Recommendation | str] | None = None) -> Table:
        """CPU times of runs by powers of ten of the error as a table: text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            choices: For error tolerances, the result of `best` or the reason for its refusal, printed below the table.
        """
        choices, measure = choices or {}, self.measures[0]
        first, last = (round(math.log10(error), 9) for error in self.errors)  # 1e-3 is no power of ten in doubles
        powers = range(math.floor(first), math.ceil(last) - 1, -1)
        decades = [float(f"1e{k}") for k in powers] or list(self.errors)
        times = run_times(self.curves, decades, measure, choices)
        rows = []
        for name in (curve.candidate.name for curve in self.curves):
            cells = (duration(t[name]) + "*" * (name == best) if name in t else "" for t, best in times)
            rows.append([name, *cells])
        rows_of = ((curve, row) for curve in self.curves for row in curve.rows)
        runs = [{"method": curve.candidate.name, **_row_dict(curve, row)} for curve, row in rows_of]
        facts = [
            {"wanted": error, **({"reason": choice} if isinstance(choice, str) else choice.to_dict())}
            for error, choice in choices.items()
        ]
        advice = (_advice(error, choice) for error, choice in choices.items())
        left_out = (as_sentence(f"Left out: {name}: {reason}") for name, reason in self.left_out.items())
        return Table(
            f"{self.title}: CPU time against the error of the {measure}",
            [Column("method"), *(Column(f"{error:.0e}", True) for error in decades)],
            rows,
            [*advice, *self.notes, *left_out],
            data=lambda: {**self.to_dict(), "choices": facts},
            items="methods",
            records=listed([(key, itemgetter(key)) for key in (runs[0] if runs else ("method",))], runs),
        )

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame


def _row_dict(curve: Curve, row: Row) -> dict[str, Any]:
    keys = ("seconds", "low", "high", "rounds")
    costs = {"seconds_per_step" if key == "seconds" else key: getattr(row.cost, key, None) for key in keys}
    errors = {"solution": row.errors.solution, "energy": row.errors.energy, "failure": row.errors.failure}
    count = curve.candidate.evaluations
    work = {"seconds": row.seconds, "evaluations": None if count is None else count * row.steps}
    return {"h": row.h, "steps": row.steps, **costs, **work, **errors}


def work_precision(
    methods: Methods,
    scene: Scene | str,
    *,
    span: float | None = None,
    errors: tuple[float, float] = (1e-3, 1e-12),
    measure: str = "all",
    budget: float = BUDGET,
    progress: Callable[[int, int], object] | bool | None = None,
) -> WorkPrecision:
    """Errors and CPU times of methods on a scene, from its start, for a range of step sizes.

    Errors and times are measured in separate runs: the timed ones observe nothing, are compiled and warm, and are
    interleaved. Steps shrink until the error is below the range, stops falling, or the budget is spent.

    Args:
        methods: Methods or their names, or one; ``"auto"`` for those known to be efficient on scenes of this structure,
            ``"all"`` for all of the catalogue that fit, which takes minutes.
        scene: The scene, with a start, or the name of a built-in one.
        span: The length of runs; by default about two hundred times |y|/|f| at the start, or less if there is no
            reference solution over that length.
        errors: The largest and the smallest error of interest.
        measure: ``"solution"`` (against the reference), ``"energy"``, or ``"all"`` for both.
        budget: CPU seconds for the longest run of a method.
        progress: Called with the number of finished parts of the work and that of all parts.

    Returns:
        The measurements; `WorkPrecision.best` recommends a method.

    Raises:
        IntegratorError: An argument cannot be used, such as a span for which the budget is too short; no method fits;
            or none of the errors can be measured over the span.

    Example:
        >>> import bseries as bs
        >>> found = bs.work_precision(["stormer-verlet", "rk4"], "pendulum", span=10, errors=(1e-2, 1e-4))
        >>> found
        <WorkPrecision of 2 methods on pendulum: ... runs over 10>
        >>> found.best(1e-3).method
        'rk4'

    References:
        E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, section II.10 (diagrams of
        work and precision).
    """
    scene = as_scene(scene)
    _ = scene.y0  # refuses a scene without a start before compilation
    loosest, finest = check_errors(errors)
    limit = read_positive(budget, "budget")
    measures = MEASURES if measure == "all" else (check_measure(measure),)
    if SOLUTION not in measures and not scene.is_hamiltonian:
        problem = "energy cannot: it has no energy that is conserved"
        raise IntegratorError(f"measure must be one that can be measured on {scene.name}, but {problem}")
    length = None if span is None else read_positive(span, "span")
    longest = max(limit, BUDGET) / LEAST_SECONDS / FINE * time_scale(scene)
    if length is not None and length > longest:
        raise IntegratorError(
            f"span must be at most {longest:.3g} for {scene.name} and this budget, but was {length:g}"
        )
    chosen, left_out = candidates(scene, methods)
    total = 2 * len(chosen)
    report = check_progress(progress) or (lambda done, total: None)
    for k, candidate in enumerate(chosen):
        report(k, total)
        steps = stepper(candidate.method, scene, solver=candidate.solver)
        with suppress(StepError):  # the first step, small enough for all methods, compiles
            steps.advance(steps.start(h=1e-9), 1)
    judge = Judge(scene, length or _rounded(SPAN.scales * time_scale(scene)), measures, finest)
    for _ in range(SPAN.trials if length is None else 0):
        if judge.problem:
            judge = Judge(scene, _rounded(judge.span / SPAN.shorter), measures, finest)
    if not judge.available:
        problem = f"{' and '.join(measures)} cannot: {judge.problem}"
        raise IntegratorError(f"measure must be one that can be measured on {scene.name}, but {problem}")
    swept = []
    for k, candidate in enumerate(chosen):
        report(len(chosen) + k, total)
        swept.append(sweep(judge, candidate, finest, limit))
    report(total, total)
    return WorkPrecision(judge, (loosest, finest), timed_curves(judge, swept), left_out)


def check_errors(errors: Iterable[Fraction | float]) -> tuple[float, float]:
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


def _rounded(value: float) -> float:
    """The nearest of 1, 2 and 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    nearest = min((1, 2, 5, 10), key=lambda digit: abs(math.log(value / (digit * power))))
    return float(f"{nearest * power:.0e}")


def run_times(
    curves: Sequence[Curve], errors: Sequence[float], measure: str, choices: Mapping[float, Recommendation | str]
) -> list[tuple[dict[str, float], str | None]]:
    """For each error, from the largest on, CPU seconds of runs that meet it by method, and the cheapest method.

    The runs are those of recommendations, with refined steps, and otherwise rows of the curves, where all smaller steps
    meet the error as well. No run is cheaper than that for a larger error, which may have met a smaller one by chance.
    """
    refined = [
        {} if choice is None or isinstance(choice, str) else {**choice.examined, choice.method: choice.seconds}
        for choice in map(choices.get, errors)
    ]
    times: list[dict[str, float]] = [{} for _ in errors]
    for curve in curves:
        name, least = curve.candidate.name, 0.0
        for column, error, known in zip(times, errors, refined, strict=True):
            seconds = known.get(name) or _row_time(curve, error, measure, least)
            if seconds is not None:
                column[name] = least = seconds
        for looser, tighter, known in reversed(list(zip(times, times[1:], refined, strict=False))):
            if name in tighter and name not in known:
                looser[name] = min(looser.get(name, math.inf), tighter[name])
    stars = (
        None
        if isinstance(choice, str)
        else choice.method
        if choice
        else min(column, key=column.__getitem__, default=None)
        for column, choice in zip(times, map(choices.get, errors), strict=True)
    )
    return list(zip(times, stars, strict=True))


def _row_time(curve: Curve, error: float, measure: str, least: float) -> float | None:
    """CPU seconds, at least `least`, of the row with the largest step that meets an error with all smaller steps."""
    good, _ = bracket(curve.sizes(measure), error)
    able = [row.seconds for row in curve.rows if row.seconds and good is not None and row.steps >= good]
    return max(least, min((seconds for seconds in able if seconds >= least), default=max(able))) if able else None


def _advice(error: float, choice: Recommendation | str) -> str:
    """The recommendation for an error, in a sentence."""
    wanted = next(text for digits in range(17) if float(text := f"{error:.{digits}e}") == error)
    if isinstance(choice, str):
        return as_sentence(f"Error {wanted}: {choice}")
    others = ", ".join(f"{name} {duration(t)}" for name, t in sorted(choice.examined.items(), key=lambda x: x[1]))
    return (
        f"Error {wanted}: {choice.method} with h = {choice.h:.6g}, {choice.steps:,} steps over {choice.span:g}, "
        f"{duration(choice.seconds)}, error {choice.error:.1e} ({choice.basis})"
        + (f"; next {others}." if others else ".")
    )


WIDTH, HEIGHT = 12.0, 8.0
"""Size of a panel, in centimetres."""
NAME_SIZE = 7
"""Font size of the names of methods, in points: twenty fit beside a panel."""
AXES = {
    "solution": "largest error of the solution, relative to the size of the state",
    "energy": "largest error of the energy, relative to it",
}


def name_curves(panel: Axes, size: float = NAME_SIZE) -> Legend:
    """Write the names of curves to the right of a panel, in the order in which the curves end there."""
    named = (line for line in panel.lines if not str(line.get_label()).startswith("_"))
    lines = sorted(named, key=lambda line: -float(line.get_ydata()[-1]))  # pyright: ignore[reportArgumentType, reportIndexIssue]
    return draw_legend(panel, lines, fontsize=size)


def draw(
    curves: Sequence[Curve], errors: tuple[float, float], measures: Sequence[str], title: str, against: str = SECONDS
) -> Figure:
    """A figure with a panel for each measure that a method has values of; see `draw_panel`."""
    shown = [measure for measure in measures if any(curve.front(measure) for curve in curves)]
    with print_style():
        figure = new_figure((WIDTH, HEIGHT * len(shown)))
        panels = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
        for panel, measure in zip(panels, shown, strict=True):
            draw_panel(panel, curves, errors, measure, against)
        panels[0].set_title(title)
    return figure


def draw_panel(
    panel: Axes, curves: Sequence[Curve], errors: tuple[float, float], measure: str, against: str = SECONDS
) -> None:
    """Draw the cost against an error: the Pareto front of each method, strong if it is the cheapest for some error."""
    if against not in COSTS:
        raise IntegratorError(f"against must be one of {', '.join(COSTS)}, but was {shown(against)}")
    curves = curves if against == SECONDS else [curve.counted() for curve in curves]
    loosest, finest = errors
    limits = min(10 * loosest, 1.0), finest / 10  # so that curves do not end at the edges
    panel.set(xscale="log", yscale="log", xlabel=AXES[measure], ylabel=COSTS[against], xlim=limits)
    panel.grid(color="#dddddd", linewidth=0.4)
    best = set[str]()
    for error in (loosest * (finest / loosest) ** (k / 50) for k in range(51)):  # five or more in a power of ten
        times = {curve.candidate.name: t for curve in curves if (t := curve.seconds(error, measure)) is not None}
        best |= {min(times, key=times.__getitem__)} if times else set()
    for k, curve in enumerate(curves):
        points = [point for point in curve.front(measure) if limits[1] <= point[0] <= limits[0]]
        if points:
            strong = curve.candidate.name in best
            style: dict[str, Any] = {**line_style(k), "marker": MARKERS[k % len(MARKERS)]}
            style |= {"linewidth": 1.8, "markersize": 5.5} if strong else {"linewidth": 0.6, "markersize": 3.2}
            panel.plot(*zip(*points, strict=True), label=curve.candidate.name, **style)
    legend = name_curves(panel)
    legend.set_title("strong: cheapest\nfor some error")
    legend.get_title().set_fontsize(NAME_SIZE)
    for line in legend.get_lines():
        line.set_linestyle("none")  # beside a panel, lines would look like continued curves
