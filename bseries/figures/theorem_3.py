"""Theorem 3: conservation of the modified Hamiltonian with N terms, for N = 1 … 8."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import label_panels, logarithmic_indices, power_exponent
from bseries.figures.options import read_count, read_method, read_start
from bseries.figures.words import listed, name_of, state
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, ORANGE, SKY, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from integrators import Method

NUMBER = None
TITLE = "Pendulum: conservation of the modified Hamiltonian, truncated after 1 to 8 terms"
SIZE = (17.0, 9.0)

METHOD = "symplectic-euler-p"
START = (2.5, 0.0)
STEP_SIZES = (0.2, 0.16, 0.125, 0.1, 0.08, 0.0625, 0.05, 0.04)
FIT_TO = 0.1
"""Largest step size in the fit of exponents."""
SPAN = 100.0
LONG_H, LONG_SPAN = 0.1, 1e4
SHOWN = 120
"""Number of points of the curves in time."""
COLOURS = (BLACK, ORANGE, BLUE, VERMILION, SKY, BLACK, ORANGE, BLACK, BLUE, BLUE)
"""Curves with the same dashes, every fourth, differ in grey."""


class Conservation(NamedTuple):
    """Data of the figure."""

    method: Method
    y0: tuple[float, ...]  # start
    terms: np.ndarray  # numbers of terms N
    h: np.ndarray  # step sizes
    errors: np.ndarray  # largest error of H with N terms for t ≤ 100, (terms, step sizes)
    t: np.ndarray  # times of the longer run
    growth: np.ndarray  # largest error up to these times for h = 0.1, (terms, times)

    @property
    def exponents(self) -> np.ndarray:
        """The exponents of h in the errors, by N."""
        fitted = self.h <= FIT_TO
        return power_exponent(self.h[fitted], self.errors[:, fitted].T)


def numbers(*, terms: object = 8, method: object = METHOD, y0: object = START) -> Conservation:
    """Errors of the truncations with up to a number of terms; the pendulum from (p, q) = (2.5, 0) rotates."""
    count, chosen, pendulum = read_count(terms, "terms", 1, 10), read_method(method), bs.scene("pendulum")
    start = read_start(y0, pendulum)
    energy = bs.modified_hamiltonian(chosen, pendulum, count)
    errors = [largest_errors(energy, h, SPAN, chosen, start)[:, -1] for h in STEP_SIZES]
    growth = largest_errors(energy, LONG_H, LONG_SPAN, chosen, start)
    shown = logarithmic_indices(growth.shape[1], SHOWN)
    sizes = np.arange(1, energy.order + 1), np.array(STEP_SIZES)
    return Conservation(chosen, start, *sizes, np.array(errors).T, shown * LONG_H, growth[:, shown])


def largest_errors(
    energy: bs.hamiltonians.ModifiedHamiltonian,
    h: float,
    span: float,
    method: Method | str = METHOD,
    y0: tuple[float, ...] = START,
) -> np.ndarray:
    """The largest error up to each step of H with 1, 2, … terms, (terms, steps + 1)."""
    run = bs.integrate(method, energy.scene, h=h, steps=round(span / h), y0=y0)
    truncations = np.cumsum(energy.terms(run.y) * h ** np.arange(energy.order)[:, None], axis=0)
    return np.maximum.accumulate(abs(truncations - truncations[:, :1]), axis=1)


def columns(numbers: Conservation) -> dict[str, np.ndarray]:
    """The errors by step size, and by time for h = 0.1, with a column for each N."""
    table = {"h": numbers.h}
    table |= {f"error_{n}_terms": row for n, row in zip(numbers.terms, numbers.errors, strict=True)}
    table |= {"terms": numbers.terms, "exponent": numbers.exponents, "t": numbers.t}
    return table | {f"error_until_t_{n}_terms": row for n, row in zip(numbers.terms, numbers.growth, strict=True)}


def caption(numbers: Conservation) -> str:
    """The exponents found, and whether the errors grow."""
    exponents = listed([f"{exponent:.2f}" for exponent in numbers.exponents])
    early = int(np.argmax(numbers.t >= numbers.t[-1] / 10))
    late = numbers.growth[:, -1] / numbers.growth[:, early]
    return (
        "Beyond the lecture, on its theorem 3: where H̃ is globally defined and the solution stays in a compact set, "
        f"H̃ truncated after N terms is conserved up to O(t hᴺ). Here {name_of(numbers.method)} on the pendulum from "
        f"(p, q) = {state(numbers.y0)}. (a) Largest errors for t ≤ {SPAN:g}; fitted exponents of h for N = 1, 2, …: "
        f"{exponents}. (b) Largest errors so far for h = {LONG_H:g}; from t = {numbers.t[early]:.4g} on they grow by "
        f"factors of up to {late.max():.2f}."
    )


def draw(numbers: Conservation, figure: Figure) -> None:
    """Left errors by step size, right errors by time."""
    left, right = figure.subplots(1, 2)
    _draw_curves(left, numbers.h, numbers.errors, numbers)
    left.set(xlabel="step size $h$", ylabel="largest error of $H^{[N]}$")
    left.set_xticks(numbers.h[::3], [f"{h:g}" for h in numbers.h[::3]])
    left.minorticks_off()
    _draw_curves(right, numbers.t, numbers.growth, numbers)
    right.set(xlabel="time $t$", ylabel="largest error of $H^{[N]}$ so far")
    label_panels((left, right), (f"$t \\leq {SPAN:g}$", f"$h = {LONG_H:g}$"))
    right.set_xlim(numbers.t[0], numbers.t[-1])
    figure.legend(handles=left.lines, loc="outside lower center", ncols=4)


def _draw_curves(axes: Axes, x: np.ndarray, rows: np.ndarray, numbers: Conservation) -> None:
    """A curve for each number of terms; few points have markers."""
    is_short = len(x) < SHOWN // 2
    for k, (n, row) in enumerate(zip(numbers.terms, rows, strict=True)):
        label = f"$N = {n}$: $h^{{{numbers.exponents[k]:.2f}}}$"
        style = {"color": COLOURS[k], "linestyle": ("-", "--", "-.", ":")[k % 4]}
        axes.loglog(x, row, marker="o" if is_short else None, label=label, **style)
