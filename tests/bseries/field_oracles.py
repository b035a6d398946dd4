"""Elementary differentials of random polynomial fields, from their definition, in the integers modulo a prime.

An identity between polynomials that holds at random points modulo a large prime holds; so these decide exactly, and
know nothing of tables, conditions or series. A polynomial is {exponents: coefficient}; a field is a list of them, and a
coloured field a list of fields, one for each colour.
"""

import random
from itertools import combinations

P = 2**31 - 1
DIMENSION = 4


class Jet:
    """A number modulo P with its gradient: what becomes of a point when it varies."""

    def __init__(self, value, gradient):
        self.value, self.gradient = value % P, [g % P for g in gradient]

    def __add__(self, other):
        return Jet(self.value + other.value, map(sum, zip(self.gradient, other.gradient, strict=True)))

    def __mul__(self, other):
        pairs = zip(self.gradient, other.gradient, strict=True)
        return Jet(self.value * other.value, [self.value * b + other.value * a for a, b in pairs])


def constant(value):
    return Jet(value, [0] * DIMENSION)


def point(source):
    """A random point whose coordinates know that they vary."""
    return [Jet(source.randrange(P), [int(i == j) for j in range(DIMENSION)]) for i in range(DIMENSION)]


def polynomial(source, degree, terms, variables=range(DIMENSION)):
    """Random monomials in some variables, of every degree up to the largest."""
    found = {}
    for k in range(terms):
        exponents = [0] * DIMENSION
        for _ in range(1 + k % degree):
            exponents[source.choice(list(variables))] += 1
        found[tuple(exponents)] = source.randrange(1, P)
    return found


def derivative(f, i):
    return {
        (*e[:i], e[i] - 1, *e[i + 1 :]): coefficient * e[i] % P for e, coefficient in f.items() if e[i]
    }  # fmt: skip


def scaled(f, factor):
    return {e: coefficient * factor % P for e, coefficient in f.items()}


def added(*polynomials):
    total = {}
    for f in polynomials:
        for e, coefficient in f.items():
            total[e] = (total.get(e, 0) + coefficient) % P
    return total


def multiplied(f, g):
    total = {}
    for e, x in f.items():
        for d, y in g.items():
            both = tuple(map(sum, zip(e, d, strict=True)))
            total[both] = (total.get(both, 0) + x * y) % P
    return total


def contracted(f, vectors, y):
    """f^(m)(v_1, …, v_m) at y for a polynomial f."""
    total = constant(0)
    if vectors:
        for i, component in enumerate(vectors[0]):
            slope = derivative(f, i)
            if slope:
                total += component * contracted(slope, vectors[1:], y)
        return total
    for exponents, coefficient in f.items():
        term = constant(coefficient)
        for x, e in zip(y, exponents, strict=True):
            for _ in range(e):
                term *= x
        total += term
    return total


def differential(tree, fields, y, known):
    """F(τ)(y) for a coloured field; `known` keeps those of subtrees."""
    if tree not in known:
        vectors = [differential(child, fields, y, known) for child in tree.children]
        known[tree] = [contracted(f, vectors, y) for f in fields[tree.color]]
    return known[tree]


def rotated(H):
    """The Hamiltonian field of H: p' = −H_q, q' = H_p, for y = (p₁, p₂, q₁, q₂)."""
    slopes = [derivative(H, i) for i in range(DIMENSION)]
    return [scaled(slopes[2], -1), scaled(slopes[3], -1), slopes[0], slopes[1]]


def divergence_free(source, degree, terms):
    """f_i = Σ_j ∂_j A_ij with a skew matrix A of random polynomials."""
    f = [{} for _ in range(DIMENSION)]
    for i, j in combinations(range(DIMENSION), 2):
        A = polynomial(source, degree, terms)
        f[i] = added(f[i], derivative(A, j))
        f[j] = added(f[j], scaled(derivative(A, i), -1))
    return f


def conserving(source, invariant, degree, terms):
    """f = S ∇I with a skew matrix S of random polynomials: I' f = 0."""
    f = [{} for _ in range(DIMENSION)]
    for i, j in combinations(range(DIMENSION), 2):
        S = polynomial(source, degree, terms)
        f[i] = added(f[i], multiplied(S, derivative(invariant, j)))
        f[j] = added(f[j], scaled(multiplied(S, derivative(invariant, i)), -1))
    return f


def split_in_blocks(f):
    """The two parts of a field by blocks of variables: that of p = (y₁, y₂) and that of q = (y₃, y₄)."""
    return [[f[0], f[1], {}, {}], [{}, {}, f[2], f[3]]]


def dot(gradient, vector):
    return sum((x * y for x, y in zip(gradient, vector, strict=True)), start=constant(0)).value


def rank(rows):
    """Rank of a matrix modulo P."""
    rows, found = [[x % P for x in row] for row in rows], 0
    for column in range(len(rows[0]) if rows else 0):
        pivot = next((k for k in range(found, len(rows)) if rows[k][column]), None)
        if pivot is None:
            continue
        rows[found], rows[pivot] = rows[pivot], rows[found]
        inverse = pow(rows[found][column], -1, P)
        rows[found] = [x * inverse % P for x in rows[found]]
        for k, row in enumerate(rows):
            if k != found and row[column]:
                factor = row[column]
                rows[k] = [(x - factor * y) % P for x, y in zip(row, rows[found], strict=True)]
        found += 1
    return found


def residue(number):
    """A rational number modulo P."""
    return number.numerator * pow(number.denominator, -1, P) % P


def seeded(*seed):
    return random.Random(repr(seed))
