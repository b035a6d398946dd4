"""Which effects of a scene matter over a run, and which can be left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from integrators.methods import method as named
from integrators.steppers.run_input import MOST_STEPS, check_progress, read_number

from ..coefficients import check_method
from ..exceptions import SeriesError
from .durations import whole_steps
from .effect_cost_rows import variant_costs
from .effect_report import EffectReport, EffectRow
from .effect_runs import EffectRuns
from .effect_variants import effect_variants
from .measures import EFFECT_MEASURES, ENERGY, SOLUTION, check_measure

if TYPE_CHECKING:
    from integrators.scenes.base import Scene

    from ..coefficients import Method
    from .effect_variants import Names
    from .timing import Timing

WRONG = 0.1
"""A run whose own error is as large says nothing of what can be left out."""
MARGIN = 2.0
"""Effects act on each other: leaving out two may change more than the sum of what leaving out each one does."""


def effect_influence(
    scene: Scene | str,
    method: Method | str,
    *,
    h: float,
    span: float,
    accept: float | None = None,
    measure: str = SOLUTION,
    effects: str | Iterable[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    start: Mapping[str, Any] | None = None,
    parts: Mapping[str, Any] | None = None,
    solver: str = "auto",
    margin: float = MARGIN,
    progress: Callable[[int, int], object] | None = None,
) -> EffectReport:
    """Which effects of a scene matter: what each does to a run, what it costs, and which can be left out.

    The influence of an effect is how far two runs of the same method with the same step are apart, one with it and one
    without: they make nearly the same errors, so that influences far below the method's error show too. Effects are
    left out, those of least influence first, while the sum of their influences times a margin stays within the accepted
    error. A run without them then measures how far that changes the result; should it be more than promised, effects
    are taken back.

    Args:
        scene: The scene, or the name of a built-in one; those whose effects are chosen when they are built have to be
            given by name.
        method: The method, or its name.
        h: The step size; negative backwards in time.
        span: How long the run is; the last step may go beyond.
        accept: The error that is accepted; by default that of the method itself, with all effects.
        measure: What is accepted: a relative error of the ``"solution"`` or of the ``"energy"``, see
            `bseries.advice.effect_report.Influence`.
        effects: The effects to look at; by default those that are on, and all if none is.
        parameters: Options of a built-in scene, and values of its parameters and of those of the effects.
        start: Start values of some blocks.
        parts: What the parts of the method are in the scene with all effects.
        solver: How implicit stages are found: ``auto``, ``fixed-point`` or ``newton``.
        margin: By what factor influences are taken too large, 1 or more.
        progress: Called with the number of steps made and of all, in all runs.

    Raises:
        SeriesError: The scene has no effects, no energy where that is the measure, or an argument is out of its range.
        IntegratorError: The method does not fit the scene with some effects, there is no such measure, or an argument
            is not of its kind; as a StepError, a step with all effects failed.

    Example:
        >>> import bseries as bs
        >>> report = bs.effect_influence("kepler", "rk4", h=0.02, span=6, accept=0.06, effects=["oblateness", "drag"])
        >>> report.leave_out, report.keep
        (('oblateness',), ('drag',))
        >>> [f"{row.name} {row.left_out.solution:.0e}" for row in report.rows], f"{report.own_error.solution:.0e}"
        (['oblateness 2e-02', 'drag 1e-01'], '3e-05')
    """
    variants = effect_variants(scene, effects, parameters, start)
    method = check_method(named(method) if isinstance(method, str) else method)
    step, length, factor = read_number(h, "h"), read_number(span, "span"), read_number(margin, "margin")
    wanted = None if accept is None else read_number(accept, "accept")
    measure = check_measure(measure, EFFECT_MEASURES)
    _check(step, length, factor, wanted)
    if measure == ENERGY and not variants.full.with_effects().is_hamiltonian:
        raise SeriesError(f"measure must be solution for {variants.full.name}, which has no energy, but was {measure}")
    check_progress(progress)
    runs = EffectRuns(variants, method, step, whole_steps(length, step), {"parts": parts, "solver": solver}, progress)
    own_error = runs.own_error()
    accepted = getattr(own_error, measure) if wanted is None else wanted
    if wanted is None and not accepted < WRONG:
        raise SeriesError(
            f"h must be small enough for a run that is right, or accept be given, but with {step:g} the error of the "
            f"method itself is {accepted:.2g}"
        )
    rows = [EffectRow(name, text, runs.alone(name), runs.without(name)) for name, text in variants.effects.items()]
    left_out = _recommended(runs, rows, measure, accepted, factor)
    times = _times(runs, left_out, parts, solver)
    full = times[variants.names]
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
        kept=times[variants.without(*left_out)],
    )


def _check(h: float, span: float, margin: float, accept: float | None) -> None:
    """Refuse numbers out of their range."""
    if h == 0 or span <= 0:
        raise SeriesError(f"span must be positive, and h not zero, but they were {span:g} and {h:g}")
    if not span / abs(h) < MOST_STEPS:
        raise SeriesError(f"span must have fewer than 2^53 steps, but had {span / abs(h):.2g} of {h:g}")
    if margin < 1:
        raise SeriesError(f"margin must be a factor, 1 or more, but was {margin:g}")
    if accept is not None and accept < 0:
        raise SeriesError(f"accept must be an error, 0 or more, but was {accept:g}")


def _recommended(
    runs: EffectRuns, rows: list[EffectRow], measure: str, accepted: float, margin: float
) -> tuple[str, ...]:
    """The effects to leave out: as many as the sum of influences allows, and a run without them confirms."""
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


def _times(runs: EffectRuns, left_out: Names, parts: Any, solver: str) -> dict[Names, Timing]:
    """Seconds for a step with no effects, all, all but one, and those recommended, if these runs do not fail."""
    variants = runs.variants
    wanted = {(), variants.names, variants.without(*left_out), *map(variants.without, variants.names)}
    able = [names for names in sorted(wanted) if runs.run(names) is not None]
    return variant_costs(
        variants, able, runs.method, runs.h, parts=parts, options={"solver": solver}, most_steps=runs.steps
    )
