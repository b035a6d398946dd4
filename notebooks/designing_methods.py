# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Designing methods with order conditions
#
# A Runge–Kutta method has order p exactly if its coefficients satisfy one polynomial equation for each rooted tree with
# up to p nodes. Here such equations are generated, solved from random starts, and the solutions are recognised as exact
# numbers. The recognition is a guess, by continued fractions; the proof is a computation in fractions afterwards.

# %%
from fractions import Fraction
from functools import cache

import numpy as np
from scipy.optimize import least_squares

import bseries as bs

conditions = bs.order_conditions("runge-kutta", 4, stages=4, explicit=True)
print(conditions)

# %% [markdown]
# The same conditions come as SymPy equations, as source code for NumPy, C and Julia, and as compiled functions for the
# residual and its Jacobian. The vector of unknowns holds the entries of A below the diagonal, then b.

# %%
f = conditions.compile()
print(conditions.sympy()[3])
print(len(conditions), "equations for", len(f.unknowns), "unknowns:", *f.unknowns)

# %% [markdown]
# ## An explicit method with four stages and order 4
#
# From a random start, least squares finds a solution, if it does not stick in a local minimum. There is a family of
# them with two parameters, so every start leads to other numbers, and none is rational.


# %%
def solve(residual, jacobian, start):
    """A zero of the residual close to a start, or None."""
    found = least_squares(residual, start, jacobian, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=300)
    return found.x if abs(found.fun).max() < 1e-12 and abs(found.x).max() < 20 else None


random = np.random.default_rng(4)
solution = None
while solution is None:
    start = random.uniform(-1, 1, len(f.unknowns))
    solution = solve(lambda x: f.residual(*f.unpack(x)), lambda x: f.jacobian(*f.unpack(x)), start)
A, b = f.unpack(solution)
print(A.round(6), b.round(6), sep="\n")

# %% [markdown]
# Two parameters of the family are the nodes c₂ and c₃. We move them to fractions with small denominators close by, by
# two more equations, and solve again from there. Where the nodes are rational the other coefficients are solutions of
# linear equations, hence rational, too; the continued fraction of each finds it. If the nodes are a bad choice (equal,
# or one of them 0) there is no solution, and the next start has its turn.


# %%
def rational(x, largest=1000):
    """The fraction with a small denominator that x is, to 11 digits, or None."""
    guess = Fraction(float(x)).limit_denominator(largest)
    return guess if abs(x - guess) < 1e-11 else None


def with_rational_nodes(solution):
    """A method with rational coefficients close to a solution, or None."""
    A, _ = f.unpack(solution)
    nodes = [float(Fraction(c).limit_denominator(4)) for c in A.sum(axis=1)[1:3]]
    rows = np.zeros((2, len(solution)))
    for k, (argument, at) in enumerate(f.unknowns):
        if argument == "A" and at[0] in (1, 2):
            rows[at[0] - 1, k] = 1

    def residual(x):
        return np.concatenate([f.residual(*f.unpack(x)), rows @ x - nodes])

    def jacobian(x):
        return np.concatenate([f.jacobian(*f.unpack(x)), rows])

    projected = solve(residual, jacobian, solution)
    guess = [None] if projected is None else [rational(x) for x in projected]
    if None in guess:
        return None
    entries = dict(zip(f.unknowns, guess, strict=True))
    A = [[entries.get(("A", (i, j)), 0) for j in range(4)] for i in range(4)]
    return bs.RungeKutta(A, [entries["b", (i,)] for i in range(4)], name="designed")


designed = []
while len(designed) < 3:
    start = random.uniform(-1, 1, len(f.unknowns))
    solution = solve(lambda x: f.residual(*f.unpack(x)), lambda x: f.jacobian(*f.unpack(x)), start)
    method = None if solution is None else with_rational_nodes(solution)
    if method is not None and method not in designed:
        assert bs.order_of(method) == 4
        designed.append(method)
        print(method, "\n")

# %% [markdown]
# `order_of` has computed with fractions, so that these are proofs. A method with one coefficient changed a little has
# no order at all, however close it is:

# %%
A, b = (np.array(x, dtype=object) for x in (designed[0].A, designed[0].b))
b[0] += Fraction(1, 10**9)
bs.order_of(bs.RungeKutta(A.tolist(), b.tolist(), warn=False))

# %% [markdown]
# ## A symplectic diagonally implicit method of order 3
#
# A diagonally implicit method is symplectic if a_ij = b_j for j < i and a_ii = b_i/2; it is then a sequence of midpoint
# steps with the step sizes b_i h (HLW, theorem VI.4.4). Only b is unknown. All entries are linear functions of it, so
# the chain rule is a product of the Jacobian with a constant matrix.


# %%
@cache
def symplectic(stages):
    """The matrix T with (entries of A, then of b) = T b, and the conditions for order 3."""
    f = bs.order_conditions("runge-kutta", 3, stages=stages, structure="diagonally-implicit").compile()
    T = np.zeros((len(f.unknowns), stages))
    for k, (argument, at) in enumerate(f.unknowns):
        T[k, at[-1]] = 0.5 if argument == "A" and at[0] == at[1] else 1
    return f, T


def search(stages, start):
    """Weights of a symplectic method of order 3 close to a start, or None."""
    f, T = symplectic(stages)
    return solve(lambda b: f.residual(*f.unpack(T @ b)), lambda b: f.jacobian(*f.unpack(T @ b)) @ T, start)


def dirk(b):
    """The symplectic method with these weights, exactly."""
    A = [[b[j] if j < i else b[j] / 2 if j == i else 0 * b[j] for j in range(len(b))] for i in range(len(b))]
    return bs.RungeKutta(A, list(b), name="symplectic")


solutions = [b for b in (search(3, random.uniform(-2, 2, 3)) for _ in range(12)) if b is not None]
for b in solutions:
    print(b.round(8), " sum of cubes", f"{sum(b**3):.1e}")
assert all(abs(sum(b**3)) < 1e-11 * max(abs(b)) ** 3 for b in solutions)

# %% [markdown]
# The four conditions come down to two, Σ b_i = 1 and Σ b_i³ = 0. With three stages no solution is rational: it would
# give x³ + y³ = z³ in whole numbers without zero, against Euler's case of Fermat's last theorem (and if one is zero,
# the other two cancel, and their sum is 0). So nothing rational is to be recognised here. But among the solutions is
# one with b₁ = b₃, where 2b₁³ + (1 − 2b₁)³ = 0: b₁ = 1/(2 − ∛2). It is symmetric, so its order is even: 4.

# %%
import sympy

root = sympy.cbrt(2)
b1 = (4 + 2 * root + root**2) / 6  # 1/(2 − ∛2) with a rational denominator
triple_jump = dirk([b1, sympy.expand(1 - 2 * b1), b1])
print(bs.order_of(triple_jump, 4), triple_jump.is_symplectic, triple_jump.is_symmetric)

# %% [markdown]
# Four stages leave room. Now the solutions form a surface; two weights are moved to fractions with small denominators,
# and we see whether the other two come out rational. Mostly they do not, and then nothing is claimed.


# %%
def with_rational_weights(b):
    """A method with rational weights close to a solution, or None."""
    fixed = [Fraction(x).limit_denominator(6) for x in b[:2]]
    f, T = symplectic(4)

    def complete(x):
        return T @ np.array([*map(float, fixed), *x])

    rest = solve(
        lambda x: f.residual(*f.unpack(complete(x))), lambda x: (f.jacobian(*f.unpack(complete(x))) @ T)[:, 2:], b[2:]
    )
    guess = [None] if rest is None else [*fixed, *map(rational, rest)]
    return None if None in guess or 0 in guess else dirk(guess)


found = set()
for start in random.uniform(-1.5, 1.5, (120, 4)):
    solution = search(4, start)
    method = None if solution is None else with_rational_weights(solution)
    if method is not None and bs.order_of(method) == 3:
        found.add(tuple(sorted(method.b)))
        assert method.is_symplectic
assert found
for weights in sorted(found):
    print(*weights, sep=", ")

# %% [markdown]
# One of the rational solutions is well known as a sum of cubes, 3³ + 4³ + 5³ = 6³: since 3 + 4 + 5 − 6 = 6, its sixths
# are weights of a symplectic method of order 3.

# %%
method = dirk([Fraction(3, 6), Fraction(4, 6), Fraction(5, 6), Fraction(-6, 6)])
assert bs.order_of(method) == 3
assert method.is_symplectic
print(method)
