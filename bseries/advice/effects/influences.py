"""Influence of the effects of a scene on a run, and which effects can be left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

from bseries.advice.distances import energy_size, relative_change, relative_distance
from bseries.advice.effects.costs import variant_costs
from bseries.advice.effects.report import EffectReport, EffectRow, Influence
from bseries.advice.effects.variants import effect_variants
from bseries.advice.measures import EFFECT_MEASURES, ENERGY, SOLUTION, check_measure, whole_steps
from bseries.algebra.stages import check_method
from bseries.exceptions import SeriesError
from integrators.core.arguments import MOST_STEPS, check_progress, read_number
from integrators.methods.catalogue.registry import method as named
from integrators.runs.integration import integrate
from integrators.runs.observers import observers
from integrators.steppers.states import StepError

if TYPE_CHECKING:
    import numpy as np

    from bseries.advice.effects.variants import EffectVariants, Names
    from bseries.advice.timing import Timing
    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene


COMPARISONS = 1000
"""Approximate number of times at which two runs are compared."""
PIECES = 4
"""Substeps of the comparison run; for a method of order p it shows 1 − 4^(−p) of the error, at least 3/4."""


class EffectRuns:
    """Runs of one method from one start with different effects, each made once.

    Args:
        variants: The scene with its effects.
        method: The method.
        h: The step size.
        steps: The number of steps.
        options: Further options of `integrate`.
        progress: Called with the number of steps done and of all, in all runs.
    """

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

    @property
    def needed(self) -> set[Names]:
        """The sets of effects in the runs for all influences."""
        names = self.variants.names
        return {names, (), *((name,) for name in names), *(self.variants.without(name) for name in names)}

    def own_error(self) -> Influence:
        """The error of the method with all effects, from a run with smaller steps."""
        names = self.variants.names
        self._known[names] = self._states(names)
        return self._apart(names, self._known[names], names, self._states(names, pieces=PIECES))

    def alone(self, name: str) -> Influence:
        """The influence of an effect on the scene without others."""
        return self._apart((name,), self.run((name,)), (), self.run(()))

    def without(self, *left_out: str) -> Influence:
        """The influence of leaving out some of all effects."""
        more, less = self.variants.names, self.variants.without(*left_out)
        return self._apart(more, self.run(more), less, self.run(less))

    def run(self, names: Names) -> np.ndarray | None:
        """The states of a run; None if a step failed, as without a potential that keeps bodies apart."""
        if names not in self._known:
            try:
                self._known[names] = self._states(names)
            except StepError:
                self._known[names] = None
        return self._known[names]

    def _states(self, names: Names, pieces: int = 1) -> np.ndarray:
        """The states at the times of comparison, (variables, times), with steps divided into pieces."""
        scene, every = self.variants.build(names), -(-self.steps // COMPARISONS)  # rounded up
        options = {**self._options, "parts": self.variants.parts(self._options.get("parts"), scene)}
        h, steps, save_every = self.h / pieces, self.steps * pieces, every * pieces
        try:
            return integrate(
                scene, self.method, h=h, steps=steps, save_every=save_every, progress=self._show, **options
            ).y
        finally:
            self._made += steps

    def _show(self, done: int, total: int) -> None:
        """Report progress; the runs that a recommendation needs are not known in advance."""
        if self._progress is not None:
            known = self.steps * (len(self.needed) + PIECES)
            self._progress(self._made + done, max(known, self._made + total))

    def _apart(self, more: Names, first: np.ndarray | None, less: Names, second: np.ndarray | None) -> Influence:
        """The distance of two runs, the second with the same effects or fewer; infinite if it overflows."""
        import numpy as np

        base = self.variants.build(less).with_effects()
        if first is None or second is None:
            return Influence(inf, inf if base.is_hamiltonian else None)
        at_first, at_second = self.variants.shared(more, less)
        y, z = first[at_first], second[at_second]
        with np.errstate(over="ignore", invalid="ignore"):
            distance = relative_distance(z, y)
            change = None
            if base.is_hamiltonian:
                without, with_more = (x[: base.dimension] for x in (z, y))
                size = energy_size(base, with_more[:, 0])
                change = relative_change(_energies(base, without), size, _energies(base, with_more))
        return Influence(_infinite_unless_finite(distance), None if change is None else _infinite_unless_finite(change))


def _infinite_unless_finite(value: float) -> float:
    return value if isfinite(value) else inf


def _energies(scene: Scene, y: np.ndarray) -> np.ndarray:
    """The Hamiltonian at many states, whose first variables are those of the scene."""
    import numpy as np

    energy = observers(scene, "energy")
    return np.array([energy(0.0, state)[0] for state in y.T])


WRONG = 0.1
"""Error of a run from which on it does not allow a recommendation."""
MARGIN = 2.0
"""Factor for interactions: leaving out two effects may change more than the sum of both influences."""


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
    """The influence and cost of each effect of a scene on a run, and the effects that can be left out.

    The influence of an effect is the distance of two runs of the same method with the same step, one with it and one
    without: they have nearly the same errors, so that influences far below the method's error are visible. Effects are
    left out in the order of increasing influence while the sum of influences times a margin stays within the accepted
    error. A run without them then measures the change; if it exceeds the promised bound, effects are restored.

    Args:
        scene: The scene, or the name of a built-in one; those whose effects are chosen when they are built have to be
            given by name.
        method: The method, or its name.
        h: The step size; negative backwards in time.
        span: The length of the run; the last step may exceed it.
        accept: The accepted error; by default that of the method itself, with all effects.
        measure: The error that is accepted: relative, of the ``"solution"`` or the ``"energy"``, see
            `bseries.advice.effects.report.Influence`.
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
    """Check that numbers are in range."""
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


def _times(runs: EffectRuns, left_out: Names, parts: Any, solver: str) -> dict[Names, Timing]:
    """Seconds per step with no effects, all, all but one, and the recommended ones, if these runs succeed."""
    variants = runs.variants
    wanted = {(), variants.names, variants.without(*left_out), *map(variants.without, variants.names)}
    able = [names for names in sorted(wanted) if runs.run(names) is not None]
    return variant_costs(
        variants, able, runs.method, runs.h, parts=parts, options={"solver": solver}, most_steps=runs.steps
    )
