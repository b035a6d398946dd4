"""Conversion of formulas to polynomials in generators.

The generators depend on all formulas together: sin q and sin 2q share those of q. So the arguments of functions with
addition theorems are collected first; a lattice basis of them gives the basic arguments. Likewise the indices of all
roots of a base are collected.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.fields.symbolic.ring_generators import GeneratedRing, Pair, prime_factors
from bseries.fields.symbolic.sparse_polynomials import constant, exponents, generator, total

if TYPE_CHECKING:
    import sympy

    from bseries.fields.symbolic.sparse_polynomials import Number, Terms


CIRCULAR = ("sin", "cos", "tan")
HYPERBOLIC = ("sinh", "cosh", "tanh")
FAMILIES = {**dict.fromkeys(CIRCULAR, CIRCULAR), **dict.fromkeys(HYPERBOLIC, HYPERBOLIC), "exp": ("exp",)}
"""Functions with addition theorems, and the families that share basic arguments."""

MOST_MULTIPLE = 50
"""Larger multiples of an argument count as independent, since addition theorems would be too long."""


class FormulaRing(GeneratedRing):
    """Ring that contains some formulas and their derivatives; arguments as for `DifferentialRing`."""

    def __init__(
        self, formulas: Sequence[sympy.Expr], variables: Iterable[sympy.Symbol], limit: int, digits: int | None
    ):
        super().__init__(variables, limit, digits)
        self._known: dict[sympy.Expr, Terms] = {}
        # Constants come last: x and x + π/3 have the basis x and π/3.
        self._lattices = {family: Lattice(lambda m: (self._varies(m), m)) for family in FAMILIES.values()}
        self._functions: dict[tuple[str, frozenset[Any]], Any] = {}
        for i, variable in enumerate(self.variables):
            k = self.add_function(variable, lambda j, i=i: constant(int(i == j)))
            self._known[variable] = {generator(k): 1}
        self._plan(formulas)

    def _plan(self, formulas: Sequence[sympy.Expr]) -> None:
        """Find the index of every root and the basic arguments, inner and frequent ones first."""
        import sympy

        arguments: Counter[tuple[int, str, Any]] = Counter()
        for part in (part for formula in formulas for part in sympy.preorder_traversal(formula)):
            if isinstance(part, sympy.Pow):
                power: Any = part.exp.as_coeff_Add()[0]
                for base in _bases(part.base):
                    self.indices[base] = math.lcm(self.indices.get(base, 1), power.q if power.is_Rational else 1)
            elif name := _name(part):
                arguments[_depth(part), name, part.args[0]] += 1

        def rank(key: tuple[int, str, Any]) -> tuple[Any, ...]:
            depth, name, argument = key
            return depth, -arguments[key], argument.could_extract_minus_sign(), name, str(argument)

        for _, name, argument in sorted(arguments, key=rank):
            self._lattices[FAMILIES[name]].insert(self.read(argument))

    def _varies(self, monomial: int) -> bool:
        variables = range(len(self.variables))
        return any(self.generator_derivative(k, i) for k, _ in exponents(monomial) for i in variables)

    def read(self, formula: sympy.Expr) -> Terms:
        """Convert a formula to a polynomial in the generators."""
        found = self._known.get(formula)
        if found is None:
            found = self._known[formula] = self._interpret(formula)
        return found

    def _interpret(self, formula: Any) -> Terms:
        import sympy

        if formula.is_Rational or formula.is_Float:
            exact: Any = sympy.Rational(formula)  # floats are exact binary fractions
            return constant(Fraction(int(exact.p), int(exact.q)))
        if formula.is_Add:
            return total((1, self.read(part)) for part in formula.args)
        if formula.is_Mul:
            return self.product(map(self.read, formula.args))
        if formula.is_Pow:
            return self._power(formula)
        name = _name(formula)
        if name:
            argument = formula.args[0]
            return self._exponential(argument) if name == "exp" else self._periodic(name, argument)
        if formula in (sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
            raise SeriesError(f"formula must be finite, but holds {formula}")
        return self._opaque(formula)

    def _opaque(self, formula: sympy.Expr) -> Terms:
        """A parameter, or a function of which only SymPy's derivative is used."""

        def derivative(i: int) -> Terms:
            variable = self.variables[i]
            return self.read(formula.diff(variable)) if variable in formula.free_symbols else {}

        return {generator(self.add_function(formula, derivative)): 1}

    def _power(self, formula: Any) -> Terms:
        base, power = formula.args
        shift, rest = power.as_coeff_Add()
        if power.is_Rational:
            return self._rational_power(formula, base, Fraction(int(power.p), int(power.q)))
        if shift.is_Rational and shift:
            return self.product([self.read(base**shift), self.read(base**rest)])
        multiple, rest = power.as_coeff_Mul()
        if multiple.is_Integer and multiple != 1:
            return self.raised(self.read(base**rest), Fraction(int(multiple)))
        return self._opaque(formula)

    def _rational_power(self, formula: Any, base: Any, power: Fraction) -> Terms:
        if power.denominator > 1 and base.is_negative and base.is_number:
            return self._opaque(formula)  # the principal value is not real
        if power.denominator > 1 and _is_positive_integer(base):
            return self.raised_number(Fraction(int(base)), power)
        return self.raised(self.read(base), power, self.indices.get(base, 1), base)

    def _coordinates(self, name: str, argument: sympy.Expr) -> list[tuple[Terms, int]]:
        """The argument of a function as a sum of multiples of basic arguments."""
        terms = self.read(argument)
        found = self._lattices[FAMILIES[name]].coordinates(terms)
        return found if all(abs(multiple) <= MOST_MULTIPLE for _, multiple in found) else [(terms, 1)]

    def _exponential(self, argument: sympy.Expr) -> Terms:
        import sympy

        result = constant(1)
        for row, multiple in self._coordinates("exp", argument):
            key = "exp", frozenset(row.items())
            if key not in self._functions:
                self._functions[key] = self.add_exponential(sympy.exp(self.expression(row)), row)
            basic: Terms = {generator(self._functions[key]): 1}
            result = self.dot([(result, self.raised(basic, Fraction(multiple)))])
        return result

    def _periodic(self, name: str, argument: sympy.Expr) -> Terms:
        """sin, cos or tan of an argument, by (c + i s)(d + i t) = (c d − s t) + i (s d + c t); j² = 1 if hyperbolic."""
        family = FAMILIES[name]
        minus = -1 if family is CIRCULAR else 1
        s: Terms = {}
        c = constant(1)
        for row, multiple in self._coordinates(name, argument):
            t, d = self._basic_pair(row, family)
            t = total([(1 if multiple > 0 else -1, t)])
            for _ in range(abs(multiple)):
                s, c = self.dot([(s, d), (c, t)]), self.dot([(c, d), (total([(minus, s)]), t)])
        if name == family[2]:
            return self.dot([(s, self.raised(c, Fraction(-1)))])
        return s if name == family[0] else c

    def _basic_pair(self, row: Terms, family: Sequence[str]) -> tuple[Terms, Terms]:
        """sin b and cos b of a basic argument: generators, or algebraic numbers."""
        import sympy

        key = family[0], frozenset(row.items())
        if key not in self._functions:
            argument = self.expression(row)
            sine, cosine = (getattr(sympy, name)(argument) for name in family[:2])
            if sine.is_algebraic and cosine.is_algebraic:
                self._functions[key] = self.read(sine), self.read(cosine)
            else:
                self._functions[key] = self.add_pair(sine, cosine, row, 1 if family is CIRCULAR else -1)
        found = self._functions[key]
        return ({generator(found.sine): 1}, {generator(found.cosine): 1}) if isinstance(found, Pair) else found


def _is_positive_integer(base: Any) -> bool:
    return bool(base.is_Integer and base.is_positive)


def _bases(base: Any) -> list[Any]:
    """The bases of the factors of a power: the base, or its prime factors."""
    return [prime for prime, _ in prime_factors(int(base))] if _is_positive_integer(base) else [base]


def _depth(formula: sympy.Basic) -> int:
    """The nesting depth of functions with addition theorems."""
    return max(map(_depth, formula.args), default=0) + bool(_name(formula))


def _name(formula: sympy.Basic) -> str:
    """The name of a function with addition theorems; empty for others, including user functions with such a name."""
    import sympy

    name = type(formula).__name__
    return name if name in FAMILIES and isinstance(formula, getattr(sympy, name)) else ""


class Lattice:
    """Lattice of integer combinations of polynomials, with a basis in echelon form.

    Each row has its own pivot, the monomial with the largest `priority`.

    Example:
        >>> lattice = Lattice()
        >>> for vector in ({1: 2}, {1: 3}, {1: 1, 0: 5}):
        ...     lattice.insert(vector)
        >>> lattice.coordinates({1: 4, 0: -10})
        [({1: 1}, 4), ({0: 5}, -2)]
    """

    def __init__(self, priority: Callable[[int], Any] = int) -> None:
        self._priority = priority
        self._rows: dict[int, Terms] = {}

    def insert(self, vector: Terms) -> None:
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

    def coordinates(self, vector: Terms) -> list[tuple[Terms, int]]:
        """A vector as an integer combination of rows; a remainder becomes a new row where possible."""
        found: list[tuple[Terms, int]] = []
        while vector:
            pivot = max(vector, key=self._priority)
            row = self._rows.setdefault(pivot, vector)
            if vector[pivot] % row[pivot]:
                return [*found, (vector, 1)]
            multiple = int(vector[pivot] // row[pivot])
            found.append((row, multiple))
            vector = _reduced(vector, row, multiple)
        return found


def _reduced(vector: Terms, row: Terms, multiple: Number) -> Terms:
    return total([(1, vector), (-multiple, row)])
