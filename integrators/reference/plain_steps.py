"""Steps of any method by definition, evaluation by evaluation, in doubles or with mpmath numbers of any precision.

Slow; the oracle that compiled steppers are compared with. Vectors are NumPy arrays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, partial
from typing import Any, TypeAlias

import mpmath
import numpy as np

from bseries_base.errors import shorten, shown
from integrators.core.arguments import MOST_STEPS, check_digits, items, read_whole
from integrators.core.errors import IntegratorError
from integrators.exact.entries import is_sympy, read_entry
from integrators.exact.polynomials import gauss_legendre
from integrators.methods.programs.evaluations import Average, Derivative, Field, Flow, LinearForm, operands
from integrators.methods.programs.program import Method, Program

Vector = np.ndarray
Number: TypeAlias = Any  # a double, a complex number, or a number of mpmath, which declares no types
Function = Callable[..., Any]
Right = Callable[[Number, Vector], Vector]
ByPart = Function | Mapping[str, Function] | Sequence[Function]

GUARD_DIGITS = 10
"""Extra digits of mpmath numbers."""
MOST_BITS = 4000
"""mpmath numbers do not overflow, but a value of 2^4000, or 10^1204, has diverged."""
COMPLEX_STEP = 1e-50
MOST_HALVINGS = 12
NODES = (3, 6, 12, 24, 48, 96)
"""Numbers of nodes for averages of the field."""
MOST_ITERATIONS = 200
PATIENCE = 3
"""Iterations without a smaller increment after which the iteration has stagnated or diverges."""


class Arithmetic:
    """The numbers to compute with: doubles if `digits` is None, or mpmath numbers with guard digits."""

    def __init__(self, digits: int | None = None) -> None:
        check_digits(digits)
        self.digits = digits
        self.decimals = 16 if digits is None else digits + GUARD_DIGITS
        self.context: Any = mpmath.fp if digits is None else mpmath.mp
        self._largest: Number = math.inf if digits is None else mpmath.ldexp(1, MOST_BITS)

    @contextmanager
    def working(self) -> Iterator[None]:
        """A context for computations in this arithmetic."""
        with np.errstate(all="ignore"), mpmath.workdps(self.decimals):  # results are checked to be finite
            yield

    def number(self, value: object, argument: str) -> Number:
        """A finite number: a real number of any kind, or a formula without symbols."""
        if not hasattr(value, "_mpf_") and not is_sympy(value):
            value = read_entry(value, argument)
        if is_sympy(value):
            if value.free_symbols:
                raise IntegratorError(
                    f"{argument} must be a number, but has the symbol {min(map(str, value.free_symbols))}"
                )
            value = value.evalf(self.decimals + GUARD_DIGITS)
        try:
            number = +self.context.convert(value)
        except OverflowError:
            number = math.inf
        if not self.is_finite([number]):
            raise IntegratorError(f"{argument} must be a finite number, but was {shorten(str(value))}")
        return number

    def vector(self, values: object) -> Vector:
        """A vector of numbers of this arithmetic."""
        return np.array(values, dtype=float if self.digits is None else object)

    def read(self, values: object, argument: str) -> Vector:
        """A vector from an argument of the user."""
        numbers = items(values, argument)
        if not numbers:
            raise IntegratorError(f"{argument} must hold at least one number, but was empty")
        return self.vector([self.number(value, f"{argument}[{i}]") for i, value in enumerate(numbers, 1)])

    def received(self, values: object, dimension: int, argument: str) -> Vector:
        """A vector from a function of the user; components that are not real become NaN."""
        given, numbers = items(values, argument), []
        if len(given) != dimension:
            raise IntegratorError(f"{argument} must give {dimension} numbers, but gave {shown(values)}")
        for value in given:
            if self.digits is not None and isinstance(value, float) and math.isfinite(value) and not value.is_integer():
                raise IntegratorError(
                    f"{argument} must compute with mpmath for {self.digits} digits, but gave the float {value!r}"
                )
            try:
                number = +self.context.convert(value)
            except (TypeError, ValueError):
                raise IntegratorError(f"{argument} must give numbers, but gave {shown(value)}") from None
            numbers.append(math.nan if isinstance(number, self.context.mpc) else number)
        return self.vector(numbers)

    def is_finite(self, *vectors: Iterable[Number]) -> bool:
        """Whether all components are finite, and below 2^MOST_BITS for mpmath."""
        return all(abs(x) < self._largest for vector in vectors for x in vector)

    def rounded(self, vector: Iterable[object]) -> Vector:
        """The vector without guard digits."""
        if self.digits is None:
            return self.vector(vector)
        with mpmath.workdps(self.digits):
            return self.vector([+mpmath.mpmathify(x) for x in vector])


def plain_step(method: Method, field: ByPart, y: Sequence[object], h: object, **options: Any) -> Vector:
    """One step of a method, computed from its definition; the options are `derivative`, `flows` and `digits`.

    Implicit stages are found by fixed-point iteration, or else by Newton's method, until the increments stagnate; flows
    and averages of the field are computed numerically until they no longer change.
    """
    stepper = _Stepper(method, field, y, h, **options)
    return stepper.step(stepper.start)


def plain_steps(method: Method, field: ByPart, y: Sequence[object], h: object, steps: int, **options: Any) -> Vector:
    """Several steps of a method; the options and errors are those of `plain_step`."""
    read_whole(steps, "steps", "0, 1, 2, …", 0, MOST_STEPS)
    stepper = _Stepper(method, field, y, h, **options)
    columns = [stepper.start]
    for n in range(1, steps + 1):
        try:
            columns.append(stepper.step(columns[-1]))
        except IntegratorError as error:
            raise IntegratorError(f"{error}, in step {n}") from None
    return np.array(columns).T


def block_parts(function: Function, blocks: Mapping[str, Iterable[int]]) -> dict[str, Function]:
    """Split a field, or its derivative, into parts by blocks of variables."""
    if not callable(function) or not isinstance(blocks, Mapping):
        raise IntegratorError(f"blocks must map parts to components, but was {shown(blocks)}")
    numbers = {name: items(block, f"blocks[{name}]") for name, block in blocks.items()}
    together = [i for block in numbers.values() for i in block]
    if not all(isinstance(i, int) for i in together) or sorted(together) != list(range(len(together))):
        raise IntegratorError(f"blocks must hold 0, 1, … once each, but were {shown(numbers)}")

    def part(block: list[int]) -> Function:
        def restricted(*arguments: object) -> list[Any]:
            values = items(function(*arguments), "field")
            if len(values) != len(together):
                raise IntegratorError(f"blocks must hold {len(values)} components, but held {len(together)}")
            return [x if i in block else 0 for i, x in enumerate(values)]

        return restricted

    return {name: part(block) for name, block in numbers.items()}


def _by_part(given: object, names: Sequence[str], argument: str, *, optional: bool = False) -> list[Any]:
    """A function for each part, in their order, from a mapping, a sequence, or a single function."""
    wanted = f"a function for each of the parts {', '.join(names)}" if len(names) > 1 else "a function"
    functions = [given] if callable(given) else [None] * len(names) if given is None and optional else given
    if isinstance(given, Mapping):
        for name in given.keys() - set(names):
            raise IntegratorError(f"{argument} must be {wanted}, but has one for {shown(name)}")
        functions = [given.get(name) for name in names]
    if not isinstance(functions, Sequence) or len(functions) != len(names):
        hint = "; block_parts makes them from one" if callable(given) else ""
        raise IntegratorError(f"{argument} must be {wanted}, but was {shown(given)}{hint}")
    for name, function in zip(names, functions, strict=True):
        if not callable(function) and not (optional and function is None):
            raise IntegratorError(f"{argument} must be {wanted}, but for {name} was {shown(function)}")
    return list(functions)


class _Stepper:
    """A method, a field, and a step size."""

    def __init__(
        self, method: Method, field: ByPart, y: object, h: object, derivative: ByPart | None = None,
        flows: ByPart | None = None, digits: int | None = None,
    ):  # fmt: skip
        self.arithmetic = arithmetic = Arithmetic(digits)
        if not isinstance(method, Method):
            raise IntegratorError(f"method must be a method, but was {shown(method)}")
        self.program = program = method.rational_program(arithmetic.decimals)
        if program.parameters:
            raise IntegratorError(f"parameters must have values before a step, but {program.parameters[0]} had none")
        self.components = _components(program)
        self.coefficient = cache(partial(arithmetic.number, argument="coefficient"))
        with arithmetic.working():
            self.start = arithmetic.rounded(arithmetic.read(y, "y"))
            self.h = arithmetic.number(h, "h")
        self.functions = _by_part(field, program.names, "field")
        self.derivatives = _by_part(derivative, program.names, "derivative", optional=True)
        self.flows = _by_part(flows, program.names, "flows", optional=True)

    def step(self, y: Vector) -> Vector:
        """y₁ = y₀ + Σ b_e k_e, with the k_e of one strongly connected component at a time."""
        k: dict[int, Vector] = {}
        with self.arithmetic.working():
            for members, is_implicit in self.components:
                k.update(self._solve(members, y, k) if is_implicit else {e: self._evaluate(e, y, k) for e in members})
                for e in members:
                    self._check_finite(f"k{e + 1}", k[e])
            end = self._point(self.program.result, y, k)
            self._check_finite("the end of the step", end)
            return self.arithmetic.rounded(end)

    def _check_finite(self, what: str, vector: Vector) -> None:
        if not self.arithmetic.is_finite(vector):
            values = ", ".join(f"{float(x):g}" for x in vector[:3]) + ", …" * (len(vector) > 3)
            raise IntegratorError(
                f"{what} of {self.program.name} must be finite, but was {values} with h = {float(self.h):g}"
            )

    def _point(self, form: LinearForm, y: Vector, k: Mapping[int, Vector]) -> Vector:
        """start · y + Σ x_e k_e."""
        total = y * self.coefficient(form.start)
        for e, x in form.terms.items():
            total = total + k[e] * self.coefficient(x)
        return total

    def _evaluate(self, e: int, y: Vector, k: Mapping[int, Vector]) -> Vector:
        """k_e by the definitions in `integrators.methods.programs.evaluations`."""
        h, evaluation = self.h, self.program.evaluations[e]
        points = [self._point(form, y, k) for form in operands(evaluation)]
        parts = range(len(self.functions)) if evaluation.part is None else [evaluation.part]

        def field(z: Vector) -> Vector:
            return sum(self._call("field", self.functions[part], z) for part in parts) * h

        match evaluation:
            case Field():
                return field(*points)
            case Derivative():
                return sum(self._derivative(part, *points) for part in parts) * h
            case Flow():
                return self._flow(evaluation, field, *points)
            case Average():
                return self._average(evaluation.power, points, field)

    def _flow(self, flow: Flow, field: Function, start: Vector, *forcing: Vector) -> Vector:
        """z(1) − z(0) for z′ = time · h f^[part](z) + Σ_j θ^j forcing[j]."""
        time = self.coefficient(flow.time)
        exact = None if flow.part is None or forcing else self.flows[flow.part]
        if exact is not None:
            return self._call("flows", lambda z: exact(z, time * self.h), start) - start

        def right(θ: object, z: Vector) -> Vector:
            return field(z) * time + (_polynomial(forcing, θ) if forcing else 0)

        return _flow_increment(right, start, self.arithmetic)

    def _average(self, power: int, path: Sequence[Vector], field: Function) -> Vector:
        """∫₀¹ θ^power h f^[part](Σ_j θ^j path[j]) dθ by Gauss quadrature, with nodes added until it stays the same."""
        arithmetic, found = self.arithmetic, math.inf
        for count in NODES:
            rule = [map(self.coefficient, pair) for pair in gauss_legendre(count, arithmetic.decimals)]
            new: Any = sum(field(_polynomial(path, θ)) * (weight * θ**power) for θ, weight in rule)
            tolerance = 4 * arithmetic.context.eps * _size(*path, new)
            if not arithmetic.is_finite(new) or _size(new - found) <= tolerance:
                return new
            found = new
        raise IntegratorError(f"average of field must converge to {arithmetic.decimals} digits, but did not")

    def _derivative(self, part: int, y: Vector, v: Vector) -> Vector:
        """(f^[part])′(y) v, as given, or by a complex step in doubles, a difference with twice the digits otherwise.

        The first is wrong for fields that are not analytic or drop imaginary parts, the second for fields that round to
        fewer digits: a difference with a large step must agree.
        """
        field, given, length = self.functions[part], self.derivatives[part], _size(v)
        if given is not None:
            return self._call("derivative", given, y, v)
        if length == 0:
            return v * 0
        v = v / length
        if self.arithmetic.digits is None:
            try:
                values = [complex(x).imag / COMPLEX_STEP for x in field(y + 1j * COMPLEX_STEP * v)]
            except Exception as error:  # a field not made for complex numbers may raise anything
                raise IntegratorError(
                    f"derivative must be given, as field does not take complex numbers: {shorten(str(error))}"
                ) from None
            found = self.arithmetic.received(values, len(y), "field")
        else:
            found = mpmath.diff(lambda t: self._call("field", field, y + v * t), 0)
        rounding: Number = self.arithmetic.context.eps
        width = rounding ** (1 / 3) * max(1, _size(y))
        here, ahead, behind = (self._call("field", field, y + v * (x * width)) for x in (0, 1, -1))
        gap = _size(found - (ahead - behind) / (2 * width))
        if gap > rounding**0.25 * _size(found) + rounding**0.75 * _size(here) / width:
            raise IntegratorError(
                "derivative must be given for this field: two ways of computing it numerically do not agree"
            )
        return found * length

    def _call(self, argument: str, function: Function, *vectors: Vector) -> Vector:
        """The value of a function of the user; arithmetic errors give NaN."""
        dimension = len(self.start)
        try:
            return self.arithmetic.received(function(*(v.copy() for v in vectors)), dimension, argument)
        except ArithmeticError:
            return self.arithmetic.vector([math.nan] * dimension)

    def _solve(self, members: Sequence[int], y: Vector, k: Mapping[int, Vector]) -> dict[int, Vector]:
        """Solve for evaluations that depend on one another."""

        def split(x: Vector) -> dict[int, Vector]:
            return dict(zip(members, x.reshape(-1, len(y)), strict=True))

        def update(x: Vector) -> Vector:
            known = {**k, **split(x)}
            return np.concatenate([self._evaluate(e, y, known) for e in members])

        zeros = np.concatenate([y * 0 for _ in members])
        first = update(zeros)
        for e, vector in split(first).items():
            self._check_finite(f"k{e + 1}", vector)
        reason = "neither fixed-point iteration nor Newton's method converged"
        for solver, start in ((_fixed_point, first), (_newton, zeros)):
            try:
                found = solver(update, start, _size(y), self.arithmetic)
            except IntegratorError as error:  # in a flow or an average at some iterate
                found, reason = None, str(error)
            if found is not None:
                return split(found)
        names = f"{', '.join(f'k{e + 1}' for e in members[:3])}{', …' * (len(members) > 3)} of {self.program.name}"
        raise IntegratorError(f"h must be small enough to solve for {names}, but was {float(self.h):g}: {reason}")


def _components(program: Program) -> list[tuple[list[int], bool]]:
    """The strongly connected components of the evaluations in the order of dependence, and whether each is implicit."""
    import networkx as nx

    graph = nx.DiGraph()
    graph.add_nodes_from(range(len(program.evaluations)))
    for e, evaluation in enumerate(program.evaluations):
        graph.add_edges_from((read, e) for form in operands(evaluation) for read in form.terms)
    condensed = nx.condensation(graph)
    found = [sorted(condensed.nodes[component]["members"]) for component in nx.topological_sort(condensed)]
    return [(members, len(members) > 1 or graph.has_edge(members[0], members[0])) for members in found]


def _size(*vectors: Vector) -> Number:
    """The largest absolute value of a component."""
    return max(abs(x) for vector in vectors for x in vector)


def _polynomial(coefficients: Sequence[Vector], θ: object) -> Vector:
    """Σ_j θ^j coefficients[j]."""
    total = coefficients[-1]
    for vector in coefficients[-2::-1]:
        total = total * θ + vector
    return total


def _flow_increment(right: Right, start: Vector, arithmetic: Arithmetic) -> Vector:
    """z(1) − z(0) for z′(θ) = right(θ, z) and z(0) = start, by the method of Gragg, Bulirsch and Stoer (HNW I, II.9).

    An interval without convergence is halved. Increments, unlike end values, have rounding errors that are small
    against z.
    """
    total, waiting = start * 0, [(0, 0)]
    while waiting:
        position, halvings = waiting.pop()
        width = arithmetic.context.ldexp(1, -halvings)
        found = _extrapolated(right, position * width, width, start + total, arithmetic)
        if found is not None:
            total = total + found
        elif halvings == MOST_HALVINGS:
            raise IntegratorError(f"flow must converge to {arithmetic.decimals} digits, but did not, or does not exist")
        else:
            waiting += [(2 * position + 1, halvings + 1), (2 * position, halvings + 1)]
    return total


def _extrapolated(right: Right, begin: Number, width: Number, z: Vector, arithmetic: Arithmetic) -> Vector | None:
    """The increment of z in an interval, from n = 2, 4, 6, … steps of the midpoint rule; None without convergence.

    The error of n steps has an expansion in 1/n², whose terms the Aitken–Neville tableau eliminates one by one. With
    more columns its factors would amplify rounding errors.
    """
    columns = 7 if arithmetic.digits is None else 6 + arithmetic.decimals // 5
    row: list[Vector] = []
    for k in range(1, columns + 1):
        step = width / (2 * k)
        before, now = z * 0, right(begin, z) * step  # Euler's method makes the first step
        for i in range(1, 2 * k):
            before, now = now, before + right(begin + i * step, z + now) * (2 * step)
        if not arithmetic.is_finite(now):
            return None
        new = [now]
        for j, old in enumerate(row, 1):
            new.append(new[-1] + (new[-1] - old) * (k - j) ** 2 / (k**2 - (k - j) ** 2))
        row = new
        if k > 1 and _size(row[-1] - row[-2]) <= 4 * arithmetic.context.eps * _size(z, row[-1]):
            return row[-1]
    return None


def _fixed_point(g: Callable[[Vector], Vector], x: Vector, scale: Number, arithmetic: Arithmetic) -> Vector | None:
    """The solution of x = g(x) by iteration until increments stagnate (HLW, VIII.6); None without convergence."""
    least, failures = math.inf, 0
    for _ in range(MOST_ITERATIONS):
        before, x = x, g(x)
        if not arithmetic.is_finite(x):
            return None
        increment = _size(x - before)
        failures = 0 if increment < least else failures + 1
        least = min(least, increment)
        if increment == 0 or failures == PATIENCE:
            return x if increment <= arithmetic.context.eps**0.75 * max(scale, _size(x)) else None
    return None


def _newton(g: Callable[[Vector], Vector], x: Vector, scale: Number, arithmetic: Arithmetic) -> Vector | None:
    """The solution of x = g(x) by Newton's method with difference Jacobians; None without convergence."""
    context, one = arithmetic.context, arithmetic.vector(np.eye(len(x)))

    def improved(x: Vector) -> Vector:
        value = g(x)
        width = context.eps**0.5 * (max(scale, _size(x)) or 1)
        columns = [unit - (g(x + unit * width) - value) / width for unit in one]
        try:
            matrix, right = np.transpose(columns).tolist(), (value - x).tolist()
            return x + arithmetic.vector(list(context.lu_solve(context.matrix(matrix), context.matrix(right))))
        except ZeroDivisionError:  # a singular matrix
            return value * math.nan

    return _fixed_point(improved, x, scale, arithmetic)
