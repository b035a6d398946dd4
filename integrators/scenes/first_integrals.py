"""Whether declared first integrals are some: their derivatives along the field, at random points in many digits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random
from typing import TYPE_CHECKING, Any, cast

from ..errors import IntegratorError
from .expansion import filled
from .local_terms import VALUE, LocalTerm

if TYPE_CHECKING:
    from .system import System

    Field = Callable[[Sequence[Any]], list[Any]]

DIGITS = 40
POINTS = 3
NOISE = 1e-25
"""What counts as zero, relative to the terms that cancel; rounding leaves about 1e-40."""
MAX_ROWS = 50_000


def can_be_checked(scene: System) -> bool:
    """Whether the field has few enough terms, and no parameter that is a symbol."""
    numbers = not any(value.free_symbols for value in scene.parameter_values.values())
    return numbers and sum(summand.sites.size for summand in scene.summands) <= MAX_ROWS


def defects(scene: System) -> dict[str, float]:
    """The declared first integrals I of a scene that are none.

    Args:
        scene: The scene.

    Returns:
        For each of them the largest |Σ ∂I/∂y_k f_k| / Σ |∂I/∂y_k f_k| at some points near the start.

    Raises:
        IntegratorError: The field has too many terms, or a parameter is a symbol.
    """
    import mpmath

    if not can_be_checked(scene):
        raise IntegratorError(
            f"scene must have numbers for parameters and at most {MAX_ROWS} terms to check its invariants, but had not"
        )
    random, found = Random(1), dict[str, float]()
    centre = [1.0] * scene.dimension if scene.start is None else scene.y0.tolist()
    with mpmath.workdps(DIGITS):
        field = _field(scene)
        derivatives = {name: _derivative(name, scene) for name in scene.invariants}
        for _ in range(POINTS):
            y = [mpmath.mpf(x) + (1 + abs(x)) * random.uniform(-1, 1) / 8 for x in centre]
            f = field(y)
            for name, derivative in derivatives.items():
                terms = derivative(y, f)
                size = mpmath.fsum(terms, absolute=True)
                if abs(mpmath.fsum(terms)) > NOISE * size:
                    found[name] = max(found.get(name, 0.0), float(abs(mpmath.fsum(terms)) / size))
    return found


def _function(symbols: Sequence[Any], formulas: Any) -> Callable[..., Any]:
    """A function of mpmath numbers."""
    import sympy

    # A variable may have the name of a function of mpmath, so symbols are replaced.
    return sympy.lambdify(symbols, formulas, "mpmath", cse=True, dummify=True)


def _derivative(name: str, scene: System) -> Callable[[Sequence[Any], Sequence[Any]], list[Any]]:
    """The terms of the derivative of an integral along the field, as a function of y and f(y)."""
    formula = filled(scene.invariants[name], scene)
    symbols = sorted(cast("set[Any]", formula.free_symbols), key=str)
    places = [scene.places[symbol.name] for symbol in symbols]
    gradient = _function(symbols, [formula.diff(symbol) for symbol in symbols])
    return lambda y, f: [g * f[k] for g, k in zip(gradient(*(y[k] for k in places)), places, strict=True)]


def _field(scene: System) -> Field:
    """f as a function of y."""
    terms = [(term, _outputs(term), [_function((), data.values)() for data in term.data]) for term in scene.local_terms]

    def field(y: Sequence[Any]) -> list[Any]:
        total: list[Any] = [0] * len(y)
        for term, outputs, data in terms:
            for row in term.sites.rows():
                x = [y[a.plus.at(row)] - (y[a.minus.at(row)] if a.minus else 0) for a in term.arguments]
                d = [values[row[source.role]] for values, source in zip(data, term.data, strict=True)]
                for output, value in zip(term.outputs, outputs(*x, *d), strict=True):
                    total[output.place.at(row)] += output.sign * value
        return total

    return field


def _outputs(term: LocalTerm) -> Callable[..., list[Any]]:
    """What a term adds at its places, but for the signs, as a function of local variables and data."""
    import sympy

    x = [sympy.Symbol(f"x{k}") for k in range(len(term.arguments))]
    d = [sympy.Symbol(f"d{k}") for k in range(len(term.data))]
    formulas = [term.formula if o.derivative == VALUE else term.formula.diff(x[o.derivative]) for o in term.outputs]
    return _function([*x, *d], formulas)
