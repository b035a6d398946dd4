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
# # Generating functions: where a modified Hamiltonian is defined
#
# The modified equation of a symplectic method has Hamiltonians *locally*. To conserve one over long times it must be a
# single function, on all of the domain of H. Section 5 of the lecture finds it there, from the generating function of
# the method (E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, sections VI.5 and IX.3.2): a map
# (p, q) ↦ (P, Q) near the identity is symplectic if and only if **locally**
#
# $$ p = P + \nabla_q S(P, q, h), \qquad Q = q + \nabla_P S(P, q, h) \qquad (20) $$
#
# with some function S. If S is defined everywhere, so is H̃.

# %%
from itertools import product

import numpy as np
import sympy
from matplotlib import pyplot

import bseries as bs
from bseries.course.field_nijhoff import field_nijhoff

BLUE, ORANGE, GREEN, BLACK = "#0072B2", "#D55E00", "#009E73", "#000000"  # told apart by all (Okabe, Ito)
p, q, h = sympy.symbols("p q h")
H = sympy.Function("H")(p, q)

# %% [markdown]
# ## The recursion (24)
#
# The exact flow after time t has an S(P, q, t) = t S₁ + t² S₂ + … that solves the equation of Hamilton and Jacobi,
# $\partial_t S = H(P, q + \nabla_P S)$. Comparing powers of t gives each S_j from those before, without any integral:

# %%
S1, S2, S3 = bs.hamiltonians.exact_generating_function(H, [p], [q], 3).terms
assert S1 == H
assert sympy.expand(2 * S2 - H.diff(q) * S1.diff(p)) == 0
assert sympy.expand(3 * S3 - H.diff(q) * S2.diff(p) - H.diff(q, 2) * S1.diff(p) ** 2 / 2) == 0
print(S3)

# %% [markdown]
# **Theorem 4.** Read backwards, with H̃ = H₁ + h H₂ + … in place of H, the same recursion finds H̃ from the S of a
# method: S_j is H_j and derivatives of earlier ones. So H̃ is defined wherever S is.
#
# ## Example 7: symplectic Euler, for all Hamiltonians at once
#
# The method implicit in p is nothing but (20) with S = h H(P, q). Its H̃ is formula (25):

# %%
terms = bs.hamiltonians.generating_hamiltonian(h * H, [p], [q], 3)
Hp, Hq = H.diff(p), H.diff(q)
assert sympy.expand(terms[1] + Hp * Hq / 2) == 0
assert sympy.expand(12 * terms[2] - (H.diff(p, 2) * Hq**2 + H.diff(q, 2) * Hp**2 + 4 * Hp * Hq * Hp.diff(q))) == 0
terms[2]

# %% [markdown]
# In several degrees of freedom the last term is $4\sum_{ij} H_{p_iq_j} H_{q_i} H_{p_j}$. Trees find the same.

# %%
central = bs.scene("central-field", potential="-1/r")
energy = bs.modified_hamiltonian("symplectic-euler-p", central, 3)
P, Q, E = central.symbols[:2], central.symbols[2:], energy.symbolic(0)
expected = sum(
    E.diff(P[i], P[j]) * E.diff(Q[i]) * E.diff(Q[j])
    + E.diff(Q[i], Q[j]) * E.diff(P[i]) * E.diff(P[j])
    + 4 * E.diff(P[i], Q[j]) * E.diff(Q[i]) * E.diff(P[j])
    for i, j in product(range(2), repeat=2)
)
assert sympy.simplify(12 * energy.symbolic(2) - expected) == 0

# %% [markdown]
# ## Theorem 5: Runge–Kutta methods
#
# Where $b_ia_{ij} + b_ja_{ji} = b_ib_j$ the method has, with H at its stages (Lasagni 1988),
#
# $$ S(P, q, h) = h\sum_i b_iH(P_i, Q_i) - h^2\sum_{ij} b_ia_{ij}\,H_q(P_i, Q_i)^{\mathsf T}H_p(P_j, Q_j). $$
#
# No path, no integral: H̃ is defined globally. Symplectic partitioned methods have a similar formula, and others have
# functions of their own, such as variational integrators; the trapezoidal rule for the action is Störmer–Verlet.

# %%
pendulum = bs.scene("pendulum")
for name in ("implicit-midpoint", "gauss2", "stormer-verlet"):
    print(bs.hamiltonians.generating_function(bs.method(name), pendulum, 3))
verlet = bs.hamiltonians.generating_function("stormer-verlet", pendulum, 5)
q0, q1 = sympy.symbols("q Q")
action = (q1 - q0) ** 2 / (2 * h) + h * (sympy.cos(q0) + sympy.cos(q1)) / 2
assert bs.hamiltonians.variational_generating_function(action, [q0], [q1], [p], 5).hamiltonian() == verlet.hamiltonian()

# %% [markdown]
# Truth from outside: steps of the method obey (20) with S truncated after N = 4 terms, up to O(h⁵).

# %%
S = bs.hamiltonians.generating_function("gauss2", pendulum, 4).expression(h)
slopes = sympy.lambdify((p, q, h), (S.diff(q), S.diff(p)), "numpy")
gaps = []
for step in (0.1, 0.05, 0.025):
    (p0, p1), (q0, q1) = bs.integrate("gauss2", pendulum, h=step, steps=1, y0=[1.0, 0.5]).y
    S_q, S_P = slopes(p1, q0, step)
    gaps.append(np.hypot(p1 + S_q - p0, q0 + S_P - q1))
orders = np.log2(np.array(gaps[:-1]) / gaps[1:])
assert (abs(orders - 5) < 0.2).all()
print(orders)

# %% [markdown]
# And where S is not global? With c h³ q added, q an angle, S is no function on the cylinder, though the map is
# one: it also pushes p by −c h³. H̃ inherits the term. It stays constant only if turns are counted, and H drifts with
# them. The same happens in `takahashi_imada.py`.

# %%
bs.hamiltonians.generating_hamiltonian(h * (p**2 / 2 - sympy.cos(q)) + h**3 * q / 10, [p], [q], 3)[2]

# %% [markdown]
# ## Exercise 5: a series that converges
#
# H = ln(α + p) + ln(β + q) (Field and Nijhoff 2003). With I = (α + p)(β + q), symplectic Euler multiplies α + p by
# 1 − h/I and divides β + q by it, so that I stays: two linear recursions, as in example 3.

# %%
scene, euler = bs.scene("field-nijhoff"), bs.method("symplectic-euler-p")  # α = β = 1
run = bs.integrate(euler, scene, h=0.5, steps=50)
invariant = (1 + run.y[0]) * (1 + run.y[1])
factor = 1 - 0.5 / invariant[0]
assert np.allclose(invariant, invariant[0], rtol=1e-13)
assert np.allclose(1 + run.y[0], (1 + run.y[0, 0]) * factor ** np.arange(51), rtol=1e-12)

# %% [markdown]
# The modified Hamiltonian is $\tilde H = H - \sum_{k\ge1} h^kI^{-k}/(k(k+1))$. It converges for |h| < |I|, to
# $(I\ln I - (I-h)\ln(I-h))/h - 1$. Every term has the domain of H: only powers of I are in the denominators.

# %%
energy, I = bs.modified_hamiltonian(euler, scene, 10), (1 + p) * (1 + q)  # noqa: E741
assert all(sympy.simplify(energy.symbolic(k) * k * (k + 1) * I**k) == -1 for k in range(1, 10))
closed = field_nijhoff("p", scene)
assert sympy.simplify(closed.radius - I) == 0
print(closed)

# %% [markdown]
# The flow of H̃ is the step: with $\tilde H = g(I)$ one has $(\alpha+p)' = -g'(I)(\alpha+p)$, and
# $e^{-hg'(I)} = 1 - h/I$.

# %%
x = sympy.Symbol("I", positive=True)
g = (x * sympy.log(x) - (x - h) * sympy.log(x - h)) / h - 1
assert sympy.simplify(sympy.exp(sympy.expand(-h * g.diff(x))) - (1 - h / x)) == 0
assert np.allclose(closed(run.y, 0.5), float(g.subs({h: 0.5, x: 4})), rtol=1e-13)
try:
    closed(scene.y0, 4.0)
    raise AssertionError("the radius of convergence is 4 at the start")
except bs.SeriesError as error:
    print(error)

# %% [markdown]
# Terms with h/I from 0.5 to 1.1. At h = I the series still converges, to 1, but there a step is not defined, as
# 1 − h/I = 0; beyond, terms grow.

# %%
pyplot.figure(figsize=(6, 3.4), layout="constrained")
k, at = np.arange(1, 41), scene.y0[:, None]  # where I = 4
for ratio, color, marker in ((0.5, BLUE, "o"), (0.9, GREEN, "s"), (1.0, BLACK, "^"), (1.1, ORANGE, "v")):
    terms = ratio**k / (k * (k + 1))
    found = energy.terms(at)[:, 0] * (4 * ratio) ** np.arange(10)
    assert np.allclose(terms[:9], -found[1:], rtol=1e-12)
    pyplot.semilogy(k, terms, marker, markersize=3, color=color, label=f"h/I = {ratio}")
n = sympy.Symbol("n", positive=True, integer=True)
assert sympy.summation(1 / (n * (n + 1)), (n, 1, sympy.oo)) == 1
pyplot.xlabel("$k$")
pyplot.ylabel("term with $h^k$")
pyplot.legend()
pyplot.show()

# %% [markdown]
# ## Exercise 6: the same for volume
#
# If a volume-preserving method is applied to a divergence-free field, all f_j of its modified equation
# $f + hf_2 + h^2f_3 + \dots$ are divergence-free. By induction, as for theorem 2: if $f_2, \dots, f_{j-1}$ are, the
# flow of the equation truncated after them keeps volume, and a step differs from it by $h^jf_j + O(h^{j+1})$. So its
# Jacobian has the determinant $1 + h^j\,\mathrm{div}\,f_j + O(h^{j+1})$, which must be 1.
#
# The ABC flow is a sum of three shears, a + b + c; splitting methods preserve volume. Others do not:

# %%
abc = bs.scene("abc-flow", A="A", B="B", C="C")
methods = {"explicit Euler": bs.method("explicit-euler"), "implicit midpoint": bs.method("implicit-midpoint")}
methods |= {"RK4": bs.method("rk4"), "Gauss, order 4": bs.method("gauss2")}
methods |= {"Lie–Trotter": bs.methods.lie_trotter(["a", "b", "c"]), "Strang": bs.methods.strang(["a", "b", "c"])}
first = {}
for name, method in methods.items():
    field = bs.modified_field(method, abc, 6)
    first[name] = next((k for k in range(6) if bs.fields.divergence(field, k) != 0), None)
    print(f"{name:18} divergence from h^{first[name]} on" if first[name] else f"{name:18} no divergence through h^5")
assert list(first.values()) == [1, 2, 4, 4, None, None]
bs.fields.divergence(bs.modified_field(methods["implicit midpoint"], abc, 3), 2)

# %% [markdown]
# The midpoint rule is symplectic and preserves area in the plane, but not volume in space. Indeed no Runge–Kutta method
# preserves volume for all divergence-free fields of all dimensions (P. Chartier, A. Murua 2007):
# `bs.volume_preservation` finds the tree that breaks it. How far is a small volume off after n steps? Backward error
# analysis predicts the logarithm, $h^k\int \mathrm{div}\,f_{k+1}\,dt$ (lines); the determinants of steps tell it too
# (dots).

# %%
abc, step = bs.scene("abc-flow"), 0.1
jacobian = sympy.lambdify(abc.symbols, sympy.Matrix(abc.field).jacobian(abc.symbols), "numpy")
figure, panels = pyplot.subplots(1, 2, figsize=(8.4, 3.4), layout="constrained")
for axes, name in zip(panels, methods, strict=False):
    run, k = bs.integrate(methods[name], abc, h=step, steps=400), first[name]
    ends = run.y[:, :-1], run.y[:, 1:]
    if name == "explicit Euler":
        ratios = [np.linalg.det(np.eye(3) + step * jacobian(*y)) for y in ends[0].T]
    else:
        halves = [step / 2 * jacobian(*y) for y in (ends[0] + ends[1]).T / 2]
        ratios = [np.linalg.det(np.eye(3) + half) / np.linalg.det(np.eye(3) - half) for half in halves]
    measured = np.cumsum(np.log(ratios))
    rate = sympy.lambdify(abc.symbols, bs.fields.divergence(bs.modified_field(methods[name], abc, k + 1), k), "numpy")(
        *run.y
    )
    predicted = np.cumsum(rate[1:] + rate[:-1]) / 2 * step ** (k + 1)
    assert abs(measured - predicted).max() < step * abs(measured).max()
    axes.plot(run.t[1:], predicted, color=ORANGE, label="predicted")
    axes.plot(run.t[1::4], measured[::4], "o", color=BLACK, markersize=2.5, label="steps")
    axes.axhline(0, color=BLACK, linestyle=":", linewidth=1, label="Lie–Trotter, Strang: 0 exactly")
    axes.set(title=f"{name}, h = {step}", xlabel="$t$", ylabel="logarithm of volume")
figure.legend(handles=panels[0].lines, loc="outside lower center", ncols=3)
pyplot.show()

# %% [markdown]
# **Try next.** If one of A, B, C is zero, the midpoint rule does preserve volume: why? And give
# `bs.hamiltonians.generating_hamiltonian` an S of your own: every S makes a symplectic method.
