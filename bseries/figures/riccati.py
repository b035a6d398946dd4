"""Figure 1: the modified equation of explicit Euler on y' = y², truncated after 1 to 4 terms."""

from __future__ import annotations

from math import log
from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import check_number, truncated_scene
from foundation.plotting import BLACK, BLUE, GREEN, GREY, VERMILION

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure

    from integrators import Scene

NUMBER = 1
TITLE = "y' = y²: explicit Euler and the modified equation after 1 to 4 terms"
CAPTION = (
    "Lecture, figure 1 (HLW, figure IX.1.1). The solution of y' = y², y(0) = 1, has a pole at t = 1; the explicit "
    "Euler method steps across it. The solutions of the modified equation with 1, 2, 3 and 4 terms follow its steps "
    "more and more closely."
)
SIZE = (12.0, 8.0)

METHOD = "explicit-euler"
TERMS = (1, 2, 3, 4)
REACH = 0.7
"""Largest h y: with 4 terms the modified field is positive up to h y = 0.74, where solutions come to rest."""
SHOWN = 0.4
"""Largest h y in the picture."""
FINE = 4
"""Points of the curves per step."""


class Riccati(NamedTuple):
    """Data of the figure."""

    h: float  # step size
    t: np.ndarray  # times of the steps
    y: np.ndarray  # numerical solution
    # solutions of the truncated equations as pairs of times and values, by the number of terms
    truncated: dict[int, tuple[np.ndarray, np.ndarray]]


def numbers(*, h: float = 0.02) -> Riccati:
    """Steps of explicit Euler for h y < 1.4, and curves up to h y = 0.7."""
    h = check_number(h, "h", 0.002, 0.1)
    riccati = bs.scene("riccati")
    run = bs.integrate(METHOD, riccati, h=h, steps=round(1 / h + log(1 / h)) + 2)
    shown = run.y[0] < 2 * REACH / h
    curves = {terms: _solution(truncated_scene(METHOD, riccati, terms, h), h) for terms in TERMS}
    return Riccati(h, run.t[shown], run.y[0, shown], curves)


def _solution(scene: Scene, h: float) -> tuple[np.ndarray, np.ndarray]:
    """The solution from y(0) = 1 at the times of steps and between them, up to h y = REACH.

    Its end is the solution of t' = 1/f(y), y' = 1, which has no pole.
    """
    import numpy as np

    time = bs.Scene({"t": 1, "y": 1}, field={"t": 1 / scene.field[0], "y": "1"})
    end = bs.reference_solution(time, REACH / h - 1, y0=[0, 1])[0, 0]
    t = np.append(np.arange(end * FINE // h + 1) * (h / FINE), end)
    return t, bs.reference_solution(scene, t, y0=[1])[0]


def columns(numbers: Riccati) -> dict[str, np.ndarray]:
    """The numerical solution, and the times and values of each curve."""
    table = {"t": numbers.t, "explicit_euler": numbers.y}
    for terms, (t, y) in numbers.truncated.items():
        table |= {f"t_{terms}_terms": t, f"y_{terms}_terms": y}
    return table


def draw(numbers: Riccati, figure: Figure) -> None:
    """The curves, and the numerical solution as dots."""
    axes, h = figure.add_subplot(), numbers.h
    styles = {1: (GREY, "--"), 2: (VERMILION, (0, (1, 1))), 3: (GREEN, "-."), 4: (BLUE, "-")}
    for terms, (t, y) in numbers.truncated.items():
        colour, dashes = styles[terms]
        label = "1 term: exact solution" if terms == 1 else f"{terms} terms"
        axes.plot(t, y, color=colour, linestyle=dashes, label=label)
    axes.plot(numbers.t, numbers.y, "o", color=BLACK, label=f"explicit Euler, $h = {h:g}$", zorder=3)
    axes.set(xlabel="time $t$", ylabel="$y$", xlim=(max(0, 1 - 16 * h), 1 + 2.5 * h), ylim=(0, SHOWN / h))
    axes.legend(loc="upper left", title="modified equation truncated after", title_fontsize=7.5, alignment="left")
