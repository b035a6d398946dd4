"""Power series in h with coefficients in a differential ring, and their composition with formulas.

A formula at y(h) = y_0 + h y_1 + … is a polynomial in the generators of its ring at y(h). The generators follow from
their differential equations: if ∂g/∂y_i = D_i, again a polynomial in generators, then

    n g_n = Σ_i Σ_{m=1}^n m y_{i,m} D_{i,n−m}.

So no Taylor series in several variables is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bseries.fields.symbolic.differential_rings import MOST_MONOMIALS, DifferentialRing, Element
from bseries.fields.symbolic.flint_rings import fastest
from bseries.fields.symbolic.sparse_polynomials import ONE, exponents, generator, generators_of

if TYPE_CHECKING:
    import sympy

    from bseries.fields.symbolic.sparse_polynomials import Number, Terms


class PowerSeries:
    """Power series in h, with coefficients computed on demand, from lower ones of this and other series."""

    __slots__ = ("_coefficient", "_known")

    def __init__(self, coefficient: Callable[[int], Any]):
        self._coefficient = coefficient
        self._known: list[Any] = []

    def __getitem__(self, n: int) -> Any:
        while len(self._known) <= n:
            self._known.append(self._coefficient(len(self._known)))
        return self._known[n]


class SeriesArithmetic:
    """Sums and products of power series; the fastest arithmetic needs a ring `closed` to new generators."""

    def __init__(self, ring: DifferentialRing, *, closed: bool = True):
        self.ring = ring
        self.coefficients: Any = fastest(ring) if closed else ring
        self.zero = self.coefficients.zero

    def element(self, value: Element | Number) -> Any:
        """Convert an element of the ring, or a number, to the arithmetic."""
        return self.coefficients.load(self.ring.coerce(value))

    def read(self, formula: sympy.Expr) -> Any:
        """Convert a formula to the arithmetic."""
        return self.element(self.ring.element(formula))

    def to_expressions(self, elements: Iterable[Any]) -> tuple[sympy.Expr, ...]:
        """Convert elements to formulas."""
        return tuple(self.ring.to_expression(self.coefficients.unload(element)) for element in elements)

    def polynomial(self, *coefficients: Any) -> PowerSeries:
        """The series with these coefficients and zeros."""
        return PowerSeries(lambda n: coefficients[n] if n < len(coefficients) else self.zero)

    def product(self, a: PowerSeries, b: PowerSeries) -> PowerSeries:
        """The product of two series."""
        return PowerSeries(lambda n: self.coefficients.dot((a[j], b[n - j]) for j in range(n + 1) if a[j] and b[n - j]))

    def combine(self, parts: Iterable[tuple[Any, Any]]) -> Any:
        """A linear combination of elements, with numbers or elements as factors."""
        numbers: list[tuple[Any, Any]] = []
        others: list[tuple[Any, Any]] = []
        for part in parts:
            (numbers if isinstance(part[0], int | Fraction) else others).append(part)
        total = self.coefficients.sum(numbers)
        return self.coefficients.sum([(1, total), (1, self.coefficients.dot(others))]) if others else total

    def dot(self, parts: Sequence[tuple[Any, PowerSeries]]) -> PowerSeries:
        """A linear combination of series, with numbers or elements as factors."""
        return PowerSeries(lambda n: self.combine((x, series[n]) for x, series in parts))

    def times_h(self, a: PowerSeries) -> PowerSeries:
        """h times a series; the coefficient of h^n needs that of h^(n−1) only."""
        return PowerSeries(lambda n: a[n - 1] if n else self.zero)


class Composition:
    """Composition of formulas with power series in place of their variables.

    Args:
        arithmetic: The arithmetic of the series.
        formulas: The ring of the formulas.
        point: A series for each of its variables.
        start: The values of the generators at h = 0, by index; by default the generators themselves, for series in the
            ring of the formulas whose first coefficients are its variables.
    """

    def __init__(
        self,
        arithmetic: SeriesArithmetic,
        formulas: DifferentialRing,
        point: Sequence[PowerSeries],
        start: Callable[[int], Any] | None = None,
    ):
        self._arithmetic = arithmetic
        self._formulas = formulas
        self._point = point
        self._start = start or (lambda k: arithmetic.element(Element(formulas, {generator(k): 1})))
        self._monomials: dict[int, PowerSeries] = {ONE: arithmetic.polynomial(arithmetic.element(1))}

    def __call__(self, formula: Element) -> PowerSeries:
        """The composition with a formula."""
        return self._polynomial(formula.terms)

    def _polynomial(self, terms: Terms) -> PowerSeries:
        return self._arithmetic.dot([(x, self._monomial(monomial)) for monomial, x in terms.items()])

    def _monomial(self, monomial: int) -> PowerSeries:
        found = self._monomials.get(monomial)
        if found is None:
            k, _ = next(exponents(monomial))
            one = generator(k)
            if monomial == one:
                found = self._generator(k)
            else:
                found = self._arithmetic.product(self._monomial(monomial - one), self._monomial(one))
            self._monomials[monomial] = found
        return found

    def _generator(self, k: int) -> PowerSeries:
        """The composition with a generator, by its differential equation."""
        ring = self._arithmetic.coefficients
        derivatives: list[tuple[PowerSeries, PowerSeries]] = []

        def coefficient(n: int) -> Any:
            if n == 0:
                return self._start(k)
            if n == 1:  # not earlier: undefined functions have infinitely many derivatives
                derivatives.extend(self._derivatives(k))
            pairs = [(ring.sum([(m, y[m])]), D[n - m]) for y, D in derivatives for m in range(1, n + 1) if y[m]]
            return ring.sum([(Fraction(1, n), ring.dot(pairs))])

        return PowerSeries(coefficient)

    def _derivatives(self, k: int) -> list[tuple[PowerSeries, PowerSeries]]:
        """Pairs of a variable and the derivative of a generator in it, as series."""
        polynomials = self._formulas.polynomials
        found = ((y, polynomials.generator_derivative(k, i)) for i, y in enumerate(self._point))
        return [(y, self._polynomial(D)) for y, D in found if D]


class Expansion:
    """Formulas as power series in h, for variables that are power series in h.

    Args:
        formulas: The formulas, which become the `elements`.
        start: The values of all variables, including h, at h = 0: formulas in other variables.
        variables: The variables of the values.
        others: Further formulas in these variables.
        limit: Largest number of monomials of a coefficient.
    """

    def __init__(
        self,
        formulas: Sequence[sympy.Expr],
        start: Mapping[sympy.Symbol, sympy.Expr],
        variables: Sequence[sympy.Symbol],
        others: Sequence[sympy.Expr] = (),
        *,
        limit: int = MOST_MONOMIALS,
    ):
        self._start = dict(start)
        self.formulas = DifferentialRing(formulas, start, limit=limit)
        self.elements = self.formulas.elements
        used = {k for element in self.elements for k in generators_of(element.terms)}
        values = (self._value(k) for k in sorted(used))
        self.ring = DifferentialRing([*others, *values], variables, limit=limit)
        self.arithmetic = SeriesArithmetic(self.ring, closed=False)  # derivatives of the formulas add generators

    def _value(self, k: int) -> Any:
        """The value of a generator at h = 0; roots are those of positive numbers, as in the ring."""
        import sympy

        value: Any = self.formulas.generators[k].xreplace(self._start).doit()  # for derivatives of undefined functions
        return sympy.powdenest(sympy.together(value), force=True) if isinstance(value, sympy.Pow) else value

    def at(self, point: Sequence[PowerSeries]) -> Composition:
        """The composition with a point, given by a series for every variable in the order of `start`."""
        return Composition(self.arithmetic, self.formulas, point, lambda k: self.arithmetic.read(self._value(k)))
