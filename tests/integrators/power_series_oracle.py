"""Steps of methods as exact power series in h, on polynomial systems: no trees, and no program but in `run`.

A number is a polynomial in h, cut after h^ORDER, and in θ; a vector is a list of numbers; a field is a list of
polynomials in the components, {exponents: coefficient}.
"""

from __future__ import annotations

import random
from fractions import Fraction
from math import factorial, prod

from integrators.methods.programs.program import Average, Derivative, Field, Flow

ORDER = 5


class Number:
    """Σ terms[i, j] h^i θ^j."""

    def __init__(self, terms):
        self.terms = {key: x for key, x in terms.items() if x}

    def __add__(self, other):
        other = number(other)
        keys = self.terms.keys() | other.terms.keys()
        return Number({key: self.terms.get(key, 0) + other.terms.get(key, 0) for key in keys})

    def __mul__(self, other):
        found = {}
        for (i, j), x in self.terms.items():
            for (k, m), y in number(other).terms.items():
                if i + k <= ORDER:
                    found[i + k, j + m] = found.get((i + k, j + m), 0) + x * y
        return Number(found)

    __radd__ = __add__
    __rmul__ = __mul__

    def __eq__(self, other):
        return self.terms == number(other).terms

    def integrated(self):
        """∫₀^θ."""
        return Number({(i, j + 1): x / (j + 1) for (i, j), x in self.terms.items()})

    def at_one(self):
        """The value at θ = 1."""
        found = {}
        for (i, _), x in self.terms.items():
            found[i, 0] = found.get((i, 0), 0) + x
        return Number(found)


def number(x):
    return x if isinstance(x, Number) else Number({(0, 0): Fraction(x)})


H, THETA = Number({(1, 0): Fraction(1)}), Number({(0, 1): Fraction(1)})


def coefficients(vector):
    """For each component the coefficients of h⁰ … h^ORDER."""
    return [[number(x).terms.get((k, 0), Fraction(0)) for k in range(ORDER + 1)] for x in vector]


def plus(*vectors):
    return [sum(components, number(0)) for components in zip(*vectors, strict=True)]


def times(x, vector):
    return [number(x) * component for component in vector]


def combined(numbers, vectors):
    """Σ x_j v_j."""
    return plus(*map(times, numbers, vectors))


def value(field, y):
    """f(y)."""
    found = []
    for polynomial in field:
        terms = [
            x * prod((y[i] for i, power in enumerate(exponents) for _ in range(power)), start=number(1))
            for exponents, x in polynomial.items()
        ]
        found.append(sum(terms, number(0)))
    return found


def partial(polynomial, i):
    found = {}
    for exponents, x in polynomial.items():
        if exponents[i]:
            lower = (*exponents[:i], exponents[i] - 1, *exponents[i + 1 :])
            found[lower] = found.get(lower, 0) + x * exponents[i]
    return found


def jacobian_times(field, y, v):
    """f'(y) v."""
    rows = [value([partial(polynomial, i) for i in range(len(y))], y) for polynomial in field]
    return [sum((a * b for a, b in zip(row, v, strict=True)), number(0)) for row in rows]


def multiply(p, q):
    found = {}
    for a, x in p.items():
        for b, y in q.items():
            key = tuple(map(sum, zip(a, b, strict=True)))
            found[key] = found.get(key, 0) + x * y
    return found


def add(*polynomials):
    found = {}
    for p in polynomials:
        for key, x in p.items():
            found[key] = found.get(key, 0) + x
    return found


def flow(field, y, time):
    """The exact flow over time · h by its Lie series Σ_k (time · h)^k / k! (L^k id)(y)."""
    n = len(field)
    powers = [{tuple(int(i == j) for j in range(n)): Fraction(1)} for i in range(n)]
    total, factor = value(powers, y), number(1)
    for k in range(1, ORDER + 1):
        powers = [add(*(multiply(partial(p, i), field[i]) for i in range(n))) for p in powers]
        factor = factor * H * Fraction(time)
        total = plus(total, times(factor * Fraction(1, factorial(k)), value(powers, y)))
    return total


def solved(equation, start):
    """The solution of x = equation(x), where every round gains a power of h."""
    x = start
    for _ in range(ORDER + 1):
        x = equation(x)
    assert all(a == b for a, b in zip(_flat(x), _flat(equation(x)), strict=True))
    return x


def _flat(x):
    return [x] if isinstance(x, Number) else [number for part in x for number in _flat(part)]


def run(program, fields, y):
    """One step of a program; `fields` by name of part."""
    total = [add(*components) for components in zip(*(fields[name] for name in program.names), strict=True)]
    zero = [number(0)] * len(y)

    def form(linear, k):
        return plus(times(linear.start, y), *(times(x, k[e]) for e, x in linear.terms.items()))

    def evaluate(evaluation, k):
        part = total if evaluation.part is None else fields[program.names[evaluation.part]]
        match evaluation:
            case Field(_, at):
                return times(H, value(part, form(at, k)))
            case Derivative(_, at, along):
                return times(H, jacobian_times(part, form(at, k), form(along, k)))
            case Average(_, path, power):
                point = combined([_power(j) for j in range(len(path))], [form(linear, k) for linear in path])
                return [(_power(power) * H * x).integrated().at_one() for x in value(part, point)]
            case Flow(_, at, time, forcing):
                start = form(at, k)
                driven = plus(zero, *(times(_power(j), form(linear, k)) for j, linear in enumerate(forcing)))
                z = solved(
                    lambda z: plus(start, [x.integrated() for x in plus(times(H * time, value(part, z)), driven)]),
                    start,
                )
                return plus([x.at_one() for x in z], times(-1, start))

    k = [zero] * len(program.evaluations)
    while True:
        found = list(k)
        for e, evaluation in enumerate(program.evaluations):
            found[e] = evaluate(evaluation, found)
        if found == k:
            return form(program.result, k)
        k = found


def _power(j):
    return Number({(0, j): Fraction(1)})


def random_field(seed, *, dimension=2, degree=3, rows=None, inputs=None):
    """A polynomial field with small coefficients: non-zero in `rows`, made of the components `inputs`."""
    source = random.Random(seed)
    rows, inputs = rows or range(dimension), inputs or range(dimension)
    field = [{} for _ in range(dimension)]
    for row in rows:
        for _ in range(6):
            exponents = [0] * dimension
            for _ in range(source.randint(0, degree)):
                exponents[source.choice(inputs)] += 1
            field[row][tuple(exponents)] = Fraction(source.choice([-3, -2, -1, 1, 2, 3]), source.choice([1, 2, 3]))
    return field


def scaled_fields(fields, factor):
    """The fields times a number: a step of factor · h with f is a step of h with factor · f."""
    return {name: [{key: factor * x for key, x in p.items()} for p in field] for name, field in fields.items()}
