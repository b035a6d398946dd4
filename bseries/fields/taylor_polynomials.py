"""Derivatives of formulas by arithmetic on truncated Taylor polynomials (automatic differentiation).

A truncated Taylor polynomial in the local variables of a term has one coefficient for each monomial of degree R or
less, sorted by degree. A function b = φ(a) follows from its differential equation, degree by degree: with the Euler
operator E, which multiplies a monomial by its degree, b = exp a gives E b = b · E a, that is b_α = Σ |β|/|α| a_β b_γ
over x^α = x^β x^γ with β ≠ 0. Formulas become lists of instructions on such polynomials; none is differentiated.

References:
    A. Griewank, A. Walther, *Evaluating Derivatives*, 2nd ed. (2008), chapter 13.
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from itertools import combinations_with_replacement
from math import comb, factorial, prod
from typing import TYPE_CHECKING, NamedTuple

import sympy

from bseries.exceptions import SeriesError
from bseries.fields.inputs import Formula, check_smooth

if TYPE_CHECKING:
    from bseries.exact.domains import Coefficient

CONSTANT, ARGUMENT, DATUM, ADD, SCALE, SHIFT, MULTIPLY, POWER, EXP, CIRCULAR, HYPERBOLIC, INTEGRAL = range(12)
"""The operations, implemented by `differential_kernels.evaluate_polynomials`."""

MOST_FACTORS = 32
"""Powers with integer or half-integer exponents up to this one are products, of square roots if need be."""


def monomials(variables: int, degree: int) -> list[tuple[int, ...]]:
    """The exponents of all monomials up to a degree, sorted by degree."""
    return [
        tuple(map(chosen.count, range(variables)))
        for d in range(degree + 1)
        for chosen in combinations_with_replacement(range(variables), d)
    ]


def monomial_count(variables: int, degree: int) -> int:
    """The number of monomials up to a degree; 0 for negative degrees."""
    return comb(variables + degree, variables) if degree >= 0 else 0


@lru_cache(maxsize=64)
def raised_monomials(variables: int, degree: int) -> tuple[int, ...]:
    """The index of x^α x_l for each monomial x^α below the highest degree and each variable x_l."""
    exponents = monomials(variables, degree)
    place = {exponent: at for at, exponent in enumerate(exponents)}
    return tuple(
        place[(*exponent[:k], exponent[k] + 1, *exponent[k + 1 :])]
        for exponent in exponents
        if sum(exponent) < degree
        for k in range(variables)
    )


@lru_cache(maxsize=64)
def factorials(variables: int, degree: int) -> tuple[int, ...]:
    """α! of every monomial x^α."""
    return tuple(prod(map(factorial, exponent)) for exponent in monomials(variables, degree))


Support = frozenset[int]  # the indices of the monomials that may occur in a polynomial


@lru_cache(maxsize=32)
def products(
    variables: int, degree: int, first: Support, second: Support, proper: bool
) -> tuple[tuple[int, int, int], ...]:
    """Triples (α, β, γ) of monomials with x^α = x^β x^γ and |α| ≤ degree, sorted by |α|.

    The indices β and γ are those in `first` and `second`; `proper` excludes β = 0.
    """
    exponents = monomials(variables, degree)
    place = {exponent: at for at, exponent in enumerate(exponents)}
    found = [
        (place[tuple(map(sum, zip(exponents[b], exponents[c], strict=True)))], b, c)
        for b in first
        if b or not proper
        for c in second
        if c < monomial_count(variables, degree - sum(exponents[b]))
    ]
    return tuple(sorted(found, key=lambda triple: (sum(exponents[triple[0]]), triple[1:])))


class Instruction(NamedTuple):
    """One operation: its result, operands, number or code of a function, and products of monomials."""

    operation: int
    result: int
    first: int = 0
    second: int = 0
    number: sympy.Expr | int = 0
    products: tuple[tuple[int, int, int], ...] = ()


def factors(instruction: Instruction, variables: int, degree: int) -> list[Coefficient]:
    """The factors of the products in a function: |β|/|α|, and (r|β| − |γ|)/|α| for a power r.

    With a = a_0 (1 + ã), b = a^r satisfies a E b = r b E a, so that b_α = Σ (r|β| − |γ|)/|α| ã_β b_γ.
    """
    degrees = [sum(exponent) for exponent in monomials(variables, degree)]
    if instruction.operation == POWER:
        return [(instruction.number * degrees[b] - degrees[c]) / degrees[a] for a, b, c in instruction.products]
    if instruction.operation in (EXP, CIRCULAR, HYPERBOLIC, INTEGRAL):
        return [Fraction(degrees[b], degrees[a]) for a, b, _ in instruction.products]
    return []


class InstructionList:
    """Instructions that compute the truncated Taylor polynomial of a formula; equal parts share their polynomials.

    The symbols of the formula are x0, x1, … for the local variables and d0, d1, … for data.
    """

    def __init__(self, formula: sympy.Expr, variables: int, degree: int):
        self.variables, self.degree = variables, degree
        self.every: Support = frozenset(range(monomial_count(variables, degree)))
        self.instructions: list[Instruction] = []
        self.known: dict[object, int] = {}
        self.supports: list[Support] = []  # one for each polynomial
        self.result = self.visit(formula)

    def emit(
        self, operation: int, *operands: int, support: Support | None = None, number: sympy.Expr | int = 0,
        triples: tuple[tuple[int, int, int], ...] = (),
    ) -> int:  # fmt: skip
        """Append an instruction; `support` is that of its result, None for all monomials."""
        self.supports.append(self.every if support is None else support & self.every)
        result = len(self.supports) - 1
        self.instructions.append(Instruction(operation, result, *operands, number=number, products=triples))
        if operation in (CIRCULAR, HYPERBOLIC, POWER):
            self.supports.append(self.every)  # a second result, or workspace
        return result

    def multiply(self, a: int, b: int) -> int:
        """The product of two polynomials."""
        triples = products(self.variables, self.degree, self.supports[a], self.supports[b], False)
        return self.emit(MULTIPLY, a, b, support=frozenset(alpha for alpha, _, _ in triples), triples=triples)

    def function(self, operation: int, a: int, b: int = 0, number: sympy.Expr | int = 0) -> int:
        """A function of polynomial a; `b` is the derivative of an integral, or an operand of the operation."""
        second = self.supports[b] if operation == INTEGRAL else self.every
        triples = products(self.variables, self.degree, self.supports[a], second, True)
        return self.emit(operation, a, b, number=number, triples=triples)

    def visit(self, formula: sympy.Expr) -> int:
        """The index of the polynomial of a formula."""
        if formula not in self.known:
            self.known[formula] = self._visit(formula)
        return self.known[formula]

    def _visit(self, formula: sympy.Expr) -> int:
        if not formula.free_symbols:
            return self.emit(CONSTANT, support=frozenset([0]), number=formula)
        if formula.is_Symbol:
            kind, number = str(formula)[0], int(str(formula)[1:])
            if kind == "x":
                return self.emit(ARGUMENT, number, support=frozenset([0, 1 + number]))
            return self.emit(DATUM, number, support=frozenset([0]))
        if isinstance(formula, sympy.Add | sympy.Mul):
            return self._combine(formula)
        if isinstance(formula, sympy.Pow):
            return self._power(formula.base, formula.exp)
        return self._function(formula)

    def _combine(self, formula: sympy.Add | sympy.Mul) -> int:
        """A sum or product; its numerical part is one SHIFT or SCALE."""
        number, rest = formula.as_coeff_Add() if formula.is_Add else formula.as_coeff_Mul()
        if number != (0 if formula.is_Add else 1):
            at = self.visit(rest)
            return self.emit(SHIFT if formula.is_Add else SCALE, at, support=self.supports[at] | {0}, number=number)
        arguments = sorted(formula.args, key=lambda x: x.sort_key())
        at = self.visit(arguments[0])
        for argument in arguments[1:]:
            other = self.visit(argument)
            if formula.is_Add:
                at = self.emit(ADD, at, other, support=self.supports[at] | self.supports[other])
            else:
                at = self.multiply(at, other)
        return at

    def _power(self, base: sympy.Expr, exponent: sympy.Expr) -> int:
        if base == sympy.E:
            return self.function(EXP, self.visit(exponent))
        if exponent.free_symbols:
            return self.visit(sympy.exp(exponent * sympy.log(base), evaluate=False))
        if exponent.is_Integer and exponent > 1:  # by products, which are valid where the base is zero
            half = self.visit(base ** (exponent // 2))
            square = self.multiply(half, half)
            return square if exponent % 2 == 0 else self.multiply(square, self.visit(base))
        at = self.visit(base)
        halves = int(abs(2 * exponent)) if (2 * exponent).is_Integer and abs(exponent) <= MOST_FACTORS else 0
        return self.function(POWER, at, halves, number=exponent)

    def _function(self, formula: sympy.Expr) -> int:
        name = formula.func.__name__
        argument: Formula = formula.args[0]
        if name == "exp":
            return self.function(EXP, self.visit(argument))
        if name in ("sin", "cos", "sinh", "cosh"):
            return self._pair(name, argument)
        if name in ("tan", "tanh"):
            top, bottom = (sympy.sin, sympy.cos) if name == "tan" else (sympy.sinh, sympy.cosh)
            return self.visit(top(argument) * sympy.Pow(bottom(argument), -1))
        power = sympy.Rational(-1, 2)
        derivatives = {  # algebraic, in the order of the codes in `differential_kernels.evaluate_centre`
            "log": lambda a: 1 / a,
            "asin": lambda a: (1 - a**2) ** power,
            "acos": lambda a: -((1 - a**2) ** power),
            "atan": lambda a: 1 / (1 + a**2),
            "asinh": lambda a: (1 + a**2) ** power,
            "acosh": lambda a: (a - 1) ** power * (a + 1) ** power,
            "atanh": lambda a: 1 / (1 - a**2),
            "erf": lambda a: 2 / sympy.sqrt(sympy.pi) * sympy.exp(-(a**2)),
        }
        if name not in derivatives:
            check_smooth(formula)
            raise SeriesError(f"field must be made of elementary functions, but has {name!r:.60}")
        at, derivative = self.visit(argument), self.visit(derivatives[name](argument))
        return self.function(INTEGRAL, at, derivative, number=list(derivatives).index(name))

    def _pair(self, name: str, argument: sympy.Expr) -> int:
        """sin and cos, or sinh and cosh, computed together as two adjacent polynomials."""
        pair = (sympy.sin, sympy.cos) if name in ("sin", "cos") else (sympy.sinh, sympy.cosh)
        key = ("pair", pair, argument)
        if key not in self.known:
            operation = CIRCULAR if pair[0] is sympy.sin else HYPERBOLIC
            self.known[key] = self.function(operation, self.visit(argument))
        return self.known[key] + (name in ("cos", "cosh"))
