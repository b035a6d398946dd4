"""The questions of the exercises: what is asked, how it is answered, and what the engine computes as the answer."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from functools import partial as of
from typing import TYPE_CHECKING, Any, NamedTuple

import sympy

import bseries as bs
from bseries.course.answer_kinds import MOST_NODES, AnswerKind, decisions, formulas, tableau
from bseries.course.answer_kinds import differentials as differentials_in
from bseries.course.field_nijhoff import FieldNijhoff, field_nijhoff

if TYPE_CHECKING:
    from bseries.exact.domains import Coefficient
    from bseries.fields.inputs import Formula
    from integrators import Scene
    from integrators.methods.programs.program import Method
    from trees import Tree

P_Q, Y_H, X_Y_Z, POLAR = ("p", "q"), ("y", "h"), ("x", "y", "z"), ("p_r", "p_phi", "r", "phi")
MIDPOINT, EULER, EULER_P, EULER_Q = "implicit-midpoint", "explicit-euler", "symplectic-euler-p", "symplectic-euler-q"
VERLET = "stormer-verlet"
WAVES = ("0", "sin(2*q)/5", "cos(2*q)/5")
IN_Q = "is that of the variant implicit in q"
MISPRINT = "p^2*cos(q)/12 + sin(q)^2/24"
"""The formula of exercise 10, in which one sign is wrong."""
h, p, q, y, z, omega, gamma = sympy.symbols("h p q y z omega gamma")


class Question(NamedTuple):
    """A question of an exercise."""

    key: str  # the number of the exercise and a letter
    asks: str  # what is asked, in a few words
    kind: AnswerKind  # how it is answered
    truth: Callable[[], Any]  # computes what the answer must be, in the form that its kind compares


def yes_no(found: Iterable[bool]) -> tuple[str, ...]:
    """Truth values as words."""
    return tuple("yes" if holds else "no" for holds in found)


# Exercises 1, 2 and 6: modified equations on scenes.


@cache
def riccati(name: str) -> tuple[sympy.Expr, ...]:
    """The coefficients c_0, …, c_4 of the modified equation y' = Σ c_k h^k y^(k+2) of a method for y' = y²."""
    series = bs.modified_field(name, "riccati", 5)
    return tuple((series.symbolic(k)[0] / y ** (k + 2)).cancel() for k in range(5))


def riccati_field(name: str) -> tuple[sympy.Expr]:
    """The right-hand side of this equation."""
    return (sympy.Add(*(c * h**k * y ** (k + 2) for k, c in enumerate(riccati(name)))),)


def lotka_volterra(power: int, name: str = "symplectic-euler-p") -> tuple[sympy.Expr]:
    """A term of the first integral of the modified equation of Lotka and Volterra's equations."""
    return (bs.modified_invariant(bs.modified_field(name, "lotka-volterra", 2)).terms[power],)


def has_integral(name: str) -> tuple[str, ...]:
    """Whether there is such an integral through h."""
    try:
        return yes_no([bool(lotka_volterra(1, name))])
    except bs.SeriesError:
        return yes_no([False])


def abc_divergence(name: str, power: int) -> tuple[sympy.Expr]:
    """The divergence of a term of the modified equation of the ABC flow."""
    return (bs.fields.divergence(bs.modified_field(name, "abc-flow", power + 1), power),)


def midpoint_preserves_volume() -> tuple[str, ...]:
    """In dimension 2, where the symplectic form is the area, and in dimension 3."""
    in_plane = bs.symplecticity("implicit-midpoint", MOST_NODES).breaks is None
    return yes_no([in_plane, abc_divergence("implicit-midpoint", 2)[0] == 0])


# Exercises 3 and 4: changes of coordinates.


def _polar() -> bs.hamiltonians.CoordinateChange:
    """The change to polar coordinates in the plane."""
    new, positions = {"p": ["p_r", "p_phi"], "q": ["r", "phi"]}, {"q1": "r*cos(phi)", "q2": "r*sin(phi)"}
    return bs.hamiltonians.point_transformation({"p": 2, "q": 2}, new, positions, positive=["r"])


def angular_momentum() -> tuple[sympy.Expr]:
    """p_phi in polar coordinates."""
    p_r, p_phi = sympy.symbols("p_r p_phi")
    equations = [sympy.Symbol(name) - _polar().formulas[name] for name in ("p1", "p2")]
    return (sympy.solve(equations, [p_r, p_phi])[p_phi],)


def logarithmic_kepler() -> tuple[Any]:
    """The Hamiltonian p²/2 − 1/q in Q = log q."""
    change = bs.hamiltonians.point_transformation({"p": 1, "q": 1}, {"P": 1, "Q": 1}, {"q": "exp(Q)"})
    return (change.hamiltonian(bs.parse_hamiltonian("p^2/2 - 1/q")).hamiltonian,)


def _oscillator(potential: str) -> Any:
    """The Hamiltonian of an oscillator of frequency 2 with a further potential, in action–angle variables."""
    change = bs.hamiltonians.harmonic_action_angle({"p": 1, "q": 1}, {"a": 1, "theta": 1}, [2])
    return change.hamiltonian(bs.parse_hamiltonian(f"(p^2 + 4*q^2)/2 + {potential}"))


def quartic_oscillator() -> tuple[Any]:
    """The Hamiltonian with the potential q⁴."""
    return (_oscillator("q^4").hamiltonian,)


def averaged_quartic() -> tuple[sympy.Expr]:
    """The first term of its normal form."""
    linear = _oscillator("0")
    quartic = quartic_oscillator()[0] - linear.hamiltonian
    return (bs.hamiltonians.lindstedt_poincare(linear, 1, perturbations=[quartic]).symbolic(1),)


# Exercises 7, 9, 11 and 12: methods.


def differentials(found: Method | str, nodes: int) -> dict[Tree, sympy.Expr]:
    """The coefficients of elementary differentials in f_k, k = `nodes`, of the modified equation of a method."""
    series = bs.modified_equation(found, nodes)
    return {tree: series[tree] / tree.symmetry for tree in series if tree.order == nodes}


def theta_method() -> bs.RungeKutta:
    """y1 = y0 + h f((1 − θ) y0 + θ y1)."""
    return bs.RungeKutta([["theta"]], ["1"], parameters=["theta"])


def three_stages(f: Any, y: Any, h: Any) -> Any:
    """The first step of exercise 9."""
    k1 = f(y)
    k2 = f(y + h / 2 * k1)
    k3 = f(y + h * (2 * k2 - k1))
    return y + h / 6 * (k1 + 4 * k2 + k3)


def taylor(f: Any, y: Any, h: Any) -> Any:
    """The second step of exercise 9."""
    k = f(y)
    return y + h * k + h**2 / 2 * f.derivative(y, k)


def extrapolated_euler(f: Any, y: Any, h: Any) -> Any:
    """The third step of exercise 9."""
    one = y + h * f(y)
    half = y + h / 2 * f(y)
    two = half + h / 2 * f(half)
    return 2 * two - one


STEPS = (three_stages, taylor, extrapolated_euler)


def adjoint_signs() -> tuple[sympy.Expr, ...]:
    """The numbers s_j with f_j* = s_j f_j for j = 2, …, 5, of the explicit Euler method."""
    euler = bs.method("explicit-euler")
    series, adjoint = bs.modified_equation(euler, 5), bs.modified_equation(bs.methods.adjoint_method(euler), 5)
    ratios = {tree.order: adjoint[tree] / series[tree] for tree in series if series[tree]}
    return tuple(ratios[nodes] for nodes in range(2, 6))


def ralston_adjoint() -> Method:
    """The adjoint of Ralston's method."""
    return bs.methods.adjoint_method(bs.method("ralston2"))


def symmetrized_ralston() -> Method:
    """Half a step of this adjoint, then half a step of Ralston's method."""
    return bs.composition([(ralston_adjoint(), "1/2"), (bs.method("ralston2"), "1/2")])


METHODS = {
    "explicit Euler": "explicit-euler",
    "implicit midpoint": "implicit-midpoint",
    "trapezoidal": "trapezoidal",
    "symplectic Euler": "symplectic-euler-p",
    "Störmer–Verlet": "stormer-verlet",
    "RK4": "rk4",
}
"""The methods of exercise 12."""


def which_are(structure: Callable[[Any, int], Any]) -> tuple[str, ...]:
    """Which of them have a structure."""
    return yes_no(structure(name, MOST_NODES).breaks is None for name in METHODS.values())


# What a tableau lacks.


def same_coefficient(one: bs.BSeries, other: bs.BSeries, tree: Tree) -> bool:
    """Whether a coefficient of a method, which may be of rounded decimals, is that of an exact one."""
    if one.digits is None:
        return one[tree] == other[tree]
    return abs(float(one[tree]) - float(other[tree])) <= 10.0 ** (2 - one.digits)


def same_as(wanted: Method) -> Callable[[bs.RungeKutta], str]:
    """Whether a tableau gives the same steps as a method."""

    def lacks(given: bs.RungeKutta) -> str:
        for nodes in range(1, MOST_NODES + 1):  # most wrong tableaus differ at a small tree
            one, other = bs.modified_equation(given, nodes), bs.modified_equation(wanted, nodes)
            different = next((tree for tree in other if not same_coefficient(one, other, tree)), None)
            if different is not None:
                return f"is another method: the modified equations differ first at the tree {different}"
        return ""

    return lacks


def having(order: int, *, symplectic: bool) -> Callable[[bs.RungeKutta], str]:
    """Whether a tableau has at least some order, and is either symplectic or symmetric, but not both."""

    def lacks(given: bs.RungeKutta) -> str:
        if (found := bs.order_of(given)) < order:
            return f"has order {found}, not {order}"
        for name, test, wanted in (
            ("symplectic", bs.symplecticity, symplectic),
            ("symmetric", bs.symmetry, not symplectic),
        ):
            breaks = test(given, MOST_NODES).breaks
            if (breaks is None) != wanted:
                return f"is {name}" if breaks is None else f"is not {name}, as the tree {breaks} shows"
        return ""

    return lacks


# Exercises 8 and 13: linear equations.


def tall_coefficients(name: str) -> tuple[sympy.Expr, ...]:
    """The coefficients b_3, b_5 in y' = (A + h b_2 A² + …) y, those of tall trees."""
    series = bs.modified_equation(name, 5)
    return tuple(series[tree] for tree in series if tree.order in (3, 5) and tree.height == tree.order - 1)


def numerical_frequency(name: str) -> tuple[sympy.Expr]:
    """The frequency of a method for the oscillator (p² + ω² q²)/2; it is ω times that for ω = 1 with the step ωh."""
    closed = bs.hamiltonians.closed_hamiltonian(name, "harmonic-oscillator").expression(h)
    return ((closed / ((p**2 + q**2) / 2) * omega).cancel().subs(h, h * omega),)


def radii(names: Iterable[str]) -> tuple[sympy.Expr, ...]:
    """The radius of convergence of log R(z): the least modulus of a zero or a pole of R."""
    functions = [bs.stability_function(name) for name in names]
    products = [_polynomial(R.numerator, z) * _polynomial(R.denominator, z) for R in functions]
    return tuple(min(map(abs, sympy.roots(product, z))) for product in products)


def _polynomial(coefficients: Iterable[object], at: sympy.Expr) -> sympy.Expr:
    """Σ c_k z^k."""
    return sympy.Add(*(sympy.sympify(c, strict=True) * at**k for k, c in enumerate(coefficients)))


def energy_factor(name: str) -> tuple[Any]:
    """|R(ih)|² of an explicit method, by which the energy of the oscillator with frequency 1 is multiplied."""
    x = sympy.Symbol("x", real=True)
    value = sympy.expand(_polynomial(bs.stability_function(name).numerator, sympy.I * x))
    return (sympy.expand(sympy.re(value) ** 2 + sympy.im(value) ** 2).subs(x, h),)


# Exercises 10, 14 and 15: modified Hamiltonians.


def energy_term(name: str, power: int, scene: str = "pendulum") -> tuple[Any]:
    """The coefficient of h^power of the modified Hamiltonian of a method on a scene."""
    return (bs.modified_hamiltonian(name, scene, power + 1).symbolic(power),)


def order_of_misprint() -> tuple[int]:
    """The order of the tableau of exercise 10: the 3/8 rule with a wrong sign."""
    rows = [[0, 0, 0, 0], ["1/3", 0, 0, 0], ["1/3", 1, 0, 0], [1, -1, 1, 0]]
    return (bs.order_of(bs.RungeKutta(rows, ["1/8", "3/8", "3/8", "1/8"])),)


def largest_energy_error() -> tuple[sympy.Expr]:
    """The largest |H_2| of the symplectic Euler method on the pendulum's orbit from (5/2, 0), where H_2 = 0.

    On it p² = 2 (E + c) and sin² q = 1 − c² with c = cos q.
    """
    c, E = sympy.Symbol("c"), sympy.Rational(5, 2) ** 2 / 2 - 1
    (term,) = energy_term("symplectic-euler-p", 1)
    square = (term**2).subs(sympy.sin(q), sympy.sqrt(1 - c**2)).subs(p, sympy.sqrt(2 * (E + c)))
    turning = [root for root in sympy.solve(square.diff(c), c) if abs(root) < 1]
    return (sympy.sqrt(max(square.subs(c, root) for root in turning)),)


@cache
def splitting_coefficients() -> tuple[Coefficient, ...]:
    """The coefficients of {T,{T,U}} and {U,{U,T}} for kicks γh, (1 − 2γ)h, γh between two drifts h/2."""
    drift = ("q", "1/2")
    flows = [("p", "gamma"), drift, ("p", "1 - 2*gamma"), drift, ("p", "gamma")]
    brackets = bs.hamiltonians.bracket_hamiltonian(bs.Splitting(flows, parameters=["gamma"]), 3)
    return brackets["T", "T", "U"], brackets["U", "U", "T"]


def best_splitting() -> tuple[Formula, ...]:
    """γ for which the first one vanishes, and the value of the second one there."""
    first, second = (sympy.sympify(c, strict=True) for c in splitting_coefficients())
    (root,) = sympy.solve(first)
    return root, second.subs(gamma, root)


def gradient_factor() -> tuple[sympy.Expr]:
    """κ for which a kick in the middle with U − κ h² |∇U|² cancels the rest: (1 − 2γ) κ is that rest."""
    root, rest = best_splitting()
    return (rest / (1 - 2 * root),)


# Exercise 16: the counter-example.


def _pendulum(wave: str) -> Scene:
    """A pendulum with a further wave in its potential."""
    return bs.parse_hamiltonian(f"p^2/2 - cos(q) + {wave}")


def third_derivative_integral() -> tuple[Any]:
    """∮ U_qqq U_q² dq for U = −cos q + ε sin 2q, a polynomial of degree 3 in ε, from its values at four of them."""
    values = [(k, bs.hamiltonians.takahashi_imada_integral(_pendulum(f"{k}*sin(2*q)"))) for k in range(4)]
    return (sympy.interpolate(values, sympy.Symbol("eps")),)


def drifting(waves: Iterable[str]) -> tuple[str, ...]:
    """For which waves the energy drifts."""
    reports = (bs.energy_drift("simplified-takahashi-imada", _pendulum(wave)) for wave in waves)
    return yes_no(report.verdict == "linear drift" for report in reports)


QUESTIONS = (
    Question(
        "1a", "c_1, c_2, c_3, c_4 of the implicit Euler method",
        formulas(count=4, others={"is that of the explicit Euler method": lambda: riccati(EULER)[1:]}),
        lambda: riccati("implicit-euler")[1:],
    ),
    Question(
        "1b", "the right-hand side through h^4 for the implicit midpoint rule",
        formulas(Y_H, others={"is that of the trapezoidal rule": of(riccati_field, "trapezoidal")}),
        of(riccati_field, MIDPOINT),
    ),
    Question(
        "1c", "the right-hand side through h^4 for the trapezoidal rule",
        formulas(Y_H, others={"is that of the midpoint rule": of(riccati_field, MIDPOINT)}),
        of(riccati_field, "trapezoidal"),
    ),
    Question(
        "1d", "does the modified equation of the trapezoidal rule have a term with h^7?",
        decisions(), lambda: yes_no([bs.modified_field("trapezoidal", "riccati", 8).symbolic(7)[0] != 0]),
    ),
    Question("2a", "the first integral I = p + ...", formulas(P_Q, constant=True), of(lotka_volterra, 0)),
    Question(
        "2b", "I_2 for the symplectic Euler method",
        formulas(P_Q, constant=True, others={IN_Q: of(lotka_volterra, 1, EULER_Q)}),
        of(lotka_volterra, 1, EULER_P),
    ),
    Question("2c", "is there an I_2 for the explicit Euler method?", decisions(), of(has_integral, EULER)),
    Question("3a", "p_phi", formulas(("p1", "p2", "r", "phi")), angular_momentum),
    Question(
        "3b", "K for Kepler's problem", formulas(POLAR),
        lambda: (_polar().hamiltonian(bs.parse_hamiltonian("(p1^2 + p2^2)/2 - 1/sqrt(q1^2 + q2^2)")).hamiltonian,),
    ),
    Question("3c", "K(P, Q) for Q = log q", formulas(("P", "Q")), logarithmic_kepler),
    Question("4a", "K(a, theta)", formulas(("a", "theta")), quartic_oscillator),
    Question("4b", "the mean of K - 2 a over theta", formulas(("a",)), averaged_quartic),
    # K(P, Q) = H(2P, 3Q): c is the factor of {p, q} = {2P, 3Q} = 6 {P, Q}, inverted.
    Question("4c", "the number c", formulas(), lambda: (1 / sympy.diag(2, 3).det(),)),
    Question(
        "5a", "the coefficient of h^3 in the modified Hamiltonian",
        formulas(P_Q), of(energy_term, EULER_P, 3, "field-nijhoff"),
    ),
    Question(
        "5b", "the sum of the series", formulas(("I", "h")),
        lambda: (field_nijhoff().expression(h).subs({p: sympy.Symbol("I") - 1, q: 0}),),  # I = (1 + p)(1 + q)
    ),
    Question(
        "5c", "the radius of convergence at (p, q) = (1, 2)",
        formulas(), lambda: (FieldNijhoff(bs.scene("field-nijhoff"), "p").radius.subs({p: 1, q: 2}),),
    ),
    Question("6a", "div f_2 of the explicit Euler method", formulas(X_Y_Z), of(abc_divergence, EULER, 1)),
    Question("6b", "div f_3 of the implicit midpoint rule", formulas(X_Y_Z), of(abc_divergence, MIDPOINT, 2)),
    Question("6c", "is volume preserved?", decisions("in dimension 2", "in dimension 3"), midpoint_preserves_volume),
    Question("7a", "f_2", differentials_in(("theta",)), lambda: differentials(theta_method(), 2)),
    Question("7b", "f_3", differentials_in(("theta",)), lambda: differentials(theta_method(), 3)),
    Question(
        "7c", "theta for order 2", formulas(), lambda: tuple(sympy.solve(*differentials(theta_method(), 2).values()))
    ),
    Question("8a", "b_3, b_5", formulas(count=2), of(tall_coefficients, MIDPOINT)),
    Question("8b", "the frequency", formulas(("omega", "h")), of(numerical_frequency, MIDPOINT)),
    Question("8c", "both radii of convergence", formulas(count=2), of(radii, (EULER, MIDPOINT))),
    Question(
        "9a", "the orders of the steps A, B, C",
        formulas(count=3), lambda: tuple(bs.order_of(bs.trace(step)) for step in STEPS),
    ),
    Question("9b", "f_3 of step B", differentials_in(), lambda: differentials(bs.trace(taylor), 3)),
    Question("9c", "step C", tableau(), lambda: same_as(bs.trace(extrapolated_euler))),
    Question(
        "10a", "the term with h^2, without h^2",
        formulas(P_Q, others={"is the formula of the notes": lambda: (bs.parse_hamiltonian(MISPRINT).hamiltonian,)}),
        of(energy_term, VERLET, 2),
    ),
    Question("10b", "the 3/8 rule", tableau(), lambda: same_as(bs.method("rk38"))),
    Question("10c", "the order of the tableau in the notes", formulas(), order_of_misprint),
    Question("11a", "the adjoint of Ralston's method", tableau(), lambda: same_as(ralston_adjoint())),
    Question("11b", "s_2, s_3, s_4, s_5", formulas(count=4), adjoint_signs),
    Question("11c", "f_3 of the composition", differentials_in(), lambda: differentials(symmetrized_ralston(), 3)),
    Question("12a", "which are symplectic?", decisions(*METHODS), of(which_are, bs.symplecticity)),
    Question("12b", "which are symmetric?", decisions(*METHODS), of(which_are, bs.symmetry)),
    Question("12c", "symplectic, not symmetric", tableau(), lambda: having(1, symplectic=True)),
    Question("12d", "symmetric, not symplectic", tableau(), lambda: having(1, symplectic=False)),
    Question("12e", "order 3, symplectic, not symmetric", tableau(), lambda: having(3, symplectic=True)),
    Question("13a", "the factor of the energy for RK4", formulas(("h",)), of(energy_factor, "rk4")),
    Question(
        "13b", "the number of steps", formulas(digits=3),  # the real number n with |R(ih)|^(2n) = 1/2
        lambda: (-sympy.log(2) / sympy.log(energy_factor("rk4")[0].subs(h, sympy.Rational(1, 10))),),
    ),
    Question(
        "13c", "the energy", formulas(digits=4),
        lambda: (energy_factor(EULER)[0].subs(h, sympy.Rational(1, 100)) ** 1000,),
    ),
    Question(
        "14a", "H_2 of the symplectic Euler method",
        formulas(P_Q, others={IN_Q: of(energy_term, EULER_Q, 1)}),
        of(energy_term, EULER_P, 1),
    ),
    Question("14b", "H_3 of the symplectic Euler method", formulas(P_Q), of(energy_term, EULER_P, 2)),
    Question(
        "14c", "H_3 of the implicit midpoint rule",
        formulas(P_Q, constant=True, others={"is that of Störmer–Verlet": of(energy_term, VERLET, 2)}),
        of(energy_term, MIDPOINT, 2),
    ),
    Question("14d", "the largest error, divided by h", formulas(digits=3), largest_energy_error),
    Question("15a", "both coefficients", formulas(("gamma",), count=2), splitting_coefficients),
    Question("15b", "gamma, and the other coefficient", formulas(count=2), best_splitting),
    Question("15c", "kappa", formulas(), gradient_factor),
    Question("16a", "the integral over a period", formulas(("eps",)), third_derivative_integral),
    Question(
        "16b", "the gain in a turn, divided by h^4",
        formulas(), lambda: (bs.energy_drift("simplified-takahashi-imada", _pendulum(WAVES[1])).turns[0].gain,),
    ),
    Question("16c", "does the energy drift?", decisions("A", "B", "C"), of(drifting, WAVES)),
)  # fmt: skip
"""All questions, in the order of the exercises."""
