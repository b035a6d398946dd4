"""Local form of a scene: terms in few local variables with numbers for parameters, the input of code generation.

A formula over pairs of sites that depends only on differences, such as a force between particles, becomes a formula in
these differences; a sum is split into pieces without common variables. A pair of atoms in the plane therefore has two
local variables, and each term of the kinetic energy has one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

from integrators.core.errors import IntegratorError
from integrators.scenes.model.blocks import ROLES, TIME, Block, canonical_blocks, component_places
from integrators.scenes.model.system import LOCAL_NAME, VALUE, Argument, Data, LocalTerm, Output, Place, System
from integrators.scenes.model.terms import Sites, Summand
from integrators.scenes.particles.expansion import filled, hamiltonian_field, is_local

if TYPE_CHECKING:
    import sympy


def local_terms_of(scene: System) -> tuple[LocalTerm, ...]:
    """The terms of a scene; parameters that are symbols stay in the formulas."""
    return tuple(term for term in _all_terms(scene) if term.outputs)


def constant_terms(scene: System) -> tuple[LocalTerm, ...]:
    """The constant terms of a Hamiltonian, which do not contribute to the field."""
    return tuple(term for term in _all_terms(scene) if not term.outputs)


def _all_terms(scene: System) -> Iterator[LocalTerm]:
    for summand in _with_field_of_poisson(scene):
        formula = filled(summand.formula, scene)
        for piece in independent_pieces(formula, _variables_in(formula, summand.sites, scene)):
            yield _local_term(piece, summand, scene)


def _with_field_of_poisson(scene: System) -> list[Summand]:
    """The summands, with B∇H in place of H for a Poisson structure."""
    if scene.poisson is None:
        return list(scene.summands)
    kept = [summand for summand in scene.summands if summand.target is not None]
    for summand in scene.summands:
        if summand.target is None:
            field = hamiltonian_field(filled(summand.formula, scene), scene)
            pieces = zip(field, scene.variables, strict=True)
            kept += [Summand(formula, name, summand.sites, summand.part) for formula, name in pieces if formula != 0]
    return kept


def _variables_in(formula: sympy.Expr, sites: Sites, scene: System) -> list[sympy.Symbol]:
    """The variables in a formula (without parameters of sites), sorted by name."""
    found = []
    for symbol in sorted(cast("set[sympy.Symbol]", formula.free_symbols), key=str):
        if _place(symbol.name, sites, scene) is not None:
            found.append(symbol)
        elif (sites.kind == "single" or not is_local(symbol.name, scene)) and LOCAL_NAME.fullmatch(symbol.name):
            raise IntegratorError(f"parameters.{symbol.name} must have another name to stay a symbol, but was a symbol")
    return found


def independent_pieces(formula: sympy.Expr, variables: Sequence[sympy.Symbol]) -> list[sympy.Expr]:
    """The summands of a formula, grouped by common variables; a constant comes first.

    Example:
        >>> import sympy
        >>> p, q = sympy.symbols("p q")
        >>> independent_pieces(p**2/2 - sympy.cos(q) + 3*q + 1, [p, q])
        [1, p**2/2, 3*q - cos(q)]
    """
    import sympy

    order: dict[sympy.Basic, int] = {symbol: k for k, symbol in enumerate(variables)}
    first = list(range(len(variables)))  # union-find: an earlier variable of the same piece, or the variable itself

    def find(k: int) -> int:
        while first[k] != k:
            first[k] = k = first[first[k]]
        return k

    summands = [
        (summand, [order[s] for s in summand.free_symbols if s in order]) for summand in _summands(formula, order)
    ]
    for _, used in summands:
        roots = sorted(map(find, used))
        for root in roots:
            first[root] = roots[0]
    pieces: dict[int, list[sympy.Expr]] = {}
    for summand, used in summands:
        pieces.setdefault(find(used[0]) if used else -1, []).append(summand)
    return [sympy.Add(*pieces[k]) for k in sorted(pieces)]


def _summands(formula: sympy.Expr, variables: Iterable[sympy.Basic]) -> Iterator[sympy.Expr]:
    """The terms of a sum, multiplied by its constant factor."""
    import sympy

    for summand in sympy.Add.make_args(formula):
        factor, rest = cast("tuple[sympy.Expr, sympy.Expr]", summand.as_independent(*variables, as_Add=False))
        if rest.is_Add:
            yield from (factor * inner for inner in _summands(rest, variables))
        else:
            yield summand


def _local_term(formula: sympy.Expr, summand: Summand, scene: System) -> LocalTerm:
    import sympy

    formula, arguments = _local_arguments(formula, summand.sites, scene)
    at_sites = sorted((s for s in cast("set[sympy.Symbol]", formula.free_symbols) if is_local(s.name, scene)), key=str)
    data = [Data(ROLES.index(s.name[-1]), cast(Any, scene.parameters[s.name[:-2]])) for s in at_sites]
    formula = _replaced(formula, {symbol: sympy.Symbol(f"d{k}") for k, symbol in enumerate(at_sites)})
    if summand.target is not None:
        outputs = [Output(VALUE, cast(Place, _place(summand.target, summand.sites, scene)), 1)]
    else:
        outputs = _hamiltonian_outputs(arguments, scene.blocks)
    return LocalTerm(formula, tuple(arguments), tuple(data), tuple(outputs), summand.sites, summand.part)


def _local_arguments(formula: sympy.Expr, sites: Sites, scene: System) -> tuple[sympy.Expr, list[Argument]]:
    """The formula in x0, x1, …: values at a site, or differences of two sites if it depends only on these."""
    import sympy

    variables = _variables_in(formula, sites, scene)
    names = {symbol.name for symbol in variables}
    arguments: list[Argument] = []
    locals_: list[sympy.Symbol] = []
    free = formula.free_symbols
    for symbol in variables:
        if symbol not in free:  # part of an earlier difference
            continue
        local, minus = symbol, None
        partner = symbol.name[:-1] + "j"
        if sites.roles == 2 and partner in names - {symbol.name}:
            dummy = sympy.Dummy()
            difference = _replaced(formula, {symbol: dummy + sympy.Symbol(partner)})
            if sympy.Symbol(partner) not in difference.free_symbols:
                local, formula, minus = dummy, difference, _place(partner, sites, scene)
                free = formula.free_symbols
        locals_.append(local)
        arguments.append(Argument(cast(Place, _place(symbol.name, sites, scene)), minus))
    # at once: a variable of the scene may be called x0
    return _replaced(formula, {local: sympy.Symbol(f"x{k}") for k, local in enumerate(locals_)}), arguments


def _replaced(formula: sympy.Expr, rule: Mapping[Any, sympy.Expr]) -> sympy.Expr:
    return cast("sympy.Expr", formula.xreplace(rule))


def _place(name: str, sites: Sites, scene: System) -> Place | None:
    """The place of a variable in the state; None for other names."""
    if sites.kind == "single" or name == TIME:
        return Place(0, scene.places[name], 0) if name in scene.places else None
    places = component_places(name[:-2], scene.blocks) if is_local(name, scene) else None
    return None if places is None else Place(ROLES.index(name[-1]), places.start, places.step)


def _hamiltonian_outputs(arguments: Sequence[Argument], blocks: Sequence[Block]) -> list[Output]:
    """p' = −∂H/∂q and q' = ∂H/∂p, with ∂H/∂y[plus] = ∂/∂x and ∂H/∂y[minus] = −∂/∂x."""
    pair = canonical_blocks(blocks)
    assert pair is not None  # checked by read_declaration
    momenta, positions = pair
    outputs = []
    for k, argument in enumerate(arguments):
        for place, sign in ((argument.plus, 1), (argument.minus, -1)):
            for own, other, direction in ((momenta, positions, 1), (positions, momenta, -1)):
                if place is not None and own.offset <= place.offset < own.end:
                    conjugate = place._replace(offset=place.offset - own.offset + other.offset)
                    outputs.append(Output(k, conjugate, sign * direction))
    return outputs
