"""Measured errors of runs: of the solution, the energy and the modified energy, observed many times."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from functools import cached_property, lru_cache
from time import thread_time
from typing import TYPE_CHECKING, NamedTuple

from bseries.advice.conservation import may_drift
from bseries.advice.distances import energy_size, relative_distances, without_time
from bseries.advice.growth import EVEN, size_of_states_after
from bseries.advice.measures import ENERGY, MEASURES, MODIFIED_ENERGY, SOLUTION
from bseries.advice.modified_terms import modified_terms
from bseries.advice.work_precision.dense_reference import DenseReference
from bseries.advice.work_precision.step_costs import Work
from bseries.analysis.order import order_of
from bseries.exceptions import SeriesError
from bseries.hamiltonians.modified_hamiltonian import modified_hamiltonian
from integrators.core.errors import IntegratorError
from integrators.methods.catalogue.registry import catalogue
from integrators.methods.catalogue.registry import method as named
from integrators.runs.integration import integrate
from integrators.steppers.states import StepError

if TYPE_CHECKING:
    import numpy as np

    from bseries.advice.work_precision.candidates import Candidate
    from bseries.hamiltonians.modified_hamiltonian import ModifiedHamiltonian
    from integrators.methods.program.program import Method
    from integrators.runs.trajectory import Trajectory
    from integrators.scenes.scene import Scene

UNSOLVED = "did not converge"
OBSERVATIONS = 400
"""Number of observations of the solution and the modified energy."""
ENERGY_OBSERVATIONS = 4000
ORDERS = {2: 5, 4: 7, 6: 7}
"""The order of the modified Hamiltonian by that of the method; with more terms compilation would dominate."""
MOST_ORDER = 7


class RunErrors(NamedTuple):
    """The errors of a run; None for those not measured.

    Attributes:
        solution: The largest distance from the reference solution, relative to the largest norm of the state.
        energy: The largest |H − H(y₀)|, relative to |H(y₀)| unless that is zero up to rounding.
        modified_energy: The same for the truncated modified Hamiltonian.
        modified_order: The number of its terms with the least change.
        courses: By measure, at equidistant times from 0 on: the relative distances from the reference, and the
            relative changes of the energies.
        seconds: CPU time of the run with its observations.
        failure: The reason why the run ended early; None if it did not.
    """

    solution: float | None = None
    energy: float | None = None
    modified_energy: float | None = None
    modified_order: int | None = None
    courses: Mapping[str, np.ndarray] = {}
    seconds: float = 0.0
    failure: str | None = None

    def error(self, measure: str) -> float | None:
        """The error by the name of its measure, one of `MEASURES`; None as well if the run failed."""
        return None if self.failure else getattr(self, measure.replace("-", "_"))

    @property
    def is_unsolved(self) -> bool:
        """Whether the run failed since stages could not be solved for."""
        return self.failure is not None and UNSOLVED in self.failure


class Judge:
    """Measurement of errors: runs of methods on a scene from its start over one span.

    Args:
        scene: The scene.
        span: The length of runs.
        measures: The errors to measure, of `MEASURES`.

    Attributes:
        reference: The reference solution; None if the solution is not measured or has no reference.
        problem: The reason why there is none.

    Example:
        >>> import bseries as bs
        >>> from bseries.advice.work_precision.candidates import candidate
        >>> pendulum = bs.scene("pendulum")
        >>> judge = Judge(pendulum, 10.0, ("solution", "energy"))
        >>> found = judge.run(candidate(pendulum, "stormer-verlet"), 100)
        >>> f"{found.solution:.1e} {found.energy:.1e}"
        '3.1e-03 2.8e-02'
    """

    def __init__(self, scene: Scene, span: float, measures: tuple[str, ...] = MEASURES):
        self.scene, self.span, self.measures = scene, span, measures
        self.y0 = scene.y0
        self.reference: DenseReference | None = None
        self.problem: str | None = None
        if SOLUTION in measures:
            try:
                self.reference = DenseReference(scene, self.y0, span)
            except IntegratorError as error:
                self.problem = str(error)

    @property
    def available(self) -> tuple[str, ...]:
        """The errors that can be measured on this scene."""
        has_energy, has_solution = self.scene.is_hamiltonian, self.reference is not None
        return tuple(m for m in self.measures if (has_solution if m == SOLUTION else has_energy))

    @cached_property
    def _energy_size(self) -> float:
        return energy_size(self.scene, self.y0)

    def run(self, candidate: Candidate, steps: int) -> RunErrors:
        """Run a method with a number of steps and measure its errors."""
        h, began = self.span / steps, thread_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # reported as a failure instead
                run = self._run(candidate, h, steps)
        except StepError as error:
            reason = UNSOLVED if UNSOLVED in str(error) else "did not end in finite numbers"
            return RunErrors(seconds=thread_time() - began, failure=f"step {error.step} of {steps} {reason}")
        seconds = thread_time() - began
        values, y = run.observed.get("energy"), run.y[: self.scene.dimension]
        courses: dict[str, np.ndarray] = {}
        order = None
        if self.reference is not None:
            courses[SOLUTION] = self._distances(run.t, y, self.reference)
        if values is not None:
            courses[ENERGY] = (values - values[0]) / self._energy_size
            modified, order = self._modified(candidate, y, h)
            courses |= {} if modified is None else {MODIFIED_ENERGY: modified}
        largest = {measure: float(abs(course).max()) for measure, course in courses.items()}
        if not all(math.isfinite(error) for error in largest.values()):
            return RunErrors(seconds=seconds, failure="its errors were not finite")
        observations = {ENERGY: ENERGY_OBSERVATIONS}
        kept = {
            m: course[: 1 + steps // _every(steps, observations.get(m, OBSERVATIONS))] for m, course in courses.items()
        }
        solution, energy, modified_energy = (largest.get(measure) for measure in MEASURES)
        return RunErrors(solution, energy, modified_energy, order, kept, seconds)

    def drifts(self, candidate: Candidate, steps: int) -> bool:
        """Whether the energy may drift in runs of a method, by the first terms of the modified equation.

        It may if these cannot be computed. A modifying integrator drifts if its basic method does, since the modified
        and the modifying equation have the same structure.
        """
        import numpy as np

        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")  # terms that are not finite are not Hamiltonian
                terms = modified_terms(candidate.method, self.scene)
                y = self._run(candidate, self.span / steps, steps).y[: self.scene.dimension]
                return may_drift(terms, y)
        except (SeriesError, IntegratorError):
            return True

    def growth(self, times: float) -> float | None:
        """The factor by which the solution grows in a multiple of the span; None if unknown."""
        import numpy as np

        if self.reference is None:
            return None
        y = without_time(self.scene, self.reference(np.linspace(0.0, self.span, OBSERVATIONS + 1)))
        later, now = (size_of_states_after(y, factor) for factor in (times, 1.0))
        return later.value / now.value if later.disagreement <= EVEN else None

    def states(self, candidate: Candidate, steps: int) -> np.ndarray:
        """The states (variables, n) of a run at equidistant times, without the time."""
        work, every = self.work(candidate, steps), _every(steps, OBSERVATIONS)
        run = integrate(work.scene, work.method, h=work.h, steps=steps, y0=work.y0, save_every=every, **work.options)
        return without_time(self.scene, run.y[: self.scene.dimension, : 1 + steps // every])

    def _run(self, candidate: Candidate, h: float, steps: int) -> Trajectory:
        return integrate(
            candidate.scene,
            candidate.method,
            h=h,
            steps=steps,
            y0=candidate.start(self.y0, h),
            solver=candidate.solver,
            save_every=_every(steps, OBSERVATIONS),
            observe="energy" if self.scene.is_hamiltonian else None,
            observe_every=_every(steps, ENERGY_OBSERVATIONS),
        )

    def work(self, candidate: Candidate, steps: int) -> Work:
        """The steps of a run, for timing."""
        h = self.span / steps
        y0, options = candidate.start(self.y0, h), {"solver": candidate.solver}
        return Work(candidate.scene, candidate.method, h, y0, options, steps)

    def _distances(self, t: np.ndarray, y: np.ndarray, reference: DenseReference) -> np.ndarray:
        """Relative distances of the solution from the reference."""
        import numpy as np

        with np.errstate(over="ignore", invalid="ignore"):
            states, exact = (without_time(self.scene, found) for found in (y, reference(t)))
            return relative_distances(states, exact, reference.size)

    def _modified(self, candidate: Candidate, y: np.ndarray, h: float) -> tuple[np.ndarray | None, int | None]:
        """The changes of the modified energy with the best number of terms, and this number."""
        import numpy as np

        energy = self.modified_energy(candidate)
        if energy is None:
            return None, None
        with np.errstate(over="ignore", invalid="ignore"):
            terms = energy.terms(y) * h ** np.arange(energy.order)[:, None]
            sums = np.cumsum(terms, axis=0)
            changes = (sums - sums[:, :1]) / self._energy_size
            largest = abs(changes).max(axis=1)
        if not np.isfinite(largest).any():
            return None, None
        best = int(np.nanargmin(largest))
        return changes[best], best + 1

    def modified_energy(self, candidate: Candidate) -> ModifiedHamiltonian | None:
        """The modified Hamiltonian of a method; None if it has none that compiles quickly."""
        if MODIFIED_ENERGY not in self.available or candidate.is_modifying:
            return None
        return _modified_energy(candidate)


def _every(steps: int, observations: int) -> int:
    """The number of steps between observations."""
    return max(1, steps // observations)


@lru_cache(maxsize=64)
def _modified_energy(candidate: Candidate) -> ModifiedHamiltonian | None:
    order = ORDERS.get(_order(candidate.method))
    try:
        return None if order is None else modified_hamiltonian(candidate.method, candidate.scene, order)
    except (SeriesError, IntegratorError):
        return None


def _order(method: Method) -> int:
    """The order of a method up to `MOST_ORDER`; that of the catalogue if it has one, as decimals are slow to check."""
    claims = {entry.name: entry.order for entry in catalogue() if isinstance(entry.order, int)}
    claim = claims.get(method.name)
    return claim if claim and named(method.name) == method else order_of(method, MOST_ORDER)
