"""`bseries shadow`: modified energies along a finished trajectory."""

from __future__ import annotations

import functools
import re
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal, standard_input
from bseries.cli.options.scene_argument import takes_scene
from bseries.cli.options.values import REAL, REALS, WholeNumber, read_assignments
from bseries.cli.output import NO_LATEX, Output, PlotFile, takes_output, takes_plot
from bseries_base.table import Table

if TYPE_CHECKING:
    from integrators import Scene

LAYOUT = "full"
"""Positions and momenta at the same times."""


@click.command()
@click.argument("file", metavar="FILE", required=False, type=click.Path())
@takes_scene(required=False)
@click.option("--order", type=WholeNumber(), help="The largest order, 2 to 24; by default 16.")
@click.option("--step", "h", metavar="H", type=REAL, help="The step size, if FILE does not contain it.")
@click.option(
    "--mass", metavar="LIST", type=REALS, help="A mass, one for each particle or one for each coordinate; by default 1."
)
@click.option(
    "--columns", metavar="TEXT",
    help='Columns by name, pattern or place, as in "q=x*,v=vx*,U=PotEng,F=fx*" or "t=0,p=1:3,q=3:5".',
)  # fmt: skip
@click.option(
    "--layout", metavar="NAME", default=LAYOUT, help="full, half-behind, half-ahead (leapfrog), or drift-kick-drift."
)
@click.option(
    "--period", metavar="LIST", type=REALS,
    help="The edge of a periodic box, or one for each dimension: unwraps positions.",
)  # fmt: skip
@click.option(
    "--tolerance", metavar="X", type=REAL,
    help="Allowed relative distance of states from steps of the method; by default 1e-9.",
)  # fmt: skip
@click.option(
    "--energy", metavar="COLUMN",
    help="Judge this column alone, an energy in a log of any program; total is the total energy by its usual names.",
)  # fmt: skip
@click.option("--bound", metavar="E", type=REAL, help="Also the largest step that keeps the energy within ±E.")
@takes_plot
@functools.partial(takes_output, formats=NO_LATEX)
def shadow(
    file: str | None,
    scene: Scene | None,
    *,
    effects: object,
    columns: str | None,
    bound: float | None,
    energy: str | None,
    plot: PlotFile,
    output: Output,
    **options: Any,
) -> Table:
    """Is the step size of a finished simulation too large? Does its energy drift?

    Measures the modified ("shadow") energies of order 2 (the energy), 4, 6, … along a trajectory of velocity Verlet
    (Störmer–Verlet, kick-drift-kick). They are constant up to higher and higher powers of the step. So they reveal a
    drift that is hidden by the oscillation of the energy, and the effect of a smaller or larger step.

    FILE is a trajectory of `bseries simulate`; an NPZ file of any program with the arrays q, p or v, U, gradU or F, and
    perhaps t, h, mass; a text or NPY file with such columns (q1, q2, …), or - for text on standard input; --columns
    assigns other names. It must contain every step. With --energy FILE is a log of energies: of LAMMPS, GROMACS (XVG),
    OpenMM or any other program. --scene supplies masses, potentials and forces; trajectories of
    `bseries simulate` contain their scene. Numbers with few digits need a larger --tolerance.

    \b
    Examples:
      bseries simulate lennard-jones --method stormer-verlet --step 1/200 --steps 20000 -o run.npz
      bseries shadow run.npz
      bseries shadow run.npz --order 12 --bound 1e-4 --plot run.png
      bseries simulate toda --method stormer-verlet --step 0.1 --steps 999 --format csv | bseries shadow - --scene toda
      bseries shadow log.lammps --energy total
      bseries shadow md.csv --mass 39.948 --step 0.002 --columns "q=x*,v=vx*,U=PotEng,F=fx*"
    """
    from bseries.shadow.trajectory_energies import shadow_energy

    if energy is not None:
        h = options.pop("h")
        others = options | {"scene": scene, "columns": columns, "bound": bound, "plot": plot.path}
        return _judged(file, energy, h, others)
    if file is None:
        raise Refusal("FILE must be given: a trajectory, as NPZ or text, or - for text on standard input")
    chosen = None
    if columns is not None:
        pieces = re.split(r"[;,]\s*(?=\w+\s*=)|;\s*$", columns)  # commas separate names of one role as well
        chosen = read_assignments(filter(None, pieces), "columns", '"q=[xy],v=v*"')
    source = standard_input() if file == "-" else file
    report = shadow_energy(source, scene, columns=chosen, progress=output.progress.update, **options)
    table = report.to_table(bound)
    if plot.path is not None:
        report.save_plot(plot.path)
    return table


def _judged(file: str | None, energy: str, h: float | None, others: dict[str, Any]) -> Table:
    """The verdict on the energies of a log; options for positions and momenta are refused."""
    from bseries.shadow.energy_log import energy_log

    if file is None:
        raise Refusal("FILE must be given: a log with a column of energies, or - for text on standard input")
    given = next((name for name, value in others.items() if value not in (None, LAYOUT)), None)
    if given is not None:
        raise Refusal(f"{given} must be left out with --energy, which judges a column alone")
    source = standard_input() if file == "-" else file
    return energy_log(source, None if energy == "total" else energy, h=h).to_table()
