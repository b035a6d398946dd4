"""From a method to its series: elementary weights of (partitioned) Runge–Kutta methods."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

from .arithmetic import Exact, Majorant
from .domains import ring_and_elements, to_float
from .exceptions import SeriesError
from .rationals import smallest_step
from .recursions import Stages, elementary_weights

if TYPE_CHECKING:
    import random

    from integrators import PartitionedRungeKutta, RungeKutta, StageAlgebra
    from trees.table import TreeTable

    Method = RungeKutta | PartitionedRungeKutta


class RationalStages:
    """The stages of a method with rational series, as an input of exact operations.

    Args:
        stages: Entries as Fractions, in any basis of the stage algebra in which products have integer coefficients.
        bounds: Bounds on the absolute values of the entries of the tableau itself.
    """

    kind = "rational"

    def __init__(self, stages: Stages, bounds: Stages):
        self.stages = stages
        self.bounds = bounds
        self.terms = stages.size
        self.step = math.lcm(*(entry.denominator for entry in (*stages.a, *stages.b)))

    def perturbed(self, source: random.Random, digits: int) -> RationalStages:
        """The same stages with every entry x changed to x (1 ± 5 · 10^−digits)."""
        change = 5 * Fraction(10) ** -digits
        a, b = ([x * (1 + source.choice((-change, change))) for x in row] for row in (self.stages.a, self.stages.b))
        bounds = Stages(self.stages.size, [abs(x) for x in a], [abs(x) for x in b], [])
        return RationalStages(Stages(self.stages.size, a, b, self.stages.relation), bounds)

    @cached_property
    def exponent(self) -> int:
        """k such that all row sums of |a| and sums of |b| are at most 2^k: then |a(τ)| ≤ 2^(k·n)."""
        s = self.bounds.size
        sums = [sum(row[i : i + s]) for row in (self.bounds.a, self.bounds.b) for i in range(0, len(row), s)]
        largest = math.ceil(max(sums))
        return max(0, (largest - 1).bit_length())

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool = False) -> Any:
        """The elementary weights."""
        stages = self.bounds if isinstance(arithmetic, Majorant) else self.stages
        return elementary_weights(stages, table, arithmetic, field=field)


class FloatStages:
    """The stages of a method with floating-point entries."""

    kind = "float"

    def __init__(self, stages: Stages):
        self.stages = stages

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool = False) -> Any:
        """The elementary weights."""
        return elementary_weights(self.stages, table, arithmetic, field=field)


class RingStages(FloatStages):
    """The stages of a method with entries in a SymPy ring, over a common denominator `step`."""

    kind = "ring"

    def __init__(self, stages: Stages, ring: Any, step: Any):
        super().__init__(stages)
        self.ring = ring
        self.step = step


@lru_cache(maxsize=64)
def stages_of(method: Method) -> RationalStages | FloatStages | RingStages:
    """A method's stages, in the form that suits its entries."""
    parts, count = method.partitions, method.stages
    algebras = [part.algebra for part in parts if part.algebra is not None]
    if len(algebras) == len(parts) and len({algebra.polynomial for algebra in algebras}) == 1:
        return _algebraic_stages(algebras)
    a = [entry for part in parts for row in part.A for entry in row]
    b = [entry for part in parts for entry in part.b]
    if any(isinstance(entry, float) for entry in (*a, *b)):
        return FloatStages(Stages(count, [to_float(x) for x in a], [to_float(x) for x in b], []))
    if all(isinstance(entry, Fraction) for entry in (*a, *b)):
        bounds = Stages(count, [abs(x) for x in a], [abs(x) for x in b], [])
        return RationalStages(Stages(count, a, b, []), bounds)
    try:
        ring, elements, step = ring_and_elements([*a, *b])
    except ZeroDivisionError:
        raise SeriesError("method must have entries that can be evaluated, but one divides by zero") from None
    return RingStages(Stages(count, elements[: len(a)], elements[len(a) :], []), ring, step)


def _algebraic_stages(algebras: Sequence[StageAlgebra]) -> RationalStages:
    """Stages on the roots of a rational polynomial P, in the basis 1, z, z², … with z = ℓx.

    ℓ is the smallest integer that makes P(z/ℓ) ℓ^s a monic polynomial with integer coefficients, so that the product
    modulo it has integer structure constants and only the entries of A and b have denominators.
    """
    polynomial, count = algebras[0].polynomial, len(algebras[0].b)
    denominators = [p.denominator for p in reversed(polynomial)]  # of the coefficients of z^s, z^(s−1), …, 1
    scale = smallest_step(denominators, math.lcm(*denominators))
    power = [Fraction(scale) ** k for k in range(count + 1)]
    relation = [polynomial[k] * power[count - k] for k in range(count)]
    a = [x.A[i][j] * power[j] / power[i] for x in algebras for i in range(count) for j in range(count)]
    b = [x.b[j] * power[j] for x in algebras for j in range(count)]
    return RationalStages(Stages(count, a, b, relation), _bounds(algebras, count))


def _bounds(algebras: Sequence[StageAlgebra], count: int) -> Stages:
    """Bounds on the tableau's entries, which are known to a few units in the last place."""
    tableaus = [algebra.tableau_float() for algebra in algebras]
    a = [_bound(entry) for A, _, _ in tableaus for row in A for entry in row]
    b = [_bound(entry) for _, b, _ in tableaus for entry in b]
    return Stages(count, a, b, [])


def _bound(entry: float) -> Fraction:
    return abs(Fraction(entry)) * (1 + Fraction(1, 2**40)) + Fraction(1, 2**60)
