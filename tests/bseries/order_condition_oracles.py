"""Truth for order conditions that knows no trees: methods expanded in powers of h on a scalar equation y' = f(y)."""

from fractions import Fraction
from math import factorial


def random_fractions(source, *shape):
    """Nested lists of small fractions."""
    if not shape:
        return Fraction(source.randint(-4, 4), source.choice([1, 2, 3, 5]))
    return [random_fractions(source, *shape[1:]) for _ in range(shape[0])]


def times(x, y):
    """Product of two power series in h, cut off where they are."""
    return [sum((x[i] * y[n - i] for i in range(n + 1)), start=Fraction(0)) for n in range(len(x))]


def field(derivatives, x):
    """f(x) for a power series x in h without constant term, f given by its derivatives at 0."""
    total = [Fraction(0)] * len(x)
    power = [Fraction(1)] + [Fraction(0)] * (len(x) - 1)
    for k, derivative in enumerate(derivatives):
        total = [a + derivative / factorial(k) * b for a, b in zip(total, power, strict=True)]
        power = times(power, x)
    return total


def rosenbrock_step(alpha, gamma, b, derivatives, order):
    """y(h) from y(0) = 0: k_i = h f(Σ α_ij k_j) + h f'(0) Σ γ_ij k_j. With γ = 0 a Runge–Kutta method."""
    stages = range(len(b))
    k = [[Fraction(0)] * (order + 1) for _ in stages]

    def combined(row):
        return [sum(a * k[j][n] for j, a in enumerate(row)) for n in range(order + 1)]

    for _ in range(order):
        inner = [field(derivatives, combined(alpha[i])) for i in stages]
        outer = [combined(gamma[i]) for i in stages]
        k = [[Fraction(0), *(u + derivatives[1] * v for u, v in zip(x, y, strict=True))][: order + 1]
             for x, y in zip(inner, outer, strict=True)]  # fmt: skip
    return combined(b)


def exact_step(derivatives, order):
    """The exact solution, by Picard iteration."""
    y = [Fraction(0)] * (order + 1)
    for _ in range(order):
        y = [Fraction(0), *(c / n for n, c in enumerate(field(derivatives, y), 1))][: order + 1]
    return y


def scalar_differential(tree, derivatives):
    """F(τ) at 0 of a scalar equation."""
    value = derivatives[len(tree.children)]
    for child in tree.children:
        value *= scalar_differential(child, derivatives)
    return value
