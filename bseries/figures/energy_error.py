"""Figure 5: energy error on the pendulum with explicit and with symplectic Euler."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import check_number
from foundation.plotting import BLACK, BLUE, GREY, VERMILION

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure

    from integrators import Scene

NUMBER = 5
TITLE = "Pendulum: error of the total energy with explicit and symplectic Euler"
CAPTION = (
    "Lecture, figure 5. With the explicit Euler method the energy drifts. Its mean slope, h ⟨∇H·f₂⟩, is predicted by "
    "the modified equation. With the symplectic Euler method (implicit in p) the error stays bounded: to first order "
    "in h it is at most h/2 max|p sin q|, the size of the first term of the modified Hamiltonian, which is zero at "
    "the start, q = 0."
)
SIZE = (12.0, 10.0)

START = (2.5, 0.0)
SPAN, CLOSER = 200.0, 20.0
"""Length of the runs, and of the part shown in the lower panel."""
POINTS = 400
"""Points of the orbit in averages of periodic functions."""
MOST_DRAWN = 4000
"""Most points of a curve in the picture."""


class EnergyError(NamedTuple):
    """Data of the figure."""

    h: float  # step size
    t: np.ndarray  # times of the steps
    explicit: np.ndarray  # error of the energy with explicit Euler
    symplectic: np.ndarray  # the same with symplectic Euler
    slope: float  # mean drift of explicit Euler predicted by its modified equation
    bound: float  # first-order bound for symplectic Euler


def numbers(*, h: float = 0.005) -> EnergyError:
    """Both runs up to t = 200 from (p, q) = (2.5, 0), where the pendulum rotates."""
    import numpy as np

    h = check_number(h, "h", 0.0005, 0.05)
    pendulum = bs.scene("pendulum")

    def run(method: str) -> bs.Trajectory:
        return bs.integrate(method, pendulum, h=h, steps=round(SPAN / h), y0=START, observe="energy")

    explicit, symplectic = run("explicit-euler"), run("symplectic-euler-p")
    errors = [energy - energy[0] for energy in (explicit.observed["energy"], symplectic.observed["energy"])]
    orbit = _orbit(explicit.observed["energy"][0])
    bound = h / 2 * float(np.abs(orbit[0] * np.sin(orbit[1])).max())
    return EnergyError(h, explicit.t, *errors, slope=h * _mean_drift(pendulum, orbit), bound=bound)


def _orbit(energy: float) -> np.ndarray:
    """Points (p, q) of a period of the rotating pendulum, at equidistant angles."""
    import numpy as np

    q = np.linspace(0, 2 * np.pi, POINTS, endpoint=False)
    return np.array([np.sqrt(2 * (energy + np.cos(q))), q])


def _mean_drift(scene: Scene, orbit: np.ndarray) -> float:
    """The time average of ∇H·f₂ for explicit Euler, with dt proportional to dq/p."""
    f, f2 = bs.modified_field(bs.method("explicit-euler"), scene, 2).terms(orbit)
    drift = f[1] * f2[0] - f[0] * f2[1]  # ∇H = (q', −p')
    return float((drift / orbit[0]).sum() / (1 / orbit[0]).sum())


def columns(numbers: EnergyError) -> dict[str, np.ndarray]:
    """The errors at all times, and the predictions."""
    import numpy as np

    predicted = {"predicted_slope": np.array([numbers.slope]), "predicted_bound": np.array([numbers.bound])}
    return {"t": numbers.t, "explicit_euler": numbers.explicit, "symplectic_euler_p": numbers.symplectic, **predicted}


def draw(numbers: EnergyError, figure: Figure) -> None:
    """Above both errors, below the smaller one enlarged."""
    above, below = figure.subplots(2)
    thin = slice(None, None, max(1, len(numbers.t) // MOST_DRAWN))
    above.plot(numbers.t[thin], numbers.explicit[thin], color=VERMILION, label="explicit Euler")
    above.plot(numbers.t[thin], numbers.symplectic[thin], color=BLUE, linewidth=0.8, label="symplectic Euler")
    slope, label = numbers.slope, f"predicted: slope {numbers.slope:.4g}"
    above.plot([0, SPAN], [0, slope * SPAN], "--", color=BLACK, linewidth=0.7, label=label)
    above.set_title(f"pendulum from $(p, q) = (2.5, 0)$, $h = {numbers.h:g}$")
    above.legend(loc="upper left")
    closer, bound = numbers.t <= CLOSER, numbers.bound
    label = r"predicted: up to $\frac{h}{2}\,\max|p\,\sin q|$"
    below.axhspan(-bound, bound, color=GREY, alpha=0.25, linewidth=0, label=label)
    below.plot(numbers.t[closer], numbers.symplectic[closer], color=BLUE, label="symplectic Euler")
    below.set(ylim=(-2.1 * bound, 1.4 * bound))
    below.legend(loc="lower left", ncols=2)
    for axes, end in ((above, SPAN), (below, CLOSER)):
        axes.set(xlabel="time $t$", ylabel="error of the energy", xlim=(0, end))
