"""Energy drift of a method on a scene: violations of the Hamiltonian structure, and the mean rates that they cause."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import sympy

from bseries.algebra.bseries import BSeries
from bseries.analysis.order import order_of
from bseries.exceptions import SeriesError
from bseries.fields.inputs import check_smooth
from bseries.hamiltonians.from_trees import energy_trees
from bseries.hamiltonians.modified_hamiltonian import ModifiedHamiltonian
from bseries.hamiltonians.orbits import Orbit, closed_orbit
from bseries.hamiltonians.perturbations import PeriodGain, Perturbation, Violation, angle_periods, violations
from bseries.scene_text import place
from foundation.diagrams import axis_label, draw_band, draw_legend, write_title
from foundation.plotting import BLACK, SKY, drawing
from foundation.table import Column, Table, as_frame, as_html, as_text, latex_text
from integrators.core.arguments import read_steps
from integrators.core.errors import shorten
from integrators.exact.arguments import read_number, read_vector
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.scene import Scene, latex_formula

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from integrators.runs.trajectory import Trajectory
    from trees.tree import Tree

BOUNDED, LINEAR, SQUARE_ROOT, UNDECIDED = "bounded", "linear drift", "square-root drift", "undecided"
BLOCKS = 32  # number of blocks of a trajectory for the standard error
HALVINGS = 4  # number of times that blocks are halved, for the growth of the variance with time
SIGNIFICANT = 4.0  # number of standard errors that is significant
MOST_OF_ALL = 0.7  # largest part of a block in the sum of squares of a stationary rate
STEEPEST = 1.5
"""Largest growth exponent of variances (2 for a linear drift); above it correlations are longer than blocks."""
STEPS = 100_000
CHUNK = 8192  # number of states of a trajectory in memory at a time
REASONS = {
    LINEAR: "the mean of dH~/dt along the trajectory is not zero",
    SQUARE_ROOT: "the mean of dH~/dt along the trajectory is zero within its error, but its integral spreads",
    UNDECIDED: "the trajectory is too short, or its energy is lost: dH~/dt is not stationary",
    BOUNDED: "along the trajectory no drift is seen: the mean of dH~/dt is zero within its error",
}
LONGEST_FORMULA = 300
MODIFIED = "the modified equation of "
LEADING_DIGITS = 2  # digits shown of values that are known to leading order in h


class RateStatistics(NamedTuple):
    """Statistics of a rate r sampled along a trajectory, and of its integral W(t) = ∫ r dt.

    Over times that are longer than correlations last, W has the mean m t and the variance c + 2 D t: c comes from the
    part of r that is a derivative of a bounded function, and D from what is left.
    """

    time: float  # the length of the trajectory
    mean: float  # m
    error: float  # its standard error, from the longest blocks
    diffusion: float  # D, from the variances of blocks of several lengths
    diffusion_error: float
    growth: float  # the exponent γ of the power t^γ that fits the variances of blocks
    largest: float  # the largest part of a block in the sum of squares of all: near 1, the rate is not stationary

    @property
    def kind(self) -> str:
        """``"linear drift"``, ``"square-root drift"``, ``"bounded"`` or ``"undecided"``.

        A rate is bounded if neither drift is significant within this time, and undecided if it is not stationary, as
        when a trajectory leaves its energy, or has correlations longer than the blocks.
        """
        if self.largest > MOST_OF_ALL or self.growth > STEEPEST:
            return UNDECIDED
        if abs(self.mean) > SIGNIFICANT * self.error:
            return LINEAR
        return SQUARE_ROOT if self.diffusion > SIGNIFICANT * self.diffusion_error else BOUNDED


def rate_statistics(rates: np.ndarray, dt: float) -> RateStatistics:
    """The statistics of a rate at equidistant times, from averages over blocks.

    References:
        H. Flyvbjerg, H. G. Petersen, J. Chem. Phys. 91 (1989) 461–466, doi:10.1063/1.457480.
    """
    least = BLOCKS * 2**HALVINGS
    if len(rates) < least:
        raise SeriesError(f"rates must be {least} or more to tell drifts apart, but were {len(rates)}")
    if not np.isfinite(rates).all():
        raise SeriesError("rates must be finite, but one was not")
    length = len(rates) // least
    used = rates[: least * length]
    mean, gains = float(used.mean()), ((used - used.mean()) * dt).reshape(-1, length).sum(axis=1)
    times = length * dt * 2.0 ** np.arange(HALVINGS + 1)
    variances = np.array([gains.reshape(-1, 2**k).sum(axis=1).var(ddof=1) for k in range(HALVINGS + 1)])
    error = float(np.sqrt(variances[-1] / BLOCKS) / times[-1])
    squares = gains.reshape(BLOCKS, -1).sum(axis=1) ** 2
    largest = float(squares.max() / squares.sum()) if squares.any() else 0.0
    growth = diffusion = diffusion_error = 0.0
    if variances.all():
        growth = float(np.polyfit(np.log(times), np.log(variances), 1)[0])
        # c + 2 D t, with the relative errors of the variances of so many blocks
        weights = 1 / (variances * np.sqrt(2 * times / (BLOCKS * times[-1])))
        fitted, covariance = np.polyfit(2 * times, variances, 1, w=weights, cov="unscaled")
        diffusion, diffusion_error = float(fitted[0]), float(np.sqrt(covariance[0, 0]))
    return RateStatistics(len(used) * dt, mean, error, diffusion, diffusion_error, growth, largest)


class DriftReport(NamedTuple):
    """Whether the energy, or a globally defined modified Hamiltonian H̃, drifts, and how fast.

    Attributes:
        perturbation: The non-Hamiltonian part of the modified field, with its formulas `terms(k)` and `rate(k)`.
        h: The step size, if one was given.
        verdict: ``"bounded"``, ``"linear drift"``, ``"square-root drift"``, or ``"undecided"`` if data is missing.
        reason: The reason in a sentence.
        breaks: The first tree for which the modified field is not Hamiltonian for every H.
        broken: The first power of h at which it is not Hamiltonian on this scene.
        orbit: The orbit, with one degree of freedom.
        means: The mean rates along this orbit, by power of h.
        statistics: The statistics of rates along a trajectory, with several degrees of freedom, by power of h.

    Example:
        >>> import bseries as bs
        >>> report = bs.energy_drift(bs.method("rk4"), bs.scene("pendulum"), y0=[2.5, 0], h=0.1)
        >>> report.verdict, report.power, f"{report.slope():.1e}"
        ('linear drift', 5, '-3.6e-07')
    """

    perturbation: Perturbation
    h: float | None
    verdict: str
    reason: str
    breaks: Tree | None = None
    broken: Violation | None = None
    orbit: Orbit | None = None
    means: tuple[tuple[int, Any], ...] = ()
    statistics: tuple[tuple[int, RateStatistics], ...] = ()

    @property
    def power(self) -> int | None:
        """The first power of h at which the modified field is not Hamiltonian; None if there is none."""
        return None if self.broken is None else self.broken.power

    @property
    def turns(self) -> tuple[PeriodGain, ...]:
        """The energy gained per period of each angle, at h^power."""
        return () if self.broken is None else self.broken.turns

    @property
    def rate(self) -> sympy.Expr | None:
        """The formula of dH̃/dt at h^power."""
        return None if self.power is None else self.perturbation.rate(self.power)

    @property
    def hamiltonian(self) -> ModifiedHamiltonian:
        """H̃ up to the violation: that of the symplectic form, or the terms before h^power.

        Raises:
            SeriesError: It has no formula.
        """
        return self.perturbation.hamiltonian(self.power)

    @property
    def drift(self) -> tuple[int, Any] | None:
        """The power of h and its coefficient in the mean of dH̃/dt; None if no drift is predicted."""
        means = self.means or [(k, s.mean) for k, s in self.statistics if s.kind == LINEAR]
        return next(((k, mean) for k, mean in means if mean), None)

    @property
    def spread(self) -> tuple[int, float] | None:
        """The power k of h and D in the variance h^2k · 2 D t of a random walk; None if there is none."""
        found = ((k, s.diffusion) for k, s in self.statistics if s.kind == SQUARE_ROOT)
        return next(found, None)

    def slope(self, h: float | None = None) -> float:
        """The predicted slope of the energy error to leading order in h, by default for the given step size.

        Raises:
            SeriesError: There is no step size, or the slope depends on the orbit.
        """
        h = self.h if h is None else h
        if h is None:
            raise SeriesError("h must be given for a slope, but was not")
        if self.drift is not None:
            power, mean = self.drift
            if getattr(mean, "free_symbols", None):
                raise SeriesError(f"parameters must be numbers for a slope, but the mean rate is {mean!s:.60}")
            return float(mean) * h**power
        if self.verdict == UNDECIDED or (self.verdict == LINEAR and self.orbit is None):
            raise SeriesError(f"y0 must be given for a slope, but the verdict is about all orbits: {self.reason}")
        return 0.0

    def deviation(self, t: float, h: float | None = None) -> float:
        """The predicted standard deviation of the energy error of a random walk at a time.

        Raises:
            SeriesError: There is no step size, or no random walk.
        """
        h = self.h if h is None else h
        if h is None or self.spread is None:
            raise SeriesError(f"verdict must be {SQUARE_ROOT} for a deviation, and h given, but it is {self.verdict}")
        power, diffusion = self.spread
        return abs(h) ** power * (2 * diffusion * abs(t)) ** 0.5

    def plot(self, ax: Axes | None = None, *, run: Trajectory) -> Axes:
        """The energy error of a run against its prediction: the mean slope, and ± two deviations of a random walk.

        The energy also oscillates, by an amount that does not grow and that the prediction leaves out.

        Args:
            ax: The axes, which are returned; None for those of a new figure.
            run: A run of the method on the scene, which observes the energy.

        Raises:
            SeriesError: The run does not observe the energy, there is no prediction for this orbit, or `ax` is no axes.
            ImportError: matplotlib is not installed.

        Example:
            >>> import bseries as bs
            >>> scene, start = bs.scene("pendulum"), {"y0": [2.5, 0], "h": 0.2}
            >>> run = bs.integrate("rk4", scene, steps=5000, observe="energy", **start)
            >>> axes = bs.energy_drift("rk4", scene, **start).plot(run=run)
            >>> [line.get_label() for line in axes.lines]
            ['measured', 'predicted']
        """
        energies = getattr(run, "observed", {}).get("energy")
        if energies is None:
            raise SeriesError(f"run must be a trajectory that observes the energy, but was {run!r:.60}")
        t, h = run.observed_t - run.observed_t[0], run.h
        slope = self.slope(h)
        with drawing(ax, SeriesError) as axes:
            axes.plot(run.observed_t, energies - energies[0], color=SKY, linewidth=1.0, label="measured")
            axes.plot(run.observed_t, slope * t, color=BLACK, linestyle="--", label="predicted")
            if self.spread is not None:
                deviation = 2 * self.deviation(1.0, h) * abs(t) ** 0.5
                draw_band(axes, run.observed_t, slope * t - deviation, slope * t + deviation, "± 2 deviations")
            draw_legend(axes)
            method = self.perturbation.field.label.removeprefix(MODIFIED)
            about = f"{place(method, self.perturbation.scene)}, h = {h:g}: {self.verdict}"
            write_title(axes, f"{about}, slope {shown_number(slope, LEADING_DIGITS)}" if slope else about)
            axes.set(xlabel=axis_label("t"), ylabel=axis_label("energy", change=True))
        return axes

    def to_dict(self) -> dict[str, Any]:
        """The report as plain data."""
        r = self.perturbation
        data: dict[str, Any] = {
            "schema": 1,
            "kind": "drift",
            "series": r.field.label,
            "scene": r.scene.name,
            "effects": list(r.scene.active),
            "order": r.field.order,
            "verdict": self.verdict,
            "reason": self.reason,
            "breaks": None if self.breaks is None else self.breaks.text(r.field.series.names or None),
            "power": self.power,
        }
        if self.power is not None:
            data["symplectic_form"] = None if r.twin is None else r.twin.name
            if r.has_formulas:
                data["perturbation"] = [str(formula) for formula in r.terms(self.power)]
                data["rate"] = str(self.rate)
            data["turns"] = [
                {**turn._asdict(), "period": str(turn.period), "gain": str(turn.gain)} for turn in self.turns
            ]
        if self.orbit is not None:
            data["orbit"] = {"y0": list(self.orbit.y0), "kind": self.orbit.kind, "period": float(self.orbit.period)}
            data["means"] = [{"power": k, "mean": str(shown_number(mean))} for k, mean in self.means]
        if self.statistics:
            data["statistics"] = [{"power": k, **s._asdict()} for k, s in self.statistics]
        if self.drift is not None:
            data["drift"] = {"power": self.drift[0], "coefficient": str(shown_number(self.drift[1]))}
        return data

    def to_table(self, effects: Sequence[str] | None = None) -> Table:
        """The report as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            effects: Effects for the title; by default those that are on.
        """
        field, scene = self.perturbation.field, self.perturbation.scene

        def latex(fact: tuple[str, str | sympy.Expr]) -> str:
            value = fact[1]
            return latex_text(value) if isinstance(value, str) else f"${latex_formula(value, scene)}$"

        def data() -> dict[str, Any]:
            slope = self._shown_slope()
            return self.to_dict() | ({} if slope is None else {"h": self.h, "slope": str(slope)})

        what, facts = Column("what"), list(self._facts())
        method = field.label.removeprefix(MODIFIED)
        return Table(
            f"Energy of {place(method, scene, effects)}: {self.verdict}",
            [what, Column("value", get=lambda fact: shorten(str(fact[1]), LONGEST_FORMULA), latex=latex)],
            facts,
            [f"Looked at through h^{field.order - 1}."],
            data=data,
            records=Table("", [what, Column("value")], facts),
        )

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame

    def __repr__(self) -> str:
        return f"<DriftReport of {self.perturbation.field.label}: {self.verdict}>"

    def _facts(self) -> Iterator[tuple[str, str | sympy.Expr]]:
        """The rows of the table."""
        r, h = self.perturbation, self.h
        yield "verdict", self.verdict
        yield "reason", self.reason
        if self.breaks is not None:
            names = r.field.series.names
            yield "not Hamiltonian for every H, by", self.breaks.text(names if len(names) > 1 else None)
        if self.power is not None:
            yield "not Hamiltonian on this scene at", f"h^{self.power}"
            if r.twin is not None:
                yield "but for a perturbation of", r.twin.name
            if r.has_formulas and self.rate is not None:
                yield f"dH~/dt at h^{self.power}", self.rate
        for turn in self.turns:
            how = "" if turn.digits is None else f", by quadrature to {turn.digits} digits"
            yield f"gain of the energy at h^{self.power} in a period {turn.period} of {turn.variable}{how}", turn.gain
        if self.orbit is not None:
            yield f"orbit through {list(self.orbit.y0)}", f"{self.orbit.kind}, period {float(self.orbit.period):.10g}"
        for k, mean in self.means:
            yield f"mean of dH~/dt at h^{k}", shown_number(mean)
        for k, s in self.statistics:
            yield f"mean of dH~/dt at h^{k}", f"{s.mean:.4g} ± {s.error:.2g} over t = {s.time:.6g}: {s.kind}"
            yield "variance of its integral over t", f"2 D t with D = {s.diffusion:.4g} ± {s.diffusion_error:.2g}"
        slope = self._shown_slope(LEADING_DIGITS)
        if slope is not None:
            yield f"leading slope of the energy at h = {h:g}", slope
        if h is not None and self.spread is not None:
            coefficient = shown_number(self.deviation(1.0), LEADING_DIGITS)
            yield f"deviation of the energy after t, h = {h:g}", f"{coefficient}*sqrt(t)"

    def _shown_slope(self, digits: int = 10) -> str | sympy.Expr | None:
        """The predicted slope of the energy, to leading order; None where there is none."""
        if self.h is None or self.drift is None:
            return None
        power, mean = self.drift
        return shown_number(mean * self.h**power, digits)


def shown_number(value: Any, digits: int = 10) -> str | sympy.Expr:
    """A number to some digits; formulas of parameters as they are."""
    return value if getattr(value, "free_symbols", None) else f"{float(value):.{digits}g}"


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

    With one degree of freedom and a closed one-form B^(−1) r, the energy gained per period of an angle decides for all
    orbits. If the form is not closed, the mean is taken along the orbit of y' = f(y) through `y0`, power by power. With
    several degrees of freedom it is taken along `steps` steps of the method, and compared with its standard error; the
    variance of the integral distinguishes a random walk, whose correlations decay, from bounded oscillations.

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
        >>> report = bs.energy_drift(bs.method("simplified-takahashi-imada"), asymmetric, y0=[2.5, 0], h=0.2)
        >>> print(report.verdict, report.turns[0].gain, f"{report.slope():.4g}")
        linear drift -pi/240 -6.543e-06
        >>> bs.energy_drift(bs.method("stormer-verlet"), asymmetric).verdict
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
        order = max(7, order_of_method + 3) if order is None else order
    steps = read_steps(steps, "steps", BLOCKS * 2**HALVINGS)
    size = None if h is None else read_number(h, "h")
    if size == 0:
        raise SeriesError("h must be a number other than 0, but was 0")
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
    if scene.dimension == 2 and broken.is_closed and y0 is None:
        elsewhere = f"nothing before h^{broken.order} on orbits that do not go round"
        return report._replace(verdict=LINEAR, reason=f"the energy gains {_gains(broken)}, and {elsewhere}")
    start = None if scene.start is None else scene.y0.tolist()
    if y0 is not None:
        start = read_vector(y0, "y0", scene.dimension).tolist()
    if scene.dimension == 2:
        return _on_one_orbit(report, chain([broken], later), order_of_method, start)
    powers = range(broken.power, min(broken.power + order_of_method, r.field.order))
    return _along_trajectory(report, powers, method, start, steps, parts)


def _gains(broken: Violation) -> str:
    gains = (f"{turn.gain} h^{broken.power} in every forward period of {turn.variable}" for turn in broken.turns)
    return " and ".join(gains)


def _on_one_orbit(
    report: DriftReport, found: Iterable[Violation], order: int, start: list[float] | None
) -> DriftReport:
    """The verdict with one degree of freedom on the orbit through a point: the first nonzero mean rate."""
    r, last = report.perturbation, report.perturbation.field.order - 1
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
    report: DriftReport, powers: Iterable[int], method: Method | BSeries, start: Any, steps: int, parts: Any
) -> DriftReport:
    """The verdict with several degrees of freedom, from the rates along a trajectory of the method."""
    from integrators import integrate

    r, h = report.perturbation, report.h
    if start is None or h is None or isinstance(method, BSeries):
        reason = "mean rates are taken along a trajectory: a method, a step size and a start must be given"
        return report._replace(verdict=UNDECIDED, reason=reason)
    powers = list(filter(r.has_terms, powers))
    pieces = []
    for made in range(0, steps, CHUNK):
        y = integrate(method, r.scene, h=h, steps=min(CHUNK, steps - made), y0=start, parts=parts).y
        pieces.append([r.rates(y[:, :-1], k) for k in powers])
        start = y[:, -1]
    found: list[tuple[int, RateStatistics]] = []
    for k, row in zip(powers, np.hstack(pieces), strict=True):
        found.append((k, rate_statistics(row, abs(h))))
        if found[-1][1].kind in (LINEAR, UNDECIDED):
            break
    last = found[-1][1].kind
    walks = any(statistics.kind == SQUARE_ROOT for _, statistics in found)
    verdict = SQUARE_ROOT if walks and last == BOUNDED else last
    return report._replace(verdict=verdict, reason=REASONS[verdict], statistics=tuple(found))
