"""Formulas as lines of Python, for numba and for mpmath.

The same formulas give the same text in every process. In double precision every number is a correctly rounded literal;
in exact mode integers stay integers, fractions are made by a function that is named, and irrational numbers are written
out, so that the lines run with the functions and the precision of mpmath.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from integrators.compile.operation_graph import ONE, OperationGraph, Reader, is_negative, lowered, reachable
from integrators.core.errors import IntegratorError
from integrators.exact.expressions import ELEMENTARY
from integrators.exact.number_text import ATOM, PRODUCT, SUM, bound_text, literal, within

if TYPE_CHECKING:
    import sympy

    from integrators.compile.operation_graph import Term
    from integrators.exact.number_text import Coefficient

FUNCTIONS = (*ELEMENTARY, "sqrt")
"""What the lines call, by the names that the modules math and mpmath have for it."""

COSTS = {"add": 1, "multiply": 1, "divide": 4, "sqrt": 5, "call": 20, "power": 40}
"""What operations cost, in additions; square roots and divisions overlap with other work."""

MAX_LENGTH = 90
"""Longer expressions are cut by one more temporary variable."""


def source_lines(
    assignments: Iterable[tuple[str, sympy.Expr]],
    names: Mapping[sympy.Symbol, str],
    *,
    number: str | None = None,
    temporary: str = "c",
) -> list[str]:
    """Assignments as lines of Python in which nothing is computed twice.

    Args:
        assignments: Targets and formulas. A target is text to the left of ``=``; if it ends in ``=`` it is an augmented
            one, such as ``"out[0] +="``.
        names: What the symbols are called: a variable, or an entry such as ``y[0]``.
        number: None for double precision; for exact lines the name of a function that makes p/q of integers p, q.
        temporary: The beginning of the names of temporary variables.

    Returns:
        The lines, without indentation. They call the `FUNCTIONS`, and exact lines also ``pi``.

    Raises:
        IntegratorError: A formula uses other symbols or functions, or a number that is not real and finite.

    Example:
        >>> import sympy
        >>> x, y = sympy.symbols("x y")
        >>> r = sympy.sqrt(x**2 + y**2)
        >>> print(*source_lines([("out[0]", -x / r**3), ("out[1]", -y / r**3)], {x: "x", y: "y"}), sep="\\n")
        c0 = x*x + y*y
        c1 = 1.0/(c0*sqrt(c0))
        out[0] = -x*c1
        out[1] = -y*c1
    """
    import sympy

    assignments = list(assignments)
    graph = OperationGraph()
    reader = Reader(graph, names)
    try:
        terms = [reader.read(sympy.sympify(formula, strict=True)) for _, formula in assignments]
        graphs = [lowered(graph, terms, horner=horner) for horner in (False, True)]
        written = [_Printer(*pair, number, temporary).print([target for target, _ in assignments]) for pair in graphs]
    except RecursionError:
        raise IntegratorError("formula must be nested less deeply, but was nested beyond the limit of Python") from None
    except ZeroDivisionError:
        raise IntegratorError("formula must not divide by zero, but does") from None
    return min(written, key=operation_cost)


def count_operations(lines: Iterable[str]) -> Counter[str]:
    """The operations that lines of Python do, by kind: those of `COSTS`.

    Args:
        lines: What `source_lines` gives.

    Returns:
        The number of operations of each kind; signs are free.

    Example:
        >>> sorted(count_operations(["c0 = sin(x)*x", "y = c0/(1.0 - c0) + x"]).items())
        [('add', 2), ('call', 1), ('divide', 1), ('multiply', 1)]
    """
    import ast

    kinds: dict[Any, str] = {ast.Add: "add", ast.Sub: "add", ast.Mult: "multiply", ast.Div: "divide", ast.Pow: "power"}
    counts: Counter[str] = Counter()
    for line in lines:
        for node in ast.walk(ast.parse(line)):
            if isinstance(node, ast.BinOp | ast.AugAssign):
                counts[kinds[type(node.op)]] += 1
            elif isinstance(node, ast.Call):
                counts["sqrt" if getattr(node.func, "id", None) == "sqrt" else "call"] += 1
    return counts


def operation_cost(lines: Iterable[str]) -> int:
    """The operations that lines of Python do, weighted by `COSTS`."""
    return sum(COSTS[kind] * count for kind, count in count_operations(lines).items())


class _Printer:
    """Writes the values of one graph; what is used twice, or too long, gets a line of its own."""

    def __init__(self, graph: OperationGraph, terms: Sequence[Term], number: str | None, temporary: str):
        self.graph, self.terms, self.number, self.temporary = graph, terms, number, temporary
        self.lines: list[str] = []
        self.texts: dict[int, tuple[str, int]] = {}
        nodes = reachable(graph, [node for _, node in terms])
        self.uses = Counter(node for _, node in terms)
        for node in nodes:
            for child, times in graph.children(node):
                self.uses[child] += times
        self.taken: set[str] = {graph.nodes[node][1] for node in nodes if graph.nodes[node][0] == "name"}
        self.temporaries = 0

    def print(self, targets: Sequence[str]) -> list[str]:
        """The lines that assign the values to these targets."""
        self.taken = {name for text in (*self.taken, *targets) for name in re.findall(r"\w+", text)}
        for target, term in zip(targets, self.terms, strict=True):
            if target.endswith("+=") and is_negative(term[0]):
                target, term = f"{target[:-2]}-=", (-term[0], term[1])
            text = self.term(term)[0]
            self.lines.append(f"{target} {text}" if target.endswith("=") else f"{target} = {text}")
        return self.lines

    def named(self, text: str) -> tuple[str, int]:
        """A new temporary variable with this value."""
        name = f"{self.temporary}{self.temporaries}"
        while name in self.taken:
            self.temporaries += 1
            name = f"{self.temporary}{self.temporaries}"
        self.temporaries += 1
        self.lines.append(f"{name} = {text}")
        return name, ATOM

    def node(self, node: int) -> tuple[str, int]:
        """The text of a node: written out where it is used once, else its variable."""
        if node not in self.texts:
            text, binding = self.written(node)
            shared = self.uses[node] > 1 and self.graph.nodes[node][0] != "name"
            self.texts[node] = self.named(text) if shared or len(text) > MAX_LENGTH else (text, binding)
        return self.texts[node]

    def written(self, node: int) -> tuple[str, int]:
        """The text of a node, written out."""
        kind, *content = self.graph.nodes[node]
        if kind == "name":
            return content[0], ATOM
        if kind == "sum":
            return self.sum(content[0]), SUM
        if kind == "product":
            return self.quotient(Fraction(1), *self.expanded(node))
        if kind == "call":
            return f"{content[0]}({self.term(content[1])[0]})", ATOM
        base, exponent = map(self.term, content)
        return f"{within(base, ATOM)}**{within(exponent, ATOM)}", PRODUCT

    def term(self, term: Term) -> tuple[str, int]:
        """The text of a coefficient times a node."""
        coefficient, node = term
        if not is_negative(coefficient):
            return self.scaled(coefficient, node)
        kind, *content = self.graph.nodes[node]
        if kind == "sum" and coefficient == -1 and self.uses[node] == 1:
            return self.sum([(-inner, child) for inner, child in content[0]]), SUM
        return f"-{within(self.scaled(-coefficient, node), PRODUCT)}", SUM

    def sum(self, terms: Iterable[Term]) -> str:
        """The text of a sum that begins without a minus, if it can; a long one goes over several lines."""
        signed = [(is_negative(coefficient), coefficient, node) for coefficient, node in terms]
        leading = next((k for k, (negative, *_) in enumerate(signed) if not negative), 0)
        text = ""
        for negative, coefficient, node in (signed[leading], *signed[:leading], *signed[leading + 1 :]):
            part = within(self.scaled(-coefficient if negative else coefficient, node), PRODUCT)
            if len(text) > MAX_LENGTH:
                text = self.named(text)[0]
            text += f" {'-' if negative else '+'} {part}" if text else f"{'-' if negative else ''}{part}"
        return text

    def scaled(self, coefficient: Coefficient, node: int) -> tuple[str, int]:
        """The text of a positive number times a node."""
        if coefficient == 1 and node != ONE:
            return self.node(node)
        return self.quotient(coefficient, *self.factors(node))

    def factors(self, node: int) -> tuple[list[tuple[str, int]], list[tuple[str, int]]]:
        """The texts that a node multiplies and divides by: those of a product that is used once are its factors."""
        if node == ONE or (self.graph.nodes[node][0] == "product" and self.uses[node] == 1):
            return self.expanded(node)
        return [self.node(node)], []

    def expanded(self, product: int) -> tuple[list[tuple[str, int]], list[tuple[str, int]]]:
        """The texts of the factors above and below the line of a product."""
        above, below = [], []
        for sides, powers in zip(((above, below), (below, above)), self.graph.nodes[product][1:], strict=True):
            for child, times in powers:
                for side, texts in zip(sides, self.factors(child), strict=True):
                    side.extend(texts * times)
        return above, below

    def quotient(self, coefficient: Coefficient, above: list[Any], below: list[Any]) -> tuple[str, int]:
        """The text of a positive number times factors over divisors; x/3 is rounded once, x·(1/3) twice."""
        if above and coefficient != 1 and self.divides(coefficient):
            below = [(self.constant(1 / coefficient), ATOM), *below]
        elif coefficient != 1 or not above:
            above = [(self.constant(coefficient), ATOM), *above]
        text = "*".join(within(factor, PRODUCT) for factor in above)
        if not below:
            return text, above[0][1] if len(above) == 1 else PRODUCT
        divisor = "*".join(within(factor, PRODUCT) for factor in below)
        return f"{text}/{divisor if len(below) == 1 and below[0][1] != PRODUCT else f'({divisor})'}", PRODUCT

    def divides(self, coefficient: Coefficient) -> bool:
        """Whether a number is written as a division: 1/n, unless it is a double or n is none."""
        if not isinstance(coefficient, Fraction) or coefficient.numerator != 1 or coefficient.denominator == 1:
            return False
        n = coefficient.denominator
        return self.number is not None or (n & (n - 1) != 0 and n < 2**53)

    def constant(self, value: Coefficient) -> str:
        """The text of a positive number."""
        return literal(value) if self.number is None else within(bound_text(value, self.number), PRODUCT)
