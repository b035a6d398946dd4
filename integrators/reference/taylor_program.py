"""A scene as a list of operations on power series, which gives the Taylor series of its solutions.

A register holds the series of a quantity: first those of the variables, then the constant 1, then one for each
operation. Every elementary function f satisfies f(u)' = g u' with another register g, so one operation covers them all.
Each operation is done once. Sums over particles are expanded row by row from the graph of the local formula, so a scene
of many particles is read quickly.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from itertools import accumulate, chain
from typing import Any, NamedTuple, TypeAlias

import mpmath
import numpy as np
import sympy
from mpmath import isfinite, mpf
from mpmath.libmp import to_rational

from integrators.compile.operation_graph import OperationGraph, Reader, reachable
from integrators.core.errors import IntegratorError, shorten
from integrators.exact.expressions import ELEMENTARY
from integrators.reference.double_double import split
from integrators.scenes.model.black_boxes import check_formulas
from integrators.scenes.model.system import VALUE, LocalTerm
from integrators.scenes.scene import Scene

WORKING_DIGITS = 60
"""Precision of numbers in formulas, twice that of the result."""

Term: TypeAlias = tuple[Any, int]
"""An mpmath number times a register."""

LINEAR, PRODUCT, POWER, FUNCTION = range(4)
"""The kinds of operations; `FUNCTION` + k is the function ELEMENTARY[k]."""
MAX_OPERATIONS = 1_000_000
"""Limit of 600 megabytes for their series."""
NOT_SMOOTH = ("abs", "sign")
PARTNERS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}


class TaylorProgram(NamedTuple):
    """The operations of a scene as arrays.

    Attributes:
        dimension: The number of variables, hence the register of the constant 1.
        operations: The rows of `Operations`; LINEAR has the first and the end of its terms.
        derivatives: The index of the first term of each derivative y_i', then the end of the last.
        registers: The register of each term of a linear combination.
        weights: The coefficient of each term, as a double-double number.
    """

    dimension: int
    operations: np.ndarray
    derivatives: np.ndarray
    registers: np.ndarray
    weights: np.ndarray


def taylor_program(scene: Scene) -> TaylorProgram:
    """The operations that compute f(y) for a scene.

    Example:
        >>> from integrators import Scene
        >>> program = taylor_program(Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)"))
        >>> len(program.operations)  # sin q, cos q and −sin q
        3
        >>> program.derivatives - program.derivatives[0], program.registers[program.derivatives[0] :]
        (array([0, 1, 2]), array([3, 0]))
    """
    check_formulas((term.formula for term in scene.numeric_terms), "Taylor series (settled_solution needs values only)")
    operations = Operations(scene.dimension)
    derivatives: list[list[Term]] = [[] for _ in range(scene.dimension)]
    try:
        with mpmath.workdps(WORKING_DIGITS):
            for term in scene.numeric_terms:
                _add(term, operations, derivatives)
            return _arrays(operations, [operations.merged(terms) for terms in derivatives])
    except RecursionError:
        raise IntegratorError("formula must be nested less deeply, but was nested beyond the limit of Python") from None
    except ZeroDivisionError:
        raise IntegratorError("formula must not divide by zero, but does") from None


def fraction_of(value: Any) -> Fraction:
    """A real number of Python or mpmath as an exact fraction, one of SymPy to 60 digits if irrational."""
    if isinstance(value, int | Fraction):
        return Fraction(value)
    if getattr(value, "is_Rational", False):
        return Fraction(int(value.p), int(value.q))
    try:
        number = value.evalf(WORKING_DIGITS, strict=True) if hasattr(value, "evalf") else value
    except ArithmeticError:
        raise IntegratorError(f"numbers must be distinguishable from zero, but one was {shorten(str(value))}") from None
    if not isfinite(number):
        raise IntegratorError(f"numbers must be finite, but one was {number}")
    return Fraction(*to_rational(number._mpf_))


def _add(term: LocalTerm, operations: Operations, derivatives: list[list[Term]]) -> None:
    """Add the contribution of a term, at every row of its index set, to the derivatives."""
    locals_ = [*(f"x{k}" for k in range(len(term.arguments))), *(f"d{k}" for k in range(len(term.data)))]
    graph = OperationGraph()
    reader = Reader(graph, {sympy.Symbol(name): name for name in locals_})
    wanted = {
        k: reader.read(term.formula if k == VALUE else term.formula.diff(sympy.Symbol(f"x{k}")))
        for k in sorted({output.derivative for output in term.outputs})
    }
    nodes = reachable(graph, [node for _, node in wanted.values()])
    data = [[_number(value) for value in data.values] for data in term.data]
    one, unit = operations.one, operations.unit
    for row in term.sites.rows():
        leaves = {f"d{k}": (data[k][row[role]], one) for k, (role, _) in enumerate(term.data)}
        for k, (plus, minus) in enumerate(term.arguments):
            leaves[f"x{k}"] = operations.sum([(unit, plus.at(row)), *([(-unit, minus.at(row))] if minus else [])])
        values = _evaluated(graph, nodes, leaves, operations)
        for k, place, sign in term.outputs:
            coefficient, register = values[wanted[k][1]]
            derivatives[place.at(row)].append((sign * _number(wanted[k][0]) * coefficient, register))


def _number(value: Any) -> Any:
    """An exact number in working precision."""
    exact = fraction_of(value)
    return mpf(exact.numerator) / exact.denominator


def _evaluated(
    graph: OperationGraph, nodes: Iterable[int], leaves: Mapping[str, Term], operations: Operations
) -> dict[int, Term]:
    """The values of the nodes of a graph, given its variables and data."""
    values: dict[int, Term] = {}

    def scaled(term: Any) -> Term:
        coefficient, register = values[term[1]]
        return _number(term[0]) * coefficient, register

    for node in nodes:
        kind, *content = graph.nodes[node]
        if kind == "name":
            values[node] = leaves[content[0]]
        elif kind == "sum":
            values[node] = operations.sum(map(scaled, content[0]))
        elif kind == "product":
            values[node] = operations.product(operations.power(values[factor], n) for factor, n in content[0])
        elif kind == "where" or content[0] in NOT_SMOOTH:
            name = content[0] if kind == "call" else kind
            raise IntegratorError(f"scene must have a smooth field for a reference solution, but its field has {name}")
        elif kind == "call":
            values[node] = operations.function(content[0], scaled(content[1]))
        else:
            values[node] = operations.general_power(*map(scaled, content))
    return values


def _arrays(operations: Operations, derivatives: list[tuple[Term, ...]]) -> TaylorProgram:
    combinations = [*operations.combinations, *derivatives]
    ends = [0, *accumulate(map(len, combinations))]
    rows = [[LINEAR, ends[row[1]], ends[row[1] + 1], 0] if row[0] == LINEAR else row for row in operations.rows]
    terms = list(chain.from_iterable(combinations))
    return TaylorProgram(
        dimension=operations.one,
        operations=np.array(rows, dtype=np.int64).reshape(-1, 4),
        derivatives=np.array(ends[len(operations.combinations) :], dtype=np.int64),
        registers=np.array([register for _, register in terms], dtype=np.int64),
        weights=np.array([_weight(coefficient) for coefficient, _ in terms], dtype=float).reshape(-1, 2),
    )


def _weight(number: Any) -> tuple[float, float]:
    try:
        return split(fraction_of(number))
    except OverflowError:
        raise IntegratorError(
            f"formula must have numbers in the range of doubles, but has {shorten(str(number))}"
        ) from None


class Operations:
    """A growing list of operations.

    Attributes:
        one: The register of the constant 1.
        rows: For each operation its kind, then for LINEAR the index in `combinations`, for PRODUCT two registers, for
            POWER a register, the numerator and the denominator of the exponent, for FUNCTION + k the registers u and g.
        combinations: Linear combinations of registers.
    """

    def __init__(self, dimension: int):
        self.one = dimension
        self.rows: list[list[int]] = []
        self.combinations: list[tuple[Term, ...]] = []
        self.unit = mpf(1)
        self._known: dict[Any, int] = {}

    def sum(self, terms: Iterable[Term]) -> Term:
        """The sum of terms."""
        kept = self.merged(terms)
        if len(kept) < 2:
            return kept[0] if kept else (0 * self.unit, self.one)
        return self.unit, self._combination(kept)

    def merged(self, terms: Iterable[Term]) -> tuple[Term, ...]:
        """The terms of a sum, one for each register."""
        total: dict[int, Any] = {}
        for coefficient, register in terms:
            total[register] = total.get(register, 0) + coefficient
        return tuple((coefficient, register) for register, coefficient in sorted(total.items()) if coefficient)

    def product(self, factors: Iterable[Term]) -> Term:
        """The product of terms."""
        number, product = self.unit, self.one
        for coefficient, register in factors:
            number *= coefficient
            if product == self.one:
                product = register
            elif register != self.one:
                product = self._operation(PRODUCT, *sorted((product, register)))
        return number, product

    def power(self, term: Term, exponent: Fraction) -> Term:
        """A rational power of a term; positive integer powers are products, whose factors may vanish."""
        number, register = term
        whole = exponent.denominator == 1
        if number < 0 and register != self.one and not whole:  # (−x)^(1/2) is not a multiple of x^(1/2)
            number, register = self.unit, self.register(term)
        number **= exponent.numerator if whole else self.unit * exponent.numerator / exponent.denominator
        if register == self.one:
            return _real(number), self.one
        if whole and exponent > 0:
            return number, self._integer_power(register, exponent.numerator)
        return number, self._operation(POWER, register, exponent.numerator, exponent.denominator)

    def general_power(self, base: Term, exponent: Term) -> Term:
        """The power of a term by a term."""
        return self.function("exp", self.product([exponent, self.function("log", base)]))

    def function(self, name: str, term: Term) -> Term:
        """An elementary function of a term."""
        if term[1] == self.one:
            return _real(getattr(mpmath, name)(term[0])), self.one
        u = self.register(term)
        if (name, u) not in self._known:
            value = self._known[name, u] = self._append(FUNCTION + ELEMENTARY.index(name), u)
            derivative = self.register(self._derivative(name, (self.unit, u), (self.unit, value)))
            self.rows[value - self.one - 1][2] = derivative
        return self.unit, self._known[name, u]

    def register(self, term: Term) -> int:
        """A register that holds a term."""
        return term[1] if term[0] == 1 else self._combination((term,))

    def _derivative(self, name: str, u: Term, value: Term) -> Term:
        """The derivative of a function with this value at u."""
        one, minus = (self.unit, self.one), (-self.unit, self.one)
        if name == "exp":
            return value
        if name in ("sin", "cos", "sinh", "cosh"):
            factor = minus if name == "cos" else one
            return self.product([factor, self.function(PARTNERS[name], u)])
        if name in ("tan", "tanh"):
            return self.sum([one, self.product([one if name == "tan" else minus, value, value])])
        if name == "log":
            return self.power(u, Fraction(-1))
        if name == "erf":
            factor = 2 / mpmath.sqrt(mpmath.pi), self.one
            return self.product([factor, self.function("exp", self.product([minus, u, u]))])
        if name in ("atan", "asinh"):
            square = self.sum([one, self.product([u, u])])
        else:
            factor = one if name == "acosh" else minus
            square = self.product([factor, self.sum([u, one]), self.sum([u, minus])])  # 1 − u² loses digits near 1
        power = self.power(square, Fraction(-1) if name in ("atan", "atanh") else Fraction(-1, 2))
        return self.product([minus, power]) if name == "acos" else power

    def _integer_power(self, register: int, n: int) -> int:
        if n == 1:
            return register
        half = self._integer_power(register, n // 2)
        square = self._operation(PRODUCT, half, half)
        return self._operation(PRODUCT, *sorted((register, square))) if n % 2 else square

    def _combination(self, terms: tuple[Term, ...]) -> int:
        if terms not in self._known:
            self._known[terms] = self._append(LINEAR, len(self.combinations))
            self.combinations.append(terms)
        return self._known[terms]

    def _operation(self, *content: int) -> int:
        if content not in self._known:
            self._known[content] = self._append(*content)
        return self._known[content]

    def _append(self, *content: int) -> int:
        if len(self.rows) == MAX_OPERATIONS:
            raise IntegratorError(
                f"scene must take at most {MAX_OPERATIONS:,} operations for its Taylor series, but takes more"
            )
        self.rows.append([*content, *[0] * (4 - len(content))])
        return self.one + len(self.rows)


def _real(number: Any) -> Any:
    """The number, refused unless real and finite."""
    if isinstance(number, mpmath.mpf) and mpmath.isfinite(number):
        return number
    raise IntegratorError(f"parameters must make the field real and finite, but gave {shorten(str(number))}")
