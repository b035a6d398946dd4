"""`bseries hamiltonian`: the modified Hamiltonian of a method, on a scene or in brackets."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli import table
from bseries.cli.application import Refusal
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.powers import notes, read_powers, remarks, span, takes_powers
from bseries.cli.options.scene_argument import head, place, read_parts, takes_parts, takes_scene
from bseries.cli.output import takes_output
from bseries.cli.table import Column

if TYPE_CHECKING:
    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output
    from bseries.hamiltonians.brackets.bracket_series import BracketSeries
    from bseries.hamiltonians.hamiltonian_verdict import HamiltonianVerdict
    from bseries.hamiltonians.modified_hamiltonian import ModifiedHamiltonian
    from integrators import Scene

FIELDS = ("power", "hamiltonian")
BRACKET_FIELDS = ("power", "bracket", "coefficient")
COLUMNS = (Column("k", True), Column("coefficient of h^k"))
VERDICT_COLUMNS = (Column("Hamiltonian for"), Column("order", True), Column("broken by"))


@click.command()
@takes_method()
@takes_scene(required=False)
@takes_parts
@takes_powers
@click.option(
    "--route", metavar="NAME", default="auto", help="trees, brackets, generating-function, integration; default auto."
)
@click.option("--brackets", is_flag=True, help="Nested brackets of the method's parts; there is no SCENE then.")
@click.option("--kinetic", metavar="NAME", help="With --brackets: the part that is quadratic in p, as T.")
@click.option("--verdict", is_flag=True, help="Whether there is one: for all Hamiltonians, and on the scene.")
@takes_output
def hamiltonian(
    method: Method,
    scene: Scene | None,
    effects: Sequence[str],
    parts: str | None,
    order: int | None,
    power: int | None,
    nonzero: bool,
    route: str,
    brackets: bool,
    kinetic: str | None,
    verdict: bool,
    output: Output,
) -> Iterable[str]:
    """The modified Hamiltonian of a method on a scene, written out by powers of h.

    The numerical solution of a symplectic method follows the Hamiltonian system of H + h H_2 + h^2 H_3 + …, that of a
    Poisson integrator likewise. Trees, brackets and generating functions lead to it independently; integration is for
    methods that are symplectic on the scene at hand only. Other methods are refused, and the sentence says where they
    fail; with --verdict that is the answer.

    With --brackets, it is a sum of nested Poisson brackets of the parts of a splitting method, for all Hamiltonians.

    \b
    Examples:
      bseries hamiltonian implicit-midpoint --scene pendulum
      bseries hamiltonian stormer-verlet --hamiltonian "p^2/2 - cos(q)" --order 3 --route generating-function
      bseries hamiltonian symplectic-euler-p --scene lotka-volterra --order 3 --format latex
      bseries hamiltonian strang --scene henon-heiles --parts "a=p;b=q" --power 2
      bseries hamiltonian stormer-verlet --brackets --kinetic T
      bseries hamiltonian yoshida4 --brackets --power 4 --format json
      bseries hamiltonian rk4 --scene pendulum --verdict
    """
    _check_options(scene, parts, route, kinetic, brackets=brackets, verdict=verdict)
    if scene is None:
        return _in_brackets(method, order, power, nonzero, kinetic, output)
    chosen = read_parts(parts, method, scene)
    if verdict:
        if power is not None:
            raise Refusal(f"power must be left out with --verdict, but was {power}")
        return _verdict(method, scene, effects, order, chosen, output)
    from bseries.hamiltonians.modified_hamiltonian import modified_hamiltonian

    order, powers = read_powers(order, power)
    energy = modified_hamiltonian(method, scene, order, parts=chosen, route=route)
    return _on_scene(energy, method, effects, powers, nonzero, route, output)


def _check_options(
    scene: Scene | None, parts: str | None, route: str, kinetic: str | None, *, brackets: bool, verdict: bool
) -> None:
    """Refuse options that contradict each other."""
    if scene is None and not brackets:
        raise Refusal(
            "SCENE must be given: --scene with a name from `bseries scenes`, --ode or --hamiltonian; or else --brackets"
        )
    if not brackets:
        if kinetic is not None:
            raise Refusal(f"kinetic must come with --brackets, but was {kinetic!r:.60} without")
        if verdict and route != "auto":
            raise Refusal(f"route must be left out with --verdict, but was {route!r:.60}")
        return
    given = {"SCENE": scene is not None, "parts": parts is not None, "route": route != "auto", "verdict": verdict}
    if name := next((name for name, is_given in given.items() if is_given), None):
        raise Refusal(f"{name} must be left out with --brackets, which are the same on all scenes, but was given")


def _on_scene(
    energy: ModifiedHamiltonian,
    method: Method,
    effects: Sequence[str],
    powers: range,
    nonzero: bool,
    route: str,
    output: Output,
) -> Iterable[str]:
    """The formulas in any format."""
    terms = [(k, energy.symbolic(k)) for k in output.track(powers, len(powers))]
    if output.format == "latex":
        from bseries.cli.scene_latex import hamiltonian_equation

        return [hamiltonian_equation(energy.scene, terms, energy.verdict.limit(latex=True))]
    rows = [(str(k), str(formula)) for k, formula in terms if formula != 0 or not nonzero]
    if output.format == "csv":
        return table.csv(FIELDS, rows)
    series = energy.field.series
    if output.format == "json":
        data = {
            **head("hamiltonian", method, energy.scene, effects),
            "order": energy.order,
            "route": energy.route,
            "domain": series.domain,
            "variables": list(energy.variables),
            "exists_through": energy.verdict.exists_through,
            "verdict": energy.verdict.to_dict(),
            **remarks(series, method, energy.scene),
            "terms": [{"power": int(k), "hamiltonian": formula} for k, formula in rows],
        }
        return [table.json(data, "terms")]
    title = f"Modified Hamiltonian of {place(method, energy.scene, effects)}: {span(powers)}, by {energy.route}"
    below = [
        energy.verdict.limit()
        or "The numerical solution follows the system with the Hamiltonian Σ h^k · (coefficient of h^k).",
        *_route_notes(energy, route),
        *notes(series, method, energy.scene, nonzero=nonzero),
    ]
    return output.listing(COLUMNS, rows, title, below)


def _route_notes(energy: ModifiedHamiltonian, route: str) -> Iterator[str]:
    """What it means that trees did not lead to it."""
    if route == "auto" and energy.route == "integration" and energy.scene.poisson is None:
        yield (
            "Found on this scene, not for all Hamiltonians: see --verdict. Where variables are angles, `bseries drift` "
            "tells whether it is a function of them."
        )


def _in_brackets(
    method: Method, order: int | None, power: int | None, nonzero: bool, kinetic: str | None, output: Output
) -> Iterable[str]:
    """Nested brackets in any format."""
    from bseries.hamiltonians.brackets.campbell_hausdorff import bracket_hamiltonian

    order, powers = read_powers(order, power)
    brackets = bracket_hamiltonian(method, order, quadratic_kinetic=kinetic)
    shown = [k for k in powers if brackets.term(k) or not nonzero]
    if output.format == "latex":
        from bseries.cli.scene_latex import ENERGY, align

        summands = [_latex_summand(brackets, k) for k in powers if brackets.term(k)]
        return [align([(ENERGY, summands)], powers[0], powers[-1])]
    if output.format in ("json", "csv"):
        data = brackets.to_dict()
        terms = [x for x in data.pop("terms") if x["power"] in powers and (x["coefficient"] != "0" or not nonzero)]
        if output.format == "csv":
            return table.csv(BRACKET_FIELDS, ([str(x[field]) for field in BRACKET_FIELDS] for x in terms))
        issues = {"issues": list(method.issues)} if method.issues else {}
        return [table.json({**data, **issues, "terms": terms}, "terms")]
    rows = [(str(k), brackets.term_text(k)) for k in shown]
    title = f"Modified Hamiltonian of {method.name}: {span(powers)}, in brackets of {', '.join(brackets.parts)}"
    return output.listing(COLUMNS, rows, title, list(_bracket_notes(brackets, method, nonzero)))


def _latex_summand(brackets: BracketSeries, k: int) -> str:
    if k == 0:
        return brackets.term_latex(k)
    return f"h{f'^{{{k}}}' if k > 1 else ''} \\left({brackets.term_latex(k)}\\right)"


def _bracket_notes(brackets: BracketSeries, method: Method, nonzero: bool) -> Iterator[str]:
    """What a reader must know about the brackets."""
    yield "{A,B} = A_q·B_p − A_p·B_q, or the bracket of a Poisson system."
    if brackets.kinetic is not None:
        yield (
            f"{brackets.kinetic} is taken to be quadratic in variables that the other parts do not depend on: "
            "brackets that vanish are left out."
        )
    if brackets.digits is not None:
        yield f"The method is published as decimals with {brackets.digits} digits: numbers show what these tell."
    if nonzero:
        yield "What is zero is left out."
    for issue in method.issues:
        yield f"Beware: {issue}."


def _verdict(
    method: Method, scene: Scene, effects: Sequence[str], order: int | None, parts: Any, output: Output
) -> Iterable[str]:
    """How far the modified equation is Hamiltonian, in any format."""
    from bseries.hamiltonians.hamiltonian_verdict import hamiltonian_verdict

    verdict = hamiltonian_verdict(method, scene, order, parts=parts)
    if output.format == "json":
        return [table.json({**head("hamiltonian-verdict", method, scene, effects), **verdict.to_dict()})]
    where = place(method, scene, effects)
    general = verdict.general
    rows = [] if general is None else [(verdict.kind, str(general.order), verdict.broken_tree or "")]
    here = where.removeprefix(f"{method.name} on ")
    rows.append((here, str(verdict.order), "" if verdict.holds else f"h^{verdict.order}"))
    if output.format == "csv":
        return table.csv([column.heading for column in VERDICT_COLUMNS], rows)
    if output.format == "latex":
        from bseries.cli.scene_latex import latex_words

        return [table.latex(VERDICT_COLUMNS, ([latex_words(cell) for cell in row] for row in rows))]
    title = f"Modified equation of {where}: Hamiltonian to order {verdict.order}, tested to {verdict.tested_to}"
    return output.listing(VERDICT_COLUMNS, rows, title, list(_verdict_notes(verdict)))


def _verdict_notes(verdict: HamiltonianVerdict) -> Iterator[str]:
    """What orders mean."""
    yield "Order n: the terms with h^0 to h^(n-1) have a Hamiltonian."
    if verdict.holds and verdict.general is not None and not verdict.general.holds:
        yield "It has one on this scene, although not for all Hamiltonians: `bseries drift` tells what that means."
