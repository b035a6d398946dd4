"""Fourier polynomials in angles: Laurent polynomials in z_j = e^(iθ_j) over exact functions of the actions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import chain
from random import Random
from typing import TypeAlias

import sympy
from flint import fmpq

from bseries.exceptions import SeriesError
from bseries.fields.differential_rings import MOST_MONOMIALS, DifferentialRing
from bseries.fields.inputs import Formula
from bseries.fields.polynomials import Element

MOST_POWER = 50  # higher powers of trigonometric polynomials raise an error

DIGITS = 100
POINTS = 3  # a coefficient that vanishes to `DIGITS` digits at this number of points counts as zero

Terms: TypeAlias = dict[tuple[int, ...], fmpq]

Mode = tuple[int, ...]  # the integers k of a wave e^(ik·θ)


class FourierRing(DifferentialRing):
    """Ring of functions of actions and angles that contains given Fourier polynomials and all their derivatives."""

    def __init__(
        self,
        formulas: Iterable[sympy.Expr],
        actions: Sequence[sympy.Symbol],
        angles: Sequence[sympy.Symbol],
        *,
        limit: int = MOST_MONOMIALS,
    ):
        self.actions, self.angles = tuple(actions), tuple(angles)
        leaves = [leaf for formula in formulas for leaf in self._leaves(formula)]
        super().__init__(leaves, [*actions, *angles], limit=limit)
        self.constant: Mode = (0,) * len(self.angles)
        self._unit = self.element(sympy.I)
        [self._i] = self._unit.generators
        self.add_relation(self._unit * self._unit + 1)
        self._waves: list[tuple[int, int]] = []  # the generators e^(iθ_j) and e^(−iθ_j)
        for place, angle in enumerate(self.angles, len(self.actions)):
            z = len(self.generators)
            self.add_function(
                sympy.exp(sympy.I * angle),
                lambda i, j=place, z=z: self._unit * self.generator(z) if i == j else self.zero,
            )
            [inverse] = self.raised(self.generator(z), Fraction(-1)).generators
            self._waves.append((z, inverse))

    def _leaves(self, formula: Formula) -> Iterator[Formula]:
        """The largest subexpressions without angles."""
        if formula.free_symbols.isdisjoint(self.angles):
            yield formula
        else:
            for part in formula.args:
                yield from self._leaves(part)

    def read(self, formula: sympy.Expr) -> Element:
        """Convert a formula with finitely many modes."""
        if formula.free_symbols.isdisjoint(self.angles):
            return self.element(formula)
        if isinstance(formula, sympy.Add):
            return self.dot((1, self.read(part)) for part in formula.args)
        if isinstance(formula, sympy.Mul):
            return math.prod(map(self.read, formula.args), start=self.coerce(1))
        if isinstance(formula, sympy.Pow) and formula.exp.is_Integer and 0 < formula.exp <= MOST_POWER:
            return self.power(self.read(formula.base), int(formula.exp))
        return self._read_wave(formula)

    def _read_wave(self, formula: sympy.Expr) -> Element:
        """Convert cos(k·θ + β) = cos β cos k·θ − sin β sin k·θ, or a sine."""
        if isinstance(formula, sympy.sin | sympy.cos):
            argument: Formula = sympy.expand(formula.args[0])
            k = [argument.diff(angle) for angle in self.angles]
            if all(n.is_Integer for n in k):
                phase = argument.xreplace(dict.fromkeys(self.angles, sympy.Integer(0)))
                c, s = self.wave(tuple(map(int, k)))
                cosine, sine = self.element(sympy.cos(phase)), self.element(sympy.sin(phase))
                pairs = [(sine, c), (cosine, s)] if isinstance(formula, sympy.sin) else [(cosine, c), (-sine, s)]
                return self.dot(pairs)
        names = ", ".join(map(str, self.angles))
        raise SeriesError(
            f"hamiltonian must have finitely many Fourier modes, of period 2π in {names}, but has {formula!s:.60}"
        )

    def wave(self, k: Mode) -> tuple[Element, Element]:
        """cos k·θ and sin k·θ."""
        half, found = Fraction(1, 2), []
        for sign in (1, -1):  # e^(±ik·θ)
            powers = ((pair[sign * n < 0], abs(n)) for pair, n in zip(self._waves, k, strict=True) if n)
            found.append(self.from_terms({tuple(sorted(powers, reverse=True)): 1}))
        forth, back = found
        return (forth + back) * half, (back - forth) * self._unit * half

    def modes(self, f: Element) -> dict[Mode, tuple[Element, Element]]:
        """The coefficients c_k and s_k of a real f = Σ c_k cos k·θ + s_k sin k·θ, with one k of each pair ±k."""
        polynomial = self._current(f)
        context, last = polynomial.context(), polynomial.context().nvars() - 1
        places = [(last - forth, last - back) for forth, back in self._waves]
        found: dict[Mode, tuple[Terms, Terms]] = {}
        for exponents, number in polynomial.terms():
            k = tuple(int(exponents[forth] - exponents[back]) for forth, back in places)
            if k >= self.constant:  # −k has the conjugate coefficient
                rest, is_sine = list(exponents), exponents[last - self._i] > 0
                for place in (last - self._i, *chain(*places)):
                    rest[place] = 0
                factor = (-2 if is_sine else 2) if any(k) else 1
                found.setdefault(k, ({}, {}))[is_sine][tuple(rest)] = factor * number
        return {
            k: (Element(self, context.from_dict(c)), Element(self, context.from_dict(s)))
            for k, (c, s) in sorted(found.items())
        }

    def waves_expression(self, f: Element) -> sympy.Expr:
        """The SymPy expression of a real f in cos k·θ and sin k·θ, with factored coefficients."""
        total: list[sympy.Expr] = []
        for k, (c, s) in self.modes(f).items():
            argument = sympy.Add(*(n * angle for n, angle in zip(k, self.angles, strict=True)))
            total += [self.to_expression(c) * sympy.cos(argument), self.to_expression(s) * sympy.sin(argument)]
        return sympy.Add(*total)

    def is_zero(self, element: Element) -> bool:
        """Whether an element is zero, by the relations of the ring or to 100 digits at several points."""
        # The ring does not use all relations between numbers, such as √(3 + 2√2) = 1 + √2.
        return super().is_zero(element) or all(self._vanishes(element, Random(seed)) for seed in range(POINTS))

    def _vanishes(self, element: Element, random: Random) -> bool:
        """Whether an element is zero to many digits, relative to its monomials, at a random point."""
        formula = self.expression(element)
        # Values of both signs distinguish √(a²) from a.
        numbers = {
            x: sympy.Rational(random.randint(-999_999, 999_999), 300_007) for x in sorted(formula.free_symbols, key=str)
        }
        summands = [sympy.N(part.xreplace(numbers), DIGITS + 20) for part in sympy.Add.make_args(formula)]
        return bool(abs(sympy.Add(*summands)) <= sympy.Add(*map(abs, summands)) * sympy.Float(10) ** -DIGITS)

    def reciprocal(self, x: Element) -> Element:
        """One over an element, with rationalised denominators for numbers."""
        value = self.to_expression(x)
        return self.element(sympy.radsimp(1 / value)) if value.is_number else self.raised(x, Fraction(-1))
