"""Figure 7: the simplified Takahashi–Imada method on the pendulum, with and without energy drift."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import check_number
from foundation.plotting import BLACK, BLUE, GREEN, VERMILION

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from integrators import Scene

NUMBER = 7
TITLE = "Simplified Takahashi–Imada method on a pendulum, with and without a symmetric potential"
CAPTION = (
    "Lecture, figure 7 (E. Hairer, R. I. McLachlan, R. D. Skeel, 2009). The error of the modified energy H + h²H₃ of "
    "the symplectic Takahashi–Imada method along the simplified method, which is not symplectic. Lines are means over "
    "25 units of time; bands show the least and the largest values in them. Where the potential U is not symmetric, "
    "each revolution of the pendulum changes the energy by −h⁴/288 ∫U‴U′² dq = −πh⁴/240 to leading order, with the "
    "opposite sign in the other direction. For U = −cos q the integral is zero."
)
SIZE = (12.0, 11.0)

SIMPLIFIED, SYMPLECTIC = "simplified-takahashi-imada", "takahashi-imada"
SPAN = 5000.0
MOMENTUM = 2.5
"""Runs start from q = 0 with this momentum, for which the pendulum rotates."""
TERMS = 3
"""H + h²H₃."""
WINDOWS = 200
"""Number of windows for means and bands in the picture."""


class Drift(NamedTuple):
    """The modified energy along runs on a scene."""

    forwards: np.ndarray  # error along the simplified method, from p = 2.5
    backwards: np.ndarray  # the same from p = −2.5
    symplectic: np.ndarray  # error along the symplectic method, from p = 2.5
    slope: float  # predicted slope of the forward run


class TakahashiImadaDrift(NamedTuple):
    """Data of the figure."""

    h: float  # step size
    t: np.ndarray  # times of the steps
    perturbed: Drift  # pendulum with U = −cos q + sin(2q)/5
    pendulum: Drift  # pendulum with U = −cos q


def numbers(*, h: float = 0.2) -> TakahashiImadaDrift:
    """Runs up to t = 5000 on both pendulums."""
    import numpy as np

    h = check_number(h, "h", 0.02, 0.4)
    t = np.arange(round(SPAN / h) + 1) * h
    perturbed, pendulum = bs.scene("pendulum", effects=["asymmetry"]), bs.scene("pendulum")
    return TakahashiImadaDrift(h, t, _drift(perturbed, h), _drift(pendulum, h))


def _drift(scene: Scene, h: float) -> Drift:
    energy = bs.modified_hamiltonian(bs.method(SYMPLECTIC), scene, TERMS).observer(h)

    def error(method: str, p: float) -> np.ndarray:
        run = bs.integrate(
            method,
            scene,
            h=h,
            steps=round(SPAN / h),
            y0=[p, 0],
            save_every=None,
            observe={"H": energy},
            observe_every=1,
        )
        return run.observed["H"] - run.observed["H"][0]

    report = bs.energy_drift(bs.method(SIMPLIFIED), scene, y0=[MOMENTUM, 0], h=h)
    errors = error(SIMPLIFIED, MOMENTUM), error(SIMPLIFIED, -MOMENTUM), error(SYMPLECTIC, MOMENTUM)
    return Drift(*errors, slope=report.slope())


def columns(numbers: TakahashiImadaDrift) -> dict[str, np.ndarray]:
    """The errors at all times, and the predicted slopes."""
    import numpy as np

    table = {"t": numbers.t}
    for name in ("perturbed", "pendulum"):
        drift: Drift = getattr(numbers, name)
        table |= {f"{key}_{name}": errors for key, errors in drift._asdict().items() if key != "slope"}
        table[f"predicted_slope_{name}"] = np.array([drift.slope])
    return table


def draw(numbers: TakahashiImadaDrift, figure: Figure) -> None:
    """Above the pendulum whose energy drifts, below the other one."""
    (above, below), (h, t) = figure.subplots(2, height_ratios=(1.7, 1), sharex=True), numbers[:2]
    predicted = numbers.perturbed.slope
    for sign, label in ((1, f"predicted: slopes $\\mp${_written(-predicted)}"), (-1, None)):
        above.plot([0, SPAN], [0, sign * predicted * SPAN], "--", color=BLACK, linewidth=0.8, zorder=3, label=label)
    forwards, backwards, symplectic, _ = numbers.perturbed
    for errors, what, colour in (
        (forwards, "simplified, $p_0 = 2.5$", VERMILION),
        (backwards, "simplified, $p_0 = -2.5$", BLUE),
        (symplectic, "symplectic, $p_0 = 2.5$", GREEN),
    ):
        _draw_band(above, t, errors, colour, f"{what}: slope {_written(slope(t, errors))}")
    forwards = numbers.pendulum.forwards
    label = f"simplified, $p_0 = 2.5$: mean, slope {_written(slope(t, forwards))}"
    _draw_band(below, t, forwards, VERMILION, label, f"least and largest in {SPAN / WINDOWS:g} units of time")
    above.set(
        title=f"$U = -\\cos\\,q + 0.2\\,\\sin\\,2q$, $h = {h:g}$",
        ylim=(1.1 * predicted * SPAN, -2.1 * predicted * SPAN),
    )
    below.set(title=f"$U = -\\cos\\,q$, $h = {h:g}$", xlabel="time $t$", xlim=(0, SPAN), ylim=(0, 1.6 * forwards.max()))
    for axes in (above, below):
        axes.set_ylabel("error of $H + h^2H_3$")
        axes.legend(loc="upper left")
    below.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)


def slope(t: np.ndarray, errors: np.ndarray) -> float:
    """The slope of the least-squares line through the errors."""
    import numpy as np

    return float(np.polyfit(t, errors, 1)[0])


def _draw_band(
    axes: Axes, t: np.ndarray, errors: np.ndarray, colour: str, label: str, band_label: str | None = None
) -> None:
    """The mean, least and largest errors in windows."""
    width = max(1, len(t) // WINDOWS)
    t, errors = (values[: width * (len(t) // width)].reshape(-1, width) for values in (t, errors))
    axes.plot(t.mean(1), errors.mean(1), color=colour, label=label)
    axes.fill_between(t.mean(1), errors.min(1), errors.max(1), color=colour, alpha=0.3, linewidth=0, label=band_label)


def _written(value: float) -> str:
    """A number with a power of ten, for labels."""
    digits, power = f"{value:.2e}".split("e")
    return f"${digits}\\cdot10^{{{int(power)}}}$"
