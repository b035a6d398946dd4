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
# # Why symplectic methods keep the energy, and up to which step
#
# **Theorem 2** of the lecture: the modified equation of a symplectic method on a Hamiltonian system is Hamiltonian,
# locally, with a *modified Hamiltonian* H̃ = H + h H₂ + h² H₃ + … (E. Hairer, C. Lubich, G. Wanner, *Geometric
# Numerical Integration*, chapter IX). That is a statement about formal series; how well steps follow the truncated
# series is that of theorem 3, below. Where H̃ is one function on the whole domain, what steps nearly conserve is H̃,
# and so H. Here it is for the implicit midpoint rule on the pendulum; RK4 is not symplectic, and the verdict says where
# its H̃ ends.
#
# Why theorem 2 holds: let $f + hf_2 + h^2f_3 + \dots$ be the modified equation, with $hf_2, \dots$ up to $h^{r-1}f_r$
# Hamiltonian. The flow of the equation truncated there is symplectic, and a step differs from it by
# $h^{r+1}f_{r+1} + \dots$; the derivatives of both are symplectic matrices, hence $Jf_{r+1}'$ is symmetric, and so
# $f_{r+1} = J^{-1}\nabla H_{r+1}$, locally, and globally on a domain that is simply connected. The cylinder of the
# pendulum is not; why H̃ is global there all the same is told by `generating_functions.py`.

# %%
# %matplotlib inline
from itertools import pairwise
from math import factorial

import numpy as np
import sympy
from matplotlib import pyplot

import bseries as bs

midpoint, verlet, pendulum = bs.method("implicit-midpoint"), bs.method("stormer-verlet"), bs.scene("pendulum")
print(bs.modified_hamiltonian(midpoint, pendulum, 5))
print(bs.hamiltonians.hamiltonian_verdict("rk4", pendulum, 6))

# %% [markdown]
# ## Example 4: the pendulum on the cylinder
#
# $H = p^2/2 - \cos q$, and q is an angle: states lie on a cylinder. **Figure 4.** Explicit Euler spirals outwards;
# symplectic Euler and Störmer–Verlet go round on what look like closed curves, near those of H even for large steps.

# %%
bs.figure("pendulum-portraits")

# %% [markdown]
# **Figure 5.** The error of the energy over a long time, h = 0.005: with explicit Euler it grows steadily, with
# symplectic Euler it stays in a band. The modified equation predicts both, slope and band.

# %%
bs.figure("energy-error")

# %%
slope = bs.energy_drift("explicit-euler", pendulum, y0=[2.5, 0], h=0.005).slope()
errors = {}
for name in ("explicit-euler", "symplectic-euler-p"):
    energies = bs.integrate(name, pendulum, h=0.005, steps=40_000, y0=[2.5, 0], observe="energy").observed["energy"]
    errors[name] = energies - energies[0]
assert abs(slope - 0.00244) < 5e-6
assert abs(errors["explicit-euler"][-1] / 200 - slope) < 3e-5
assert abs(errors["symplectic-euler-p"]).max() < 0.0053  # h/2 max|p sin q| = 0.00528, to first order
print(f"explicit Euler: slope {slope:.5f}; symplectic Euler: up to {abs(errors['symplectic-euler-p']).max():.5f}")

# %% [markdown]
# Estimate (12) says that a method of order r drifts by no more than C t h^r. RK4 does better on the pendulum: halving
# the step divides its drift by about 2⁵, not 2⁴. The verdict above tells why: there the term with h⁴ has a Hamiltonian
# too.

# %%
drifts = []
for h in (0.2, 0.1, 0.05):
    run = bs.integrate("rk4", pendulum, h=h, steps=round(100 / h), y0=[2.5, 0], observe="energy")
    drifts.append(run.observed["energy"][-1] - run.observed["energy"][0])
np.testing.assert_allclose(drifts, (-1.168171096e-3, -3.860285678e-5, -1.302958731e-6), rtol=1e-5)
assert all(28 < first / second < 33 for first, second in pairwise(drifts))
print("up to t = 100, h = 0.2, 0.1, 0.05:", *(f"{drift:.3e}" for drift in drifts))

# %% [markdown]
# ## Example 5: large steps
#
# Twenty thousand steps of the midpoint rule from four starts that swing or turn over. **Figure 6.** Up to h = 0.7 the
# dots stay near the level curves of $H^{[3]} = \frac{p^2}2 - \cos q + \frac{h^2}{48}(\cos 2q - 2p^2\cos q)$. (That is
# the term with h² printed above, up to a constant: $-\frac1{24}\sin^2 q = \frac1{48}\cos 2q - \frac1{48}$.) Large dots
# are the starts, grey are level curves through them; for h = 1 the third orbit jumps between islands.

# %%
bs.figure("large-steps")

# %% [markdown]
# How well they do is seen from the largest change of H + h²H₃ along the four orbits:

# %%
STARTS = [(0.0, -1.5), (0.0, -2.5), (1.5, -np.pi), (2.5, -np.pi)]
TRUNCATED = {n: bs.modified_hamiltonian(midpoint, pendulum, n) for n in (1, 3, 5)}
EXPECTED = {
    0.1: (6.97e-7, 8.84e-7, 2.87e-6, 1.51e-5),
    0.3: (5.59e-5, 7.20e-5, 2.41e-4, 1.26e-3),
    0.7: (1.57e-3, 2.26e-3, 8.48e-3, 5.80e-2),
}


def deviation(energy, h, start):
    """The largest change of a function along 20,000 steps."""
    values = energy(bs.integrate(midpoint, pendulum, h=h, steps=20_000, y0=start).y, h)
    return abs(values - values[0]).max()


for h, expected in EXPECTED.items():
    found = [deviation(TRUNCATED[3], h, start) for start in STARTS]
    assert np.allclose(found, expected, rtol=5e-3)
    print(f"h = {h}: ", *(f"{value:10.2e}" for value in found))

# %% [markdown]
# **Theorem 3.** Let the method be symplectic of order r and its H̃ globally defined. While the numerical solution stays
# in a compact set, H̃ truncated after N terms, $H^{[N]}$, is conserved up to O(t hᴺ) and H itself up to O(hʳ), for
# times t ≤ C h^(r−N). (If H and the method are analytic and h is small, the best N, of size 1/h, makes hᴺ exponentially
# small and times exponentially long.) Here is symplectic Euler, from (p, q) = (2.5, 0), with N = 1 … 8: (a) the
# exponents of h are N; (b) nothing grows with t, since truncations with more terms are conserved better still, and what
# they add to $H^{[N]}$, of size hᴺ, only oscillates.

# %%
bs.figure("theorem-3")

# %% [markdown]
# The midpoint rule has even powers of h only, so that each term that is there gains h² (N = 1, 3, 5; 20,000 steps each,
# so that t = 20,000 h). How large N may be, and what is left then, is the end of `modified_equations.py`.

# %%
steps = np.array([0.025, 0.05, 0.1, 0.2, 0.4])
pyplot.figure(figsize=(5.5, 3.4), layout="constrained")
looks = zip(("#0072B2", "#D55E00", "#009E73"), "os^", strict=True)  # colours told apart by all (Okabe, Ito)
for (n, energy), (colour, marker) in zip(TRUNCATED.items(), looks, strict=True):
    errors = [deviation(energy, h, STARTS[0]) for h in steps]
    assert n > 3 or abs(np.log2(errors[2] / errors[1]) - (n + 1)) < 0.1
    pyplot.loglog(steps, errors, marker=marker, color=colour, label=f"$N = {n}$: $h^{n + 1}$")
pyplot.xticks(steps, [str(h) for h in steps])
pyplot.minorticks_off()
pyplot.xlabel("$h$")
pyplot.ylabel("largest change of $H^{[N]}$")
pyplot.legend()
pyplot.show()

# %% [markdown]
# ### Where chaos sets in
#
# The lecture lets chaos begin soon after h = 0.7. Measured: two starts 10⁻¹⁰ apart, and how far apart they are after
# 20,000 steps. Of these four orbits none is chaotic before h = 1.3, where the second one is, next to the separatrix.


# %%
def separation(h, start):
    """The distance of two orbits in the end."""
    starts = [(start[0] + shift, start[1]) for shift in (0, 1e-10)]
    ends = [bs.integrate(midpoint, pendulum, h=h, steps=20_000, y0=y0, save_every=None).y[:, -1] for y0 in starts]
    return np.linalg.norm(ends[0] - ends[1])


for h in (0.7, 1.0, 1.29, 1.3):
    found = [separation(h, start) for start in STARTS]
    assert [value > 0.01 for value in found] == [False, h == 1.3, False, False]
    print(f"h = {h}: ", *(f"{value:8.0e}" for value in found))

# %% [markdown]
# A map of all starts shows why. A chaotic layer at the separatrix is expected for every h, exponentially thin as
# h → 0. The solution on the separatrix has its singularities at the times ±iπ/2, and so, up to a factor, the width of
# the layer in energy is $h^{-3}e^{-\pi^2/h}$, its width in p at q = 0 as well, and that at the saddle point, where the
# energy is p²/2, is $h^{-3/2}e^{-\pi^2/2h}$ (Lazutkin's exponent; the powers of h are measured for this method). Below
# h = 0.7 the layer is hardly ever met, and only from h ≈ 1 on is it a part of the picture. Blue: orbits that begin a
# relative 10⁻¹⁰ apart are more than 0.01 apart at t = 700; (b) is the neighbourhood of the saddle point, where the
# factor of the dashed line is fitted.

# %%
bs.figure("chaos-onset")

# %% [markdown]
# ## Example 6: Störmer–Verlet in brackets
#
# For a splitting of H = T(p) + U(q), with T quadratic, H̃ is a sum of nested Poisson brackets, by the formula of Baker,
# Campbell and Hausdorff: the kick–drift–kick method,

# %%
brackets = bs.hamiltonians.bracket_hamiltonian(verlet, 5, quadratic_kinetic=True)
GIVEN = {
    "{T,{T,U}}": "1/12", "{U,{U,T}}": "-1/24",
    "{T,{T,{T,{T,U}}}}": "-1/720", "{U,{T,{T,{T,U}}}}": "1/360", "{U,{U,{T,{T,U}}}}": "-1/480",
    "{T,{T,{U,{U,T}}}}": "1/120",
}  # fmt: skip
assert {word: str(brackets[word]) for word in GIVEN} == GIVEN
brackets

# %% [markdown]
# and drift–kick–drift, with T and U exchanged. A general T has two more terms with h⁴. With one degree of freedom, and
# U', U″, … written u₁, u₂, …, the brackets of kick–drift–kick are
# $h^2(p^2u_2/12 - u_1^2/24) + h^4(-p^4u_4/720 + p^2u_1u_3/120 + p^2u_2^2/60 - u_1^2u_2/240)$:

# %%
print(bs.hamiltonians.bracket_hamiltonian("position-verlet", 3))
general = bs.hamiltonians.bracket_hamiltonian(verlet, 5)
assert [str(general[word]) for word in ("{U,{U,{U,{U,T}}}}", "{T,{U,{U,{U,T}}}}")] == ["7/5760", "1/360"]
p, q, *u = sympy.symbols("p q u1:6")
taylor = " + ".join(f"u{k}*q^{k}/{factorial(k)}" for k in range(1, 6))
anything = bs.Scene({"p": 1, "q": 1}, hamiltonian=f"p^2/2 + {taylor}", parameters={str(s): str(s) for s in u})
energy = bs.modified_hamiltonian(verlet, anything, 5)
u1, u2, u3, u4, _ = u
H3, H5 = (energy.symbolic(k).subs(q, 0) for k in (2, 4))
assert sympy.expand(H3 - p**2 * u2 / 12 + u1**2 / 24) == 0
assert sympy.expand(H5 + p**4 * u4 / 720 - p**2 * (u1 * u3 / 120 + u2**2 / 60) + u1**2 * u2 / 240) == 0

# %% [markdown]
# There are three routes to H̃ that have nothing in common but the result: trees, brackets, and the Hamilton–Jacobi
# equation, of which `generating_functions.py` tells.

# %%
routes = ("trees", "brackets", "generating-function")
galaxy = bs.scene("henon-heiles")
terms = {route: bs.modified_hamiltonian(verlet, galaxy, 5, route=route).symbolic(4) for route in routes}
assert all(sympy.expand(term - terms["trees"]) == 0 for term in terms.values())

# %% [markdown]
# ## What can still go wrong
#
# The simplified method of Takahashi and Imada is not symplectic, but on every pendulum it has an H̃ locally, as it
# preserves area. On an asymmetric one this H̃ is no function on the cylinder: as a function of p and q it grows by
# $\frac12h^4\alpha^2\int U'''U'^2\,dq$, to leading order, from q to q + 2π. Along solutions it is constant if turns are
# counted. So what is left without the part that grows, which is periodic, loses as much with every turn forwards, and
# so does H: the energy drifts beside a modified Hamiltonian that is conserved, but has many values.

# %%
simplified, asymmetric = bs.method("simplified-takahashi-imada"), bs.scene("pendulum", effects=["asymmetry"])
print(bs.hamiltonians.hamiltonian_verdict(simplified, asymmetric, 5))
print(bs.energy_drift(simplified, asymmetric, y0=[2.5, 0], h=0.2).verdict)
for kind in (pendulum, asymmetric):
    print(f"∫ U‴U′² dq = {bs.hamiltonians.takahashi_imada_integral(kind)} for the {kind.title}")

# %% [markdown]
# That story is `takahashi_imada.py`. **Try next:** another method in figure 6's place (`bs.method("gauss2")`), or the
# orbits of `separation` nearer to the separatrix, where chaos begins first.
