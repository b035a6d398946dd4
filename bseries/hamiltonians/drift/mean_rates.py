"""Energy drift of a method on a scene: violations of the Hamiltonian structure, and the mean rates that they cause."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np

from bseries.algebra.bseries import BSeries
from bseries.analysis.order import order_of
from bseries.exceptions import SeriesError
from bseries.fields.symbolic.generators import check_smooth
from bseries.hamiltonians.drift.orbits import (
    BLOCKS,
    BOUNDED,
    HALVINGS,
    LINEAR,
    SQUARE_ROOT,
    UNDECIDED,
    Orbit,
    RateStatistics,
    closed_orbit,
    rate_statistics,
)
from bseries.hamiltonians.drift.perturbations import Perturbation, Violation, angle_periods, violations
from bseries.hamiltonians.drift.report import DriftReport
from bseries.hamiltonians.from_trees import energy_trees
from integrators.core.arguments import read_steps
from integrators.exact.arguments import read_number, read_vector
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.scene import Scene

STEPS = 100_000
CHUNK = 8192
"""Number of states of a trajectory in memory at a time."""
REASONS = {
    LINEAR: "the mean of dH~/dt along the trajectory is not zero",
    SQUARE_ROOT: "the mean of dH~/dt along the trajectory is zero within its error, but its integral spreads",
    UNDECIDED: "the trajectory is too short, or its energy is lost: dH~/dt is not stationary",
    BOUNDED: "along the trajectory no drift is seen: the mean of dH~/dt is zero within its error",
}


def energy_drift(
    method: Method | BSeries | str,
    scene: Scene | str,
    order: int | None = None,
    *,
    y0: Any = None,
    h: float | None = None,
    steps: int = STEPS,
    parts: Any = None,
) -> DriftReport:
    """Whether the energy error of a method on a scene stays bounded, drifts linearly, or like a random walk.

    Formally the method follows y' = B ∇H̃ + r, and r begins with the first power h^K at which the modified field is not
    the field of a globally defined function. To leading order H̃ changes at the rate ∇H · r, whose mean decides.
    "Bounded" means that there is no drift through the powers of h examined.

    With one degree of freedom there are three cases. If the one-form B^(−1) r is closed, it is the differential of a
    function, unless variables are angles: then the energy gained per period, minus the integral of the form over a
    period, decides for all orbits (for the simplified Takahashi–Imada method it is −h⁴α²/2 ∫U‴U′² dq). If it is not
    closed, the mean is taken along the orbit of y' = f(y) through `y0`, power by power. With several degrees of freedom
    it is taken along `steps` steps of the method, and compared with its standard error. A zero mean alone does not make
    a random walk: the variance of the integral distinguishes one, whose correlations decay, from bounded oscillations.

    Args:
        method: A method, or a modified field.
        scene: The scene, with a Hamiltonian.
        order: The largest number of nodes N: powers h^0 … h^(N−1); by default three more than the order of the method,
            and at least 7; for a series its own.
        y0: The start. With one degree of freedom and a closed form None gives a verdict about all orbits; otherwise it
            means the start of the scene.
        h: The step size, for predicted slopes; needed with several degrees of freedom.
        steps: The length of the trajectory with several degrees of freedom.
        parts: As for `modified_field`.

    Raises:
        SeriesError: The scene has no Hamiltonian, or `h` is 0.
        IntegratorError: A step failed, or `y0`, `h` or `steps` does not fit.

    Example:
        >>> import bseries as bs
        >>> asymmetric = bs.scene("pendulum", effects=["asymmetry"])
        >>> report = energy_drift(bs.method("simplified-takahashi-imada"), asymmetric, y0=[2.5, 0], h=0.2)
        >>> print(report.verdict, report.turns[0].gain, f"{report.slope():.4g}")
        linear drift -pi/240 -6.543e-06
        >>> energy_drift(bs.method("stormer-verlet"), asymmetric).verdict
        'bounded'

    References:
        E. Hairer, R. I. McLachlan, R. D. Skeel, ESAIM: M2AN 43 (2009) 631–644, doi:10.1051/m2an/2009019;
        E. Faou, E. Hairer, T.-L. Pham, BIT 44 (2004) 699–709; E. Hairer, lecture on long-time behaviour, section 4.
    """
    method = as_method(method)
    scene = as_scene(scene)
    for summand in scene.summands:
        check_smooth(summand.formula)
    if isinstance(method, BSeries):
        beyond = (tree.order - 1 for tree, value in method.items() if tree.order > 1 and value)
        order_of_method = next(beyond, method.order)
    else:
        order_of_method = order_of(method)
    steps = read_steps(steps, "steps", BLOCKS * 2**HALVINGS)
    size = None if h is None else read_number(h, "h")
    if size == 0:
        raise SeriesError("h must be a number other than 0, but was 0")
    if order is None and not isinstance(method, BSeries):
        order = max(7, order_of_method + 3)
    r = Perturbation(method, scene, order, parts=parts)
    far = f"through h^{r.field.order - 1}"
    report = DriftReport(r, size, BOUNDED, f"the modified field is Hamiltonian {far}, for all H of this form")
    least = order_of_method
    if scene.poisson is None:
        found = energy_trees(method, scene, r.field.order, parts).verdict
        if found.breaks is None:
            return report
        report, least = report._replace(breaks=found.breaks), found.order
    later = violations(r, least)
    broken = next(later, None)
    if broken is None:
        return report._replace(reason=f"on this scene the modified field is Hamiltonian {far}, and globally so")
    report = report._replace(broken=broken)
    if scene.dimension == 2:
        if broken.is_closed and y0 is None:
            elsewhere = f"nothing before h^{broken.order} on orbits that do not go round"
            return report._replace(verdict=LINEAR, reason=f"the energy gains {_gains(broken)}, and {elsewhere}")
        return _on_one_orbit(report, chain([broken], later), order_of_method, y0)
    powers = range(broken.power, min(broken.power + order_of_method, r.field.order))
    return _along_trajectory(report, powers, method, y0, steps, parts)


def _start(scene: Scene, y0: Any) -> list[float] | None:
    """A start as floats: `y0`, or that of the scene if it has one."""
    if y0 is not None:
        return read_vector(y0, "y0", scene.dimension).tolist()
    return None if scene.start is None else scene.y0.tolist()


def _gains(broken: Violation) -> str:
    gains = (f"{turn.gain} h^{broken.power} in every forward period of {turn.variable}" for turn in broken.turns)
    return " and ".join(gains)


def _on_one_orbit(report: DriftReport, found: Iterable[Violation], order: int, y0: Any) -> DriftReport:
    """The verdict with one degree of freedom on the orbit through y0: the first nonzero mean rate."""
    r, last = report.perturbation, report.perturbation.field.order - 1
    start = _start(r.scene, y0)
    if start is None:
        return report._replace(verdict=UNDECIDED, reason="the mean rate depends on the orbit: y0 must be given")
    orbit, means = closed_orbit(r.scene, start, angle_periods(r.scene)), list[tuple[int, Any]]()
    for broken in found:
        if not broken.is_closed:
            last = min(broken.power + order - 1, last)
        for k, mean in _means(r, broken, orbit, last):
            means.append((k, mean))
            if mean:
                size = f"the mean of dH~/dt along the orbit is of order h^{k}"
                reason = f"the energy gains {_gains(broken)}" if broken.is_closed else size
                return report._replace(verdict=LINEAR, reason=reason, orbit=orbit, means=tuple(means))
    reason = f"the mean of dH~/dt along the orbit vanishes through h^{last}"
    if report.broken is not None and report.turns:
        reason += f"; the energy gains {_gains(report.broken)}, but the orbit completes no period"
    return report._replace(reason=reason, orbit=orbit, means=tuple(means))


def _means(r: Perturbation, broken: Violation, orbit: Orbit, last: int) -> Iterator[tuple[int, Any]]:
    """Mean rates along an orbit due to a violation: at its power, and if the form is not closed up to a last power."""
    if broken.is_closed:
        gain = sum(turn.gain * orbit.revolutions[r.scene.places[turn.variable]] for turn in broken.turns)
        yield broken.power, gain / orbit.period if gain else 0
    else:
        for k in filter(r.has_terms, range(broken.power, last + 1)):
            yield k, orbit.mean(r.rate(k)) if orbit.period else 0


def _along_trajectory(
    report: DriftReport, powers: Sequence[int], method: Method | BSeries, y0: Any, steps: int, parts: Any
) -> DriftReport:
    """The verdict with several degrees of freedom, from the rates along a trajectory of the method."""
    r, h = report.perturbation, report.h
    start = _start(r.scene, y0)
    if start is None or h is None or isinstance(method, BSeries):
        reason = "mean rates are taken along a trajectory: a method, a step size and a start must be given"
        return report._replace(verdict=UNDECIDED, reason=reason)
    powers = list(filter(r.has_terms, powers))
    rates = _rates(r, powers, method, start, h, steps, parts)
    found: list[tuple[int, RateStatistics]] = []
    for k, row in zip(powers, rates, strict=True):
        found.append((k, rate_statistics(row, abs(h))))
        if found[-1][1].kind in (LINEAR, UNDECIDED):
            break
    last = found[-1][1].kind
    walks = any(statistics.kind == SQUARE_ROOT for _, statistics in found)
    verdict = SQUARE_ROOT if walks and last == BOUNDED else last
    return report._replace(verdict=verdict, reason=REASONS[verdict], statistics=tuple(found))


def _rates(
    r: Perturbation, powers: Sequence[int], method: Method, state: Any, h: float, steps: int, parts: Any
) -> np.ndarray:
    """The rates by power at every step of a trajectory, computed piece by piece."""
    from integrators import integrate

    pieces = []
    for made in range(0, steps, CHUNK):
        y = integrate(method, r.scene, h=h, steps=min(CHUNK, steps - made), y0=state, parts=parts).y
        pieces.append([r.rates(y[:, :-1], k) for k in powers])
        state = y[:, -1]
    return np.hstack(pieces)
