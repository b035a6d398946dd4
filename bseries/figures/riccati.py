"""Figure 1: steps of a method on y' = y², and its modified equation truncated after 1 to 4 terms."""

from __future__ import annotations

from math import log
from typing import TYPE_CHECKING, Any, NamedTuple

import bseries as bs
from bseries.exceptions import SeriesError
from bseries.figures.helpers import truncated_scene
from bseries.figures.options import read_method, read_number
from bseries.figures.words import listed, name_of, scientific
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, GREEN, GREY, VERMILION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from integrators import Method, Scene

NUMBER = 1
TITLE = "y' = y²: steps across the pole, and the modified equation after 1 to 4 terms"
SIZE = (12.0, 8.0)

CURVES = 4
"""Number of truncations: the first ones that differ, that of the first term included."""
MOST_TERMS = 9
REACH = 0.7
"""Largest h y of curves. They end earlier where the truncated field has a zero, at which solutions come to rest: for
explicit Euler with 4 terms at h y = 0.74."""
BEFORE_REST = 0.95
SHOWN = 0.4
"""Largest h y in the picture."""
FINE = 4
"""Points of the curves per step."""


class Riccati(NamedTuple):
    """Data of the figure."""

    method: Method  # the method
    h: float  # step size
    t: np.ndarray  # times of the steps
    y: np.ndarray  # numerical solution
    # solutions of the truncated equations as pairs of times and values, by the number of terms
    truncated: dict[int, tuple[np.ndarray, np.ndarray]]

    def distances(self) -> tuple[float, list[float]]:
        """The last time of a step that all curves reach, and their distances from the step."""
        last = min([self.t[-1], *(t[-1] for t, _ in self.truncated.values())])
        step = int(np.searchsorted(self.t, last * (1 + 1e-12), "right")) - 1
        found = (np.interp(self.t[step], t, y) for t, y in self.truncated.values())
        return float(self.t[step]), [float(abs(y - self.y[step])) for y in found]


def numbers(*, h: object = 0.02, method: object = "explicit-euler") -> Riccati:
    """Steps for h y < 1.4, and curves up to h y = 0.7."""
    h, chosen = read_number(h, "h", 0.002, 0.1), read_method(method)
    riccati = bs.scene("riccati")
    coefficients = _coefficients(chosen, riccati)
    terms = [k + 1 for k, c in enumerate(coefficients) if c][:CURVES]
    if len(terms) < 2:
        raise SeriesError(
            f"method must have an error among the terms up to h^{MOST_TERMS - 1}, but {name_of(chosen)} has none"
        )
    t, y = _steps(chosen, riccati, h)
    curves = {n: _solution(truncated_scene(chosen, riccati, n, h), h, _reach(coefficients[:n])) for n in terms}
    return Riccati(chosen, h, t, y, curves)


def _coefficients(method: Method, scene: Scene) -> list[float]:
    """The coefficients c of the modified equation y' = y² Σ c_k (h y)^k."""
    import sympy

    field, y = bs.modified_field(method, scene, MOST_TERMS), sympy.Symbol("y")
    return [float(sympy.Poly(field.symbolic(k)[0], y).LC()) for k in range(MOST_TERMS)]


def _reach(coefficients: list[float]) -> float:
    """The largest h y of a curve."""
    roots: Any = np.roots(coefficients[::-1])
    zeros = roots.real[(abs(roots.imag) < 1e-9) & (roots.real > 0)]
    return min([REACH, *(BEFORE_REST * zeros)])


def _steps(method: Method, scene: Scene, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of the steps as long as h y < 1.4; implicit steps may have no solution before."""
    try:
        with np.errstate(all="ignore"):
            run = bs.integrate(method, scene, h=h, steps=round(1 / h + log(1 / h)) + 2)
    except bs.integrators.StepError as error:
        run = error.trajectory
    y = run.y[0]
    shown = np.logical_and.accumulate((y > 0) & (y < 2 * REACH / h))
    return run.t[shown], y[shown]


def _solution(scene: Scene, h: float, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """The solution from y(0) = 1 at the times of steps and between them, up to a value of h y.

    Its end is the solution of s' = 1/f(y), y' = 1, which has no pole.
    """
    time = bs.Scene({"s": 1, "y": 1}, field={"s": 1 / scene.field[0], "y": "1"})
    end = bs.reference_solution(time, reach / h - 1, y0=[0, 1])[0, 0]
    t = np.append(np.arange(end * FINE // h + 1) * (h / FINE), end)
    return t, bs.reference_solution(scene, t, y0=[1])[0]


def columns(numbers: Riccati) -> dict[str, np.ndarray]:
    """The numerical solution, and the times and values of each curve."""
    table = {"t": numbers.t, "y": numbers.y}
    for terms, (t, y) in numbers.truncated.items():
        table |= {f"t_{terms}_terms": t, f"y_{terms}_terms": y}
    return table


def caption(numbers: Riccati) -> str:
    """The pole, and how far the curves are from the steps."""
    name, (t, distances) = name_of(numbers.method), numbers.distances()
    crossed = "steps across it" if numbers.t[-1] >= 1 else f"is shown up to t = {numbers.t[-1]:.3g}"
    return (
        "Lecture, figure 1 (HLW, figure IX.1.1). The solution of y' = y², y(0) = 1, has a pole at t = 1; the numerical "
        f"solution by {name} with h = {numbers.h:g} {crossed}. Curves: solutions of the modified equation, truncated "
        f"after {listed([str(n) for n in numbers.truncated])} terms. Their distances from the step at t = {t:.3g} are "
        f"{listed([scientific(d) for d in distances])}."
    )


def draw(numbers: Riccati, figure: Figure) -> None:
    """The curves, and the numerical solution as dots."""
    axes, h = figure.add_subplot(), numbers.h
    styles = (GREY, "--"), (VERMILION, (0, (1, 1))), (GREEN, "-."), (BLUE, "-")
    for (terms, (t, y)), (colour, dashes) in zip(numbers.truncated.items(), styles, strict=False):
        label = "1 term: exact solution" if terms == 1 else f"{terms} terms"
        axes.plot(t, y, color=colour, linestyle=dashes, label=label)
    axes.plot(numbers.t, numbers.y, "o", color=BLACK, label=f"{name_of(numbers.method)}, $h = {h:g}$", zorder=3)
    tops = [float(t[y <= SHOWN / h][-1]) for t, y in [(numbers.t, numbers.y), *numbers.truncated.values()]]
    axes.set(xlabel="time $t$", ylabel="$y$", xlim=(max(0, 1 - 16 * h), max(1, *tops) + 2 * h), ylim=(0, SHOWN / h))
    axes.legend(loc="upper left", title="modified equation truncated after", title_fontsize=7.5, alignment="left")
