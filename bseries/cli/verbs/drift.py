"""`bseries drift`: whether the energy of a method on a scene drifts, and how fast."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.scene_argument import takes_parts, takes_scene, takes_start
from bseries.cli.options.values import REAL, WholeNumber
from bseries.cli.output import Output, PlotFile, takes_output, takes_plot
from bseries_base.table import Table

if TYPE_CHECKING:
    from integrators import Method, Scene


@click.command()
@takes_method()
@takes_scene()
@takes_parts
@takes_start
@click.option("--step", "h", metavar="H", type=REAL, help="The step size, for predicted slopes and for trajectories.")
@click.option("--steps", type=WholeNumber(), help="Steps of the run.")
@click.option(
    "--order", type=WholeNumber(), help="Powers h^0 to h^(N-1) of the modified equation; by default at least 7."
)
@takes_plot
@takes_output
def drift(
    method: Method,
    scene: Scene,
    effects: Sequence[str],
    *,
    start: dict[str, list[str]] | None,
    steps: int | None,
    order: int | None,
    plot: PlotFile,
    output: Output,
    **options: Any,
) -> Table:
    """Whether the energy error of a method stays bounded, drifts linearly, or like a random walk.

    Finds the first power of h at which the modified equation has no Hamiltonian on the scene, and the mean rate of
    change of the energy that follows. With one degree of freedom the mean is computed on the orbit from --start, or for
    all orbits where variables are angles; with several, along a numerical trajectory, which needs --step. With --step
    a run must also confirm that the energy is bounded. --plot draws the energy error of a run against the prediction.

    \b
    Examples:
      bseries drift simplified-takahashi-imada --scene pendulum --effect asymmetry
      bseries drift simplified-takahashi-imada --scene pendulum --effect asymmetry --start "p=5/2;q=0" --step 0.2
      bseries drift rk4 --scene pendulum --start "p=5/2;q=0" --step 0.1 --plot drift.png
      bseries drift rk4 --scene henon-heiles --step 0.1 --steps 20000 --format json
      bseries drift leapfrog --scene kepler --step 0.01 --plot band.png
    """
    from bseries.hamiltonians.energy_drift import STEPS, energy_drift
    from integrators.runs.integration import integrate

    if plot.path is not None and options["h"] is None:
        raise Refusal("step must be given with --plot, for a run to compare with, but was not")
    y0 = None if start is None else scene.with_start(**start).y0
    run: dict[str, Any] = {**options, "y0": y0, "steps": STEPS if steps is None else steps}
    report = energy_drift(method, scene, order, **run)
    plot.save(lambda: report.plot(run=integrate(method, scene, observe="energy", **run)))
    return report.to_table(effects)
