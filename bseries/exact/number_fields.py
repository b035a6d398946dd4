"""Real algebraic numbers given by formulas, as elements of one number field.

Lattice reduction of the powers of a number θ proposes its minimal polynomial, and of a number and powers of θ an
element of Q(θ). Nothing is taken on trust: each proposal is an equation E = 0 between formulas, and is proved. A
formula is a quotient U/L of algebraic integers in a field of degree D, whose conjugates are at most 2^u and 2^v in
absolute value. The norm of U is an integer, so that E = 0 or |E| ≥ 2^(−u(D−1)−v): a ball that contains E and is
smaller decides.

References:
    C. Burnikel, S. Funke, K. Mehlhorn, S. Schirra, S. Schmitt, Algorithmica 55 (2009) 14–28,
    doi:10.1007/s00453-007-9132-4 (the bound); H. Cohen, *A Course in Computational Algebraic Number Theory*, 2.7.2.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from functools import lru_cache, reduce
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exceptions import SeriesError
from integrators.exact.arithmetic import MOST_DEGREE, degree_bound

if TYPE_CHECKING:
    import sympy
    from flint import arb

DEGREES = (2, 4, 8, MOST_DEGREE)
"""Largest degrees of minimal polynomials, one after the other."""
MOST_COEFFICIENT = 256
"""Bits of the coefficients of minimal polynomials: SymPy isolates the roots of larger ones slowly."""
BITS = (16, 64, MOST_COEFFICIENT)
"""Largest sizes of coefficients."""
MOST_BITS = 2**19
"""Largest precision of a proof."""
QUICK_BITS = 2**13
"""More than proposals are made from; wrong ones are refused at this precision."""
MULTIPLES = (1, -1, 2, -2, 3)
"""Q(θ, α) is Q(θ + kα) for all but a few numbers k."""


class NoNumberFieldError(SeriesError):
    """Numbers are in no number field whose degree is small enough."""


class Size(NamedTuple):
    """The bounds u and v on the conjugates of U and L."""

    u: int
    v: int

    def plus(self, other: Size) -> Size:
        """The size of a sum."""
        return Size(max(self.u + other.v, other.u + self.v) + 1, self.v + other.v)

    def times(self, other: Size) -> Size:
        """The size of a product."""
        return Size(self.u + other.u, self.v + other.v)

    def root(self, degree: int) -> Size:
        """The size of a root: of U L^(degree − 1), over L."""
        return Size(-(-(self.u + (degree - 1) * self.v) // degree), self.v)


def domain_of(numbers: Sequence[sympy.Expr], *, few: bool) -> tuple[Any, list[Any]]:
    """SymPy's domain of numbers and formulas, and its elements; `few` says whether SymPy may look for a number field.

    SymPy is fast for roots of rational numbers and for cosines; roots within roots are left to `common_field`.

    Raises:
        NoNumberFieldError: Roots within roots are in no field that was found and proved.
    """
    import sympy

    powers: set[Any] = set().union(*(x.atoms(sympy.Pow) for x in numbers))
    nested = (x for x in powers if x.is_number and x.exp.is_Rational and not (x.exp.is_Integer or x.base.is_Rational))
    if not any(nested) or any(x.free_symbols for x in numbers):
        constructed: Any = sympy.construct_domain(numbers, extension=True if few else None)
        return constructed
    try:
        found = common_field(numbers)
    except ArithmeticError:
        found = None
    if found is None:
        raise NoNumberFieldError(f"entries must lie in a number field of degree {MOST_DEGREE} at most, but did not")
    return found


def common_field(numbers: Sequence[sympy.Expr]) -> tuple[Any, list[Any]] | None:
    """SymPy's domain of a field with these real numbers, and its elements; None if no field was found and proved.

    Raises:
        ArithmeticError: A number cannot be enclosed, such as the inverse of a formula for zero.

    Example:
        >>> import sympy
        >>> field, (x,) = common_field([sympy.sqrt(3 + 2 * sympy.sqrt(2))])
        >>> field.mod.degree(), field.to_sympy(x).evalf(10)
        (2, 2.414213562)
    """
    import sympy

    degree, theta = degree_bound(numbers), sympy.Integer(0)
    polynomial: list[int] | None = [0, 1]
    for number in dict.fromkeys(numbers):
        for k in (0, *MULTIPLES) if theta else (1,):
            polynomial = _minimal_polynomial(theta + k * number, degree)
            if polynomial and _coordinates(number, theta + k * number, len(polynomial) - 1, degree):
                theta += k * number
                break
        else:
            return None
    assert polynomial is not None
    rows = [_coordinates(number, theta, len(polynomial) - 1, degree) for number in numbers]
    if None in rows:
        return None
    x, descending = sympy.Symbol("x"), polynomial[::-1]
    root = sympy.CRootOf(sympy.Poly(descending, x), _index(theta, polynomial))
    field: Any = sympy.QQ.algebraic_field((sympy.Poly(descending, x, domain="QQ"), root))
    return field, [field([field.dom(-a, c) for a in reversed(row)]) for c, *row in filter(None, rows)]


@lru_cache(maxsize=1024)
def _minimal_polynomial(theta: sympy.Expr, degree: int) -> list[int] | None:
    """Coefficients of the minimal polynomial of θ, ascending; None if none was found and proved."""
    from flint import fmpz_poly

    for n, bits in product((n for n in DEGREES if n < 2 * degree), BITS):
        proposed = _relation([theta**k for k in range(n + 1)], bits)
        for factor, _ in fmpz_poly(proposed).factor()[1]:
            coefficients = [int(a) for a in factor.coeffs()]
            small = len(coefficients) > 1 and max(map(abs, coefficients)).bit_length() <= MOST_COEFFICIENT
            if small and is_zero(_horner(coefficients, theta), degree):
                return coefficients
    return None


@lru_cache(maxsize=1024)
def _coordinates(number: sympy.Expr, theta: sympy.Expr, count: int, degree: int) -> list[int] | None:
    """Integers c ≠ 0 and a_0, a_1, …, `count` in number, with c α + a_0 + a_1 θ + … = 0; None if none were found."""
    for bits in BITS:
        c, *row = _relation([number, *(theta**k for k in range(count))], bits)
        if c and is_zero(c * number + _horner(row, theta), degree):
            return [c, *row]
    return None


def _horner(coefficients: Sequence[int], at: sympy.Expr) -> Any:
    """A polynomial in a form with small bounds."""
    value: Any = 0
    for a in reversed(coefficients):
        value = value * at + a
    return value


def _relation(numbers: Sequence[sympy.Expr], bits: int) -> list[int]:
    """Small integers, not all zero, that make the sum of their products with numbers small."""
    from flint import arb, ctx, fmpz_mat

    size = len(numbers)
    balls = [enclosure(x, size * bits) for x in numbers]
    with ctx.workprec(2 * MOST_BITS):
        last: list[Any] = [(x * arb(2) ** (size * bits)).mid().floor().unique_fmpz() for x in balls]
    reduced = fmpz_mat([[*(int(i == j) for j in range(size)), x] for i, x in enumerate(last)]).lll()
    return [int(reduced[0, j]) for j in range(size)]


def is_zero(formula: sympy.Expr, degree: int) -> bool:
    """Whether a formula in a field of at most this degree is proved to be zero."""
    size = _size(formula)
    bits = size.u * (degree - 1) + size.v
    accuracies = (min(bits, QUICK_BITS), bits + 1)
    return bits <= MOST_BITS and all(enclosure(formula, accuracy).contains(0) for accuracy in accuracies)


@lru_cache(maxsize=4096)
def _size(formula: sympy.Expr) -> Size:
    """Bounds for a formula, by those of its operands."""
    import sympy

    if isinstance(formula, sympy.Rational):
        return Size(int(formula.p).bit_length(), int(formula.q).bit_length())
    if isinstance(formula, sympy.Add | sympy.Mul):
        return reduce(Size.plus if formula.is_Add else Size.times, map(_size, formula.args))
    if isinstance(formula, sympy.Pow) and isinstance(formula.exp, sympy.Rational):
        root, times = _size(formula.base).root(int(formula.exp.q)), int(formula.exp.p)
        u, v = root if times > 0 else reversed(root)
        return Size(u * abs(times), v * abs(times))
    if isinstance(formula, sympy.CRootOf):  # Cauchy's bound, times the leading coefficient
        coefficients = [int(a).bit_length() for a in formula.poly.all_coeffs()]
        return Size(max(coefficients) + 1, coefficients[0])
    return Size(1, 1)  # 2 cos x / 2, 2 sin x / 2, 2 sin x / 2 cos x


@lru_cache(maxsize=256)
def enclosure(formula: sympy.Expr, bits: int) -> arb:
    """An enclosure of a number, of radius 2^-bits at most."""
    from flint import arb, ctx

    precision = bits + 64
    while precision <= 4 * MOST_BITS:
        with ctx.workprec(precision):
            ball = _ball(formula, {})
            if ball.is_finite() and ball.rad() * arb(2) ** bits <= 1:
                return ball
        precision *= 2
    raise ArithmeticError("number could not be enclosed")


def _ball(formula: sympy.Expr, known: dict[Any, Any]) -> arb:
    """An enclosure of a number at the present precision; those of its parts become known."""
    if formula not in known:
        known[formula] = _ball_from_parts(formula, known)
    return known[formula]


def _ball_from_parts(formula: sympy.Expr, known: dict[Any, Any]) -> arb:
    import sympy
    from flint import arb, fmpq

    if isinstance(formula, sympy.Rational):
        return arb(fmpq(int(formula.p), int(formula.q)))
    if isinstance(formula, sympy.Add | sympy.Mul):
        operation = operator.add if formula.is_Add else operator.mul
        return reduce(operation, (_ball(part, known) for part in formula.args))
    if isinstance(formula, sympy.Pow) and isinstance(formula.exp, sympy.Rational):
        if formula.exp.q > 1:
            return _ball(formula.base, known).root(int(formula.exp.q)) ** int(formula.exp.p)
        return _ball(formula.base, known) ** int(formula.exp.p)
    if isinstance(formula, sympy.CRootOf):
        return _real_roots([int(a) for a in reversed(formula.poly.all_coeffs())])[formula.index]
    if isinstance(formula, sympy.cos | sympy.sin | sympy.tan):
        turns = formula.args[0] / sympy.pi
        if isinstance(turns, sympy.Rational):
            sine, cosine = arb.sin_cos_pi_fmpq(fmpq(int(turns.p), int(turns.q)))
            return {"cos": cosine, "sin": sine, "tan": sine / cosine}[formula.func.__name__]
    raise ArithmeticError("is not made of roots and cosines")


def _real_roots(ascending: Sequence[int]) -> list[arb]:
    """Enclosures of the real roots of an irreducible polynomial, in ascending order."""
    from flint import fmpz_poly

    roots: list[Any] = fmpz_poly(list(ascending)).complex_roots()
    return sorted((root.real for root, _ in roots if root.imag == 0), key=lambda root: root.mid())


def _index(theta: sympy.Expr, ascending: Sequence[int]) -> int:
    """Which real root of its minimal polynomial θ is."""
    from flint import ctx

    bits = 64
    while True:
        with ctx.workprec(bits):
            ball = enclosure(theta, bits)
            found = [k for k, root in enumerate(_real_roots(ascending)) if root.overlaps(ball)]
        if len(found) == 1:
            return found[0]
        bits *= 2
