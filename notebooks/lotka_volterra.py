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
scene.field, scene.hamiltonian

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
    EXPLICIT: (
        (p * (p * q - q**2 + 3 * q - 4) / 2, -q * (p**2 - p * q + 1) / 2),
        (-p**3 * q / 3 + 5 * p**2 * q**2 / 6 - p**2 * q - p * q**3 / 3 + 3 * p * q**2 / 2 - 10 * p * q / 3 + 8 * p / 3,
         p**3 * q / 3 - 5 * p**2 * q**2 / 6 + p * q**3 / 3 - p * q**2 / 2 + 4 * p * q / 3 - q / 3),
    ),
    SYMPLECTIC: (
        (p * (p * q + q**2 - 5 * q + 4) / 2, -q * (p**2 + p * q - 4 * p + 1) / 2),
        (-p**3 * q / 3 - 2 * p**2 * q**2 / 3 + 2 * p**2 * q - p * q**3 / 3 + 5 * p * q**2 / 2 - 16 * p * q / 3
         + 8 * p / 3,
         p**3 * q / 3 + 2 * p**2 * q**2 / 3 - 2 * p**2 * q + p * q**3 / 3 - 2 * p * q**2 + 10 * p * q / 3 - q / 3),
    ),
}  # fmt: skip


def differ(found, given):
    """Whether two lists of formulas differ."""
    return any(sympy.expand(a - b) != 0 for a, b in zip(found, given, strict=True))


for name, terms in GIVEN.items():
    assert not differ(fields[name].symbolic(0), (p * (2 - q), q * (p - 1)))
    assert not any(differ(fields[name].symbolic(k), term) for k, term in enumerate(terms, 1))

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
DEFECTS = {
    EXPLICIT: (6.18271e-12, 9.64706e-14, 1.50636e-15),
    SYMPLECTIC: (8.32004e-12, 1.30908e-13, 2.0525e-15),
    ADJOINT: (8.61687e-12, 1.33223e-13, 2.07058e-15),
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


for name, given in DEFECTS.items():
    found = [defect(name, Fraction(1, n)) for n in (100, 200, 400)]
    np.testing.assert_allclose(found, given, rtol=1e-5)
    print(f"{name:18}", *(f"{value:.3e}" for value in found), f"  exponent {np.log2(found[1] / found[2]):.3f}")

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
# so its modified equation has the same form with $I + h I_2 + h^2 I_3 + \dots$. Each $I_k$ follows by integration.

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
# $\dot I = h\,\bigl((p-1)^2 + \tfrac12 (q-2)^2\bigr) + O(h^2)$: it grows everywhere but at the equilibrium (1, 2). That
# is the spiral.

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
# Along 5000 steps with h = 0.1 from (1.5, 2.5) each term of the integral makes it more constant, nearly by a factor 10.

# %%
DEVIATIONS = {
    SYMPLECTIC: (0.0235643663, 0.00136649395, 0.000216510513, 2.31735870e-5, 3.67216556e-6),
    ADJOINT: (0.0294979212, 0.00177365289, 0.000284934518, 3.11225829e-5, 5.04101197e-6),
}
for name, given in DEVIATIONS.items():
    states = bs.integrate(scene, name, h=0.1, steps=5000, y0=[1.5, 2.5]).y
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

# %%
ENDS = {
    EXPLICIT: [(0.763957162319, 3.49812567891), (0.302307177348, 2.0022503673),
               (2.73068606064, 2.63468653163), (4.02568083265, 1.24245685165)],
    SYMPLECTIC: [(0.923167691145, 3.30891310645), (0.420624233492, 2.10494927329),
                 (1.764893275, 2.83903088052), (1.16666766917, 3.32341205511)],
}  # fmt: skip
DISTANCES = {
    EXPLICIT: [(0.230824, 0.113778, 1.04316, 3.57535), (0.0198778, 0.0216946, 0.12293, 0.239851),
               (0.0050823, 0.00197829, 0.0146127, 0.0292062), (0.000490474, 0.000267808, 0.00111402, 0.0034038),
               (0.000102134, 2.02818e-5, 0.000304467, 0.000326751)],
    SYMPLECTIC: [(0.10928, 0.0592205, 0.0602962, 0.0615581), (0.0221452, 0.0266062, 0.0748945, 0.104144),
                 (0.00385123, 0.00386725, 0.00827118, 0.0112924), (0.000765378, 0.000809928, 0.00209896, 0.00286767),
                 (0.000159355, 0.000164339, 0.000386504, 0.000536028)],
}  # fmt: skip
TIMES = (1, 2, 5, 10)
for name, given in DISTANCES.items():
    ends = bs.integrate(scene, name, h=0.1, steps=100, y0=[2, 2]).y[:, [10, 20, 50, 100]]
    np.testing.assert_allclose(ends.T, ENDS[name], rtol=1e-11)
    print(f"{name}: distances at t = 1, 2, 5, 10")
    for terms, expected in enumerate(given, 1):
        flow = bs.reference_solution(truncated(name, terms, sympy.Rational(1, 10)), TIMES, y0=[2, 2])
        found = np.linalg.norm(flow - ends, axis=0)
        np.testing.assert_allclose(found, expected, rtol=2e-5)
        print(f"  {terms} term{'s' * (terms > 1):1}", *(f"{value:10.2e}" for value in found))

# %% [markdown]
# With one term these are the errors of the methods in the ordinary sense; those of explicit Euler grow along the
# spiral. With two terms the distances are of size h², with three h³. Try other steps
# (`bs.figure("truncation", h=0.05, terms=5)`), another method (has `bs.method("heun2")` an integral?), or an equation
# of your own. What a modified integral is for Hamiltonian systems is the subject of `modified_hamiltonians.py`.
