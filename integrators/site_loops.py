"""Sums over sites as lines of Python: loops around formulas in local variables, without arrays of their own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import groupby
from typing import TYPE_CHECKING, Any, Protocol

from .printer import source_lines
from .site_lanes import lane_lines, suits_lanes

if TYPE_CHECKING:
    from collections.abc import Sequence

    import sympy

    from .scenes.local_terms import Argument, Data, LocalTerm, Place
    from .scenes.system import System
    from .scenes.terms import Sites

INDICES = ("i", "j", "k", "l")
"""The loop variables for the sites of a row, by role."""


class Context(Protocol):
    """What lines need from the text around them."""

    number: str | None
    zero: str
    lanes: bool

    def numbers(self, values: Sequence[sympy.Expr]) -> str:
        """The name of a constant array of exact numbers."""
        ...

    def sites(self, values: Sequence[int]) -> str:
        """The name of a constant array of integers."""
        ...


class SiteSum:
    """Formulas summed over the same rows of sites.

    Attributes:
        sites: The rows.
        outputs: A formula for each place it is added at; what else a key can be is up to the user of the class.
        arguments: The symbol of each local variable.
        data: The symbol of each parameter that differs from site to site.
    """

    def __init__(self, sites: Sites):
        self.sites = sites
        self.outputs: dict[Any, Any] = {}
        self.arguments: dict[Argument, sympy.Symbol] = {}
        self.data: dict[Data, Any] = {}

    @classmethod
    def flat(cls, scene: System, outputs: Mapping[Any, Any]) -> SiteSum:
        """Formulas in the variables of a scene, summed over nothing."""
        from .scenes.local_terms import Argument, Place
        from .scenes.terms import Sites

        total = cls(Sites("single"))
        names = {symbol: total._argument(Argument(Place(0, k, 0), None)) for k, symbol in enumerate(scene.symbols)}
        total.outputs = {key: formula.xreplace(names) for key, formula in outputs.items()}
        return total

    def add(self, term: LocalTerm, outputs: Iterable[tuple[Any, sympy.Expr]]) -> None:
        """Add formulas in the local variables and data of a term."""
        import sympy

        names: dict[Any, Any] = {sympy.Symbol(f"x{k}"): self._argument(x) for k, x in enumerate(term.arguments)}
        names |= {sympy.Symbol(f"d{k}"): self._datum(data) for k, data in enumerate(term.data)}
        for key, formula in outputs:
            self.outputs[key] = self.outputs.get(key, sympy.Integer(0)) + formula.xreplace(names)

    def _argument(self, argument: Argument) -> sympy.Symbol:
        import sympy

        plus, minus = argument
        name = f"y{plus.offset}" if minus is None and plus.stride == 0 else f"x{len(self.arguments)}"
        return self.arguments.setdefault(argument, sympy.Symbol(name))

    def _datum(self, data: Data) -> sympy.Expr:
        """The symbol of a parameter with a value for each site; the value itself where all sites have the same."""
        import sympy

        if len(set(data.values)) == 1:
            return data.values[0]
        return self.data.setdefault(data, sympy.Symbol(f"d{len(self.data)}"))

    def covered(self, place: Place) -> set[int]:
        """The entries that one pass over the rows writes once each at a place; none if it may write one twice."""
        if self.sites.kind == "single":
            return {place.offset}
        if self.sites.kind == "each" and place.stride:
            return set(range(place.offset, place.offset + place.stride * self.sites.count, place.stride))
        return set()

    def lines(self, targets: Mapping[Any, str], context: Context) -> list[str]:
        """The statements.

        Args:
            targets: For keys of the outputs the left-hand side with its ``=`` or ``+=``, in the order wanted.
            context: How numbers are written.

        Returns:
            The lines, indented from 0. Over pairs, what belongs to the first site is read before the inner loop and
            written after it.
        """
        if not self.outputs:
            return []
        if context.lanes and suits_lanes(self):
            return lane_lines(self, targets, context)
        first = 0 if self.sites.kind == "pairs" else None
        before: list[str] = []
        body: list[str] = []
        after: list[str] = []
        names, targets = self.names(), dict(targets)
        read: dict[Place | None, str] = {}
        for argument, symbol in self.arguments.items():
            if symbol in names:
                for place in argument:
                    if place is not None and place.role == first and place not in read:
                        read[place] = f"u{len(read)}"
                        before.append(f"{read[place]} = {entry('y', place)}")
                body.append(f"{symbol} = {difference(argument, read)}")
        for data, symbol in self.data.items():
            if symbol in names:
                line = f"{symbol} = {context.numbers(data.values)}[{INDICES[data.role]}]"
                (before if data.role == first else body).append(line)
        for key in targets:
            if first is not None and getattr(key, "role", None) == first:
                name = f"a{len(after)}"
                before.append(f"{name} = {context.zero}")
                after.append(f"{targets[key]} {name}")
                targets[key] = f"{name} +="
        assignments = [(target, self.outputs[key]) for key, target in targets.items()]
        body += source_lines(assignments, names, number=context.number)
        return self.loop(before, body, after, context)

    def names(self) -> dict[Any, str]:
        """What the formulas use."""
        free: set[Any] = set().union(*(formula.free_symbols for formula in self.outputs.values()))
        return {symbol: str(symbol) for symbol in (*self.arguments.values(), *self.data.values()) if symbol in free}

    def loop(self, before: list[str], body: list[str], after: list[str], context: Context) -> list[str]:
        """A loop over the rows, with statements before and after the inner loop over second sites of pairs."""
        kind, n = self.sites.kind, self.sites.count
        if kind == "single":
            return body
        if kind == "pairs":
            inner = [f"for j in range(i + 1, {n}):", *indented(body)]
            return [f"for i in range({n - 1}):", *indented([*before, *inner, *after])]
        if kind == "table":
            columns = [context.sites(column) for column in zip(*self.sites.table, strict=True)]
            rows = [f"{index} = {column}[row]" for index, column in zip(INDICES, columns, strict=False)]
            return [f"for row in range({self.sites.size}):", *indented([*rows, *body])]
        second = {"each": [], "chain": ["j = i + 1"], "ring": [f"j = i + 1 if i < {n - 1} else 0"]}[kind]
        return [f"for i in range({self.sites.size}):", *indented([*second, *body])]


def difference(argument: Argument, known: Mapping[Any, str] | None = None) -> str:
    """The text of a local variable: an entry of the state, or the difference of two."""
    places = [place for place in argument if place is not None]
    return " - ".join((known or {}).get(place) or entry("y", place) for place in places)


def entry(array: str, place: Place) -> str:
    """The entry of an array at a place."""
    if place.stride == 0:
        return f"{array}[{place.offset}]"
    index = INDICES[place.role] if place.stride == 1 else f"{place.stride}*{INDICES[place.role]}"
    return f"{array}[{place.offset} + {index}]" if place.offset else f"{array}[{index}]"


def zeros(entries: Iterable[int], zero: str) -> list[str]:
    """Statements that set entries of `out` to zero: consecutive ones by a loop."""
    lines: list[str] = []
    for _, run in groupby(enumerate(sorted(entries)), key=lambda pair: pair[1] - pair[0]):
        places = [place for _, place in run]
        if len(places) > 3:
            start = f"{places[0]}, " if places[0] else ""
            lines += [f"for i in range({start}{places[-1] + 1}):", f"    out[i] = {zero}"]
        else:
            lines += [f"out[{place}] = {zero}" for place in places]
    return lines


def indented(lines: Iterable[str]) -> list[str]:
    """The lines as the body of a block."""
    return [f"    {line}" for line in lines]
