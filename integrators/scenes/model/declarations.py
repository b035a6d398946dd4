"""Parsing of declarations: names, parameters, formulas and start values."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Collection, Iterable, Iterator, Mapping, MutableMapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.core.arguments import as_lists, is_listed, items
from integrators.core.errors import IntegratorError, shorten, shown
from integrators.scenes.model.blocks import ROLES, TIME, Block, check_symbols
from integrators.scenes.model.formulas import read_formula, read_numbers, stable_form
from integrators.scenes.model.terms import KINDS, Key, Sites, Term

if TYPE_CHECKING:
    import sympy

    Parameters = dict[str, sympy.Expr | tuple[sympy.Expr, ...]]
    Start = dict[str, tuple[sympy.Expr, ...]]


class Namespace(NamedTuple):
    """The names available in formulas.

    Attributes:
        blocks: The blocks.
        parameters: The parameters.
        flat: The names in formulas without sites; a parameter with a value for each site is numbered.
        label: The prefix of arguments in messages.
    """

    blocks: tuple[Block, ...]
    parameters: Parameters
    flat: MutableMapping[str, str]
    label: str = ""

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


def numbered(parameters: Mapping[str, Any]) -> dict[str, sympy.Expr]:
    """The values of site parameters under the names m1, m2, …"""
    return {
        f"{name}{k}": entry
        for name, value in parameters.items()
        if isinstance(value, tuple)
        for k, entry in enumerate(value, 1)
    }


def register_names(
    blocks: Sequence[Block], parameters: Parameters, label: str, taken: dict[str, str]
) -> dict[str, str]:
    """Add the names of blocks and parameters to `taken`, and return those for flat formulas with their meanings."""
    several = {name: value for name, value in parameters.items() if isinstance(value, tuple)}
    meanings = [(block.variables, f"a variable of the block {label}{block.name}") for block in blocks]
    meanings += [((name,), f"the parameter {label}{name}") for name in parameters if name not in several]
    meanings += [
        (numbered({name: value}), f"a value of the parameter {label}{name}") for name, value in several.items()
    ]
    for block in blocks:
        _register((f"the block {block.name}",), f"a block of {label or 'the scene'}".rstrip("."), taken)
    flat: dict[str, str] = {}
    for names, what in meanings:
        flat |= _register(names, what, taken)
    for name in (*(component for block in blocks for component in block.components), *several):
        _register((f"{name}_{role}" for role in ROLES), f"{label}{name} at a site", taken)
    return flat


def _register(names: Iterable[str], what: str, taken: dict[str, str]) -> dict[str, str]:
    new = dict.fromkeys(names, what)
    for name in new:
        if name in taken:
            raise IntegratorError(f"names must be different, but {shorten(name)} stands for {taken[name]} and {what}")
    taken.update(new)
    return new


def read_parameters(values: Any, argument: str = "parameters") -> Parameters:
    """The values of parameters: exact numbers, or a parameter's own name, which leaves it a symbol."""
    if not isinstance(values, Mapping):
        raise IntegratorError(f"{argument} must map names to numbers, but was {shown(values)}")
    if TIME in values:
        raise IntegratorError(f"{argument} must not be called {TIME}, which is the time, but one was")
    return {name: _read_parameter(name, values[name], f"{argument}.{name}") for name in check_symbols(values, argument)}


def _read_parameter(name: str, value: Any, argument: str) -> sympy.Expr | tuple[sympy.Expr, ...]:
    if getattr(value, "ndim", 0) or is_listed(value):
        numbers = read_numbers(items(value, argument), argument)
        if not numbers:
            raise IntegratorError(f"{argument} must have a number for each site, but was empty")
        return numbers
    read = read_formula(value, (name,), argument)
    if read.free_symbols and not read.is_Symbol:
        raise IntegratorError(f"{argument} must be a number or its own name, but was {shorten(str(value))!r}")
    return read


def read_summands(hamiltonian: Any, field: Any, terms: Any, namespace: Namespace) -> dict[Key, sympy.Expr]:
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
    roles = KINDS[term.over] if isinstance(term.over, str) else len(term.over[0])
    names = namespace.local(roles) if roles else namespace.flat
    if not term.field:
        from integrators.exact.branches import Sign

        formula = read_formula(term.hamiltonian, names, place + "hamiltonian")
        if jumps := min(map(str, formula.atoms(Sign)), default=""):
            raise IntegratorError(f"{place}hamiltonian must be continuous, but has {shorten(jumps)}, which jumps")
        yield (None, _sites(term, formula, None, namespace, place + "hamiltonian"), term.part), formula
    targets = namespace.targets(roles) if term.field else ()
    for target, written in term.field:
        if target not in targets:
            raise IntegratorError(
                f"{place}field must have equations for {shorten(', '.join(targets))}, but has one for {target!r:.60}"
            )
        formula = read_formula(written, names, f"{place}field.{target}")
        yield (target, _sites(term, formula, target, namespace, f"{place}field.{target}"), term.part), formula


def _sites(term: Term, formula: sympy.Expr, target: str | None, namespace: Namespace, argument: str) -> Sites:
    used = {str(symbol) for symbol in formula.free_symbols} | {target or ""}
    return namespace.sites(term.over, used, argument)


def read_start(values: Any, blocks: Sequence[Block], argument: str = "start") -> Start:
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


def _flattened(value: Any, depth: int = 2) -> list[Any]:
    """The entries of a number, a list, or a list of rows."""
    value = as_lists(value)
    if depth and is_listed(value):
        return [entry for row in value for entry in _flattened(row, depth - 1)]
    return [value]
