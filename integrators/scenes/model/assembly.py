"""Declaration of a scene, with base system and effects separate: assembly with the active effects and table."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten, shown
from integrators.core.text_files import LARGEST_NUMBER
from integrators.exact.expressions import MAX_LENGTH, decimal_text
from integrators.scenes.model.blocks import TIME, Block, canonical_blocks, component_places, read_blocks
from integrators.scenes.model.declarations import (
    Namespace,
    join_start,
    merged,
    read_parameters,
    read_start,
    read_summands,
    register_names,
)
from integrators.scenes.model.formulas import formula_text, read_formula
from integrators.scenes.model.terms import Effect, Key, Sites

if TYPE_CHECKING:
    import sympy

    from integrators.scenes.model.declarations import Parameters, Start

    Matrix = tuple[tuple[sympy.Expr, ...], ...]


class Contribution(NamedTuple):
    """The base system or an effect: exact formulas in checked names; `breaks` is for effects only."""

    blocks: tuple[Block, ...]
    parameters: Parameters
    summands: dict[Key, sympy.Expr]
    start: Start
    breaks: tuple[str, ...] = ()


class Declaration(NamedTuple):
    """The data that define a scene, except for the active effects."""

    base: Contribution
    effects: dict[str, Contribution]
    poisson: Matrix | None
    invariants: dict[str, sympy.Expr]
    positive: tuple[sympy.Expr, ...]


class Assembly(NamedTuple):
    """Base system with active effects; `timed` if the time was added to the variables."""

    blocks: tuple[Block, ...]
    parameters: Parameters
    summands: dict[Key, sympy.Expr]
    timed: bool


def read_declaration(
    variables: Any, hamiltonian: Any, field: Any, terms: Any, poisson: Any, parameters: Any, invariants: Any,
    start: Any, positive: Any, effects: Mapping[str, Effect],
) -> Declaration:  # fmt: skip
    """Parse the arguments of `Scene`, including effects that are off."""
    blocks = read_blocks(variables)
    if not blocks:
        raise IntegratorError("variables must have at least one block, but had none")
    if any(block.name == TIME and block.variables != (TIME,) for block in blocks):
        raise IntegratorError(f"variables.{TIME} must be the time alone, but had other variables")
    values = read_parameters(parameters)
    taken: dict[str, str] = {}
    flat = register_names(blocks, values, "", taken)
    for names in (flat, taken):
        names.setdefault(TIME, "the time")
    namespace = Namespace(blocks, values, flat)
    summands = read_summands(hamiltonian, field, terms, namespace)
    read = Declaration(
        base=Contribution(blocks, values, summands, read_start(start, blocks)),
        effects={},
        poisson=read_poisson(poisson, flat, blocks[-1].end),
        invariants=_read_invariants(invariants, flat),
        positive=tuple(read_formula(formula, flat, "positive") for formula in items(positive, "positive")),
    )
    check_equations(assemble(read, ()), read.poisson)
    for name, effect in effects.items():
        read.effects[name] = _read_effect(name, effect, namespace, read, taken)
        check_equations(assemble(read, (name,)), read.poisson, f"effects.{name}.")
        if read.base.start:
            join_start(read.effects[name].start, read.effects[name].blocks, f"effects.{name}.start")
    if flat[TIME] == "the time":
        _check_time(read)
    return read


def _check_time(scene: Declaration) -> None:
    """Refuse formulas and start values of the time in an autonomous system."""
    timed = has_time(scene, ())
    if not timed and any(map(_uses_time, (*scene.invariants.values(), *scene.positive))):
        raise IntegratorError(f"invariants and positive must not use the time {TIME} where the field does not, but did")
    if TIME in scene.base.start and not has_time(scene, scene.effects):
        raise IntegratorError(f"start must not have a value for the time {TIME} where nothing uses it, but had one")


def has_time(scene: Declaration, active: Iterable[str]) -> bool:
    """Whether the field depends on the time."""
    formulas = [*scene.base.summands.values(), *(entry for row in scene.poisson or () for entry in row)]
    formulas += [formula for name in active for formula in scene.effects[name].summands.values()]
    return any(map(_uses_time, formulas))


def _uses_time(formula: sympy.Expr) -> bool:
    return any(str(symbol) == TIME for symbol in formula.free_symbols)


def _read_effect(name: str, effect: Effect, base: Namespace, scene: Declaration, taken: dict[str, str]) -> Contribution:
    label = f"effects.{name}."
    blocks = read_blocks(effect.variables, f"{label}variables", base.blocks[-1].end)
    parameters = read_parameters(effect.parameters, f"{label}parameters")
    flat = ChainMap(register_names(blocks, parameters, label, taken), base.flat)
    namespace = Namespace((*base.blocks, *blocks), {**base.parameters, **parameters}, flat, label)
    summands = read_summands(effect.hamiltonian, effect.field or None, effect.terms, namespace)
    start = read_start(effect.start, blocks, f"{label}start")
    for broken in effect.breaks:
        if broken not in scene.invariants:
            known = shorten(", ".join(scene.invariants) or "none")
            raise IntegratorError(f"{label}breaks must be of the invariants {known}, but one was {broken!r:.60}")
    return Contribution(blocks, parameters, summands, start, effect.breaks)


def _read_invariants(formulas: Any, names: Mapping[str, str]) -> dict[str, sympy.Expr]:
    if not isinstance(formulas, Mapping) or not all(isinstance(name, str) for name in formulas):
        raise IntegratorError(f"invariants must map names to formulas, but was {shown(formulas)}")
    return {name: read_formula(formula, names, f"invariants.{name}") for name, formula in formulas.items()}


def read_poisson(matrix: Any, names: Collection[str], dimension: int) -> Matrix | None:
    """The matrix B of a Poisson structure, checked to be square and skew-symmetric."""
    if matrix is None:
        return None
    rows = [items(row, f"row {i} of poisson") for i, row in enumerate(items(matrix, "poisson"), 1)]
    if not 1 <= len(rows) <= dimension or any(len(row) != len(rows) for row in rows):
        shape = " + ".join(str(len(row)) for row in rows) or "no"
        raise IntegratorError(
            f"poisson must be square with 1 to {dimension} rows, but had rows of {shorten(shape)} entries"
        )
    read = [
        tuple(read_formula(x, names, f"poisson[{i}][{j}]") for j, x in enumerate(row, 1))
        for i, row in enumerate(rows, 1)
    ]
    for i, row in enumerate(read):
        for j in range(i + 1):
            total = row[j] + read[j][i]
            if total.expand() != 0 and not total.equals(0):
                raise IntegratorError(
                    f"poisson must be skew-symmetric, but its entries ({i + 1}, {j + 1}) and ({j + 1}, {i + 1}) "
                    f"were {shorten(str(row[j]))} and {shorten(str(read[j][i]))}"
                )
    return tuple(read)


def assemble(scene: Declaration, active: Collection[str]) -> Assembly:
    """The base system with the active effects; an explicit time becomes a variable t with t' = 1."""
    import sympy

    parts = [scene.base, *(scene.effects[name] for name in active)]
    blocks: list[Block] = []
    for block in (block for part in parts for block in part.blocks):
        blocks.append(block._replace(offset=blocks[-1].end if blocks else 0))
    summands = merged(item for part in parts for item in part.summands.items())
    timed = has_time(scene, active) and not any(TIME in block.variables for block in blocks)
    if timed:
        blocks.append(Block(TIME, (TIME,), blocks[-1].end, 1, (TIME,)))
        summands[TIME, Sites("single"), None] = sympy.Integer(1)
    parameters = {name: value for part in parts for name, value in part.parameters.items()}
    return Assembly(tuple(blocks), parameters, summands, timed)


def check_equations(system: Assembly, poisson: Matrix | None, label: str = "") -> None:
    """Refuse a Hamiltonian without a symplectic or Poisson structure, and variables without an equation."""
    known = bytearray(system.blocks[-1].end)
    hamiltonian = [sites for target, sites, _ in system.summands if target is None]
    if poisson is not None:
        if not hamiltonian:
            raise IntegratorError("hamiltonian must be given where poisson is, but was not")
        if any(sites.kind != "single" for sites in hamiltonian):
            raise IntegratorError(
                f"{label}terms of the Hamiltonian must be single where poisson is given, but one was not"
            )
        known[: len(poisson)] = b"\1" * len(poisson)
    elif hamiltonian:
        for block in _conjugate_blocks(system.blocks, label):
            known[block.offset : block.end] = b"\1" * block.dimension
    named = set()
    for target, sites, _ in system.summands:
        if target is not None and sites.kind == "single":
            named.add(target)
        elif target is not None:
            places = component_places(target[:-2], system.blocks) or slice(0)
            known[places] = b"\1" * sites.count
    if all(known):
        return
    variables = (name for block in system.blocks for name in block.variables)
    missing = [name for name, found in zip(variables, known, strict=True) if not found and name not in named]
    if missing:
        names = shorten(", ".join(missing))
        raise IntegratorError(f"{label}field must have an equation for every variable, but has none for {names}")


def _conjugate_blocks(blocks: Sequence[Block], label: str) -> tuple[Block, Block]:
    pair = canonical_blocks(blocks)
    if pair is None:
        sizes = ", ".join(f"{block.name} of {block.dimension}" for block in blocks)
        raise IntegratorError(
            f"{label}variables must have a block of momenta and one of positions of equal size for a Hamiltonian, told "
            'apart by their names: p and q, which may hold any variables, as in {"p": ["u"], "q": ["w"]}, or others '
            f"such as v and x; but had {shorten(sizes)}"
        )
    return pair


BASE = ""
"""The owner of parameters and blocks that belong to no effect."""


class UnknownNameError(IntegratorError):
    """Unknown name of a parameter or block."""


def with_values(scene: Declaration, active: Collection[str], values: Mapping[str, Any]) -> Declaration:
    """The declaration with other values of parameters, of the base system or of effects that are on."""
    parts = _parts(scene)
    owners = {name: owner for owner, part in parts.items() for name in part.parameters}
    for name, value in values.items():
        owner = _owner(name, owners, active, "parameter")
        old, new = parts[owner].parameters[name], read_parameters({name: value})[name]
        if _count(old) != _count(new):
            raise IntegratorError(f"parameters.{name} must be {_count(old)}, as before, but was {_count(new)}")
        parts[owner] = parts[owner]._replace(parameters={**parts[owner].parameters, name: new})
    return _joined(scene, parts)


def with_start_values(scene: Declaration, active: Collection[str], values: Mapping[str, Any]) -> Declaration:
    """The declaration with other start values of blocks or variables, of the base system or of effects that are on."""
    parts = _parts(scene)
    blocks = [(block, owner) for owner, part in parts.items() for block in part.blocks]
    owners = {block.name: owner for block, owner in blocks}
    entries = {name: (block.name, at) for block, _ in blocks for at, name in enumerate(block.variables)}
    if TIME in values and TIME not in owners and has_time(scene, active):
        owners[TIME] = BASE
        parts = {
            owner: part._replace(start={k: v for k, v in part.start.items() if k != TIME})
            for owner, part in parts.items()
        }
    for name, value in values.items():
        block, at = (name, None) if name in owners else entries.get(name, (name, None))
        owner = _owner(block, owners, active, "block")
        if at is not None:
            whole = parts[owner].start.get(block, ())
            value = [*whole[:at], value, *whole[at + 1 :]]
        new = read_start({block: value}, parts[owner].blocks)
        parts[owner] = parts[owner]._replace(start={**parts[owner].start, **new})
    return _joined(scene, parts)


def _parts(scene: Declaration) -> dict[str, Contribution]:
    return {BASE: scene.base, **scene.effects}


def _joined(scene: Declaration, parts: dict[str, Contribution]) -> Declaration:
    return scene._replace(base=parts[BASE], effects={name: parts[name] for name in scene.effects})


def _owner(name: str, owners: Mapping[str, str], active: Collection[str], argument: str) -> str:
    """The effect that declares a name, or `BASE`; names of effects that are off are refused."""
    owner = owners.get(name)
    if owner is not None and (owner == BASE or owner in active):
        return owner
    known = shorten(", ".join(key for key, value in owners.items() if value == BASE or value in active))
    those = f"the {argument}s are {known}" if known else "there are none"
    off = f" unless the effect {owner} is on" if owner else ""
    raise UnknownNameError(f"there is no {argument} {shorten(name)}{off}; {those}")


def _count(value: Any) -> str:
    return f"a list of {len(value)} numbers" if isinstance(value, tuple) else "a number"


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
    from integrators.scenes.model.black_boxes import check_formulas

    check_formulas([formula], "a file")
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
