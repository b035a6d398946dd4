"""`bseries drift`: whether the energy of a method on a scene drifts, and how fast."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import click

from bseries.cli import table
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.numbers import read_float
from bseries.cli.options.scene_argument import place, read_parts, read_start, takes_parts, takes_scene
from bseries.cli.output import WholeNumber, takes_output
from bseries.cli.table import Column

if TYPE_CHECKING:
    import sympy

    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output
    from bseries.hamiltonians.drift.report import DriftReport
    from integrators import Scene

    Fact = tuple[str, str | sympy.Expr]

COLUMNS = (Column("what"), Column("value"))
MOST_CHARACTERS = 300
"""Longer formulas are cut in tables for readers."""


@click.command()
@takes_method()
@takes_scene()
@takes_parts
@click.option("--start", metavar="TEXT", help='Where the orbit starts, by block, as in "p=5/2;q=0".')
@click.option("--step", metavar="H", help="The step size, for predicted slopes and for trajectories.")
@click.option("--steps", type=WholeNumber(), help="With several degrees of freedom: how long the trajectory is.")
@click.option("--order", type=WholeNumber(), help="How far to look, powers h^0 to h^(N-1); by default at least 7.")
@takes_output
def drift(
    method: Method,
    scene: Scene,
    effects: Sequence[str],
    parts: str | None,
    start: str | None,
    step: str | None,
    steps: int | None,
    order: int | None,
    output: Output,
) -> Iterable[str]:
    """Whether the energy error of a method stays bounded, drifts linearly, or like a random walk.

    Looks for the first power of h at which the modified equation has no Hamiltonian on the scene, and for the mean of
    what follows from it. With one degree of freedom that is computed on the orbit from --start, and where variables are
    angles for all orbits at once; with several, along a trajectory of the method, which takes --step.

    \b
    Examples:
      bseries drift simplified-takahashi-imada --scene pendulum --effect asymmetry
      bseries drift simplified-takahashi-imada --scene pendulum --effect asymmetry --start "p=5/2;q=0" --step 0.2
      bseries drift rk4 --scene pendulum --start "p=5/2;q=0" --step 0.1
      bseries drift rk4 --scene henon-heiles --step 0.1 --steps 20000 --format json
    """
    from bseries.hamiltonians.drift.mean_rates import STEPS, energy_drift

    report = energy_drift(
        method,
        scene,
        order,
        y0=None if start is None else read_start(start, scene).y0,
        h=None if step is None else read_float(step, "step"),
        steps=STEPS if steps is None else steps,
        parts=read_parts(parts, method, scene),
    )
    if output.format == "json":
        slope = _slope(report)
        return [table.json(report.to_dict() | ({} if slope is None else {"h": report.h, "slope": str(slope)}))]
    if output.format == "latex":
        from bseries.cli.scene_latex import latex_formula, latex_words

        def latex(value: str | sympy.Expr) -> str:
            return latex_words(value) if isinstance(value, str) else f"${latex_formula(value, scene)}$"

        return [table.latex(COLUMNS, ([latex_words(what), latex(value)] for what, value in _facts(report)))]
    rows = [(what, str(value)) for what, value in _facts(report)]
    if output.format == "csv":
        return table.csv([column.heading for column in COLUMNS], rows)
    from integrators.core.errors import shorten

    title = f"Energy of {place(method, scene, effects)}: {report.verdict}"
    shown = [(what, shorten(value, MOST_CHARACTERS)) for what, value in rows]
    return output.listing(COLUMNS, shown, title, [f"Looked at through h^{report.perturbation.field.order - 1}."])


def _facts(report: DriftReport) -> Iterator[Fact]:
    """What was found: text, or formulas."""
    from bseries.hamiltonians.drift.report import LEADING_DIGITS, shown_number

    r = report.perturbation
    yield "verdict", report.verdict
    yield "reason", report.reason
    if report.breaks is not None:
        names = r.field.series.names
        yield "not Hamiltonian for every H, by", report.breaks.text(names if len(names) > 1 else None)
    if report.power is not None:
        yield from _break_facts(report)
    if report.orbit is not None:
        yield f"orbit through {list(report.orbit.y0)}", f"{report.orbit.kind}, period {float(report.orbit.period):.10g}"
    for k, mean in report.means:
        yield f"mean of dH~/dt at h^{k}", shown_number(mean)
    for k, found in report.statistics:
        yield (
            f"mean of dH~/dt at h^{k}",
            f"{found.mean:.4g} ± {found.error:.2g} over t = {found.time:.6g}: {found.kind}",
        )
    slope = _slope(report, LEADING_DIGITS)
    if slope is not None:
        yield f"leading slope of the energy at h = {report.h:g}", slope
    if report.h is not None and report.spread is not None:
        coefficient = shown_number(report.deviation(1.0), LEADING_DIGITS)
        yield f"deviation of the energy after t, h = {report.h:g}", f"{coefficient}*sqrt(t)"


def _break_facts(report: DriftReport) -> Iterator[Fact]:
    """What is not Hamiltonian on the scene."""
    r = report.perturbation
    yield "not Hamiltonian on this scene at", f"h^{report.power}"
    if r.twin is not None:
        yield "but for a perturbation of", r.twin.name
    if r.has_formulas and report.rate is not None:
        yield f"dH~/dt at h^{report.power}", report.rate
    for turn in report.turns:
        how = "" if turn.digits is None else f", by quadrature to {turn.digits} digits"
        yield f"gain of the energy at h^{report.power} in a turn of {turn.variable} by {turn.period}{how}", turn.gain


def _slope(report: DriftReport, digits: int = 10) -> str | sympy.Expr | None:
    """The predicted slope of the energy, to leading order; None where there is none."""
    if report.h is None or report.drift is None:
        return None
    from bseries.hamiltonians.drift.report import shown_number

    power, mean = report.drift
    return shown_number(mean * report.h**power, digits)
