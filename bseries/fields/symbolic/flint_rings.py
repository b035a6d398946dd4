"""Arithmetic of differential rings by python-flint.

Results equal those in Python; products of long polynomials are many times faster.
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
"""Rings with more generators count as open: undefined functions have infinitely many new derivatives."""


def fastest(ring: DifferentialRing) -> DifferentialRing | FlintRing:
    """The fastest arithmetic for a ring: by python-flint, if it is installed and the ring is closed."""
    return FlintRing(ring) if flint() is not None and _is_closed(ring) else ring


class FlintRing:
    """A differential ring closed under differentiation, with polynomials of python-flint as elements."""

    def __init__(self, ring: DifferentialRing):
        self.ring = ring
        self.variables = ring.variables
        inner = ring.polynomials
        self._polynomials = Polynomials(range(inner.size))
        last = inner.size - 1  # python-flint numbers generators from the leading one
        numbers = range(len(self.variables))
        derivatives = [[inner.generator_derivative(k, i) for k in range(inner.size)] for i in numbers]
        self._derivatives = [
            [(last - k, self._polynomials.of(x)) for k, x in enumerate(row) if x] for row in derivatives
        ]
        self._relations = [
            self._polynomials.of({rule.monomial: 1, **{m: -x for m, x in rule.tail}}) for rule in inner.rules
        ]
        self.zero = self._polynomials.of({})

    def load(self, element: Element) -> Any:
        """Convert an element to a polynomial."""
        return self._polynomials.of(element.terms)

    def unload(self, polynomial: Any) -> Element:
        """Convert a polynomial to an element."""
        return Element(self.ring, self._polynomials.terms(polynomial))

    def denominator(self, elements: Iterable[Any]) -> int:
        """1: fractions are as fast as integers here."""
        return 1

    def derivative(self, polynomial: Any, i: int) -> Any:
        """The derivative with respect to the i-th variable."""
        return self.dot((polynomial.derivative(k), inner) for k, inner in self._derivatives[i])

    def dot(self, pairs: Iterable[tuple[Any, Any]]) -> Any:
        """A sum of products in normal form."""
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
        """A linear combination."""
        return sum((polynomial * self._polynomials.number(x) for x, polynomial in parts), start=self.zero)


def _is_closed(ring: DifferentialRing) -> bool:
    """Whether a ring is closed under differentiation with at most `MOST_GENERATORS` generators."""
    polynomials, k = ring.polynomials, 0
    while k < polynomials.size <= MOST_GENERATORS:
        for i in range(len(ring.variables)):
            polynomials.generator_derivative(k, i)
        k += 1
    return polynomials.size <= MOST_GENERATORS
