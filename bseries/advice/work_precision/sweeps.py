"""Errors and CPU times of methods over a range of step sizes.

`candidates` are methods for a scene, a `Judge` measures the errors of runs, a sweep makes runs with decreasing steps,
and a `Curve` holds errors and times.
"""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from time import thread_time
from typing import NamedTuple, TypeVar

import numpy as np

from bseries.advice.measures import (
    ENERGY,
    MEASURES,
    ROUNDING,
    SOLUTION,
    energy_size,
    largest_size,
    relative_change,
    relative_distances,
    without_time,
)
from bseries.advice.timing import Timing, Work, step_costs
from bseries.algebra.stages import check_method
from bseries_base.errors import shorten
from integrators.core.errors import IntegratorError
from integrators.methods.catalogue.registry import RECOMMENDED, catalogue, method
from integrators.methods.programs.program import Method
from integrators.reference.halved_steps import settled_solution
from integrators.reference.solution import reference_solution
from integrators.runs.integration import integrate
from integrators.runs.scipy_solvers import right_hand_side
from integrators.scenes.scene import Scene
from integrators.steppers.plan import Nodes, plan
from integrators.steppers.states import StepError
from integrators.steppers.step_model import Call
from integrators.steppers.stepping import method_pieces, stepper
from integrators.steppers.structure import Structure

Methods = Iterable[Method | str] | Method | str

NYSTROM = (
    *("stormer-verlet", "chin4a", "chin4c", *RECOMMENDED["nystrom splitting"].values(), "blanes-moan-rkn6-11"),
    *("dormand-prince54", "dop853", "gauss4", "gauss8", "lobatto-iiia-iiib8"),
)
"""For q'' = g(q). These and the next two lists are the methods of the catalogue that were the cheapest for some error
on some scene, and simple methods of orders 2 and 4 for comparison."""
SPLIT = (
    *("stormer-verlet", "blanes-moan4", "blanes-moan6", "sofroniou-spaletta8", "rk4", "tsit5", "dormand-prince54"),
    *("dop853", "implicit-midpoint", "gauss2", "gauss4"),
)
"""For two parts whose flows are known."""
WHOLE = (
    *("rk4", "dormand-prince54", "tsit5", "verner65", "dop853", "implicit-midpoint", "gauss2", "gauss4", "gauss6"),
    *("radau-iia2", "radau-iia3", "rodas4"),
)
"""For any field."""
AUTO, ALL = "auto", "all"


class Candidate(NamedTuple):
    """A method with its name, and the solver for its implicit stages; see `integrators.stepper`."""

    name: str
    method: Method
    solver: str = "fixed-point"
    evaluations: int | None = None  # of f in a step, where the number is fixed


def candidates(scene: Scene, methods: Methods = AUTO) -> tuple[list[Candidate], dict[str, str]]:
    """The methods of a selection that fit a scene, and the reasons why others do not, by name; see `work_precision`.

    ``"all"`` are those of the catalogue without parameters, of families those with few stages.
    """
    left_out = dict[str, str]()
    found = []
    for name, given in _named(scene, methods).items():
        try:
            found.append(candidate(scene, given))
        except IntegratorError as error:
            left_out[name] = str(error)
    if not found:
        reason = next(iter(left_out.values()), "")
        raise IntegratorError(f"methods must have one that fits {scene.name}, but had none: {shorten(reason, 200)}")
    return found, {} if methods == AUTO else left_out  # default methods were not requested by name


def candidate(scene: Scene, given: Method | str) -> Candidate:
    """A method, or the name of one, as a candidate for a scene."""
    found = Candidate(given, method(given)) if isinstance(given, str) else Candidate(given.name, given)
    stepper(found.method, scene, solver=found.solver)
    return found._replace(evaluations=evaluations(found.method, scene))


def evaluations(method: Method, scene: Scene) -> int | None:
    """How often a step evaluates f, in the block of variables where it does so most often.

    What the step before has evaluated is not counted again. None where steps iterate, or where derivatives or exact
    flows are computed, too.

    Example:
        >>> import bseries as bs
        >>> [evaluations(bs.method(name), bs.scene("kepler")) for name in ("rk4", "leapfrog", "RK45", "gauss2")]
        [4, 1, 6, None]
    """
    work = plan(Nodes(method, Structure(scene, method_pieces(method, scene, None)))).computed
    calls = [call for call in work if isinstance(call, Call) and call.node.kind == "field"]
    counts = Counter(block for call in calls for block in call.blocks)
    return max(counts.values(), default=0) if len(calls) == len(work) else None


def _named(scene: Scene, methods: Methods) -> dict[str, Method | str]:
    """Methods by name, checked."""
    if methods == AUTO:  # those known to be efficient on scenes of this structure
        for names, typical in ((NYSTROM, "rkn-verlet"), (SPLIT, "strang")):
            with suppress(IntegratorError):
                stepper(typical, scene)
                return {name: name for name in names}
        return {name: name for name in WHOLE}
    if methods == ALL:
        entries = (entry for entry in catalogue() if entry.is_family or not entry.parameters)
        # More than eight stages are not more accurate in double precision.
        stages = ((e.name, range(e.least_stages, 9) if e.is_family else [""]) for e in entries)
        return {f"{name}{s}": f"{name}{s}" for name, numbers in stages for s in numbers}
    found: dict[str, Method | str] = {}
    for given in [methods] if isinstance(methods, str) or not isinstance(methods, Iterable) else methods:
        name = given if isinstance(given, str) else check_method(given).name
        if isinstance(given, str):
            method(given)  # refuses unknown names
        if found.setdefault(name, given) != given:
            raise IntegratorError(f"methods must have different names, but two are called {name}")
    if not found:
        raise IntegratorError("methods must name at least one method, but named none")
    return found


DEGREE = 16
"""Degree of the interpolation: about as many points as doubles have digits."""
INTERVALS = 64, 256, 1024, 4096
"""Numbers of intervals tried: with the last one there are 70,000 points."""
PRECISION = 2e-14
"""Relative tolerance of the interpolation, besides rounded times: a hundred times the unit roundoff, for 17 terms."""


class DenseReference:
    """A reference solution as a function of time, from y0 at time 0, with a relative error of `allowed` or of doubles.

    `size` is the largest Euclidean norm of the state.

    Raises:
        IntegratorError: The solution ends early, or is not accurate enough over the span.
    """

    def __init__(self, scene: Scene, y0: np.ndarray, span: float, allowed: float = 0.0):
        self._scene, self._y0, self._span = scene, y0, span
        allowed = max(allowed, PRECISION)
        for intervals in INTERVALS:
            uncertainty, error, rounding = self._sample(intervals)
            if uncertainty <= allowed + rounding and error <= PRECISION + rounding + uncertainty:
                return
            if uncertainty > allowed:
                break
        raise IntegratorError(
            f"span must be shorter for a reference solution of {scene.name} with errors up to {allowed:.0e}, "
            f"but was {span:g}"
        )

    def _sample(self, intervals: int) -> tuple[float, float, float]:
        """Interpolate the solution in intervals; its error, that of the interpolation, and the effect of rounded times.

        The solution is computed at the nodes and, for the error, at a point between the middle two of them.
        """
        nodes = -np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
        between = (nodes[DEGREE // 2] + nodes[DEGREE // 2 + 1]) / 2
        places = np.insert(nodes[1:], DEGREE // 2, between)
        width = self._span / intervals
        times = ((np.arange(intervals)[:, None] + (1 + places) / 2) * width).ravel()
        if self._scene.black_boxes:  # halved steps, as there are no formulas for Taylor series
            found = settled_solution(self._scene, times, y0=self._y0)
        else:
            found = reference_solution(self._scene, times, y0=self._y0, full=True)
        values = found.high.reshape(len(self._y0), intervals, DEGREE + 1)
        starts = np.concatenate([np.asarray(self._y0)[:, None], values[:, :-1, -1]], axis=1)
        at_nodes = np.concatenate([starts[:, :, None], np.delete(values, DEGREE // 2, axis=2)], axis=2)
        self._coefficients = at_nodes @ np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, DEGREE)).T
        self.size = largest_size(without_time(self._scene, at_nodes.reshape(len(self._y0), -1)))
        interpolated = self((np.arange(intervals) + (1 + between) / 2) * width)
        error = float(np.linalg.norm(interpolated - values[:, :, DEGREE // 2], axis=0).max()) / self.size
        uncertainty = float(np.linalg.norm(found.error, axis=0).max()) / self.size
        speed = np.linalg.norm(np.diff(values.reshape(len(self._y0), -1)), axis=0) / np.diff(times)
        rounding = 2.0**-52 * self._span * float(speed.max()) / self.size
        return uncertainty, error if math.isfinite(error) else math.inf, rounding

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """The solution at times from 0 to the span, (variables, times)."""
        intervals = self._coefficients.shape[1]
        scaled = np.asarray(times, dtype=float) * (intervals / self._span)
        at = np.clip(scaled.astype(int), 0, intervals - 1)
        basis = np.polynomial.chebyshev.chebvander(2 * (scaled - at) - 1, DEGREE)
        return np.einsum("vtk,tk->vt", self._coefficients[:, at], basis)


Swept = list[tuple[int, "RunErrors"]]

UNSOLVED = "did not converge"
LEAST_SECONDS = 5e-9
"""Lower bound for the time of a step, some additions, which ends the sweeps of methods that always fail."""
Point = TypeVar("Point", bound=tuple)
"""An error, the CPU seconds for it, and further entries."""


class SweepLimits(NamedTuple):
    """Which steps a sweep takes, and when it ends."""

    first_step: float = 4.0
    """The first step size, as a multiple of `time_scale`: methods of many stages allow steps of that size."""
    steep: float = 30.0
    """If halving the step reduces the error by a larger factor, further steps are divided by √2, so that there are two
    or three rows for each power of ten."""
    gain: float = 1.2
    """Factor that a step has to reduce an error below `ROUNDING` by: methods of order 1 reduce it by √2."""
    patience: int = 2
    """Steps without this gain after which the sweep ends: one may be without it by chance."""
    stiff: float = 1e-4
    """If the largest step with convergent stages has a smaller error, the step is limited by the solver, not by
    accuracy: otherwise the first steps of a sweep have no correct digit."""


SWEEP = SweepLimits()


class RunErrors(NamedTuple):
    """The errors of a run; None for those not measured."""

    solution: float | None = None  # the largest distance from the reference, relative to the largest norm of the state
    energy: float | None = None  # the largest |H − H(y₀)|, relative to |H(y₀)| unless that is zero up to rounding
    seconds: float = 0.0  # CPU time of the run with its observations
    failure: str | None = None  # the reason why the run ended early

    def error(self, measure: str) -> float | None:
        """The error by the name of its measure, one of `MEASURES`; None as well if the run failed."""
        return None if self.failure else getattr(self, measure)


class Judge:
    """Measurement of errors, some of `MEASURES`: runs of methods on a scene from its start over one span.

    `reference` is the reference solution, accurate to the precision of doubles or a hundredth of the smallest error of
    interest `finest`, if the solution is measured and has one; `problem` says why there is none.
    """

    def __init__(self, scene: Scene, span: float, measures: tuple[str, ...] = MEASURES, finest: float = 0.0):
        self.scene, self.span, self.measures = scene, span, measures
        self.reference: DenseReference | None = None
        self.problem = ""
        if SOLUTION in measures:
            try:
                self.reference = DenseReference(scene, scene.y0, span, finest / 100)
            except IntegratorError as error:
                self.problem = str(error)

    @property
    def available(self) -> tuple[str, ...]:
        """The errors that can be measured on this scene."""
        has_energy, has_solution = self.scene.is_hamiltonian, self.reference is not None
        return tuple(m for m in self.measures if (has_solution if m == SOLUTION else has_energy))

    def run(self, candidate: Candidate, steps: int) -> RunErrors:
        """Run a method with a number of steps and measure its errors."""
        began = thread_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # reported as a failure instead
                run = integrate(
                    candidate.method,
                    self.scene,
                    h=self.span / steps,
                    steps=steps,
                    solver=candidate.solver,
                    save_every=max(1, steps // 400),  # over the default span about 13 in each period
                    observe=ENERGY if self.scene.is_hamiltonian else None,
                    observe_every=max(1, steps // 4000),  # errors have narrow peaks, as at a perihelion
                )
        except StepError as error:
            reason = UNSOLVED if UNSOLVED in str(error) else "did not end in finite numbers"
            return RunErrors(seconds=thread_time() - began, failure=f"step {error.step} of {steps} {reason}")
        seconds = thread_time() - began
        solution = energy = None
        with np.errstate(over="ignore", invalid="ignore"):
            if self.reference is not None:
                states, exact = (without_time(self.scene, found) for found in (run.y, self.reference(run.t)))
                solution = float(relative_distances(states, exact, self.reference.size).max())
            if ENERGY in run.observed:
                energy = relative_change(run.observed[ENERGY], energy_size(self.scene, self.scene.y0))
        if not all(math.isfinite(error) for error in (solution, energy) if error is not None):
            return RunErrors(seconds=seconds, failure="its errors were not finite")
        return RunErrors(solution, energy, seconds)

    def work(self, candidate: Candidate, steps: int) -> Work:
        """The steps of a run, for timing."""
        options = {"solver": candidate.solver}
        return Work(self.scene, candidate.method, self.span / steps, options=options, most_steps=steps)


class Row(NamedTuple):
    """One step size of a method."""

    h: float
    steps: int  # over the span
    cost: Timing | None  # of a step; None if the run failed
    errors: RunErrors

    @property
    def seconds(self) -> float | None:
        """CPU seconds for all steps, without observations."""
        return None if self.cost is None else self.cost.seconds * self.steps


class Curve(NamedTuple):
    """The rows of one method, from large to small steps."""

    candidate: Candidate
    rows: tuple[Row, ...]

    def front(self, measure: str) -> list[tuple[float, float]]:
        """Errors and seconds on the Pareto front of the rows, from the cheapest to the most precise."""
        errors = ((row.seconds, row.errors.error(measure)) for row in self.rows)
        return pareto_front(
            (max(error, 2.0**-60), seconds)  # an error of 0 has no logarithm; all others are larger
            for seconds, error in errors
            if seconds and error is not None
        )

    def seconds(self, error: float, measure: str = SOLUTION) -> float | None:
        """CPU seconds over the span for an error, interpolated between rows; None if no row reaches it."""
        return seconds_at(self.front(measure), error)

    def counted(self) -> Curve:
        """The curve with evaluations of f in place of CPU seconds; without rows where their number is not known."""
        count = self.candidate.evaluations
        rows = (row._replace(cost=row.cost and replace(row.cost, seconds=float(count or 0))) for row in self.rows)
        return self._replace(rows=tuple(rows) if count else ())

    def sizes(self, measure: str) -> dict[int, float]:
        """The errors of the rows by number of steps, infinite where runs failed."""
        errors = ((row.steps, row.errors.error(measure)) for row in self.rows)
        return {steps: math.inf if error is None else error for steps, error in errors}


def pareto_front(points: Iterable[Point]) -> list[Point]:
    """The Pareto front of points in error and time, from the fastest to the most precise.

    Example:
        >>> pareto_front([(1e-3, 1.0), (1e-2, 2.0), (1e-6, 4.0), (1e-5, 8.0)])
        [(0.001, 1.0), (1e-06, 4.0)]
    """
    kept: list[Point] = []
    for point in sorted(points, key=lambda point: (point[1], point[0])):
        if not kept or point[0] < kept[-1][0]:
            kept.append(point)
    return kept


def seconds_at(front: Sequence[tuple], error: float) -> float | None:
    """CPU seconds for an error, interpolated linearly between the logarithms of a front's points.

    Errors above the front give its least time, errors below it None.

    Example:
        >>> front = [(1e-2, 1.0), (1e-6, 4.0)]
        >>> round(seconds_at(front, 1e-4), 12), seconds_at(front, 1.0), seconds_at(front, 1e-9)
        (2.0, 1.0, None)
    """
    if not front or error < front[-1][0]:
        return None
    after = next(k for k, point in enumerate(front) if point[0] <= error)
    if after == 0:
        return front[0][1]
    (rough, fast), (fine, slow) = front[after - 1][:2], front[after][:2]
    return fast * (slow / fast) ** (math.log(rough / error) / math.log(rough / fine))


def time_scale(scene: Scene) -> float:
    """|y|/|f(y)| at the start; 1/|f| if y is 0, and 1 in an equilibrium.

    Near an equilibrium f is small and not representative: ten times |f|/|f'f| is a bound.

    Example:
        >>> import bseries as bs
        >>> time_scale(bs.scene("linear")), round(time_scale(bs.scene("pendulum").with_start(p=[0], q=["pi"])), 3)
        (1.0, 10.0)
    """
    f, y = right_hand_side(scene), scene.y0
    here, size = f(0.0, y), float(np.linalg.norm(y)) or 1.0
    speed = float(np.linalg.norm(here))
    if not speed:
        return 1.0
    nudge = 1e-6 * size  # the increment for f'f
    rate = float(np.linalg.norm(f(0.0, y + nudge / speed * here) - here)) / nudge
    return min(size / speed, 10 / rate) if rate > 0 else size / speed


def sweep(judge: Judge, candidate: Candidate, finest: float, budget: float) -> tuple[Candidate, Swept]:
    """Numbers of steps and errors of one method, from large steps to small ones.

    Stages are found by fixed-point iteration. If that and not accuracy limits the step, the scene is stiff for the
    method, and the sweep is repeated with Newton's method as an alternative.
    """
    swept = _sweep(judge, candidate, finest, budget)
    first = next((errors.error(judge.available[0]) for _, errors in swept if errors.failure is None), 0.0)
    if any(UNSOLVED in (errors.failure or "") for _, errors in swept) and first is not None and first < SWEEP.stiff:
        candidate = candidate._replace(solver="auto")
        return candidate, _sweep(judge, candidate, finest, budget)
    return candidate, swept


def _sweep(judge: Judge, candidate: Candidate, finest: float, budget: float) -> Swept:
    """Runs with decreasing steps until the error is below `finest`, no longer falls, or the budget is spent."""
    measure = judge.available[0]
    steps = max(1, math.ceil(judge.span / (SWEEP.first_step * time_scale(judge.scene))))
    found: Swept = []
    best, idle, factor = math.inf, 0, 2.0  # the least error, steps without gain, and the factor to the next step
    while True:
        errors = judge.run(candidate, steps)
        found.append((steps, errors))
        error = errors.error(measure)
        if error is not None:
            idle = idle + 1 if error > best / SWEEP.gain and best < ROUNDING else 0
            factor = math.sqrt(2) if error * SWEEP.steep < best < math.inf else factor
            best = min(best, error)
            if error < finest or idle >= SWEEP.patience:
                break
        following = max(steps + 1, round(steps * factor))
        per_step = errors.seconds / steps if errors.failure is None and len(found) > 1 else LEAST_SECONDS
        too_long = errors.seconds > budget and len(found) > 1  # the first run compiles
        if too_long or max(per_step, LEAST_SECONDS) * following > budget:
            break
        steps = following
    return found


def timed_curves(judge: Judge, swept: Sequence[tuple[Candidate, Swept]]) -> list[Curve]:
    """The curves of several sweeps, timed in interleaved rounds.

    Iterated steps are timed for each step size, others in the longest run: their cost does not depend on the step size.
    """
    timed, work = list[dict[int, str]](), dict[str, Work]()
    for candidate, rows in swept:
        counts = [steps for steps, errors in rows if errors.failure is None]
        iterates = stepper(candidate.method, judge.scene, solver=candidate.solver).iterates
        chosen = {steps: steps if iterates else counts[-1] for steps in counts}
        timed.append({steps: f"{candidate.name} {n}" for steps, n in chosen.items()})
        work |= {f"{candidate.name} {n}": judge.work(candidate, n) for n in chosen.values()}
    costs = step_costs(work, sample=0.004)  # shorter than elsewhere, since many rows are timed
    return [
        Curve(candidate, tuple(Row(judge.span / n, n, costs.get(keys.get(n, "")), e) for n, e in rows))
        for (candidate, rows), keys in zip(swept, timed, strict=True)
    ]
