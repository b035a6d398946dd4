"""Energy drift of a method on a scene: where its modified field is not Hamiltonian, and what the energy gains then."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import sympy

from bseries.algebra.bseries import BSeries
from bseries.analysis.order import order_of
from bseries.exceptions import SeriesError
from bseries.fields.inputs import MpNumber, Point, check_smooth
from bseries.hamiltonians.drift_evidence import Evidence, run_evidence
from bseries.hamiltonians.drift_statistics import (
    BOUNDED,
    LEAST_VALUES,
    LINEAR,
    SQUARE_ROOT,
    UNDECIDED,
    UNSEEN,
    DriftStatistics,
)
from bseries.hamiltonians.from_trees import energy_trees
from bseries.hamiltonians.modified_hamiltonian import ModifiedHamiltonian
from bseries.hamiltonians.orbits import Orbit, closed_orbit
from bseries.hamiltonians.perturbations import PeriodGain, Perturbation, Violation, angle_periods, violations
from bseries.scene_text import place
from bseries_base.diagrams import axis_label, draw_band, draw_legend, of_line
from bseries_base.errors import shorten
from bseries_base.plotting import BLACK, SKY, drawing
from bseries_base.table import Column, Table, as_frame, as_html, as_text, latex_text
from integrators.core.arguments import read_steps
from integrators.exact.arguments import read_number, read_vector
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.runs.titles import write_title
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene, latex_formula

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from integrators.runs.trajectory import Trajectory
    from trees.tree import Tree

Mean: TypeAlias = "sympy.Expr | MpNumber"

STEPS = 100_000
LONGEST_FORMULA = 300
MODIFIED = "the modified equation of "
LEADING_DIGITS = 2  # digits shown of values that are known to leading order in h


class DriftReport(NamedTuple):
    """Whether the energy, or a globally defined modified Hamiltonian H̃, drifts, and how fast.

    Attributes:
        perturbation: The non-Hamiltonian part of the modified field, with its formulas `terms(k)` and `rate(k)`.
        h: The step size, if one was given.
        verdict: ``"bounded"``, ``"linear drift"``, ``"square-root drift"``, ``"unsteady drift"``, ``"no drift seen"``
            if there is no evidence for any of these, or ``"undecided"`` if data is missing.
        reason: The reason in a sentence.
        breaks: The first tree for which the modified field is not Hamiltonian for every H.
        broken: The first power of h at which it is not Hamiltonian on this scene.
        orbit: The orbit, with one degree of freedom.
        means: The mean rates along this orbit, by power of h.
        evidence: What a run shows, where one was needed.

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
    means: tuple[tuple[int, Mean], ...] = ()
    evidence: Evidence | None = None

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
    def statistics(self) -> tuple[tuple[int, DriftStatistics], ...]:
        """The statistics of the integrals of rates along a run, with several degrees of freedom, by power of h."""
        return () if self.evidence is None else self.evidence.rates

    @property
    def drift(self) -> tuple[int, Mean] | None:
        """The power of h and its coefficient in the mean of dH̃/dt; None if no drift is predicted.

        Along a run it is the power that contributes most.
        """
        if self.evidence is None:
            return next(((k, mean) for k, mean in self.means if mean), None)
        row = self._largest(LINEAR, lambda s: abs(s.mean))
        return None if row is None else (row[0], row[1].mean)

    @property
    def spread(self) -> tuple[int, float] | None:
        """The power k of h and D in the variance h^2k · 2 D t of a predicted random walk; None if there is none."""
        row = self._largest(SQUARE_ROOT, lambda s: s.diffusion**0.5)
        return None if row is None else (row[0], row[1].diffusion)

    def _largest(self, kind: str, size: Callable[[DriftStatistics], float]) -> tuple[int, DriftStatistics] | None:
        """The power of h that contributes most, if the verdict is of a kind, and predicted."""
        found = self.evidence
        if found is None or self.verdict != kind or not found.is_predicted:
            return None
        return max(found.rates, key=lambda row: abs(found.h) ** row[0] * size(row[1]))

    def slope(self, h: float | None = None) -> float:
        """The predicted slope of the energy error to leading order in h, by default for the given step size.

        Raises:
            SeriesError: There is no step size, the slope depends on the orbit, or a drift is not predicted.
        """
        h = self.h if h is None else h
        if h is None:
            raise SeriesError("h must be given for a slope, but was not")
        if self.drift is not None:
            power, mean = self.drift
            if getattr(mean, "free_symbols", None):
                raise SeriesError(f"parameters must be numbers for a slope, but the mean rate is {mean!s:.60}")
            return float(mean) * h**power
        if self.verdict in (BOUNDED, SQUARE_ROOT, UNSEEN):
            return 0.0
        if self.verdict == LINEAR and self.evidence is None:
            raise SeriesError(f"y0 must be given for a slope, but the verdict is about all orbits: {self.reason}")
        raise SeriesError(f"verdict must be one with a slope, but was {self.verdict}: {self.reason}")

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

    def plot(self, ax: Axes | None = None, *, run: Trajectory, **style: Any) -> Axes:
        """The energy error of a run against its prediction.

        That is the mean slope of a linear drift, ± two deviations of a random walk, or else the range in which the
        leading term of the modified equation, such as −h²H₃, lets the energy oscillate.

        Args:
            ax: The axes, which are returned; None for pyplot's current or new ones.
            run: A run of the method on the scene, which observes the energy.
            **style: Properties of the line of the run, such as ``color`` and ``lw``.

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
        slope = self.slope(h) if self.drift is not None else 0.0
        with drawing(ax, SeriesError) as axes:
            usual = of_line(style, color=SKY, linewidth=1.0, label="measured")
            axes.plot(run.observed_t, energies - energies[0], **usual)
            if slope:
                axes.plot(run.observed_t, slope * t, color=BLACK, linestyle="--", label="predicted")
            elif self.spread is not None:
                deviation = 2 * self.deviation(1.0, h) * abs(t) ** 0.5
                draw_band(axes, run.observed_t, -deviation, deviation, "± 2 deviations")
            elif (found := self.evidence) is not None and found.leading is not None and found.band is not None:
                scale = (h / found.h) ** found.leading.power
                for end, label in zip(found.band, (f"range of {found.leading.formula}", None), strict=True):
                    axes.axhline(scale * end, color=BLACK, linestyle="--", linewidth=0.8, label=label)
            draw_legend(axes)
            method = self.perturbation.field.label.removeprefix(MODIFIED)
            about = f"{place(method, self.perturbation.scene)}, h = {h:g}: {self._verdict()}"
            write_title(axes, f"{about}, slope {shown_number(slope, LEADING_DIGITS)}" if slope else about)
            axes.set(xlabel=axis_label("t"), ylabel=axis_label("energy", change=True))
        return axes

    def _verdict(self) -> str:
        """The verdict with what it is about: the time, or the amplitude and the power of h."""
        found = self.evidence
        if found is None or found.energy is None or self.verdict not in (BOUNDED, UNSEEN):
            return self.verdict
        if self.verdict == UNSEEN:
            return f"{UNSEEN} over t = {found.time:.6g}"
        if found.leading is None or found.energy.low == found.energy.high:
            return f"{BOUNDED}, by rounding errors"
        return f"{BOUNDED}, amplitude {found.energy.amplitude:.2g}, of order h^{found.leading.power}"

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
        if self.evidence is not None:
            data["statistics"] = [{"power": k, **s._asdict()} for k, s in self.statistics]
            data["run"] = self.evidence.to_dict()
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
            f"Energy of {place(method, scene, effects)}: {self._verdict()}",
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
        yield "verdict", self._verdict()
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
            yield f"mean of dH~/dt at h^{k}", f"{s.mean:.4g} ± {s.error:.2g} over t = {s.time:.6g}"
            if self.spread is not None:
                yield "variance of its integral over t", f"2 D t with D = {s.diffusion:.4g} ± {s.diffusion_error:.2g}"
        if self.evidence is not None:
            yield from self.evidence.facts()
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


def shown_number(value: Mean, digits: int = 10) -> str | sympy.Expr:
    """A number to some digits; formulas of parameters as they are."""
    return value if getattr(value, "free_symbols", None) else f"{float(value):.{digits}g}"


def energy_drift(
    method: Method | BSeries | str,
    scene: Scene | str,
    order: int | None = None,
    *,
    y0: Point | None = None,
    h: float | None = None,
    steps: int = STEPS,
    parts: Parts | None = None,
) -> DriftReport:
    """Whether the energy error of a method on a scene stays bounded, drifts linearly, or like a random walk.

    Formally the method follows y' = B ∇H̃ + r, and r begins with the first power h^K at which the modified field is not
    the field of a globally defined function. To leading order H̃ changes at the rate ∇H · r, whose mean decides.

    With one degree of freedom and a closed one-form B^(−1) r, the energy gained per period of an angle decides for all
    orbits. If the form is not closed, the mean is taken along the orbit of y' = f(y) through `y0`, power by power. With
    several degrees of freedom it is taken along `steps` steps of the method, and compared with its standard error; the
    slow waves of the integral distinguish a random walk, whose increments are uncorrelated, from bounded oscillations.

    Without a step size, "bounded" is a statement about the series: as h tends to 0, no drift through the powers of h
    examined. With a step size and a start, a run must confirm it: the variance of the energy is saturated, and the
    leading term of the modified equation explains its oscillations. Otherwise the verdict is "no drift seen", or the
    drift of the run.

    Args:
        method: A method, or a modified field.
        scene: The scene, with a Hamiltonian.
        order: The largest number of nodes N: powers h^0 … h^(N−1); by default three more than the order of the method,
            and at least 7; for a series its own.
        y0: The start. With one degree of freedom and a closed form None gives a verdict about all orbits; otherwise it
            means the start of the scene.
        h: The step size, for predicted slopes and for runs; needed with several degrees of freedom.
        steps: The length of the run.
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
    steps = read_steps(steps, "steps", LEAST_VALUES)
    size = None if h is None else read_number(h, "h")
    if size == 0:
        raise SeriesError("h must be a number other than 0, but was 0")
    start = None if scene.start is None else scene.y0.tolist()
    if y0 is not None:
        start = read_vector(y0, "y0", scene.dimension).tolist()
    r = Perturbation(method, scene, order, parts=parts)
    report = _of_the_series(DriftReport(r, size, BOUNDED, ""), method, order_of_method, start, y0 is None, parts)
    has_numbers = not any(getattr(x, "free_symbols", ()) for x in (*scene.parameter_values.values(), *r.field.weights))
    if report.verdict not in (BOUNDED, UNDECIDED) or start is None or size is None or isinstance(method, BSeries):
        return report
    if report.verdict == BOUNDED and not has_numbers:
        return report
    first = r.field.order if report.broken is None or scene.dimension == 2 else report.broken.power
    evidence = run_evidence(
        r, method, start, size, steps, parts, order=order_of_method,
        powers=list(filter(r.has_terms, range(first, min(first + order_of_method, r.field.order)))),
        is_symplectic=report.breaks is None if scene.poisson is None else report.broken is None,
    )  # fmt: skip
    return report._replace(verdict=evidence.kind, reason=evidence.reason, evidence=evidence)


def _of_the_series(
    report: DriftReport,
    method: Method | BSeries,
    order: int,
    start: list[float] | None,
    everywhere: bool,
    parts: Parts | None,
) -> DriftReport:
    """The verdict of the modified equation as h tends to 0: for all orbits, or on the closed orbit through a point."""
    r = report.perturbation
    scene = r.scene
    far = f"through h^{r.field.order - 1}"
    report = report._replace(reason=f"the modified field is Hamiltonian {far}, for all H of this form")
    least = order
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
    if scene.dimension > 2:
        reason = "mean rates are taken along a trajectory: a method, a step size and a start must be given"
        return report._replace(verdict=UNDECIDED, reason=reason)
    if broken.is_closed and everywhere:
        elsewhere = f"nothing before h^{broken.order} on orbits that do not go round"
        return report._replace(verdict=LINEAR, reason=f"the energy gains {_gains(broken)}, and {elsewhere}")
    return _on_one_orbit(report, chain([broken], later), order, start)


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
    orbit, means = closed_orbit(r.scene, start, angle_periods(r.scene)), list[tuple[int, Mean]]()
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


def _means(r: Perturbation, broken: Violation, orbit: Orbit, last: int) -> Iterator[tuple[int, Mean]]:
    """Mean rates along an orbit due to a violation: at its power, and if the form is not closed up to a last power."""
    if broken.is_closed:
        gain = sum(turn.gain * orbit.revolutions[r.scene.places[turn.variable]] for turn in broken.turns)
        yield broken.power, gain / orbit.period if gain else 0
    else:
        for k in filter(r.has_terms, range(broken.power, last + 1)):
            yield k, orbit.mean(r.rate(k)) if orbit.period else 0
