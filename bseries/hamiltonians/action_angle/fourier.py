"""Fourier polynomials in angles, with exact functions of the actions as coefficients.

f(a, θ) = Σ_k (c_k(a) cos k·θ + s_k(a) sin k·θ), with one k of each pair ±k. Products follow from the addition theorems,
so that the modes of a formula are found without a search for simplifications.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from random import Random
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.differential_rings import MOST_MONOMIALS, DifferentialRing
from bseries.fields.symbolic.polynomials import Element

if TYPE_CHECKING:
    import sympy

    Number = int | Fraction

MOST_POWER = 50
"""Higher powers of trigonometric polynomials raise an error."""

DIGITS = 100
POINTS = 3
"""A coefficient that vanishes to this number of digits at this number of points is zero."""


class Mode(NamedTuple):
    """Mode cos k·θ or sin k·θ; the first nonzero entry of k is positive."""

    k: tuple[int, ...]
    is_sine: bool


FourierPolynomial: TypeAlias = "dict[Mode, Element]"


class FourierRing:
    """Ring of Fourier polynomials in angles, over a ring of functions of the actions that contains given formulas.

    Args:
        formulas: The SymPy expressions that the ring contains.
        actions: The symbols of the actions; further symbols are parameters.
        angles: The symbols of the angles.
        limit: Coefficients with more monomials raise `TooLarge`.

    Example:
        >>> import sympy
        >>> a, theta = sympy.symbols("a theta")
        >>> fourier = FourierRing([sympy.sqrt(a) * sympy.sin(theta) ** 3], [a], [theta])
        >>> fourier.expression(fourier.read(sympy.sqrt(a) * sympy.sin(theta) ** 3))
        3*sqrt(a)*sin(theta)/4 - sqrt(a)*sin(3*theta)/4
    """

    def __init__(
        self,
        formulas: Iterable[sympy.Expr],
        actions: Sequence[sympy.Symbol],
        angles: Sequence[sympy.Symbol],
        *,
        limit: int = MOST_MONOMIALS,
    ):
        self.actions, self.angles = tuple(actions), tuple(angles)
        self._angles = set(self.angles)
        leaves = [leaf for formula in formulas for leaf in self._leaves(formula)]
        self.coefficients = DifferentialRing(leaves, self.actions, limit=limit)
        self.constant = Mode((0,) * len(self.angles), False)

    def _leaves(self, formula: Any) -> Iterator[Any]:
        """The largest parts of a formula without angles."""
        if not formula.free_symbols & self._angles:
            yield formula
        else:
            for part in formula.args:
                yield from self._leaves(part)

    # Reading and writing.

    def read(self, formula: Any) -> FourierPolynomial:
        """Convert a formula to a Fourier polynomial."""
        if not formula.free_symbols & self._angles:
            return self._clean({self.constant: self.coefficients.element(formula)})
        if formula.is_Add:
            return self.sum((1, self.read(part)) for part in formula.args)
        if formula.is_Mul:
            return self._product(map(self.read, formula.args))
        if formula.is_Pow and formula.exp.is_Integer and 0 < formula.exp <= MOST_POWER:
            return self._product([self.read(formula.base)] * int(formula.exp))
        return self._wave(formula)

    def _wave(self, formula: Any) -> FourierPolynomial:
        """Convert cos(k·θ + β) = cos β cos k·θ − sin β sin k·θ, or a sine."""
        import sympy

        if isinstance(formula, sympy.sin | sympy.cos):
            argument = sympy.expand(formula.args[0])
            k = [argument.diff(angle) for angle in self.angles]
            if all(n.is_Integer for n in k):
                k, is_sine = tuple(map(int, k)), isinstance(formula, sympy.sin)
                phase = argument.xreplace(dict.fromkeys(self.angles, sympy.Integer(0)))
                cosine, sine = sympy.cos(phase), sympy.sin(phase)
                weights = {False: sine, True: cosine} if is_sine else {False: cosine, True: -sine}
                return self.sum(
                    (sign, {mode: self.coefficients.element(weight)})
                    for kind, weight in weights.items()
                    for sign, mode in _canonical(k, kind)
                )
        names = ", ".join(map(str, self.angles))
        raise SeriesError(
            f"hamiltonian must have finitely many Fourier modes, of period 2π in {names}, but has {formula!s:.60}"
        )

    def expression(self, f: FourierPolynomial, *, simplify: bool = True) -> sympy.Expr:
        """The SymPy expression, with factored coefficients if `simplify`."""
        import sympy

        total: list[Any] = []
        for (k, is_sine), x in sorted(f.items(), key=lambda item: (sum(map(abs, item[0].k)), item[0])):
            argument = sympy.Add(*(n * angle for n, angle in zip(k, self.angles, strict=True)))
            wave = sympy.sin(argument) if is_sine else sympy.cos(argument)
            total.append(self.coefficients.to_expression(x, simplify=simplify) * wave)
        return sympy.Add(*total)

    # Arithmetic.

    def sum(self, parts: Iterable[tuple[Number, FourierPolynomial]]) -> FourierPolynomial:
        """A linear combination."""
        gathered: dict[Mode, list[tuple[Number, Element]]] = defaultdict(list)
        for factor, f in parts:
            for mode, x in f.items():
                gathered[mode].append((factor, x))
        return self._clean({mode: self.coefficients.dot(summands) for mode, summands in gathered.items()})

    def dot(self, pairs: Iterable[tuple[FourierPolynomial, FourierPolynomial]]) -> FourierPolynomial:
        """A sum of products."""
        gathered: dict[Mode, list[tuple[Number, Element]]] = defaultdict(list)
        for f, g in pairs:
            for left, x in f.items():
                for right, y in g.items():
                    xy = x * y
                    for factor, mode in _superposition(left, right):
                        gathered[mode].append((factor, xy))
        return self._clean({mode: self.coefficients.dot(summands) for mode, summands in gathered.items()})

    def _product(self, factors: Iterable[FourierPolynomial]) -> FourierPolynomial:
        result: FourierPolynomial = {self.constant: self.coefficients.coerce(1)}
        for factor in factors:
            result = self.dot([(result, factor)])
        return result

    def along_action(self, f: FourierPolynomial, i: int) -> FourierPolynomial:
        """The derivative with respect to the i-th action."""
        return self._clean({mode: self.coefficients.derivative(x, i) for mode, x in f.items()})

    def along_angle(self, f: FourierPolynomial, i: int) -> FourierPolynomial:
        """The derivative with respect to the i-th angle."""
        derivatives = {Mode(k, not is_sine): (k[i] if is_sine else -k[i]) * x for (k, is_sine), x in f.items() if k[i]}
        return self._clean(derivatives)

    def _clean(self, f: FourierPolynomial) -> FourierPolynomial:
        return {mode: x for mode, x in f.items() if x}

    def is_zero(self, x: Element) -> bool:
        """Whether a coefficient is zero, by the relations of the ring or to 100 digits at several points.

        The ring does not use all relations between numbers, such as √(3 + 2√2) = 1 + √2.
        """
        return self.coefficients.is_zero(x) or all(self._vanishes(x, Random(seed)) for seed in range(POINTS))

    def _vanishes(self, x: Element, random: Random) -> bool:
        """Whether a coefficient is zero to many digits, relative to its monomials, at a random point."""
        import mpmath
        import sympy

        used = x.generators
        formulas = [self.coefficients.generators[k] for k in used]
        symbols = sorted(set().union(*(formula.free_symbols for formula in formulas)), key=str)
        with mpmath.workdps(DIGITS + 20):
            # Both signs, to distinguish √(a²) from a.
            point = [mpmath.mpf(random.randint(-999_999, 999_999)) / 300_007 for _ in symbols]
            try:
                values = dict(zip(used, sympy.lambdify(symbols, formulas, "mpmath", dummify=True)(*point), strict=True))
            except (ArithmeticError, ValueError):  # outside the domain of a function
                return False
            summands = [
                mpmath.mpf(number.numerator) / number.denominator * mpmath.fprod(values[k] ** n for k, n in powers)
                for powers, number in x.terms.items()
            ]
            return bool(abs(mpmath.fsum(summands)) <= mpmath.fsum(map(abs, summands)) * mpmath.mpf(10) ** -DIGITS)

    def reciprocal(self, x: Element) -> Element:
        """One over a coefficient, with rationalised denominators for numbers."""
        import sympy

        ring = self.coefficients
        value: Any = ring.to_expression(x)
        if value.is_number:
            return ring.element(sympy.radsimp(1 / value))
        return ring.raised(x, Fraction(-1))


def _canonical(k: tuple[int, ...], is_sine: bool) -> Iterator[tuple[int, Mode]]:
    """The mode of a wave with its sign; sin 0 has none."""
    leading = next((n for n in k if n), 0)
    if leading or not is_sine:
        flipped = leading < 0
        yield -1 if flipped and is_sine else 1, Mode(tuple(-n for n in k) if flipped else k, is_sine)


def _superposition(left: Mode, right: Mode) -> Iterator[tuple[Fraction, Mode]]:
    """A product of two waves as a sum, such as 2 sin j sin k = cos(j − k) − cos(j + k)."""
    total = tuple(j + k for j, k in zip(left.k, right.k, strict=True))
    difference = tuple(j - k for j, k in zip(left.k, right.k, strict=True))
    is_sine = left.is_sine != right.is_sine
    signs = {(False, False): (1, 1), (True, True): (1, -1), (True, False): (1, 1), (False, True): (-1, 1)}
    for sign, k in zip(signs[left.is_sine, right.is_sine], (difference, total), strict=True):
        for flip, mode in _canonical(k, is_sine):
            yield Fraction(sign * flip, 2), mode
