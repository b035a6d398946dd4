"""Influence of the effects of a scene on a run, and the effects that can be left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict
from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bseries.advice.effects.costs import EffectVariants, Names, effect_variants, variant_costs
from bseries.advice.measures import (
    ENERGY,
    SOLUTION,
    check_measure,
    energy_size,
    relative_change,
    relative_distance,
    whole_steps,
)
from bseries.advice.timing import Timing
from bseries.algebra.stages import check_method
from bseries.exceptions import SeriesError
from bseries_base.diagrams import SHADE, bar_height, draw_bars, draw_legend
from bseries_base.plotting import BLACK, VERMILION, drawing
from bseries_base.table import Column, Table, as_frame, as_html, as_text, listed
from integrators.core.arguments import MOST_STEPS, check_progress
from integrators.exact.arguments import read_number
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.runs.integration import integrate
from integrators.runs.observers import observers
from integrators.runs.titles import write_title
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene
from integrators.steppers.states import StepError

if TYPE_CHECKING:
    from matplotlib.axes import Axes


PIECES = 4
"""Substeps of the comparison run; for a method of order p it shows 1 − 4^(−p) of the error, at least 3/4."""
MARGIN = 2.0
"""Default of the factor for interactions: leaving out two effects may change more than the sum of both influences, as
each may change the influence of the other by its whole size."""
MEASURABLE = 0.03
"""Smallest relative difference of two times that can be measured: repeated medians differ by that much."""


EXPLANATION = (
    "solution, energy: what leaving an effect out of all changes, relative to the size of the state and to the energy "
    "at the start; alone: the same in the scene without other effects, for the solution; step: CPU time that it adds "
    "to a step."
)


class Influence(NamedTuple):
    """The distance of two runs in the variables that they share.

    Attributes:
        solution: The largest distance of states, relative to the largest norm of the state; infinite if a run failed.
        energy: The largest relative difference of the energy, the Hamiltonian without effects; None if there is none.

    Example:
        >>> import bseries as bs
        >>> report = bs.effect_influence("rk4", "pendulum", h=0.05, span=1, effects="damping")
        >>> report.rows[0].alone == report.rows[0].left_out, f"{report.own_error.solution:.0e}"
        (True, '2e-08')
    """

    solution: float
    energy: float | None


class EffectRow(NamedTuple):
    """One effect.

    Attributes:
        name: The effect.
        summary: Its description.
        alone: The influence of adding it to the scene without effects.
        left_out: The influence of leaving it out of the scene with all effects.
        seconds: Seconds that it adds to a step of the scene with all others; None if a run without it failed.
        uncertainty: The uncertainty of `seconds`, from the quartiles of both times.

    Example:
        >>> import bseries as bs
        >>> report = bs.effect_influence("rk4", "pendulum", h=0.05, span=1, effects="damping")
        >>> [(row.name, f"{row.left_out.solution:.0e}") for row in report.rows]
        [('damping', '3e-02')]
    """

    name: str
    summary: str
    alone: Influence
    left_out: Influence
    seconds: float | None = None
    uncertainty: float | None = None

    def with_costs(self, full: Timing, less: Timing | None) -> EffectRow:
        """The row with the cost of the effect: the difference of a step with all effects and one without it."""
        if less is None:
            return self
        uncertainty = (full.high - full.low + less.high - less.low) / 2
        return self._replace(seconds=full.seconds - less.seconds, uncertainty=uncertainty)


class EffectReport(NamedTuple):
    """The influence of the effects of a scene on a run, with a recommendation; made by `effect_influence`.

    Attributes:
        method: The method.
        scene: The scene with its effects.
        h: The step size.
        steps: The number of steps.
        measure: The error in the recommendation: ``"solution"`` or ``"energy"``.
        accept: The accepted error.
        margin: The safety factor for influences, since effects interact.
        own_error: The error of the method itself, with all effects.
        rows: The effects.
        leave_out: The effects that the recommendation leaves out.
        apart: The measured distance of the runs with all effects and with the recommended ones.
        bare: Seconds per step without effects; None if that run failed.
        full: Seconds per step with all effects.
        kept: Seconds per step with the recommended effects.

    Example:
        >>> import bseries as bs
        >>> report = bs.effect_influence("rk4", "kepler", h=0.02, span=6, accept=0.06, effects=["oblateness", "drag"])
        >>> report.leave_out, report.keep
        (('oblateness',), ('drag',))
        >>> report.apart.solution <= report.promised <= report.accept
        True
    """

    scene: str
    method: str
    h: float
    steps: int
    measure: str
    accept: float
    margin: float
    own_error: Influence
    rows: tuple[EffectRow, ...]
    leave_out: tuple[str, ...]
    apart: Influence
    bare: Timing | None
    full: Timing
    kept: Timing

    @property
    def keep(self) -> tuple[str, ...]:
        """The recommended effects."""
        return tuple(row.name for row in self.rows if row.name not in self.leave_out)

    @property
    def promised(self) -> float:
        """The bound of the distance of both runs: the sum of the influences left out, times the margin."""
        influences = (getattr(row.left_out, self.measure) for row in self.rows if row.name in self.leave_out)
        return self.margin * sum(influences, 0.0)

    @property
    def saved(self) -> float:
        """The relative time that the recommendation saves."""
        return 1 - self.kept.seconds / self.full.seconds

    def advice(self) -> Iterator[str]:
        """The recommendation in sentences."""
        if self.leave_out:
            if abs(self.saved) <= max(MEASURABLE, (self.full.spread + self.kept.spread) / 2):
                saving = ", which changes the time of a step by less than it varies"
            elif self.saved < 0:
                saving = f", though a step takes {-self.saved:.0%} longer"
            else:
                saving = f", which saves {self.saved:.0%} of a step's time"
            left_out, kept = ", ".join(self.leave_out), ", ".join(self.keep) or "none"
            accepted = f"{self.accept:.2g} is accepted for the {self.measure}"
            yield f"Leave out {left_out}{saving}; keep {kept}: {accepted}."
            yield (
                f"Promised: the {self.measure} changes by at most {self.promised:.2g}, {self.margin:g} times the sum "
                f"of influences; a run without them: {getattr(self.apart, self.measure):.2g}."
            )
        else:
            least = min(getattr(row.left_out, self.measure) for row in self.rows)
            yield (
                f"Keep all effects: leaving out any of them changes the {self.measure} by {least:.2g} or more, and "
                f"{self.accept:.2g} is accepted, with a margin of {self.margin:g}."
            )
        own = getattr(self.own_error, self.measure)
        if not own <= self.accept:
            yield f"The method's own error, {own:.2g}, exceeds the accepted error: use a smaller step."

    def to_dict(self) -> dict[str, Any]:
        """The report as JSON-ready data."""
        facts = self._asdict()
        times = {name: facts.pop(name) for name in ("bare", "full", "kept")}
        rows = [
            {**row._asdict(), "alone": _numbers(row.alone), "left_out": _numbers(row.left_out)} for row in self.rows
        ]
        return {
            "schema": 1,
            "kind": "effects",
            **facts,
            "own_error": _numbers(self.own_error),
            "apart": _numbers(self.apart),
            "keep": self.keep,
            "promised": self.promised,
            "seconds_per_step": {name: None if time is None else asdict(time) for name, time in times.items()},
            "rows": rows,
        }

    def to_table(self) -> Table:
        """The report as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON."""
        rows = [*self.rows, EffectRow("", "", Influence(0.0, None), self.own_error)]  # that of the method has no name
        values: tuple[tuple[str, Callable[[EffectRow], Any], str, Callable[[Any], str]], ...] = (
            ("effect", lambda row: row.name, "effect", lambda name: name or "(error of the method)"),
            ("solution", lambda row: row.left_out.solution, "solution", "{:.2g}".format),
            ("energy", lambda row: row.left_out.energy, "energy", "{:.2g}".format),
            ("alone_solution", lambda row: row.alone.solution if row.name else None, "alone", "{:.2g}".format),
            ("alone_energy", lambda row: row.alone.energy, "", str),
            ("seconds", lambda row: row.seconds, "step", lambda x: f"{x * 1e9:+.1f} ns"),
            ("uncertainty", lambda row: row.uncertainty, "±", lambda x: f"{x * 1e9:.1f}"),
            (
                "leave_out", lambda row: str(row.name in self.leave_out).lower() if row.name else None,
                "advice", lambda x: "leave out" if x == "true" else "keep",
            ),
        )  # fmt: skip

        def column(get: Callable[[EffectRow], Any], heading: str, text: Callable[[Any], str]) -> Column:
            is_number = heading not in ("effect", "advice")
            return Column(heading, is_number, lambda row: "" if (value := get(row)) is None else text(value))

        known = (("no effects", self.bare), ("all", self.full), ("the recommended ones", self.kept))
        times = (f"{found.seconds * 1e9:,.1f} ns with {name}" for name, found in known if found is not None)
        return Table(
            f"Effects of {self.scene}, {self.method}: {self.steps:,} steps of {self.h:g}",
            [column(get, heading, text) for _, get, heading, text in values if heading],
            rows,
            [EXPLANATION, f"A step takes {', '.join(times)}.", *self.advice()],
            data=self.to_dict,
            items="rows",
            records=listed([(key, get) for key, get, *_ in values], rows),
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """What leaving out each effect changes, against the accepted error and the error of the method itself.

        Effects to be left out have white bars; those with which no run ended, and those without influence, have none.

        Args:
            ax: The axes, which are returned; None for pyplot's current or new ones.

        Raises:
            SeriesError: `ax` is no axes.
            ImportError: matplotlib is not installed.

        Example:
            >>> import bseries as bs
            >>> options = {"h": 0.02, "span": 6, "accept": 0.06, "effects": ["oblateness", "drag"]}
            >>> axes = bs.effect_influence("rk4", "kepler", **options).plot()
            >>> axes.get_xlabel(), [label.get_text() for label in axes.get_yticklabels()]
            ('change of the solution without the effect', ['oblateness: leave out', 'drag: keep'])
        """
        names = [f"{row.name}: {'leave out' if row.name in self.leave_out else 'keep'}" for row in self.rows]
        changes = [getattr(row.left_out, self.measure) for row in self.rows]
        widths = [change if change and isfinite(change) else nan for change in changes]
        fills = ["white" if row.name in self.leave_out else SHADE for row in self.rows]
        with drawing(ax, SeriesError, (12.0, bar_height(len(names)))) as axes:
            draw_bars(axes, names, widths, color=fills)
            write_title(axes, f"{self.method} on {self.scene}, h = {self.h:g}")
            axes.set_xscale("log")
            axes.set_xlabel(f"change of the {self.measure} without the effect")
            axes.axvline(self.accept, color=VERMILION, linestyle="--", label="accepted error")
            axes.axvline(getattr(self.own_error, self.measure), color=BLACK, linestyle=":", label="error of the method")
            draw_legend(axes)
        return axes

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame

    def __repr__(self) -> str:
        return f"<EffectReport of {self.method} on {self.scene}: {len(self.rows)} effects>"


def _numbers(influence: Influence) -> dict[str, float | None]:
    """An influence as JSON-ready data, with null for infinity."""
    return {key: value if value is not None and isfinite(value) else None for key, value in influence._asdict().items()}


class EffectRuns:
    """Runs of one method from one start with different effects, each made once."""

    def __init__(
        self,
        variants: EffectVariants,
        method: Method | str,
        h: float,
        steps: int,
        options: Mapping[str, Any],
        progress: Callable[[int, int], object] | None = None,
    ):
        self.variants, self.method, self.h, self.steps = variants, method, h, steps
        self._options, self._progress = dict(options), progress
        self._known: dict[Names, np.ndarray | None] = {}
        self._made = 0
        names = variants.names
        needed = {names, (), *((name,) for name in names), *map(variants.without, names)}
        self._least = steps * (len(needed) + PIECES)  # the steps of all influences, and of the error of the method

    def own_error(self) -> Influence:
        """The error of the method with all effects, from a run with smaller steps."""
        return self._apart(self.variants.names, self.variants.names, PIECES)

    def alone(self, name: str) -> Influence:
        """The influence of an effect on the scene without others."""
        return self._apart((name,), ())

    def without(self, *left_out: str) -> Influence:
        """The influence of leaving out some of all effects."""
        return self._apart(self.variants.names, self.variants.without(*left_out))

    def run(self, names: Names) -> np.ndarray | None:
        """The states of a run; None if a step fails without some effects, as without a potential that confines."""
        if names not in self._known:
            try:
                self._known[names] = self._states(names)
            except StepError:
                if names == self.variants.names:
                    raise
                self._known[names] = None
        return self._known[names]

    def _states(self, names: Names, pieces: int = 1) -> np.ndarray:
        """The states at the times of comparison, (variables, times), with steps divided into pieces."""
        scene, every = self.variants.build(names), -(-self.steps // 1000)  # tens of times in each period
        options = {**self._options, "parts": self.variants.parts(self._options.get("parts"), scene)}
        options |= {"h": self.h / pieces, "steps": self.steps * pieces, "save_every": every * pieces}

        def show(done: int, total: int) -> None:  # the runs that a recommendation needs are not known in advance
            if self._progress is not None:
                self._progress(self._made + done, max(self._least, self._made + total))

        try:
            return integrate(self.method, scene, progress=show, **options).y
        finally:
            self._made += self.steps * pieces

    def _apart(self, more: Names, less: Names, pieces: int = 1) -> Influence:
        """The distance of two runs, the second with the same effects in smaller steps, or with fewer."""
        first, second = self.run(more), self.run(less) if pieces == 1 else self._states(less, pieces)
        base = self.variants.build(less).with_effects()
        if first is None or second is None:
            return Influence(inf, inf if base.is_hamiltonian else None)
        at_first, at_second = self.variants.shared(more, less)
        y, z = first[at_first], second[at_second]
        with np.errstate(over="ignore", invalid="ignore"):
            distance, change = relative_distance(z, y), None
            if base.is_hamiltonian:
                energy = observers(base, "energy")
                without, with_more = (np.array([energy(0.0, at[: base.dimension])[0] for at in x.T]) for x in (z, y))
                change = relative_change(without, energy_size(base, y[: base.dimension, 0]), with_more)
        return Influence(distance if isfinite(distance) else inf, change if change is None or isfinite(change) else inf)


def effect_influence(
    method: Method | str,
    scene: Scene | str,
    *,
    h: float,
    span: float,
    accept: float | None = None,
    measure: str = SOLUTION,
    effects: str | Iterable[str] | None = None,
    parameters: Mapping[str, object] | None = None,
    start: Mapping[str, object] | None = None,
    parts: Parts | None = None,
    solver: str = "auto",
    margin: float = MARGIN,
    progress: Callable[[int, int], object] | bool | None = None,
) -> EffectReport:
    """The influence and cost of each effect of a scene on a run, and the effects that can be left out.

    The influence of an effect is the distance of two runs of the same method with the same step, one with it and one
    without: they have nearly the same errors, so that influences far below the method's error are visible. Effects are
    left out in the order of increasing influence while the sum of influences times a margin stays within the accepted
    error. A run without them then measures the change; if it exceeds the promised bound, effects are restored.

    Args:
        method: The method, or its name.
        scene: The scene, or the name of a built-in one; those whose effects are chosen when they are built have to be
            given by name.
        h: The step size; negative backwards in time.
        span: The length of the run; the last step may exceed it.
        accept: The accepted error; by default that of the method itself, with all effects.
        measure: The error that is accepted: relative, of the ``"solution"`` or the ``"energy"``, see
            `Influence`.
        effects: The effects to examine; by default the active ones, or all if none is active.
        parameters: Options of a built-in scene, and values of its parameters and of those of its effects.
        start: Start values of blocks.
        parts: The assignment of the method's parts in the scene with all effects.
        solver: The solver for implicit stages: ``auto``, ``fixed-point`` or ``newton``.
        margin: The safety factor for influences, 1 or more.
        progress: Called with the number of steps done and of all, in all runs.

    Raises:
        SeriesError: The scene has no effects, no energy where that is the measure, or an argument is out of its range.
        IntegratorError: The method does not fit the scene with some effects, there is no such measure, or an argument
            is not of its kind; as a StepError, a step with all effects failed.

    Example:
        >>> import bseries as bs
        >>> report = bs.effect_influence("rk4", "kepler", h=0.02, span=6, accept=0.06, effects=["oblateness", "drag"])
        >>> report.leave_out, report.keep
        (('oblateness',), ('drag',))
        >>> [f"{row.name} {row.left_out.solution:.0e}" for row in report.rows], f"{report.own_error.solution:.0e}"
        (['oblateness 2e-02', 'drag 1e-01'], '3e-05')
    """
    variants = effect_variants(scene, effects, parameters, start)
    method = check_method(as_method(method))
    step, length, factor = read_number(h, "h"), read_number(span, "span"), read_number(margin, "margin")
    wanted = None if accept is None else read_number(accept, "accept")
    measure = check_measure(measure)
    _check(step, length, factor, wanted)
    if measure == ENERGY and not variants.full.with_effects().is_hamiltonian:
        raise SeriesError(f"measure must be solution for {variants.full.name}, which has no energy, but was {measure}")
    show = check_progress(progress)
    runs = EffectRuns(variants, method, step, whole_steps(length, step), {"parts": parts, "solver": solver}, show)
    own_error = runs.own_error()
    accepted = getattr(own_error, measure) if wanted is None else wanted
    if wanted is None and not accepted < 0.1:  # not one correct digit
        raise SeriesError(
            f"h must be small enough for an accurate run, or accept be given, but with {step:g} the error of the "
            f"method itself is {accepted:.2g}"
        )
    rows = [EffectRow(name, text, runs.alone(name), runs.without(name)) for name, text in variants.effects.items()]
    left_out = effects_to_leave_out(runs, rows, measure, accepted, factor)
    names, kept = variants.names, variants.without(*left_out)
    wanted_times = {(), names, kept, *map(variants.without, names)}
    able = [chosen for chosen in sorted(wanted_times) if runs.run(chosen) is not None]
    options = {"solver": solver}
    times = variant_costs(variants, able, method, step, parts=parts, options=options, most_steps=runs.steps)
    full = times[names]
    return EffectReport(
        scene=variants.full.name,
        method=method.name,
        h=step,
        steps=runs.steps,
        measure=measure,
        accept=accepted,
        margin=factor,
        own_error=own_error,
        rows=tuple(row.with_costs(full, times.get(variants.without(row.name))) for row in rows),
        leave_out=left_out,
        apart=runs.without(*left_out),
        bare=times.get(()),
        full=full,
        kept=times[kept],
    )


def _check(h: float, span: float, margin: float, accept: float | None) -> None:
    """Check that numbers are in range."""
    if h == 0 or span <= 0:
        raise SeriesError(f"span must be positive, and h not zero, but they were {span:g} and {h:g}")
    if not span / abs(h) < MOST_STEPS:
        raise SeriesError(f"span must have fewer than 2^53 steps, but had {span / abs(h):.2g} of {h:g}")
    if margin < 1:
        raise SeriesError(f"margin must be a factor, 1 or more, but was {margin:g}")
    if accept is not None and accept < 0:
        raise SeriesError(f"accept must be an error, 0 or more, but was {accept:g}")


def effects_to_leave_out(
    runs: EffectRuns, rows: list[EffectRow], measure: str, accepted: float, margin: float
) -> tuple[str, ...]:
    """The effects to leave out: as many as the sum of influences allows and a run without them confirms."""
    influence = {row.name: getattr(row.left_out, measure) for row in rows}
    chosen, total = list[str](), 0.0
    for name in sorted(influence, key=influence.__getitem__):
        if not margin * (total + influence[name]) <= accepted:
            break
        chosen.append(name)
        total += influence[name]
    while chosen and not getattr(runs.without(*chosen), measure) <= margin * sum(influence[name] for name in chosen):
        chosen.pop()
    return tuple(name for name in influence if name in chosen)
