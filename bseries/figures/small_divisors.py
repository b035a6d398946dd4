"""Small divisors: the non-resonance condition of theorem 7 for the frequencies of the outer planets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import label_panels
from bseries.figures.options import read_count
from bseries.figures.words import listed
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NUMBER = None
TITLE = "Outer solar system: small divisors k·ω among the mean motions of the planets"
SIZE = (17.0, 8.5)

PLANETS = "JSUNP"
"""Jupiter, Saturn, Uranus, Neptune, Pluto."""
GIANTS = 4
YEAR = 365.25
METHOD, STEP, STEPS, EVERY = "blanes-moan-rkn6", 200.0, 150_000, 5
"""The step in days, and the number of steps per stored state; Jupiter's year has 4333 days."""
KNOWN = ((2, -5, 0, 0, 0), (0, 0, 1, -2, 0), (0, 0, 0, 2, -3))
"""Jupiter and Saturn, Uranus and Neptune, Neptune and Pluto."""


class Divisors(NamedTuple):
    """The least divisors of a set of planets, by |k|."""

    norm: np.ndarray  # |k| = 1, 2, …
    least: np.ndarray  # least |k·ω| with this |k|, in radians per year
    k: np.ndarray  # minimising k, (norms, planets)

    @property
    def nu(self) -> int:
        """ν = d − 1 for d planets; for larger ν almost all frequencies satisfy the condition with some γ > 0."""
        return self.k.shape[1] - 1

    @property
    def gamma(self) -> float:
        """The largest γ with |k·ω| ≥ γ |k|^(−ν) for all these k."""
        return float((self.least * self.norm ** float(self.nu)).min())


class SmallDivisors(NamedTuple):
    """Data of the figure."""

    frequencies: np.ndarray  # mean motions of the planets, in radians per year
    giants: Divisors  # divisors without Pluto
    planets: Divisors  # those with Pluto


def numbers(*, reach: object = 20) -> SmallDivisors:
    """The divisors for |k| up to `reach`."""
    reach = read_count(reach, "reach", 5, 30)
    omega = mean_motions()
    return SmallDivisors(omega, divisors(omega[:GIANTS], reach), divisors(omega, reach))


def mean_motions() -> np.ndarray:
    """The mean rates of the planets' longitudes, about the axis of the total angular momentum.

    A smooth weight that vanishes at both ends suppresses the periodic parts of the rates.
    """
    scene = bs.scene("outer-solar-system")
    run = bs.integrate(METHOD, scene, h=STEP, steps=STEPS, save_every=EVERY)
    p, q = run.y.reshape(2, len(PLANETS) + 1, 3, -1)
    axis = np.cross(q[:, :, 0], p[:, :, 0]).sum(axis=0)
    first = np.cross(axis, (1.0, 0.0, 0.0))
    frame = np.array([row / np.linalg.norm(row) for row in (first, np.cross(axis, first))])
    x, y = np.einsum("rc,bcn->rbn", frame, q[1:] - q[0])
    longitudes = np.unwrap(np.arctan2(y, x))
    rates = np.diff(longitudes) / (EVERY * STEP / YEAR)
    count = rates.shape[1]
    weights = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 4
    return rates @ weights / weights.sum()


def divisors(omega: np.ndarray, reach: int) -> Divisors:
    """The least divisor for each |k| ≤ reach; of k and −k the one with k·ω > 0."""
    k, norms = np.zeros((1, 0), dtype=np.int8), np.zeros(1, dtype=np.int64)
    for _ in omega:
        values = np.arange(-reach, reach + 1, dtype=np.int8)
        sums = norms[:, None] + abs(values)
        row, column = np.nonzero(sums <= reach)
        k, norms = np.column_stack([k[row], values[column]]), sums[row, column]
    sizes, norm = abs(k @ omega), np.arange(1, reach + 1)
    best = [(chosen := np.flatnonzero(norms == n))[sizes[chosen].argmin()] for n in norm]
    found = k[best]
    return Divisors(norm, sizes[best], found * np.where(found @ omega < 0, -1, 1)[:, None])


def columns(numbers: SmallDivisors) -> dict[str, np.ndarray]:
    """The frequencies, and for each |k| the least divisor and its k."""
    table = {"frequency": numbers.frequencies}
    for name, found in (("giants", numbers.giants), ("planets", numbers.planets)):
        table |= {f"norm_{name}": found.norm, f"least_{name}": found.least}
        table |= {f"k_{planet}_{name}": row for planet, row in zip(PLANETS, found.k.T, strict=False)}
    return table


def caption(numbers: SmallDivisors) -> str:
    """What is drawn, with the constants found."""
    years = STEP * STEPS / YEAR
    sizes = [f"{found.gamma:.2g} for d = {found.k.shape[1]}" for found in (numbers.giants, numbers.planets)]
    return (
        "Beyond the lecture, on condition (28) of its theorem 7. Dots: the least |k·ω| for each |k| = Σ|k_i|, where "
        f"ω are the mean motions of the planets in a run over {years:,.0f} years. Dashed lines: γ|k|^(−ν) with ν = d "
        f"− 1 and the largest possible γ, {listed(sizes)}; for larger ν almost all frequencies satisfy such a "
        "condition. Triangles: commensurabilities known to astronomers. Neptune and Pluto are in 3:2 resonance; "
        "their divisor differs from zero by the slow motion of Pluto's perihelion."
    )


def draw(numbers: SmallDivisors, figure: Figure) -> None:
    """Draw the four giants on the left, all planets on the right."""
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, found in ((left, numbers.giants), (right, numbers.planets)):
        axes.loglog(found.norm, found.least, "o", color=BLUE, label=r"least $|k\cdot\omega|$")
        label = rf"$\gamma\,|k|^{{-{found.nu}}}$ with $\gamma = {found.gamma:.1g}$"
        axes.loglog(
            found.norm, found.gamma * found.norm ** -float(found.nu), "--", color=BLACK, linewidth=0.8, label=label
        )
        axes.legend(loc="lower left")
        _draw_known(axes, numbers.frequencies[: found.k.shape[1]])
    ticks = [1, 2, 3, 5, 7, 10, 20]
    for axes in (left, right):
        axes.set(xlabel="$|k|$", xlim=(0.9, numbers.giants.norm[-1] * 1.1))
        axes.set_xticks(ticks, map(str, ticks))
        axes.minorticks_off()
    left.set_ylabel(r"least $|k\cdot\omega|$ (radians per year)")
    label_panels((left, right), ("Jupiter, Saturn, Uranus, Neptune", "with Pluto"))


def _draw_known(axes: Axes, omega: np.ndarray) -> None:
    """Draw the divisors known to astronomers whose planets are all included."""
    for k in KNOWN:
        if not any(k[len(omega) :]):
            norm, size = sum(map(abs, k)), abs(float(np.dot(k[: len(omega)], omega)))
            axes.loglog(norm, size, "^", color=VERMILION, markersize=5, fillstyle="none")
            axes.annotate(_written(k), (norm, size), xytext=(5, 3), textcoords="offset points", fontsize=7.5)


def _written(k: Sequence[int]) -> str:
    """A divisor as text, such as 2J−5S."""
    terms = (
        f"{'-' if n < 0 else '+'}{abs(n) if abs(n) > 1 else ''}{planet}"
        for planet, n in zip(PLANETS, k, strict=True)
        if n
    )
    return "$" + "".join(terms).removeprefix("+") + "$"
