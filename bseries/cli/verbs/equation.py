"""`bseries equation`: the modified or modifying equation on a scene, written out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import click

from bseries.cli import table
from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.powers import notes, read_powers, remarks, span, takes_powers
from bseries.cli.options.scene_argument import head, place, read_parts, takes_parts, takes_scene
from bseries.cli.output import takes_output
from bseries.cli.table import Column

if TYPE_CHECKING:
    import sympy

    from bseries.cli.options.method_argument import Method
    from bseries.cli.output import Output
    from bseries.fields.modified_fields import SceneSeries
    from integrators import Scene

FIELDS = ("power", "variable", "field")
COLUMNS = (Column("k", True), Column("d/dt"), Column("coefficient of h^k"))


@click.command()
@takes_method()
@takes_scene()
@takes_parts
@takes_powers
@click.option("--modifying", is_flag=True, help="The modifying integrator, not the modified equation.")
@takes_output
def equation(
    method: Method,
    scene: Scene,
    effects: Sequence[str],
    parts: str | None,
    order: int | None,
    modifying: bool,
    power: int | None,
    nonzero: bool,
    output: Output,
) -> Iterable[str]:
    """The modified equation of a method on a scene, written out by powers of h.

    It is y' = f_h(y), which the numerical solution follows formally; with --modifying, the equation to which the method
    is applied to follow y' = f(y). --order N means powers h^0 to h^(N-1). Only trees are computed whose elementary
    differentials need not vanish on the scene; the first line says how many of how many these are.

    \b
    Examples:
      bseries equation explicit-euler --scene riccati
      bseries equation rk4 --scene pendulum --effect damping --parameter gamma=1/5
      bseries equation stormer-verlet --scene kepler --order 3 --format latex
      bseries equation implicit-midpoint --hamiltonian "p^2/2 - cos(q)" --order 3 --modifying
      bseries equation symplectic-euler-p --ode "u' = u*(v-2); v' = v*(1-u)" --blocks "p=u;q=v" --order 3
      bseries equation strang --scene pendulum --parts "a=p;b=q" --power 2

    The text of equations is in numbers, variables, parameters, + - * / ^, parentheses, sqrt, and elementary functions
    such as sin and exp. A method that treats p and q differently takes the blocks of these names.
    """
    from bseries.fields.modified_fields import modified_field, modifying_field

    order, powers = read_powers(order, power)
    make = modifying_field if modifying else modified_field
    f = make(method, scene, order, parts=read_parts(parts, method, scene))
    terms = [(k, f.symbolic(k)) for k in output.track(powers, len(powers))]
    if output.format == "latex":
        from bseries.cli.scene_latex import field_equations

        return [field_equations(scene, terms)]
    if output.format == "json":
        records = [_record(k, field) for k, field in terms if any(field) or not nonzero]
        return [table.json({**_head(f, method, effects, modifying), "terms": records}, "terms")]
    rows = [
        (str(k), x, str(g)) for k, field in terms for x, g in zip(f.variables, field, strict=True) if g or not nonzero
    ]
    if output.format == "csv":
        return table.csv(FIELDS, rows)
    what = "Modifying integrator" if modifying else "Modified equation"
    title = f"{what} of {place(method, scene, effects)}: {span(powers)}, {f.report()}"
    below = [_meaning(modifying), *notes(f.series, method, scene, nonzero=nonzero)]
    return output.listing(COLUMNS, rows, title, below, sections=0)


def _head(f: SceneSeries, method: Method, effects: Sequence[str], modifying: bool) -> dict[str, Any]:
    """What JSON says besides the terms."""
    return {
        **head("equation", method, f.scene, effects),
        "order": f.order,
        "modifying": modifying,
        "domain": f.series.domain,
        "trees": {"needed": len(f.trees.table), "total": f.trees.total},
        "variables": list(f.variables),
        **remarks(f.series, method, f.scene),
    }


def _record(k: int, field: Sequence[sympy.Expr]) -> dict[str, Any]:
    return {"power": k, "field": [str(formula) for formula in field]}


def _meaning(modifying: bool) -> str:
    if modifying:
        return "As a formal series: applied to y' = Σ h^k · (coefficient of h^k), the method follows the exact flow."
    return "As a formal series: the numerical solution follows y' = Σ h^k · (coefficient of h^k)."
