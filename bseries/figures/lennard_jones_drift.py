"""Figure 8: the simplified Takahashi–Imada method on a cluster of atoms, with a random walk of the energy."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import fitted_factor, growth_exponent, label_panels, logarithmic_indices
from bseries.figures.options import read_count, read_number
from bseries.figures.words import power, scientific
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, SKY

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.random import Generator


NUMBER = 8
TITLE = "Lennard-Jones cluster: random walk of the modified energy with the simplified Takahashi–Imada method"
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
LECTURE = 400, 2e4, 3.08e-6, 0.091e-6
"""Trajectories, time, standard deviation and mean there in the lecture; its exponents are those of its axis, ×10⁻⁶."""
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
    def lecture_step(self) -> float:
        """The step size at which the deviation would be that of the lecture, if s is proportional to h⁴ √t."""
        _, time, deviation, _ = LECTURE
        return self.h * (deviation / (self.coefficient * time**0.5)) ** 0.25

    @property
    def standard_error(self) -> np.ndarray:
        """The standard error of the mean."""
        return self.deviation / self.members**0.5


def numbers(
    *, h: object = 0.01, members: object = 400, span: object = 20_000, seed: object = 0, checkpoint: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> LennardJonesDrift:  # fmt: skip
    """An ensemble up to t = 20,000, which takes minutes; with a folder `checkpoint` it can be resumed."""
    h, members = read_number(h, "h", 0.002, 0.02), read_count(members, "members", 2, 100_000)
    atoms = bs.scene("lennard-jones")
    steps = round(read_number(span, "span", 20, 1e6) / h)
    energy = bs.modified_hamiltonian(bs.method(SYMPLECTIC), atoms, TERMS)
    result = bs.ensemble(
        SIMPLIFIED, atoms, h=h, steps=steps, sample=partial(start, atoms, bs.runs.thermal_momenta(atoms, 1), h),
        members=members, rng=read_count(seed, "seed", 0, 2**63), observe={"H": energy.observer(h)},
        observe_every=max(1, steps // TIMES), change="absolute", keep=KEPT, checkpoint=checkpoint, progress=progress,
    )  # fmt: skip
    return LennardJonesDrift(members, h, result.t, result.mean["H"], result.std["H"], result.series["H"])


def start(atoms: bs.Scene, draw: Callable[[Generator], np.ndarray], h: float, random: Generator) -> np.ndarray:
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


def caption(numbers: LennardJonesDrift) -> str:
    """The deviation and the mean at the end, beside those of the lecture."""
    members, time, deviation, mean = LECTURE
    end, ours, error = numbers.t[-1], float(numbers.mean[-1]), float(numbers.standard_error[-1])
    ratio = abs(ours) / error
    return (
        "Lecture, figure 8 (E. Hairer, R. I. McLachlan, R. D. Skeel, 2009). The error of the modified energy H + "
        "h²H₃ + h⁴H₅ of the symplectic Takahashi–Imada method along the simplified method. Its standard deviation s "
        f"grows like {power('t', numbers.exponent)}; with a rate of mean zero and decaying correlations it would be "
        f"√t. At t = {end:,.0f}, {numbers.members} trajectories with h = {numbers.h:g} have s = "
        f"{scientific(float(numbers.deviation[-1]))} and the mean {scientific(ours)}, {ratio:.1f} standard errors "
        f"from zero. The time average (19) of the rate (18) is this error over t: {scientific(ours / end)} ± "
        f"{scientific(error / end)}. The lecture gives s = {scientific(deviation)} and the mean {scientific(mean)} at "
        f"t = {time:,.0f} for {members} trajectories (its exponents are damaged in the scan; these are those of its "
        f"axis, ×10⁻⁶). If s is c h⁴ √t, the deviations agree for h = {numbers.lecture_step:.2g}. The parameters of "
        "the lecture are not known. Here 9 atoms in the plane, with σ = ε = m = 1, start as a hexagonal cluster with "
        f"random momenta of kinetic energy {KINETIC:g}, hence all with the same energy, and are equilibrated for "
        f"{EQUILIBRATION:g} units of time. Without H₅ the oscillations of the energy would hide the random walk for a "
        "long time."
    )


def draw(numbers: LennardJonesDrift, figure: Figure) -> None:
    """Above trajectories with their mean and deviation, below the deviation in logarithmic scales."""
    above, below = figure.subplots(2, height_ratios=(1.5, 1))
    drawn = f"{len(numbers.single)} of {numbers.members} trajectories, $h = {numbers.h:g}$"
    label_panels((above, below), (drawn, "sizes"))
    t, fit = numbers.t, numbers.coefficient * numbers.t**0.5
    for k, errors in enumerate(numbers.single):
        above.plot(t, errors, color=SKY, linewidth=0.5, label=None if k else "trajectories")
    for sign, label in ((1, r"$\pm s$"), (-1, None)):
        above.plot(t, sign * numbers.deviation, color=BLUE, label=label)
        above.plot(t, sign * fit, "--", color=BLACK, linewidth=0.8, label=label and r"$\pm c\,\sqrt{t}$")
    above.plot(t, numbers.mean, color=BLACK, label="mean")
    above.set(xlabel="time $t$", ylabel="error of $H + h^2H_3 + h^4H_5$", xlim=(0, t[-1]))
    above.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    above.legend(loc="lower left", bbox_to_anchor=(0.16, 0.98), ncols=4, borderaxespad=0)
    rows = logarithmic_indices(len(numbers.t), SHOWN)
    t, mean, error = numbers.t[rows], numbers.mean[rows], numbers.standard_error[rows]
    below.loglog(t, numbers.deviation[rows], color=BLUE, label=rf"$s$, like $t^{{{numbers.exponent:.2f}}}$")
    below.loglog(t, fit[rows], "--", color=BLACK, linewidth=0.8, label=r"$c\,\sqrt{t}$")
    below.loglog(t, abs(mean), color=BLACK, linewidth=0.8, label="|mean|")
    if numbers.members >= ENOUGH:
        below.loglog(t, 3 * error, ":", color=BLACK, label="3 standard errors")
    below.set(xlabel="time $t$", ylabel="size of the error", xlim=(t[0], t[-1]))
    below.legend(loc="upper left", ncols=2)
