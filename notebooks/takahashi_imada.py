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
# # The counter-example: the method of Takahashi and Imada, simplified
#
# Symplectic methods nearly keep a modified energy, where that is globally defined. Does a method that is nearly
# symplectic nearly keep it? This is section 4 of the lecture of E. Hairer, with its figures 7 and 8; the whole story is
# in E. Hairer, R. I. McLachlan, R. D. Skeel, *On energy conservation of the simplified Takahashi–Imada method*, ESAIM:
# M2AN 43 (2009) 631–644.
#
# For $\ddot q = f(q) = -\nabla U(q)$ a step is half a kick $p \mathrel{+}= \frac h2F(q)$, a drift
# $q \mathrel{+}= hp$, and half a kick again. With F = f it is Störmer–Verlet, which becomes much more accurate with
# $F = f + \alpha h^2 f'f$, $\alpha = \frac1{12}$. That is the method (13); it is symplectic, since this is the force of
# the potential $U - \frac\alpha2 h^2\|\nabla U\|^2$. To do without the derivative, the *simplified* method (14) has
# $F = f(q + \alpha h^2 f(q))$, which is the same but for $O(h^4)$.

# %%
# %matplotlib inline
from math import factorial
from typing import Any

import numpy as np
import sympy

import bseries as bs

true, simplified = bs.method("takahashi-imada"), bs.method("simplified-takahashi-imada")
assert bs.order_of(true) == bs.order_of(simplified) == 2

# %% [markdown]
# ## The modified Hamiltonian, for every U and α
#
# A potential with symbols u₁, …, u₅ as its derivatives at q = 0 stands for all: later ones play no part in what
# follows. (15) and (16), complete:

# %%
p, q, alpha, *u = sympy.symbols("p q alpha u1:6")
u1, u2, u3, u4, u5 = u
taylor = " + ".join(f"u{k}*q^{k}/{factorial(k)}" for k in range(1, 6))
anything = bs.Scene({"p": 1, "q": 1}, hamiltonian=f"p^2/2 + {taylor}", parameters={str(s): str(s) for s in u})
any_true, any_simplified = (
    bs.methods.TakahashiImada("alpha", simplified=kind, parameters=["alpha"]) for kind in (False, True)
)
energy = bs.modified_hamiltonian(any_true, anything, 5)
H3, H5 = (sympy.expand(energy.symbolic(k).subs(q, 0)) for k in (2, 4))
assert energy.symbolic(1) == energy.symbolic(3) == 0
sympy.Eq(sympy.Symbol("H_3"), sympy.collect(H3, u1))

# %%
sympy.Eq(sympy.Symbol("H_5"), H5)


# %%
def is_zero(formula):
    return sympy.expand(formula) == 0


twelfth = {alpha: sympy.Rational(1, 12)}
assert is_zero(H3 - (p**2 * u2 / 12 - (sympy.Rational(1, 24) + alpha / 2) * u1**2))
assert is_zero(H3.subs(twelfth) - (p**2 * u2 - u1**2) / 12)
assert is_zero(
    H5 + p**4 * u4 / 720 + (10 * alpha - 1) * p**2 * u1 * u3 / 120 + (5 * alpha - 1) * p**2 * u2**2 / 60
    - (20 * alpha - 1) * u1**2 * u2 / 240
)  # fmt: skip
assert is_zero(H5.subs(twelfth) - (u1**2 * u2 / 360 + p**2 * u1 * u3 / 720 + 7 * p**2 * u2**2 / 720 - p**4 * u4 / 720))

# %% [markdown]
# For α = 0 this is Störmer–Verlet, of example 6. In the accuracy the gain is hidden: H₃ does not vanish for any α. But
# for α = 1/12, H₃ = (p²U″ − U′²)/12 is the bracket of H with −pU′/12: a change of coordinates removes it, and what is
# left is of order 4.

# %%
bracket = (-p * u2 / 12) * p - (-u1 / 12) * u1  # {A, H} = A_q H_p − A_p H_q of A = −pU′/12
assert is_zero(H3.subs(twelfth) + bracket)

# %% [markdown]
# ## What simplification costs
#
# The modified equations of the two methods differ first at h⁴, by $\frac12\alpha^2 f''(f,f) = -\frac12\alpha^2U'''U'^2$
# in $\dot p$: formula (17). At h⁶ more is different.

# %%
symplectic, other = (bs.modified_field(method, anything, 7) for method in (any_true, any_simplified))


def difference(k):
    """What the simplified method adds at h^k, to p' and to q'."""
    pairs = zip(other.symbolic(k), symplectic.symbolic(k), strict=True)
    return [sympy.expand((a - b).subs(q, 0)) for a, b in pairs]


assert all(difference(k) == [0, 0] for k in range(4))
assert difference(4) == [-(alpha**2) * u1**2 * u3 / 2, 0]
in_p, in_q = difference(6)
assert is_zero(
    in_p - alpha**3 * u1**3 * u4 / 6 - alpha**2 * (
        u1**3 * u4 / 24 + u1**2 * u2 * u3 / 8 - p**2 * u1**2 * u5 / 24 - p**2 * u1 * u2 * u4 / 6
        - p**2 * u1 * u3**2 / 12 - p**2 * u2**2 * u3 / 12
    )
)  # fmt: skip
assert is_zero(in_q - alpha**2 * p * (u1**2 * u4 / 12 + u1 * u2 * u3 / 6))
sympy.Matrix(difference(4))

# %% [markdown]
# The whole terms of (14) with h² and h⁴, for reference:

# %%
second, fourth = ([formula.subs(q, 0) for formula in other.symbolic(k)] for k in (2, 4))
assert is_zero(second[0] - (alpha * u1 * u2 + u1 * u2 / 12 - p**2 * u3 / 12))
assert is_zero(second[1] - p * u2 / 6)
assert is_zero(
    fourth[0] - alpha * (p**2 * u1 * u4 / 12 + p**2 * u2 * u3 / 4 - u1**2 * u3 / 12 - u1 * u2**2 / 6)
    + alpha**2 * u1**2 * u3 / 2 - u1**2 * u3 / 240 - u1 * u2**2 / 120 + p**2 * u1 * u4 / 120 + p**2 * u2 * u3 / 24
    - p**4 * u5 / 720
)  # fmt: skip
assert is_zero(fourth[1] - p * u1 * u3 / 60 - p * u2**2 / 30 + alpha * p * (u1 * u3 + u2**2) / 6 + p**3 * u4 / 180)

# %% [markdown]
# In one degree of freedom nothing is lost yet: a step is a composition of shears, area is preserved, the divergence of
# every term is 0, and so each is Hamiltonian, *locally*. In general the method is not symplectic; the tree that breaks
# it has five nodes.

# %%
assert all(bs.fields.divergence(other, k) == 0 for k in range(7))
pendulum, asymmetric = bs.scene("pendulum"), bs.scene("pendulum", effects=["asymmetry"])
verdict: Any = bs.hamiltonians.hamiltonian_verdict(simplified, pendulum, 6)
assert verdict.holds
assert verdict.general.breaks.order == 5
assert not bs.hamiltonians.hamiltonian_verdict(simplified, "henon-heiles", 6).holds
print(verdict)

# %% [markdown]
# Along the solution the modified energy of (13) changes with the rate (18),
# $\dot{\tilde H} = -\frac12 h^4\alpha^2\, p\,U'''U'^2 + O(h^6)$. With $p = \dot q + O(h^2)$ that is the derivative of
# $-\frac12h^4\alpha^2 \int U'''U'^2 dq$. If the integral over a period is zero, as for $U = -\cos q$, no energy is lost
# or gained to this order. If not, every turn forwards adds $-\frac12h^4\alpha^2$ times the integral, and every turn
# backwards the opposite: for the perturbed pendulum $U = -\cos q + 0.2 \sin 2q$ the integral is $6\pi/5 \approx 3.77$.

# %%
report: Any = bs.energy_drift(simplified, asymmetric, y0=[2.5, 0], h=0.2)
U = -sympy.cos(q) + sympy.sin(2 * q) / 5
assert is_zero((report.rate + p * U.diff(q, 3) * U.diff(q) ** 2 / 288).rewrite(sympy.exp))
integral = bs.hamiltonians.takahashi_imada_integral(asymmetric)
assert integral == 6 * sympy.pi / 5
assert abs(float(integral) - 3.769911184307751886) < 1e-15
assert bs.hamiltonians.takahashi_imada_integral(pendulum) == 0
assert bs.energy_drift(true, asymmetric).verdict == bs.energy_drift(simplified, pendulum).verdict == "bounded"
assert abs(report.slope() / -6.542905262680666e-06 - 1) < 1e-12
assert abs(report.orbit.period / 3.2010170074434336 - 1) < 1e-12
print(report)

# %% [markdown]
# ## Figure 7
#
# Pendulums that turn over, h = 0.2. On the perturbed one the energy falls on the predicted line (dashed), and rises
# when the pendulum turns the other way round; the symplectic method (above), and the simplified one on the pendulum
# (below), show oscillations only. Lines are means over 25 units of time, bands how far the error goes up and down in
# them; it is 0 at t = 0.

# %%
bs.figure("takahashi-imada-drift")


# %%
def line(t, values):
    """The slope of the line that fits best, and the root mean square of what is left."""
    slope, start = np.polyfit(t, values, 1)
    return slope, np.sqrt(np.mean((values - start - slope * t) ** 2))


lines = {}
for scene in (pendulum, asymmetric):
    for method in (simplified, true):
        run = bs.integrate(method, scene, h=0.2, steps=25_000, y0=[2.5, 0])
        for n in (3, 5):
            lines[scene, method, n] = line(run.t, bs.modified_hamiltonian(true, scene, n)(run.y, 0.2))
        (slope, rest), (_, finer) = lines[scene, method, 3], lines[scene, method, 5]
        print(f"{method.name:26} on {scene.title:23} slope {slope:9.2e}, left {rest:.1e}, with H₅ {finer:.1e}")

# %% [markdown]
# Only one of the four drifts, and its slope is the predicted one but for O(h⁶). What is left oscillates, less so with
# the next term of the modified Hamiltonian.

# %%
drift, drift5 = (lines[asymmetric, simplified, n][0] for n in (3, 5))
assert abs(drift / -6.550336e-6 - 1) < 1e-6
assert abs(drift5 / -6.550556e-6 - 1) < 1e-6
assert abs(drift - report.slope()) < 1e-8
assert all(abs(slope) < 3e-11 for (*case, _), (slope, _) in lines.items() if case != [asymmetric, simplified])

# %% [markdown]
# The other sense of rotation has the opposite slope, and a pendulum that swings has none: on its way back it loses what
# it gained.

# %%
for momentum, expected, close in ((2.5, -6.568936359e-6, 1e-13), (-2.5, -report.slope(), 7e-8), (0.5, 0, 1e-10)):
    run = bs.integrate(simplified, asymmetric, h=0.2, steps=10_000, y0=[momentum, 0])
    slope = line(run.t, bs.modified_hamiltonian(true, asymmetric, 3)(run.y, 0.2))[0]
    print(f"p = {momentum:4}: {slope:10.3e}")
    assert abs(slope - expected) < close

# %% [markdown]
# ## Figure 8
#
# With many degrees of freedom the rate (18) looks random. If the motion is ergodic on the states that have the same
# energy and momenta, the mean over time is a mean in space (19). (18) is odd in p, and these states are symmetric under
# p → −p (together with a mirror image, where angular momentum is not zero), so that this mean is zero: there is no
# drift like t. That alone does not make a random walk; an oscillation has the mean zero as well. If moreover the
# correlations of the rate decay fast enough for a finite integral, as they seem to do in this chaos, the standard
# deviation s of the energy grows like $h^4\sqrt t$. The figure has 400 trajectories of nine atoms up to t = 20,000 and
# takes minutes (`bseries figure lennard-jones-drift`); its parameters are our choice, since those of the lecture are
# lost. What it shows is H + h²H₃ + h⁴H₅; the lecture has the formula of figure 7, but without H₅ oscillations would
# cover the walk. **Here it is reduced** to 12 trajectories up to t = 500 with twice the step, for a few seconds: that
# shows the walk, but mean and deviation of so few, for so short a time, are rough.

# %%
STEP, SPAN = 0.02, 500
bs.figure("lennard-jones-drift", h=STEP, members=12, span=SPAN)

# %% [markdown]
# For a number, 60 trajectories are observed less often. All have the same energy, and 50 units of time to forget the
# ordered cluster that they start from. A part of the error only oscillates, so that the variance is s² = a + 2Dt: over
# such times 2D, and not the exponent, can be seen. It is near 400 h⁸; that of the symplectic method is zero.

# %%
atoms, KINETIC, MEMBERS = bs.scene("lennard-jones"), 2.4, 60
momenta, energy = bs.runs.thermal_momenta(atoms, 1), bs.modified_hamiltonian(true, atoms, 5).observer(STEP)


def start(random):
    """A state in disorder."""
    y = momenta(random)
    y[:18] *= np.sqrt(2 * KINETIC / (y[:18] @ y[:18]))
    return bs.integrate(simplified, atoms, h=STEP, steps=2500, y0=y, save_every=None).y[:, -1]


diffusion = {}
for method in (simplified, true):
    result = bs.ensemble(
        method, atoms, h=STEP, steps=round(SPAN / STEP), sample=start, members=MEMBERS, rng=4,
        observe={"E": energy}, observe_every=round(SPAN / STEP / 20), change="absolute",
    )  # fmt: skip
    t, mean, deviation = result.t[2:], result.mean["E"], result.std["E"]
    diffusion[method] = np.polyfit(t, (deviation[2:] / STEP**4) ** 2, 1)[0]
    print(f"{method.name:28} s = {deviation[-1]:.1e} in the end, 2D = {diffusion[method]:6.2f} h⁸")
    if method is simplified:
        print(f"the mean is {mean[-1]:.1e}, with a standard error of {deviation[-1] / MEMBERS**0.5:.1e}")
        assert abs(mean[-1]) < 4 * deviation[-1] / MEMBERS**0.5
assert 150 < diffusion[simplified] < 1000
assert abs(diffusion[true]) < 1

# %% [markdown]
# So three cases: no drift, where (18) is the derivative of a bounded function; a linear one of size th⁴, where its mean
# is not zero; and one like $\sqrt t\,h^4$, where its mean is zero and its correlations decay. `bs.energy_drift` tells
# which, for any method. Try `bs.method("rk4")` on the pendulum, or another asymmetry
# (`bs.scene("pendulum", effects=["asymmetry"], epsilon="1/2")`). Why symplectic methods with a global modified
# Hamiltonian do not drift is told in `modified_hamiltonians.py`, and where they are global, in
# `generating_functions.py`.
