"""Two forms of scenes: flat, with one formula for each variable, and local, the input of code generation.

Local terms have few local variables, with numbers for parameters. A formula over pairs of sites that depends only on
differences, such as a force between particles, becomes a formula in these differences; a sum is split into pieces
without common variables. A pair of atoms in the plane therefore has two local variables, and each term of the kinetic
energy has one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, cast

from bseries_base.errors import shorten
from integrators.core.errors import IntegratorError
from integrators.exact.arithmetic import renamed, substituted
from integrators.scenes.model.blocks import ROLES, TIME, Block, canonical_blocks, component_places
from integrators.scenes.model.system import LOCAL_NAME, VALUE, Argument, Data, LocalTerm, Output, Place, System
from integrators.scenes.model.terms import Sites, Summand

if TYPE_CHECKING:
    import sympy


def filled(formula: sympy.Expr, scene: System) -> sympy.Expr:
    """The formula with numbers for parameters; parameters indexed by a site (``m_i``) stay symbols."""
    import sympy

    values = scene.parameter_values
    symbols = cast("set[sympy.Symbol]", formula.free_symbols)
    used = {s: values[s.name] for s in symbols if s.name in values}
    try:
        result = substituted(formula, used)
    except ArithmeticError as error:
        raise IntegratorError(f"parameters must make {shorten(str(formula))} small enough, but it {error}") from None
    if used and result.has(sympy.I):
        given = ", ".join(sorted(f"{symbol} = {shorten(str(value))}" for symbol, value in used.items()))
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
    return renamed(formula, {symbol: _at_row(str(symbol), row, scene) for symbol in symbols})


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
    return cast("tuple[sympy.Expr, ...]", scene.parameters[name[:-2]])[site]


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
            expanded: Any = sympy.expand_mul(sympy.Add(*products))  # powers of sums stay whole
            field[i] = expanded
    elif pair is not None:
        for p, q in zip(range(pair[0].offset, pair[0].end), range(pair[1].offset, pair[1].end), strict=True):
            field[p], field[q] = -gradient[q], gradient[p]
    return field


def constant_terms(scene: System) -> tuple[LocalTerm, ...]:
    """The constant terms of a Hamiltonian, which do not contribute to the field."""
    return tuple(term for term in all_terms(scene) if not term.outputs)


def all_terms(scene: System) -> Iterator[LocalTerm]:
    """The terms of a scene; parameters that are symbols stay in the formulas."""
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
    data = [
        Data(ROLES.index(s.name[-1]), cast("tuple[sympy.Expr, ...]", scene.parameters[s.name[:-2]])) for s in at_sites
    ]
    formula = renamed(formula, {symbol: sympy.Symbol(f"d{k}") for k, symbol in enumerate(at_sites)})
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
            difference = renamed(formula, {symbol: dummy + sympy.Symbol(partner)})
            if sympy.Symbol(partner) not in difference.free_symbols:
                local, formula, minus = dummy, difference, _place(partner, sites, scene)
                free = formula.free_symbols
        locals_.append(local)
        arguments.append(Argument(cast(Place, _place(symbol.name, sites, scene)), minus))
    # at once: a variable of the scene may be called x0
    return renamed(formula, {local: sympy.Symbol(f"x{k}") for k, local in enumerate(locals_)}), arguments


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
