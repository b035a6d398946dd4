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
# # Long runs: energy, rounding, variable steps, many starts
#
# For small steps, what a method does over long times is what its modified equation says (E. Hairer, C. Lubich, G.
# Wanner, *Geometric Numerical Integration*, chapter IX). Here it is seen in runs of millions of steps, on Kepler's
# problem and on a cluster of atoms.

# %%
from itertools import pairwise
from math import pi
from time import process_time

import numpy as np
from matplotlib import pyplot

import bseries as bs

PERIOD = 2 * pi
BLUE, ORANGE, GREEN, BLACK = "#0072B2", "#D55E00", "#009E73", "#000000"  # told apart by all (Okabe, Ito)
pyplot.rcParams.update({"figure.figsize": (6.4, 3.8), "figure.constrained_layout.use": True, "axes.grid": True})
pyplot.rcParams.update({"grid.alpha": 0.3, "font.size": 9, "lines.linewidth": 1.2, "legend.frameon": False})
kepler = bs.scene("kepler")

# %% [markdown]
# ## Three methods for the same money
#
# A planet of eccentricity 0.6 over 10,000 periods. The steps are such that each method takes about the same time: a
# step of Störmer–Verlet evaluates the force once, one of the classical Runge–Kutta method four times, and one of
# Gauss's method of order 6 three times in each of its iterations. The energy is observed at times that hit all phases
# of the orbit.

# %%
PERIODS = 10_000
METHODS = {"stormer-verlet": (1200, BLUE), "rk4": (600, ORANGE), "gauss3": (150, GREEN)}
runs = {}
for name, (steps, _) in METHODS.items():
    bs.integrate(name, kepler, h=0.01, steps=1, observe="energy")  # compiles
    start = process_time()
    runs[name] = bs.integrate(
        name,
        kepler,
        h=PERIOD / steps,
        steps=steps * PERIODS,
        save_every=None,
        observe="energy",
        observe_every=steps // 7,
    )
    seconds = process_time() - start
    print(f"{name:15} {steps:4} steps a period, {seconds:.2f} s, {seconds / (steps * PERIODS) * 1e9:4.0f} ns a step")


# %%
def relative_change(values):
    """How far values are from the first one."""
    return np.abs(values / values[0] - 1)


def upper_curve(t, values, count=60):
    """The largest of the values in each of some stretches of time, which grow in geometric progression."""
    edges = np.unique(np.searchsorted(t, np.geomspace(t[-1] / 1e4, t[-1], count)))
    pieces = [(a, b) for a, b in pairwise(edges) if b > a]
    return np.array([t[b] for _, b in pieces]), np.array([values[a:b].max() for a, b in pieces])


for name, (steps, colour) in METHODS.items():
    t, error = upper_curve(runs[name].observed_t, relative_change(runs[name].observed["energy"]))
    pyplot.loglog(t / PERIOD, error, color=colour)
    where = {
        "xy": (t[20] / PERIOD, error[20]),
        "xytext": (0, -14 if name == "rk4" else 5),
        "textcoords": "offset points",
    }
    pyplot.annotate(f"{name}, {steps} steps a period", color=colour, **where)
pyplot.xlabel("periods")
pyplot.ylabel("relative energy error")
pyplot.title("Energy error at equal cost, Kepler's problem with e = 0.6")
pyplot.show()

# %% [markdown]
# The energy error of the Runge–Kutta method grows linearly; the other two are symplectic and nearly preserve a modified
# energy, so that their error only oscillates.

# %%
last = {name: relative_change(run.observed["energy"])[-1000:].max() for name, run in runs.items()}
early = {name: relative_change(run.observed["energy"])[:1000].max() for name, run in runs.items()}
assert last["rk4"] > 20 * early["rk4"]
assert all(last[name] < 1.1 * early[name] for name in ("stormer-verlet", "gauss3"))

# %% [markdown]
# ## Rounding
#
# Störmer–Verlet and the Gauss methods preserve angular momentum exactly. So all that becomes of it is rounding: here
# its root mean square over 24 starts, with compensated summation and without. Errors that are independent of each
# other add up as in a random walk, like the root of time (dashed).

# %%
STEPS, EVERY, MEMBERS = 400_000, 2000, 24
starts = bs.runs.perturbed_start(kepler, 1e-3)
for name, colour in (("stormer-verlet", BLUE), ("gauss3", GREEN)):
    for compensated, style in ((True, "-"), (False, ":")):
        result = bs.ensemble(
            name, kepler, h=PERIOD / 200, steps=STEPS, sample=starts, members=MEMBERS, keep=MEMBERS,
            observe="angular_momentum", change="relative", observe_every=EVERY, compensated=compensated,
        )  # fmt: skip
        rms = np.sqrt((result.series["angular_momentum"] ** 2).mean(axis=0))[1:]
        label = f"{name}, {'compensated' if compensated else 'plain'} sums"
        pyplot.loglog(result.t[1:] / PERIOD, rms, style, color=colour, label=label)
        print(f"{label:36} {rms[-1]:.1e} after {STEPS:,} steps")
periods = result.t[1:] / PERIOD
for level in (2.5e-17, 4e-16):
    pyplot.loglog(periods, level * np.sqrt(periods), "--", color=BLACK, alpha=0.5, linewidth=0.8)
pyplot.xlabel("periods")
pyplot.ylabel("rms relative change of angular momentum")
pyplot.title("Rounding alone: 200 steps a period")
pyplot.legend()
pyplot.show()

# %% [markdown]
# ## Variable steps that stay reversible
#
# On an orbit with eccentricity 0.9 a constant step is too large near the sun and too small elsewhere. With `control`
# steps are proportional to a power of the distance, in a way that leaves a symmetric method symmetric (Hairer &
# Söderlind 2005). Both runs have the same number of steps for the same time.

# %%
comet = bs.scene("kepler", eccentricity="0.9")
STEPS = 200_000
variable = bs.integrate("stormer-verlet", comet, h=0.02, steps=STEPS, control="(q1^2 + q2^2)^(3/4)", observe="energy")
constant = bs.integrate("stormer-verlet", comet, h=variable.t[-1] / STEPS, steps=STEPS, observe="energy")

figure, (orbit, errors) = pyplot.subplots(2, 1, figsize=(6.4, 5.6), height_ratios=(1, 1.6))
for run, colour, name in ((constant, ORANGE, "constant steps"), (variable, BLUE, "variable steps")):
    first = run.t < 5 * PERIOD
    orbit.plot(run.y[2, first], run.y[3, first], color=colour, linewidth=0.8, label=name)
    t, error = upper_curve(run.t, relative_change(run.observed["energy"]))
    errors.loglog(t / PERIOD, error, color=colour, label=name)
orbit.plot(0, 0, "o", color=BLACK, markersize=4)
orbit.set(aspect="equal", xlabel="$q_1$", ylabel="$q_2$", title="five periods, e = 0.9")
errors.set(xlabel="periods", ylabel="relative energy error", title=f"{STEPS:,} steps each")
errors.legend(loc="center right")
pyplot.show()

# %%
print(f"steps from {np.diff(variable.t).min():.1e} to {np.diff(variable.t).max():.1e}")
assert (
    relative_change(variable.observed["energy"]).max() < 2e-3 < 0.1 < relative_change(constant.observed["energy"]).max()
)

# %% [markdown]
# They are reversible: with the opposite step the run goes back to its start.

# %%
steps = bs.stepper("stormer-verlet", comet, control="(q1^2 + q2^2)^(3/4)")
state = steps.start(h=0.02)
steps.advance(state, 10_000)
state = steps.restart(state, h=-state.h)
steps.advance(state, 10_000)
assert abs(state.y - comet.y0).max() < 1e-9
state.t, state.y - comet.y0

# %% [markdown]
# ## An ensemble
#
# Nine atoms in the plane with the Lennard-Jones potential, 200 starts with momenta of the temperature 0.1. All start at
# the minimum of the potential, where the modified energy of Störmer–Verlet is off by another amount than on average: so
# the mean is not zero. Neither mean nor spread grow in this time. Members run on all cores, and numbers do not depend
# on how many there are.

# %%
atoms = bs.scene("lennard-jones")
result = bs.ensemble(
    "stormer-verlet", atoms, h=0.005, steps=8000, sample=bs.runs.thermal_momenta(atoms, 0.1), members=200,
    change="absolute", observe_every=20, keep=3,
)  # fmt: skip
mean, std = result.mean["energy"], result.std["energy"]
pyplot.fill_between(result.t, mean - std, mean + std, color=BLUE, alpha=0.25, linewidth=0, label="mean ± deviation")
pyplot.plot(result.t, mean, color=BLUE, label="mean of 200 members")
pyplot.plot(result.t, result.series["energy"][0], color=ORANGE, linewidth=0.6, label="one member")
pyplot.xlabel("time")
pyplot.ylabel("change of energy")
pyplot.title("Störmer–Verlet with h = 0.005 on nine Lennard-Jones atoms")
pyplot.legend(ncols=3, loc="upper left")
pyplot.show()
result

# %% [markdown]
# Each member is, to the last bit, what `integrate` gives from its start.

# %%
assert not result.failures
assert std[-100:].mean() < 1.5 * std[100:200].mean()
first_start = bs.runs.thermal_momenta(atoms, 0.1)(np.random.default_rng(np.random.SeedSequence(0).spawn(1)[0]))
alone = bs.integrate("stormer-verlet", atoms, h=0.005, steps=8000, y0=first_start, observe="energy", save_every=20)
energy = alone.observed["energy"]
assert (result.series["energy"][0] == energy - energy[0]).all()
