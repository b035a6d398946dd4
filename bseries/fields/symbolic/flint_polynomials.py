"""Polynomials and their factorisation by python-flint, an optional package."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING, Any

from bseries.fields.symbolic.sparse_polynomials import exponent, generator, generators_of, narrowed

if TYPE_CHECKING:
    from bseries.fields.symbolic.sparse_polynomials import Number, Terms


@cache
def flint() -> ModuleType | None:
    """The package, if it is installed and has multivariate polynomials."""
    try:
        import flint as package  # pyright: ignore[reportMissingImports]
    except ImportError:
        return None
    return package if hasattr(package, "fmpq_mpoly_ctx") else None


def irreducible_factors(terms: Terms) -> list[tuple[Terms, int]]:
    """The factors of an integer polynomial with their exponents, up to constants."""
    polynomials = Polynomials(generators_of(terms))
    return [(polynomials.terms(factor), e) for factor, e in polynomials.of(terms).factor()[1]]


class Polynomials:
    """Polynomials with rational coefficients in some generators; the last generator is the leading one."""

    def __init__(self, generators: Sequence[int]):
        package: Any = flint()
        self._generators = tuple(reversed(generators))
        self._rational = package.fmpq
        self.context = package.fmpq_mpoly_ctx.get([f"g{k}" for k in self._generators], package.Ordering.lex)

    def of(self, terms: Terms) -> Any:
        """Convert to a polynomial of python-flint."""
        return self.context.from_dict(
            {tuple(exponent(m, k) for k in self._generators): self.number(x) for m, x in terms.items()}
        )

    def number(self, value: Number) -> Any:
        """Convert a coefficient."""
        return self._rational(value.numerator, value.denominator)

    def terms(self, polynomial: Any) -> Terms:
        """Convert from a polynomial of python-flint."""
        return {
            sum(map(generator, self._generators, map(int, m))): narrowed(Fraction(int(x.p), int(x.q)))
            for m, x in polynomial.to_dict().items()
        }
