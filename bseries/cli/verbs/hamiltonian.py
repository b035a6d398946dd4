"""`bseries hamiltonian`: the modified Hamiltonian of a method, on a scene or in brackets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli.application import Refusal, say
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.scene_argument import takes_parts, takes_scene
from bseries.cli.options.values import REAL, read_powers, takes_powers
from bseries.cli.output import Output, PlotFile, takes_output, takes_plot
from bseries_base.table import Table

if TYPE_CHECKING:
    from integrators import Method, Scene


STEPS = 1000
"""Of the run in a plot."""


OF_INTEGRATION = (
    "Found on this scene, not for all Hamiltonians: see --verdict. Where variables are angles, `bseries drift` "
    "determines whether it is a function of them."
)


@click.command()
@takes_method()
@takes_scene(required=False, named=True)
@takes_parts
@takes_powers
@click.option(
    "--route", metavar="NAME", default="auto", help="trees, brackets, generating-function, integration; default auto."
)
@click.option("--brackets", is_flag=True, help="Nested brackets of the method's parts; there is no SCENE then.")
@click.option("--kinetic", metavar="NAME", help="With --brackets: the part that is quadratic in p, as T.")
@click.option("--verdict", is_flag=True, help="Whether there is one: for all Hamiltonians, and on the scene.")
@click.option("--step", metavar="H", type=REAL, help="With --plot: the step size.")
@takes_plot
@takes_output
def hamiltonian(
    method: Method,
    scene: Scene | None,
    named: dict[str, Any] | None,
    effects: Sequence[str],
    parts: dict[str, list[str]] | None,
    order: int | None,
    power: int | None,
    nonzero: bool,
    route: str,
    brackets: bool,
    kinetic: str | None,
    verdict: bool,
    step: float | None,
    plot: PlotFile,
    output: Output,
) -> Table:
    """The modified Hamiltonian of a method on a scene, in powers of h.

    The numerical solution of a symplectic method follows the Hamiltonian system of H + h H_2 + h^2 H_3 + …, that of a
    Poisson integrator likewise. Trees, brackets and generating functions lead to it independently; integration is for
    methods that are symplectic on the scene at hand only. Other methods are refused, and the sentence says where they
    fail; with --verdict that is the answer. Functions that are only named, as in p^2/2 + U(q), stand for all functions:
    the formulas have their derivatives.

    --plot draws its level curves, with the states of a run from the scene's start; with more than two variables, the
    errors of H and of H~ along this run.

    With --brackets, it is a sum of nested Poisson brackets of the parts of a splitting method, for all Hamiltonians.

    \b
    Examples:
      bseries hamiltonian implicit-midpoint --scene pendulum
      bseries hamiltonian stormer-verlet --hamiltonian "p^2/2 - cos(q)" --order 3 --route generating-function
      bseries hamiltonian symplectic-euler-p --scene lotka-volterra --order 3 --format latex
      bseries hamiltonian stormer-verlet --hamiltonian "p^2/2 + U(q)" --order 5
      bseries hamiltonian symplectic-euler-p --hamiltonian "H(p,q)" --order 3
      bseries hamiltonian strang --scene henon-heiles --parts "a=p;b=q" --power 2
      bseries hamiltonian stormer-verlet --brackets --kinetic T
      bseries hamiltonian yoshida4 --brackets --power 4 --format json
      bseries hamiltonian rk4 --scene pendulum --verdict
      bseries hamiltonian symplectic-euler-p --scene pendulum --order 3 --step 0.5 --plot levels.pdf
    """
    if named is not None:
        from bseries.hamiltonians.named_functions import named_hamiltonian

        others = {"brackets": brackets, "kinetic": kinetic, "verdict": verdict, "step": step, "route": route != "auto"}
        if name := next((name for name, value in others.items() if value), None):
            raise Refusal(f"{name} must be left out for functions that are only named, but was given")
        order, powers = read_powers(order, power)
        return named_hamiltonian(method, order=order, parts=parts, **named).to_table(powers, nonzero=nonzero)
    if scene is None and not brackets:
        raise Refusal(
            "SCENE must be given: --scene with a name from `bseries scenes`, --ode or --hamiltonian; or else --brackets"
        )
    given = {"SCENE": scene is not None, "parts": parts is not None, "route": route != "auto", "verdict": verdict}
    if brackets and (name := next((name for name, is_given in given.items() if is_given), None)):
        raise Refusal(f"{name} must be left out with --brackets, which are the same on all scenes, but was given")
    if kinetic is not None and not brackets:
        raise Refusal(f"kinetic must come with --brackets, but was {kinetic!r:.60} without")
    if verdict and (route != "auto" or power is not None):
        name, value = ("route", route) if route != "auto" else ("power", power)
        raise Refusal(f"{name} must be left out with --verdict, but was {value!r:.60}")
    if (plot.path is None) != (step is None) or (plot.path is not None and (brackets or verdict)):
        raise Refusal("plot must come with --step, and without --brackets and --verdict, but did not")
    if scene is None:
        from bseries.hamiltonians.brackets.campbell_hausdorff import bracket_hamiltonian

        order, powers = read_powers(order, power)
        nested = bracket_hamiltonian(method, order, quadratic_kinetic=kinetic)
        return nested.to_table(powers, nonzero=nonzero, issues=method.issues)
    if verdict:
        from bseries.hamiltonians.verdicts import hamiltonian_verdict

        return hamiltonian_verdict(method, scene, order, parts=parts).to_table(effects)
    from bseries.hamiltonians.modified_hamiltonian import modified_hamiltonian
    from integrators.runs.integration import integrate

    order, powers = read_powers(order, power)
    energy = modified_hamiltonian(method, scene, order, parts=parts, route=route)
    if step is not None:
        plot.save(lambda: energy.plot(h=step, run=integrate(method, scene, h=step, steps=STEPS, parts=parts)))
    table = energy.to_table(powers, nonzero=nonzero, effects=effects)
    if route == "auto" and energy.route == "integration" and scene.poisson is None:
        limit, *others = table.notes
        table = table._replace(notes=[limit, OF_INTEGRATION, *others])
    if output.has_records and (end := energy.verdict.limit()):  # records have no notes
        say("warning", end)
    return table
