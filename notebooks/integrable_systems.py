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
# # Completely integrable systems: planets and the Toda lattice
#
# A Hamiltonian system with d degrees of freedom is *completely integrable* if suitable coordinates, actions a and
# angles θ, make its Hamiltonian a function K(a) of the actions alone: then a stays and θ turns uniformly, on a torus.
# What do numerical methods do to such tori? Section 6 of the lecture prepares the answer: changes of coordinates, first
# integrals in involution, and two systems to try (E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*,
# sections VI.5 and X.1).

# %%
# %matplotlib inline
import numpy as np
import sympy
from matplotlib import pyplot

import bseries as bs

BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#999999"  # told apart by all (Okabe, Ito)

# %% [markdown]
# ## Exercise 3: from positions to all coordinates
#
# A change of positions q = χ(Q) becomes a symplectic change of all coordinates with P = χ'(Q)ᵀ p, for it has the
# generating function p·χ(Q), that is P·dQ = p·χ'(Q)dQ = p·dq. For polar coordinates in the plane:

# %%
cartesian, polar = {"p": 2, "q": 2}, {"p": ["p_r", "p_phi"], "q": ["r", "phi"]}
change = bs.hamiltonians.point_transformation(
    cartesian, polar, {"q1": "r*cos(phi)", "q2": "r*sin(phi)"}, positive=["r"]
)
print(change)

# %% [markdown]
# Solved for the new momenta this is (26) of the lecture: $p_r = p_1\cos\varphi + p_2\sin\varphi$,
# $p_\varphi = r\,(-p_1\sin\varphi + p_2\cos\varphi)$.

# %%
z = p_r, p_phi, r, phi = change.symbols
p1, p2, q1, q2 = old = [change.formulas[name] for name in ("p1", "p2", "q1", "q2")]
assert sympy.simplify(p1 * sympy.cos(phi) + p2 * sympy.sin(phi) - p_r) == 0
assert sympy.simplify(r * (p2 * sympy.cos(phi) - p1 * sympy.sin(phi)) - p_phi) == 0
assert change.is_symplectic

# %% [markdown]
# The same from the other side: P·χ(q) generates the change to Q = χ(q), if the way back is given. A map that moves
# positions and leaves momenta as they were is refused.

# %%
back = {"q1": "Q1", "q2": "Q2 - Q1^2"}
bent = bs.hamiltonians.generating_transformation(cartesian, {"P": 2, "Q": 2}, "P1*q1 + P2*(q2 + q1^2)", positions=back)
assert bent == bs.hamiltonians.point_transformation(cartesian, {"P": 2, "Q": 2}, back)
wrong = {"p1": "p_r", "p2": "p_phi", "q1": "r*cos(phi)", "q2": "r*sin(phi)"}
try:
    bs.hamiltonians.canonical_transformation(cartesian, polar, wrong)
    raise AssertionError("this map is not symplectic")
except bs.SeriesError as error:
    print(error)

# %% [markdown]
# ## Exercise 4: a Hamiltonian system in new coordinates
#
# A symplectic y = ψ(z) takes the system of H to that of K(z) = H(ψ(z)): as ψ'(z) J⁻¹ ψ'(z)ᵀ = J⁻¹, from ż = J⁻¹∇K and
# ∇K = ψ'ᵀ∇H follows ẏ = ψ'ż = J⁻¹∇H. Here for a planet whose perihelion advances, $V(r) = -1/r - \mu/(3r^3)$, where
# ψ'(z) ż is compared with the field at ψ(z). No φ is left in K.

# %%
planet = bs.scene("perturbed-kepler", mu="mu")
central = change.hamiltonian(planet)
moved = sympy.Matrix(old).jacobian(z) * sympy.Matrix(central.field)
there = sympy.Matrix(planet.field).subs(dict(zip(planet.symbols, old, strict=True)), simultaneous=True)
assert sympy.simplify((moved - there).subs(r, sympy.Symbol("r", positive=True))).is_zero_matrix
central.hamiltonian

# %% [markdown]
# Solutions are the same in both coordinates. Numerical solutions are not: a Runge–Kutta method commutes with affine
# changes of coordinates, but not with all others.
#
# ## Example 8: motion in a central field
#
# **Theorem 6** (Arnold, Liouville) asks for d first integrals that are in involution, that is {F_i, F_j} = 0, and whose
# gradients are linearly independent; where their level sets are compact (so that solutions exist for all times),
# actions and angles exist near each component. In a central field there are two degrees of freedom, the energy, and the
# angular momentum L = p_φ.


# %%
def bracket(A, B, momenta, positions):
    """{A, B} = A_q·B_p − A_p·B_q."""
    return sympy.Add(*(A.diff(q) * B.diff(p) - A.diff(p) * B.diff(q) for p, q in zip(momenta, positions, strict=True)))


energy = p_r**2 / 2 + p_phi**2 / (2 * r**2) + sympy.Function("V")(r)
assert bracket(energy, p_phi, (p_r, p_phi), (r, phi)) == 0
gradients = sympy.Matrix([energy, p_phi]).jacobian(z)
sympy.Matrix([minor for minor in (gradients[:, [1, k]].det() for k in range(4)) if minor != 0])

# %% [markdown]
# The gradients are dependent where these minors vanish, $p_r = 0$ and $p_\varphi^2 = r^3 V'(r)$: on circular orbits. In
# the Kepler problem, $V = -1/r$, that is $r = L^2$, and with $p_r = 0$ also $L^2 = 2r^2(H + 1/r)$. Without r this is
# α(H, L) = 0:

# %%
H, L = sympy.symbols("H L")
alpha = sympy.resultant(L**2 - 2 * r**2 * H - 2 * r, L**2 - r, r)
assert sympy.expand(alpha + L**2 * (1 + 2 * H * L**2)) == 0
sympy.factor(alpha)

# %% [markdown]
# In the plane of L and H (a) circular orbits bound what is possible, and between them and H = 0 level sets are tori.
# (Only L = 0, the fall into the centre, is cut out; for H ≥ 0 level sets are not compact.) On each torus there are two
# frequencies, and where their ratio is not rational the orbit fills a ring (b; cross: the centre). They show in the
# angle from one perihelion to the next, $2\int_{u_1}^{u_2} L\,du/\sqrt{2(H + u + \mu u^3/3) - L^2u^2}$ with u = 1/r.


# %%
def turn(y, mu):
    """The angle, by the trapezoidal rule: u goes from u₁ to u₂ and back, u₁ < u₂ < u₃ are where the root vanishes."""
    p, u = y[:2], 1 / np.linalg.norm(y[2:])
    momentum, energy = y[2] * y[1] - y[3] * y[0], p @ p / 2 - u - mu * u**3 / 3
    first, second, third = np.sort(np.roots([2 * mu / 3, -(momentum**2), 2, 2 * energy]).real)
    u = (first + second) / 2 + (second - first) / 2 * np.sin(np.linspace(0, 2 * np.pi, 100, endpoint=False))
    return 2 * np.pi * np.mean(momentum / np.sqrt(2 * mu / 3 * (third - u)))


def measured_turn(planet, h):
    """The mean over 100 turns of Störmer–Verlet."""
    p, q = bs.integrate("stormer-verlet", planet, h=h, steps=round(630 / h)).y.reshape(2, 2, -1)
    radial, angle = (p * q).sum(axis=0), np.unwrap(np.arctan2(q[1], q[0]))
    k = np.flatnonzero((radial[:-1] < 0) & (radial[1:] >= 0))  # r is least between k and k + 1
    angles = angle[k] - radial[k] / (radial[k + 1] - radial[k]) * (angle[k + 1] - angle[k])
    return (angles[-1] - angles[0]) / (len(k) - 1)


planet = bs.scene("perturbed-kepler")
exact = turn(planet.y0, 0.015)
errors = np.array([measured_turn(planet, h) - exact for h in (0.01, 0.005)])
assert abs(errors[0] / errors[1] - 4) < 0.05
print(f"the perihelion advances by {np.degrees(exact) - 360:.3f}° a turn")
print("errors of Störmer–Verlet with h = 0.01, 0.005:", np.degrees(errors).round(4))

# %%
figure, (left, right) = pyplot.subplots(1, 2, figsize=(8.4, 4), layout="constrained")
momenta = np.linspace(-2, 2, 400)
left.plot(momenta, -1 / (2 * momenta**2), color=ORANGE, label="circular orbits")
left.fill_between(momenta, -1 / (2 * momenta**2), 0, color=BLUE, alpha=0.25, linewidth=0, label="tori")
left.fill_between(momenta, 0, 0.5, color=GREY, alpha=0.25, linewidth=0, label="not compact")
left.axvline(0, color=ORANGE, linestyle=":", label="L = 0")
left.plot(0.8, -0.5, "ko", markersize=4, label="start of (b)")
left.set(xlabel="angular momentum $L$", ylabel="energy $H$", ylim=(-2, 0.5), title="(a) Kepler problem")
figure.legend(loc="outside lower left", fontsize=8, ncols=5)
run = bs.integrate("stormer-verlet", planet, h=0.01, steps=15_000)
right.plot(run.y[2], run.y[3], color=BLUE, linewidth=0.6)
right.plot(0, 0, "+", color=GREY, markersize=8)
right.plot(run.y[2, 0], run.y[3, 0], "ko", markersize=4)
right.set(aspect="equal", xlabel="$q_1$", ylabel="$q_2$", title=r"(b) with $\mu = 0.015$")
pyplot.show()

# %% [markdown]
# H is analytic, and for μ ≠ 0 the frequencies change independently with the actions. So near most of these tori, those
# whose frequencies satisfy a Diophantine condition, the truncated modified equation has tori of its own, by the KAM
# theorem, with frequencies that are off by O(h²); the method follows them up to tiny errors. Its error grows, but over
# long times no faster than linearly. That is the subject of `linear_error_growth.py`.
#
# ## Example 9: the Toda lattice
#
# On a ring neighbours repel exponentially: $H = \sum_k p_k^2/2 + \exp(q_k - q_{k+1})$. Flaschka's matrix L has
# $a_k = -p_k/2$ in its diagonal and $b_k = \frac12\exp((q_k - q_{k+1})/2)$ beside it and in two corners. It moves by
# $\dot L = BL - LB$ with a skew-symmetric B, a *Lax pair*: L(t) stays similar to L(0), and its eigenvalues stay.

# %%
toda = bs.scene("toda")
p, q = toda.symbols[:3], toda.symbols[3:]
b = [sympy.exp((q[k] - q[(k + 1) % 3]) / 2) / 2 for k in range(3)]
lax = sympy.Matrix([[-p[0] / 2, b[0], b[2]], [b[0], -p[1] / 2, b[1]], [b[2], b[1], -p[2] / 2]])
skew = sympy.Matrix([[0, b[0], -b[2]], [-b[0], 0, b[1]], [b[2], -b[1], 0]])
motion = lax.applyfunc(lambda entry: sum(entry.diff(x) * v for x, v in zip(toda.symbols, toda.field, strict=True)))
assert sympy.simplify(motion - (skew * lax - lax * skew)).is_zero_matrix

# %% [markdown]
# The traces of L, L², L³ say the same as its eigenvalues. They are in involution, and independent at the start of
# figure 9. (Level sets are compact once the common motion of all particles is split off.)

# %%
traces = [sympy.expand((lax**k).trace()) for k in (1, 2, 3)]
assert (2 * traces[1]).equals(toda.hamiltonian)
assert all(sympy.simplify(bracket(traces[i], traces[k], p, q)) == 0 for k in range(3) for i in range(k))
at_start = dict(zip(toda.symbols, toda.y0, strict=True))
assert np.linalg.matrix_rank(np.array(sympy.Matrix(traces).jacobian(toda.symbols).subs(at_start), dtype=float)) == 3

# %% [markdown]
# **Figure 9.** Four times as many steps for Störmer–Verlet as for RK4, which evaluates the force four times in each.

# %%
bs.figure("toda")

# %% [markdown]
# The errors in figures, of the eigenvalues and of the solution:

# %%
EXPECTED = {
    "rk4": [(0.00717, 0.205), (0.01429, 1.145), (0.02826, 3.087)],
    "stormer-verlet": [(0.00174, 0.0212), (0.00153, 0.0694), (0.00146, 0.0898)],
}
matrix = sympy.lambdify(toda.symbols, lax, "numpy")
for name, h, times in (("rk4", 0.08, ("24.96", 50, 100)), ("stormer-verlet", 0.02, (25, 50, 100))):
    run, exact = bs.integrate(name, toda, h=h, steps=round(100 / h)), bs.reference_solution(toda, times)
    spectra = [np.linalg.eigvalsh(matrix(*y)) for y in (toda.y0, *run.y[:, [round(float(t) / h) for t in times]].T)]
    for t, y, spectrum, expected in zip(times, exact.T, spectra[1:], EXPECTED[name], strict=True):
        found = np.linalg.norm(spectrum - spectra[0]), np.linalg.norm(run.y[:, round(float(t) / h)] - y)
        assert np.allclose(found, expected, rtol=5e-3)
        print(f"{name:15} t = {t:5}  {found[0]:.5f}  {found[1]:.4f}")

# %% [markdown]
# With RK4 eigenvalues drift and the global error grows like t²; with Störmer–Verlet the error of the eigenvalues stays
# in a band, and the global error grows like t.
#
# **Try next.** Other symplectic methods (`"mclachlan4"`, `"gauss2"`); the Hénon–Heiles model, which is the Toda lattice
# up to third powers of its variables only, and no longer integrable.
