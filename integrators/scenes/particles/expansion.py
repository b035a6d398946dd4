"""Scenes in flat form: one formula for each variable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, cast

from integrators.core.errors import IntegratorError, shorten
from integrators.scenes.model.blocks import ROLES, canonical_blocks, component_places
from integrators.scenes.model.terms import Summand

if TYPE_CHECKING:
    import sympy

    from integrators.scenes.model.system import System


def filled(formula: sympy.Expr, scene: System) -> sympy.Expr:
    """The formula with numbers for parameters; parameters indexed by a site (``m_i``) stay symbols."""
    import sympy

    values = scene.parameter_values
    symbols = cast("set[sympy.Symbol]", formula.free_symbols)
    used = {s: values[s.name] for s in symbols if s.name in values}
    result = cast("sympy.Expr", formula.xreplace(used))
    if used and result.has(sympy.I):
        given = ", ".join(sorted(f"{symbol} = {value}" for symbol, value in used.items()))
        raise IntegratorError(f"parameters must make {shorten(str(formula))} real, but were {given}")
    return result


def written_out(summand: Summand, scene: System) -> Iterator[tuple[str | None, sympy.Expr]]:
    """The targets and formulas of a summand at every row of its sites, in flat names, with values of parameters."""
    formula = filled(summand.formula, scene)
    if summand.sites.kind == "single":
        yield summand.target, formula
        return
    for row in summand.sites.rows():
        yield summand.target and str(_at_row(summand.target, row, scene)), at_row(formula, row, scene)


def at_row(formula: sympy.Expr, row: tuple[int, ...], scene: System) -> sympy.Expr:
    """The formula of a term over sites at a row of sites, in flat names."""
    symbols = [symbol for symbol in formula.free_symbols if is_local(str(symbol), scene)]
    return cast("sympy.Expr", formula.xreplace({symbol: _at_row(str(symbol), row, scene) for symbol in symbols}))


def is_local(name: str, scene: System) -> bool:
    """Whether a name in a term over sites is indexed by a site, such as ``q_i`` and ``m_j``."""
    base = name[:-2]
    at_site = component_places(base, scene.blocks) is not None or isinstance(scene.parameters.get(base), tuple)
    return at_site and name[-2:-1] == "_" and name[-1] in ROLES


def _at_row(name: str, row: tuple[int, ...], scene: System) -> sympy.Expr:
    """The variable or number of a local name at a row of sites."""
    import sympy

    places, site = component_places(name[:-2], scene.blocks), row[ROLES.index(name[-1])]
    if places is not None:
        return sympy.Symbol(scene.variables[places.start + places.step * site])
    return cast(Any, scene.parameters[name[:-2]])[site]


def flat_hamiltonian(summands: Sequence[Summand], scene: System) -> sympy.Expr | None:
    """The sum of all terms of a Hamiltonian; None if there are no terms, or some are not Hamiltonian."""
    import sympy

    if not summands or any(summand.target is not None for summand in summands):
        return None
    return sympy.Add(*(formula for summand in summands for _, formula in written_out(summand, scene)))


def flat_field(scene: System, part: str | None = None) -> tuple[sympy.Expr, ...]:
    """f(y) or a part of it, one formula for each variable."""
    import sympy

    parts: dict[str | None, list[sympy.Expr]] = {name: [] for name in (None, *scene.variables)}
    for summand in scene.summands:
        if part in (None, summand.part):
            for target, formula in written_out(summand, scene):
                parts[target].append(formula)
    energy = sympy.Add(*parts.pop(None))
    for name, formula in zip(scene.variables, hamiltonian_field(energy, scene), strict=True):
        parts[name].append(formula)
    return tuple(sympy.Add(*parts[name]) for name in scene.variables)


def hamiltonian_field(energy: sympy.Expr, scene: System) -> list[sympy.Expr]:
    """J⁻¹∇H or B∇H; zero for variables outside the structure."""
    import sympy

    field: list[sympy.Expr] = [sympy.Integer(0)] * scene.dimension
    used = energy.free_symbols
    gradient = [energy.diff(symbol) if symbol in used else sympy.Integer(0) for symbol in scene.symbols]
    pair = canonical_blocks(scene.blocks)
    if scene.poisson is not None:
        for i, row in enumerate(scene.poisson):
            products = (filled(b, scene) * g for b, g in zip(row, gradient, strict=False))
            field[i] = sympy.expand_mul(sympy.Add(*products))  # powers of sums stay whole
    elif pair is not None:
        for p, q in zip(range(pair[0].offset, pair[0].end), range(pair[1].offset, pair[1].end), strict=True):
            field[p], field[q] = -gradient[q], gradient[p]
    return field
