"""First integrals of modified equations of Poisson systems, by integrating gradients; and their divergence."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import sympy
from sympy.polys.matrices import DomainMatrix
from sympy.polys.matrices.exceptions import DMNonInvertibleMatrixError

from bseries.exceptions import SeriesError
from bseries.fields.differential_rings import DifferentialRing
from bseries.fields.inputs import Formula, Step, check_power, power_sum
from bseries.fields.modified_fields import SceneSeries, check_field
from bseries.fields.polynomials import Element
from bseries.scene_text import power_table
from bseries_base.formulas import formula_text
from bseries_base.table import Table, as_frame, as_html
from integrators.scenes.model.blocks import poisson_matrix
from integrators.scenes.particles.expansion import filled
from integrators.scenes.scene import Scene

Wave: TypeAlias = "sympy.sin | sympy.cos"
Sum: TypeAlias = dict[sympy.Expr, sympy.Expr]
"""A sum of products, as a map from one factor to the other."""

MOST_POWERS = 60  # higher powers of sines or of polynomials are not expanded


class ModifiedInvariant(NamedTuple):
    """First integral I + h I_2 + h² I_3 + … of a truncated modified equation.

    Attributes:
        label: The name of the modified equation.
        variables: The symbols of the variables.
        terms: The formulas by power of h. The first is the Hamiltonian of the scene if it has one; the others are
            determined up to constants, which are left out.

    Example:
        >>> import bseries as bs, sympy
        >>> f = bs.modified_field(bs.method("symplectic-euler-p"), bs.scene("pendulum"), 2)
        >>> bs.modified_invariant(f).expression(sympy.Symbol("h"))
        -h*p*sin(q)/2 + p**2/2 - cos(q)
    """

    label: str
    variables: tuple[sympy.Symbol, ...]
    terms: tuple[sympy.Expr, ...]

    def expression(self, h: Step) -> sympy.Expr:
        """The integral for a step size, a number or a symbol.

        Raises:
            SeriesError: `h` is neither a number nor an expression.
        """
        return power_sum(self.terms, h)

    def __str__(self) -> str:
        rows = (f"h^{k:<3} {formula_text(term)}" for k, term in enumerate(self.terms))
        return "\n".join([f"integral of {self.label}", *rows])

    def __repr__(self) -> str:
        return f"<ModifiedInvariant of {self.label}: powers h^0 to h^{len(self.terms) - 1}>"

    def to_table(self) -> Table:
        """The integral as a table."""
        return power_table(f"Integral of {self.label}", self.terms, 0, self.to_dict)

    _repr_html_, to_pandas = as_html, as_frame

    def to_dict(self) -> dict[str, Any]:
        """The integral as plain data."""
        return {
            "schema": 1,
            "kind": "invariant",
            "series": self.label,
            "variables": [str(symbol) for symbol in self.variables],
            "terms": [{"power": k, "invariant": formula_text(term)} for k, term in enumerate(self.terms)],
        }


def modified_invariant(f: SceneSeries) -> ModifiedInvariant:
    """First integral of a truncated modified equation that is a Poisson system like the scene.

    For y' = B(y) ∇I(y) with B invertible, a Poisson integrator has a modified equation y' = B(y) (∇I + h ∇I_2 + …), so
    that ∇I_k = B(y)^(−1) f_k. For other methods B(y)^(−1) f_k is not a gradient.

    Args:
        f: A field such as a `modified_field`, of an exact method.

    Raises:
        SeriesError: `f` is not an exact field, its scene has no invertible structure matrix, a term is not Hamiltonian
            (the message names the first such power of h), or a term is beyond the integration rules of `potential`.

    Example:
        >>> import bseries as bs
        >>> lotka_volterra = bs.scene("lotka-volterra")
        >>> f = bs.modified_field(bs.method("symplectic-euler-p"), lotka_volterra, 2)
        >>> print(bs.modified_invariant(f))
        integral of the modified equation of symplectic-euler-p on lotka-volterra
        h^0   p + q - log(p) - 2*log(q)
        h^1   -p**2/4 - p*q/2 + 2*p - q**2/4 + 5*q/2 - log(p)/2 - 2*log(q)

    References:
        HLW, theorem IX.3.1 and section IX.3 (Poisson integrators); E. Hairer, lecture on long-time behaviour,
        exercise 2.
    """
    label = f"{check_field(f).label} on {f.scene.name}"
    if not f.series.is_exact or f.series.digits is not None:
        raise SeriesError(f"f must be exact, but the coefficients of {f.label} are decimals")
    inverse = inverse_structure(f)
    terms = tuple(_integral(f, inverse, k, label) for k in range(f.order))
    return ModifiedInvariant(label, f.scene.symbols, terms)


def _integral(f: SceneSeries, inverse: list[list[Element]], k: int, label: str) -> sympy.Expr:
    """I_(k+1), whose gradient is B^(−1) f_(k+1)."""
    ring, gradient = f.formulas.ring, covector(f, inverse, k)
    if not is_gradient(ring, gradient):
        raise SeriesError(
            f"f must be a Hamiltonian or Poisson field, but {label} is none: at h^{k}, B^(-1) f_{k + 1} is no gradient"
        )
    energy = f.scene.hamiltonian
    if k == 0 and energy is not None:
        H = ring.element(energy)
        if all(ring.is_zero(ring.derivative(H, i) - x) for i, x in enumerate(gradient)):
            return energy
    found = potential(ring, gradient)
    if found is None:
        raise SeriesError(f"f must be simple enough to integrate, but {label} is not: at h^{k} no rule applies")
    return found


def divergence(f: SceneSeries, k: int) -> sympy.Expr:
    """Divergence Σ_i ∂f_{k+1,i}/∂y_i of the term with h^k.

    A method preserves volume if and only if the divergence vanishes for all k.

    Args:
        f: A field such as a `modified_field`.
        k: The power of h.

    Raises:
        SeriesError: `f` is not a field, or `k` is out of range.

    Example:
        >>> import bseries as bs
        >>> abc = bs.scene("abc-flow")
        >>> bs.fields.divergence(bs.modified_field(bs.method("explicit-euler"), abc, 2), 1)
        sin(x)*cos(z) + sin(y)*cos(x) + sin(z)*cos(y)

    References:
        HLW, section VI.9 and lemma VI.9.1; E. Hairer, lecture on long-time behaviour, exercise 6.
    """
    check_power(k, check_field(f).order - 1)
    ring, field = f.formulas.ring, f.formulas.elements(k + 1)
    total = sum((ring.derivative(component, i) for i, component in enumerate(field)), ring.zero)
    return sympy.Integer(0) if ring.is_zero(total) else ring.to_expression(total)


def covector(f: SceneSeries, inverse: list[list[Element]], k: int) -> list[Element]:
    """B^(−1) f_(k+1), the gradient of the integral if there is one."""
    field = f.formulas.elements(k + 1)
    return [f.formulas.ring.dot(zip(row, field, strict=True)) for row in inverse]


def is_gradient(ring: DifferentialRing, components: list[Element]) -> bool:
    """Whether the Jacobian matrix is symmetric."""
    return all(
        ring.is_zero(ring.derivative(components[i], j) - ring.derivative(components[j], i))
        for i in range(len(components))
        for j in range(i)
    )


def inverse_structure(f: SceneSeries) -> list[list[Element]]:
    """The inverse structure matrix B(y)^(−1) of the scene."""
    matrix = sympy.Matrix(structure_matrix(f.scene))
    try:
        inverse = DomainMatrix.from_Matrix(matrix).to_field().inv().to_Matrix()
    except DMNonInvertibleMatrixError:
        raise SeriesError(
            f"scene must have an invertible structure B, but that of {f.scene.name} is singular"
        ) from None
    return [[f.formulas.ring.element(entry) for entry in row] for row in inverse.tolist()]


def structure_matrix(scene: Scene) -> Sequence[Sequence[sympy.Expr | int]]:
    """The structure matrix B(y) of y' = B(y) ∇I(y), with the values of parameters."""
    if scene.poisson is not None and len(scene.poisson) == scene.dimension:
        return [[filled(entry, scene) for entry in row] for row in scene.poisson]
    if scene.canonical_pair is None:
        raise SeriesError(
            f"scene must be canonical or a Poisson system in all variables, but {scene.name} is not; momenta and "
            "positions are recognised by the names of blocks, such as p and q"
        )
    return poisson_matrix(scene.canonical_pair)


def potential(ring: DifferentialRing, gradient: Sequence[Element]) -> sympy.Expr | None:
    """Integrate a vector of formulas that is known to be a gradient; None if no rule applies.

    There are rules for powers of polynomials that are linear, or quadratic and even, in a variable, for trigonometric
    polynomials and for exponentials. The function is verified by differentiation.
    """
    found: sympy.Expr = sympy.Integer(0)
    for i, x in enumerate(ring.variables):
        rest = gradient[i] - ring.derivative(ring.element(found), i)
        part = antiderivative(ring.to_expression(rest, simplify=False), x)
        if part is None:
            return None
        found += part
    inverse = (ring.derivative(ring.element(found), i) for i in range(len(gradient)))
    return found if all(ring.is_zero(a - b) for a, b in zip(gradient, inverse, strict=True)) else None


def antiderivative(formula: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """An antiderivative of a sum of products; None if no rule applies to a product."""
    coefficients: dict[sympy.Expr, list[sympy.Expr]] = defaultdict(list)
    for term in sympy.Add.make_args(formula):
        coefficient, part = term.as_independent(x, as_Add=False) if term.has(x) else (term, sympy.Integer(1))
        coefficients[part].append(coefficient)
    try:
        integrals = {part: sympy.Add.make_args(_of_product(part, x)) for part in coefficients}
    except _NoRule:
        return None
    return sympy.Add(*(c * term for part, factors in coefficients.items() for c in factors for term in integrals[part]))


class _NoRule(SeriesError):
    """No rule integrates a product."""


def _of_product(product: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    """∫ x^m f dx, where f is a product of sines and cosines, an exponential, or a power Q(x)^e."""
    power: sympy.Expr = sympy.Integer(0)
    growth: sympy.Expr = sympy.Integer(0)
    waves: list[tuple[Wave, int]] = []
    others: list[tuple[sympy.Expr, sympy.Expr]] = []
    for factor in sympy.Mul.make_args(product):
        base, exponent = factor.as_base_exp()
        if base == x and not exponent.has(x):
            power += exponent
        elif isinstance(factor, sympy.exp):
            growth += exponent
        elif isinstance(base, sympy.sin | sympy.cos) and exponent.is_Integer and 0 < exponent <= MOST_POWERS:
            waves.append((base, int(exponent)))
        elif factor != 1:
            others.append((base, exponent))
    kinds = bool(growth) + bool(waves) + len(others)
    if kinds > 1:
        raise _NoRule
    if others:
        base, exponent = others[0]
        return _of_polynomial_power(power, base, exponent, x)
    if kinds == 0:
        return sympy.log(x) if power == -1 else x ** (power + 1) / (power + 1)
    sums = _superposition(waves) if waves else {sympy.exp(growth): 1}
    return sympy.Add(*(c * _by_parts(_degree(power), wave, x) for wave, c in sums.items()))


def _degree(power: sympy.Expr) -> int:
    if not power.is_Integer or not 0 <= power <= MOST_POWERS:
        raise _NoRule
    return int(power)


def _by_parts(m: int, wave: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    """∫ x^m e^(kx+c) dx, also with sin, cos or 1 in place of exp, by parts."""
    if not wave.has(x):
        return wave * x ** (m + 1) / (m + 1)
    argument: Formula = wave.args[0]
    k = argument.diff(x)
    if k.has(x) or not k:
        raise _NoRule
    integrals = {sympy.exp: sympy.exp, sympy.sin: lambda argument: -sympy.cos(argument), sympy.cos: sympy.sin}
    inner = integrals[type(wave)](argument) / k
    if m == 0:
        return inner
    coefficient, other = inner.as_independent(x, as_Add=False)
    return x**m * inner - m * coefficient * _by_parts(m - 1, other, x)


def _superposition(waves: Sequence[tuple[Wave, int]]) -> Sum:
    """A product of powers of sines and cosines as a trigonometric sum, by cos b = (e^(ib) + e^(−ib))/2."""
    total: Sum = {sympy.Integer(0): sympy.Integer(1)}  # coefficients of e^(ia) by argument a
    for base, times in waves:
        plus, minus = (1, 1) if isinstance(base, sympy.cos) else (-sympy.I, sympy.I)
        for _ in range(times):
            longer: Sum = defaultdict(lambda: sympy.Integer(0))
            for a, c in total.items():
                longer[a + base.args[0]] += plus * c / 2
                longer[a - base.args[0]] += minus * c / 2
            total = longer
    found: Sum = defaultdict(lambda: sympy.Integer(0))
    for a, c in total.items():
        for formula, factor in ((sympy.cos(a), sympy.re(c)), (sympy.sin(a), -sympy.im(c))):
            sign, wave = formula.as_coeff_Mul()
            found[wave] += sign * factor
    return {wave: c for wave, c in found.items() if c}


def _of_polynomial_power(m: sympy.Expr, base: sympy.Expr, exponent: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    """∫ x^m Q^e dx by the substitution u = Q, for Q = αx + β or, with odd m, Q = αx² + β."""
    if exponent.has(x) or not base.is_polynomial(x):
        raise _NoRule
    coefficients = sympy.Poly(base, x).all_coeffs()
    degree = len(coefficients) - 1
    leading, constant, rest = coefficients[0], coefficients[-1], coefficients[1:-1]
    times, odd = divmod(_degree(m) - (degree - 1), degree)
    if degree > 2 or any(rest) or times < 0 or odd:
        raise _NoRule
    total = sympy.Integer(0)
    for j in range(times + 1):  # x^m dx = ((u − β)/α)^times du / (degree α)
        power = exponent + j
        integral = sympy.log(base) if power == -1 else base ** (power + 1) / (power + 1)
        total += math.comb(times, j) * (-constant) ** (times - j) * integral
    return total / (degree * leading ** (times + 1))
