"""Declaration of a scene, base system and effects apart: parsing, assembly with the active effects, and table."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Collection, Iterable, Iterator, Mapping, MutableMapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries_base.errors import shorten, shown
from bseries_base.formulas import formula_text
from bseries_base.table import Document
from integrators.core.arguments import as_lists, check_distinct, check_label, is_listed, items
from integrators.core.errors import IntegratorError
from integrators.core.text_files import LARGEST_NUMBER
from integrators.exact.arithmetic import simplest
from integrators.exact.expressions import MAX_LENGTH, decimal_text
from integrators.scenes.model.blocks import (
    ROLES,
    TIME,
    Block,
    canonical_blocks,
    check_symbols,
    component_places,
    read_blocks,
)
from integrators.scenes.model.formulas import read_formula, read_numbers, stable_form
from integrators.scenes.model.terms import KINDS, Effect, Key, Sites, Term, numbered

if TYPE_CHECKING:
    import sympy

    Matrix = tuple[tuple[sympy.Expr, ...], ...]
    Parameters = dict[str, sympy.Expr | tuple[sympy.Expr, ...]]
    Start = dict[str, tuple[sympy.Expr, ...]]


class Namespace(NamedTuple):
    """The names available in formulas."""

    blocks: tuple[Block, ...]
    parameters: Parameters
    # the names in formulas without sites; a parameter with a value for each site is numbered
    flat: MutableMapping[str, str]
    label: str = ""  # the prefix of arguments in messages

    @property
    def scalars(self) -> list[str]:
        """The parameters with one value."""
        return [name for name, value in self.parameters.items() if not isinstance(value, tuple)]

    @property
    def at_sites(self) -> dict[str, tuple[str, int]]:
        """The names that take an index ``_i``: their block or parameter, and the number of its sites."""
        found = {component: (block.name, block.sites) for block in self.blocks for component in block.components}
        return found | {n: (n, len(value)) for n, value in self.parameters.items() if isinstance(value, tuple)}

    def local(self, roles: int) -> list[str]:
        """The names in a formula over rows of `roles` sites."""
        return [*(f"{name}_{role}" for name in self.at_sites for role in ROLES[:roles]), *self.scalars, TIME]

    def targets(self, roles: int) -> Collection[str]:
        """The names of variables whose derivatives a term can contribute to."""
        if roles == 0:
            return ChainMap(*(dict.fromkeys(block.variables) for block in reversed(self.blocks)))
        components = [component for block in self.blocks for component in block.components]
        return [f"{name}_{role}" for name in components for role in ROLES[:roles]]

    def sites(self, over: str | tuple[tuple[int, ...], ...], used: Iterable[str], argument: str) -> Sites:
        """The index set of a term; the local names `used` in it determine the number of sites."""
        if over == "single":
            return Sites("single")
        known = self.at_sites
        owners = dict(known[name[:-2]] for name in used if name[-2:-1] == "_" and name[:-2] in known)
        if len(set(owners.values())) != 1:
            found = " and ".join(f"{count} of {name}" for name, count in sorted(owners.items())) or "none"
            raise IntegratorError(f"{argument} must have names at equally many sites, but had {found}")
        count = next(iter(owners.values()))
        if isinstance(over, str):
            return Sites(over, count)
        largest = max(site for row in over for site in row) + 1
        if largest > count:
            raise IntegratorError(f"{argument} must have site numbers up to {count}, but had {largest}")
        return Sites("table", count, over)


def register_names(
    blocks: Sequence[Block], parameters: Parameters, label: str, taken: dict[str, str]
) -> dict[str, str]:
    """Add the names of blocks and parameters to `taken`, and return those for flat formulas with their meanings."""
    several = {name: value for name, value in parameters.items() if isinstance(value, tuple)}
    flat: dict[str, str] = {}

    def register(names: Iterable[str], what: str, *, in_formulas: bool = False) -> None:
        new = dict.fromkeys(names, what)
        for name in new:
            if name in taken:
                both = f"{taken[name]} and {what}"
                raise IntegratorError(f"names must be different, but {shorten(name)} stands for {both}")
        taken.update(new)
        if in_formulas:
            flat.update(new)

    for block in blocks:
        register((f"the block {block.name}",), f"a block of {label or 'the scene'}".rstrip("."))
    for block in blocks:
        register(block.variables, f"a variable of the block {label}{shorten(block.name)}", in_formulas=True)
    for name in parameters:
        if name not in several:
            register((name,), f"the parameter {label}{shorten(name)}", in_formulas=True)
    for name, value in several.items():
        register(numbered({name: value}), f"a value of the parameter {label}{shorten(name)}", in_formulas=True)
    for name in (*(component for block in blocks for component in block.components), *several):
        register((f"{name}_{role}" for role in ROLES), f"{label}{name} at a site")
    check_distinct(taken, "names")
    return flat


def read_parameters(values: object, argument: str = "parameters") -> Parameters:
    """The values of parameters: exact numbers, or a parameter's own name, which leaves it a symbol."""
    if not isinstance(values, Mapping):
        raise IntegratorError(f"{argument} must map names to numbers, but was {shown(values)}")
    if TIME in values:
        raise IntegratorError(f"{argument} must not be called {TIME}, which is the time, but one was")
    found: Parameters = {}
    for name in check_symbols(values, argument):
        value, place = values[name], f"{argument}.{shorten(name)}"
        if getattr(value, "ndim", 0) or is_listed(value):
            found[name] = read_numbers(items(value, place), place)
            if not found[name]:
                raise IntegratorError(f"{place} must have a number for each site, but was empty")
        else:
            found[name] = read = read_formula(value, (name,), place)
            if read.free_symbols and not read.is_Symbol:
                raise IntegratorError(f"{place} must be a number or its own name, but was {shorten(str(value))!r}")
    return found


def read_summands(hamiltonian: object, field: Any, terms: object, namespace: Namespace) -> dict[Key, sympy.Expr]:
    """The formulas of a field or Hamiltonian, summed by target, sites and part."""
    label = namespace.label
    declared = [] if hamiltonian is None else [Term(hamiltonian=hamiltonian)]
    declared += [] if field is None else [Term(field=field)]
    numbers = len(declared)
    read = []
    for k, term in enumerate([*declared, *items(terms, f"{label}terms")]):
        if not isinstance(term, Term):
            raise IntegratorError(f"{label}terms must be Terms, but one was {shown(term)}")
        read += _read_term(term, namespace, label if k < numbers else f"{label}terms[{k - numbers + 1}].")
    return merged(read)


def merged(formulas: Iterable[tuple[Key, sympy.Expr]]) -> dict[Key, sympy.Expr]:
    """The sums of formulas with equal keys, in their stable forms."""
    gathered: dict[Key, list[sympy.Expr]] = {}
    for key, formula in formulas:
        gathered.setdefault(key, []).append(formula)
    import sympy

    return {
        key: found[0] if len(found) == 1 else stable_form(sympy.Add(*found), "a sum of terms")
        for key, found in gathered.items()
    }


def _read_term(term: Term, namespace: Namespace, place: str) -> Iterator[tuple[Key, sympy.Expr]]:
    from integrators.exact.branches import Sign

    roles = KINDS[term.over] if isinstance(term.over, str) else len(term.over[0])
    names = namespace.local(roles) if roles else namespace.flat
    targets = namespace.targets(roles) if term.field else ()
    for target, written in term.field or ((None, term.hamiltonian),):
        argument = f"{place}hamiltonian" if target is None else f"{place}field.{target}"
        if target is not None and target not in targets:
            known = shorten(", ".join(targets))
            raise IntegratorError(f"{place}field must have equations for {known}, but has one for {target!r:.60}")
        formula = read_formula(written, names, argument)
        if target is None and (jumps := min(map(str, formula.atoms(Sign)), default="")):
            raise IntegratorError(f"{argument} must be continuous, but has {shorten(jumps)}, which jumps")
        used = {str(symbol) for symbol in formula.free_symbols} | {target or ""}
        yield (target, namespace.sites(term.over, used, argument), term.part), formula


def read_start(values: object, blocks: Sequence[Block], argument: str = "start") -> Start:
    """The start values of blocks: a number, a list, or a row for each site; the time t is allowed too."""

    if not isinstance(values, Mapping):
        raise IntegratorError(f"{argument} must map blocks to lists of numbers, but was {shown(values)}")
    sizes = {TIME: 1} | {block.name: block.dimension for block in blocks}
    found: Start = {}
    for name, value in values.items():
        if name not in sizes:
            known = shorten(", ".join(block.name for block in blocks) or "none")
            raise IntegratorError(f"{argument} must have values for {known}, but has some for {name!r:.60}")
        entries = _flattened(value)
        if len(entries) != sizes[name]:
            raise IntegratorError(
                f"{argument}.{name} must have as many values as the block has variables, {sizes[name]}, "
                f"but has {len(entries)}"
            )
        found[name] = read_numbers(entries, f"{argument}.{name}")
    return found


def join_start(values: Start, blocks: Sequence[Block], argument: str = "start") -> tuple[sympy.Expr, ...]:
    """The start values of all variables in the order of the state; the time starts at 0 by default."""
    import sympy

    values = {TIME: (sympy.Integer(0),), **values}
    for block in blocks:
        if block.name not in values:
            known = shorten(", ".join(block.name for block in blocks))
            raise IntegratorError(f"{argument} must have values for {known}, but has none for {block.name}")
    return tuple(value for block in blocks for value in values[block.name])


def _flattened(value: object, depth: int = 2) -> list[object]:
    """The entries of a number, a list, or a list of rows."""
    value = as_lists(value)
    if depth and is_listed(value):
        return [entry for row in value for entry in _flattened(row, depth - 1)]
    return [value]


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
    variables: object, hamiltonian: object, field: Any, terms: object, poisson: object, parameters: object,
    invariants: object, start: object, positive: object, effects: Mapping[str, Effect],
) -> Declaration:  # fmt: skip
    """Parse the arguments of `Scene`, including effects that are off."""
    blocks = read_blocks(variables)
    if not blocks:
        raise IntegratorError("variables must have at least one block, but had none")
    if any(TIME in names != (TIME, TIME) for names in ((block.name, *block.variables) for block in blocks)):
        raise IntegratorError(f"variables.{TIME} must be the time, in a block {TIME} of its own, but was not")
    values = read_parameters(parameters)
    taken: dict[str, str] = {}
    flat = register_names(blocks, values, "", taken)
    for names in (flat, taken):
        names.setdefault(TIME, "the time")
    namespace = Namespace(blocks, values, flat)
    summands = read_summands(hamiltonian, field, terms, namespace)
    if not isinstance(invariants, Mapping) or not all(isinstance(name, str) for name in invariants):
        raise IntegratorError(f"invariants must map names to formulas, but was {shown(invariants)}")
    for name in (*invariants, *effects):
        check_label(name, "names of invariants and effects")
    read = Declaration(
        base=Contribution(blocks, values, summands, read_start(start, blocks)),
        effects={},
        poisson=read_poisson(poisson, flat, blocks[-1].end),
        invariants={name: read_formula(formula, flat, f"invariants.{name}") for name, formula in invariants.items()},
        positive=tuple(read_formula(formula, flat, "positive") for formula in items(positive, "positive")),
    )
    check_equations(assemble(read, ()), read.poisson)
    for name, effect in effects.items():
        read.effects[name] = _read_effect(name, effect, namespace, read, taken)
        check_equations(assemble(read, (name,)), read.poisson, f"effects.{name}.")
        if read.base.start:
            join_start(read.effects[name].start, read.effects[name].blocks, f"effects.{name}.start")
    if flat[TIME] == "the time":  # and not a variable
        if not has_time(read, ()) and any(map(_uses_time, (*read.invariants.values(), *read.positive))):
            what = f"use the time {TIME} where the field does not"
            raise IntegratorError(f"invariants and positive must not {what}, but did")
        if TIME in read.base.start and not has_time(read, read.effects):
            raise IntegratorError(f"start must not have a value for the time {TIME} where nothing uses it, but had one")
    return read


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


def read_poisson(matrix: object, names: Collection[str], dimension: int) -> Matrix | None:
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
    rates = [formula for (target, _, _), formula in system.summands.items() if target == TIME]
    if rates and sum(rates) != 1:
        raise IntegratorError(
            f"{label}field.{TIME} must be 1, since {TIME} is the time, but was {shorten(str(sum(rates)))}"
        )
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
        pair = canonical_blocks(system.blocks)
        if pair is None:
            sizes = ", ".join(f"{block.name} of {block.dimension}" for block in system.blocks)
            raise IntegratorError(
                f"{label}variables must have a block of momenta and one of positions of equal size for a Hamiltonian, "
                'told apart by their names: p and q, which may hold any variables, as in {"p": ["u"], "q": ["w"]}, or '
                f"others such as v and x; but had {shorten(sizes)}"
            )
        for block in pair:
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


BASE = ""
"""The owner of parameters and blocks that belong to no effect."""


class UnknownNameError(IntegratorError):
    """Unknown name of a parameter or block."""


def with_values(scene: Declaration, active: Collection[str], values: Mapping[str, object]) -> Declaration:
    """The declaration with other values of parameters, of the base system or of effects that are on."""

    def count(value: object) -> str:
        return f"a list of {len(value)} numbers" if isinstance(value, tuple) else "a number"

    parts = {BASE: scene.base, **scene.effects}
    owners = {name: owner for owner, part in parts.items() for name in part.parameters}
    for name, value in values.items():
        owner = _owner(name, owners, active, "parameter")
        old, new = parts[owner].parameters[name], read_parameters({name: value})[name]
        if count(old) != count(new):
            raise IntegratorError(f"parameters.{name} must be {count(old)}, as before, but was {count(new)}")
        parts[owner] = parts[owner]._replace(parameters={**parts[owner].parameters, name: new})
    return _joined(scene, parts)


def with_start_values(scene: Declaration, active: Collection[str], values: Mapping[str, object]) -> Declaration:
    """The declaration with other start values of blocks or variables, of the base system or of effects that are on."""
    parts = {BASE: scene.base, **scene.effects}
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


def declaration_table(
    declaration: Declaration, labels: Mapping[str, str | None], effects: Mapping[str, Effect], active: tuple[str, ...]
) -> Document:
    """A declaration as nested dictionaries and lists of integers and text, without empty entries."""
    data: Document = {**labels, "active": list(active)}
    data |= _contribution_table(declaration.base)
    if declaration.poisson is not None:
        data["poisson"] = _numbers(declaration.poisson, "poisson")
    data["positive"] = [_text(formula, "positive") for formula in declaration.positive]
    data["invariants"] = {name: _text(value, f"invariants.{name}") for name, value in declaration.invariants.items()}
    data["effects"] = {
        name: {"summary": effects[name].summary} | _contribution_table(effect)
        for name, effect in declaration.effects.items()
    }
    return _without_empty(data)


def _without_empty(table: Mapping[str, object]) -> Document:
    """The table without keys whose value is None or empty, on all levels."""
    inner = {key: _without_empty(value) if isinstance(value, dict) else value for key, value in table.items()}
    return {key: value for key, value in inner.items() if value not in (None, [], {})}


def _contribution_table(part: Contribution) -> Document:
    """The table of the base system or of an effect."""

    def rows(values: list[object], length: int) -> list[object]:
        return [values[k : k + length] for k in range(0, len(values), length)] if length > 1 else values

    at_site = {block.name: len(block.components) for block in part.blocks}
    return {
        "variables": {block.name: block.size for block in part.blocks},
        **_formulas_table(part.summands),
        "parameters": {name: _numbers(value) for name, value in part.parameters.items()},
        "start": {name: rows(_numbers(values), at_site.get(name, 1)) for name, values in part.start.items()},
        "breaks": list(part.breaks),
    }


def _formulas_table(summands: Mapping[Key, sympy.Expr]) -> Document:
    """The keys hamiltonian, field and terms; a sum too long for one text is split into several terms."""
    table: Document = {}
    terms: dict[Any, Document] = {}
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

    from integrators.scenes.model.black_boxes import check_formulas

    check_formulas([formula], "a file")
    text = formula_text(formula).replace("**", "^")
    if len(text) <= MAX_LENGTH:
        yield text
        return
    summands = list(sympy.Add.make_args(formula))
    for half in (summands[::2], summands[1::2]):
        yield from _texts(sympy.Add(*half))


def _text(formula: sympy.Expr, argument: str) -> str:
    text, *others = _texts(formula)
    if others:
        length = len(formula_text(formula).replace("**", "^"))
        raise IntegratorError(f"{argument} must have at most {MAX_LENGTH} characters in a file, but had {length}")
    return text


def _numbers(value: Any, argument: str = "a number") -> Any:
    """An integer, the text of a decimal or formula, or a list of these for all sites."""
    if isinstance(value, tuple):
        return [_numbers(entry, argument) for entry in value]
    if not value.is_Rational:
        return _text(value, argument)
    exact = simplest(value)
    return int(exact) if exact.denominator == 1 and abs(exact) < LARGEST_NUMBER else decimal_text(exact)
