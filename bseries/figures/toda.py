"""Figure 9: errors of the solution and of the conserved eigenvalues on the Toda lattice."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import power_exponent
from foundation.plotting import BLUE, VERMILION

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure

NUMBER = 9
TITLE = "Toda lattice of three particles: errors of the eigenvalues and of the solution, RK4 and Störmer–Verlet"
CAPTION = (
    "Lecture, figure 9 (HLW, sections X.1.5 and X.3). The eigenvalues of Flaschka's matrix L(p, q) are first "
    "integrals. With Störmer–Verlet, which is symplectic, their error stays bounded and the global error grows "
    "linearly, as theorem 7 states for non-resonant frequencies. With RK4 the error of the eigenvalues grows linearly "
    "and the global error quadratically. The exponents are fitted to the running maxima from t = 10 on."
)
SIZE = (12.0, 12.0)

SPAN, FIT_FROM = 100, 10
SHOWN = 0.8
"""Largest global error in the picture, as in the lecture."""
GRID = Fraction(1, 50)
"""Common divisor of both step sizes."""


class Errors(NamedTuple):
    """The errors of a method."""

    h: float  # step size
    t: np.ndarray  # times of the steps
    eigenvalues: np.ndarray  # Euclidean norms of the errors of the eigenvalues
    solution: np.ndarray  # those of the errors of (p, q)


class Toda(NamedTuple):
    """Data of the figure: the errors of the classical Runge–Kutta method and of Störmer–Verlet."""

    rk4: Errors
    stormer_verlet: Errors


def numbers() -> Toda:
    """The errors of RK4 with h = 0.08 and Störmer–Verlet (kick–drift–kick) with h = 0.02 up to t = 100."""
    solution = bs.reference_solution(bs.scene("toda"), [k * GRID for k in range(int(SPAN / GRID) + 1)])
    return Toda(_errors("rk4", 4, solution), _errors("stormer-verlet", 1, solution))


def _errors(method: str, every: int, solution: np.ndarray) -> Errors:
    """The errors of a method whose step is a multiple of the grid on which the solution is known."""
    import numpy as np

    h = float(every * GRID)
    run = bs.integrate(method, bs.scene("toda"), h=h, steps=round(SPAN / h))
    values = eigenvalues(run.y)
    changes = np.linalg.norm(values - values[0], axis=1)
    return Errors(h, run.t, changes, np.linalg.norm(run.y - solution[:, ::every], axis=0))


def eigenvalues(states: np.ndarray) -> np.ndarray:
    """The eigenvalues of L, in ascending order, (states, n), for states (2n, states).

    L is the periodic Jacobi matrix with the diagonal a_k = −p_k/2 and b_k = exp((q_k − q_{k+1})/2)/2 beside it.

    References:
        H. Flaschka, Phys. Rev. B 9 (1974) 1924–1925, doi:10.1103/PhysRevB.9.1924.
    """
    import numpy as np

    p, q = np.split(states, 2)
    n = len(p)
    after = np.roll(np.arange(n), -1)
    matrix = np.zeros((states.shape[1], n, n))
    matrix[:, range(n), range(n)] = -p.T / 2
    matrix[:, range(n), after] = np.exp((q - q[after]) / 2).T / 2
    matrix[:, after, range(n)] = matrix[:, range(n), after]
    return np.linalg.eigvalsh(matrix)


def growth_exponent(t: np.ndarray, error: np.ndarray) -> float:
    """The exponent of t in the running maximum for t ≥ 10."""
    import numpy as np

    late = t >= FIT_FROM
    return float(power_exponent(t[late], np.maximum.accumulate(error)[late]))


def columns(numbers: Toda) -> dict[str, np.ndarray]:
    """The times and errors of each method."""
    table = {}
    for method, errors in numbers._asdict().items():
        _, t, values, solution = errors
        table |= {f"t_{method}": t, f"eigenvalue_error_{method}": values, f"global_error_{method}": solution}
    return table


def draw(numbers: Toda, figure: Figure) -> None:
    """Above the errors of the eigenvalues, below those of the solution."""
    above, below = figure.subplots(2, sharex=True)
    styles = ("RK4", VERMILION), ("Störmer–Verlet", BLUE)
    for (label, colour), errors in zip(styles, numbers, strict=True):
        for axes, error in ((above, errors.eigenvalues), (below, errors.solution)):
            exponent = growth_exponent(errors.t, error)
            text = f"{label}, $h = {errors.h:g}$, like $t^{{{exponent:.2f}}}$"
            axes.plot(errors.t, error, color=colour, linewidth=0.8, label=text)
    above.set(ylabel="error of the eigenvalues of $L$", ylim=(0, None))
    below.set(xlabel="time $t$", ylabel="global error", xlim=(0, SPAN), ylim=(0, SHOWN))
    for axes in (above, below):
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2)
