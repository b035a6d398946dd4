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
# # Linear error growth: theorem 7, step by step
#
# On an integrable system the global error of a symplectic method grows like t. That of a method whose actions drift
# grows like t², since frequencies drift with the actions. Why? Section 7 of the lecture proves the first in a few
# steps, which are those of a computation. Here they are carried out: first with one degree of freedom, where everything
# has a formula, then with two, where small denominators come in (E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical
# Integration*, sections X.2 and X.3). Symplecticity is not the only way to such actions: symmetric methods on
# reversible integrable systems have them too (ibid., section XI.3), as is seen below.
#
# **Theorem 7.** Let the system be integrable and real-analytic, the method analytic, symplectic and of order r, with a
# modified Hamiltonian that is globally defined, the frequencies ω(a*) strongly non-resonant with exponent ν, and the
# actions of the start within c |log h|^(−ν−1) of a*. Then, for h small enough, while t ≤ h^(−r), the error of the
# solution is at most C t h^r, and that of the actions at most C h^r.

# %%
# %matplotlib inline
import numpy as np
from matplotlib import pyplot

import bseries as bs

BLUE, ORANGE, BLACK = "#0072B2", "#D55E00", "#000000"  # told apart by all (Okabe, Ito)
H_STEP, SPAN = 0.01, 1000.0

# %% [markdown]
# ## An integrable system, and its numerical solution
#
# A rotor with $H = a + a^2/2$, where $a = (p^2 + q^2)/2$ is the action. It turns with the frequency ω(a) = 1 + a, so
# that the exact solution is known; to methods it is given in p and q. (H is not separable: Störmer–Verlet is here the
# implicit composition of the two symplectic Euler methods with h/2.)

# %%
old, new = {"p": 1, "q": 1}, {"a": 1, "theta": 1}
rotor = bs.Scene(old, hamiltonian="(p^2 + q^2)/2 + (p^2 + q^2)^2/8", name="rotor")
change = bs.hamiltonians.harmonic_action_angle(old, new, [1])
integrable = change.hamiltonian(rotor)
print(change)
print("K =", integrable.hamiltonian)

# %%
START = np.array([1.0, 0.5])  # a and θ


def turning(state, omega, t):
    """The solution a = const, θ = θ₀ + ωt."""
    return np.array([np.full_like(t, state[0]), state[1] + omega * t])


def run(method, h=H_STEP):
    """Times, actions and the global error."""
    found = bs.integrate(method, rotor, h=h, steps=round(SPAN / h), y0=change.to_old(START), save_every=10)
    exact = change.to_old(turning(START, 1 + START[0], found.t))
    return found.t, (found.y**2).sum(axis=0) / 2, np.linalg.norm(found.y - exact, axis=0)


runs = {name: run(name) for name in ("stormer-verlet", "kutta3")}

# %% [markdown]
# ## Backward error analysis, and action-angle variables
#
# The steps of Störmer–Verlet are those of H + h²H₃ + h⁴H₅ + … In a and θ this is the integrable system with a
# perturbation, ε = h², and the perturbation contains θ: a is not constant any more.

# %%
energy = bs.modified_hamiltonian("stormer-verlet", rotor, 5)
perturbations = [change.hamiltonian(bs.Scene(old, hamiltonian=energy.symbolic(k))).hamiltonian for k in (2, 4)]
perturbations[0]

# %% [markdown]
# ## Lindstedt–Poincaré series
#
# A symplectic change (a, θ) → (b, φ) with generating function ε S₁(b, θ) + ε² S₂(b, θ) removes θ as far as ε². Each S
# solves an equation ω(b) ∂S/∂θ + (known function) = (its mean), Fourier mode by Fourier mode: sin kθ is divided by kω.

# %%
form = bs.hamiltonians.lindstedt_poincare(integrable, 2, perturbations=perturbations)
print(form)
print("S_1 =", form.generating_function(1))

# %% [markdown]
# In the new variables nothing is left to do: b is constant up to O(t ε³), and φ turns uniformly with a frequency that
# is off by O(h²). So the error grows linearly, and it is known in advance: $\sqrt{2a}\,|\omega_h - \omega|\,t$.

# %%
epsilon = H_STEP**2
b, phase = form.to_normal(START, epsilon)
omega_h = bs.integrators.right_hand_side(form.normal_scene.with_parameters(eps=epsilon))(0.0, np.array([b, phase]))[1]
linear = np.sqrt(2 * START[0]) * abs(omega_h - 1 - START[0])
print(f"b - a = {b - START[0]:.2e}, error predicted: {linear:.4e} t")

t, actions, errors = runs["stormer-verlet"]
assert abs(np.polyfit(t, errors, 1)[0] / linear - 1) < 0.01
states = bs.integrate("stormer-verlet", rotor, h=H_STEP, steps=5000, y0=change.to_old(START)).y
angles = np.array([(states**2).sum(axis=0) / 2, np.arctan2(states[1], states[0])])
varies = {"a": np.ptp(angles[0]), "b": np.ptp(form.to_normal(angles, epsilon)[0])}
assert varies["a"] > 5e-5 > 1e-10 > varies["b"]
print(f"in 5000 steps a varies by {varies['a']:.1e}, b by {varies['b']:.1e}")

# %% [markdown]
# Kutta's method of order 3 is neither symplectic nor symmetric, and the energy drifts with a slope that the modified
# equation predicts: a changes by t·slope/ω, and the frequency with it. So the angle is off by an integral,
# t²·ω'(a)·slope/(2ω).

# %%
report = bs.energy_drift("kutta3", rotor, y0=change.to_old(START), h=H_STEP)
rate = report.slope() / (1 + START[0])
quadratic = np.sqrt(2 * START[0]) * abs(rate) / 2
print(report.verdict, f"of the action: {rate:.3e} t; error predicted: {quadratic:.3e} t^2")
t, actions, errors = runs["kutta3"]
assert abs(np.polyfit(t, actions, 1)[0] / rate - 1) < 0.01
assert abs(errors[-1] / (quadratic * t[-1] ** 2) - 1) < 0.03

# %%
figure, (left, right) = pyplot.subplots(1, 2, figsize=(8.4, 3.8), layout="constrained")
for (name, (t, actions, errors)), color in zip(runs.items(), (BLUE, ORANGE), strict=True):
    left.loglog(t[1:], errors[1:], color=color, label=name)
    right.loglog(t[1:], np.maximum.accumulate(abs(actions - actions[0]))[1:], color=color)
t = runs["kutta3"][0][1:]
left.loglog(t, linear * t, ":", color=BLACK, label="predicted: $t$")
left.loglog(t, quadratic * t**2, "--", color=BLACK, label="predicted: $t^2$")
left.set(xlabel="time $t$", ylabel="global error")
right.set(xlabel="time $t$", ylabel="largest change of the action so far")
left.legend()
pyplot.show()

# %% [markdown]
# Lobatto IIIA with three stages is not symplectic, but symmetric, and the rotor is reversible: p ↦ −p turns the motion
# round and takes each circle a = const to itself. What the modified equation adds is reversible, too, so that a does
# not drift, and the error grows like t:

# %%
assert not bs.symplecticity("lobatto-iiia3", 5).holds
t, actions, errors = run("lobatto-iiia3", h=0.05)
late = t > 10
exponent = np.polyfit(np.log(t[late]), np.log(errors[late]), 1)[0]
assert abs(exponent - 1) < 0.01
assert abs(actions - START[0]).max() < 1e-12
print(f"lobatto-iiia3: the error grows like t^{exponent:.2f}, a changes by {abs(actions - START[0]).max():.0e}")

# %% [markdown]
# ## Figure 10: two degrees of freedom
#
# The diagram of the proof on two coupled rotors, $H = a_1 + \frac32a_2 + \frac12a_1a_2$, with frequencies in golden
# ratio; h = 0.02. "Solution after N" is what the series with N terms predicts: b constant, φ turning uniformly with the
# frequency that belongs to b, and both taken back to p and q. The steps of Störmer–Verlet leave it by O(t h^(2N+2))
# only, and the new actions b change less and less; Kutta's method has no such actions.

# %%
bs.figure("linear-error-growth")

# %% [markdown]
# What is new is what S is divided by: k·ω with k in ℤ², whose signs may differ. In resonance one of them is zero.

# %%
energy = "a1 + 3/2*a2 + a1*a2/2 + eps*a1*a2*cos(2*theta1 - 2*theta2)"
rotors = bs.Scene({"a": 2, "theta": 2}, hamiltonian=energy, parameters={"eps": "1/100"}, name="rotors")
form = bs.hamiltonians.lindstedt_poincare(rotors, 2)
for actions in ([1, "2*sqrt(5) - 4"], [1, 2], [1, "2001/1000"]):
    smallest = form.small_denominators(actions, 1)[0]
    print(f"actions {actions}: k = {smallest.k}, k·ω = {smallest.value:.4g}")
assert form.small_denominators([1, 2], 1)[0].value == 0

# %% [markdown]
# With constant frequencies in resonance no change of variables removes that mode. It is refused, or kept: the normal
# form then has an angle left, that of the slow motion.

# %%
resonant = bs.Scene(
    {"a": 2, "theta": 2},
    hamiltonian="a1 + a2 + eps*(a1*cos(theta1 - theta2) + cos(theta1))",
    parameters={"eps": "1/100"},
    name="resonant rotors",
)
try:
    bs.hamiltonians.lindstedt_poincare(resonant, 1)
    raise AssertionError("these frequencies are resonant")
except bs.SeriesError as error:
    print(error)
print(bs.hamiltonians.lindstedt_poincare(resonant, 1, keep_resonant=True))

# %% [markdown]
# ## Condition (28)
#
# $|k\cdot\omega| \ge \gamma\,|k|^{-\nu}$ for all k ≠ 0 lets k·ω come close to 0 no faster than a power of |k|. Fourier
# coefficients of analytic functions decay exponentially, so that the quotients still have a convergent sum. It is no
# rare luck: for ν > d − 1 the frequencies of a ball that violate it have a measure of at most const·γ. Counted for
# d = 2, ν = 2, among random ω and all |k| ≤ 40:

# %%
random = np.random.default_rng(1)
omega = random.uniform(1, 2, (20_000, 2))
k = np.array([(i, j) for i in range(-40, 41) for j in range(1, 41) if abs(i) + j <= 40])
worst = np.min([abs(omega @ row) * abs(row).sum() ** 2 for row in k], axis=0)
gammas = np.array([0.2, 0.1, 0.05, 0.025])
violating = (worst[:, None] < gammas).mean(axis=0)
for gamma, share in zip(gammas, violating, strict=True):
    print(f"γ = {gamma}: {share:.1%} violate it")
assert np.allclose(violating / gammas, violating[1] / gammas[1], rtol=0.1)

# %% [markdown]
# The mean motions of the outer planets, from a run of the solar system: Neptune and Pluto are in resonance, Jupiter and
# Saturn nearly so. Dots are the least |k·ω| for each |k|; the dashed line is $\gamma|k|^{-\nu}$ with ν = d − 1 and the
# largest γ that fits; triangles are commensurabilities that astronomers know.

# %%
bs.figure("small-divisors")

# %% [markdown]
# ## Why the new actions stay: theorem 3
#
# After N steps of the series the remainder is O(ε^(N+1)), and b moves by no more than that per unit of time. It is the
# same argument as in **theorem 3**: there the modified Hamiltonian after N terms has errors of at most O(t hᴺ). For
# N = 1 … 8 they are measured on the pendulum, in `modified_hamiltonians.py`.
#
# **Try next.** Other methods in `run`: `"gauss2"`, which is symplectic of order 4; `"rk4"`, whose frequency is off by
# O(h⁴) and drifts by O(t h⁵), so that its error first grows like t h⁴ and in the end like t² h⁵. A start on a resonance
# of the two rotors, a₂ = 1 + a₁ (k = (2, −2)). And `integrable_systems.py`, where figure 9 shows both kinds of growth
# on the Toda lattice.
