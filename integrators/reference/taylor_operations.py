"""Operations on power series along a solution, each done once.

A register holds the series of a quantity: first those of the variables, then the constant 1, then one for each
operation. Every elementary function f solves an equation f(u)' = g u' with another register g, so that one operation
serves them all.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import Any, TypeAlias

from integrators.core.errors import IntegratorError, shorten
from integrators.exact.expressions import ELEMENTARY

Term: TypeAlias = tuple[Any, int]
"""A number of mpmath times a register."""

LINEAR, PRODUCT, POWER, FUNCTION = range(4)
"""The kinds of operations; `FUNCTION` + k is the function ELEMENTARY[k]."""
MAX_OPERATIONS = 1_000_000
"""Their series take 600 megabytes."""
PARTNERS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}


class Operations:
    """A list of operations that grows as values are asked for.

    Attributes:
        one: The register of the constant 1.
        rows: For each operation its kind, then for LINEAR the place in `combinations`, for PRODUCT two registers, for
            POWER a register, the numerator and the denominator of the exponent, for FUNCTION + k a register u and the
            register g.
        combinations: Linear combinations of registers.
    """

    def __init__(self, dimension: int):
        from mpmath import mpf

        self.one = dimension
        self.rows: list[list[int]] = []
        self.combinations: list[tuple[Term, ...]] = []
        self.unit = mpf(1)
        self._known: dict[Any, int] = {}

    def sum(self, terms: Iterable[Term]) -> Term:
        """The sum of terms."""
        kept = self.merged(terms)
        if len(kept) < 2:
            return kept[0] if kept else (0 * self.unit, self.one)
        return self.unit, self._combination(kept)

    def merged(self, terms: Iterable[Term]) -> tuple[Term, ...]:
        """The terms of a sum with one for each register."""
        total: dict[int, Any] = {}
        for coefficient, register in terms:
            total[register] = total.get(register, 0) + coefficient
        return tuple((coefficient, register) for register, coefficient in sorted(total.items()) if coefficient)

    def product(self, factors: Iterable[Term]) -> Term:
        """The product of terms."""
        number, product = self.unit, self.one
        for coefficient, register in factors:
            number *= coefficient
            if product == self.one:
                product = register
            elif register != self.one:
                product = self._operation(PRODUCT, *sorted((product, register)))
        return number, product

    def power(self, term: Term, exponent: Fraction) -> Term:
        """A rational power of a term; positive integer powers are products, whose factors may vanish."""
        number, register = term
        whole = exponent.denominator == 1
        if number < 0 and register != self.one and not whole:  # (−x)^(1/2) is no multiple of x^(1/2)
            number, register = self.unit, self.register(term)
        number **= exponent.numerator if whole else self.unit * exponent.numerator / exponent.denominator
        if register == self.one:
            return _real(number), self.one
        if whole and exponent > 0:
            return number, self._integer_power(register, exponent.numerator)
        return number, self._operation(POWER, register, exponent.numerator, exponent.denominator)

    def general_power(self, base: Term, exponent: Term) -> Term:
        """The power of a term by a term."""
        return self.function("exp", self.product([exponent, self.function("log", base)]))

    def function(self, name: str, term: Term) -> Term:
        """An elementary function of a term."""
        if term[1] == self.one:
            import mpmath

            return _real(getattr(mpmath, name)(term[0])), self.one
        u = self.register(term)
        if (name, u) not in self._known:
            value = self._known[name, u] = self._append(FUNCTION + ELEMENTARY.index(name), u)
            derivative = self.register(self._derivative(name, (self.unit, u), (self.unit, value)))
            self.rows[value - self.one - 1][2] = derivative
        return self.unit, self._known[name, u]

    def register(self, term: Term) -> int:
        """A register with the value of a term."""
        return term[1] if term[0] == 1 else self._combination((term,))

    def _derivative(self, name: str, u: Term, value: Term) -> Term:
        """The derivative of a function at u, where it has this value."""
        one, minus = (self.unit, self.one), (-self.unit, self.one)
        if name == "exp":
            return value
        if name in ("sin", "cos", "sinh", "cosh"):
            factor = minus if name == "cos" else one
            return self.product([factor, self.function(PARTNERS[name], u)])
        if name in ("tan", "tanh"):
            return self.sum([one, self.product([one if name == "tan" else minus, value, value])])
        if name == "log":
            return self.power(u, Fraction(-1))
        if name in ("atan", "asinh"):
            square = self.sum([one, self.product([u, u])])
        else:
            factor = one if name == "acosh" else minus
            square = self.product([factor, self.sum([u, one]), self.sum([u, minus])])  # 1 − u² loses digits near 1
        power = self.power(square, Fraction(-1) if name in ("atan", "atanh") else Fraction(-1, 2))
        return self.product([minus, power]) if name == "acos" else power

    def _integer_power(self, register: int, n: int) -> int:
        if n == 1:
            return register
        half = self._integer_power(register, n // 2)
        square = self._operation(PRODUCT, half, half)
        return self._operation(PRODUCT, *sorted((register, square))) if n % 2 else square

    def _combination(self, terms: tuple[Term, ...]) -> int:
        if terms not in self._known:
            self._known[terms] = self._append(LINEAR, len(self.combinations))
            self.combinations.append(terms)
        return self._known[terms]

    def _operation(self, *content: int) -> int:
        if content not in self._known:
            self._known[content] = self._append(*content)
        return self._known[content]

    def _append(self, *content: int) -> int:
        if len(self.rows) == MAX_OPERATIONS:
            raise IntegratorError(
                f"scene must take at most {MAX_OPERATIONS:,} operations for its Taylor series, but takes more"
            )
        self.rows.append([*content, *[0] * (4 - len(content))])
        return self.one + len(self.rows)


def _real(number: Any) -> Any:
    """The number, if it is real and finite."""
    import mpmath

    if isinstance(number, mpmath.mpf) and mpmath.isfinite(number):
        return number
    raise IntegratorError(f"parameters must make the field real and finite, but gave {shorten(str(number))}")
