"""The arithmetic of a differential ring by python-flint.

Products of long polynomials are many times faster than in Python, those of short ones as fast. The results are equal.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from bseries.fields.symbolic.differential_rings import DifferentialRing, Element
from bseries.fields.symbolic.flint_polynomials import Polynomials, flint
from bseries.fields.symbolic.sparse_polynomials import TooLarge

if TYPE_CHECKING:
    from bseries.fields.symbolic.sparse_polynomials import Number

MOST_GENERATORS = 40
"""Functions such as unknown ones have new derivatives without end."""


def fastest(ring: DifferentialRing) -> DifferentialRing | FlintRing:
    """The arithmetic to use for a ring: python-flint's, if it is installed and all generators are known beforehand."""
    return FlintRing(ring) if flint() is not None and _is_closed(ring) else ring


class FlintRing:
    """A differential ring that has all the generators its derivatives need; elements are polynomials of python-flint.

    Args:
        ring: The ring whose arithmetic this is.
    """

    def __init__(self, ring: DifferentialRing):
        self.ring = ring
        self.variables = ring.variables
        inner = ring.polynomials
        self._polynomials = Polynomials(range(inner.size))
        last = inner.size - 1  # python-flint counts generators from the leading one
        slopes = [[inner.slope_of_generator(k, i) for k in range(inner.size)] for i in range(len(self.variables))]
        self._slopes = [[(last - k, self._polynomials.of(x)) for k, x in enumerate(row) if x] for row in slopes]
        self._relations = [
            self._polynomials.of({rule.monomial: 1, **{m: -x for m, x in rule.tail}}) for rule in inner.rules
        ]
        self.zero = self._polynomials.of({})

    def load(self, element: Element) -> Any:
        """An element as a polynomial."""
        return self._polynomials.of(element.terms)

    def unload(self, polynomial: Any) -> Element:
        """A polynomial as an element."""
        return Element(self.ring, self._polynomials.terms(polynomial))

    def denominator(self, elements: Iterable[Any]) -> int:
        """Fractions are as fast as integers here."""
        return 1

    def derivative(self, polynomial: Any, i: int) -> Any:
        """The derivative with respect to the i-th variable."""
        return self.dot((polynomial.derivative(k), slope) for k, slope in self._slopes[i])

    def dot(self, pairs: Iterable[tuple[Any, Any]]) -> Any:
        """The sum of products, in normal form."""
        total: Any = sum((a * b for a, b in pairs), start=self.zero)
        while True:
            if len(total) > self.ring.polynomials.limit:
                raise TooLarge
            before = total
            for relation in self._relations:
                total = divmod(total, relation)[1]
            if len(self._relations) < 2 or total == before:
                return total

    def sum(self, parts: Iterable[tuple[Number, Any]]) -> Any:
        """The sum of multiples."""
        return sum((polynomial * self._polynomials.number(x) for x, polynomial in parts), start=self.zero)


def _is_closed(ring: DifferentialRing) -> bool:
    """Whether all derivatives of a ring's generators have been made generators, without too many of them."""
    polynomials, k = ring.polynomials, 0
    while k < polynomials.size <= MOST_GENERATORS:
        for i in range(len(ring.variables)):
            polynomials.slope_of_generator(k, i)
        k += 1
    return polynomials.size <= MOST_GENERATORS
