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
# # From a tableau to its modified equation
#
# A method with step h, applied to y' = f(y), follows the flow of another differential equation, y' = f(y) + h f₂(y) +
# h² f₃(y) + …, its *modified equation* (E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, chapter
# IX): exactly as a formal series, which in general diverges, and up to O(h^(N+1)) in each step if it is truncated after
# N terms. Its terms are elementary differentials of f, one for each rooted tree. This is the first of seven notebooks
# on a lecture by E. Hairer about backward error analysis: here are its examples 1 and 3, exercise 1, theorem 1 and
# figure 1.

# %%
# %matplotlib inline
from fractions import Fraction
from itertools import accumulate
from math import factorial, pi
from typing import Any

import mpmath
import numpy as np
import sympy
from IPython.display import Math, display
from matplotlib import pyplot

import bseries as bs

BLUE, ORANGE, GREEN, BLACK = "#0072B2", "#D55E00", "#009E73", "#000000"  # told apart by all (Okabe, Ito)
method = bs.RungeKutta([[0, 0], ["1/2", 0]], [0, 1], name="my midpoint rule")
bs.modified_equation(method, 4)

# %% [markdown]
# The row of the tree τ says: the modified equation has the term h^(|τ|−1) · weight · F(τ). There is none with h¹: the
# method has order 2. As a formula, without what vanishes:

# %%
Math(bs.modified_equation(method, 4).to_latex())

# %% [markdown]
# **Theorem 1.** The first term that does not vanish is the leading term of the local error: for a method of order r it
# has h^r, and its coefficients are those of the method less those of the exact flow, $a(\tau) - 1/\gamma(\tau)$.

# %%
METHODS: dict[str, Any] = {
    name: bs.method(name)
    for name in (
        "explicit-euler", "implicit-euler", "implicit-midpoint", "trapezoidal", "explicit-midpoint", "heun2", "rk4",
    )
}  # fmt: skip
for name, known in METHODS.items():
    r = bs.order_of(known)
    b, error = bs.modified_equation(known, r + 1), bs.series(known, r + 1) - bs.exact_flow(r + 1)
    assert all(b[tree] == (tree.order == 1) for tree in b if tree.order <= r)
    assert all(b[tree] == error[tree] for tree in b if tree.order == r + 1)
    print(f"{name:18} order {r}, error constants", *(error[tree] for tree in b if tree.order == r + 1))

# %% [markdown]
# ## Example 1: y' = y²
#
# Here f' = 2y, f'' = 2, and all higher derivatives vanish: F(τ) is a number times y^(|τ|+1), and it is zero as soon as
# a node has three children. On a scene, `modified_field` takes only the trees that are needed, and sums up what they
# give.

# %%
GIVEN = {
    "explicit-euler": "1, -1, 3/2, -8/3, 31/6, -157/15",  # (5)
    "implicit-euler": "1, 1, 3/2, 8/3, 31/6, 157/15",
    "implicit-midpoint": "1, 0, 1/4, 0, 1/8, 0, 11/192, 0, 3/128",  # (6)
    "trapezoidal": "1, 0, 1/2, 0, 1/2, 0",
    "explicit-midpoint": "1, 0, -3/4, 5/4, -7/8, -9/8",
    "heun2": "1, 0, -1/2, 1/2, 1/4, -3/2",
    "rk4": "1, 0, 0, 0, -1/24, 0, 65/576, -17/96, 19/144",  # (7)
}
riccati, y = bs.scene("riccati"), sympy.Symbol("y")


def square_equation(name, order):
    """The coefficients of y², h y³, h² y⁴, … in the modified equation of y' = y²."""
    f = bs.modified_field(METHODS[name], riccati, order)
    return [Fraction(str(f.symbolic(k)[0] / y ** (k + 2))) for k in range(order)]


for name, text in GIVEN.items():
    given = [Fraction(c) for c in text.split(",")]
    assert square_equation(name, len(given)) == given

# %% [markdown]
# The equations (5), (6) and (7) of the lecture, for explicit Euler, the implicit midpoint rule and RK4:

# %%
h = sympy.Symbol("h")
for number, name, order in ((5, "explicit-euler", 6), (6, "implicit-midpoint", 9), (7, "rk4", 9)):
    f = bs.modified_field(METHODS[name], riccati, order)
    formula = sympy.latex(sum(h**k * f.symbolic(k)[0] for k in range(order)), order="rev-lex")
    display(Math(rf"({number})\quad y' = {formula} + \dots"))

# %% [markdown]
# ## Exercise 1: without trees
#
# The lecture has a program of a dozen lines for (5): put the Taylor series of the modified equation into the formula
# of the method, and what is left at hⁿ is −fₙ. It knows nothing of trees, so that it can check them. Written for an
# equation residual(y, y₁, h) = 0, it does for implicit methods as well.


# %%
def by_recursion(residual, order):
    """The coefficients of y², h y³, h² y⁴, … for a method given by residual(y, y1, h) = 0."""
    _, h, y = sympy.ring("h, y", sympy.QQ)
    found = [sympy.QQ(1)]
    for n in range(2, order + 1):
        field = sum(c * h**k * y ** (k + 2) for k, c in enumerate(found))
        y1, derivative = y, y
        for k in range(1, n + 1):
            derivative = derivative.diff(y) * field
            y1 += derivative * h**k / factorial(k)
        found.append(-residual(y, y1, h).coeff(h**n * y ** (n + 1)))
    return [Fraction(str(c)) for c in found]


FORMULAS = {
    "explicit-euler": lambda y, y1, h: y1 - y - h * y**2,
    "implicit-euler": lambda y, y1, h: y1 - y - h * y1**2,
    "implicit-midpoint": lambda y, y1, h: y1 - y - h * (y + y1) ** 2 / 4,
    "trapezoidal": lambda y, y1, h: y1 - y - h * (y**2 + y1**2) / 2,
}
for name, residual in FORMULAS.items():
    assert by_recursion(residual, 6) == square_equation(name, 6)
    print(f"{name:18}", *by_recursion(residual, 6))

# %% [markdown]
# Two laws can be read off. The implicit Euler method is the explicit one with −h, and so is its modified equation. The
# midpoint rule and the trapezoidal rule are *symmetric*, they do not change when −h takes the place of h and y₁ that of
# y₀: their expansions are in even powers of h. That holds for every y' = f(y): coefficients of trees with an even
# number of nodes are 0.

# %%
explicit, implicit = (square_equation(f"{kind}-euler", 9) for kind in ("explicit", "implicit"))
assert implicit == [(-1) ** k * c for k, c in enumerate(explicit)]
for name in ("rk4", "heun2", "trapezoidal", "gauss2", "lobatto-iiia3"):
    known: Any = bs.method(name)
    powers = sorted({tree.order - 1 for tree, _ in bs.modified_equation(known, 8).nonzero()})
    print(f"{name:14} order {bs.order_of(known)}, powers of h: {powers}")
    assert powers[1] == bs.order_of(known)
    assert all(power % 2 == 0 for power in powers) == known.is_symmetric

# %% [markdown]
# ## Figure 1
#
# The exact solution from y(0) = 1 is 1/(1−t), with a pole at t = 1. Explicit Euler steps with h = 0.02 (dots) know
# nothing of it; the modified equation, cut off after 1, 2, 3 and 4 terms, follows the dots better and better.

# %%
bs.figure("riccati")


# %%
def truncated(terms, h):
    """The modified equation of explicit Euler on y' = y², as a scene."""
    f = bs.modified_field(METHODS["explicit-euler"], riccati, terms)
    return bs.Scene({"y": 1}, field={"y": sum(sympy.Rational(h) ** k * f.symbolic(k)[0] for k in range(terms))})


# %% [markdown]
# At t = 1, where the exact solution has its pole:

# %%
TRUNCATED = {2: 15.95466885, 3: 19.11913372, 4: 17.74042893}
step = bs.integrate("explicit-euler", riccati, h=0.02, steps=50).y[0, -1]
print(f"step 50      {step:.5f}")
np.testing.assert_allclose(step, 18.1285001919, rtol=1e-11)
for terms, given in TRUNCATED.items():
    found = bs.reference_solution(truncated(terms, "1/50"), 1, y0=[1])[0, 0]
    np.testing.assert_allclose(found, given, rtol=1e-9)
    print(f"{terms} terms      {found:.5f}")

# %% [markdown]
# ## Example 3: y' = Ay, where the series converges
#
# Now f'' = 0, and only tall trees contribute. A step is y₁ = R(hA) y₀ with the stability function R, and the modified
# equation is (1/h) log R(hA) = Σ bₖ hᵏ⁻¹Aᵏ. It converges as long as no zero or pole of R comes into the way of the
# logarithm: for |hλ| < ρ, where λ are the eigenvalues of A.

# %%
LINEAR = {
    "rk4": ("1, 0, 0, 0, -1/120, 1/144", 1.944544365596894),
    "implicit-midpoint": ("1, 0, 1/12, 0, 1/80, 0", 2.0),
    "explicit-euler": ("1, -1/2, 1/3, -1/4, 1/5, -1/6", 1.0),
    "implicit-euler": ("1, 1/2, 1/3, 1/4, 1/5, 1/6", 1.0),
    "heun2": ("1, 0, -1/6, 1/8, -1/20, 0", 1.414213562373095),
}
for name, (text, radius) in LINEAR.items():
    tall = bs.modified_equation(METHODS[name], 6, max_children=1)
    assert tall.coefficients() == [Fraction(c) for c in text.split(",")]
    found = bs.fields.convergence_radius(METHODS[name])
    assert abs(found.radius / radius - 1) < 1e-14
    print(f"{name:18} b = {text};  ρ = {found}")


# %% [markdown]
# How good are the first ten terms? The defect R(hλ) − exp(Σ bₖ(hλ)ᵏ) goes like h¹¹, here for λ = 1 + i/2 and h = 1/10,
# 1/20, 1/40.


# %%
def exact(x):
    """A fraction as a number of mpmath."""
    return mpmath.mpf(x.numerator) / x.denominator


def defects(name, z, terms):
    """|R(z) − exp(Σ b_k z^k)| for 1, 2, … terms."""
    b = bs.modified_equation(METHODS[name], terms, max_children=1).coefficients()
    R = bs.stability_function(METHODS[name])
    numerator, denominator = (mpmath.polyval([*map(exact, c)][::-1], z) for c in (R.numerator, R.denominator))
    sums = accumulate(exact(c) * z**k for k, c in enumerate(b, 1))
    return [abs(numerator / denominator - mpmath.exp(x)) for x in sums]


# %%
DEFECTS = {  # for h = 1/10
    "rk4": 1.81151e-15,
    "implicit-midpoint": 3.35305e-15,
    "explicit-euler": 3.12607e-12,
    "implicit-euler": 3.78376e-12,
    "heun2": 9.77432e-14,
}
with mpmath.workdps(40):
    for name, given in DEFECTS.items():
        found = [defects(name, mpmath.mpc(1, 0.5) / n, 10)[-1] for n in (10, 20, 40)]
        exponent = mpmath.log(found[1] / found[2], 2)
        assert abs(found[0] / given - 1) < 5e-6
        assert abs(exponent - 11) < 0.1
        print(f"{name:18}", *(f"{float(value):.3e}" for value in found), f"  exponent {float(exponent):.2f}")

# %% [markdown]
# With all terms it is zero inside the radius, and outside they are of no use. Here for RK4 on the oscillator, λ = i,
# whose radius is 1.94:

# %%
for h, colour, dashes in ((1.0, BLUE, "-"), (1.7, GREEN, "--"), (2.2, ORANGE, ":")):
    with mpmath.workdps(40):
        errors = [*map(float, defects("rk4", mpmath.mpc(0, h), 40))]
    assert (errors[-1] < errors[0] / 10) == (h < LINEAR["rk4"][1])
    pyplot.semilogy(range(1, 41), errors, dashes, color=colour, label=f"h = {h}")
pyplot.xlabel("number of terms")
pyplot.ylabel("error of a step")
pyplot.title("RK4 on y' = iy: the modified equation converges for h < 1.94", fontsize=10)
pyplot.legend()
pyplot.show()

# %% [markdown]
# ## Where the series diverges: exponentially small errors
#
# A linear equation is the exception. In general the terms grow in the end like factorials, however small h is, and
# there is a best number of them. If f is analytic, with a frequency scale ω, and h|ω| is small, the error of a step
# after the best number is at most C h e^(−γ/(h|ω|)) (ibid., section IX.7). It can be seen where everything is known:
# Störmer–Verlet with H = p − ½ log(1 + q²) takes steps of the trapezoidal rule for ∫ t/(1+t²) dt, and the terms of its
# modified equation are those of the Euler–Maclaurin formula, $\frac{B_k}{k!} h^k g^{(k)}(t)$. The solution has its
# singularities at the distance δ = 1, t = ±i. Then the best N is near 2πδ/h, and the error there below exp(−2πδ/h):
# smaller than any power of h.

# %%
TERMS, verlet = 35, bs.method("stormer-verlet")
quadrature = bs.parse_hamiltonian("p - log(1 + q^2)/2")
f = bs.modified_field(verlet, quadrature, TERMS, route="towers")
nodes, weights = np.polynomial.legendre.leggauss(20)


def truncation_errors(h):
    """The distances of a step from the flows of the modified equations with 1, 3, 5, … terms."""
    t = h * (nodes + 1) / 2
    p = f.terms(np.array([0 * t, t]))[:, 0] @ weights * h / 2
    flows = np.cumsum(p * h ** np.arange(TERMS))
    return abs(flows - bs.integrate(verlet, quadrature, h=h, steps=1, y0=[0, 0]).y[0, 1])[::2]


# %%
x, odd = np.linspace(6, 30, 13), np.arange(1, TERMS + 1, 2)
errors = np.array([truncation_errors(2 * pi / value) for value in x])
best, least = odd[errors.argmin(axis=1)], errors.min(axis=1)
assert (abs(best - x) <= 1.5).all()
assert (least < np.exp(-x)).all()
assert abs(np.polyfit(x, np.log(least), 1)[0] + 1) < 0.1

# %% [markdown]
# Dots are the best N on the left, and the errors there on the right.

# %%
_, (left, right) = pyplot.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
for k, colour, dashes in ((0, ORANGE, ":"), (5, GREEN, "--"), (12, BLUE, "-")):
    left.semilogy(odd, errors[k], dashes, color=colour, label=f"h = {2 * pi / x[k]:.2f}")
    left.semilogy(best[k], least[k], "o", color=colour)
right.semilogy(x, least, "o", color=BLUE, label="after the best N terms")
right.semilogy(x, np.exp(-x), "--", color=BLACK, label=r"$e^{-2\pi/h}$")
left.set(xlabel="number of terms N", ylabel="error of a step", ylim=(1e-16, 1e2))
right.set(xlabel=r"$2\pi/h$", ylabel="least error of a step")
left.legend()
right.legend()
pyplot.show()

# %% [markdown]
# `bs.figure("optimal-truncation")` has the same for the pendulum. What such errors mean for long times is told by
# theorem 3 (`modified_hamiltonians.py`). To try next: `bs.fields.reach` says how many terms are worth having at a
# point. `lotka_volterra.py` goes on with equations in the plane.
