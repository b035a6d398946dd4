"""Figure 10: linear error growth of symplectic methods on integrable systems, step by step on two rotors."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import growth_exponent, label_panels, logarithmic_indices
from bseries.figures.options import read_method, read_number
from bseries.figures.words import name_of, power
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, ORANGE, VERMILION, WHITE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from integrators import Method, Scene

NUMBER = 10
TITLE = "Two coupled rotors: linear growth of the global error, by the steps of the proof of theorem 7"
SIZE = (17.0, 19.0)

SYMPLECTIC, OTHER = "stormer-verlet", "kutta3"
"""Störmer–Verlet, whose modified Hamiltonian has even powers of h; and a method to compare with."""
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


BOXES = (
    ((0.14, 0.88), "integrable\nHamiltonian system\n$H(p, q)$"),
    ((0.5, 0.88), "numerical solution\n$(p_n, q_n)$"),
    ((0.86, 0.88), "modified\nHamiltonian system\n$\\widetilde{H}(p, q)$"),
    ((0.14, 0.44), "Hamiltonian system\n$K(a)$\n$a = \\mathrm{const},\\ \\dot{\\theta} = \\omega(a)$"),
    ((0.86, 0.44), "modified\nHamiltonian system\n$K(a) + \\varepsilon K_1(a, \\theta) + \\ldots$"),
    (
        (0.76, 0.07),
        "$K(b) + \\varepsilon \\overline{K}_1(b) + \\ldots + \\varepsilon^N \\overline{K}_N(b)"
        " + \\varepsilon^{N+1} R(b, \\varphi)$",
    ),
    (
        (0.24, 0.07),
        "$\\|b(t) - b_0\\| \\leq C\\,t\\,\\varepsilon^{N+1}$\n"
        "$\\|\\varphi(t) - \\varphi_0 - \\omega_\\varepsilon(b_0)\\,t\\| \\leq C\\,(t + t^2)\\,\\varepsilon^{N+1}$",
    ),
)
"""Places and contents of the boxes of the diagram."""
ARROWS = (
    ((0.27, 0.88), (0.395, 0.88), "symplectic\nmethod", (0.332, 0.965)),
    ((0.605, 0.88), (0.73, 0.88), "backward\nerror analysis", (0.667, 0.965)),
    ((0.14, 0.745), (0.14, 0.585), "", (0, 0)),
    ((0.86, 0.745), (0.86, 0.585), "", (0, 0)),
    ((0.35, 0.665), (0.16, 0.665), "", (0, 0)),
    ((0.65, 0.665), (0.84, 0.665), "action–angle variables\n$(p, q) = \\psi(a, \\theta)$", (0.5, 0.665)),
    ((0.86, 0.305), (0.86, 0.14), "Lindstedt–Poincaré series\n$(a, \\theta) = \\chi(b, \\varphi)$", (0.69, 0.225)),
    ((0.525, 0.07), (0.475, 0.07), "", (0, 0)),
)
"""Start, end, text and its place for the arrows."""


class LinearErrorGrowth(NamedTuple):
    """Data of the figure: at all times the largest distances up to then."""

    method: Method  # the method to compare with
    h: float  # step size
    t: np.ndarray  # times
    symplectic: np.ndarray  # global error of Störmer–Verlet
    other: np.ndarray  # that of the other method
    predicted: np.ndarray  # distance of Störmer–Verlet from the solutions after N = 1, 2 terms, (terms, times)
    actions: np.ndarray  # changes of the actions with Störmer–Verlet
    other_actions: np.ndarray  # those with the other method
    new_actions: np.ndarray  # changes of the actions b after N = 1, 2 terms with Störmer–Verlet, (terms, times)


def numbers(*, h: object = 0.02, method: object = OTHER) -> LinearErrorGrowth:
    """The steps of the proof: runs, modified Hamiltonian, action-angle variables, Lindstedt–Poincaré series, back."""
    h, other = read_number(h, "h", 0.01, 0.05), read_method(method)
    rotors, change = scene(), bs.hamiltonians.harmonic_action_angle(OLD, NEW, [1, 1])
    start = np.array(START)
    first, second = (
        bs.integrate(method, rotors, h=h, steps=round(SPAN / h), y0=change.to_old(start), save_every=EVERY)
        for method in (SYMPLECTIC, other)
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
    errors = _largest(first.y - exact), _largest(second.y - exact), np.array(predicted)
    actions = _changes(states), _changes(_action_angles(second.y)), np.array(new)
    return LinearErrorGrowth(other, h, first.t, *errors, *actions)


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
    return state[:, None] + np.concatenate([0 * omega, omega])[:, None] * t


def _action_angles(states: np.ndarray) -> np.ndarray:
    """Actions and angles of states (p, q), (4, times)."""
    p, q = np.split(states, 2)
    return np.vstack([(p**2 + q**2) / 2, np.arctan2(q, p)])


def _changes(states: np.ndarray) -> np.ndarray:
    """The largest changes of actions so far."""
    return _largest(states[:2] - states[:2, :1])


def _largest(differences: np.ndarray) -> np.ndarray:
    """The largest Euclidean norms so far."""
    return np.maximum.accumulate(np.linalg.norm(differences, axis=0))


def columns(numbers: LinearErrorGrowth) -> dict[str, np.ndarray]:
    """All curves, as functions of time."""
    other = numbers.method.name or "other"
    table = {"t": numbers.t, f"error_{SYMPLECTIC}": numbers.symplectic, f"error_{other}": numbers.other}
    table |= {f"error_after_{n}_terms": row for n, row in enumerate(numbers.predicted, 1)}
    table |= {f"actions_{SYMPLECTIC}": numbers.actions, f"actions_{other}": numbers.other_actions}
    table |= {f"new_actions_after_{n}_terms": row for n, row in enumerate(numbers.new_actions, 1)}
    return {name.replace("-", "_"): column for name, column in table.items()}


def caption(numbers: LinearErrorGrowth) -> str:
    """The diagram, and what the curves are."""
    grown = [power("t", _exponent(numbers, curve)) for curve in (numbers.symplectic, numbers.other)]
    return (
        "Lecture, figure 10. (a) The proof of theorem 7 as the lecture draws it, with ε = h^r for a method of order "
        "r. (b), (c) The same steps as a computation for two coupled rotors, H = a₁ + 3a₂/2 + a₁a₂/2 with a_i = "
        f"(p_i² + q_i²)/2 and ω₂/ω₁ the golden ratio, and Störmer–Verlet with h = {numbers.h:g}, where r = 2. Drawn "
        "are largest distances up to each time. Upper curves: (b) of the numerical solutions from the exact one, "
        f"which grow like {grown[0]} for Störmer–Verlet and like {grown[1]} for {name_of(numbers.method)}; (c) of the "
        "actions a from their values at the start. Lower curves, Störmer–Verlet only: (b) of the numerical solution "
        "from b = const, φ = φ₀ + ω(b)t after N terms of the Lindstedt–Poincaré series, transformed back; (c) of the "
        "new actions b from their values at the start."
    )


def _exponent(numbers: LinearErrorGrowth, curve: np.ndarray) -> float:
    """The exponent of t in a curve."""
    return growth_exponent(numbers.t, curve, FIT_FROM, SPAN, SHOWN)


def draw(numbers: LinearErrorGrowth, figure: Figure) -> None:
    """Above the diagram; below global errors and actions."""
    panels = figure.subplot_mosaic([["a", "a"], ["b", "c"]], height_ratios=(1.15, 1))
    diagram, left, right = panels.values()
    label_panels(panels.values(), ("idea of the proof", "solutions", "actions"))
    diagram.set(xlim=(0, 1), ylim=(-0.05, 1))
    diagram.axis("off")
    boxed = {"boxstyle": "round,pad=0.5", "facecolor": WHITE, "edgecolor": BLACK, "linewidth": 0.7}
    for (x, y), text in BOXES:
        diagram.text(x, y, text, ha="center", va="center", bbox=boxed, linespacing=1.5)
    for start, end, text, (x, y) in ARROWS:
        diagram.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "linewidth": 0.8, "facecolor": BLACK})
        diagram.text(x, y, text, ha="center", va="center", fontsize=7.5, linespacing=1.4)
    _draw_curves(left, numbers, numbers.other, numbers.symplectic, numbers.predicted, "after")
    _draw_curves(right, numbers, numbers.other_actions, numbers.actions, numbers.new_actions, "actions $b$ after")
    left.set_ylabel("largest error so far")
    right.set_ylabel("largest change so far")


def _draw_curves(
    axes: Axes, numbers: LinearErrorGrowth, other: np.ndarray, symplectic: np.ndarray, series: np.ndarray, what: str
) -> None:
    rows = logarithmic_indices(len(numbers.t), SHOWN)
    terms = (f"{what} {n} term{'s' * (n > 1)}" for n in range(1, TERMS + 1))
    names = name_of(numbers.method), "Störmer–Verlet", *terms
    styles = (ORANGE, "--"), (BLUE, "-"), (BLACK, "-."), (VERMILION, ":")
    for curve, name, (colour, dashes) in zip((other, symplectic, *series), names, styles, strict=True):
        label = f"{name}: $t^{{{_exponent(numbers, curve):.2f}}}$"
        axes.loglog(numbers.t[rows], curve[rows], linestyle=dashes, color=colour, label=label)
    axes.set(xlabel="time $t$", xlim=(numbers.t[1], SPAN))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2))
