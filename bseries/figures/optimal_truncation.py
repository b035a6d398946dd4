"""Exponentially small errors: optimal truncation of the modified equation."""

from __future__ import annotations

import warnings
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, cast

import bseries as bs
from bseries.figures.helpers import label_panels
from bseries.figures.options import read_count
from bseries.figures.words import state
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, GREEN, VERMILION

if TYPE_CHECKING:
    from matplotlib.figure import Figure


NUMBER = None
TITLE = "Störmer–Verlet: the error of the modified equation after N terms, and after the best number of them"
SIZE = (17.0, 7.0)

METHOD = "stormer-verlet"
PENDULUM_START, QUADRATURE_START = (2.5, 0.0), (0.0, 0.0)
PENDULUM_RANGE, QUADRATURE_RANGE = (10.0, 17.0, 8), (6.0, 32.0, 14)
"""The least and largest x, and their number."""
QUADRATURE_TERMS = 35
QUADRATURE_DISTANCE = 1.0
"""The solution p = ½ log(1 + t²) is singular at ±i."""
SHOWN = (0, 4, 7)
"""Step sizes of the pendulum in the left panel."""
NODES, ITERATIONS, ROUNDING = "gauss16", 80, 1e-15
TINY_STEP = 1e-15
"""Step size without an optimal truncation order, so that `bseries.reach` does not warn."""


class Truncations(NamedTuple):
    """Errors of truncations on a scene."""

    distance: float  # distance δ of the singularities
    h: np.ndarray  # step sizes, from large to small
    terms: np.ndarray  # numbers of terms N; only odd ones, as the method is symmetric
    errors: np.ndarray  # error of a step by step size and number of terms; nan where the flow could not be computed
    expected: np.ndarray  # optimal N by the sizes of the terms at the middle of the step (`reach`), by step size

    @property
    def x(self) -> np.ndarray:
        """2πδ/h."""
        return 2 * np.pi * self.distance / self.h

    @property
    def least(self) -> np.ndarray:
        """The smallest error, by step size."""
        return np.nanmin(self.errors, axis=1)

    @property
    def best(self) -> np.ndarray:
        """The N of the smallest error, by step size."""
        return self.terms[np.nanargmin(self.errors, axis=1)]


class OptimalTruncation(NamedTuple):
    """Data of the figure."""

    pendulum: Truncations
    quadrature: Truncations


def numbers(*, terms: object = 17) -> OptimalTruncation:
    """The errors; for the pendulum with up to the given number of terms."""
    terms = read_count(terms, "terms", 5, 19)
    quadrature = bs.parse_hamiltonian("p - log(1 + q^2)/2")
    return OptimalTruncation(
        _truncations(bs.scene("pendulum"), PENDULUM_START, terms, pendulum_distance(), PENDULUM_RANGE),
        _truncations(quadrature, QUADRATURE_START, QUADRATURE_TERMS, QUADRATURE_DISTANCE, QUADRATURE_RANGE),
    )


def pendulum_distance() -> float:
    """The time from q = 0 to q = i∞ of the rotating pendulum, over i: ∫ dy/p for q = iy, by the trapezoidal rule."""
    energy = PENDULUM_START[0] ** 2 / 2 - 1
    y, width = np.linspace(-80, 80, 1601, retstep=True)
    return float((width / np.sqrt(2 * (energy + np.cosh(y)))).sum() / 2)


def _truncations(
    scene: bs.Scene, start: tuple[float, float], terms: int, distance: float, x: tuple[float, float, int]
) -> Truncations:
    """The errors of all truncations, for step sizes with equidistant 2πδ/h."""
    h, odd = 2 * np.pi * distance / np.linspace(*x), np.arange(1, terms + 1, 2)
    steps = [bs.integrate(METHOD, scene, h=size, steps=1, y0=start).y[:, 1] for size in h]
    fields = [bs.modified_field(bs.method(METHOD), scene, int(n), route="towers") for n in odd]
    gauss = cast(bs.RungeKutta, bs.method(NODES)).to_float()
    flow = partial(_flow, np.array(gauss.A, dtype=float), np.array(gauss.b, dtype=float), np.array(start))
    errors = [[np.linalg.norm(flow(f, size) - end) for f in fields] for size, end in zip(h, steps, strict=True)]
    middles = (np.array(start) + steps) / 2
    sizes = [bs.fields.reach(fields[-1], middle, TINY_STEP) for middle in middles]
    best = [found._replace(h=size).optimal_order for found, size in zip(sizes, h, strict=True)]
    return Truncations(distance, h, odd, np.array(errors), np.array(best))


def _flow(A: np.ndarray, b: np.ndarray, start: np.ndarray, f: bs.fields.SceneSeries, h: float) -> np.ndarray:
    """The flow of a field after a time h, by one step of a Gauss method; nan if the iteration fails."""
    derivatives = np.zeros((len(start), len(b)))
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of diverging iterations
        for _ in range(ITERATIONS):
            before, derivatives = derivatives, f.evaluator.value(start[:, None] + h * derivatives @ A.T, h)
            if abs(derivatives - before).max() < ROUNDING:
                return start + h * derivatives @ b
    return np.full(len(start), np.nan)


def columns(numbers: OptimalTruncation) -> dict[str, np.ndarray]:
    """The values by step size for each scene, with a column of errors for each number of terms."""
    table = {}
    for scene, found in numbers._asdict().items():
        errors = zip(found.terms, found.errors.T, strict=True)
        table |= {f"x_{scene}": found.x, f"h_{scene}": found.h}
        table |= {f"error_{scene}_{n}_terms": column for n, column in errors}
        table |= {f"best_terms_{scene}": found.best, f"expected_terms_{scene}": found.expected}
    return table


def caption(numbers: OptimalTruncation) -> str:
    """What is drawn, with the numbers of terms that were tried."""
    return (
        "Beyond the lecture, on the remark after its theorem 3 (HLW, section IX.7). The error is the distance of a "
        "step of Störmer–Verlet from the flow of the modified equation with N terms. It decreases at first, then the "
        "series diverges. The best N is proportional to 1/h, and the error for this N is exponentially small, in "
        "agreement with the bounds for analytic f and small h. Here both are approximately functions of x = 2πδ/h, "
        "where δ is the distance of the singularities of the solution from the real axis in complex time: "
        f"{numbers.pendulum.distance:.3g} for the pendulum from (p, q) = {state(PENDULUM_START)}, with up to "
        f"{numbers.pendulum.terms[-1]} terms. For the quadrature problem, H = p − ½ log(1 + q²) from (0, 0), it is 1, "
        f"the steps are those of the trapezoidal rule, and {numbers.quadrature.terms[-1]} terms are available."
    )


def draw(numbers: OptimalTruncation, figure: Figure) -> None:
    """From left to right: errors by N, the least ones by 1/h, and their N."""
    left, middle, right = figure.subplots(1, 3)
    errors = numbers.pendulum
    for k, colour, dashes in zip(SHOWN, (VERMILION, GREEN, BLUE), ("-.", "--", "-"), strict=True):
        left.semilogy(errors.terms, errors.errors[k], dashes, color=colour, label=f"$h = {errors.h[k]:.2f}$")
        left.semilogy(errors.best[k], errors.least[k], "o", color=colour, markersize=5)
    left.set(xlabel="number of terms $N$", ylabel="error of a step", ylim=(None, 8))
    left.legend(loc="upper right")
    styles = ("pendulum", "o", BLUE), ("quadrature", "^", VERMILION)
    for found, (label, marker, colour) in zip(numbers, styles, strict=True):
        middle.semilogy(found.x, found.least, marker, color=colour, label=label)
        right.plot(found.x, found.expected, marker, color=colour, fillstyle="none", markersize=6, label="smallest term")
        right.plot(found.x, found.best, marker, color=colour, label="least error")
    ends = np.array([0, QUADRATURE_RANGE[1] + 2])
    middle.semilogy(ends, np.exp(-ends), "--", color=BLACK, linewidth=0.8, label="$e^{-x}$")
    right.plot(ends, ends, "--", color=BLACK, linewidth=0.8, label="$N = x$")
    middle.set(ylabel="least error")
    right.set(ylabel="number of terms $N$", ylim=ends)
    label_panels((left, middle, right), ("pendulum", "the least of these errors", "the best $N$"))
    for axes, shown in ((middle, slice(None)), (right, slice(2, None))):
        axes.set(xlabel=r"$x = 2\pi\delta/h$", xlim=ends)
        axes.legend(handles=axes.lines[shown])
