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
# # Why symplectic methods keep the energy, and a method that does not
#
# The numerical solution of a symplectic method follows, up to tiny errors, the motion of a *modified Hamiltonian*
# H̃ = H + h² H₃ + h⁴ H₅ + … (E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, chapter IX). Here it
# is for the implicit midpoint rule on the pendulum.

# %%
import numpy as np
import sympy
from matplotlib import pyplot

import bseries as bs

midpoint, pendulum = bs.method("implicit-midpoint"), bs.scene("pendulum")
H = bs.modified_hamiltonian(midpoint, pendulum, 5)
H

# %% [markdown]
# A large step, h = 0.8, and orbits that swing and orbits that turn. The dots do not lie on level curves of the energy
# (dashed), but on those of H̃.

# %%
STEP = 0.8
STARTS = [(0.0, -1.5), (0.0, -2.5), (1.5, -np.pi), (2.5, -np.pi)]
TRUNCATED = {n: bs.modified_hamiltonian(midpoint, pendulum, n) for n in (1, 3, 5)}


def level_curves(energy, starts, h, **style):
    """The curves on which a Hamiltonian has its values at the starts."""
    q, p = np.meshgrid(np.linspace(-np.pi, np.pi, 300), np.linspace(-2.2, 4.2, 300))
    values = energy(np.array([p.ravel(), q.ravel()]), h).reshape(p.shape)
    pyplot.contour(q, p, values, levels=sorted(energy(start, h) for start in starts), **style)


pyplot.figure(figsize=(7, 4.2))
level_curves(TRUNCATED[1], STARTS, STEP, colors="0.6", linestyles="dashed", linewidths=0.9)
level_curves(TRUNCATED[5], STARTS, STEP, colors="C0", linewidths=0.9)
for start in STARTS:
    p, q = bs.integrate(pendulum, midpoint, h=STEP, steps=60, y0=start).y
    pyplot.plot((q + np.pi) % (2 * np.pi) - np.pi, p, "k.", markersize=5)
pyplot.plot([], [], "k.", label="implicit midpoint rule, h = 0.8")
pyplot.plot([], [], "C0", label="H̃, three terms")
pyplot.plot([], [], color="0.6", linestyle="dashed", label="H")
pyplot.xlabel("q")
pyplot.ylabel("p")
pyplot.legend(loc="upper center", fontsize=8, ncol=3)
pyplot.show()

# %% [markdown]
# With each term H̃ is conserved better. The first figures of the table that follows are those of H + h² H₃ over 20,000
# steps; the steps are 0.1, 0.3 and 0.7.

# %%
EXPECTED = {
    0.1: (6.97e-7, 8.84e-7, 2.87e-6, 1.51e-5),
    0.3: (5.59e-5, 7.20e-5, 2.41e-4, 1.26e-3),
    0.7: (1.57e-3, 2.26e-3, 8.48e-3, 5.80e-2),
}


def deviation(energy, h, start):
    """The largest change of a function along 20,000 steps."""
    values = energy(bs.integrate(pendulum, midpoint, h=h, steps=20_000, y0=start).y, h)
    return abs(values - values[0]).max()


print("  h  ", *(f"({p:.1f}, {q:.2f})".rjust(14) for p, q in STARTS))
for h, expected in EXPECTED.items():
    found = [deviation(TRUNCATED[3], h, start) for start in STARTS]
    assert np.allclose(found, expected, rtol=5e-3)
    print(f"{h:4} ", *(f"{value:14.2e}" for value in found))

# %%
steps = np.array([0.025, 0.05, 0.1, 0.2, 0.4])
pyplot.figure(figsize=(5.5, 3.6))
for n, energy in TRUNCATED.items():
    errors = [deviation(energy, h, STARTS[0]) for h in steps]
    slope = np.log2(errors[2] / errors[1])
    assert n > 3 or abs(slope - (n + 1)) < 0.1
    pyplot.loglog(steps, errors, "o-", label=f"{(n + 1) // 2} term{'s' * (n > 1)}: h^{n + 1}")
pyplot.xticks(steps, map(str, steps))
pyplot.minorticks_off()
pyplot.xlabel("h")
pyplot.ylabel("largest change of H̃")
pyplot.legend()
pyplot.show()

# %% [markdown]
# ## Three routes to the same function
#
# For a splitting method H̃ is a sum of nested Poisson brackets of the kinetic energy T and the potential energy U,

# %%
verlet, galaxy = bs.method("stormer-verlet"), bs.scene("henon-heiles")
bs.bracket_hamiltonian(verlet, 5, quadratic_kinetic=True)

# %% [markdown]
# and evaluated on a scene it is what comes from trees, and from the Hamilton–Jacobi equation.

# %%
routes = ("trees", "brackets", "generating-function")
terms = {route: bs.modified_hamiltonian(verlet, galaxy, 5, route=route).symbolic(4) for route in routes}
assert all(sympy.expand(term - terms["trees"]) == 0 for term in terms.values())
terms["trees"]

# %% [markdown]
# ## A method that keeps the energy of one pendulum, and not of another
#
# The simplified method of Takahashi and Imada is not symplectic. On a pendulum it has a modified Hamiltonian all the
# same, but perhaps none that is periodic in the angle: with every turn it gains −h⁴α²/2 ∫U‴U′² dq.

# %%
simplified = bs.method("simplified-takahashi-imada")
asymmetric = bs.scene("pendulum", effects=["asymmetry"])
print(bs.hamiltonian_verdict(simplified, asymmetric, 5))
bs.takahashi_imada_integral(pendulum), bs.takahashi_imada_integral(asymmetric)

# %%
print(bs.energy_drift(simplified, asymmetric, y0=[2.5, 0], h=0.2))

# %% [markdown]
# For pendulums that turn, the modified energy H + h²H₃ of the method drifts as predicted (lines): up or down,
# depending on the sense of rotation, on the asymmetric one; not at all on the ordinary one.

# %%
pyplot.figure(figsize=(7, 4))
for scene, momentum, color in [(asymmetric, 2.5, "C0"), (asymmetric, -2.5, "C3"), (pendulum, 2.5, "C2")]:
    report = bs.energy_drift(simplified, scene, y0=[momentum, 0], h=0.2)
    energy = bs.modified_hamiltonian(bs.method("takahashi-imada"), scene, 3)
    run = bs.integrate(scene, simplified, h=0.2, steps=25_000, y0=[momentum, 0])
    values = energy(run.y, 0.2)
    slope = np.polyfit(run.t, values, 1)[0]
    assert abs(slope - report.slope()) < 1e-7
    label = f"{'asymmetric' if scene is asymmetric else 'ordinary'}, p = {momentum}"
    pyplot.plot(run.t[::500], values[::500] - values[0], "o", markersize=3.5, color=color, label=label)
    pyplot.plot(run.t, report.slope() * run.t, "k", linewidth=0.8)
pyplot.xlabel("t")
pyplot.ylabel("change of H + h²H₃")
pyplot.legend()
pyplot.show()
