"""Power series in h with coefficients in a differential ring, and their composition with formulas.

A formula at y(h) = y_0 + h y_1 + … is a polynomial in the generators of its ring at y(h). The generators follow from
their differential equations: if ∂g/∂y_i = D_i, again a polynomial in generators, then

    n g_n = Σ_i Σ_{m=1}^n m y_{i,m} D_{i,n−m}.

So no Taylor series in several variables is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import sympy

from bseries.fields.symbolic.differential_rings import MOST_MONOMIALS, DifferentialRing
from bseries.fields.symbolic.polynomials import Element, Monomial, Number


class PowerSeries:
    """Power series in h over a ring, with coefficients computed on demand, from lower ones of this and other series."""

    __slots__ = ("_coefficient", "_known", "ring")

    def __init__(self, ring: DifferentialRing, coefficient: Callable[[int], Element]):
        self.ring = ring
        self._coefficient = coefficient
        self._known: list[Element] = []

    @classmethod
    def polynomial(cls, *coefficients: Element) -> PowerSeries:
        """The series with these coefficients and zeros."""
        ring: Any = coefficients[0].ring
        return cls(ring, lambda n: coefficients[n] if n < len(coefficients) else ring.zero)

    def __getitem__(self, n: int) -> Element:
        while len(self._known) <= n:
            self._known.append(self._coefficient(len(self._known)))
        return self._known[n]

    def __mul__(self, other: PowerSeries) -> PowerSeries:
        def coefficient(n: int) -> Element:
            return self.ring.dot((self[j], other[n - j]) for j in range(n + 1) if self[j] and other[n - j])

        return PowerSeries(self.ring, coefficient)


def combination(ring: DifferentialRing, parts: Sequence[tuple[Element | Number, PowerSeries]]) -> PowerSeries:
    """A linear combination of series, with numbers or elements as factors."""
    return PowerSeries(ring, lambda n: ring.dot((x, series[n]) for x, series in parts))


class Composition:
    """Composition of formulas of a ring with a power series for each of its variables.

    `start` gives the values of the generators at h = 0, by index; by default the generators themselves, for series in
    the ring of the formulas whose first coefficients are its variables.
    """

    def __init__(
        self,
        formulas: DifferentialRing,
        point: Sequence[PowerSeries],
        start: Callable[[int], Element] | None = None,
    ):
        self._ring = point[0].ring
        self._formulas = formulas
        self._point = point
        self._start = start or formulas.generator
        self._monomials: dict[Monomial, PowerSeries] = {(): PowerSeries.polynomial(self._ring.coerce(1))}

    def __call__(self, formula: Element) -> PowerSeries:
        """The composition with a formula."""
        return combination(self._ring, [(x, self._monomial(monomial)) for monomial, x in formula.terms.items()])

    def _monomial(self, monomial: Monomial) -> PowerSeries:
        found = self._monomials.get(monomial)
        if found is None:
            *newer, (k, e) = monomial
            if monomial == ((k, 1),):
                found = self._generator(k)
            else:
                rest = (*newer, (k, e - 1)) if e > 1 else tuple(newer)
                found = self._monomial(rest) * self._monomial(((k, 1),))
            self._monomials[monomial] = found
        return found

    def _generator(self, k: int) -> PowerSeries:
        """The composition with a generator, by its differential equation."""
        derivatives: list[tuple[PowerSeries, PowerSeries]] = []  # a variable and the derivative in it

        def coefficient(n: int) -> Element:
            if n == 0:
                return self._start(k)
            if n == 1:  # not earlier: undefined functions have infinitely many derivatives
                ring = self._formulas
                found = ((y, ring.generator_derivative(k, i)) for i, y in enumerate(self._point))
                derivatives.extend((y, self(D)) for y, D in found if D)
            pairs = ((Fraction(m, n) * y[m], D[n - m]) for y, D in derivatives for m in range(1, n + 1) if y[m])
            return self._ring.dot(pairs)

        return PowerSeries(self._ring, coefficient)


class Expansion:
    """Formulas as power series in h, for variables that are power series in h.

    `start` has the values of all variables, including h, at h = 0. These values, and `others`, are formulas in
    `variables`.
    """

    def __init__(
        self,
        formulas: Sequence[sympy.Expr],
        start: Mapping[sympy.Symbol, sympy.Expr],
        variables: Sequence[sympy.Symbol],
        others: Sequence[sympy.Expr] = (),
    ):
        self._start = dict(start)
        self.formulas = DifferentialRing(formulas, start, limit=MOST_MONOMIALS)
        self.elements = self.formulas.elements
        used = {k for element in self.elements for k in element.generators}
        values = (self._value(k) for k in sorted(used))
        self.ring = DifferentialRing([*others, *values], variables, limit=MOST_MONOMIALS)

    def _value(self, k: int) -> Any:
        """The value of a generator at h = 0; roots are those of positive numbers, as in the ring."""
        value: Any = self.formulas.generators[k].xreplace(self._start).doit()  # for derivatives of undefined functions
        return sympy.powdenest(sympy.together(value), force=True) if isinstance(value, sympy.Pow) else value

    def at(self, point: Sequence[PowerSeries]) -> Composition:
        """The composition with a point, given by a series for every variable in the order of `start`."""
        return Composition(self.formulas, point, lambda k: self.ring.element(self._value(k)))
