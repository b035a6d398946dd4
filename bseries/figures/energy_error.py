"""Figure 5: energy error of two methods on the pendulum, and what modified equations predict."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.exceptions import SeriesError
from bseries.figures.helpers import label_panels
from bseries.figures.options import read_methods, read_number, read_start
from bseries.figures.words import column_names, name_of, power_of_h, scientific, short_names, state
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, GREY, ORANGE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from integrators import Method, Scene

NUMBER = 5
TITLE = "Pendulum: error of the total energy with explicit and symplectic Euler"
SIZE = (12.0, 10.5)

METHODS = ("explicit-euler", "symplectic-euler-p")
START = (2.5, 0.0)
CLOSER = 0.1
"""Part of the time that the lower panel shows."""
POINTS = 400
"""Points of the exact orbit, over a period."""
FLOW = "dop853"
MOST_DRAWN = 4000
"""Most points of a curve in the picture."""
MOST_STEPS = 10_000_000


class Energy(NamedTuple):
    """A method on the pendulum."""

    method: Method
    order: int  # its order
    errors: np.ndarray  # error of the energy at all times
    verdict: str  # what `energy_drift` finds: bounded, linear drift, …
    slope: float  # mean slope predicted by the modified equation
    # least and largest error to first order in h^order, where the modified equation is Hamiltonian; else nan
    band: tuple[float, float]


class EnergyError(NamedTuple):
    """Data of the figure."""

    h: float  # step size
    y0: tuple[float, ...]  # start
    t: np.ndarray  # times of the steps
    runs: tuple[Energy, ...]  # both methods


def numbers(*, h: object = 0.005, methods: object = METHODS, y0: object = START, span: object = 200) -> EnergyError:
    """Runs of both methods; the pendulum from (p, q) = (2.5, 0) rotates."""
    import sympy

    from bseries.hamiltonians.orbits import closed_orbit

    h, span = read_number(h, "h", 0.0005, 0.5), read_number(span, "span", 10, 1e5)
    chosen, pendulum = read_methods(methods, 2), bs.scene("pendulum")
    start, steps = read_start(y0, pendulum), round(span / h)
    if steps > MOST_STEPS:
        raise SeriesError(f"span/h must be at most {MOST_STEPS:,} steps, but was {steps:,}")
    period = float(closed_orbit(pendulum, start, {1: 2 * sympy.pi}).period)  # until it turns back or over
    if not period:
        raise SeriesError(f"y0 must not be an equilibrium, but was {start}")
    orbit = bs.integrate(FLOW, pendulum, h=period / POINTS, steps=POINTS, y0=start).y
    runs = [
        bs.integrate(method, pendulum, h=h, steps=steps, y0=start, save_every=None, observe="energy", observe_every=1)
        for method in chosen
    ]
    errors = [run.observed["energy"] - run.observed["energy"][0] for run in runs]
    found = (_prediction(method, pendulum, h, orbit, error) for method, error in zip(chosen, errors, strict=True))
    return EnergyError(h, start, runs[0].observed_t, tuple(found))


def _prediction(method: Method, scene: Scene, h: float, orbit: np.ndarray, errors: np.ndarray) -> Energy:
    """The errors of a run with what the modified equation says of them."""
    report, order = bs.energy_drift(method, scene, y0=orbit[:, 0].tolist()), bs.order_of(method)
    band = float("nan"), float("nan")
    if report.power is None or report.power > order:
        terms = bs.modified_hamiltonian(method, scene, order + 1).terms(orbit)[order]
        changes = h**order * (terms[0] - terms)  # H̃ stays, so H changes by what the term takes away
        band = float(changes.min()), float(changes.max())
    return Energy(method, order, errors, report.verdict, report.slope(h), band)


def columns(numbers: EnergyError) -> dict[str, np.ndarray]:
    """The errors at all times, and the predictions."""
    table = {"t": numbers.t}
    for key, run in zip(column_names([run.method for run in numbers.runs]), numbers.runs, strict=True):
        table |= {f"error_{key}": run.errors, f"predicted_slope_{key}": np.array([run.slope])}
        table[f"predicted_band_{key}"] = np.array(run.band)
    return table


def caption(numbers: EnergyError) -> str:
    """What is predicted, and what is found."""
    text = f"Lecture, figure 5. Pendulum from (p, q) = {state(numbers.y0)} with h = {numbers.h:g}: error of the energy."
    for run in numbers.runs:
        name, largest = name_of(run.method), scientific(float(abs(run.errors).max()))
        if run.slope:
            found = scientific(float(np.polyfit(numbers.t, run.errors, 1)[0]))
            text += (
                f" With {name} the energy drifts: its modified equation predicts the mean slope "
                f"{scientific(run.slope)}, and the line fitted to the errors has the slope {found}."
            )
        elif not np.isnan(run.band).any():
            low, high = map(scientific, run.band)
            text += (
                f" The modified equation of {name} is Hamiltonian at {power_of_h(run.order)}: the size of this term of "
                f"the modified Hamiltonian predicts errors from {low} to {high}, and the largest one is {largest}."
            )
        else:
            text += f" With {name} no drift is predicted ({run.verdict}), and the largest error is {largest}."
    return text


def draw(numbers: EnergyError, figure: Figure) -> None:
    """Above both errors, below the smaller one enlarged."""
    above, below = figure.subplots(2)
    span = float(numbers.t[-1])
    thin = slice(None, None, max(1, len(numbers.t) // MOST_DRAWN))
    names = short_names([run.method for run in numbers.runs])
    for run, name, colour in zip(numbers.runs, names, (ORANGE, BLUE), strict=True):
        above.plot(numbers.t[thin], run.errors[thin], color=colour, linewidth=1.0, label=name)
    for run, dashes in zip(numbers.runs, ("--", ":"), strict=True):
        if run.slope:
            label = f"predicted slope {run.slope:.4g}"
            above.plot([0, span], [0, run.slope * span], dashes, color=BLACK, linewidth=0.8, label=label)
    run, name, colour = min(
        zip(numbers.runs, names, (ORANGE, BLUE), strict=True), key=lambda row: float(abs(row[0].errors).max())
    )
    shown = numbers.t <= CLOSER * span
    handles = list(above.lines)
    if run.band[0] < run.band[1]:
        handles.append(below.axhspan(*run.band, color=GREY, alpha=0.25, linewidth=0, label="predicted range"))
    below.plot(numbers.t[shown], run.errors[shown], color=colour, label=name)
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    label_panels((above, below), ("both methods", f"{name}, $t \\leq {CLOSER * span:g}$"))
    for axes, end in ((above, span), (below, CLOSER * span)):
        axes.set(xlabel="time $t$", ylabel="$H(p, q) - H(p_0, q_0)$", xlim=(0, end))
