"""Figure 10: linear error growth of symplectic methods on integrable systems, step by step on two rotors."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import check_number, growth_exponent, logarithmic_indices
from foundation.plotting import BLUE, GREEN, PURPLE, VERMILION

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from integrators import Scene

NUMBER = 10
TITLE = "Two coupled rotors: linear growth of the global error, by the steps of the proof of theorem 7"
CAPTION = (
    "Lecture, figure 10: its diagram as a computation. The system H = a₁ + 3a₂/2 + a₁a₂/2 with a_i = (p_i² + q_i²)/2 "
    "is integrable; ω₂/ω₁ is the golden ratio. The angles are removed from the modified Hamiltonian of "
    "Störmer–Verlet, computed through h⁴ in action-angle variables, by the Lindstedt–Poincaré series with N terms. In "
    "the new variables the actions b are constant and φ = φ₀ + ω(b)t. (a) The largest global error so far grows "
    "linearly for Störmer–Verlet and quadratically for Kutta's method of order 3, which is neither symplectic nor "
    "symmetric. The other curves show the distance of Störmer–Verlet from the solutions with N terms, transformed "
    "back. (b) Changes of the actions a and of the new actions b."
)
SIZE = (17.0, 10.5)

SYMPLECTIC, OTHER = "stormer-verlet", "kutta3"
OLD, NEW = {"p": 2, "q": 2}, {"a": 2, "theta": 2}
ENERGY = "{0} + 3/2*{1} + {0}*{1}/2"
START = (1.0, 2 * 5**0.5 - 4, 0.5, 1.0)
"""Actions and angles. The frequencies 1 + a₂/2 and 3/2 + a₁/2 are 2/φ and 2, where φ is the golden ratio."""
SPAN, FIT_FROM = 1000.0, 30.0
TERMS = 2
"""Powers h² and h⁴ of the modified Hamiltonian, ε and ε²."""
EVERY = 5
"""Steps between observed states."""
SHOWN = 150
"""Number of points of a curve."""


class LinearErrorGrowth(NamedTuple):
    """Data of the figure: at all times the largest distances up to then."""

    h: float  # step size
    t: np.ndarray  # times
    symplectic: np.ndarray  # global error of Störmer–Verlet
    other: np.ndarray  # that of Kutta's method of order 3
    predicted: np.ndarray  # distance of Störmer–Verlet from the solutions after N = 1, 2 terms, (terms, times)
    actions: np.ndarray  # changes of the actions with Störmer–Verlet
    other_actions: np.ndarray  # those with Kutta's method
    new_actions: np.ndarray  # changes of the actions b after N = 1, 2 terms with Störmer–Verlet, (terms, times)


def numbers(*, h: float = 0.02) -> LinearErrorGrowth:
    """The steps of the proof: runs, modified Hamiltonian, action-angle variables, Lindstedt–Poincaré series, back."""
    import numpy as np

    h = check_number(h, "h", 0.01, 0.05)
    rotors, change = scene(), bs.hamiltonians.harmonic_action_angle(OLD, NEW, [1, 1])
    start = np.array(START)
    first, second = (
        bs.integrate(method, rotors, h=h, steps=round(SPAN / h), y0=change.to_old(start), save_every=EVERY)
        for method in (SYMPLECTIC, OTHER)
    )
    exact = change.to_old(_rotating(start, _frequencies(change.hamiltonian(rotors), start), first.t))
    states, predicted, new = _action_angles(first.y), [], []
    for form in normal_forms(rotors, change):
        eps = h**2
        b = form.to_normal(start, eps)
        omega = _frequencies(form.normal_scene.with_parameters(eps=eps), b)
        solution = change.to_old(form.from_normal(_rotating(b, omega, first.t), eps))
        predicted.append(_largest(first.y - solution))
        new.append(_changes(form.to_normal(states, eps)))
    return LinearErrorGrowth(
        h,
        first.t,
        _largest(first.y - exact),
        _largest(second.y - exact),
        np.array(predicted),
        _changes(states),
        _changes(_action_angles(second.y)),
        np.array(new),
    )


def scene() -> Scene:
    """The rotors in Cartesian coordinates, to which the method is applied."""
    actions = [f"(p{i}^2 + q{i}^2)/2" for i in (1, 2)]
    return bs.Scene(OLD, hamiltonian=ENERGY.format(*actions), name="rotors")


def normal_forms(rotors: Scene, change: bs.hamiltonians.CoordinateChange) -> list[bs.hamiltonians.NormalForm]:
    """The modified Hamiltonian of Störmer–Verlet without angles, through ε, ε², … with ε = h²."""
    energy = bs.modified_hamiltonian(bs.method(SYMPLECTIC), rotors, 2 * TERMS + 1)
    terms = (bs.Scene(OLD, hamiltonian=energy.symbolic(2 * k)) for k in range(1, TERMS + 1))
    perturbations = [change.hamiltonian(term).hamiltonian for term in terms]
    integrable = change.hamiltonian(rotors)
    return [
        bs.hamiltonians.lindstedt_poincare(integrable, n, perturbations=perturbations[:n]) for n in range(1, TERMS + 1)
    ]


def _frequencies(system: Scene, state: np.ndarray) -> np.ndarray:
    """The velocities of the angles."""
    return bs.integrators.right_hand_side(system)(0.0, state)[2:]


def _rotating(state: np.ndarray, omega: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Constant actions and angles with frequencies ω, (4, times)."""
    import numpy as np

    return state[:, None] + np.concatenate([0 * omega, omega])[:, None] * t


def _action_angles(states: np.ndarray) -> np.ndarray:
    import numpy as np

    p, q = np.split(states, 2)
    return np.vstack([(p**2 + q**2) / 2, np.arctan2(q, p)])


def _changes(states: np.ndarray) -> np.ndarray:
    """The largest changes of actions so far."""
    return _largest(states[:2] - states[:2, :1])


def _largest(differences: np.ndarray) -> np.ndarray:
    """The largest Euclidean norms so far."""
    import numpy as np

    return np.maximum.accumulate(np.linalg.norm(differences, axis=0))


def columns(numbers: LinearErrorGrowth) -> dict[str, np.ndarray]:
    """All curves, as functions of time."""
    table = {"t": numbers.t, f"error_{SYMPLECTIC}": numbers.symplectic, f"error_{OTHER}": numbers.other}
    table |= {f"error_after_{n}_terms": row for n, row in enumerate(numbers.predicted, 1)}
    table |= {f"actions_{SYMPLECTIC}": numbers.actions, f"actions_{OTHER}": numbers.other_actions}
    table |= {f"new_actions_after_{n}_terms": row for n, row in enumerate(numbers.new_actions, 1)}
    return {name.replace("-", "_"): column for name, column in table.items()}


def draw(numbers: LinearErrorGrowth, figure: Figure) -> None:
    """Left global errors, right the actions."""
    left, right = figure.subplots(1, 2)
    _draw_curves(left, numbers, numbers.other, numbers.symplectic, numbers.predicted, "solution after")
    _draw_curves(right, numbers, numbers.other_actions, numbers.actions, numbers.new_actions, "new actions,")
    left.set(title="(a) solutions", ylabel="largest error so far")
    right.set(title="(b) actions", ylabel="largest change so far")


def _draw_curves(
    axes: Axes, numbers: LinearErrorGrowth, other: np.ndarray, symplectic: np.ndarray, series: np.ndarray, what: str
) -> None:
    rows = logarithmic_indices(len(numbers.t), SHOWN)
    names = "Kutta's method", "Störmer–Verlet", *(f"{what} $N = {n}$" for n in range(1, TERMS + 1))
    styles = (VERMILION, "--"), (BLUE, "-"), (GREEN, "-."), (PURPLE, ":")
    for curve, name, (colour, dashes) in zip((other, symplectic, *series), names, styles, strict=True):
        exponent = growth_exponent(numbers.t, curve, FIT_FROM, SPAN, SHOWN)
        label = f"{name}: $t^{{{exponent:.2f}}}$"
        axes.loglog(numbers.t[rows], curve[rows], linestyle=dashes, color=colour, label=label)
    axes.set(xlabel="time $t$", xlim=(numbers.t[1], SPAN))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17))
