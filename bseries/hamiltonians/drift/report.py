"""Report of `energy_drift`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exceptions import SeriesError
from bseries.hamiltonians.drift.orbits import LINEAR, SQUARE_ROOT, UNDECIDED, RateStatistics
from bseries.scene_text import place
from foundation.diagrams import axis_label, draw_band, draw_legend, write_title
from foundation.plotting import BLACK, SKY, drawing
from foundation.table import Column, Table, as_frame, as_html, as_text, latex_text
from integrators.core.errors import shorten
from integrators.scenes.scene import latex_formula

if TYPE_CHECKING:
    import sympy
    from matplotlib.axes import Axes

    from bseries.hamiltonians.drift.orbits import Orbit
    from bseries.hamiltonians.drift.perturbations import PeriodGain, Perturbation, Violation
    from bseries.hamiltonians.modified_hamiltonian import ModifiedHamiltonian
    from integrators.runs.trajectory import Trajectory
    from trees.tree import Tree

LONGEST_FORMULA = 300
MODIFIED = "the modified equation of "
LEADING_DIGITS = 2
"""Digits shown of values that are known to leading order in h."""


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

        def latex(fact: _Fact) -> str:
            value = fact[1]
            return latex_text(value) if isinstance(value, str) else f"${latex_formula(value, scene)}$"

        def data() -> dict[str, Any]:
            slope = _slope(self)
            return self.to_dict() | ({} if slope is None else {"h": self.h, "slope": str(slope)})

        what, facts = Column("what"), list(_facts(self))
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


def shown_number(value: Any, digits: int = 10) -> str | sympy.Expr:
    """A number to some digits; formulas of parameters as they are."""
    return value if getattr(value, "free_symbols", None) else f"{float(value):.{digits}g}"


_Fact = tuple[str, "str | sympy.Expr"]


def _facts(report: DriftReport) -> Iterator[_Fact]:
    """The rows of the table: text, or formulas."""
    yield "verdict", report.verdict
    yield "reason", report.reason
    if report.breaks is not None:
        names = report.perturbation.field.series.names
        yield "not Hamiltonian for every H, by", report.breaks.text(names if len(names) > 1 else None)
    if report.power is not None:
        yield "not Hamiltonian on this scene at", f"h^{report.power}"
        if report.perturbation.twin is not None:
            yield "but for a perturbation of", report.perturbation.twin.name
        if report.perturbation.has_formulas and report.rate is not None:
            yield f"dH~/dt at h^{report.power}", report.rate
    for turn in report.turns:
        how = "" if turn.digits is None else f", by quadrature to {turn.digits} digits"
        yield f"gain of the energy at h^{report.power} in a period {turn.period} of {turn.variable}{how}", turn.gain
    if report.orbit is not None:
        yield f"orbit through {list(report.orbit.y0)}", f"{report.orbit.kind}, period {float(report.orbit.period):.10g}"
    for k, mean in report.means:
        yield f"mean of dH~/dt at h^{k}", shown_number(mean)
    for k, s in report.statistics:
        yield f"mean of dH~/dt at h^{k}", f"{s.mean:.4g} ± {s.error:.2g} over t = {s.time:.6g}: {s.kind}"
        yield "variance of its integral over t", f"2 D t with D = {s.diffusion:.4g} ± {s.diffusion_error:.2g}"
    slope = _slope(report, LEADING_DIGITS)
    if slope is not None:
        yield f"leading slope of the energy at h = {report.h:g}", slope
    if report.h is not None and report.spread is not None:
        coefficient = shown_number(report.deviation(1.0), LEADING_DIGITS)
        yield f"deviation of the energy after t, h = {report.h:g}", f"{coefficient}*sqrt(t)"


def _slope(report: DriftReport, digits: int = 10) -> str | sympy.Expr | None:
    """The predicted slope of the energy, to leading order; None where there is none."""
    if report.h is None or report.drift is None:
        return None
    power, mean = report.drift
    return shown_number(mean * report.h**power, digits)
