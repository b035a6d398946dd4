"""Reversible variable steps: symmetric control of the step density.

Constant steps of size ε in a new time τ with dt/dτ = σ(y) have the size h = ε σ(y). The density of steps ρ = 1/σ(y)
changes along a solution by dρ/dτ = G(y) = −∇σ(y)·f(y)/σ(y), and is integrated along with it, by the midpoint rule:

    ρ_(n+1/2) = ρ_n + ε/2 G(y_n),  y_(n+1) = Φ_h(y_n) with h = ε/ρ_(n+1/2),  ρ_(n+1) = ρ_(n+1/2) + ε/2 G(y_(n+1)).

If Φ is symmetric, so is this explicit scheme: steps with −ε retrace those with ε. If σ is invariant under reversal of
the momenta, energies and first integrals of integrable reversible systems do not drift.

References:
    E. Hairer, G. Söderlind, SIAM J. Sci. Comput. 26 (2005) 1838–1851, doi:10.1137/04060699; HLW, section VIII.3.2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import sympy

from bseries_base.errors import shorten
from integrators.compile.scene_source import flat_lines
from integrators.core.errors import IntegratorError
from integrators.exact.arithmetic import renamed
from integrators.exact.expressions import nearest_double
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.model.system import System
from integrators.scenes.particles.expansion import filled

if TYPE_CHECKING:
    from integrators.steppers.writer import StepWriter

DENSITY, RATE, TIME, TIME_COMPENSATION = range(4)
"""Entries of `State.control`: ρ_n, G(y_n), the time, and the compensation of the time."""
_CONTROL = ", ".join(f"controls[{k}]" for k in (DENSITY, RATE, TIME, TIME_COMPENSATION))


class ControlText(NamedTuple):
    """Statements of controlled steps: before the first of a call and of a run, around each, and after the last."""

    load: tuple[str, ...] = ()
    fresh: tuple[str, ...] = ()
    before: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    store: tuple[str, ...] = ()


def read_control(control: object, scene: System) -> sympy.Expr:
    """Read the step size function σ(y) of h = ε σ(y).

    Example:
        >>> from integrators import scene
        >>> read_control("sqrt(q1^2 + q2^2)", scene("kepler"))
        sqrt(q1**2 + q2**2)
    """
    formula = filled(read_formula(control, [*scene.variables, *scene.parameter_values], "control"), scene)
    if not formula.free_symbols & set(scene.symbols):
        raise IntegratorError(f"control must depend on the variables, but was {shorten(str(control))}")
    return formula


def start_control(formula: sympy.Expr, scene: System, y: np.ndarray, t0: float) -> np.ndarray:
    """`State.control` at the start of a run."""
    values = {symbol: sympy.Rational(float(x)) for symbol, x in zip(scene.symbols, y, strict=True)}
    at_start = renamed(formula, values)
    size = at_start.evalf(30)
    if not (size.is_finite and size.is_positive):
        raise IntegratorError(f"control must be positive at the start, but was {shorten(str(size.evalf(6)))}")
    return np.array([nearest_double(1 / size), 0.0, t0, 0.0])


def control_text(formula: sympy.Expr, writer: StepWriter) -> ControlText:
    """Statements of steps with a step size function; the rate is G(y) = −∇σ(y)·f(y)/σ(y)."""
    structure = writer.structure
    scene, whole = structure.scene, len(structure.pieces) - 1
    used = [k for k, symbol in enumerate(scene.symbols) if symbol in formula.free_symbols]
    gradient = {f"s{k}": formula.diff(scene.symbols[k]) for k in used}
    body = flat_lines(scene, {"sigma": formula, **gradient}, writer.module)
    total = " + ".join(f"s{k}*f[{k}]" for k in used)
    writer.module.function(
        "density_rate(y, f)", "The rate of change of the density of steps.", [*body, f"return -({total})/sigma"]
    )
    field = writer.functions.field(whole, sorted({structure.block_of[k] for k in used}))
    value = writer.array("field")
    rate = f"{field}(y, {value})", f"rate = density_rate(y, {value})"
    return ControlText(
        load=("epsilon = h", f"density, rate, time, time_compensation = {_CONTROL}"),
        fresh=rate,
        before=("middle = density + 0.5*epsilon*rate", "if not middle > 0.0:", "    break", "h = epsilon/middle"),
        after=(
            *rate,
            "density = middle + 0.5*epsilon*rate",
            "c = h + time_compensation",
            "x = time + c",
            "time_compensation = c - (x - time)",
            "time = x",
        ),
        store=(f"{_CONTROL} = density, rate, time, time_compensation",),
    )
