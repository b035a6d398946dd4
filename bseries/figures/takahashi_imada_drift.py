"""Figure 7: the simplified Takahashi–Imada method on the pendulum, with and without energy drift."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import label_panels
from bseries.figures.options import read_number
from bseries.figures.words import scientific
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, GREEN, ORANGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


NUMBER = 7
TITLE = "Simplified Takahashi–Imada method on a pendulum, with and without a symmetric potential"
SIZE = (12.0, 11.0)

SIMPLIFIED, SYMPLECTIC = "simplified-takahashi-imada", "takahashi-imada"
LEAST_MOMENTUM = 2.3
"""Above it both pendulums rotate from q = 0."""
TERMS = 3
"""H + h²H₃."""
WINDOWS = 200
"""Number of windows for means and bands in the picture."""
COLOURS = (ORANGE, BLUE, GREEN)
DASHES = ("-", "-.", "--")
BAND = 0.3
"""Opacity of bands."""


class Drift(NamedTuple):
    """The modified energy along runs on a scene."""

    forwards: np.ndarray  # error along the simplified method, from p > 0
    backwards: np.ndarray  # the same from −p
    symplectic: np.ndarray  # error along the symplectic method, from p > 0
    slope: float  # predicted slope of the forward run


class TakahashiImadaDrift(NamedTuple):
    """Data of the figure."""

    h: float  # step size
    p: float  # momentum of the start at q = 0
    t: np.ndarray  # times of the steps
    perturbed: Drift  # pendulum with U = −cos q + sin(2q)/5
    pendulum: Drift  # pendulum with U = −cos q


def numbers(*, h: object = 0.2, p: object = 2.5, span: object = 5000) -> TakahashiImadaDrift:
    """Runs on both pendulums from q = 0 and momenta ±p, for which they rotate."""
    h, p = read_number(h, "h", 0.02, 0.4), read_number(p, "p", LEAST_MOMENTUM, 4)
    span = read_number(span, "span", 100, 1e5)
    t = np.arange(round(span / h) + 1) * h
    perturbed, pendulum = bs.scene("pendulum", effects=["asymmetry"]), bs.scene("pendulum")
    return TakahashiImadaDrift(h, p, t, _drift(perturbed, h, p, len(t) - 1), _drift(pendulum, h, p, len(t) - 1))


def _drift(scene: bs.Scene, h: float, momentum: float, steps: int) -> Drift:
    """The three runs on a scene, and the predicted slope."""
    energy = bs.modified_hamiltonian(bs.method(SYMPLECTIC), scene, TERMS).observer(h)

    def error(method: str, p: float) -> np.ndarray:
        run = bs.integrate(
            method, scene, h=h, steps=steps, y0=[p, 0], save_every=None, observe={"H": energy}, observe_every=1
        )
        return run.observed["H"] - run.observed["H"][0]

    report = bs.energy_drift(bs.method(SIMPLIFIED), scene, y0=[momentum, 0], h=h)
    errors = error(SIMPLIFIED, momentum), error(SIMPLIFIED, -momentum), error(SYMPLECTIC, momentum)
    return Drift(*errors, slope=report.slope())


def columns(numbers: TakahashiImadaDrift) -> dict[str, np.ndarray]:
    """The errors at all times, and the predicted slopes."""
    table = {"t": numbers.t}
    for name in ("perturbed", "pendulum"):
        drift: Drift = getattr(numbers, name)
        table |= {f"{key}_{name}": errors for key, errors in drift._asdict().items() if key != "slope"}
        table[f"predicted_slope_{name}"] = np.array([drift.slope])
    return table


def caption(numbers: TakahashiImadaDrift) -> str:
    """Predicted and fitted slopes."""
    drift, t = numbers.perturbed, numbers.t
    found = [scientific(slope(t, errors)) for errors in (drift.forwards, drift.backwards, drift.symplectic)]
    return (
        "Lecture, figure 7 (E. Hairer, R. I. McLachlan, R. D. Skeel, 2009). The error of the modified energy H + "
        "h²H₃ of the symplectic Takahashi–Imada method along the simplified method, which is not symplectic, with h "
        f"= {numbers.h:g} from q = 0 and p = ±{numbers.p:g}. Lines are means over {t[-1] / WINDOWS:g} units of time; "
        "bands show the least and the largest values in them. (a) U = −cos q + 0.2 sin 2q is not symmetric: each "
        "revolution of the pendulum changes the energy by −h⁴/288 ∫U‴U′² dq = −πh⁴/240 to leading order, with the "
        f"opposite sign in the other direction. Predicted slopes: ±{scientific(abs(drift.slope))}; found: {found[0]} "
        f"and {found[1]}, and {found[2]} with the symplectic method. (b) For U = −cos q the integral is zero; found: "
        f"{scientific(slope(t, numbers.pendulum.forwards))}."
    )


def draw(numbers: TakahashiImadaDrift, figure: Figure) -> None:
    """Above the pendulum whose energy drifts, below the other one."""
    (above, below), (h, p, t) = figure.subplots(2, height_ratios=(1.7, 1), sharex=True), numbers[:3]
    span = float(t[-1])
    label_panels((above, below), (rf"$U = -\cos\,q + 0.2\,\sin\,2q$, $h = {h:g}$", rf"$U = -\cos\,q$, $h = {h:g}$"))
    names = (f"simplified, $p_0 = {p:g}$", f"simplified, $p_0 = -{p:g}$", f"symplectic, $p_0 = {p:g}$")
    for errors, what, colour, dashes in zip(numbers.perturbed[:3], names, COLOURS, DASHES, strict=True):
        _draw_band(above, t, errors, what, colour, dashes)
    predicted = numbers.perturbed.slope
    for sign, label in ((1, "predicted"), (-1, None)):
        above.plot([0, span], [0, sign * predicted * span], ":", color=BLACK, linewidth=1.0, zorder=3, label=label)
    _draw_band(below, t, numbers.pendulum.forwards, None, COLOURS[0])
    band = below.fill_between([], [], color=COLOURS[0], alpha=BAND, label=f"range in {span / WINDOWS:g} units of time")
    below.set(xlabel="time $t$", xlim=(0, span), ylim=(0, 1.1 * numbers.pendulum.forwards.max()))
    for axes in (above, below):
        axes.set_ylabel("error of $H + h^2H_3$")
    below.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
    figure.legend(handles=[*above.lines[:4], band], loc="outside lower center", ncols=2)


def slope(t: np.ndarray, errors: np.ndarray) -> float:
    """The slope of the least-squares line through the errors."""
    return float(np.polyfit(t, errors, 1)[0])


def _draw_band(axes: Axes, t: np.ndarray, errors: np.ndarray, label: str | None, color: str, dashes: str = "-") -> None:
    """The mean, least and largest errors in windows."""
    width = max(1, len(t) // WINDOWS)
    t, errors = (values[: width * (len(t) // width)].reshape(-1, width) for values in (t, errors))
    axes.plot(t.mean(1), errors.mean(1), label=label, color=color, linestyle=dashes)
    axes.fill_between(t.mean(1), errors.min(1), errors.max(1), color=color, alpha=BAND, linewidth=0)
