"""Check of declared first integrals: their derivatives along the field at random points, in 40 digits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random
from typing import TYPE_CHECKING, Any, cast

from integrators.compile.scene_source import precise_scene
from integrators.core.errors import IntegratorError
from integrators.scenes.particles.expansion import filled

if TYPE_CHECKING:
    from integrators.scenes.model.system import System

DIGITS = 40
POINTS = 3
NOISE = 1e-25
"""The relative size below which cancelled terms count as zero; rounding errors are about 1e-40."""
MAX_ROWS = 50_000


def can_be_checked(scene: System) -> bool:
    """Whether the field has at most `MAX_ROWS` terms and no symbolic parameter."""
    numbers = not any(value.free_symbols for value in scene.parameter_values.values())
    return numbers and sum(summand.sites.size for summand in scene.summands) <= MAX_ROWS


def defects(scene: System) -> dict[str, float]:
    """The largest |Σ ∂I/∂y_k f_k| / Σ |∂I/∂y_k f_k| near the start, for each I that is not a first integral."""
    import mpmath

    if not can_be_checked(scene):
        raise IntegratorError(
            f"scene must have numbers for parameters and at most {MAX_ROWS} terms to check its invariants, but had not"
        )
    random, found = Random(1), dict[str, float]()
    centre = [1.0] * scene.dimension if scene.start is None else scene.y0.tolist()
    with mpmath.workdps(DIGITS):
        field = precise_scene(scene).field
        derivatives = {name: _derivative(name, scene) for name in scene.invariants}
        for _ in range(POINTS):
            y = [mpmath.mpf(x) + (1 + abs(x)) * random.uniform(-1, 1) / 8 for x in centre]
            try:
                f: list[Any] = [None] * len(y)
                field(y, f)
                rates = {name: derivative(y, f) for name, derivative in derivatives.items()}
            except (ArithmeticError, ValueError):
                raise IntegratorError(
                    f"field and invariants of {scene.name} must be defined near the start, but at a point there are not"
                ) from None
            for name, terms in rates.items():
                size = mpmath.fsum(terms, absolute=True)
                if abs(mpmath.fsum(terms)) > NOISE * size:
                    found[name] = max(found.get(name, 0.0), float(abs(mpmath.fsum(terms)) / size))
    return found


def _derivative(name: str, scene: System) -> Callable[[Sequence[Any], Sequence[Any]], list[Any]]:
    """The terms ∂I/∂y_k f_k of an invariant as a function of y and f(y)."""
    import sympy

    formula = filled(scene.invariants[name], scene)
    symbols = sorted(cast("set[Any]", formula.free_symbols), key=str)
    places = [scene.places[symbol.name] for symbol in symbols]
    # Symbols are replaced because a variable may have the name of an mpmath function.
    partial = [formula.diff(symbol) for symbol in symbols]
    gradient = sympy.lambdify(symbols, partial, "mpmath", cse=True, dummify=True)
    return lambda y, f: [g * f[k] for g, k in zip(gradient(*(y[k] for k in places)), places, strict=True)]
