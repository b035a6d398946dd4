"""Roots of generating polynomials: the root condition, parasitic modes, and A(α)-stability, decided exactly.

Roots of modulus 1 of a real polynomial are roots of g, its greatest common divisor with the reciprocal polynomial. With
ζ also 1/ζ̄ is a root of g, so that both are equal, and |ζ| = 1, if disjoint balls around the roots of g leave no other
choice. Other roots are told from the unit circle by balls of enough digits.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

from integrators.core.errors import IntegratorError
from integrators.exact.arithmetic import in_sympy
from integrators.exact.entries import Entry, find_domain, round_entry
from integrators.exact.polynomials import to_flint

MOST_BITS = 1 << 14
"""Balls of more bits are not tried; roots that differ so little do not come from coefficients of reasonable size."""


class ParasiticMode(NamedTuple):
    """A root ζ ≠ 1 of ρ on the unit circle and its growth parameter μ = σ(ζ)/(ζ ρ'(ζ)).

    To first order, a parasitic component z ζ^n obeys z' = μ f'(y) z (HLW, theorem XV.3.2).

    Example:
        >>> import bseries as bs
        >>> milne = bs.memory.symmetric_multistep(["pi/2", "pi"])
        >>> [(mode.root, round(mode.growth.real, 10)) for mode in milne.growth_parameters]
        [((-1+0j), -1.6666666667), (-1j, 0.3333333333), (1j, 0.3333333333)]
    """

    root: complex
    growth: complex

    def __str__(self) -> str:
        return f"{self.root:.6g} grows with {self.growth:.6g}"


def roots(coefficients: Sequence[Entry]) -> tuple[complex, ...]:
    """The roots of a polynomial (ascending coefficients) with multiplicities: largest first, 1 first among equals."""
    found = [_complex(ball) for ball, count in _isolated(coefficients, 100) for _ in range(count)]
    return tuple(sorted(found, key=lambda z: (-round(abs(z), 12), abs(z - 1) > 1e-12, -abs(cmath.phase(z)), z.imag)))


def satisfies_root_condition(coefficients: Sequence[Entry]) -> bool:
    """Whether no root has modulus above 1, and those of modulus 1 are simple."""
    circle, outside = on_and_outside(coefficients)
    return not outside and all(count == 1 for _, count in circle)


def parasitic_modes(alpha: Sequence[Entry], beta: Sequence[Entry]) -> tuple[ParasiticMode, ...]:
    """The modes of the simple roots ζ ≠ 1 of ρ on the unit circle."""
    circle, _ = on_and_outside(alpha)
    rho, sigma = ([round_entry(x) for x in row] for row in (alpha, beta))
    zetas = [_complex(ball) for ball, count in circle if count == 1 and not (ball - 1).contains(0)]
    modes = []
    for zeta in sorted(zetas, key=lambda z: (-abs(cmath.phase(z)), z.imag)):
        slope = sum(j * a * zeta ** (j - 1) for j, a in enumerate(rho) if j)
        modes.append(ParasiticMode(zeta, sum(b * zeta**j for j, b in enumerate(sigma)) / (zeta * slope)))
    return tuple(modes)


def on_and_outside(coefficients: Sequence[Entry]) -> tuple[list[tuple[Any, int]], int]:
    """The roots of modulus 1 with their multiplicities, and the number of those of larger modulus."""
    rational = (domain := find_domain(coefficients)) == "QQ"
    if domain == "algebraic" and not _is_reciprocal(coefficients):
        raise IntegratorError("alpha must be rational, or symmetric, for the roots on the unit circle to be known")
    import flint

    bits = 100
    while bits <= MOST_BITS:
        with flint.ctx.workprec(bits):
            balls = _isolated(coefficients, bits)
            reciprocal = _isolated(_reciprocal_part(coefficients), bits) if rational else balls
            found = _told_apart(balls, [ball for ball, _ in reciprocal])
        if found is not None:
            return found
        bits *= 2
    raise IntegratorError(
        "alpha must have roots that are known to be on the unit circle or not, but some are too close"
    )


def _told_apart(
    balls: Sequence[tuple[Any, int]], reciprocal: Sequence[Any]
) -> tuple[list[tuple[Any, int]], int] | None:
    """The roots on the unit circle and the number of those outside; None where the balls do not tell."""
    circle, outside = [], 0
    for ball, count in balls:
        size = abs(ball)
        if size > 1 or size < 1:
            outside += bool(size > 1)
            continue
        mirrored = 1 / ball.conjugate()
        own = [other for other in reciprocal if other.overlaps(ball)]
        if len(own) != 1 or sum(bool(other.overlaps(own[0])) for other, _ in balls) != 1:
            return None  # the ball in `own` may be that of another root
        if [other for other in reciprocal if other.overlaps(mirrored)] != own:
            return None  # ζ and 1/ζ̄ may be different roots
        circle.append((ball, count))
    return circle, outside


def _is_reciprocal(coefficients: Sequence[Entry]) -> bool:
    """Whether a polynomial is its own reciprocal, up to the sign."""
    return any(
        all(x - sign * y == 0 for x, y in zip(coefficients, coefficients[::-1], strict=True)) for sign in (1, -1)
    )


def _reciprocal_part(coefficients: Sequence[Entry]) -> list[Fraction]:
    """The greatest common divisor of a rational polynomial and its reciprocal."""
    found = _flint(coefficients).gcd(_flint([*coefficients][::-1]))
    return [Fraction(int(x.p), int(x.q)) for x in found.coeffs()]


def _flint(coefficients: Sequence[Any]) -> Any:
    from flint import fmpq_poly

    return fmpq_poly(list(map(to_flint, coefficients)))


def _isolated(coefficients: Sequence[Entry], bits: int) -> list[tuple[Any, int]]:
    """Disjoint balls around the roots, with multiplicities; roots of formulas must be simple."""
    import flint

    with flint.ctx.workprec(bits):
        if find_domain(coefficients) == "QQ":
            return _flint(coefficients).complex_roots() if len(coefficients) > 1 else []
        if find_domain(coefficients) == "symbolic":
            raise IntegratorError("alpha must have no symbols for its roots to be known")
        import sympy

        digits, numbers = bits // 3, []
        for x in coefficients:
            value = sympy.N(in_sympy(x), digits + 10)
            numbers.append(flint.arb(str(value), f"1e-{digits - 5}"))
        try:
            return [(root, 1) for root in flint.acb_poly(numbers).roots(tol=flint.arb(2) ** (-bits // 2))]
        except ValueError:
            raise IntegratorError("alpha must have simple roots if its entries are irrational") from None


def _complex(ball: Any) -> complex:
    real, imag = (float(part.mid()) if abs(part) > 1e-20 else 0.0 for part in (ball.real, ball.imag))
    return complex(real, imag)


def stability_angle(alpha: Sequence[Entry], beta: Sequence[Entry]) -> float | None:
    """The largest angle α, in degrees, of a sector around the negative real axis in which a method is stable.

    The boundary of the stability region is on the root locus z = ρ(ζ)/σ(ζ), |ζ| = 1. All of the sector is stable if the
    axis is and the locus does not enter. The argument of z is extremal where Re(ζρ'/ρ − ζσ'/σ) = 0, a polynomial in
    cos θ, or where z is 0 or infinite.
    """
    if find_domain([*alpha, *beta]) != "QQ":
        raise IntegratorError("alpha and beta must be rational for the stability angle")
    real, imag = _real_part(alpha, beta), _imaginary_part(alpha, beta)
    if not _stable_on_axis(alpha, beta, real, imag):
        return None
    if _is_nonnegative(real):
        return 90.0
    slopes = [[j * x for j, x in enumerate(row)] for row in (alpha, beta)]
    turning = _real_part(slopes[0], alpha) * _real_part(beta, beta)
    turning -= _real_part(slopes[1], beta) * _real_part(alpha, alpha)
    import mpmath

    with mpmath.workdps(80):
        ends, near = [mpmath.mpf(0), mpmath.pi], mpmath.mpf(10) ** -25
        angles = [*ends, *(mpmath.acos(mpmath.mpf(x.mid().str(70, radius=False))) for x in _between(turning))]
        points = [theta + shift for theta in angles for shift in (-near, near) if 0 < theta + shift < mpmath.pi]
        exact: Any = alpha, beta
        rho, sigma = ([mpmath.mpf(x.numerator) / x.denominator for x in row] for row in exact)

        def angle(theta: Any) -> Any:
            zeta = mpmath.expj(theta)
            z = mpmath.polyval(rho[::-1], zeta) / mpmath.polyval(sigma[::-1], zeta)
            return abs(mpmath.arg(-z))

        return float(mpmath.degrees(min(map(angle, points))))


def _stable_on_axis(alpha: Sequence[Any], beta: Sequence[Any], real: Any, imag: Any) -> bool:
    """Whether the open negative real axis is stable: z = −1 is, and the locus does not meet the axis."""
    at = [a + b for a, b in zip(alpha, beta, strict=True)]
    circle, outside = on_and_outside(at)
    if at[-1] == 0 or circle or outside or real(1) < 0 or real(-1) < 0:
        return False
    meets = imag // imag.gcd(real)  # common roots are those with z = 0 or infinity
    return not any(bool(_value(real, x) < 0) for x in _between(meets))


def _value(polynomial: Any, at: Any) -> Any:
    value = 0 * at
    for x in reversed(polynomial.coeffs()):
        value = value * at + x
    return value


def _between(polynomial: Any) -> Iterator[Any]:
    """The real roots in (−1, 1) as balls of 300 bits."""
    import flint

    for end in (1, -1):
        factor = flint.fmpq_poly([-end, 1])
        while polynomial.degree() > 0 and polynomial(end) == 0:
            polynomial //= factor
    with flint.ctx.workprec(300):
        for root, _ in polynomial.complex_roots() if polynomial.degree() > 0 else ():
            if root.imag == 0 and abs(root.real) < 1:
                yield root.real


def _is_nonnegative(polynomial: Any) -> bool:
    """Whether a rational polynomial is nonnegative on [−1, 1]: so it is between its roots, and at the ends."""
    inner = sorted([-1.0, *(float(x.mid()) for x in _between(polynomial)), 1.0])
    middles = [Fraction(x + y) / 2 for x, y in pairwise(inner)]
    return all(polynomial(to_flint(x)) >= 0 for x in middles)


def _products(p: Sequence[Any], q: Sequence[Any]) -> dict[int, Any]:
    """The coefficients of p(ζ) q(1/ζ) by powers of ζ."""
    found: dict[int, Any] = {}
    for i, x in enumerate(p):
        for j, y in enumerate(q):
            found[i - j] = found.get(i - j, 0) + x * y
    return found


def _real_part(p: Sequence[Any], q: Sequence[Any]) -> Any:
    """Re p(ζ) q(ζ̄) for |ζ| = 1 as a polynomial in cos θ."""
    from flint import fmpq_poly

    first = [fmpq_poly([1]), fmpq_poly([0, 1])]  # Chebyshev polynomials T_0, T_1
    return _in_cosine(_products(p, q), first, lambda m: 1)


def _imaginary_part(p: Sequence[Any], q: Sequence[Any]) -> Any:
    """Im p(ζ) q(ζ̄) / sin θ for |ζ| = 1 as a polynomial in cos θ."""
    from flint import fmpq_poly

    first = [fmpq_poly([0]), fmpq_poly([1])]  # U_{−1}, U_0: sin mθ = sin θ U_{m−1}
    return _in_cosine(_products(p, q), first, lambda m: int(math.copysign(1, m)))


def _in_cosine(terms: dict[int, Any], polynomials: list[Any], sign: Any) -> Any:
    from flint import fmpq_poly

    total = fmpq_poly([0])
    while len(polynomials) <= max(map(abs, terms)):
        polynomials.append(fmpq_poly([0, 2]) * polynomials[-1] - polynomials[-2])
    for m, x in terms.items():
        total += polynomials[abs(m)] * to_flint(sign(m) * Fraction(x))
    return total
