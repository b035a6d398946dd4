"""Figure 9: errors of the solution and of the conserved eigenvalues on the Toda lattice."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import label_panels, power_exponent
from bseries.figures.options import read_methods, read_numbers
from bseries.figures.words import column_names, name_of, power, short_names
from bseries_base.extras import np
from bseries_base.plotting import BLUE, ORANGE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from integrators import Method

NUMBER = 9
TITLE = "Toda lattice of three particles: errors of the eigenvalues and of the solution, RK4 and Störmer–Verlet"
SIZE = (12.0, 12.0)

METHODS, STEP_SIZES = ("rk4", "stormer-verlet"), ("2/25", "1/50")
SPAN, FIT_FROM = 100, 10
SHOWN = 0.8
"""Largest global error in the picture, as in the lecture."""


class Errors(NamedTuple):
    """The errors of a method."""

    method: Method
    h: float  # step size
    t: np.ndarray  # times of the steps
    eigenvalues: np.ndarray  # Euclidean norms of the errors of the eigenvalues
    solution: np.ndarray  # those of the errors of (p, q)


def numbers(*, methods: object = METHODS, h: object = STEP_SIZES) -> tuple[Errors, ...]:
    """The errors of two methods up to t = 100; Störmer–Verlet is kick–drift–kick."""
    sizes = read_numbers(h, "h", [2], 0.005, 0.2)
    return tuple(map(_errors, read_methods(methods, 2), sizes))


def _errors(method: Method, h: float) -> Errors:
    run = bs.integrate(method, bs.scene("toda"), h=h, steps=round(SPAN / h))
    values = eigenvalues(run.y)
    changes = np.linalg.norm(values - values[0], axis=1)
    solution = bs.reference_solution(bs.scene("toda"), run.t)
    return Errors(method, h, run.t, changes, np.linalg.norm(run.y - solution, axis=0))


def eigenvalues(states: np.ndarray) -> np.ndarray:
    """The eigenvalues of L, in ascending order, (states, n), for states (2n, states).

    L is the periodic Jacobi matrix with the diagonal a_k = −p_k/2 and b_k = exp((q_k − q_{k+1})/2)/2 beside it.

    References:
        H. Flaschka, Phys. Rev. B 9 (1974) 1924–1925, doi:10.1103/PhysRevB.9.1924.
    """
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
    late = t >= FIT_FROM
    return float(power_exponent(t[late], np.maximum.accumulate(error)[late]))


def columns(numbers: tuple[Errors, ...]) -> dict[str, np.ndarray]:
    """The times and errors of each method."""
    table = {}
    names = column_names([run.method for run in numbers])
    for key, (_, _, t, values, solution) in zip(names, numbers, strict=True):
        table |= {f"t_{key}": t, f"eigenvalue_error_{key}": values, f"global_error_{key}": solution}
    return table


def caption(numbers: tuple[Errors, ...]) -> str:
    """The exponents found, and what theorem 7 says of the method."""
    found = []
    for errors in numbers:
        values, solution = (power("t", growth_exponent(errors.t, e)) for e in (errors.eigenvalues, errors.solution))
        is_symplectic = getattr(errors.method, "is_symplectic", False)
        bound = " (theorem 7: bounded, and at most linear, for non-resonant frequencies)" if is_symplectic else ""
        about = f"{name_of(errors.method)} with h = {errors.h:g}"
        found.append(f"{about}: the eigenvalues like {values}, the solution like {solution}{bound}")
    return (
        "Lecture, figure 9 (HLW, sections X.1.5 and X.3). Toda lattice of three particles: (a) Euclidean norm of the "
        "errors of the eigenvalues of Flaschka's matrix L(p, q), which are first integrals; (b) Euclidean norm of "
        f"the error of (p, q), shown up to {SHOWN:g}. Largest errors so far grow, fitted from t = {FIT_FROM} on: "
        f"{'; '.join(found)}."
    )


def draw(numbers: tuple[Errors, ...], figure: Figure) -> None:
    """Above the errors of the eigenvalues, below those of the solution."""
    above, below = figure.subplots(2, sharex=True)
    label_panels((above, below), ("eigenvalues of $L$", "solution"))
    names = short_names([errors.method for errors in numbers])
    for name, colour, errors in zip(names, (ORANGE, BLUE), numbers, strict=True):
        for axes, error in ((above, errors.eigenvalues), (below, errors.solution)):
            axes.plot(errors.t, error, color=colour, linewidth=0.8, label=f"{name}, $h = {errors.h:g}$")
    above.set(ylabel="error of the eigenvalues", ylim=(0, None))
    below.set(xlabel="time $t$", ylabel="error of $(p, q)$", xlim=(0, SPAN), ylim=(0, SHOWN))
    figure.legend(handles=above.lines, loc="outside lower center", ncols=2)
