"""`bseries equation`: the modified or modifying equation on a scene, written out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from . import layout
from .application import Refusal
from .layout import Column
from .method_argument import takes_method
from .output import WholeNumber, takes_output
from .scene_argument import read_parts, takes_parts, takes_scene

if TYPE_CHECKING:
    import sympy

    from integrators import Scene

    from ..evaluation import SceneSeries
    from .method_argument import Method
    from .output import Output

    Terms = list[tuple[int, tuple[sympy.Expr, ...]]]

DEFAULT_ORDER = 5
FIELDS = ("power", "variable", "field")
COLUMNS = (Column("k", True), Column("d/dt"), Column("coefficient of h^k"))


@click.command()
@takes_method()
@takes_scene()
@takes_parts
@click.option(
    "--order", type=WholeNumber(), help="Trees with 1 to N nodes, powers h^0 to h^(N-1); by default 5, or for --power."
)
@click.option("--modifying", is_flag=True, help="The modifying integrator, not the modified equation.")
@click.option("--power", type=WholeNumber(), metavar="K", help="Only what h^K multiplies.")
@click.option("--nonzero", is_flag=True, help="Leave out what is zero.")
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

    It is y' = f_h(y), which the numerical solution follows; with --modifying, the equation to which the method is
    applied to follow y' = f(y). --order N means powers h^0 to h^(N-1). Only trees are computed whose elementary
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
    from trees.counting import check_order

    from ..evaluation import modified_field, modifying_field

    if order is None:
        order = DEFAULT_ORDER if power is None or power < 0 else power + 1
    check_order(order)
    if power is not None and not 0 <= power < order:
        raise Refusal(f"power must be from 0 to {order - 1}, but was {power}")
    make = modifying_field if modifying else modified_field
    f = make(method, scene, order, parts=read_parts(parts, method, scene))
    powers = range(order) if power is None else range(power, power + 1)
    terms = [(k, f.symbolic(k)) for k in output.track(powers, len(powers))]
    if output.format == "latex":
        from .scene_latex import align

        return [align(scene, terms)]
    if output.format == "json":
        records = [_record(k, field) for k, field in terms if any(field) or not nonzero]
        return [layout.json({**_head(f, method, effects, modifying), "terms": records}, "terms")]
    rows = [
        (str(k), x, str(g)) for k, field in terms for x, g in zip(f.variables, field, strict=True) if g or not nonzero
    ]
    if output.format == "csv":
        return layout.csv(FIELDS, rows)
    title, notes = _title(f, method, effects, modifying, powers), list(_notes(f, method, modifying, nonzero))
    if output.format == "markdown":
        return [layout.markdown(COLUMNS, rows, title=title, notes=notes)]
    text = layout.table(COLUMNS, layout.sections(rows, 0), output.width)
    return [layout.paragraphs([title, ""], output.width), text, layout.paragraphs(["", *notes], output.width)]


def _head(f: SceneSeries, method: Method, effects: Sequence[str], modifying: bool) -> dict[str, Any]:
    """What JSON says besides the terms."""
    head: dict[str, Any] = {
        "schema": 1,
        "kind": "equation",
        "method": method.name,
        "scene": f.scene.name,
        "effects": list(effects),
        "order": f.order,
        "modifying": modifying,
        "domain": f.series.domain,
        "trees": {"needed": len(f.trees.table), "total": f.trees.total},
        "variables": list(f.variables),
    }
    lists = {"issues": list(method.issues), "notes": list(f.scene.notes)}
    digits = {} if f.series.digits is None else {"digits": f.series.digits}
    return head | digits | {key: value for key, value in lists.items() if value}


def _record(k: int, field: Sequence[sympy.Expr]) -> dict[str, Any]:
    return {"power": k, "field": [str(formula) for formula in field]}


def _title(f: SceneSeries, method: Method, effects: Sequence[str], modifying: bool, powers: range) -> str:
    what = "Modifying integrator" if modifying else "Modified equation"
    on = f" with {', '.join(effects)}" if effects else ""
    span = f"powers h^{powers[0]} to h^{powers[-1]}" if len(powers) > 1 else f"power h^{powers[0]}"
    return f"{what} of {method.name} on {f.scene.name}{on}: {span}, {f.report()}"


def _notes(f: SceneSeries, method: Method, modifying: bool, nonzero: bool) -> Iterator[str]:
    """What a reader must know about the formulas."""
    if modifying:
        yield "The method applied to y' = Σ h^k · (coefficient of h^k) follows the exact flow of the scene."
    else:
        yield "The numerical solution follows y' = Σ h^k · (coefficient of h^k)."
    if f.series.digits is not None:
        yield f"The tableau is published as decimals with {f.series.digits} digits: numbers show what these tell."
    elif not f.series.is_exact:
        yield "Floating point: the tableau holds floats, so the numbers carry rounding errors."
    for note in f.scene.notes:
        yield f"{note[0].upper()}{note[1:]}."
    if nonzero:
        yield "What is zero is left out."
    for issue in method.issues:
        yield f"Beware: {issue}."
