"""Differential rings: formulas as polynomials in generators closed under differentiation, and power series over them.

With generators such as sin q, cos q, 1/g, √g and e^g, derivatives and products of formulas are those of polynomials,
and equal formulas have equal normal forms without a search for simplifications.

The generators depend on all formulas together: sin q and sin 2q share those of q. So the arguments of functions with
addition theorems are collected first; a lattice basis of them gives the basic arguments. Likewise the indices of all
roots of a base are collected.

A formula at y(h) = y_0 + h y_1 + … is a polynomial in the generators of its ring at y(h). The generators follow from
their differential equations: if ∂g/∂y_i = D_i, again a polynomial in generators, then

    n g_n = Σ_i Σ_{m=1}^n m y_{i,m} D_{i,n−m}.

So no Taylor series in several variables is needed.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import reduce
from typing import TypeAlias

import sympy

from bseries.exceptions import SeriesError
from bseries.fields.inputs import Formula, check_smooth
from bseries.fields.polynomials import (
    Element,
    GeneratedRing,
    Monomial,
    Number,
    Pair,
    Quotient,
    TooLarge,
    prime_factors,
    primitive,
)

MOST_MONOMIALS = 1_000_000

CIRCULAR = ("sin", "cos", "tan")
HYPERBOLIC = ("sinh", "cosh", "tanh")
FAMILIES = {**dict.fromkeys(CIRCULAR, CIRCULAR), **dict.fromkeys(HYPERBOLIC, HYPERBOLIC), "exp": ("exp",)}
"""Functions with addition theorems, and the families that share basic arguments."""

MOST_MULTIPLE = 50  # larger multiples of an argument count as independent, since addition theorems would be too long

Row: TypeAlias = dict[Monomial, Fraction]
Argument: TypeAlias = frozenset[tuple[Monomial, Fraction]]
"""The argument of a function: the terms of a polynomial."""

MOST_FACTORED = 60  # polynomials with more monomials are not factored, which can take seconds


class DifferentialRing(GeneratedRing):
    """A ring of functions of some variables that contains given formulas and all their derivatives.

    `bool(element)` decides exactly whether an element is zero if no two denominators or roots, and no denominator and
    sin or sinh, share the generator for which their relation is solved. `is_zero` also uses a common denominator. It is
    exact if the generators satisfy no other relations than those of the ring: for rational functions of the variables,
    of functions with independent arguments, and of square roots of which none is a multiple of another.

    Symbols other than the variables are parameters. Results with more than `limit` monomials raise `TooLarge`; `digits`
    is the number of digits of floats in results.

    Example:
        >>> import sympy
        >>> x = sympy.Symbol("x")
        >>> ring = DifferentialRing([sympy.sin(2 * x), sympy.cos(x)], [x])
        >>> f, g = ring.elements
        >>> ring.to_expression(ring.derivative(f, 0) - 4 * g * g)
        -2
    """

    def __init__(
        self,
        formulas: Iterable[sympy.Expr],
        variables: Iterable[sympy.Symbol],
        *,
        limit: int = MOST_MONOMIALS,
        digits: int | None = None,
    ):
        super().__init__(variables, limit, digits)
        formulas = tuple(formulas)
        self._known: dict[sympy.Expr, Element] = {}
        # Constants come last: x and x + π/3 have the basis x and π/3.
        self._lattices = {family: Lattice(lambda m: (self._varies(m), m)) for family in FAMILIES.values()}
        self._exponentials_of: dict[Argument, int] = {}
        self._pairs_of: dict[tuple[str, Argument], tuple[Element, Element]] = {}
        for i, variable in enumerate(self.variables):
            k = self.add_function(variable, lambda j, i=i: self.coerce(int(i == j)))
            self._known[variable] = self.generator(k)
        try:
            self._plan(formulas)
            self.elements = tuple(map(self.element, formulas))
        except RecursionError:
            raise SeriesError("fields must be nested less deeply than the interpreter's limit") from None

    def _plan(self, formulas: Sequence[sympy.Expr]) -> None:
        """Find the index of every root and the basic arguments, inner and frequent ones first."""
        arguments: Counter[tuple[int, str, sympy.Expr]] = Counter()
        for part in (part for formula in formulas for part in sympy.preorder_traversal(formula)):
            if isinstance(part, sympy.Pow):
                power = part.exp.as_coeff_Add()[0]
                bases = dict(prime_factors(int(part.base))) if _is_positive_integer(part.base) else [part.base]
                index = _fraction(power).denominator if power.is_Rational else 1
                for base in bases:
                    self.indices[base] = math.lcm(self.indices.get(base, 1), index)
            elif name := _name(part):
                arguments[_depth(part), name, _argument(part)] += 1

        def rank(key: tuple[int, str, sympy.Expr]) -> tuple[int, int, bool, str, str]:
            depth, name, argument = key
            return depth, -arguments[key], argument.could_extract_minus_sign(), name, str(argument)

        for _, name, argument in sorted(arguments, key=rank):
            self._lattices[FAMILIES[name]].insert(self.element(argument).terms)

    def _varies(self, monomial: Monomial) -> bool:
        return any(self.generator_derivative(k, i) for k, _ in monomial for i in range(len(self.variables)))

    # Reading.

    def element(self, formula: sympy.Expr) -> Element:
        """Convert a formula to an element."""
        found = self._known.get(formula)
        if found is None:
            found = self._known[formula] = self._interpret(formula)
        return found

    def _interpret(self, formula: sympy.Expr) -> Element:
        if formula.is_Rational or formula.is_Float:
            return self.coerce(_fraction(formula))
        if isinstance(formula, sympy.Add):
            return self.dot((1, self.element(part)) for part in formula.args)
        if isinstance(formula, sympy.Mul):
            return math.prod(map(self.element, formula.args), start=self.coerce(1))
        if isinstance(formula, sympy.Pow):
            return self._power(formula)
        name = _name(formula)
        if name:
            argument = _argument(formula)
            return self._exponential(argument) if name == "exp" else self._periodic(name, argument)
        if formula in (sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
            raise SeriesError(f"formula must be finite, but holds {formula}")
        return self._opaque(formula)

    def _opaque(self, formula: sympy.Expr) -> Element:
        """A parameter, or a function of which only SymPy's derivative is used."""
        check_smooth(formula)

        def derivative(i: int) -> Element:
            variable = self.variables[i]
            return self.element(formula.diff(variable)) if variable in formula.free_symbols else self.zero

        return self.generator(self.add_function(formula, derivative))

    def _power(self, formula: sympy.Pow) -> Element:
        base, power = formula.args
        shift, rest = power.as_coeff_Add()
        if power.is_Rational:
            exponent = _fraction(power)
            if exponent.denominator > 1 and base.is_negative and base.is_number:
                return self._opaque(formula)  # the principal value is not real
            if exponent.denominator > 1 and _is_positive_integer(base):
                return self.raised_number(Fraction(int(base)), exponent)
            return self.raised(self.element(base), exponent, self.indices.get(base, 1), base)
        if shift.is_Rational and shift:
            return self.element(base**shift) * self.element(base**rest)
        multiple, rest = power.as_coeff_Mul()
        if multiple.is_Integer and multiple != 1:
            return self.raised(self.element(base**rest), Fraction(int(multiple)))
        return self._opaque(formula)

    def _coordinates(self, name: str, argument: sympy.Expr) -> list[tuple[Row, int]]:
        """The argument of a function as a sum of multiples of basic arguments."""
        terms = self.element(argument).terms
        found = self._lattices[FAMILIES[name]].coordinates(terms)
        return found if all(abs(multiple) <= MOST_MULTIPLE for _, multiple in found) else [(terms, 1)]

    def _exponential(self, argument: sympy.Expr) -> Element:
        result = self.coerce(1)
        for row, multiple in self._coordinates("exp", argument):
            key = frozenset(row.items())
            if key not in self._exponentials_of:
                basic = self.from_terms(row)
                self._exponentials_of[key] = self.add_exponential(sympy.exp(self.expression(basic)), basic)
            result = result * self.raised(self.generator(self._exponentials_of[key]), Fraction(multiple))
        return result

    def _periodic(self, name: str, argument: sympy.Expr) -> Element:
        """sin, cos or tan of an argument, by (c + i s)(d + i t) = (c d − s t) + i (s d + c t); j² = 1 if hyperbolic."""
        family = FAMILIES[name]
        minus = -1 if family is CIRCULAR else 1
        s, c = self.zero, self.coerce(1)
        for row, multiple in self._coordinates(name, argument):
            t, d = self._basic_pair(row, family)
            t = t if multiple > 0 else -t
            for _ in range(abs(multiple)):
                s, c = self.dot([(s, d), (c, t)]), self.dot([(c, d), (minus * s, t)])
        if name == family[2]:
            return s * self.raised(c, Fraction(-1))
        return s if name == family[0] else c

    def _basic_pair(self, row: Row, family: Sequence[str]) -> tuple[Element, Element]:
        """sin b and cos b of a basic argument: generators, or algebraic numbers."""
        key = family[0], frozenset(row.items())
        if key not in self._pairs_of:
            basic = self.from_terms(row)
            sine, cosine = (getattr(sympy, name)(self.expression(basic)) for name in family[:2])
            if sine.is_number and sine.is_algebraic and cosine.is_algebraic:
                self._pairs_of[key] = self.element(sine), self.element(cosine)
            else:
                pair = self.add_pair(sine, cosine, basic, 1 if family is CIRCULAR else -1)
                self._pairs_of[key] = self.generator(pair.sine), self.generator(pair.cosine)
        return self._pairs_of[key]

    # Writing.

    def to_expression(self, element: Element, *, simplify: bool = True) -> sympy.Expr:
        """The SymPy expression: with common denominators and factored if that is not too large, or expanded."""
        if simplify and self.digits is None:
            with suppress(TooLarge):
                return sympy.Add(*map(self._factored, self.quotients(element, grow=False)))
        return self.expression(element)

    def _factored(self, part: Quotient) -> sympy.Expr:
        if not part.numerator:
            return sympy.Integer(0)
        numerator = reduce(self._shorter, self.pairs, part.numerator)
        monomial = Element(self, numerator.polynomial.term_content())
        content, rest = primitive(Element(self, numerator.polynomial / monomial.polynomial))
        factors = (self.expression(factor) ** e for factor, e in self._factors(rest))
        roots = (self.generators[k] ** e for k, e in part.roots.items())
        return sympy.Mul(self.expression(content * monomial), *factors, *roots)

    def _factors(self, element: Element) -> list[tuple[Element, int]]:
        """The irreducible factors of a primitive polynomial with their exponents, if the polynomial is short."""
        if element.size == 1 or element.size > MOST_FACTORED:
            return [(element, 1)]
        return [(primitive(Element(self, factor))[1], e) for factor, e in element.polynomial.factor()[1]]

    def _shorter(self, element: Element, pair: Pair) -> Element:
        """A polynomial with cos² replaced by 1 − sin² (or cosh² by 1 + sinh²) where that makes it shorter."""
        found: Counter[Monomial] = Counter()
        for monomial, x in element.terms.items():
            powers = {pair.sine: 0, pair.cosine: 0, **dict(monomial)}
            half, powers[pair.cosine] = divmod(powers[pair.cosine], 2)
            for j in range(half + 1):
                replaced = {**powers, pair.sine: powers[pair.sine] + 2 * j}
                key = tuple(sorted(((k, e) for k, e in replaced.items() if e), reverse=True))
                found[key] += x * math.comb(half, j) * (-pair.sign) ** j
        replaced = self.from_terms(found)
        return replaced if replaced.size < element.size else element


def _fraction(number: sympy.Expr) -> Fraction:
    """A rational number, or a float, which is an exact binary fraction."""
    return Fraction(*map(int, sympy.Rational(number).as_numer_denom()))


def _is_positive_integer(base: sympy.Expr) -> bool:
    return bool(base.is_Integer and base.is_positive)


def _depth(formula: sympy.Basic) -> int:
    """The nesting depth of functions with addition theorems."""
    return max(map(_depth, formula.args), default=0) + bool(_name(formula))


def _name(formula: sympy.Basic) -> str:
    """The name of a function with addition theorems; empty for others, including user functions with such a name."""
    if formula is sympy.E:
        return "exp"
    name = type(formula).__name__
    return name if name in FAMILIES and isinstance(formula, getattr(sympy, name)) else ""


def _argument(formula: sympy.Basic) -> sympy.Expr:
    """The argument of such a function; SymPy's number e is exp(1) without one."""
    return next((x for x in formula.args if isinstance(x, sympy.Expr)), sympy.Integer(1))


class Lattice:
    """Lattice of polynomials; in its echelon basis each row has its own pivot, the monomial of largest `priority`."""

    def __init__(self, priority: Callable[[Monomial], tuple[bool, Monomial]]):
        self._priority = priority
        self._rows: dict[Monomial, Row] = {}

    def insert(self, vector: Row) -> None:
        """Extend the lattice by a vector, by Euclid's algorithm on every pivot."""
        while vector:
            pivot = max(vector, key=self._priority)
            row = self._rows.get(pivot)
            if row is None:
                self._rows[pivot] = vector
                return
            vector = _reduced(vector, row, vector[pivot] // row[pivot])
            if pivot in vector:
                self._rows[pivot], vector = vector, row

    def coordinates(self, vector: Row) -> list[tuple[Row, int]]:
        """A vector as an integer combination of rows; a remainder becomes a new row where possible."""
        found: list[tuple[Row, int]] = []
        while vector:
            pivot = max(vector, key=self._priority)
            row = self._rows.setdefault(pivot, vector)
            if vector[pivot] % row[pivot]:
                return [*found, (vector, 1)]
            multiple = int(vector[pivot] // row[pivot])
            found.append((row, multiple))
            vector = _reduced(vector, row, multiple)
        return found


def _reduced(vector: Row, row: Row, multiple: int) -> Row:
    """vector − multiple · row."""
    found = {m: vector.get(m, Fraction(0)) - multiple * row.get(m, 0) for m in {**vector, **row}}
    return {m: x for m, x in found.items() if x}


class PowerSeries:
    """Power series in h over a ring, with coefficients computed on demand, from lower ones of this and other series."""

    __slots__ = ("_coefficient", "_known", "ring")

    def __init__(self, ring: GeneratedRing, coefficient: Callable[[int], Element]):
        self.ring = ring
        self._coefficient = coefficient
        self._known: list[Element] = []

    @classmethod
    def polynomial(cls, *coefficients: Element) -> PowerSeries:
        """The series with these coefficients and zeros."""
        ring = coefficients[0].ring
        return cls(ring, lambda n: coefficients[n] if n < len(coefficients) else ring.zero)

    def __getitem__(self, n: int) -> Element:
        while len(self._known) <= n:
            self._known.append(self._coefficient(len(self._known)))
        return self._known[n]

    def __mul__(self, other: PowerSeries) -> PowerSeries:
        def coefficient(n: int) -> Element:
            return self.ring.dot((self[j], other[n - j]) for j in range(n + 1) if self[j] and other[n - j])

        return PowerSeries(self.ring, coefficient)


def combination(ring: GeneratedRing, parts: Sequence[tuple[Element | Number, PowerSeries]]) -> PowerSeries:
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
        self.formulas = DifferentialRing(formulas, start)
        self.elements = self.formulas.elements
        used = {k for element in self.elements for k in element.generators}
        values = (self._value(k) for k in sorted(used))
        self.ring = DifferentialRing([*others, *values], variables)

    def _value(self, k: int) -> Formula:
        """The value of a generator at h = 0; roots are those of positive numbers, as in the ring."""
        value: Formula = self.formulas.generators[k].xreplace(self._start).doit()  # derivatives of undefined functions
        return sympy.powdenest(sympy.together(value), force=True) if value.is_Pow else value

    def at(self, point: Sequence[PowerSeries]) -> Composition:
        """The composition with a point, given by a series for every variable in the order of `start`."""
        return Composition(self.formulas, point, lambda k: self.ring.element(self._value(k)))
