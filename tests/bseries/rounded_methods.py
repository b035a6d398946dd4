"""Random methods of known order with irrational coefficients, correctly rounded, and with one digit changed."""

import random
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

import mpmath

from integrators import PartitionedRungeKutta, RungeKutta, Splitting
from integrators.methods.kinds.second_order import RungeKuttaNystrom

DIGITS = 130
"""The working precision."""


class Case(NamedTuple):
    """A method as its numbers, the function that makes it of numbers and digits, and its order."""

    kind: str
    numbers: list[Any]
    make: Callable[..., Any]
    order: int


def cases(seed: int) -> Iterator[Case]:
    """Random methods of all kinds, in turns."""
    source = random.Random(seed)
    kinds = (explicit2, explicit3, explicit4, dirk2, dirk3, implicit2, partitioned, nystrom, strang, triple_jump)
    while True:
        for kind in kinds:
            with mpmath.workdps(DIGITS):
                yield Case(kind.__name__, *kind(source))


def number(source: random.Random, low: float, high: float) -> Any:
    """A random number of all digits, at a distance from zero."""
    while True:
        x = mpmath.mpf(source.getrandbits(400)) / 2**400 * (high - low) + low
        if abs(x) > 0.05:
            return x


def rounded(x: Any, digits: int) -> Fraction:
    """A number correctly rounded to significant digits."""
    with mpmath.workdps(DIGITS):
        return Fraction(mpmath.nstr(x, digits, strip_zeros=False)) if x else Fraction(0)


def unit(x: Any, digits: int) -> Fraction:
    """A unit of the last of the digits of a number."""
    return Fraction(10) ** (int(mpmath.floor(mpmath.log10(abs(x)))) + 1 - digits)


def tableau(stages: int) -> Callable[..., RungeKutta]:
    """The function that makes a tableau of its entries, A by rows and b."""

    def make(numbers: list[Any], digits: int | None) -> RungeKutta:
        rows = [numbers[i * stages : (i + 1) * stages] for i in range(stages + 1)]
        return RungeKutta(rows[:-1], rows[-1], digits=digits, warn=False)

    return make


def explicit2(source: random.Random) -> tuple[Any, ...]:
    c = number(source, 0.2, 1.5)
    b = 1 / (2 * c)
    return [0, 0, c, 0, 1 - b, b], tableau(2), 2


def weights(nodes: list[Any], count: int) -> Any:
    """Weights of the quadrature with these nodes."""
    matrix = mpmath.matrix([[x**k for x in nodes] for k in range(count)])
    return list(mpmath.lu_solve(matrix, mpmath.matrix([mpmath.mpf(1) / (k + 1) for k in range(count)])))


def distinct(source: random.Random, count: int) -> list[Any]:
    while True:
        found = [number(source, 0.1, 1.2) for _ in range(count)]
        if min(abs(x - y) for i, x in enumerate(found) for y in found[:i]) > 0.1 and abs(found[0] - 2 / 3) > 0.05:
            return found


def explicit3(source: random.Random) -> tuple[Any, ...]:
    c2, c3 = distinct(source, 2)
    b = weights([0, c2, c3], 3)
    a = 1 / (6 * b[2] * c2)
    return [0, 0, 0, c2, 0, 0, c3 - a, a, 0, *b], tableau(3), 3


def explicit4(source: random.Random) -> tuple[Any, ...]:
    """Kutta's methods with the nodes 0, c2, c3, 1, by Σ b_i a_ij = b_j (1 − c_j)."""
    while True:
        c2, c3 = distinct(source, 2)
        if min(abs(c2 - 1), abs(c3 - 1), abs(c2 - 0.5), abs(6 * c2 * c3 - 4 * (c2 + c3) + 3)) > 0.1:
            break
    c = [0, c2, c3, mpmath.mpf(1)]
    b = weights(c, 4)
    a43 = b[2] * (1 - c3) / b[3]
    a32 = 1 / (24 * b[3] * a43 * c2)
    a42 = (b[1] * (1 - c2) - b[2] * a32) / b[3]
    rows = [0, 0, 0, 0, c2, 0, 0, 0, c3 - a32, a32, 0, 0, 1 - a42 - a43, a42, a43, 0]
    return [*rows, *b], tableau(4), 4


def dirk2(source: random.Random) -> tuple[Any, ...]:
    """Two stages with equal diagonals: order 3 for γ = (3 ± √3)/6 (Crouzeix), else 2."""
    if source.random() < 0.5:
        g = (3 + source.choice((-1, 1)) * mpmath.sqrt(3)) / 6
        return [g, 0, 1 - 2 * g, g, mpmath.mpf(1) / 2, mpmath.mpf(1) / 2], tableau(2), 3
    g, c = distinct(source, 2)
    b = (mpmath.mpf(1) / 2 - g) / (c - g)
    return [g, 0, c - g, g, 1 - b, b], tableau(2), 2


def dirk3(source: random.Random) -> tuple[Any, ...]:
    """Nørsett's methods of order 4: γ³ − 3/2 γ² + γ/2 = 1/24."""
    g = (1 + 2 / mpmath.sqrt(3) * mpmath.cos(source.choice((1, 11, 13)) * mpmath.pi / 18)) / 2
    w = 1 / (6 * (2 * g - 1) ** 2)
    return [g, 0, 0, 0.5 - g, g, 0, 2 * g, 1 - 4 * g, g, w, 1 - 2 * w, w], tableau(3), 4


def implicit2(source: random.Random) -> tuple[Any, ...]:
    """Collocation at two nodes: order 2."""
    c = distinct(source, 2)
    b = weights(c, 2)
    rows = []
    for x in c:
        matrix = mpmath.matrix([[1, 1], c])
        rows += list(mpmath.lu_solve(matrix, mpmath.matrix([x, x**2 / 2])))
    return [*rows, *b], tableau(2), 2


def partitioned(source: random.Random) -> tuple[Any, ...]:
    """Two explicit parts with common weights and all four conditions of order 2."""
    c, d = number(source, 0.2, 1.5), 0
    b = 1 / (2 * c)
    x = number(source, 0.2, 0.9)
    d = (mpmath.mpf(1) / 2 - x * (1 - b)) / b
    numbers = [0, 0, c, 0, 1 - b, b, x, 0, d - b / 2, b / 2, 1 - b, b]

    def make(numbers: list[Any], digits: int | None) -> PartitionedRungeKutta:
        return PartitionedRungeKutta(
            {"p": tableau(2)(numbers[:6], digits), "q": tableau(2)(numbers[6:], digits)}, warn=False
        )

    return numbers, make, 2


def nystrom(source: random.Random) -> tuple[Any, ...]:
    """Two explicit stages of order 3: Σ b̄ = 1/2, Σ b = 1, Σ b c = 1/2, Σ b̄ c = 1/6, Σ b c² = 1/3, Σ b_i ā_ij = 1/6."""
    c1 = number(source, 0.05, 0.3)
    c2 = (mpmath.mpf(1) / 3 - c1 / 2) / (mpmath.mpf(1) / 2 - c1)
    b2 = (mpmath.mpf(1) / 2 - c1) / (c2 - c1)
    w2 = (mpmath.mpf(1) / 6 - c1 / 2) / (c2 - c1)
    numbers = [0, 0, 1 / (6 * b2), 0, mpmath.mpf(1) / 2 - w2, w2, 1 - b2, b2, c1, c2]

    def make(x: list[Any], digits: int | None) -> RungeKuttaNystrom:
        return RungeKuttaNystrom([x[:2], x[2:4]], x[4:6], x[6:8], x[8:], digits=digits)

    return numbers, make, 3


def splitting(numbers: list[Any], digits: int | None) -> Splitting:
    return Splitting([("pq"[k % 2], x) for k, x in enumerate(numbers)], digits=digits)


def strang(source: random.Random) -> tuple[Any, ...]:
    """A symmetric splitting of order 2."""
    a, b = number(source, -0.5, 0.8), number(source, 0.1, 0.9)
    inner = mpmath.mpf(1) / 2 - a
    return [a, b, inner, 1 - 2 * b, inner, b, a], splitting, 2


def triple_jump(source: random.Random) -> tuple[Any, ...]:
    """Symmetric compositions of three or five steps of order 4."""
    count = source.choice((1, 2))
    g = 1 / (2 * count - mpmath.cbrt(2 * count))
    steps = [g] * count + [1 - 2 * count * g] + [g] * count
    half = [x / 2 for x in steps]
    drifts = [half[0], *(x + y for x, y in pairwise(half)), half[-1]]
    return [x for pair in zip(drifts, [*steps, 0], strict=True) for x in pair][:-1], splitting, 4
