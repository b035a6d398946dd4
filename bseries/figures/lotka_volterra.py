"""Figure 2: two Euler methods on the Lotka–Volterra equations, with the exact and the modified flow."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import check_number, truncated_scene
from foundation.plotting import BLACK, BLUE, GREY, VERMILION

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from integrators import Scene

NUMBER = 2
TITLE = "Lotka–Volterra: explicit and symplectic Euler in the exact and in the modified flow"
CAPTION = (
    "Lecture, figure 2 (HLW, figure IX.1.2). Numerical solutions, started at the large dots, leave the curves of the "
    "exact flow (left) but stay close to those of the modified equation truncated after h (right). For the symplectic "
    "Euler method, implicit in p, the modified curves are closed. The initial values of the lecture are not known."
)
SIZE = (13.0, 12.5)

METHODS = {"explicit-euler": "explicit Euler", "symplectic-euler-p": "symplectic Euler"}
SPAN = 10.0
LINE = 2.0
"""All starts lie on the line q = 2."""
STARTS = {"explicit-euler": (2.0,), "symplectic-euler-p": (2.0, 3.5)}
CLOSED = (2.0, 3.5, 1.25, 1.6, 2.45, 2.95, 4.1, 4.8)
"""Starts of closed curves, those of the numerical solutions first."""
SPIRALS = (2.0, 2.38)
"""Starts of spirals, half a period apart."""
AROUND, INWARDS, OUTWARDS = 6.5, -16.0, 10.6
"""Lengths of curves: slightly more than a period of the closed ones; spirals in both directions."""
POINTS = 500


class LotkaVolterra(NamedTuple):
    """Data of the figure."""

    h: float  # step size
    steps: dict[str, np.ndarray]  # numerical solutions by method, (starts, 2, steps + 1)
    exact: np.ndarray  # curves of the exact flow, (curves, 2, points)
    # curves of the modified flows, by method. The first curves start where the steps do
    modified: dict[str, np.ndarray]


def numbers(*, h: float = 0.1) -> LotkaVolterra:
    """Steps of both methods up to t = 10, and the flows around them."""
    h = check_number(h, "h", 0.005, 0.12)
    scene = bs.scene("lotka-volterra")
    explicit, symplectic = METHODS
    return LotkaVolterra(
        h,
        {name: _steps(scene, name, h) for name in METHODS},
        _curves(scene, CLOSED, AROUND),
        {
            explicit: _curves(truncated_scene(explicit, scene, 2, h), SPIRALS, INWARDS, OUTWARDS),
            symplectic: _curves(truncated_scene(symplectic, scene, 2, h), CLOSED, AROUND),
        },
    )


def _steps(scene: Scene, method: str, h: float) -> np.ndarray:
    """The numerical solutions of a method."""
    import numpy as np

    starts = [(p, LINE) for p in STARTS[method]]
    return np.array([bs.integrate(method, scene, h=h, steps=round(SPAN / h), y0=start).y for start in starts])


def _curves(flow: Scene, starts: tuple[float, ...], *ends: float) -> np.ndarray:
    """The curves of a flow through points on the line q = 2, from the first end over the start to the last one."""
    import numpy as np

    def curve(p: float, end: float) -> np.ndarray:
        return bs.reference_solution(flow, np.linspace(0, end, POINTS), y0=[p, LINE], digits=16)

    def joined(p: float) -> np.ndarray:
        first, *rest = (curve(p, end) for end in ends)
        return np.hstack([first[:, ::-1], *rest])

    return np.array([joined(p) for p in starts])


def columns(numbers: LotkaVolterra) -> dict[str, np.ndarray]:
    """The states of the numerical solutions and of all curves, by number."""
    modified = {f"modified_{name}": curves for name, curves in numbers.modified.items()}
    table = {}
    for name, curves in {**numbers.steps, "exact": numbers.exact, **modified}.items():
        for k, (p, q) in enumerate(curves, 1):
            key = f"{name}_{k}".replace("-", "_")
            table |= {f"p_{key}": p, f"q_{key}": q}
    return table


def draw(numbers: LotkaVolterra, figure: Figure) -> None:
    """A row for each method: its steps with the exact and with the modified flow."""
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for row, (method, label) in zip(panels, METHODS.items(), strict=True):
        flows = ("exact flow", numbers.exact), ("modified flow", numbers.modified[method])
        for axes, (flow, curves) in zip(row, flows, strict=True):
            _draw_panel(axes, curves, numbers.steps[method])
            axes.set_title(f"{label}, {flow}")
            axes.label_outer()
    shown = panels[0, 0].lines[-3:]
    figure.legend(handles=shown, loc="outside lower center", ncols=len(shown))


def _draw_panel(axes: Axes, curves: np.ndarray, runs: np.ndarray) -> None:
    for curve in curves[len(runs) :]:
        axes.plot(*curve, color=GREY, linewidth=0.7)
    for curve, states in zip(curves, runs, strict=False):
        axes.plot(*curve, color=BLUE, label="flow through the start")
        axes.plot(*states, "o", color=VERMILION, markersize=2.4, label="numerical solution")
        axes.plot(*states[:, 0], "o", color=BLACK, markersize=5, label="start")
    axes.set(xlabel="$p$ (prey)", ylabel="$q$ (predators)", xlim=(0, 5), ylim=(0, 6.5))
