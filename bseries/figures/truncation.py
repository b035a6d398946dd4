"""Figure 3: truncations of the modified equation of the Lotka–Volterra equations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import bseries as bs
from bseries.figures.helpers import check_count, check_number, truncated_scene
from foundation.plotting import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NUMBER = 3
TITLE = "Lotka–Volterra: the modified equations truncated after h and after h²"
CAPTION = (
    "Lecture, figure 3 (HLW, figure IX.1.3). Two Euler methods from (p, q) = (2, 2), with the exact solution and the "
    "solutions of the modified equations truncated after h and after h². Below: their distances from the numerical "
    "solution, which are O(h), O(h²) and O(h³) for small h. At h = 0.1 the term with h brings no gain for the "
    "symplectic Euler method from t ≈ 5 on, because of the periods: 4.594 for the method, 4.615 for the given "
    "equations, 4.620 for the truncation after h, and 4.591 for the truncation after h²."
)
SIZE = (15.0, 13.0)

METHODS = {"explicit-euler": "(a) explicit Euler", "symplectic-euler-p": "(b) symplectic Euler"}
SPAN = 10.0
START = (2.0, 2.0)
FINE = 5
"""Points of the curves per step."""
MOST_TERMS = 6


class Truncation(NamedTuple):
    """Data of the figure."""

    h: float  # step size
    t: np.ndarray  # times of the steps
    fine_t: np.ndarray  # times of the curves: those of the steps and between them
    steps: dict[str, np.ndarray]  # numerical solutions (2, steps + 1) by method
    curves: dict[str, np.ndarray]  # solutions of the modified equations by method, (terms, 2, points)

    def distances(self, method: str) -> np.ndarray:
        """The distances |y_n − y(t_n)| of the steps of a method from the curves, (terms, steps + 1)."""
        import numpy as np

        return np.linalg.norm(self.curves[method][:, :, ::FINE] - self.steps[method], axis=1)


def numbers(*, h: float = 0.1, terms: int = 3) -> Truncation:
    """Steps up to t = 10, and the solutions of the equations truncated after 1 term (the exact one), 2, …"""
    import numpy as np

    h, terms = check_number(h, "h", 0.005, 0.12), check_count(terms, "terms", 1, MOST_TERMS)
    scene, count = bs.scene("lotka-volterra"), round(SPAN / h)
    runs = {name: bs.integrate(name, scene, h=h, steps=count, y0=START) for name in METHODS}
    fine_t = np.arange(count * FINE + 1) * (h / FINE)

    def curves(method: str) -> np.ndarray:
        scenes = (truncated_scene(method, scene, k + 1, h) for k in range(terms))
        return np.array([bs.reference_solution(truncated, fine_t, y0=START) for truncated in scenes])

    t = next(iter(runs.values())).t
    return Truncation(
        h, t, fine_t, {name: run.y for name, run in runs.items()}, {name: curves(name) for name in METHODS}
    )


def columns(numbers: Truncation) -> dict[str, np.ndarray]:
    """States and distances at the times of the steps, and the curves at theirs."""
    table = {"t": numbers.t, "t_curves": numbers.fine_t}
    for method in METHODS:
        key = method.replace("-", "_")
        table |= dict(zip((f"p_{key}", f"q_{key}"), numbers.steps[method], strict=True))
        for k, (curve, distance) in enumerate(zip(numbers.curves[method], numbers.distances(method), strict=True), 1):
            ending = f"{key}_{k}_terms"
            table |= {f"p_{ending}": curve[0], f"q_{ending}": curve[1], f"distance_{ending}": distance}
    return table


def draw(numbers: Truncation, figure: Figure) -> None:
    """Above the curves, below their distances from the steps."""
    panels = figure.subplots(2, 2, height_ratios=(1.5, 1))
    panels[1, 1].sharey(panels[1, 0])
    for (above, below), (method, label) in zip(panels.T, METHODS.items(), strict=True):
        _draw_curves(above, numbers, method)
        above.set_title(label)
        for distance, style in zip(numbers.distances(method), _styles(numbers), strict=True):
            below.semilogy(numbers.t[1:], distance[1:], **style)
        below.set(xlabel="time $t$", xlim=(0, SPAN))
    panels[0, 0].set_ylabel("$q$ (predators)")
    panels[1, 0].set_ylabel("distance from the steps")
    figure.legend(handles=panels[0, 0].lines, loc="outside lower center", ncols=4)


def _draw_curves(axes: Axes, numbers: Truncation, method: str) -> None:
    for curve, style in zip(numbers.curves[method], _styles(numbers), strict=True):
        axes.plot(*curve, **style)
    label = f"numerical solution, $h = {numbers.h:g}$"
    axes.plot(*numbers.steps[method], "o", color=BLACK, markersize=2.4, label=label)
    axes.set_xlabel("$p$ (prey)")


def _styles(numbers: Truncation) -> list[dict[str, Any]]:
    """The plot styles of the curves, by the number of terms."""
    terms = len(next(iter(numbers.curves.values())))
    labels = ["exact solution", "after $h$", *(f"after $h^{k}$" for k in range(2, MOST_TERMS))]
    colours = GREY, VERMILION, BLUE, GREEN, PURPLE, ORANGE
    dashes = "-", "-.", (0, (1, 1)), "--", (0, (6, 1)), (0, (4, 1, 1, 1, 1, 1))
    styles = zip(labels, colours, dashes, strict=True)
    return [{"label": label, "color": colour, "linestyle": dash} for label, colour, dash in styles][:terms]
