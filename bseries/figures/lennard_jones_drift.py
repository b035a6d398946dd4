"""Figure 8: the simplified Takahashi–Imada method on a cluster of atoms, with a random walk of the energy."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import bseries as bs
from bseries.figures.helpers import check_count, check_number, fitted_factor, growth_exponent, logarithmic_indices
from foundation.plotting import BLACK, BLUE, GREY, VERMILION

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.random import Generator

    from integrators import Scene

NUMBER = 8
TITLE = "Lennard-Jones cluster: random walk of the modified energy with the simplified Takahashi–Imada method"
CAPTION = (
    "Lecture, figure 8 (E. Hairer, R. I. McLachlan, R. D. Skeel, 2009). The error of the modified energy H + h²H₃ + "
    "h⁴H₅ of the symplectic Takahashi–Imada method along the simplified method. Its mean over all trajectories is "
    "zero within its standard error. Its standard deviation s grows like √t, as for a rate with mean zero and "
    "decaying correlations. The parameters of the lecture are not known. Here 9 atoms in the plane, with σ = ε = m = "
    "1, start as a hexagonal cluster with random momenta of kinetic energy 2.4, hence all with the same energy, and "
    "are equilibrated for 50 units of time. Without H₅ the oscillations of the energy would hide the random walk for "
    "a long time."
)
SIZE = (13.0, 12.0)

SIMPLIFIED, SYMPLECTIC = "simplified-takahashi-imada", "takahashi-imada"
KINETIC, EQUILIBRATION = 2.4, 50.0
"""Initial kinetic energy, of temperature 0.3, and length of runs before the observation."""
TERMS = 5
"""Powers h⁰ … h⁴ of the modified energy."""
TIMES = 1000
"""Number of observations of the energy."""
KEPT = 12
"""Number of trajectories drawn individually."""
SHOWN = 150
"""Approximate number of points of curves in the logarithmic panel."""
ENOUGH = 36
"""Number of trajectories from which on standard errors are drawn: they must be well below the deviation."""
FIT_FROM = 0.1
"""Part of the span from which on the deviation is fitted."""


class LennardJonesDrift(NamedTuple):
    """Data of the figure."""

    members: int  # number of trajectories
    h: float  # step size
    t: np.ndarray  # times of observation
    mean: np.ndarray  # mean of the error of the modified energy
    deviation: np.ndarray  # its standard deviation
    single: np.ndarray  # error along the first trajectories, (trajectories, times)

    @property
    def exponent(self) -> float:
        """The exponent of t in the deviation."""
        return growth_exponent(self.t, self.deviation, FIT_FROM * self.t[-1], self.t[-1], 100)

    @property
    def coefficient(self) -> float:
        """The factor c of s = c √t."""
        late = self.t >= FIT_FROM * self.t[-1]
        return fitted_factor(self.deviation[late], self.t[late] ** 0.5)

    @property
    def standard_error(self) -> np.ndarray:
        """The standard error of the mean."""
        return self.deviation / self.members**0.5


def numbers(
    *,
    h: float = 0.01,
    members: int = 400,
    span: float = 2e4,
    seed: int = 0,
    checkpoint: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> LennardJonesDrift:
    """An ensemble up to t = 20,000, which takes minutes; with a folder `checkpoint` it can be resumed."""
    h, members = check_number(h, "h", 0.002, 0.02), check_count(members, "members", 2, 100_000)
    atoms: Any = bs.scene("lennard-jones")
    steps = round(check_number(span, "span", 20, 1e6) / h)
    energy = bs.modified_hamiltonian(bs.method(SYMPLECTIC), atoms, TERMS)
    result = bs.ensemble(
        SIMPLIFIED,
        atoms,
        h=h,
        steps=steps,
        sample=partial(start, atoms, bs.runs.thermal_momenta(atoms, 1), h),
        members=members,
        seed=check_count(seed, "seed", 0, 2**63),
        observe={"H": energy.observer(h)},
        observe_every=max(1, steps // TIMES),
        change="absolute",
        keep=KEPT,
        checkpoint=checkpoint,
        progress=progress,
    )
    return LennardJonesDrift(members, h, result.t, result.mean["H"], result.std["H"], result.series["H"])


def start(atoms: Scene, draw: Callable[[Generator], np.ndarray], h: float, random: Generator) -> np.ndarray:
    """A state after equilibration from the initial cluster, with the energy that all trajectories share.

    The cluster has an atypical modified energy, so that the mean change from there would not be zero.
    """
    y = draw(random)
    momenta = y[: len(y) // 2]
    momenta *= (2 * KINETIC / (momenta @ momenta)) ** 0.5
    return bs.integrate(SIMPLIFIED, atoms, h=h, steps=round(EQUILIBRATION / h), y0=y, save_every=None).y[:, -1]


def columns(numbers: LennardJonesDrift) -> dict[str, np.ndarray]:
    """Mean, deviation and standard error at all times, and the errors along single trajectories."""
    table = {"t": numbers.t, "mean": numbers.mean, "deviation": numbers.deviation}
    table["standard_error"] = numbers.standard_error
    return table | {f"error_{k}": errors for k, errors in enumerate(numbers.single, 1)}


def draw(numbers: LennardJonesDrift, figure: Figure) -> None:
    """Above trajectories with their mean and deviation, below the deviation in logarithmic scales."""
    above, below = figure.subplots(2, height_ratios=(1.5, 1))
    _draw_trajectories(above, numbers)
    _draw_deviation(below, numbers)


def _draw_trajectories(axes: Axes, numbers: LennardJonesDrift) -> None:
    t, fit = numbers.t, numbers.coefficient * numbers.t**0.5
    label = f"{len(numbers.single)} of {numbers.members} trajectories, $h = {numbers.h:g}$"
    for k, errors in enumerate(numbers.single):
        axes.plot(t, errors, color=GREY, linewidth=0.5, label=None if k else label)
    for sign, label in ((1, r"$\pm s$"), (-1, None)):
        axes.plot(t, sign * numbers.deviation, color=BLUE, label=label)
        axes.plot(t, sign * fit, "--", color=BLACK, linewidth=0.8, label=label and r"$\pm c\,\sqrt{t}$")
    axes.plot(t, numbers.mean, color=VERMILION, label="mean")
    axes.set(xlabel="time $t$", ylabel="error of $H + h^2H_3 + h^4H_5$", xlim=(0, t[-1]))
    axes.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1.04), ncols=4)


def _draw_deviation(axes: Axes, numbers: LennardJonesDrift) -> None:
    rows = logarithmic_indices(len(numbers.t), SHOWN)
    t, deviation, mean, error = (
        values[rows] for values in (numbers.t, numbers.deviation, numbers.mean, numbers.standard_error)
    )
    axes.loglog(t, deviation, color=BLUE, label=rf"$s$, like $t^{{{numbers.exponent:.2f}}}$")
    axes.loglog(t, numbers.coefficient * t**0.5, "--", color=BLACK, linewidth=0.8, label=r"$c\,\sqrt{t}$")
    axes.loglog(t, abs(mean), color=VERMILION, linewidth=0.8, label="|mean|")
    if numbers.members >= ENOUGH:
        axes.loglog(t, 3 * error, ":", color=VERMILION, label="3 standard errors")
    axes.set(xlabel="time $t$", ylabel="size of the error", xlim=(t[0], t[-1]))
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1.04), ncols=4)
