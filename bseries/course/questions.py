"""The questions of the exercises: what is asked, how it is answered, and where the truth comes from."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import partial as of
from typing import Any, NamedTuple

from bseries.analysis.structure import symmetry, symplecticity
from bseries.course import truths
from bseries.course.answer_kinds import AnswerKind, Choices, Differentials, Formulas, Tableau
from integrators import method, trace

P_Q, Y_H, X_Y_Z, POLAR = ("p", "q"), ("y", "h"), ("x", "y", "z"), ("p_r", "p_phi", "r", "phi")
MIDPOINT, EULER, EULER_P, EULER_Q = "implicit-midpoint", "explicit-euler", "symplectic-euler-p", "symplectic-euler-q"
VERLET = "stormer-verlet"
WAVES = ("0", "sin(2*q)/5", "cos(2*q)/5")
IN_Q = "is that of the variant implicit in q"
IN_PLANE_AND_SPACE = ("in dimension 2", "in dimension 3")


class Question(NamedTuple):
    """A question of an exercise.

    Attributes:
        key: The number of the exercise and a letter.
        asks: What is asked, in a few words.
        kind: How it is answered.
        truth: Computes what the answer must be, in the form that its kind compares.
    """

    key: str
    asks: str
    kind: AnswerKind
    truth: Callable[[], Any]


def _coefficients(name: str) -> Any:
    """c_1, …, c_4 of exercise 1."""
    return truths.riccati(name)[1:]


def _field(function: Callable[[], Any], nodes: int) -> Any:
    """A term of the modified equation of a method that is made when it is needed."""
    return truths.differentials(function(), nodes)


def _same_as(function: Callable[[], Any]) -> Any:
    """The requirement to be such a method."""
    return truths.same_as(function())


def _orders() -> tuple[int, ...]:
    """The orders of the steps of exercise 9."""
    return tuple(truths.order_of(trace(step)) for step in truths.STEPS)


QUESTIONS = (
    Question(
        "1a", "c_1, c_2, c_3, c_4 of the implicit Euler method",
        Formulas(count=4, others={"is that of the explicit Euler method": of(_coefficients, EULER)}),
        of(_coefficients, "implicit-euler"),
    ),
    Question(
        "1b", "the right-hand side through h^4 for the implicit midpoint rule",
        Formulas(Y_H, others={"is that of the trapezoidal rule": of(truths.riccati_field, "trapezoidal")}),
        of(truths.riccati_field, MIDPOINT),
    ),
    Question(
        "1c", "the right-hand side through h^4 for the trapezoidal rule",
        Formulas(Y_H, others={"is that of the midpoint rule": of(truths.riccati_field, MIDPOINT)}),
        of(truths.riccati_field, "trapezoidal"),
    ),
    Question(
        "1d", "does the modified equation of the trapezoidal rule have a term with h^7?",
        Choices(), of(truths.has_riccati_term, "trapezoidal", 7),
    ),
    Question("2a", "the first integral I = p + ...", Formulas(P_Q, constant=True), of(truths.lotka_volterra, 0)),
    Question(
        "2b", "I_2 for the symplectic Euler method",
        Formulas(P_Q, constant=True, others={IN_Q: of(truths.lotka_volterra, 1, EULER_Q)}),
        of(truths.lotka_volterra, 1, EULER_P),
    ),
    Question("2c", "is there an I_2 for the explicit Euler method?", Choices(), of(truths.has_integral, EULER)),
    Question("3a", "p_phi", Formulas(("p1", "p2", "r", "phi")), truths.angular_momentum),
    Question("3b", "K for Kepler's problem", Formulas(POLAR), truths.polar_kepler),
    Question("3c", "K(P, Q) for Q = log q", Formulas(("P", "Q")), truths.logarithmic_kepler),
    Question("4a", "K(a, theta)", Formulas(("a", "theta")), truths.quartic_oscillator),
    Question("4b", "the mean of K - 2 a over theta", Formulas(("a",)), truths.averaged_quartic),
    Question("4c", "the number c", Formulas(), truths.scaling_factor),
    Question("5a", "the coefficient of h^3 in the modified Hamiltonian", Formulas(P_Q), truths.field_nijhoff_term),
    Question("5b", "the sum of the series", Formulas(("I", "h")), truths.field_nijhoff),
    Question("5c", "the radius of convergence at (p, q) = (1, 2)", Formulas(), truths.field_nijhoff_radius),
    Question("6a", "div f_2 of the explicit Euler method", Formulas(X_Y_Z), of(truths.abc_divergence, EULER, 1)),
    Question("6b", "div f_3 of the implicit midpoint rule", Formulas(X_Y_Z), of(truths.abc_divergence, MIDPOINT, 2)),
    Question("6c", "is volume preserved?", Choices(IN_PLANE_AND_SPACE), truths.midpoint_preserves_volume),
    Question("7a", "f_2", Differentials(("theta",)), of(_field, truths.theta_method, 2)),
    Question("7b", "f_3", Differentials(("theta",)), of(_field, truths.theta_method, 3)),
    Question("7c", "theta for order 2", Formulas(), truths.theta_of_order_2),
    Question("8a", "b_3, b_5", Formulas(count=2), of(truths.tall_coefficients, MIDPOINT)),
    Question("8b", "the frequency", Formulas(("omega", "h")), of(truths.numerical_frequency, MIDPOINT)),
    Question("8c", "both radii of convergence", Formulas(count=2), of(truths.radii, (EULER, MIDPOINT))),
    Question("9a", "the orders of the steps A, B, C", Formulas(count=3), _orders),
    Question("9b", "f_3 of step B", Differentials(), of(_field, of(trace, truths.taylor), 3)),
    Question("9c", "step C", Tableau(), of(_same_as, of(trace, truths.extrapolated_euler))),
    Question(
        "10a", "the term with h^2, without h^2",
        Formulas(P_Q, others={"is the formula of the notes": truths.misprinted_term}),
        of(truths.energy_term, VERLET, 2),
    ),
    Question("10b", "the 3/8 rule", Tableau(), of(_same_as, of(method, "rk38"))),
    Question("10c", "the order of the tableau in the notes", Formulas(), truths.order_of_misprint),
    Question("11a", "the adjoint of Ralston's method", Tableau(), of(_same_as, truths.ralston_adjoint)),
    Question("11b", "s_2, s_3, s_4, s_5", Formulas(count=4), truths.adjoint_signs),
    Question("11c", "f_3 of the composition", Differentials(), of(_field, truths.symmetrized_ralston, 3)),
    Question("12a", "which are symplectic?", Choices(tuple(truths.METHODS)), of(truths.which_are, symplecticity)),
    Question("12b", "which are symmetric?", Choices(tuple(truths.METHODS)), of(truths.which_are, symmetry)),
    Question("12c", "symplectic, not symmetric", Tableau(), lambda: truths.having(1, symplectic=True)),
    Question("12d", "symmetric, not symplectic", Tableau(), lambda: truths.having(1, symplectic=False)),
    Question("12e", "order 3, symplectic, not symmetric", Tableau(), lambda: truths.having(3, symplectic=True)),
    Question("13a", "the factor of the energy for RK4", Formulas(("h",)), of(truths.energy_factor, "rk4")),
    Question("13b", "the number of steps", Formulas(digits=3), of(truths.steps_to_half, "rk4", Fraction(1, 10))),
    Question("13c", "the energy", Formulas(digits=4), of(truths.energy_after, EULER, Fraction(1, 100), 1000)),
    Question(
        "14a", "H_2 of the symplectic Euler method",
        Formulas(P_Q, others={IN_Q: of(truths.energy_term, EULER_Q, 1)}),
        of(truths.energy_term, EULER_P, 1),
    ),
    Question("14b", "H_3 of the symplectic Euler method", Formulas(P_Q), of(truths.energy_term, EULER_P, 2)),
    Question(
        "14c", "H_3 of the implicit midpoint rule",
        Formulas(P_Q, constant=True, others={"is that of Störmer–Verlet": of(truths.energy_term, VERLET, 2)}),
        of(truths.energy_term, MIDPOINT, 2),
    ),
    Question("14d", "the largest error, divided by h", Formulas(digits=3), truths.largest_energy_error),
    Question("15a", "both coefficients", Formulas(("gamma",), count=2), truths.splitting_coefficients),
    Question("15b", "gamma, and the other coefficient", Formulas(count=2), truths.best_splitting),
    Question("15c", "kappa", Formulas(), truths.gradient_factor),
    Question("16a", "the integral over a period", Formulas(("eps",)), truths.third_derivative_integral),
    Question("16b", "the gain in a turn, divided by h^4", Formulas(), truths.gain_per_turn),
    Question("16c", "does the energy drift?", Choices(("A", "B", "C")), of(truths.drifting, WAVES)),
)  # fmt: skip
"""All questions, in the order of the exercises."""
