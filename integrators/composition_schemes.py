"""Compositions that raise the order: the triple jump, Suzuki's fractal, and published schemes for any method."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from .compositions import adjoint_method, composition
from .entries import multiply_entries, read_entry, sum_entries
from .errors import IntegratorError
from .expressions import shorten
from .nystrom_splitting import NystromSplitting
from .program import Program
from .splitting import Splitting

if TYPE_CHECKING:
    from .entries import Entry
    from .program_method import Method

MAX_ORDER = 30


def triple_jump(method: Method, order: int, *, name: str | None = None) -> Program | Splitting:
    """Three steps of γh, (1−2γ)h, γh with γ = 1/(2 − 2^(1/(p+1))).

    Args:
        method: a method of even order p.
        order: its order p.
        name: what messages call the result.

    Returns:
        A method of order p + 1; if the method is symmetric, it is so, too, and has order p + 2.

    Raises:
        IntegratorError: `method` is no method, or `order` is no even number.

    Example:
        >>> from integrators import method
        >>> [round(float(x), 4) for _, x in triple_jump(method("strang"), 2).flows]
        [0.6756, 1.3512, -0.1756, -1.7024, -0.1756, 1.3512, 0.6756]

    References:
        M. Suzuki, Phys. Lett. A 146 (1990) 319–323, doi:10.1016/0375-9601(90)90962-N; H. Yoshida, Phys. Lett. A 150
        (1990) 262–268, doi:10.1016/0375-9601(90)90092-3; Hairer, Lubich, Wanner, *Geometric Numerical Integration*,
        formula (II.4.4).
    """
    gamma = _inverse_of_difference(2, _even(order) + 1)
    return composition([(method, x) for x in _around(gamma, 1)], name=name or f"triple jump of {_name(method)}")


def suzuki_fractal(method: Method, order: int, *, name: str | None = None) -> Program | Splitting:
    """Five steps of γh, γh, (1−4γ)h, γh, γh with γ = 1/(4 − 4^(1/(p+1))), which stay close to the step itself.

    Args:
        method: a method of even order p.
        order: its order p.
        name: what messages call the result.

    Returns:
        A method of order p + 1; if the method is symmetric, it is so, too, and has order p + 2.

    Raises:
        IntegratorError: `method` is no method, or `order` is no even number.

    Example:
        >>> from integrators import method
        >>> [round(float(x), 4) for _, x in suzuki_fractal(method("strang"), 2).flows]
        [0.2072, 0.4145, 0.4145, 0.4145, -0.1217, -0.658, -0.1217, 0.4145, 0.4145, 0.4145, 0.2072]

    References:
        M. Suzuki, Phys. Lett. A 146 (1990) 319–323, doi:10.1016/0375-9601(90)90962-N; Hairer, Lubich, Wanner,
        *Geometric Numerical Integration*, formula (II.4.5).
    """
    gamma = _inverse_of_difference(4, _even(order) + 1)
    return composition([(method, x) for x in _around(gamma, 2)], name=name or f"Suzuki's fractal of {_name(method)}")


def symmetric_composition(method: Method, scheme: str, *, name: str | None = None) -> Program | Splitting:
    """The steps γ_1 h, …, γ_s h of a published scheme, with γ_(s+1−i) = γ_i.

    Args:
        method: a symmetric method of order 2.
        scheme: the name of a composition in the catalogue, such as "kahan-li8"; `recommended` names the best.
        name: what messages call the result.

    Returns:
        A symmetric method of the order of the scheme.

    Raises:
        IntegratorError: `method` is no method, or `scheme` no such name.

    Example:
        Which part of a splitting begins makes a difference; here it is the drift:

        >>> from integrators import Splitting
        >>> verlet = Splitting([("q", "1/2"), ("p", 1), ("q", "1/2")], parts=("p", "q"))
        >>> symmetric_composition(verlet, "kahan-li8")
        <Splitting kahan-li8 of custom: p, q, 35 stages>

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, V.3.2.
    """
    from .methods.symmetric_compositions import SCHEMES

    exact = {"triple-jump4": triple_jump, "suzuki4": suzuki_fractal}
    key = scheme.lower().replace("_", "-") if isinstance(scheme, str) else ""
    title = name or f"{key} of {_name(method)}"
    if key in exact:
        return exact[key](method, 2, name=title)
    if key not in SCHEMES:
        raise IntegratorError(f"scheme must be one of {', '.join((*exact, *SCHEMES))}, but was {shorten(repr(scheme))}")
    outer = [Fraction(step) for step in SCHEMES[key].outer.split()]
    steps = [*outer, 1 - 2 * sum(outer), *outer[::-1]]
    return _with_digits(composition([(method, x) for x in steps], name=title), SCHEMES[key].digits)


def adjoint_composition(method: Method, splitting: Splitting, *, name: str | None = None) -> Program | Splitting:
    """A method of order 1 and its adjoint in turn, with steps that come from a splitting method in two parts.

    With the flows c_1, c_2, … of a splitting method the steps are d_1 = c_1, d_k = c_k − d_(k−1): for the Lie–Trotter
    method in these parts the composition is the splitting method itself, and the order conditions of both are the same.
    So methods found for two parts serve for three, or for any method of order 1.

    Args:
        method: a method of order 1, such as the symplectic Euler method or `lie_trotter` with any number of parts.
        splitting: a splitting method in two parts, which are of any kind.
        name: what messages call the result.

    Returns:
        A method of the order of the splitting, symmetric if that is.

    Raises:
        IntegratorError: `method` is no method, or `splitting` no such method.

    Example:
        >>> from integrators import lie_trotter, method
        >>> three = adjoint_composition(lie_trotter(["a", "b", "c"]), method("strang"))
        >>> [(part, str(x)) for part, x in three.flows]
        [('a', '1/2'), ('b', '1/2'), ('c', '1'), ('b', '1/2'), ('a', '1/2')]

    References:
        R. I. McLachlan, SIAM J. Sci. Comput. 16 (1995) 151–168, doi:10.1137/0916010; Hairer, Lubich, Wanner,
        *Geometric Numerical Integration*, II.5 and III.3.3.
    """
    suitable = isinstance(splitting, Splitting) and len(splitting.names) == 2 and not splitting.issues
    if not suitable or isinstance(splitting, NystromSplitting):
        raise IntegratorError(
            f"splitting must be a consistent splitting method in two parts of any kind, but was {_name(splitting)}"
        )
    title = name or f"{splitting.name} of {_name(method)}"
    steps: list[Entry] = [Fraction(0)]
    for _, coefficient in splitting.flows[:-1]:
        steps.append(sum_entries((coefficient, multiply_entries(steps[-1], Fraction(-1)))))
    pair = method, adjoint_method(method)
    composed = composition([(pair[k % 2], x) for k, x in enumerate(steps[1:])], name=title)
    return _with_digits(composed, splitting.digits)


def _with_digits(composed: Program | Splitting, digits: int | None) -> Program | Splitting:
    """The composition with steps that are decimals."""
    known = [count for count in (composed.digits, digits) if count is not None]
    if not known or composed.digits == min(known):
        return composed
    labels = {"name": composed.name, "digits": min(known)}
    if isinstance(composed, Splitting):
        return Splitting(composed.flows, parts=composed.names, **labels)
    parts = {"parts": composed.names, "auxiliary": composed.auxiliary, "max_children": composed.max_children}
    return Program(composed.evaluations, composed.result, **parts, **labels)


def _inverse_of_difference(m: int, degree: int) -> Entry:
    """1/(m − m^(1/n)) = Σ_k m^(n−1−k) x^k / (m^n − m) with x = m^(1/n): a normal form without roots in denominators."""
    import sympy

    x = sympy.root(m, degree)
    terms = (sympy.Rational(m ** (degree - 1 - k), m**degree - m) * x**k for k in range(degree))
    return read_entry(sympy.Add(*terms), "gamma")


def _around(gamma: Entry, count: int) -> list[Entry]:
    """`count` times γ before and after the rest of the step."""
    rest = sum_entries((Fraction(1), multiply_entries(gamma, Fraction(-2 * count))))
    return [*[gamma] * count, rest, *[gamma] * count]


def _even(order: Any) -> int:
    if isinstance(order, bool) or not isinstance(order, int) or order % 2 or not 2 <= order <= MAX_ORDER:
        raise IntegratorError(f"order must be an even number from 2 to {MAX_ORDER}, but was {shorten(repr(order))}")
    return order


def _name(method: Any) -> str:
    return shorten(str(getattr(method, "name", method)))
