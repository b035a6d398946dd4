"""`bseries equation`: the modified or modifying equation on a scene, as formulas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from bseries.cli.options.method_argument import takes_method
from bseries.cli.options.scene_argument import takes_parts, takes_scene
from bseries.cli.options.values import read_powers, takes_powers
from bseries.cli.output import Output, takes_output
from bseries_base.table import Table

if TYPE_CHECKING:
    from integrators import Method, Scene


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
    parts: dict[str, list[str]] | None,
    order: int | None,
    modifying: bool,
    power: int | None,
    nonzero: bool,
    output: Output,
) -> Table:
    """The modified equation of a method on a scene, in powers of h.

    The numerical solution formally solves y' = f_h(y). With --modifying: the equation for which the method solves
    y' = f(y). --order N means powers h^0 to h^(N-1). Trees whose elementary differentials vanish on the scene are left
    out; the first line gives the number of the others.

    \b
    Examples:
      bseries equation explicit-euler --scene riccati
      bseries equation rk4 --scene pendulum --effect damping --parameter gamma=1/5
      bseries equation stormer-verlet --scene kepler --order 3 --format latex
      bseries equation implicit-midpoint --hamiltonian "p^2/2 - cos(q)" --order 3 --modifying
      bseries equation symplectic-euler-p --ode "u' = u*(v-2); v' = v*(1-u)" --blocks "p=u;q=v" --order 3
      bseries equation strang --scene pendulum --parts "a=p;b=q" --power 2

    Equations consist of numbers, variables, parameters, + - * / ^, parentheses, sqrt, and elementary functions such as
    sin and exp. A method that treats p and q differently applies to the blocks of these names.
    """
    from bseries.fields.modified_fields import modified_field, modifying_field

    order, powers = read_powers(order, power)
    f = (modifying_field if modifying else modified_field)(method, scene, order, parts=parts)
    return f.to_table(powers, nonzero=nonzero, effects=effects, issues=method.issues)
