"""What is known about a scene, as rows of a name and a value."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from integrators import scene_catalogue
from integrators.expressions import decimal_text, shorten
from integrators.scenes.formulas import formula_text

from .scene_latex import latex_formula, latex_words

if TYPE_CHECKING:
    import sympy

    from integrators import Scene
    from integrators.scenes.registry import SceneEntry
    from integrators.scenes.terms import Summand

    Value = str | Sequence[sympy.Expr]

SUMS = {
    "each": "each site",
    "chain": "neighbours in a chain",
    "ring": "neighbours in a ring",
    "pairs": "pairs of sites",
}


def rows(scene: Scene) -> list[tuple[str, str]]:
    """The facts as text."""

    def text(value: Value) -> str:
        return value if isinstance(value, str) else ", ".join(_decimal(x) or formula_text(x) for x in value)

    return [(what, text(value)) for what, value in _facts(scene)]


def latex_rows(scene: Scene) -> list[tuple[str, str]]:
    """The facts as LaTeX."""

    def latex(value: Value) -> str:
        if isinstance(value, str):
            return latex_words(value)
        return ", ".join(f"${_decimal(x) or latex_formula(x, scene)}$" for x in value)

    return [(latex_words(what), latex(value)) for what, value in _facts(scene)]


def _decimal(number: Any) -> str | None:
    """The decimal of a rational number, if that is shorter than the fraction; else None."""
    if not number.is_Rational:
        return None
    decimal = decimal_text(Fraction(int(number.p), int(number.q)))
    return decimal if len(decimal) < len(str(number)) else None


def _facts(scene: Scene) -> Iterator[tuple[str, Value]]:
    """What is known: text, or formulas."""
    entry = _entry_of(scene)
    yield "variables", ", ".join(scene.variables)
    yield "blocks", ", ".join(f"{block.name} of {block.dimension}" for block in scene.blocks)
    for summand in scene.summands:
        yield _place(summand), [summand.formula]
    for k, row in enumerate(scene.poisson or (), 1):
        yield f"Poisson matrix, row {k}", row
    for name, value in scene.parameters.items():
        yield f"parameter {name}", value if isinstance(value, tuple) else [value]
    for name, value in entry.options.items() if entry else ():
        if name not in scene.parameters:
            yield f"option {name}", f"by default {_typed(value)}"
    yield from _effects(scene, entry)
    for name, formula in scene.invariants.items():
        yield f"invariant {name}", [formula]
    if scene.positive:
        yield "positive", scene.positive
    if scene.start is not None:
        yield from ((f"start {block.name}", scene.start[block.offset : block.end]) for block in scene.blocks)
    if entry and entry.aliases:
        yield "also called", ", ".join(entry.aliases)
    if scene.reference:
        yield "reference", scene.reference


def _entry_of(scene: Scene) -> SceneEntry | None:
    """What the catalogue says about scenes of this name; None if it has none."""
    return next((entry for entry in scene_catalogue() if entry.name == scene.name), None)


def _place(summand: Summand) -> str:
    """Where a formula goes: H or a derivative, over which sites, and in which part of the field."""
    target = "H" if summand.target is None else f"{summand.target}'"
    table = "; ".join(" ".join(str(site + 1) for site in row) for row in summand.sites.table)
    where = f"sites {shorten(table)}" if table else SUMS.get(summand.sites.kind)
    part = summand.part and f"part {summand.part}"
    return ", ".join(filter(None, [target, where, part]))


def _effects(scene: Scene, entry: SceneEntry | None) -> Iterator[tuple[str, str]]:
    """The effects with their summaries; those that are off with the parameters that they would bring."""
    for name, effect in scene.effects.items():
        state, parameters = ("on", {}) if name in scene.active else ("off", effect.parameters)
        values = (f"{key} = {_typed(value)}" for key, value in parameters.items())
        yield f"effect {name} ({state})", "; ".join(filter(None, [effect.summary, *values]))
    for name, summary in ((entry and entry.built_in_effects) or {}).items():
        yield f"effect {name}", summary


def _typed(value: Any) -> str:
    """A value as it is typed behind --parameter NAME=."""
    if not isinstance(value, tuple):
        return str(value)
    return (";" if isinstance(value[0], tuple) else ",").join(map(_typed, value))
