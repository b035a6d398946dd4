"""Perturbation run: the exact flow over a part of a run, and the first-order effect of the modified equation.

A method follows y' = f(y) + r(y) with a small r = h^p f_{p+1} + … Along the exact flow y(t) the energy changes by
∫ ∇H(y) · r(y) dt, and the solution by e(t) with e' = f'(y) e + r(y). Both integrands are smooth along the orbit, so
trapezoidal sums suffice: r is evaluated at grid points of y(t), all at once. For e a second solution of y' = f(y)
receives at every grid point an impulse proportional to r(y(t)), of such a size that its distance from the first one is
linear in r and well above rounding. A third one receives r(y(t)) itself: if that exceeds rounding, it also shows
nonlinear effects, as next to a separatrix, or of terms whose first-order effects cancel in the long run.
"""

from __future__ import annotations

import math
from functools import cache
from time import thread_time
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.conservation import gradient
from bseries.advice.distances import largest_size, norms, without_time
from bseries.exceptions import SeriesError
from bseries.fields.modified_fields import modified_field
from bseries.fields.truncation import Reach
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    import numpy as np

    from bseries.advice.modified_terms import ModifiedTerms
    from bseries.fields.modified_fields import SceneSeries
    from bseries.fields.truncation import Reach
    from integrators import Scene


CHECKED = 512
"""Number of grid points up to which errors are also computed with fewer terms."""
RESOLUTION = 6
"""Grid points in the time scale τ, τ² = |f|/|f'f'f + f"(f, f)/4|: 1/ω for an oscillator."""
SUBSTEPS = 3
"""Steps of the flow between grid points."""
METHOD = "dop853"
PASSES, AT_ONCE, CONVERGED = 10, 32, 1e-4
"""Iterations for r along the solution that it leads to, points in each, and the relative change that ends them."""
DISTANCE = 1e-9
"""Relative distance to which impulses move the second solution within the time scale."""
FIRST_ORDER, FEWER_TERMS, NONLINEAR = range(3)
"""The perturbed solutions: small multiples of r with all powers, and with one less, and r itself."""
CANCELLED = 2.0**-46
"""Sums that are a smaller part of their terms are 0 up to rounding."""
SECONDS = 4.0
"""CPU time for large scenes; small ones have all grid points in a tenth of that."""
FIRST_BLOCK, MOST_POINTS = 256, 2**14
FINER, COARSER, MOST_REFINEMENTS = 1.5, 4.0, 24
UNIT = 2.0**-53
"""Unit roundoff."""


class PerturbationRun(NamedTuple):
    """Results at n grid points.

    Attributes:
        t: The times since the start.
        y: The states, (variables, n).
        reach: The mean sizes of the terms, and the optimal truncation.
        powers: The powers of h used.
        errors: The errors of the solution to first order in r, (variables, n); the time has none.
        nonlinear: The distance of a solution with the impulses r; nan from where it could not be computed.
        checked: `errors` at the first grid points with one power less, if there are two or more.
        changes: The changes of the energy, (powers, n); None without an energy.
        sizes: The sizes of variables, see `ModifiedTerms.sizes`.
        displacement: The largest distance of the solution with small impulses: errors are linear while it is small.
    """

    t: np.ndarray
    y: np.ndarray
    reach: Reach
    powers: tuple[int, ...]
    errors: np.ndarray
    nonlinear: np.ndarray
    checked: np.ndarray
    changes: np.ndarray | None
    sizes: np.ndarray
    displacement: float

    @property
    def time_scale(self) -> float:
        """The time scale of the field."""
        return RESOLUTION * abs(float(self.t[1]))


def perturbation_run(
    terms: ModifiedTerms, y0: np.ndarray, h: float, span: float, t0: float = 0.0
) -> PerturbationRun | None:
    """Follow the exact flow, with the effects of the modified terms.

    Args:
        terms: The first terms of the modified equation, at least one.
        y0: The start.
        h: The step size.
        span: The length of the run, with the sign of h.
        t0: The time of the start.

    Returns:
        The results over the whole span, or the part that the CPU time allows; None if the span is shorter than the
        time scale and the effect of r is below the rounding of a single step.

    Raises:
        SeriesError: The terms do not decrease from the first one on, are not finite or all 0, or the time scale of f
            becomes shorter and shorter.
        IntegratorError: The solution ends.

    Example:
        >>> import bseries as bs
        >>> from bseries.advice.modified_terms import modified_terms
        >>> pendulum = bs.scene("pendulum")
        >>> found = perturbation_run(modified_terms(bs.method("rk4"), pendulum), pendulum.y0, 0.1, 50.0)
        >>> round(float(found.t[-1]), 9), found.powers, f"{abs(found.changes.sum(axis=0)).max():.0e}"
        (50.0, (4, 5, 6), '4e-06')
    """
    import numpy as np

    total = max(1, math.ceil(span / _spacing(terms, y0, span, t0)))
    first = exact_states(terms.field.scene, y0, span / total, min(FIRST_BLOCK, total), t0)
    reach, size = _reach(terms, first, h), largest_size(without_time(terms.field.scene, first))
    if total <= RESOLUTION and abs(span) * sum(reach.sizes[k] for k in terms.powers) < UNIT * size:
        return None
    flows = _PerturbedFlows(terms, y0, h, span / total, t0, reach, size)
    flows.advance(min(FIRST_BLOCK, total))  # compiles
    began = thread_time()
    while flows.done < min(total, MOST_POINTS) and 2 * (thread_time() - began) < SECONDS:
        flows.advance(min(flows.done, total - flows.done))
    y, errors, nonlinear, rates = (np.concatenate(pieces, axis=-1) for pieces in zip(*flows.pieces, strict=True))
    changes = None
    if rates.size:
        changes = np.zeros(rates.shape)
        changes[:, 1:] = np.cumsum((rates[:, 1:] + rates[:, :-1]) * (flows.spacing / 2), axis=1)
    t = np.linspace(0.0, span * (flows.done / total), flows.done + 1)  # ends exactly with the run
    displacement = float(flows.scale * norms(errors).max())
    checked = np.concatenate(flows.checked, axis=1)
    sizes = terms.sizes(y)
    return PerturbationRun(t, y, reach, flows.powers, errors, nonlinear, checked, changes, sizes, displacement)


def exact_states(scene: Scene, y0: np.ndarray, spacing: float, points: int, t0: float) -> np.ndarray:
    """The exact flow at y0 and the next grid points."""
    from integrators import integrate

    step = spacing / SUBSTEPS
    return integrate(scene, METHOD, h=step, steps=SUBSTEPS * points, save_every=SUBSTEPS, y0=y0, t0=t0).y


@cache
def _impulses() -> Any:
    """Compiled observer that adds an impulse to the state before and after recording it."""
    from numba import types

    from foundation.machine_code import cfunc
    from integrators.compile.machine import DOUBLE, DOUBLES, OPTIONS

    def add(t: Any, y: Any, row: Any) -> None:
        """Read the number of variables and the impulse from a row, and write the state between into it.

        Solvers without memory from step to step allow the state to be changed.
        """
        for i in range(int(row[0])):
            impulse = row[i + 1]
            row[i + 1] = y[i] + impulse
            y[i] = row[i + 1] + impulse

    return cfunc(types.void(DOUBLE, DOUBLES, DOUBLES), **OPTIONS)(add)


class _PerturbedFlows:
    """The exact flow and the solutions with impulses, advanced block by block."""

    def __init__(
        self, terms: ModifiedTerms, y0: np.ndarray, h: float, spacing: float, t0: float, reach: Reach, size: float
    ):
        import numpy as np

        self.spacing, self.done = spacing, 0
        self._terms, self._h, self._t0, self._last = terms, h, t0, y0
        scene = terms.field.scene
        self._stepper, self._gradient = stepper(scene, METHOD), gradient(scene)
        self.powers = _decreasing(reach, terms.powers)
        self.scale = DISTANCE * size / (abs(spacing) * RESOLUTION * sum(reach.sizes[k] for k in self.powers))
        first = y0[:, None]
        values = self._terms_at(first)
        whole, rates = values.sum(axis=0), self._rates(first, values)
        self._scales = self.scale, self.scale, 1.0
        self._states = [self._stepper.start(y0, h=spacing / SUBSTEPS, t0=t0) for _ in self._scales]
        for state, scale, r in zip(self._states, self._scales, (whole, self._fewer(values), whole), strict=True):
            state.values += scale * spacing / 2 * r[:, 0]
        zero = np.zeros_like(first)
        self.pieces, self.checked = [(first, zero, zero, rates)], [zero]

    def _terms_at(self, y: np.ndarray) -> np.ndarray:
        """The terms of r, (powers, variables, n)."""
        import numpy as np

        return self._terms.values(y)[: len(self.powers)] * self._h ** np.array(self.powers)[:, None, None]

    @staticmethod
    def _fewer(values: np.ndarray) -> np.ndarray:
        """r with one power less, if there are two."""
        return values[: max(1, len(values) - 1)].sum(axis=0)

    def _rates(self, y: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The rates of change of the energy by power, (powers, n); none without an energy."""
        import numpy as np

        if self._gradient is None:
            return np.empty((0, y.shape[1]))
        products = self._gradient(y) * values
        rates = products.sum(axis=1)
        rates[abs(rates) <= CANCELLED * abs(products).sum(axis=1)] = 0.0  # where the energy is conserved
        return rates

    def advance(self, points: int) -> None:
        """Follow the flow over more grid points."""
        t = self._t0 + self.done * self.spacing
        y = exact_states(self._terms.field.scene, self._last, self.spacing, points, t)[:, 1:]
        values = self._terms_at(y)
        errors = self._errors(FIRST_ORDER, values.sum(axis=0), y)
        self.pieces.append((y, errors, self._nonlinear(y), self._rates(y, values)))
        if self.done < CHECKED:
            self.checked.append(self._errors(FEWER_TERMS, self._fewer(values), y))
        self._last, self.done = y[:, -1].copy(), self.done + points

    def _nonlinear(self, y: np.ndarray) -> np.ndarray:
        """The distance of the solution with impulses r from the flow; nan where the iteration does not converge.

        r is evaluated along the solution of the previous iteration: along the flow it would be a force with the period
        of the orbit, and the solution, whose period differs, would lock to it.
        """
        import numpy as np

        found = np.full(y.shape, np.nan)
        last = self.pieces[-1][2][:, -1:]
        if not np.isfinite(last).all():
            return found
        for first in range(0, y.shape[1], AT_ONCE):
            here, begin = slice(first, first + AT_ONCE), self._states[NONLINEAR]
            errors = last
            for _ in range(PASSES):
                self._states[NONLINEAR], before = begin.copy(), errors
                errors = self._errors(NONLINEAR, self._terms_at(y[:, here] + errors).sum(axis=0), y[:, here])
                if abs(errors - before).max() <= CONVERGED * abs(errors).max():
                    break
            else:
                break
            found[:, here], last = errors, errors[:, -1:]
        return found

    def _errors(self, which: int, r: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The scaled distance of a perturbed solution from the flow, between the two halves of the impulses."""
        import numpy as np

        state, scale = self._states[which], self._scales[which]
        rows, first = np.empty((y.shape[1], len(y) + 1)), state.n
        rows[:, 0], rows[:, 1:] = len(y), scale * self.spacing / 2 * r.T
        steps = SUBSTEPS * len(rows)
        try:
            self._stepper.record(state, steps, o_every=SUBSTEPS, observer=_impulses().address, o_rows=rows)
        except StepError:
            if which != NONLINEAR:
                raise
            rows[(state.n - first) // SUBSTEPS :, 1:] = np.nan  # the perturbed solution may end earlier
        return (rows[:, 1:].T - y) / scale


def _decreasing(reach: Reach, powers: tuple[int, ...]) -> tuple[int, ...]:
    """The powers of h whose terms decrease; two if there are, since a single one has no error estimate."""
    found = tuple(k for k in powers if k <= reach.optimal_power)
    if len(found) < min(2, len(powers)):
        before, power = [(0, *powers)[len(found) + i] for i in (0, 1)]
        if reach.sizes[power]:
            raise SeriesError(
                f"h must be small enough for the terms of the modified equation to shrink, but was {reach.h:g}, where "
                f"the one with h^{power} is {reach.sizes[power] / reach.sizes[before]:.1g} times that with h^{before}"
            )
    return found


def _spacing(terms: ModifiedTerms, y0: np.ndarray, span: float, t0: float) -> float:
    """The distance of grid points: a part of the time scale along the beginning of the orbit."""
    from integrators import method

    field, whole = modified_field(method("explicit-euler"), terms.field.scene, 3), abs(span)
    spacing, was_reduced = min(whole, _time_scale(field, y0[:, None], all_terms=True) / RESOLUTION), False
    for _ in range(MOST_REFINEMENTS):
        points = min(FIRST_BLOCK, math.ceil(whole / spacing))
        states = exact_states(field.scene, y0, math.copysign(spacing, span), points, t0)
        wanted = _time_scale(field, states) / RESOLUTION
        if spacing > FINER * wanted:
            spacing, was_reduced = wanted, True
        elif was_reduced or wanted < COARSER * spacing or points < FIRST_BLOCK:
            return math.copysign(spacing, span)
        else:
            spacing *= COARSER
    raise SeriesError("scene must have a field that does not turn ever faster, but along this solution it does")


def _time_scale(field: SceneSeries, y: np.ndarray, all_terms: bool = False) -> float:
    """The least τ of some points, from f and f'f'f/3 + f"(f, f)/12, the terms of the explicit Euler method."""
    import numpy as np

    f, once, twice = (norms(term) for term in field.terms(y))
    least = np.sqrt(f[twice > 0] / (3 * twice[twice > 0])).min(initial=math.inf)
    return float((f[once > 0] / (2 * once[once > 0])).min(initial=least) if all_terms else least)


def _reach(terms: ModifiedTerms, y: np.ndarray, h: float) -> Reach:
    """The mean sizes of the terms at some states."""
    import numpy as np

    sizes, each = np.zeros(terms.field.order), np.array([norms(values) for values in terms.values(y)])
    sizes[0] = norms(terms.field.terms(y)[0]).mean()
    sizes[list(terms.powers)] = each.mean(axis=1)
    if not np.isfinite(sizes).all():
        raise SeriesError("y0 must be where terms of the modified equation are finite, but there are some that are not")
    if not sizes[list(terms.powers)].any():
        raise SeriesError("y0 must be where the modified equation has terms besides f, but there all vanish")
    if len(each) > 1:
        first, second = each[:2, each[0].argmax()]
        ratio = second / first * np.float64(abs(h)) ** (terms.powers[1] - terms.powers[0])
        if ratio > 1:
            raise SeriesError(
                f"h must be small enough for the terms of the modified equation to shrink where they are largest, but "
                f"was {h:g}, where the one with h^{terms.powers[1]} is {ratio:.1g} times that with h^{terms.powers[0]}"
            )
    return Reach(f"{terms.field.label} on {terms.field.scene.name}", h, tuple(sizes.tolist()))
