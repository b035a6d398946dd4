"""Functions of a scene: its field, Hamiltonian and first integrals.

Terms over single variables become scalar code, and terms over particles loops around local formulas, or SIMD lanes for
pairs. Nothing is allocated. The text depends on formulas, blocks and numbers only, not on names or on effects that are
off. A site is the position of a particle in the arrays of a scene, and a row of sites holds the particles of one
summand.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from itertools import chain, groupby
from types import ModuleType
from typing import Generic, NamedTuple, TypeAlias, TypeVar, cast

import sympy

from bseries_base.lowering import MOST_PERMUTED, WIDTH
from integrators.compile.modules import load_module
from integrators.compile.printer import KEPT, Assign, ModuleText, count_operations, indented, source_lines
from integrators.scenes.model.system import Argument, Data, LocalTerm, Output, Place, System, output_formula
from integrators.scenes.model.terms import Sites
from integrators.scenes.particles.expansion import constant_terms, filled, flat_hamiltonian

K = TypeVar("K", bound=Hashable)


def compiled_scene(scene: System) -> ModuleType:
    """Compile the functions of a scene, or load them from the cache on disk.

    Example:
        >>> import numpy as np
        >>> from integrators.scenes.scene import Scene
        >>> pendulum = compiled_scene(Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)"))
        >>> out = np.empty(2)
        >>> pendulum.field(np.array([0.5, 0.0]), out)
        >>> out, pendulum.energy(np.array([0.5, 0.0]))
        (array([-0. ,  0.5]), -0.875)
    """
    source = scene_source(scene)
    return load_module(source, keep=KEPT in source)


def scene_source(scene: System) -> str:
    """Write the source of the functions of a scene.

    Example:
        >>> from integrators.scenes.scene import Scene
        >>> print(scene_source(Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)")))
        ... # doctest: +ELLIPSIS
        \"""The field f of y' = f(y) ...
        def field(y, out):
            \"""Put f(y) in out.\"""
            y0 = y[0]
            y1 = y[1]
            out[0] = -sin(y1)
            out[1] = y0
        ...
    """
    writer = ModuleText()
    field = field_lines(scene.numeric_terms, lambda term: term.outputs, range(scene.dimension), writer)
    writer.function("field(y, out)", "Put f(y) in out.", field)
    if scene.is_hamiltonian:
        writer.function("energy(y)", "The Hamiltonian at y.", energy_lines(scene, writer))
    if scene.invariants:
        formulas = [filled(formula, scene) for formula in scene.invariants.values()]
        lines = flat_lines(scene, {f"out[{k}]": formula for k, formula in enumerate(formulas)}, writer)
        writer.function("invariants(y, out)", "Put the first integrals in out.", lines)
    return writer.source(scene)


def flat_lines(scene: System, outputs: Mapping[str, sympy.Expr], writer: ModuleText) -> list[str]:
    """Statements that assign formulas in the variables of a scene to targets."""
    total = SiteSum.flat(scene, outputs)
    return total.lines({target: Assign(target, "=", formula) for target, formula in total.outputs.items()}, writer)


def field_lines(
    terms: Iterable[LocalTerm],
    outputs: Callable[[LocalTerm], Iterable[Output]],
    entries: Iterable[int],
    writer: ModuleText,
) -> list[str]:
    """Statements for the outputs and entries of a piece of a field: first contributions are assigned, others added."""
    lines: list[str] = []
    assigned: set[int] = set()
    touched: set[int] = set()
    for total in gathered(terms, lambda term: ((x.place, output_formula(term, x)) for x in outputs(term))):
        statements = {}
        for place in sorted(total.outputs):
            covered = total.covered(place)
            assigns = bool(covered) and covered.isdisjoint(touched)
            statements[place] = Assign(entry("out", place), "=" if assigns else "+=", total.outputs[place])
            touched |= covered
            assigned |= covered if assigns else set()
        lines += total.lines(statements, writer)
    return [*zeros(set(entries) - assigned), *lines]


def energy_lines(scene: System, writer: ModuleText) -> list[str]:
    """Statements for the Hamiltonian."""
    if scene.poisson is not None:
        hamiltonian = flat_hamiltonian(scene.summands, scene)
        assert hamiltonian is not None  # of which a Poisson matrix gives the field
        sums = [SiteSum.flat(scene, {"total": hamiltonian})]  # local terms give the field
    else:
        constants = []  # local terms omit these, because the field does not need them
        for term in constant_terms(scene):
            constants += [term.formula.xreplace(term.data_at(row)) for row in term.sites.rows()]
        constant = SiteSum.flat(scene, {"total": sympy.Add(*constants)})
        sums = gathered(scene.numeric_terms, lambda term: [("total", term.formula)], constant)
    lines: list[str] = []
    for k, part in enumerate(sums):
        lines += part.lines({"total": Assign("total", "+=" if k else "=", part.outputs["total"])}, writer)
    return [*lines, "return total"]


def gathered(
    terms: Iterable[LocalTerm],
    outputs: Callable[[LocalTerm], Iterable[tuple[K, sympy.Expr]]],
    first: SiteSum[K] | None = None,
) -> list[SiteSum[K]]:
    """Sums of terms over the same sites: over single variables, then over each particle, then over several."""
    sums = {} if first is None else {first.sites: first}
    for term in terms:
        sums.setdefault(term.sites, SiteSum(term.sites)).add(term, outputs(term))
    return sorted(sums.values(), key=lambda total: total.sites.roles if total.sites.kind != "table" else len(INDICES))


INDICES = ("i", "j", "k", "l")
"""The loop variables for the sites of a row, by role."""


class SiteSum(Generic[K]):
    """Formulas summed over the same rows of sites.

    Attributes:
        sites: The rows.
        outputs: Formulas by the place to which they are added, the name of a variable, or another key of the caller.
        arguments: The symbol of each local variable.
        data: The symbol of each parameter that differs between particles.
    """

    def __init__(self, sites: Sites):
        self.sites = sites
        self.outputs: dict[K, sympy.Expr] = {}
        self.arguments: dict[Argument, sympy.Symbol] = {}
        self.data: dict[Data, sympy.Symbol] = {}

    @classmethod
    def flat(cls, scene: System, outputs: Mapping[K, sympy.Expr]) -> SiteSum[K]:
        """Formulas in the variables of a scene, without a sum."""
        total = cls(Sites("single"))
        names = {symbol: total._argument(Argument(Place(0, k, 0), None)) for k, symbol in enumerate(scene.symbols)}
        total.outputs = {key: cast("sympy.Expr", formula.xreplace(names)) for key, formula in outputs.items()}
        return total

    def add(self, term: LocalTerm, outputs: Iterable[tuple[K, sympy.Expr]]) -> None:
        """Add formulas in the local variables and data of a term."""
        names: dict[sympy.Basic, sympy.Basic] = {
            sympy.Symbol(f"x{k}"): self._argument(x) for k, x in enumerate(term.arguments)
        }
        for k, data in enumerate(term.data):  # a parameter that is the same for all particles becomes its value
            symbol = self.data.setdefault(data, sympy.Symbol(f"d{len(self.data)}")) if len({*data.values}) > 1 else None
            names[sympy.Symbol(f"d{k}")] = symbol or data.values[0]
        for key, formula in outputs:
            self.outputs[key] = self.outputs.get(key, sympy.Integer(0)) + formula.xreplace(names)

    def _argument(self, argument: Argument) -> sympy.Symbol:
        plus, minus = argument
        name = f"y{plus.offset}" if minus is None and plus.stride == 0 else f"x{len(self.arguments)}"
        return self.arguments.setdefault(argument, sympy.Symbol(name))

    def covered(self, place: Place) -> set[int]:
        """The entries that a pass over the rows writes at a place; empty if it may write one twice."""
        if self.sites.kind == "single":
            return {place.offset}
        if self.sites.kind == "each" and place.stride:
            return set(range(place.offset, place.offset + place.stride * self.sites.count, place.stride))
        return set()

    def lines(self, statements: Mapping[K, Assign[sympy.Expr]], module: ModuleText) -> list[str]:
        """The lines of the sum; for pairs, data of the first particle are read and written outside the inner loop.

        The statements assign the outputs, or add them, by their keys and in order of computation.
        """
        if not self.outputs:
            return []
        if module.lanes and self.sites.kind == "pairs" and (lines := _vector_lines(self, statements, module)):
            return lines
        first = 0 if self.sites.kind == "pairs" else None
        before: list[str] = []
        body: list[str] = []
        names = self.names()
        read: dict[Place, str] = {}
        for argument, symbol in self.arguments.items():
            if symbol in names:
                for place in argument:
                    if place is not None and place.role == first and place not in read:
                        read[place] = f"u{len(read)}"
                        before.append(f"{read[place]} = {entry('y', place)}")
                body.append(f"{symbol} = {difference(argument, read)}")
        for data, symbol in self.data.items():
            if symbol in names:
                line = f"{symbol} = {module.numbers(data.values)}[{INDICES[data.role]}]"
                (before if data.role == first else body).append(line)
        summed, zeroed, after = _accumulators(statements, first)
        before += zeroed
        body += source_lines(summed.values(), names)
        return self.loop(before, body, after, module)

    def names(self) -> dict[sympy.Symbol, str]:
        """The texts of the symbols that the formulas contain."""
        free: set[sympy.Basic] = set().union(*(formula.free_symbols for formula in self.outputs.values()))
        return {symbol: str(symbol) for symbol in (*self.arguments.values(), *self.data.values()) if symbol in free}

    def loop(self, before: list[str], body: list[str], after: list[str], module: ModuleText) -> list[str]:
        """A loop over the rows; for pairs with statements before and after the inner loop."""
        kind, n = self.sites.kind, self.sites.count
        if kind == "single":
            return body
        if kind == "pairs":
            inner = [f"for j in range(i + 1, {n}):", *indented(body)]
            return [f"for i in range({n - 1}):", *indented([*before, *inner, *after])]
        if kind == "table":
            columns = [module.integers(column) for column in zip(*self.sites.table, strict=True)]
            rows = [f"{index} = {column}[row]" for index, column in zip(INDICES, columns, strict=False)]
            return [f"for row in range({self.sites.size}):", *indented([*rows, *body])]
        second = {"each": [], "chain": ["j = i + 1"], "ring": [f"j = i + 1 if i < {n - 1} else 0"]}[kind]
        return [f"for i in range({self.sites.size}):", *indented([*second, *body])]


def difference(argument: Argument, known: Mapping[Place, str] | None = None) -> str:
    """The text of a local variable: an entry of the state, or a difference of two."""
    places = [place for place in argument if place is not None]
    return " - ".join((known or {}).get(place) or entry("y", place) for place in places)


def entry(array: str, place: Place) -> str:
    """The entry of an array at a place."""
    if place.stride == 0:
        return f"{array}[{place.offset}]"
    index = INDICES[place.role] if place.stride == 1 else f"{place.stride}*{INDICES[place.role]}"
    return f"{array}[{place.offset} + {index}]" if place.offset else f"{array}[{index}]"


def zeros(entries: Iterable[int]) -> list[str]:
    """Statements that set entries of `out` to zero, by loops if possible."""
    lines: list[str] = []
    for _, run in groupby(enumerate(sorted(entries)), key=lambda pair: pair[1] - pair[0]):
        places = [place for _, place in run]
        if len(places) > 3:
            start = f"{places[0]}, " if places[0] else ""
            lines += [f"for i in range({start}{places[-1] + 1}):", "    out[i] = 0.0"]
        else:
            lines += [f"out[{place}] = 0.0" for place in places]
    return lines


FILL = 4
"""The number of lanes is a multiple of this; results of padding lanes are not used."""


class Ring(NamedTuple):
    """SIMD lanes for all pairs of n sites, taken as a ring.

    Attributes:
        rows: The pair of each lane, in ascending order; padding lanes repeat the last pair.
        lanes: For each distance d from 1 to n/2 the lanes of the pairs (site, site + d mod n).
    """

    rows: list[tuple[int, ...]]
    lanes: list[list[int]]

    @classmethod
    def of(cls, n: int) -> Ring:
        """Number the lanes by distance, first those that fill whole vectors.

        Example:
            >>> Ring.of(3)
            Ring(rows=[(0, 1), (1, 2), (0, 2), (0, 2)], lanes=[[0, 1, 2]])
        """
        distances, full = range(1, n // 2 + 1), n // WIDTH * WIDTH
        numbers: dict[tuple[int, ...], int] = {}
        pairs = [[tuple(sorted((site, (site + distance) % n))) for site in range(n)] for distance in distances]
        for sites in (slice(full), slice(full, n)):
            for pair in chain.from_iterable(found[sites] for found in pairs):
                numbers.setdefault(pair, len(numbers))
        rows: list[tuple[int, ...]] = [*numbers]
        rows += rows[-1:] * (-len(rows) % FILL)
        return cls(rows, [[numbers[pair] for pair in found] for found in pairs])


Scatter: TypeAlias = Mapping[K, tuple[int, str]]
"""For each output the number and the sign of its value among distinct values."""


def ring_lines(
    total: SiteSum[K],
    statements: Mapping[K, Assign[sympy.Expr]],
    values: Sequence[sympy.Expr],
    scatter: Scatter[K],
    module: ModuleText,
) -> list[str]:
    """Statements for a sum over pairs in a ring."""
    n, ring, names = total.sites.count, Ring.of(total.sites.count), total.names()
    arguments = {x: names[symbol] for x, symbol in total.arguments.items() if symbol in names}
    copies, differences = _gather(arguments, ring, n, module)
    lanes = dict(names)
    for data, symbol in total.data.items():
        if symbol in names:
            lanes[symbol] = f"{module.numbers([data.values[row[data.role]] for row in ring.rows])}[r]"
    formula = source_lines([Assign(f"v{k}[r]", "=", value) for k, value in enumerate(values)], lanes)
    totals: list[str] = []
    for key, (target, op, _) in statements.items():
        if not isinstance(key, Place):
            number, sign = scatter[key]
            sums = _balanced([f"v{number}[{lane}]" for lane in range(n * (n - 1) // 2)])
            totals.append(f"{target} {op} {sums if sign == '+' else f'-({sums})'}")
    return [
        *copies,
        *(f"v{k} = stack({len(ring.rows)})" for k in range(len(values))),
        f"for r in range({len(ring.rows)}):",
        *indented([*differences, *formula]),
        *totals,
        *(line for place, roles in _by_place(scatter).items() for line in _sum_lines(place, roles, ring, module)),
    ]


def _by_place(scatter: Scatter[K]) -> dict[tuple[int, int], dict[int, tuple[int, str]]]:
    """For each offset and stride, the contributions to the two particles of a pair."""
    found: dict[tuple[int, int], dict[int, tuple[int, str]]] = {}
    for key, value in scatter.items():
        if isinstance(key, Place):
            found.setdefault((key.offset, key.stride), {})[key.role] = value
    return found


def _gather(arguments: Mapping[Argument, str], ring: Ring, n: int, module: ModuleText) -> tuple[list[str], list[str]]:
    """Statements that gather entries of all particles, and those that compute the local variables of a lane."""
    sites = [module.integers(column) for column in zip(*ring.rows, strict=True)]
    arrays: dict[tuple[int, int], str] = {}

    def text(place: Place) -> str:
        if not place.stride:
            return f"y[{place.offset}]"
        array = arrays.setdefault((place.offset, place.stride), f"q{len(arrays)}")
        return f"{array}[{sites[place.role]}[r]]"

    differences = [
        f"{name} = {' - '.join(text(x) for x in argument if x is not None)}" for argument, name in arguments.items()
    ]
    copies = [f"{array} = stack({n})" for array in arrays.values()]
    for (offset, stride), array in arrays.items():
        copies += [f"for i in range({n}):", f"    {array}[i] = y[{offset} + {stride}*i]"]
    return copies, differences


def _sum_lines(
    place: tuple[int, int], roles: Mapping[int, tuple[int, str]], ring: Ring, module: ModuleText
) -> list[str]:
    """Statements that add to each particle the contributions of its pairs."""
    (number, first), (_, second) = roles[0], roles[1]
    terms: list[str] = []

    def add(lanes: Sequence[int], are_first: Sequence[bool]) -> None:
        """One pair for each site: its lane, and whether the site is the first of its pair."""
        value, signs = f"v{number}[{module.integers(lanes)}[i]]", [first if x else second for x in are_first]
        if len(set(signs)) > 1:
            value = f"{module.numbers([sympy.Integer(f'{sign}1') for sign in signs])}[i]*{value}"
        elif signs[0] == "-":
            value = f"-{value}"
        terms.append(value)

    n = len(ring.lanes[0])
    for distance, lanes in enumerate(ring.lanes, 1):
        add(lanes, [site + distance < n for site in range(n)])
        if 2 * distance < n:  # otherwise both neighbours at this distance are the same
            add([lanes[site - distance] for site in range(n)], [site < distance for site in range(n)])
    offset, stride = place
    return [f"for i in range({n}):", f"    out[{offset} + {stride}*i] += {_balanced(terms)}"]


def _balanced(terms: Sequence[str]) -> str:
    """A sum as a balanced tree, of logarithmic depth."""
    if len(terms) < 3:
        return " + ".join(terms)
    half = len(terms) // 2
    return " + ".join(f"({_balanced(part)})" if len(part) > 1 else part[0] for part in (terms[:half], terms[half:]))


FEWEST_PAIRS, MOST_LANES = 3, 4096
SLOW = {"call", "power"}
"""Operations without vector instructions, which dominate the time."""


def _vector_lines(
    total: SiteSum[K], statements: Mapping[K, Assign[sympy.Expr]], module: ModuleText
) -> list[str] | None:
    """Statements for a sum over pairs that LLVM or `lowering` vectorise; None if a plain loop is as fast."""
    values, scatter = _values(statements)
    formulas = [Assign(f"v{k}", "=", formula) for k, formula in enumerate(values)]
    if total.sites.size < FEWEST_PAIRS or SLOW & count_operations(source_lines(formulas, total.names())).keys():
        return None
    if total.sites.size > MOST_PERMUTED:
        return _row_lines(total, statements, values, scatter, module) if total.sites.count <= MOST_LANES else None
    # in a ring each output must be a sum over all pairs, or be added to both particles up to a sign
    if any(statement.op != "+=" for statement in statements.values()) or not all(
        key.stride if isinstance(key, Place) else isinstance(key, str) for key in statements
    ):
        return None
    if any(len(roles) != 2 or roles[0][0] != roles[1][0] for roles in _by_place(scatter).values()):
        return None
    return ring_lines(total, statements, values, scatter, module)


def _row_lines(
    total: SiteSum[K],
    statements: Mapping[K, Assign[sympy.Expr]],
    values: Sequence[sympy.Expr],
    scatter: Scatter[K],
    module: ModuleText,
) -> list[str]:
    """Statements for a sum over pairs: gather, formula and scatter over the partners of each particle in turn."""
    n, names = total.sites.count, total.names()
    summed, before, after = _accumulators(statements, 0)
    body: list[str] = []
    for key, (target, op, _) in summed.items():
        number, sign = scatter[key]
        value = f"v{number}[j]"
        body.append(f"{target} {sign}= {value}" if op == "+=" else f"{target} = {sign.strip('+')}{value}")
    local = {argument: names[symbol] for argument, symbol in total.arguments.items() if symbol in names}
    lanes = names | {total.arguments[argument]: f"{name}[j]" for argument, name in local.items()}
    row: list[str] = []
    for data, symbol in total.data.items():
        if symbol in names and data.role == 0:
            row.append(f"{names[symbol]} = {module.numbers(data.values)}[i]")
        elif symbol in names:
            lanes[symbol] = f"{module.numbers(data.values)}[j]"
    formula = source_lines([Assign(f"v{k}[j]", "=", value) for k, value in enumerate(values)], lanes)
    gather = [f"{name}[j] = {difference(argument)}" for argument, name in local.items()]
    arrays = [f"{name} = stack({n})" for name in (*local.values(), *(f"v{k}" for k in range(len(values))))]
    following = f"for j in range(i + 1, {n}):"
    passes = [line for lines in (gather, formula, body) for line in (following, *indented(lines))]
    return [*arrays, f"for i in range({n - 1}):", *indented([*row, *before, *passes, *after])]


def _values(statements: Mapping[K, Assign[sympy.Expr]]) -> tuple[list[sympy.Expr], dict[K, tuple[int, str]]]:
    """Distinct formulas up to sign, and for each output the number of its formula with a sign."""
    values: list[sympy.Expr] = []
    scatter: dict[K, tuple[int, str]] = {}
    for key, (_, _, formula) in statements.items():
        if -formula in values:
            scatter[key] = values.index(-formula), "-"
            continue
        if formula not in values:
            values.append(formula)
        scatter[key] = values.index(formula), "+"
    return values, scatter


def _accumulators(
    statements: Mapping[K, Assign[sympy.Expr]], first: int | None
) -> tuple[dict[K, Assign[sympy.Expr]], list[str], list[str]]:
    """Statements with variables for the first particle of a row, and those before and after the inner loop."""
    before: list[str] = []
    after: list[str] = []
    changed = dict(statements)
    for key, (target, op, value) in statements.items():
        if first is not None and isinstance(key, Place) and key.role == first:
            name = f"a{len(after)}"
            changed[key] = Assign(name, "+=", value)
            before.append(f"{name} = 0.0")
            after.append(f"{target} {op} {name}")
    return changed, before, after
