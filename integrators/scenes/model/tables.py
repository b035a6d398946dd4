"""Declarations of scenes as nested tables of integers and text: the content of scene files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError
from integrators.exact.expressions import MAX_LENGTH, decimal_text
from integrators.scenes.model.assembly import Contribution, Declaration
from integrators.scenes.model.effects import Effect
from integrators.scenes.model.formulas import formula_text
from integrators.scenes.model.terms import Key

if TYPE_CHECKING:
    import sympy

LARGEST_NUMBER = 2**53
"""Larger integers are written as text, because other readers may convert numbers to doubles."""


def declaration_table(
    declaration: Declaration, labels: Mapping[str, str | None], effects: Mapping[str, Effect], active: tuple[str, ...]
) -> dict[str, Any]:
    """A declaration as nested dictionaries and lists of integers and text, without empty entries."""
    data: dict[str, Any] = {**labels, "active": list(active)}
    data |= _contribution_table(declaration.base)
    if declaration.poisson is not None:
        data["poisson"] = [[_number(entry, "poisson") for entry in row] for row in declaration.poisson]
    data["positive"] = [_text(formula, "positive") for formula in declaration.positive]
    data["invariants"] = {name: _text(value, f"invariants.{name}") for name, value in declaration.invariants.items()}
    data["effects"] = {
        name: {"summary": effects[name].summary} | _contribution_table(effect)
        for name, effect in declaration.effects.items()
    }
    return _without_empty(data)


def _without_empty(table: Mapping[str, Any]) -> dict[str, Any]:
    """The table without keys whose value is None or empty, on all levels."""
    inner = {key: _without_empty(value) if isinstance(value, dict) else value for key, value in table.items()}
    return {key: value for key, value in inner.items() if value not in (None, [], {})}


def _contribution_table(part: Contribution) -> dict[str, Any]:
    """The table of the base system or of an effect."""
    at_site = {block.name: len(block.components) for block in part.blocks}
    return {
        "variables": {block.name: block.size for block in part.blocks},
        **_formulas_table(part.summands),
        "parameters": {name: _numbers(value) for name, value in part.parameters.items()},
        "start": {name: _rows(_numbers(values), at_site.get(name, 1)) for name, values in part.start.items()},
        "breaks": list(part.breaks),
    }


def _formulas_table(summands: Mapping[Key, sympy.Expr]) -> dict[str, Any]:
    """The keys hamiltonian, field and terms; a sum too long for one text is split into several terms."""
    table: dict[str, Any] = {}
    terms: dict[Any, dict[str, Any]] = {}
    for (target, sites, part), formula in summands.items():
        for k, text in enumerate(_texts(formula)):
            place = table
            if k or part is not None or sites.kind != "single":
                over = [[site + 1 for site in row] for row in sites.table] or sites.kind
                labels = {"over": over} | ({} if part is None else {"part": part})
                place = terms.setdefault((target is None, sites, part, k), labels)
            if target is None:
                place["hamiltonian"] = text
            else:
                place.setdefault("field", {})[target] = text
    return {**table, "terms": list(terms.values())}


def _texts(formula: sympy.Expr) -> Iterator[str]:
    """A formula as one text, or as several summands if the text exceeds the parser's limit."""
    import sympy

    text = _written(formula)
    if len(text) <= MAX_LENGTH:
        yield text
        return
    summands = list(sympy.Add.make_args(formula))
    for half in (summands[::2], summands[1::2]):
        yield from _texts(sympy.Add(*half))


def _written(formula: sympy.Expr) -> str:
    return formula_text(formula).replace("**", "^")


def _text(formula: sympy.Expr, argument: str) -> str:
    text = _written(formula)
    if len(text) > MAX_LENGTH:
        raise IntegratorError(f"{argument} must have at most {MAX_LENGTH} characters in a file, but had {len(text)}")
    return text


def _numbers(value: Any) -> Any:
    """One number, or a list of numbers for all sites."""
    return [_number(entry, "a number") for entry in value] if isinstance(value, tuple) else _number(value, "a number")


def _number(value: Any, argument: str) -> int | str:
    """An integer, or the text of a decimal or formula."""
    if not value.is_Rational:
        return _text(value, argument)
    exact = Fraction(int(value.p), int(value.q))
    return int(exact) if exact.denominator == 1 and abs(exact) < LARGEST_NUMBER else decimal_text(exact)


def _rows(values: list[Any], length: int) -> list[Any]:
    """The values in rows of a given length; a flat list for length 1."""
    return [values[k : k + length] for k in range(0, len(values), length)] if length > 1 else values
