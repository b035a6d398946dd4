"""Formulas as assignments in Python, and functions as modules for numba.

The text depends on the formulas only. Every number is a correctly rounded literal.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from textwrap import wrap
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

import sympy

from bseries_base.syntax_trees import syntax_tree
from integrators.compile.operation_graph import (
    ONE,
    OperationGraph,
    Reader,
    Term,
    expand_powers,
    is_negative,
    reachable,
)
from integrators.core.errors import IntegratorError
from integrators.exact.arithmetic import Exact, in_sympy, simplest
from integrators.exact.expressions import ATOM, ELEMENTARY, PRODUCT, SUM, Part, literal, within

if TYPE_CHECKING:
    from integrators.scenes.model.system import System

FUNCTIONS = (*ELEMENTARY, "sqrt")
"""The functions that lines may call, with their names in the module math."""

BOX = "box_"
"""Begins the names of black boxes in generated code."""

COSTS = {"add": 1, "multiply": 1, "divide": 4, "sqrt": 5, "call": 20, "power": 40}
"""Costs of operations in units of an addition; square roots and divisions overlap with other operations."""

MAX_LENGTH = 90
"""Length beyond which an expression gets a temporary variable."""


T = TypeVar("T", covariant=True)


class Assign(NamedTuple, Generic[T]):
    """A statement ``target op value`` with the operator ``=``, ``+=`` or ``-=``; the value is a formula or text."""

    target: str
    op: str
    value: T

    def __str__(self) -> str:
        return f"{self.target} {self.op} {self.value}"


def source_lines(
    assignments: Iterable[Assign[sympy.Expr]],
    names: Mapping[sympy.Symbol, str],
) -> list[str]:
    """Write formulas as assignments in Python, without common subexpressions.

    Example:
        >>> import sympy
        >>> x, y = sympy.symbols("x y")
        >>> r = sympy.sqrt(x**2 + y**2)
        >>> force = [Assign("out[0]", "=", -x / r**3), Assign("out[1]", "+=", -y / r**3)]
        >>> print(*source_lines(force, {x: "x", y: "y"}), sep="\\n")
        c0 = x*x + y*y
        c1 = 1.0/(c0*sqrt(c0))
        out[0] = -x*c1
        out[1] -= y*c1
    """
    assignments = list(assignments)
    graph = OperationGraph()
    reader = Reader(graph, names)
    try:
        terms = [reader.read(in_sympy(assignment.value)) for assignment in assignments]
        expanded = [expand_powers(graph, terms, horner=horner) for horner in (False, True)]
        printed = [_Printer(*pair).print(assignments) for pair in expanded]
    except RecursionError:
        raise IntegratorError("formula must be nested less deeply, but was nested beyond the limit of Python") from None
    except ZeroDivisionError:
        raise IntegratorError("formula must not divide by zero, but does") from None
    return min(printed, key=operation_cost)


def count_operations(lines: Iterable[str]) -> Counter[str]:
    """Count the operations in lines of Python.

    Example:
        >>> sorted(count_operations(["c0 = sin(x)*x", "y = c0/(1.0 - c0) + x"]).items())
        [('add', 2), ('call', 1), ('divide', 1), ('multiply', 1)]
    """
    import ast

    kinds: dict[type[ast.operator], str] = {
        ast.Add: "add", ast.Sub: "add", ast.Mult: "multiply", ast.Div: "divide", ast.Pow: "power"
    }  # fmt: skip
    counts: Counter[str] = Counter()
    for line in lines:
        for node in ast.walk(syntax_tree(line)):
            if isinstance(node, ast.BinOp | ast.AugAssign):
                counts[kinds[type(node.op)]] += 1
            elif isinstance(node, ast.Call):
                name = getattr(node.func, "id", "")
                counts[{"sqrt": "sqrt", "abs": "add"}.get(name, "call")] += 1
            elif isinstance(node, ast.IfExp):
                counts["add"] += 1
    return counts


def operation_cost(lines: Iterable[str]) -> int:
    """The number of operations in lines of Python, weighted by `COSTS`."""
    return sum(COSTS[kind] * count for kind, count in count_operations(lines).items())


class _Printer:
    """Prints a graph; nodes with several uses and long expressions get temporary variables."""

    def __init__(self, graph: OperationGraph, terms: Sequence[Term]):
        self.graph, self.terms = graph, terms
        self.lines: list[str] = []
        self.texts: dict[int, Part] = {}
        nodes = reachable(graph, [node for _, node in terms])
        self.uses = Counter(node for _, node in terms)
        for node in nodes:
            for child, times in graph.children(node):
                self.uses[child] += times
        self.taken: set[str] = {graph.nodes[node][1] for node in nodes if graph.nodes[node][0] == "name"}
        self.temporaries = 0

    def print(self, assignments: Sequence[Assign[sympy.Expr]]) -> list[str]:
        """The lines of these statements, whose values are the terms."""
        targets = (assignment.target for assignment in assignments)
        self.taken = {name for text in (*self.taken, *targets) for name in re.findall(r"\w+", text)}
        for (target, op, _), (coefficient, node) in zip(assignments, self.terms, strict=True):
            if op == "+=" and is_negative(coefficient):
                op, coefficient = "-=", -coefficient
            self.lines.append(str(Assign(target, op, self.term((coefficient, node))[0])))
        return self.lines

    def named(self, text: str) -> Part:
        """Assign a text to a new temporary variable."""
        name = f"c{self.temporaries}"
        while name in self.taken:
            self.temporaries += 1
            name = f"c{self.temporaries}"
        self.temporaries += 1
        self.lines.append(f"{name} = {text}")
        return name, ATOM

    def node(self, node: int) -> Part:
        """The text of a node: its expression if it has one use, otherwise its variable."""
        if node not in self.texts:
            text, binding = self.expression(node)
            shared = self.uses[node] > 1 and self.graph.nodes[node][0] not in ("name", "box")
            self.texts[node] = self.named(text) if shared or len(text) > MAX_LENGTH else (text, binding)
        return self.texts[node]

    def expression(self, node: int) -> Part:
        """The expression of a node."""
        kind, *content = self.graph.nodes[node]
        if kind == "name":
            return content[0], ATOM
        if kind == "sum":
            return self.sum(content[0]), SUM
        if kind == "product":
            return self.quotient(Fraction(1), *self.product_parts(node))
        if kind == "call" and content[0] == "sign":
            x = within(self.term(content[1]), SUM)
            return f"(1.0 if {x} > 0.0 else -1.0 if {x} < 0.0 else {x})", ATOM  # 0 or nan
        if kind == "call":
            return f"{content[0]}({self.term(content[1])[0]})", ATOM
        if kind == "where":
            x, a, b = (self.term(part)[0] for part in content)
            return f"({a} if {x} > 0.0 else {b} if {x} <= 0.0 else {x})", ATOM  # nan where it is undecided
        if kind == "entry":
            return f"{self.term(content[1])[0]}[{content[0]}]", ATOM
        if kind == "box":
            return self.box(*content), ATOM
        base, exponent = map(self.term, content)
        return f"{within(base, ATOM)}**{within(exponent, ATOM)}", PRODUCT

    def box(self, key: str, *values: Term) -> str:
        """The array with the arguments of a black box, and its values after them."""
        from integrators.scenes.model.black_boxes import box_of

        texts = [self.term(value)[0] for value in values]
        array = self.named(f"stack({box_of(key).total})")[0]
        self.lines += [f"{array}[{k}] = {text}" for k, text in enumerate(texts)]
        self.lines.append(f"{BOX}{key}({array})")
        return array

    def term(self, term: Term) -> Part:
        """The text of a coefficient times a node."""
        coefficient, node = term
        if not is_negative(coefficient):
            return self.scaled(coefficient, node)
        kind, *content = self.graph.nodes[node]
        if kind == "sum" and coefficient == -1 and self.uses[node] == 1:
            return self.sum([(-inner, child) for inner, child in content[0]]), SUM
        return f"-{within(self.scaled(-coefficient, node), PRODUCT)}", SUM

    def sum(self, terms: Iterable[Term]) -> str:
        """The text of a sum, which begins without a minus if possible; a long one uses temporary variables."""
        signed = [(is_negative(coefficient), coefficient, node) for coefficient, node in terms]
        leading = next((k for k, (negative, *_) in enumerate(signed) if not negative), 0)
        text = ""
        for negative, coefficient, node in (signed[leading], *signed[:leading], *signed[leading + 1 :]):
            part = within(self.scaled(-coefficient if negative else coefficient, node), PRODUCT)
            if len(text) > MAX_LENGTH:
                text = self.named(text)[0]
            text += f" {'-' if negative else '+'} {part}" if text else f"{'-' if negative else ''}{part}"
        return text

    def scaled(self, coefficient: Exact, node: int) -> Part:
        """The text of a positive number times a node."""
        if coefficient == 1 and node != ONE:
            return self.node(node)
        return self.quotient(coefficient, *self.factors(node))

    def factors(self, node: int) -> tuple[list[Part], list[Part]]:
        """Numerator and denominator of a node; a product with one use is split into its factors."""
        if node == ONE or (self.graph.nodes[node][0] == "product" and self.uses[node] == 1):
            return self.product_parts(node)
        return [self.node(node)], []

    def product_parts(self, product: int) -> tuple[list[Part], list[Part]]:
        """Numerator and denominator of a product."""
        above, below = [], []
        for sides, powers in zip(((above, below), (below, above)), self.graph.nodes[product][1:], strict=True):
            for child, times in powers:
                for side, texts in zip(sides, self.factors(child), strict=True):
                    side.extend(texts * times)
        return above, below

    def quotient(self, coefficient: Exact, above: list[Part], below: list[Part]) -> Part:
        """The text of a positive number times a quotient; x/3 is rounded once, x·(1/3) twice."""
        if above and coefficient != 1 and self.divides(coefficient):
            below = [(literal(1 / coefficient), ATOM), *below]
        elif coefficient != 1 or not above:
            above = [(literal(coefficient), ATOM), *above]
        text = "*".join(within(factor, PRODUCT) for factor in above)
        if not below:
            return text, above[0][1] if len(above) == 1 else PRODUCT
        divisor = "*".join(within(factor, PRODUCT) for factor in below)
        return f"{text}/{divisor if len(below) == 1 and below[0][1] != PRODUCT else f'({divisor})'}", PRODUCT

    def divides(self, coefficient: Exact) -> bool:
        """Whether 1/n is written as a division, because n is a double and 1/n is not."""
        if not isinstance(coefficient, Fraction) or coefficient.numerator != 1 or coefficient.denominator == 1:
            return False
        n = coefficient.denominator
        return n & (n - 1) != 0 and n < 2**53


MAX_KEPT_DATA = 100_000
"""Numbers in a constant array beyond which machine code is not cached on disk (a megabyte)."""
KEPT, COMPILED = "from bseries_base.machine_code import njit", "from numba import njit"
MAX_WIDTH = 100
WRITTEN = '{box}{key} = written("{key}")'
CALLED = """\
address_{key} = address_of("{key}")


@compiled
def {box}{key}(a):
    call_values(address_{key}, a)
"""
"""A black box in generated code: written with its callers, or called by functions that numba compiles and keeps."""

SCENE_FUNCTIONS = '''\
"""The field f of y' = f(y) and its observables in double precision.

{state}
"""

{imports}

compiled = njit(nogil=True, error_model="numpy", fastmath={{"contract"}})
{constants}
'''


class ModuleText:
    """Functions of a module, and their constant arrays.

    Args:
        lanes: Whether sums over many particles are written for SIMD instructions, with work arrays on the stack.
        plain: Whether functions are lowered with their callers instead of being compiled one by one.
    """

    def __init__(self, *, lanes: bool = False, plain: bool = False):
        self.lanes, self.decorator = lanes, "" if plain else "@compiled"
        self._functions: list[str] = []
        self._arrays: dict[tuple[str, ...], str] = {}

    def numbers(self, values: Sequence[object]) -> str:
        """The name of a constant array of exact numbers."""
        return self._arrays.setdefault(tuple(map(literal, map(simplest, values))), f"D{len(self._arrays)}")

    def integers(self, values: Sequence[int]) -> str:
        """The name of a constant array of integers."""
        return self._arrays.setdefault(tuple(map(str, values)), f"D{len(self._arrays)}")

    def function(self, signature: str, summary: str, body: Sequence[str], decorator: str | None = None) -> None:
        """Add a function."""
        decorators = [self.decorator if decorator is None else decorator]
        lines = [*filter(None, decorators), f"def {signature}:", f'    """{summary}"""', *indented(body)]
        self._functions.append("\n".join(lines))

    @property
    def bodies(self) -> str:
        """The functions so far."""
        return "\n\n\n".join(self._functions)

    def source(self, scene: System, template: str | None = None) -> str:
        """The text of the module; the template of its head is by default that of a scene's functions."""
        bodies = self.bodies
        called = ", ".join(name for name in FUNCTIONS if re.search(rf"\b{name}\(", bodies))
        imports = ["import numpy as np"] * bool(self._arrays) + [f"from math import {called}"] * bool(called)
        boxes = sorted(set(re.findall(rf"\b{BOX}(\w+)\(", bodies)))
        if boxes:
            imports.append("from integrators.compile.black_boxes import address_of, written")
        if template is None and boxes:
            imports += [COMPILED, "from integrators.compile.machine import call_values, stack"]
        elif template is None:
            imports.append(KEPT if all(len(texts) <= MAX_KEPT_DATA for texts in self._arrays) else COMPILED)
        constants = [(CALLED if template is None else WRITTEN).format(box=BOX, key=key) for key in boxes]
        for texts, name in self._arrays.items():
            constants += [f"{name} = np.array([", *indented(wrap(f"{', '.join(texts)},", MAX_WIDTH)), "])"]
        head = (template or SCENE_FUNCTIONS).format(
            state="\n".join(f"y[{b.offset}:{b.end}] = {_shown(b.variables)}" for b in scene.blocks),
            imports="\n".join(imports),
            constants="\n".join(constants),
        )
        return f"{head.rstrip()}\n\n\n{bodies}\n"


def _shown(names: Sequence[str]) -> str:
    return ", ".join(names if len(names) < 8 else (*names[:4], "…", names[-1]))


def indented(lines: Iterable[str]) -> list[str]:
    """The lines as the body of a block."""
    return [f"    {line}" for line in lines]
