"""Every kind of method as its source defines a step, beside the kind itself: cases for `power_series_oracle`."""

from __future__ import annotations

import random
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import power_series_oracle as oracle
from power_series_oracle import H, combined, flow, jacobian_times, number, plus, random_field, solved, times, value

from integrators import (
    ContinuousStageRungeKutta,
    GeneralizedAdditiveRungeKutta,
    LawsonMethod,
    PartitionedRungeKutta,
    Rosenbrock,
    RungeKutta,
    RungeKuttaNystrom,
    Splitting,
    TakahashiImada,
    TwoDerivativeRungeKutta,
    WMethod,
    method,
)


class Case(NamedTuple):
    """A method, a system for it, its step by the source's formulas, and the step by a slightly wrong rule."""

    method: Any
    fields: dict[str, list[dict]]
    step: Callable
    wrong: Callable


POINT = [Fraction(1, 2), Fraction(-2, 3), Fraction(1, 3), Fraction(-1, 2)]
SOURCE = random.Random(2024)


def row(count):
    return [Fraction(SOURCE.randint(-3, 3), SOURCE.choice([1, 2, 3, 4])) for _ in range(count)]


def matrix(rows, columns=None):
    return [row(columns or rows) for _ in range(rows)]


def lower(count, *, diagonal):
    return [[x if j < i + diagonal else Fraction(0) for j, x in enumerate(r)] for i, r in enumerate(matrix(count))]


def runge_kutta(A, b, f, y):
    """y1 = y + h Σ b_i f(Y_i), Y_i = y + h Σ_j a_ij f(Y_j)."""

    def stages(Y):
        slopes = [value(f, x) for x in Y]
        return [plus(y, times(H, combined(a, slopes))) for a in A]

    Y = solved(stages, [y] * len(b))
    return plus(y, times(H, combined(b, [value(f, x) for x in Y])))


def runge_kutta_case(A, b):
    return Case(
        RungeKutta(A, b, warn=False),
        {"": random_field(1)},
        lambda fields, y: runge_kutta(A, b, fields[""], y),
        lambda fields, y: runge_kutta([list(column) for column in zip(*A, strict=True)], b, fields[""], y),
    )


def additive_case():
    """Y_i = y + h Σ_ν Σ_j a^ν_ij f^ν(Y_j), with three parts."""
    A, b = {name: matrix(2) for name in "abc"}, {name: row(2) for name in "abc"}

    def step(fields, y, A=A):
        def increment(name, weights, Y):
            return times(H, combined(weights, [value(fields[name], x) for x in Y]))

        Y = solved(lambda Y: [plus(y, *(increment(n, A[n][i], Y) for n in A)) for i in range(2)], [y, y])
        return plus(y, *(increment(n, b[n], Y) for n in A))

    tableaux = {name: {"A": A[name], "b": b[name]} for name in "abc"}
    swapped = {"a": A["b"], "b": A["a"], "c": A["c"]}
    fields = {name: random_field(seed) for seed, name in enumerate("abc")}
    built = PartitionedRungeKutta(tableaux, warn=False)
    return Case(built, fields, step, lambda fields, y: step(fields, y, swapped))


def gark_case():
    """Y^ν_i = y + h Σ_μ Σ_j a^νμ_ij f^μ(Y^μ_j); sizes 1, 2 and 2."""
    sizes = {"a": 1, "b": 2, "c": 2}
    A = {n: {m: matrix(sizes[n], sizes[m]) for m in sizes} for n in sizes}
    b = {n: row(sizes[n]) for n in sizes}

    def step(fields, y, A=A):
        def slopes(Y):
            return {n: [value(fields[n], x) for x in Y[n]] for n in sizes}

        def equation(flat):
            Y = {n: flat[sum(list(sizes.values())[:i]) :][: sizes[n]] for i, n in enumerate(sizes)}
            f = slopes(Y)
            return [
                plus(y, *(times(H, combined(A[n][m][i], f[m])) for m in sizes)) for n in sizes for i in range(sizes[n])
            ]

        flat = solved(equation, [y] * 5)
        f = slopes({"a": flat[:1], "b": flat[1:3], "c": flat[3:]})
        return plus(y, *(times(H, combined(b[n], f[n])) for n in sizes))

    swapped = {**A, "b": {**A["b"], "b": A["c"]["c"], "c": A["b"]["b"]}}
    fields = {name: random_field(seed) for seed, name in enumerate("abc")}
    built = GeneralizedAdditiveRungeKutta(A, b)
    return Case(built, fields, step, lambda fields, y: step(fields, y, swapped))


def second_order_fields(*, velocity=False):
    """p' = g(q) or g(p, q), q' = p with two degrees of freedom: components 0, 1 are p."""
    momentum = random_field(5, dimension=4, rows=(0, 1), inputs=range(4) if velocity else (2, 3))
    drift = [{}, {}, {(1, 0, 0, 0): Fraction(1)}, {(0, 1, 0, 0): Fraction(1)}]
    return {"p": momentum, "q": drift}


def nystrom_case(*, velocity):
    """k_i = g(q + c_i h p + h² Σ ā_ij k_j, p + h Σ a_ij k_j); HNW II, (14.4)."""
    A_bar, b_bar, b, c = matrix(3), row(3), row(3), row(3)
    A = matrix(3) if velocity else None

    def step(fields, y, b_bar=b_bar):
        p, q = y[:2], y[2:]
        momenta = A or [[0] * 3] * 3

        def g(i, k):
            moved = plus(p, times(H, combined(momenta[i], k)))
            place = plus(q, times(H * c[i], p), times(H * H, combined(A_bar[i], k)))
            return value(fields["p"], [*moved, *place])[:2]

        k = solved(lambda k: [g(i, k) for i in range(3)], [[number(0)] * 2] * 3)
        end = plus(q, times(H, p), times(H * H, combined(b_bar, k)))
        return [*plus(p, times(H, combined(b, k))), *end]

    built = RungeKuttaNystrom(A_bar, b_bar, b, c, A=A)
    return Case(built, second_order_fields(velocity=velocity), step, lambda fields, y: step(fields, y, b))


def two_derivative_case():
    """Y_i = y + h Σ a_ij f(Y_j) + h² Σ â_ij g(Y_j) with g = f' f."""
    A, A_hat, b, b_hat = matrix(2), matrix(2), row(2), row(2)

    def step(fields, y, A_hat=A_hat):
        f = fields[""]

        def moved(first, second, Y):
            slopes = [value(f, x) for x in Y]
            bends = [jacobian_times(f, x, slope) for x, slope in zip(Y, slopes, strict=True)]
            return plus(y, times(H, combined(first, slopes)), times(H * H, combined(second, bends)))

        Y = solved(lambda Y: [moved(A[i], A_hat[i], Y) for i in range(2)], [y, y])
        return moved(b, b_hat, Y)

    built = TwoDerivativeRungeKutta(A, A_hat, b, b_hat)
    return Case(built, {"": random_field(6)}, step, lambda fields, y: step(fields, y, [[0, 0], [0, 0]]))


def rosenbrock_step(alpha, gamma, b, f, jacobian, y):
    """k_i = h f(y + Σ α_ij k_j) + h J Σ_(j≤i) γ_ij k_j; Hairer–Wanner, (IV.7.4)."""
    k = []
    for i in range(len(b)):
        explicit = times(H, value(f, plus(y, *map(times, alpha[i][:i], k))))
        known = combined(gamma[i][:i], k) if i else [number(0)] * len(y)
        k.append(
            solved(
                lambda x, explicit=explicit, known=known, i=i: plus(
                    explicit, times(H, jacobian(plus(known, times(gamma[i][i], x))))
                ),
                explicit,
            )
        )
    return plus(y, combined(b, k))


def rosenbrock_case():
    alpha, gamma, b = lower(3, diagonal=0), lower(3, diagonal=1), row(3)

    def step(fields, y, gamma=gamma):
        return rosenbrock_step(alpha, gamma, b, fields[""], lambda v: jacobian_times(fields[""], y, v), y)

    total = [[x + z for x, z in zip(r, s, strict=True)] for r, s in zip(alpha, gamma, strict=True)]
    fields = {"": random_field(7)}
    return Case(Rosenbrock(alpha, gamma, b), fields, step, lambda fields, y: step(fields, y, total))


def w_method_case():
    alpha, gamma, b, W = lower(2, diagonal=0), lower(2, diagonal=1), row(2), matrix(2)

    def step(fields, y):
        def product(v):
            return [sum((number(x) * component for x, component in zip(r, v, strict=True)), number(0)) for r in W]

        return rosenbrock_step(alpha, gamma, b, fields["f"], product, y)

    def exact_jacobian(fields, y):
        return rosenbrock_step(alpha, gamma, b, fields["f"], lambda v: jacobian_times(fields["f"], y, v), y)

    linear = [{(1, 0): r[0], (0, 1): r[1]} for r in W]
    return Case(WMethod(alpha, gamma, b), {"f": random_field(8), "W": linear}, step, exact_jacobian)


def quadrature(count):
    """Nodes in [0, 1] and weights, exact for polynomials of degree below `count`."""
    nodes = [Fraction(i, count - 1) for i in range(count)]
    weights = []
    for node in nodes:
        basis = [Fraction(1)]
        for other in nodes:
            if other != node:
                shifted = [*(x * -other for x in basis), Fraction(0)]
                basis = [(a + b) / (node - other) for a, b in zip(shifted, [0, *basis], strict=True)]
        weights.append(sum(x / (i + 1) for i, x in enumerate(basis)))
    return nodes, weights


def continuous_stage_case():
    """Y_τ = y + h ∫ A_τσ f(Y_σ) dσ as a Runge–Kutta method with exact quadrature: the integrands are polynomials."""
    M, B = matrix(3, 2), row(2)
    nodes, weights = quadrature(2 * 3 + 1 + 1)  # paths of degree 2, a field of degree 3, and σ

    def step(fields, y, B=B):
        A = [
            [
                w * sum(M[i][j] * t**i * s**j for i in range(3) for j in range(2))
                for s, w in zip(nodes, weights, strict=True)
            ]
            for t in nodes
        ]
        b = [w * sum(B[j] * s**j for j in range(2)) for s, w in zip(nodes, weights, strict=True)]
        return runge_kutta(A, b, fields[""], y)

    fields = {"": random_field(9)}
    return Case(ContinuousStageRungeKutta(M, B), fields, step, lambda fields, y: step(fields, y, B[::-1]))


def average_case():
    """y1 = y0 + h ∫ f((1−θ) y0 + θ y1) dθ, by Simpson's rule, which is exact for cubic fields."""

    def step(fields, y, weights=(1, 4, 1)):
        def equation(end):
            middle = times(Fraction(1, 2), plus(y, end))
            slopes = [value(fields[""], x) for x in (y, middle, end)]
            return plus(y, times(H * Fraction(1, sum(weights)), combined(weights, slopes)))

        return solved(equation, y)

    return Case(method("avf"), {"": random_field(10)}, step, lambda fields, y: step(fields, y, (1, 2, 1)))


def kahan_case():
    """(y1 − y0)/h = Q(y0, y1) + L (y0 + y1)/2 + c for f(y) = Q(y, y) + L y + c: what Kahan wrote down."""

    def polarised(polynomial, x, y):
        total = number(0)
        for exponents, factor in polynomial.items():
            letters = [i for i, power in enumerate(exponents) for _ in range(power)]
            if len(letters) == 2:
                i, j = letters
                total = total + (x[i] * y[j] + x[j] * y[i]) * (factor / 2)
            else:
                total = (
                    total + sum(((x[i] + y[i]) * Fraction(1, 2) for i in letters), number(int(not letters))) * factor
                )
        return total

    def step(fields, y):
        return solved(lambda end: plus(y, times(H, [polarised(p, y, end) for p in fields[""]])), y)

    def trapezoidal(fields, y):
        half = Fraction(1, 2)
        return runge_kutta([[0, 0], [half, half]], [half, half], fields[""], y)

    return Case(method("kahan"), {"": random_field(11, degree=2)}, step, trapezoidal)


def exponential(L, time, v):
    """exp(time · h L) v by its series."""
    total, term = v, v
    for k in range(1, oracle.ORDER + 1):
        term = times(H * Fraction(time) * Fraction(1, k), jacobian_times(L, [number(0)] * len(v), term))
        total = plus(total, term)
    return total


def lawson_case():
    """Y_i = exp(c_i hL) y + h Σ a_ij exp((c_i − c_j) hL) N(Y_j)."""
    tableau = RungeKutta(lower(3, diagonal=0), row(3), warn=False)

    def step(fields, y, exponent=lambda to, of: to - of):
        L, slopes = fields["L"], []
        A, b, c = tableau.A, tableau.b, tableau.c
        for to, weights in [*zip(c, A, strict=True), (Fraction(1), b)]:
            Y = exponential(L, to, y)
            for x, of, slope in zip(weights, c, slopes, strict=False):
                Y = plus(Y, times(H * x, exponential(L, exponent(to, of), slope)))
            slopes.append(value(fields["N"], Y))
        return Y

    linear = [{(1, 0): a, (0, 1): b} for a, b in matrix(2)]
    fields = {"L": linear, "N": random_field(12)}
    return Case(LawsonMethod(tableau), fields, step, lambda fields, y: step(fields, y, lambda to, of: to))


def splitting_case():
    flows = [(part, x) for part, x in zip("abcab", row(5), strict=True)]

    def step(fields, y, flows=flows):
        for part, x in flows:
            y = flow(fields[part], y, x)
        return y

    fields = {name: random_field(seed, degree=2) for seed, name in enumerate("abc")}
    return Case(Splitting(flows), fields, step, lambda fields, y: step(fields, y, flows[::-1]))


def takahashi_imada_case(*, simplified):
    """The step with the force f + α h² f' f, or f(q + α h² f(q)); α in general position."""
    alpha = Fraction(2, 7)

    def step(fields, y, simplified=simplified):
        force = [{key[2:]: x for key, x in p.items()} for p in fields["p"][:2]]

        def better(q):
            f = value(force, q)
            if simplified:
                return value(force, plus(q, times(H * H * alpha, f)))
            return plus(f, times(H * H * alpha, jacobian_times(force, q, f)))

        p, q = y[:2], y[2:]
        p = plus(p, times(H * Fraction(1, 2), better(q)))
        q = plus(q, times(H, p))
        p = plus(p, times(H * Fraction(1, 2), better(q)))
        return [*p, *q]

    built = TakahashiImada(alpha, simplified=simplified)
    return Case(built, second_order_fields(), step, lambda fields, y: step(fields, y, not simplified))


def hairer_matrix(nodes):
    """A_τσ = Σ_i ∫₀^τ ℓ_i(x) dx ℓ_i(σ) / b_i for given nodes; Hairer (2010)."""
    count = len(nodes)
    basis = []
    for node in nodes:
        p = [1]
        for other in nodes:
            if other != node:
                p = [(a - other * b) / (node - other) for a, b in zip([0, *p], [*p, 0], strict=True)]
        basis.append(p)
    b = [sum(x / Fraction(j + 1) for j, x in enumerate(p)) for p in basis]
    M = [[0] * count for _ in range(count + 1)]
    for p, weight in zip(basis, b, strict=True):
        for i, x in enumerate(p, 1):
            M[i] = [a + x * y / (i * weight) for a, y in zip(M[i], p, strict=True)]
    return M


CASES = {
    "runge-kutta": runge_kutta_case(matrix(3), row(3)),
    "additive": additive_case(),
    "gark": gark_case(),
    "nystrom": nystrom_case(velocity=False),
    "nystrom with velocities": nystrom_case(velocity=True),
    "two-derivative": two_derivative_case(),
    "rosenbrock": rosenbrock_case(),
    "w-method": w_method_case(),
    "continuous stage": continuous_stage_case(),
    "averaged vector field": average_case(),
    "kahan": kahan_case(),
    "lawson": lawson_case(),
    "splitting": splitting_case(),
    "takahashi-imada": takahashi_imada_case(simplified=False),
    "simplified takahashi-imada": takahashi_imada_case(simplified=True),
}


def start(case):
    """The start of the step, as numbers."""
    dimension = len(next(iter(case.fields.values())))
    return [number(x) for x in POINT[:dimension]]
