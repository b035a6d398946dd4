"""Taylor series of the solutions of a scene, in double-double numbers: its operations on power series, and their steps.

A register holds the series of a quantity: first those of the variables, then the constant 1, then one for each
operation. Every elementary function f satisfies f(u)' = g u' with another register g, so one operation covers them all.
Each operation is done once. Sums over particles are expanded row by row from the graph of the local formula, so a scene
of many particles is read quickly.

A compiled step expands all series order by order, then sums them at its end. Series are in powers of
s = (t − t_n)/unit, with a signed power of two near the step as unit: coefficients in t itself may leave the range of
doubles.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from fractions import Fraction
from itertools import accumulate, chain
from typing import Any, NamedTuple, TypeAlias

import mpmath
import numpy as np
import sympy
from mpmath import isfinite, mpf
from mpmath.libmp import to_rational
from numpy.typing import NDArray

from bseries_base.errors import shorten
from bseries_base.machine_code import njit
from integrators.compile import machine
from integrators.compile.machine import fma
from integrators.compile.operation_graph import OperationGraph, Reader, reachable
from integrators.core.errors import IntegratorError
from integrators.exact import expressions
from integrators.exact.arithmetic import simplest
from integrators.exact.expressions import ELEMENTARY
from integrators.reference import double_double
from integrators.reference.double_double import (
    DoubleDouble,
    add,
    divide,
    inlined,
    integer_power,
    multiply,
    quick_two_sum,
    scale,
    split,
    square_root,
    strict,
    subtract,
    two_product,
    two_sum,
)
from integrators.scenes.model.black_boxes import check_formulas
from integrators.scenes.model.system import VALUE, LocalTerm
from integrators.scenes.scene import Scene

WORKING_DIGITS = 60
"""Precision of numbers in formulas, twice that of the result."""

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]
Number: TypeAlias = Any  # exact, or a number of mpmath or of python-flint, which declare no types
Term: TypeAlias = tuple[Number, int]
"""An mpmath number times a register."""

LINEAR, PRODUCT, POWER, FUNCTION = range(4)
"""The kinds of operations; `FUNCTION` + k is the function ELEMENTARY[k]."""
MAX_OPERATIONS = 1_000_000
"""Limit of 600 megabytes for their series."""
NOT_SMOOTH = ("abs", "sign")
PARTNERS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}


class TaylorProgram(NamedTuple):
    """The operations of a scene as arrays."""

    dimension: int  # the number of variables, hence the register of the constant 1
    operations: Indices  # the rows of `Operations`; LINEAR has the first and the end of its terms
    derivatives: Indices  # the index of the first term of each derivative y_i', then the end of the last
    registers: Indices  # the register of each term of a linear combination
    weights: Array  # its coefficient, as a double-double number


def taylor_program(scene: Scene) -> TaylorProgram:
    """The operations that compute f(y) for a scene."""
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


def fraction_of(value: Number) -> Fraction:
    """A real number of Python or mpmath as an exact fraction, one of SymPy to 60 digits if irrational."""
    if isinstance(value, int | Fraction):
        return Fraction(value)
    if getattr(value, "is_Rational", False):
        return simplest(value)
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


def _number(value: object) -> Number:
    """An exact number in working precision."""
    exact = fraction_of(value)
    return mpf(exact.numerator) / exact.denominator


def _evaluated(
    graph: OperationGraph, nodes: Iterable[int], leaves: Mapping[str, Term], operations: Operations
) -> dict[int, Term]:
    """The values of the nodes of a graph, given its variables and data."""
    values: dict[int, Term] = {}

    def scaled(term: tuple[object, int]) -> Term:
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
            base, exponent = map(scaled, content)
            values[node] = operations.function("exp", operations.product([exponent, operations.function("log", base)]))
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


def _weight(number: object) -> tuple[float, float]:
    try:
        return split(fraction_of(number))
    except OverflowError:
        raise IntegratorError(
            f"formula must have numbers in the range of doubles, but has {shorten(str(number))}"
        ) from None


class Operations:
    """A growing list of operations."""

    def __init__(self, dimension: int):
        self.one = dimension  # the register of the constant 1
        # For each operation its kind, then for LINEAR the index in `combinations`, for PRODUCT two registers, for POWER
        # a register, the numerator and the denominator of the exponent, for FUNCTION + k the registers u and g.
        self.rows: list[list[int]] = []
        self.combinations: list[tuple[Term, ...]] = []
        self.unit = mpf(1)
        self._known: dict[tuple[object, ...], int] = {}

    def sum(self, terms: Iterable[Term]) -> Term:
        """The sum of terms."""
        kept = self.merged(terms)
        if len(kept) < 2:
            return kept[0] if kept else (0 * self.unit, self.one)
        return self.unit, self._combination(kept)

    def merged(self, terms: Iterable[Term]) -> tuple[Term, ...]:
        """The terms of a sum, one for each register."""
        total: dict[int, Number] = {}
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


def _real(number: object) -> Number:
    """The number, refused unless real and finite."""
    if isinstance(number, mpmath.mpf) and mpmath.isfinite(number):
        return number
    raise IntegratorError(f"parameters must make the field real and finite, but gave {shorten(str(number))}")


RUNNING, DONE, STUCK = range(3)
LARGEST_STEP = 16.0
"""In units; needed where all high coefficients vanish, as at a point of symmetry."""
SMALLEST_STEP = 2.0**-64
"""As a fraction of the whole interval; near a pole, steps shrink by a constant factor."""
STEP_BITS = 24
"""Bits of a step, few enough that the time stays exact."""
BIAS = 2.0**-6
"""Relative bias of the perturbations: 1/n is always rounded alike, so amplitudes grow by 2^-110 a step."""
INVERSES = np.array([split(Fraction(1, max(n, 1))) for n in range(64)])


SIN, COS, TAN, ASIN, ACOS, ATAN, SINH, COSH, TANH, ASINH, ACOSH, ATANH, EXP, LOG, ERF = range(
    FUNCTION, FUNCTION + len(ELEMENTARY)
)


@inlined
def convolution(series: Array, x: int, y: int, first: int, end: int, k: int) -> DoubleDouble:
    """Σ_{first ≤ j < end} x_j y_{k−j}: the high parts exactly, the rest in doubles."""
    total, rest = 0.0, 0.0
    for j in range(first, end):
        product, error = two_product(series[x, j, 0], series[y, k - j, 0])
        total, lost = two_sum(total, product)
        rest += lost + fma(series[x, j, 1], series[y, k - j, 0], fma(series[x, j, 0], series[y, k - j, 1], error))
    return quick_two_sum(total, rest)


@inlined
def weighted(
    series: Array, x: int, y: int, first: int, end: int, k: int, start: float, increment: float
) -> DoubleDouble:
    """Σ_{first ≤ j < end} (start + increment·j) x_j y_{k−j}; the weights are integers."""
    total, rest = 0.0, 0.0
    for j in range(first, end):
        weight = start + increment * j
        high, low = two_product(weight, series[x, j, 0])
        low = fma(weight, series[x, j, 1], low)
        product, error = two_product(high, series[y, k - j, 0])
        total, lost = two_sum(total, product)
        rest += lost + fma(low, series[y, k - j, 0], fma(high, series[y, k - j, 1], error))
    return quick_two_sum(total, rest)


@inlined
def linear(series: Array, registers: Indices, weights: Array, first: int, end: int, k: int) -> DoubleDouble:
    """The k-th coefficient of a linear combination."""
    total, rest = 0.0, 0.0
    for i in range(first, end):
        x = registers[i]
        product, error = two_product(weights[i, 0], series[x, k, 0])
        total, lost = two_sum(total, product)
        rest += lost + fma(weights[i, 1], series[x, k, 0], fma(weights[i, 0], series[x, k, 1], error))
    return quick_two_sum(total, rest)


@inlined
def product(series: Array, x: int, y: int, k: int) -> DoubleDouble:
    """The k-th coefficient of a product; a square takes half the work."""
    square = x == y
    total = convolution(series, x, y, 0, (k + 1) // 2 if square else k + 1, k)
    if square:
        total = scale(total, 2.0)
        if k % 2 == 0:
            middle = (series[x, k // 2, 0], series[x, k // 2, 1])
            total = add(total, multiply(middle, middle))
    return total


@inlined
def power(series: Array, u: int, value: int, numerator: int, denominator: int, k: int) -> DoubleDouble:
    """The k-th coefficient of v = u^(a/b) for k > 0, from b u v' = a u' v."""
    total = weighted(series, value, u, 0, k, k, float(numerator * k), -float(numerator + denominator))
    return divide(total, scale((series[u, 0, 0], series[u, 0, 1]), float(denominator * k)))


@inlined
def function(series: Array, u: int, derivative: int, k: int) -> DoubleDouble:
    """The k-th coefficient of v = f(u) for k > 0, from v' = g u'."""
    total = weighted(series, u, derivative, 1, k + 1, k, 0.0, 1.0)
    return multiply(total, (INVERSES[k, 0], INVERSES[k, 1]))


@strict
def first_of_function(u: DoubleDouble, kind: int, numerator: int, denominator: int) -> DoubleDouble:
    """u^(a/b), or f(u)."""
    if kind == POWER:
        if denominator == 1:
            return integer_power(u, numerator)
        if denominator == 2:
            return integer_power(square_root(u), numerator)
        exponent = divide((float(numerator), 0.0), (float(denominator), 0.0))
        return double_double.exp(multiply(exponent, double_double.log(u)))
    if kind == SIN:
        return double_double.sin(u)
    if kind == COS:
        return double_double.cos(u)
    if kind == TAN:
        return double_double.tan(u)
    if kind == ASIN:
        return double_double.asin(u)
    if kind == ACOS:
        return double_double.acos(u)
    if kind == ATAN:
        return double_double.atan(u)
    if kind == SINH:
        return double_double.sinh(u)
    if kind == COSH:
        return double_double.cosh(u)
    if kind == TANH:
        return double_double.tanh(u)
    if kind == ASINH:
        return double_double.asinh(u)
    if kind == ACOSH:
        return double_double.acosh(u)
    if kind == ATANH:
        return double_double.atanh(u)
    if kind == EXP:
        return double_double.exp(u)
    if kind == LOG:
        return double_double.log(u)
    return double_double.erf(u)


@strict
def expand(program: TaylorProgram, series: Array, unit: float, order: int) -> None:
    """Compute all coefficients to this order from the values of the variables."""
    one, operations, derivatives, registers, weights = program
    for k in range(order + 1):
        for i in range(len(operations)):
            kind, a, b, c = operations[i, 0], operations[i, 1], operations[i, 2], operations[i, 3]
            target = one + 1 + i
            if kind == LINEAR:
                value = linear(series, registers, weights, a, b, k)
            elif kind == PRODUCT:
                value = product(series, a, b, k)
            elif k == 0:
                value = first_of_function((series[a, 0, 0], series[a, 0, 1]), kind, b, c)
            elif kind == POWER:
                value = power(series, a, target, b, c, k)
            else:
                value = function(series, a, b, k)
            series[target, k, 0], series[target, k, 1] = value
        if k < order:
            for i in range(one):
                derivative = scale(linear(series, registers, weights, derivatives[i], derivatives[i + 1], k), unit)
                value = multiply(derivative, (INVERSES[k + 1, 0], INVERSES[k + 1, 1]))
                series[i, k + 1, 0], series[i, k + 1, 1] = value


@strict
def step_size(series: Array, dimension: int, order: int) -> float:
    """The step, in units, from the second half of the coefficients; nan if some are not finite.

    These show the radius of convergence, relative to the size of each variable, the largest of its first coefficients.
    A step of radius/e² needs the fewest operations per digit and unit of time (Jorba, Zou 2005).
    """
    radius = math.inf
    for i in range(dimension):
        size = 0.0
        for k in range(order // 2 + 1):
            size = max(size, abs(series[i, k, 0]))
        for k in range(order // 2 + 1, order + 1):
            coefficient = abs(series[i, k, 0])
            if not coefficient < math.inf:
                return math.nan
            if coefficient > 0:
                radius = min(radius, (size / coefficient) ** (1.0 / k))
    return min(radius * math.exp(-2 - 0.7 / (order - 1)), LARGEST_STEP)


@strict
def at(series: Array, i: int, order: int, s: DoubleDouble) -> DoubleDouble:
    """The value of a variable by Horner's rule."""
    total = (0.0, 0.0)
    for k in range(order, -1, -1):
        total = add(multiply(total, s), (series[i, k, 0], series[i, k, 1]))
    return total


@strict
def evaluate(
    series: Array, dimension: int, order: int, step: float, unit: float, state: Array, times: Array, first: int,
    values: Array,
) -> int:  # fmt: skip
    """Evaluate the solution and its size Σ |c_k step^k| at the times within a step; the index of the next time."""
    while first < len(times):
        s = scale(subtract((times[first, 0], times[first, 1]), (state[0], state[1])), 1 / unit)
        if s[0] > step:
            break
        for i in range(dimension):
            values[i, first, 0], values[i, first, 1] = at(series, i, order, s)
            size = 0.0
            for k in range(order, -1, -1):
                size = size * step + abs(series[i, k, 0])
            values[i, first, 2] = size
        first += 1
    return first


@njit(sources=(double_double, expressions, machine), nogil=True, error_model="numpy", fastmath=False)
def advance(
    program: TaylorProgram, series: Array, state: Array, order: int, perturbation: float, steps: int, times: Array,
    first: int, values: Array,
) -> tuple[int, int]:  # fmt: skip
    """Make at most `steps` steps, and evaluate the solution at the times that they pass, from index `first` on.

    The result is the index of the next time, and RUNNING, DONE, or STUCK (no step is possible). `series`, (registers,
    order + 1, 2), has the state in its first coefficients and is overwritten; `state`, the time since the start as a
    double-double number and the unit, is updated. `times`, (n, 2), are since the start, of one sign and increasing in
    size; `values`, (variables, n, 3), receives the solution there and its size within the step. `perturbation` is the
    relative change of each variable after each step, of random sign, and the relative extension of steps.
    """
    dimension = program.dimension
    series[dimension, :, :] = 0.0
    series[dimension, 0, 0] = 1.0
    for _ in range(steps):
        unit = state[2]
        if not abs(unit) > SMALLEST_STEP * abs(times[-1, 0]):
            return first, STUCK
        expand(program, series, unit, order)
        step = step_size(series, dimension, order)
        if not step > 0:
            state[2] = unit * 2.0**-16
            continue
        mantissa, exponent = math.frexp(step)
        if exponent >= 0:
            step = math.ldexp(math.floor(math.ldexp(mantissa, STEP_BITS)), exponent - STEP_BITS)
            first = evaluate(series, dimension, order, step, unit, state, times, first, values)
            if first == len(times):
                return first, DONE
            for i in range(dimension):
                value = at(series, i, order, (step, perturbation * step))
                sign = math.copysign(1.0, value[0]) * math.copysign(1.0, value[1])  # its low bits are random
                series[i, 0, 0], series[i, 0, 1] = multiply(value, (1.0, (sign + BIAS) * perturbation))
            state[0], state[1] = add((state[0], state[1]), (step * unit, 0.0))
        state[2] = math.ldexp(unit, exponent - 1 if exponent > 0 else exponent)
    return first, RUNNING
