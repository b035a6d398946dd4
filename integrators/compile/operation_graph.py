"""Formulas as a graph of operations without common subexpressions.

A value is a term (coefficient, node): an exact number times a node. Nodes are numbered, and equal ones are identified:

    ("name", text)             a variable
    ("call", function, term)   an elementary function, abs or sign
    ("where", term, term, term)   the second value if the first is positive, otherwise the third
    ("power", term, term)      a power that is not a product of integer powers and square roots
    ("sum", (term, …))         the first coefficient is positive, and their absolute values are not all equal
    ("product", ((node, n), …), ((node, n), …))   powers of nodes over powers of nodes, n > 0
    ("box", key, term, …)      all values of a black box
    ("entry", text, term)      one of them, by its index

Node 0 is the empty product, so a number x is the term (x, 0).

`Reader` keeps rational exponents; `expand_powers` replaces them by multiplications, divisions and square roots.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cache
from heapq import heapify, heappop, heappush
from math import gcd, lcm
from typing import Any, TypeAlias

import sympy

from bseries_base.errors import shorten
from integrators.core.errors import IntegratorError
from integrators.exact.arithmetic import Exact, in_sympy, simplest
from integrators.exact.expressions import ELEMENTARY

Content: TypeAlias = tuple[Any, ...]  # of a node, by its kind as above
Term = tuple[Exact, int]
Product = tuple[Exact, Counter[int], Counter[int]]


ONE = 0
BRANCHING = {"Absolute": "abs", "Sign": "sign", "Where": "where"}
"""The functions of `integrators.exact.branches`, by the names of their classes."""
CALLED = (*ELEMENTARY, *BRANCHING.values())


class OperationGraph:
    """Numbered nodes, each of which refers to nodes with smaller numbers only."""

    def __init__(self) -> None:
        self.nodes: list[Content] = []
        self._numbers: dict[Content, int] = {}
        self.node("product", (), ())

    def node(self, *content: object) -> int:
        """The number of the node with this content."""
        if content not in self._numbers:
            self._numbers[content] = len(self.nodes)
            self.nodes.append(content)
        return self._numbers[content]

    def product(self, above: Mapping[int, object], below: Mapping[int, object] | None = None) -> int:
        """The product of powers of nodes; a single node to the power one is that node."""
        if not below and len(above) == 1 and set(above.values()) == {1}:
            return next(iter(above))
        return self.node("product", tuple(sorted(above.items())), tuple(sorted((below or {}).items())))

    def sum(self, terms: Iterable[Term]) -> Term:
        """The sum of terms, with the sign of the first and a common absolute value factored out."""
        collected: dict[int, Exact] = {}
        for coefficient, node in terms:
            collected[node] = simplest(collected[node] + coefficient) if node in collected else coefficient
        kept = [(coefficient, node) for node, coefficient in sorted(collected.items()) if coefficient != 0]
        kept.sort(key=lambda term: term[1] == ONE)  # numbers last
        if len(kept) < 2:
            return kept[0] if kept else (Fraction(0), ONE)
        first = kept[0][0]
        if all(coefficient in (first, -first) for coefficient, _ in kept):
            scale = first
        else:
            scale = Fraction(-1 if is_negative(first) else 1)
        return scale, self.node("sum", tuple((simplest(coefficient / scale), node) for coefficient, node in kept))

    def factors(self, node: int) -> dict[int, Fraction]:
        """The factors of a node with their powers; before `expand_powers` products have no denominators."""
        content = self.nodes[node]
        return dict(content[1]) if content[0] == "product" else {node: Fraction(1)}

    def children(self, node: int) -> list[tuple[int, int]]:
        """The operands of a node, with multiplicities."""
        kind, *content = self.nodes[node]
        if kind == "product":
            return [*content[0], *content[1]]
        terms = content[0] if kind == "sum" else [part for part in content if not isinstance(part, str)]
        return [(child, 1) for _, child in terms]


def is_negative(number: Exact) -> bool:
    """Whether an exact number is below zero."""
    return number < 0 if isinstance(number, Fraction) else bool(number.evalf() < 0)


class Reader:
    """Converts SymPy expressions to terms of a graph."""

    def __init__(self, graph: OperationGraph, names: Mapping[sympy.Symbol, str]) -> None:
        self.graph, self.names = graph, names
        self._known: dict[sympy.Basic, Term] = {}

    def read(self, expression: sympy.Expr) -> Term:
        """The term of an expression."""
        if expression not in self._known:
            self._known[expression] = self._read(expression)
        return self._known[expression]

    def _read(self, expression: Any) -> Term:
        graph, name = self.graph, type(expression).__name__
        if getattr(expression, "is_Symbol", False):
            if expression not in self.names:
                known = ", ".join(str(symbol) for symbol in self.names)
                raise IntegratorError(
                    f"formula must use the names {shorten(known)}, but has {shorten(str(expression))!r}"
                )
            return Fraction(1), graph.node("name", self.names[expression])
        if name == "Entry":
            box, k, *values = expression.args
            found = Fraction(1), graph.node("box", box.key, *map(self.read, values))
            return Fraction(1), graph.node("entry", str(box.inputs + k), found)
        name = BRANCHING.get(name, name)
        if not (expression.is_Add or expression.is_Mul or expression.is_Pow or name in CALLED):
            return exact_number(expression), ONE
        terms = [self.read(argument) for argument in expression.args]
        if all(node == ONE for _, node in terms):
            return exact_number(expression), ONE
        if expression.is_Add:
            return graph.sum(terms)
        if expression.is_Mul:
            return self._product(terms)
        if expression.is_Pow:
            return self._power(*terms)
        if name == "where":
            return Fraction(1), graph.node("where", *terms)
        return Fraction(1), graph.node("call", name, terms[0])

    def _product(self, terms: Sequence[Term]) -> Term:
        coefficient: Exact = Fraction(1)
        factors: Counter[int] = Counter()
        for factor, node in terms:
            coefficient *= factor
            factors.update(self.graph.factors(node))
        return simplest(coefficient), self.graph.product({node: n for node, n in factors.items() if n})

    def _power(self, base: Term, exponent: Term) -> Term:
        (scale, node), (power, variable) = base, exponent
        if variable != ONE or not isinstance(power, Fraction):
            return Fraction(1), self.graph.node("power", base, exponent)
        if power.denominator == 1:
            factors = {factor: n * power for factor, n in self.graph.factors(node).items()}
            return scale**power.numerator, self.graph.product(factors)
        if is_negative(scale):  # (−x)^(1/2) is not a multiple of x^(1/2)
            scale, node = -scale, self.graph.node("sum", ((Fraction(-1), node),))
        root = in_sympy(scale) ** in_sympy(power)
        return simplest(root), self.graph.product({node: power})


def exact_number(expression: sympy.Expr) -> Exact:
    """The value of an expression without symbols; a float has its exact value."""
    if not getattr(expression, "is_number", False):
        raise IntegratorError(
            f"formula must be made of + * ** and {', '.join(CALLED)}, but has {shorten(str(expression))!r}"
        )
    value = expression.evalf()
    if not value.is_Float and value != 0:
        raise IntegratorError(f"formula must have finite real numbers only, but has {shorten(str(expression))!r}")
    return simplest(sympy.Rational(expression) if expression.is_Float else expression)


def expand_powers(graph: OperationGraph, terms: Sequence[Term], *, horner: bool) -> tuple[OperationGraph, list[Term]]:
    """Express values by additions, multiplications, divisions, roots and calls.

    Returns a new graph and the values in it; with `horner` sums are nested by Horner's rule.
    """
    expansion = _Expansion(graph, [node for _, node in terms], horner)
    return _with_shared_pairs(expansion.result, [expansion.expand(term) for term in terms])


def reachable(graph: OperationGraph, nodes: Iterable[int]) -> list[int]:
    """These nodes and all their operands, in order of computation."""
    found, waiting = set(), list(nodes)
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting += [child for child, _ in graph.children(node)]
    return sorted(found)


class _Expansion:
    """Converts a graph with powers to one with multiplications."""

    def __init__(self, graph: OperationGraph, wanted: Iterable[int], horner: bool):
        self.graph, self.horner, self.result = graph, horner, OperationGraph()
        self.reciprocals = _shared_reciprocals(graph, reachable(graph, wanted))
        self._known: dict[int, Term] = {}

    def expand(self, term: Term) -> Term:
        """The term of the new graph for a term of the old one."""
        coefficient, node = term
        if node not in self._known:
            self._known[node] = self._expand(node)
        scale, node = self._known[node]
        return simplest(coefficient * scale), node

    def _expand(self, node: int) -> Term:
        kind, *content = self.graph.nodes[node]
        if kind == "product":
            return self._term(self._powers(content[0]))
        if kind == "sum":
            products = [self._factors(*term) for term in content[0]]
            return self.result.sum(self._horner(products) if self.horner else map(self._term, products))
        return Fraction(1), self.result.node(kind, *(x if isinstance(x, str) else self.expand(x) for x in content))

    def _factors(self, coefficient: Exact, node: int) -> Product:
        kind, *content = self.graph.nodes[node]
        if kind == "product":
            scale, above, below = self._powers(content[0])
        else:
            scale, node = self.expand((Fraction(1), node))
            above, below = Counter({node: 1}), Counter()
        return simplest(coefficient * scale), above, below

    def _term(self, product: Product) -> Term:
        coefficient, above, below = product
        return coefficient, self.result.product(above, below)

    def _powers(self, powers: Iterable[tuple[int, Fraction]]) -> Product:
        """Coefficient, numerator and denominator of a product of rational powers."""
        scale: Exact = Fraction(1)
        above: Counter[int] = Counter()
        below: Counter[int] = Counter()
        for node, power in powers:
            if power > 0:
                scale *= self._multiply(above, node, power)
            elif node in self.reciprocals:
                step = self.reciprocals[node]
                divisor: Counter[int] = Counter()
                times = int(-power / step)
                scale /= self._multiply(divisor, node, step) ** times
                above[self.result.product({}, divisor)] += times
            else:
                scale /= self._multiply(below, node, -power)
        return simplest(scale), above, below

    def _multiply(self, factors: Counter[int], node: int, power: Fraction) -> Exact:
        """Add a positive power of a node to the factors, x^(11/4) = x · x · √x · √√x; returns the coefficient."""
        term = self.expand((Fraction(1), node))
        whole, rest = divmod(power, 1)
        if whole:
            factors[term[1]] += int(whole)
        if rest.denominator in (2, 4):
            root = self.result.node("call", "sqrt", term)
            if rest >= Fraction(1, 2):
                factors[root] += 1
            if rest.denominator == 4:
                factors[self.result.node("call", "sqrt", (Fraction(1), root))] += 1
        elif rest:
            factors[self.result.node("power", term, (rest, ONE))] += 1
        return term[0] ** int(whole)

    def _horner(self, products: list[Product]) -> list[Term]:
        """The terms of a sum with common factors factored out, the most frequent first."""
        terms: list[Term] = []
        while True:
            counts = Counter(node for _, above, _ in products for node in above)
            best = max(counts, key=lambda node: (counts[node], -node), default=ONE)
            if counts[best] < 2:
                return [*terms, *map(self._term, products)]
            power = Counter({best: min(above[best] for _, above, _ in products if best in above)})
            inner = [(number, above - power, below) for number, above, below in products if best in above]
            coefficient, node = self.result.sum(self._horner(inner))
            terms.append((coefficient, self.result.product(power + Counter({node: 1}))))
            products = [product for product in products if best not in product[1]]


def _shared_reciprocals(graph: OperationGraph, nodes: Iterable[int]) -> dict[int, Fraction]:
    """Nodes with several negative powers, each with the greatest common divisor of these."""
    powers: defaultdict[int, list[Fraction]] = defaultdict(list)
    for node in nodes:
        if graph.nodes[node][0] == "product":
            for factor, power in graph.nodes[node][1]:
                if power < 0:
                    powers[factor].append(-power)
    divisors: dict[int, Fraction] = {}
    for node, found in powers.items():
        if len(found) > 1:
            scale = lcm(*(power.denominator for power in found))
            divisors[node] = Fraction(gcd(*(int(power * scale) for power in found)), scale)
    return divisors


def _with_shared_pairs(graph: OperationGraph, terms: Sequence[Term]) -> tuple[OperationGraph, list[Term]]:
    """The graph with a node for each pair of factors that two products share."""
    nodes = reachable(graph, [node for _, node in terms])
    sides = [(node, side) for node in nodes for side in (1, 2) if graph.nodes[node][0] == "product"]
    factors = [Counter(dict(graph.nodes[node][side])) for node, side in sides]
    pairs = _extract_pairs(factors, first_new=len(graph.nodes))
    reduced = dict(zip(sides, factors, strict=True))
    result = OperationGraph()

    @cache
    def copy(node: int) -> int:
        if node in pairs:
            return result.product(copied(Counter(pairs[node])))
        kind, *parts = graph.nodes[node]
        if kind == "product":
            return result.product(copied(reduced[node, 1]), copied(reduced[node, 2]))
        if kind == "sum":
            return result.node(kind, tuple((coefficient, copy(child)) for coefficient, child in parts[0]))
        return result.node(kind, *(x if isinstance(x, str) else (x[0], copy(x[1])) for x in parts))

    def copied(counts: Counter[int]) -> Counter[int]:
        copies: Counter[int] = Counter()
        for node, n in counts.items():
            copies[copy(node)] += n
        return copies

    return result, [(coefficient, copy(node)) for coefficient, node in terms]


def _extract_pairs(groups: Sequence[Counter[int]], *, first_new: int) -> dict[int, tuple[int, ...]]:
    """Replace frequent pairs of factors in products by new factors numbered from `first_new`; returns the pairs."""
    counts: Counter[tuple[int, int]] = Counter()
    holders: defaultdict[int, set[int]] = defaultdict(set)
    for index, group in enumerate(groups):
        counts.update(_pairs(group))
        for factor in group:
            holders[factor].add(index)
    queue = [(-count, pair) for pair, count in counts.items() if count > 1]
    heapify(queue)
    found: dict[int, tuple[int, ...]] = {}
    while queue:
        count, pair = heappop(queue)
        if counts[pair] != -count:
            if counts[pair] > 1:
                heappush(queue, (-counts[pair], pair))
            continue
        new = first_new + len(found)
        found[new] = pair
        for index in sorted(holders[pair[0]] & holders[pair[1]]):
            group = groups[index]
            before = _pairs(group)
            if times := before.pop(pair, 0):
                for factor in pair:
                    group[factor] -= times
                    if not group[factor]:
                        del group[factor]
                group[new] = times
                holders[new].add(index)
                after = _pairs(group)
                counts.subtract(before)
                counts.update(after)
                for changed in after:
                    if counts[changed] > 1:
                        heappush(queue, (-counts[changed], changed))
        counts[pair] = 0
    return found


def _pairs(group: Counter[int]) -> Counter[tuple[int, int]]:
    """The multiplicity of each pair of factors in a product."""
    factors = sorted(group)
    pairs = {(a, b): min(group[a], group[b]) for i, a in enumerate(factors) for b in factors[i + 1 :]}
    return Counter(pairs | {(a, a): group[a] // 2 for a in factors if group[a] > 1})
