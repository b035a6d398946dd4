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
# # Prey, predators and two Euler methods
#
# The equations of Lotka and Volterra, $\dot q = q(p-1)$, $\dot p = p(2-q)$, have closed orbits: predators q follow prey
# p around and around. One Euler method leaves them in a spiral, the other does not, although both make errors of the
# same size. The modified equation tells why. This is example 2 of the lecture of E. Hairer, with exercise 2 and figures
# 2 and 3 (E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, figures IX.1.2 and IX.1.3).

# %%
# %matplotlib inline
from fractions import Fraction

import numpy as np
import sympy
from matplotlib import pyplot

import bseries as bs

EXPLICIT, SYMPLECTIC, ADJOINT = "explicit-euler", "symplectic-euler-p", "symplectic-euler-q"
BLUE, ORANGE = "#0072B2", "#D55E00"  # told apart by all (Okabe, Ito)
p, q = sympy.symbols("p q")
scene = bs.scene("lotka-volterra")
sympy.Matrix(scene.field)  # (p', q')

# %% [markdown]
# ## Example 2: the modified equations
#
# (a) is the explicit Euler method, (b) the symplectic one that is implicit in p:
# $p_1 = p_0 + h p_1(2-q_0)$, $q_1 = q_0 + h q_0(p_1-1)$.

# %%
fields = {name: bs.modified_field(bs.method(name), scene, 5) for name in (EXPLICIT, SYMPLECTIC, ADJOINT)}
for name, f in fields.items():
    print(name)
    for k in (1, 2):
        print(*(f"  h^{k} in {v}': {formula}" for v, formula in zip("pq", f.symbolic(k), strict=True)), sep="\n")

# %% [markdown]
# The terms with h are those of the lecture. Both methods have order 1, and the terms look much alike.

# %%
GIVEN = {
    EXPLICIT: (p * (p * q - q**2 + 3 * q - 4) / 2, -q * (p**2 - p * q + 1) / 2),
    SYMPLECTIC: (p * (p * q + q**2 - 5 * q + 4) / 2, -q * (p**2 + p * q - 4 * p + 1) / 2),
}


def differ(found, given):
    """Whether two lists of formulas differ."""
    return any(sympy.expand(a - b) != 0 for a, b in zip(found, given, strict=True))


for name, term in GIVEN.items():
    assert not differ(fields[name].symbolic(0), (p * (2 - q), q * (p - 1)))
    assert not differ(fields[name].symbolic(1), term)

# %% [markdown]
# The other symplectic Euler method, implicit in q, is the adjoint of (b): its modified equation has −h.

# %%
for k in range(5):
    assert not differ(fields[ADJOINT].symbolic(k), [(-1) ** k * term for term in fields[SYMPLECTIC].symbolic(k)])

# %% [markdown]
# ## A test that needs no theory
#
# One step, and the flow of the modified equation with five terms: their distance must shrink like h⁶. Steps are in
# fractions and the flow has 30 digits. The start is (p, q) = (1.5, 2.5).

# %%
STEPS = {
    EXPLICIT: lambda p, q, h: (p + h * p * (2 - q), q + h * q * (p - 1)),
    SYMPLECTIC: lambda p, q, h: (p / (1 - h * (2 - q)), q + h * q * (p / (1 - h * (2 - q)) - 1)),
    ADJOINT: lambda p, q, h: (p + h * p * (2 - q / (1 - h * (p - 1))), q / (1 - h * (p - 1))),
}


def truncated(name, terms, size):
    """The modified equation with so many terms, for a step size, as a scene."""
    field = {v: sum(size**k * fields[name].symbolic(k)[i] for k in range(terms)) for i, v in enumerate("pq")}
    return bs.Scene({"p": 1, "q": 1}, field=field)


def defect(name, size):
    """How far a step is from the flow of the modified equation with five terms."""
    start = Fraction(3, 2), Fraction(5, 2)
    flow = bs.reference_solution(truncated(name, 5, sympy.Rational(size)), size, y0=start, full=True)
    ends = [Fraction(a) + Fraction(b) for a, b in zip(flow.high[:, 0].tolist(), flow.low[:, 0].tolist(), strict=True)]
    return float(sum((a - b) ** 2 for a, b in zip(ends, STEPS[name](*start, size), strict=True))) ** 0.5


# %%
DEFECTS = {EXPLICIT: 6.18271e-12, SYMPLECTIC: 8.32004e-12, ADJOINT: 8.61687e-12}  # for h = 0.01
for name, given in DEFECTS.items():
    found = [defect(name, Fraction(1, n)) for n in (100, 200, 400)]
    exponents = np.log2(np.array(found[:-1]) / found[1:])
    assert abs(found[0] / given - 1) < 1e-5
    assert (abs(exponents - 6) < 0.03).all()
    print(f"{name:18}", *(f"{value:.3e}" for value in found), f"  exponent {exponents[-1]:.3f}")

# %% [markdown]
# ## Figure 2
#
# Steps with h = 0.1 from the large dots (where those of the lecture were is not known), on the left among solutions of
# the given equations, on the right among those of the modified equations, truncated after the term with h. The explicit
# method spirals outwards, as its modified equation does; the orbits of the other modified equation are closed again.

# %%
bs.figure("lotka-volterra")

# %% [markdown]
# ## Exercise 2: first integrals
#
# With $I = p - \ln p + q - 2\ln q$ the equations are $\dot q = pq\,I_p$, $\dot p = -pq\,I_q$: multiply, and
# $\dot I = 0$. They are a *Poisson system*, Hamiltonian up to the factor pq. Method (b) preserves this structure, and
# so its modified equation has the same form with $I + h I_2 + h^2 I_3 + \dots$. Each $I_k$ follows by integration, and
# is one function for all p, q > 0, since this quadrant is simply connected.

# %%
integral = bs.modified_invariant(fields[SYMPLECTIC])
print(bs.modified_invariant(bs.modified_field(bs.method(SYMPLECTIC), scene, 3)))

# %%
INTEGRALS = (
    p + q - sympy.log(p) - 2 * sympy.log(q),
    -(p**2 / 4 + p * q / 2 - 2 * p + sympy.log(p) / 2 + q**2 / 4 - 5 * q / 2 + 2 * sympy.log(q)),
    p**3 / 9 + p**2 * q / 3 - p**2 + p * q**2 / 3 - 2 * p * q + 10 * p / 3 + q**3 / 9 - 5 * q**2 / 4 + 16 * q / 3
    - sympy.log(p) / 3 - 8 * sympy.log(q) / 3,
)  # fmt: skip
assert not differ(integral.terms[:3], INTEGRALS)
assert not differ(
    bs.modified_invariant(fields[ADJOINT]).terms[:3], [(-1) ** k * term for k, term in enumerate(INTEGRALS)]
)
for k, term in enumerate(integral.terms):
    assert not differ(fields[SYMPLECTIC].symbolic(k), (-p * q * term.diff(q), p * q * term.diff(p)))

# %% [markdown]
# Explicit Euler has no such integral. With h the first one changes as
# $\dot I = h\,\bigl((p-1)^2 + \tfrac12 (q-2)^2\bigr) + O(h^2)$: for small h it grows everywhere but at the equilibrium
# (1, 2). That is the spiral.

# %%
growth = sum(INTEGRALS[0].diff(v) * term for v, term in zip((p, q), fields[EXPLICIT].symbolic(1), strict=True))
assert not differ([growth], [(2 * p**2 - 4 * p + q**2 - 4 * q + 6) / 2])
assert not differ([growth], [(p - 1) ** 2 + (q - 2) ** 2 / 2])
try:
    bs.modified_invariant(fields[EXPLICIT])
except bs.SeriesError as error:
    print(error)
else:
    raise AssertionError("explicit Euler has no first integral")

# %% [markdown]
# Along 5000 steps with h = 0.1 from (1.5, 2.5) each term of the integral makes it more constant, by factors from 6 to
# 17.

# %%
DEVIATIONS = {
    SYMPLECTIC: (0.0235643663, 0.00136649395, 0.000216510513, 2.31735870e-5, 3.67216556e-6),
    ADJOINT: (0.0294979212, 0.00177365289, 0.000284934518, 3.11225829e-5, 5.04101197e-6),
}
for name, given in DEVIATIONS.items():
    states = bs.integrate(name, scene, h=0.1, steps=5000, y0=[1.5, 2.5]).y
    terms = np.array([sympy.lambdify((p, q), term)(*states) for term in bs.modified_invariant(fields[name]).terms])
    values = np.cumsum(terms * 0.1 ** np.arange(5)[:, None], axis=0)
    found = abs(values - values[:, :1]).max(axis=1)
    np.testing.assert_allclose(found, given, rtol=1e-8)
    colour, dashes = {SYMPLECTIC: (BLUE, "o-"), ADJOINT: (ORANGE, "^--")}[name]
    pyplot.semilogy(range(1, 6), found, dashes, color=colour, label=name)
pyplot.xticks(range(1, 6))
pyplot.xlabel("terms of the integral")
pyplot.ylabel("largest change, 5000 steps, h = 0.1")
pyplot.legend()
pyplot.show()

# %% [markdown]
# ## Figure 3: how many terms does it take?
#
# The steps from (2, 2), the exact solution, and those of the modified equations truncated after h and after h².

# %%
bs.figure("truncation")

# %% [markdown]
# The distances in numbers, also for longer truncations:

# %%
TIMES = (1, 2, 5, 10)
distances = {}
for name in (EXPLICIT, SYMPLECTIC):
    ends = bs.integrate(name, scene, h=0.1, steps=100, y0=[2, 2]).y[:, [10, 20, 50, 100]]
    print(f"{name}: distances at t = 1, 2, 5, 10")
    for terms in range(1, 6):
        flow = bs.reference_solution(truncated(name, terms, sympy.Rational(1, 10)), TIMES, y0=[2, 2])
        distances[name, terms] = np.linalg.norm(flow - ends, axis=0)
        print(f"  {terms} term{'s' * (terms > 1):1}", *(f"{value:10.2e}" for value in distances[name, terms]))

# %%
for name, last in ((EXPLICIT, (3.57535, 0.239851, 0.0292062)), (SYMPLECTIC, (0.0615581, 0.104144, 0.0112924))):
    np.testing.assert_allclose([distances[name, terms][-1] for terms in (1, 2, 3)], last, rtol=2e-5)

# %% [markdown]
# With one term these are the errors of the methods in the ordinary sense; those of explicit Euler grow along the
# spiral. With two terms the distances are of size h², with three h³; that is a law for small h. At h = 0.1 the term
# with h alone is no gain for symplectic Euler from t ≈ 5 on, although its orbit is the better one: what counts then is
# how long a turn takes.


# %%
def period(flow):
    """How long the orbit through (2, 2) takes to come back to q = 2, by Newton's method."""
    t = 4.6
    for _ in range(5):
        p, q = bs.reference_solution(flow, t, y0=[2, 2])[:, 0]
        t -= (q - 2) / bs.integrators.right_hand_side(flow)(0.0, np.array([p, q]))[1]
    return t


periods = [period(truncated(SYMPLECTIC, terms, sympy.Rational(1, 10))) for terms in range(1, 6)]
states = bs.integrate(SYMPLECTIC, scene, h=0.1, steps=20_000, y0=[2, 2]).y
angle = np.unwrap(np.arctan2(states[1] - 2, states[0] - 1))
turn = 2000 * 2 * np.pi / abs(angle[-1] - angle[0])
np.testing.assert_allclose(periods[:3], (4.614871, 4.620397, 4.591347), atol=1e-6)
assert abs(turn - periods[-1]) < 1e-3
print("periods after 1, 2, … terms:", *(f"{value:.4f}" for value in periods), f"; of the steps: {turn:.4f}")

# %% [markdown]
# The term with h makes the period longer, the steps make it shorter, and only the term with h² tells so. Try other
# steps (`bs.figure("truncation", h=0.05, terms=5)`), another method (has `bs.method("heun2")` an integral?), or an
# equation of your own. For Hamiltonian systems the modified integral is a modified Hamiltonian, the subject of
# `modified_hamiltonians.py`.
