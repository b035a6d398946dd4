"""Report of `effect_influence`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from bseries.advice.timing import Timing
from bseries.table import Column, Table, as_html, listed

MEASURABLE = 0.03
"""Smallest relative difference of two times that can be measured."""


class Influence(NamedTuple):
    """The distance of two runs in the variables that they share.

    Attributes:
        solution: The largest distance of states, relative to the largest norm of the state; infinite if a run failed.
        energy: The largest relative difference of the energy, the Hamiltonian without effects; None if there is none.

    Example:
        >>> import bseries as bs
        >>> report = bs.effect_influence("pendulum", "rk4", h=0.05, span=1, effects="damping")
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
        >>> report = bs.effect_influence("pendulum", "rk4", h=0.05, span=1, effects="damping")
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
        scene: The scene with its effects.
        method: The method.
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
        >>> report = bs.effect_influence("kepler", "rk4", h=0.02, span=6, accept=0.06, effects=["oblateness", "drag"])
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

    @property
    def times(self) -> dict[str, Timing | None]:
        """Seconds per step by active effects."""
        return {"no effects": self.bare, "all": self.full, "the recommended ones": self.kept}

    def __str__(self) -> str:
        lines = [f"{self.method} on {self.scene}: {self.steps:,} steps of {self.h:g}"]
        for row in self.rows:
            cost = "" if row.seconds is None else f"; {row.seconds * 1e9:+.3g} ns a step"
            lines.append(f"  without {row.name}: {_shown(row.left_out)}{cost}")
        return "\n".join([*lines, f"  error of the method: {_shown(self.own_error)}", *self.advice()])

    def advice(self) -> Iterator[str]:
        """The recommendation in sentences."""
        yield from self._recommendation()
        own = getattr(self.own_error, self.measure)
        if not own <= self.accept:
            yield f"The method's own error, {own:.2g}, is more than what is accepted: that takes a smaller step."

    def _recommendation(self) -> Iterator[str]:
        if not self.leave_out:
            least = min(getattr(row.left_out, self.measure) for row in self.rows)
            yield (
                f"Keep all effects: leaving out any of them changes the {self.measure} by {least:.2g} or more, and "
                f"{self.accept:.2g} is accepted, with a margin of {self.margin:g}."
            )
            return
        left_out, kept = ", ".join(self.leave_out), ", ".join(self.keep) or "none"
        accepted = f"{self.accept:.2g} is accepted for the {self.measure}"
        yield f"Leave out {left_out}{self._saving()}; keep {kept}: {accepted}."
        yield (
            f"Promised: the {self.measure} changes by at most {self.promised:.2g}, {self.margin:g} times the sum of "
            f"influences; a run without them: {getattr(self.apart, self.measure):.2g}."
        )

    def _saving(self) -> str:
        """The effect of the recommendation on the time of a step."""
        if abs(self.saved) <= max(MEASURABLE, (self.full.spread + self.kept.spread) / 2):
            return ", which changes the time of a step by less than it varies"
        if self.saved < 0:
            return f", though a step takes {-self.saved:.0%} longer"
        return f", which saves {self.saved:.0%} of a step's time"

    def to_dict(self) -> dict[str, Any]:
        """The report as JSON-ready data."""
        rows = [
            {**row._asdict(), "alone": _numbers(row.alone), "left_out": _numbers(row.left_out)} for row in self.rows
        ]
        times = {"bare": self.bare, "full": self.full, "kept": self.kept}
        return {
            "schema": 1,
            "kind": "effects",
            "method": self.method,
            "scene": self.scene,
            "h": self.h,
            "steps": self.steps,
            "measure": self.measure,
            "accept": self.accept,
            "margin": self.margin,
            "own_error": _numbers(self.own_error),
            "keep": self.keep,
            "leave_out": self.leave_out,
            "promised": self.promised,
            "apart": _numbers(self.apart),
            "seconds_per_step": {name: None if time is None else time._asdict() for name, time in times.items()},
            "rows": rows,
        }

    def to_table(self) -> Table:
        """The report as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON."""
        return _table(self)

    _repr_html_ = as_html


def _shown(influence: Influence) -> str:
    energy = "" if influence.energy is None else f", energy {influence.energy:.2g}"
    return f"solution {influence.solution:.2g}{energy}"


def _numbers(influence: Influence) -> dict[str, float | None]:
    """An influence as JSON-ready data, with null for infinity."""
    from math import isfinite

    return {key: value if value is not None and isfinite(value) else None for key, value in influence._asdict().items()}


EXPLANATION = (
    "solution, energy: what leaving an effect out of all changes, relative to the size of the state and to the energy "
    "at the start; alone: what it does to the solution by itself; step: CPU time that it adds to a step."
)


def _table(report: EffectReport) -> Table:
    """A row for each effect, and one for the method itself."""
    own = EffectRow("", "", Influence(0.0, None), report.own_error)

    def advice(row: EffectRow) -> str:
        return "" if row is own else "leave out" if row.name in report.leave_out else "keep"

    columns = (
        Column("effect", get=lambda row: row.name or "(error of the method)"),
        Column("solution", True, lambda row: f"{row.left_out.solution:.2g}"),
        Column("energy", True, lambda row: "" if row.left_out.energy is None else f"{row.left_out.energy:.2g}"),
        Column("alone", True, lambda row: "" if row is own else f"{row.alone.solution:.2g}"),
        Column("step", True, lambda row: "" if row.seconds is None else f"{row.seconds * 1e9:+.1f} ns"),
        Column("±", True, lambda row: "" if row.seconds is None else f"{(row.uncertainty or 0) * 1e9:.1f}"),
        Column("advice", get=advice),
    )
    fields = (
        ("effect", lambda row: row.name),
        ("solution", lambda row: row.left_out.solution),
        ("energy", lambda row: row.left_out.energy),
        ("alone_solution", lambda row: None if row is own else row.alone.solution),
        ("alone_energy", lambda row: row.alone.energy),
        ("seconds", lambda row: row.seconds),
        ("uncertainty", lambda row: row.uncertainty),
        ("leave_out", lambda row: None if row is own else str(row.name in report.leave_out).lower()),
    )
    rows = [*report.rows, own]
    times = (f"{found.seconds * 1e9:,.1f} ns with {name}" for name, found in report.times.items() if found is not None)
    return Table(
        f"Effects of {report.scene}, {report.method}: {report.steps:,} steps of {report.h:g}",
        columns,
        rows,
        [EXPLANATION, f"A step takes {', '.join(times)}.", *report.advice()],
        data=report.to_dict,
        items="rows",
        records=listed(fields, rows),
    )
