"""Formulas as a graph of operations, in which nothing is written down twice.

A value is a term (coefficient, node): an exact number times a node. Nodes are numbered and equal ones are one node:

    ("name", text)             a variable
    ("call", function, term)   an elementary function
    ("power", term, term)      a power that is not a product of integer powers and square roots
    ("sum", (term, …))         the first coefficient is positive, and they have no common absolute value
    ("product", ((node, n), …), ((node, n), …))   powers of nodes over powers of nodes, n > 0

Node 0 is the empty product, so a number x is the term (x, 0).

Reading keeps rational exponents; `lowered` replaces them by multiplications, divisions and square roots.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from .errors import IntegratorError
from .expressions import ELEMENTARY, shorten

if TYPE_CHECKING:
    import sympy

    Coefficient = Fraction | sympy.Expr
    Term = tuple[Coefficient, int]

ONE = 0


class OperationGraph:
    """Numbered nodes; a node only refers to nodes with smaller numbers."""

    def __init__(self) -> None:
        self.nodes: list[tuple[Any, ...]] = []
        self._numbers: dict[tuple[Any, ...], int] = {}
        self.node("product", (), ())

    def node(self, *content: Any) -> int:
        """The number of the node with this content."""
        if content not in self._numbers:
            self._numbers[content] = len(self.nodes)
            self.nodes.append(content)
        return self._numbers[content]

    def product(self, above: Mapping[int, Any], below: Mapping[int, Any] | None = None) -> int:
        """The product of powers of nodes; a single node to the power one is that node."""
        if not below and len(above) == 1 and set(above.values()) == {1}:
            return next(iter(above))
        return self.node("product", tuple(sorted(above.items())), tuple(sorted((below or {}).items())))

    def sum(self, terms: Iterable[Term]) -> Term:
        """The sum of terms, with the sign of the first and the common size of all taken out."""
        collected: dict[int, Coefficient] = {}
        for coefficient, node in terms:
            collected[node] = simplest(collected[node] + coefficient) if node in collected else coefficient
        kept = [(coefficient, node) for node, coefficient in sorted(collected.items()) if coefficient != 0]
        kept.sort(key=lambda term: term[1] == ONE)  # numbers go last
        if len(kept) < 2:
            return kept[0] if kept else (Fraction(0), ONE)
        first = kept[0][0]
        if all(coefficient in (first, -first) for coefficient, _ in kept):
            scale = first
        else:
            scale = Fraction(-1 if is_negative(first) else 1)
        return scale, self.node("sum", tuple((simplest(coefficient / scale), node) for coefficient, node in kept))

    def factors(self, node: int) -> dict[int, Any]:
        """The powers of nodes that a node is the product of (products that are only read have nothing below)."""
        content = self.nodes[node]
        return dict(content[1]) if content[0] == "product" else {node: Fraction(1)}

    def children(self, node: int) -> list[tuple[int, Any]]:
        """The nodes that a node is computed from, each with the number of times."""
        kind, *content = self.nodes[node]
        if kind == "product":
            return [*content[0], *content[1]]
        terms = content[0] if kind == "sum" else [part for part in content if not isinstance(part, str)]
        return [(child, 1) for _, child in terms]


def simplest(number: Any) -> Coefficient:
    """A rational number as a `Fraction`, any other as it is."""
    return Fraction(int(number.p), int(number.q)) if getattr(number, "is_Rational", False) else number


def is_negative(number: Coefficient) -> bool:
    """Whether an exact number is below zero."""
    return number < 0 if isinstance(number, Fraction) else bool(number.evalf() < 0)


class Reader:
    """Reads SymPy expressions into a graph."""

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
        if not (expression.is_Add or expression.is_Mul or expression.is_Pow or name in ELEMENTARY):
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
        return Fraction(1), graph.node("call", name, terms[0])

    def _product(self, terms: Sequence[Term]) -> Term:
        coefficient: Any = Fraction(1)
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
        if is_negative(scale):  # (−x)^(1/2) is no multiple of x^(1/2)
            scale, node = -scale, self.graph.node("sum", ((Fraction(-1), node),))
        return _root(scale, power), self.graph.product({node: power})


def _root(number: Coefficient, power: Fraction) -> Coefficient:
    import sympy

    return simplest(sympy.sympify(number, strict=True) ** sympy.Rational(power.numerator, power.denominator))


def exact_number(expression: Any) -> Coefficient:
    """The number that an expression without symbols is; a float stands for its exact value."""
    import sympy

    if not getattr(expression, "is_number", False):
        raise IntegratorError(
            f"formula must be made of + * ** and {', '.join(ELEMENTARY)}, but has {shorten(str(expression))!r}"
        )
    value: Any = expression.evalf()
    if not value.is_Float and value != 0:
        raise IntegratorError(f"formula must have finite real numbers only, but has {shorten(str(expression))!r}")
    return simplest(sympy.Rational(expression) if expression.is_Float else expression)
