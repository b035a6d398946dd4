"""What the engine computes as the answers of the exercises, by exercise."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any

import bseries as bs
from bseries.course.answer_kinds import MOST_NODES

if TYPE_CHECKING:
    from integrators.methods.programs.program import Method
    from trees import Tree


def yes_no(found: Iterable[bool]) -> tuple[str, ...]:
    """Truth values as words."""
    return tuple("yes" if holds else "no" for holds in found)


def symbols(names: str) -> Any:
    """Symbols by their names."""
    import sympy

    return sympy.symbols(names, seq=True)


# Exercises 1, 2 and 6: modified equations on scenes.


@cache
def riccati(name: str) -> tuple[Any, ...]:
    """The coefficients c_0, …, c_4 of the modified equation y' = Σ c_k h^k y^(k+2) of a method for y' = y²."""
    series, (y,) = bs.modified_field(name, "riccati", 5), symbols("y")
    return tuple((series.symbolic(k)[0] / y ** (k + 2)).cancel() for k in range(5))


def riccati_field(name: str) -> tuple[Any]:
    """The right-hand side of this equation."""
    y, h = symbols("y h")
    return (sum(c * h**k * y ** (k + 2) for k, c in enumerate(riccati(name))),)


def has_riccati_term(name: str, power: int) -> tuple[str, ...]:
    """Whether this equation has a term with a power of h."""
    return yes_no([bs.modified_field(name, "riccati", power + 1).symbolic(power)[0] != 0])


def lotka_volterra(power: int, name: str = "symplectic-euler-p") -> tuple[Any]:
    """A term of the first integral of the modified equation of Lotka and Volterra's equations."""
    return (bs.modified_invariant(bs.modified_field(name, "lotka-volterra", 2)).terms[power],)


def has_integral(name: str) -> tuple[str, ...]:
    """Whether there is such an integral through h."""
    try:
        return yes_no([bool(lotka_volterra(1, name))])
    except bs.SeriesError:
        return yes_no([False])


def abc_divergence(name: str, power: int) -> tuple[Any]:
    """The divergence of a term of the modified equation of the ABC flow."""
    return (bs.fields.divergence(bs.modified_field(name, "abc-flow", power + 1), power),)


def midpoint_preserves_volume() -> tuple[str, ...]:
    """In dimension 2, where the symplectic form is the area, and in dimension 3."""
    in_plane = bs.symplecticity("implicit-midpoint", MOST_NODES).breaks is None
    return yes_no([in_plane, abc_divergence("implicit-midpoint", 2)[0] == 0])


# Exercises 3 to 5: changes of coordinates, and a modified Hamiltonian in closed form.


def _polar() -> Any:
    """The change to polar coordinates in the plane."""
    new, positions = {"p": ["p_r", "p_phi"], "q": ["r", "phi"]}, {"q1": "r*cos(phi)", "q2": "r*sin(phi)"}
    return bs.hamiltonians.point_transformation({"p": 2, "q": 2}, new, positions, positive=["r"])


def angular_momentum() -> tuple[Any]:
    """p_phi in polar coordinates."""
    import sympy

    formulas, unknown = _polar().formulas, symbols("p_r p_phi")
    equations = [sympy.Symbol(name) - formulas[name] for name in ("p1", "p2")]
    return (sympy.solve(equations, unknown)[unknown[1]],)


def polar_kepler() -> tuple[Any]:
    """The Hamiltonian of Kepler's problem in polar coordinates."""
    return (_polar().hamiltonian(bs.parse_hamiltonian("(p1^2 + p2^2)/2 - 1/sqrt(q1^2 + q2^2)")).hamiltonian,)


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


def averaged_quartic() -> tuple[Any]:
    """The first term of its normal form."""
    linear = _oscillator("0")
    quartic = quartic_oscillator()[0] - linear.hamiltonian
    return (bs.hamiltonians.lindstedt_poincare(linear, 1, perturbations=[quartic]).symbolic(1),)


def scaling_factor() -> tuple[Any]:
    """c in z' = c J⁻¹ ∇K(z) for K(P, Q) = H(2P, 3Q): the factor of {p, q} = {2P, 3Q} = 6 {P, Q}, inverted."""
    import sympy

    P, Q = symbols("P Q")
    return (1 / sympy.Matrix([2 * P, 3 * Q]).jacobian([P, Q]).det(),)


@cache
def _field_nijhoff() -> Any:
    """Field and Nijhoff's modified Hamiltonian in closed form."""
    return bs.hamiltonians.closed_hamiltonian("symplectic-euler-p", "field-nijhoff")


def field_nijhoff_term() -> tuple[Any]:
    """The coefficient of h³ of Field and Nijhoff's modified Hamiltonian."""
    return (bs.modified_hamiltonian("symplectic-euler-p", "field-nijhoff", 4).symbolic(3),)


def field_nijhoff() -> tuple[Any]:
    """Its closed form in terms of I = (1 + p)(1 + q): at p = I − 1, q = 0."""
    p, q, invariant, h = symbols("p q I h")
    return (_field_nijhoff().expression(h).subs({p: invariant - 1, q: 0}),)


def field_nijhoff_radius() -> tuple[Any]:
    """Its radius of convergence at (p, q) = (1, 2)."""
    p, q = symbols("p q")
    return (_field_nijhoff().radius.subs({p: 1, q: 2}),)


# Exercises 7, 9, 11 and 12: methods.


def differentials(found: Method | str, nodes: int) -> dict[Tree, Any]:
    """The coefficients of elementary differentials in f_k, k = `nodes`, of the modified equation of a method."""
    series = bs.modified_equation(found, nodes)
    return {tree: series[tree] / tree.symmetry for tree in series if tree.order == nodes}


def theta_method() -> bs.RungeKutta:
    """y1 = y0 + h f((1 − θ) y0 + θ y1)."""
    return bs.RungeKutta([["theta"]], ["1"], parameters=["theta"])


def theta_of_order_2() -> tuple[Any, ...]:
    """The zero of f_2."""
    import sympy

    (coefficient,) = differentials(theta_method(), 2).values()
    return tuple(sympy.solve(coefficient))


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


def adjoint_signs() -> tuple[Any, ...]:
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


def same_as(wanted: Method) -> Callable[[bs.RungeKutta], str]:
    """Whether a tableau gives the same steps as a method."""

    def lacks(given: bs.RungeKutta) -> str:
        for nodes in range(1, MOST_NODES + 1):  # most wrong tableaus differ at a small tree
            one, other = bs.modified_equation(given, nodes), bs.modified_equation(wanted, nodes)
            different = next((tree for tree in other if one[tree] != other[tree]), None)
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


def tall_coefficients(name: str) -> tuple[Any, ...]:
    """The coefficients b_3, b_5 in y' = (A + h b_2 A² + …) y, those of tall trees."""
    series = bs.modified_equation(name, 5)
    return tuple(series[tree] for tree in series if tree.order in (3, 5) and tree.height == tree.order - 1)


def numerical_frequency(name: str) -> tuple[Any]:
    """The frequency of a method for the oscillator (p² + ω² q²)/2; it is ω times that for ω = 1 with the step ωh."""
    h, omega, p, q = symbols("h omega p q")
    closed = bs.hamiltonians.closed_hamiltonian(name, bs.parse_hamiltonian("(p^2 + q^2)/2")).expression(h)
    return ((closed / ((p**2 + q**2) / 2) * omega).cancel().subs(h, h * omega),)


def radii(names: Iterable[str]) -> tuple[Any, ...]:
    """The radius of convergence of log R(z): the least modulus of a zero or a pole of R."""
    import sympy

    (z,) = symbols("z")
    functions = [bs.stability_function(name) for name in names]
    products = [_polynomial(R.numerator, z) * _polynomial(R.denominator, z) for R in functions]
    return tuple(min(map(abs, sympy.roots(product, z))) for product in products)


def _polynomial(coefficients: Iterable[Any], z: Any) -> Any:
    """Σ c_k z^k."""
    import sympy

    return sympy.Add(*(sympy.sympify(c, strict=True) * z**k for k, c in enumerate(coefficients)))


def energy_factor(name: str) -> tuple[Any]:
    """|R(ih)|² of an explicit method, by which the energy of the oscillator with frequency 1 is multiplied."""
    import sympy

    (h,) = symbols("h")
    x = sympy.Symbol("x", real=True)
    value = sympy.expand(_polynomial(bs.stability_function(name).numerator, sympy.I * x))
    return (sympy.expand(sympy.re(value) ** 2 + sympy.im(value) ** 2).subs(x, h),)


def steps_to_half(name: str, h: Fraction) -> tuple[Any]:
    """The number n of steps, as a real number, with |R(ih)|^(2n) = 1/2."""
    import sympy

    (factor,) = energy_factor(name)
    return (-sympy.log(2) / sympy.log(factor.subs(symbols("h")[0], sympy.Rational(h))),)


def energy_after(name: str, h: Fraction, steps: int) -> tuple[Any]:
    """The energy after some steps in units of that at the start."""
    import sympy

    (factor,) = energy_factor(name)
    return (factor.subs(symbols("h")[0], sympy.Rational(h)) ** steps,)


# Exercises 10, 14 and 15: modified Hamiltonians.


def energy_term(name: str, power: int) -> tuple[Any]:
    """The coefficient of h^power of the modified Hamiltonian of a method on the pendulum."""
    return (bs.modified_hamiltonian(name, "pendulum", power + 1).symbolic(power),)


def misprinted_term() -> tuple[Any]:
    """The formula of exercise 10, in which one sign is wrong."""
    return (bs.parse_hamiltonian("p^2*cos(q)/12 + sin(q)^2/24").hamiltonian,)


def order_of_misprint() -> tuple[int]:
    """The order of the tableau of exercise 10: the 3/8 rule with a wrong sign."""
    rows = [[0, 0, 0, 0], ["1/3", 0, 0, 0], ["1/3", 1, 0, 0], [1, -1, 1, 0]]
    return (bs.order_of(bs.RungeKutta(rows, ["1/8", "3/8", "3/8", "1/8"])),)


def largest_energy_error() -> tuple[Any]:
    """The largest |H_2| of the symplectic Euler method on the pendulum's orbit from (5/2, 0), where H_2 = 0.

    On it p² = 2 (E + c) and sin² q = 1 − c² with c = cos q.
    """
    import sympy

    p, q, c = symbols("p q c")
    E = sympy.Rational(5, 2) ** 2 / 2 - 1
    (term,) = energy_term("symplectic-euler-p", 1)
    square = (term**2).subs(sympy.sin(q), sympy.sqrt(1 - c**2)).subs(p, sympy.sqrt(2 * (E + c)))
    turning = [root for root in sympy.solve(square.diff(c), c) if abs(root) < 1]
    return (sympy.sqrt(max(square.subs(c, root) for root in turning)),)


@cache
def splitting_coefficients() -> tuple[Any, ...]:
    """The coefficients of {T,{T,U}} and {U,{U,T}} for kicks γh, (1 − 2γ)h, γh between two drifts h/2."""
    drift = ("q", "1/2")
    flows = [("p", "gamma"), drift, ("p", "1 - 2*gamma"), drift, ("p", "gamma")]
    brackets = bs.hamiltonians.bracket_hamiltonian(bs.Splitting(flows, parameters=["gamma"]), 3)
    return brackets["T", "T", "U"], brackets["U", "U", "T"]


def best_splitting() -> tuple[Any, ...]:
    """γ for which the first one vanishes, and the value of the second one there."""
    import sympy

    first, second = (sympy.sympify(c, strict=True) for c in splitting_coefficients())
    (gamma,) = sympy.solve(first)
    return gamma, second.subs(symbols("gamma")[0], gamma)


def gradient_factor() -> tuple[Any]:
    """κ for which a kick in the middle with U − κ h² |∇U|² cancels the rest: (1 − 2γ) κ is that rest."""
    gamma, rest = best_splitting()
    return (rest / (1 - 2 * gamma),)


# Exercise 16: the counter-example.


def _pendulum(wave: str) -> Any:
    """A pendulum with a further wave in its potential."""
    return bs.parse_hamiltonian(f"p^2/2 - cos(q) + {wave}")


def third_derivative_integral() -> tuple[Any]:
    """∮ U_qqq U_q² dq for U = −cos q + ε sin 2q, a polynomial of degree 3 in ε, from its values at four of them."""
    import sympy

    values = [(k, bs.hamiltonians.takahashi_imada_integral(_pendulum(f"{k}*sin(2*q)"))) for k in range(4)]
    return (sympy.interpolate(values, symbols("eps")[0]),)


def gain_per_turn() -> tuple[Any]:
    """The gain of the energy in a forward turn for ε = 1/5, without h⁴."""
    (turn,) = bs.energy_drift("simplified-takahashi-imada", _pendulum("sin(2*q)/5")).turns
    return (turn.gain,)


def drifting(waves: Iterable[str]) -> tuple[str, ...]:
    """For which waves the energy drifts."""
    reports = (bs.energy_drift("simplified-takahashi-imada", _pendulum(wave)) for wave in waves)
    return yes_no(report.verdict == "linear drift" for report in reports)
