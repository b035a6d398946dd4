"""From a method to the stages that recursions work on: tableaux directly, everything else through its program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import accumulate
from typing import TYPE_CHECKING, Any, TypeAlias

from bseries.algebra.flow_chains import FlowChain, flow_steps
from bseries.algebra.program_stages import StageRows
from bseries.exact.arithmetic import Exact, Majorant, Wrapped, wrapped_stages
from bseries.exact.domains import (
    RingValues,
    alike,
    as_floats,
    as_ring,
    converted,
    divided,
    ring_and_elements,
    ring_element,
    to_float,
)
from bseries.exact.rationals import smallest_step, twos
from bseries.exact.recursions import Stages, elementary_weights
from bseries.exceptions import SeriesError
from integrators import PartitionedRungeKutta, RungeKutta
from integrators.methods.program.program import Method, Program

if TYPE_CHECKING:
    import random

    from bseries.exact.domains import Values
    from integrators import StageAlgebra
    from trees.table import TreeTable

    MethodStages: TypeAlias = "RationalStages | FloatStages | RingStages"


class _WithStages:
    """What all kinds of stages share."""

    stages: Stages
    units = 1

    def weight_sums(self, colors: int) -> list[Any]:
        """For each colour the sum of the weights: the coefficient of the single node."""
        size = self.stages.size
        units = list(accumulate(self.stages.sizes[:-1], initial=0))
        return [sum(self.stages.b[c * size + at] for at in units) for c in range(colors)]

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool | None = False) -> Any:
        """The elementary weights; with `field` None the stages themselves, for recursions that start from them."""
        stages = self.stages_for(arithmetic)
        return stages if field is None else elementary_weights(stages, table, arithmetic, field=field)

    def stages_for(self, arithmetic: Exact) -> Stages:
        """The stages to use in an arithmetic."""
        return self.stages


class RationalStages(_WithStages):
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
        own = self.stages
        blocks = own.sizes if own.relation else ()
        bounds = Stages(own.size, [abs(x) for x in a], [abs(x) for x in b], own.relation, blocks)
        return RationalStages(Stages(own.size, a, b, own.relation, blocks), bounds)

    @cached_property
    def integers(self) -> Wrapped:
        """The arithmetic modulo 2^64 for recursions that start from the stages themselves."""
        a, b = (max((twos(x.denominator) for x in row), default=0) for row in (self.stages.a, self.stages.b))
        return wrapped_stages(a, b)

    @property
    def growth(self) -> float:
        """Some κ ≥ 0 such that |a(τ)| ≤ 2^(κ·n)."""
        return float(self.exponent)

    @cached_property
    def exponent(self) -> int:
        """k such that |a(τ)| ≤ 2^(k·n): the sums of |b|, and of |a| over the rows of a block, are at most 2^k.

        For a product of polynomials the sums of absolute coefficients multiply at most.
        """
        s, b = self.bounds.size, self.bounds.b
        rows = [sum(self.bounds.a[i : i + s]) for i in range(0, len(self.bounds.a), s)]
        sums, first = [sum(b[i : i + s]) for i in range(0, len(b), s)], 0
        for size in self.bounds.sizes * (len(rows) // s):
            sums.append(sum(rows[first : first + size]))
            first += size
        return max(0, (math.ceil(max(sums)) - 1).bit_length())

    def stages_for(self, arithmetic: Exact) -> Stages:
        """The stages to use in an arithmetic: for bounds, those with bounds on the entries."""
        return self.bounds if isinstance(arithmetic, Majorant) else self.stages


class FloatStages(_WithStages):
    """The stages of a method with floating-point entries."""

    kind = "float"

    def __init__(self, stages: Stages):
        self.stages = stages


class RingStages(_WithStages):
    """The stages of a method with entries in a SymPy ring, over a common denominator `step`."""

    kind = "ring"

    def __init__(self, stages: Stages, ring: Any, step: Any):
        self.stages = stages
        self.ring = ring
        self.step = step


def check_method(method: object) -> Method:
    """The argument, if it is a method."""
    if isinstance(method, Method):
        return method
    raise SeriesError(
        "method must be a method such as method('rk4') or a series, or inherit `Method` and have a property `program`, "
        f"but was {method!r:.60}"
    )


def auxiliary_colors(method: Method) -> frozenset[int]:
    """The colours that are no parts of the field, such as the matrix of a W-method."""
    if isinstance(method, RungeKutta | PartitionedRungeKutta):
        return frozenset()
    return frozenset(method.names.index(name) for name in method.program.auxiliary)


def own_trees(method: Method) -> Any:
    """Which trees a method is meant for, as bounds on children; None for all."""
    return method.max_children


def stages_of(method: Method, order: int) -> MethodStages:
    """A method's stages, in the form that suits its entries, exact for trees up to `order` nodes."""
    if isinstance(method, RungeKutta | PartitionedRungeKutta):
        return _tableau_stages(method)
    return _program_stages(method.program, order)


def inputs_of(method: Method, order: int) -> MethodStages | FlowChain:
    """What the coefficients of a method are computed from: its stages, or a chain of flows."""
    if not isinstance(method, RungeKutta | PartitionedRungeKutta):
        steps = flow_steps(method.program)
        if steps is not None:
            return FlowChain(steps, order)
    return stages_of(method, order)


@lru_cache(maxsize=64)
def _tableau_stages(method: RungeKutta | PartitionedRungeKutta) -> MethodStages:
    parts = method.partitions
    algebras = [part.algebra for part in parts if part.algebra is not None]
    if len(algebras) == len(parts) and len({algebra.polynomial for algebra in algebras}) == 1:
        return _algebraic_stages(algebras)
    a = [entry for part in parts for row in part.A for entry in row]
    b = [entry for part in parts for entry in part.b]
    return _in_domain(method.stages, a, b)


@lru_cache(maxsize=64)
def _program_stages(program: Program, order: int) -> MethodStages:
    rows = StageRows(program, order)
    plain = max(rows.sizes, default=1) == 1
    return _in_domain(len(rows.rows), *rows.flat(len(program.names)), () if plain else rows.sizes)


def _in_domain(size: int, a: list[Any], b: list[Any], blocks: Sequence[int] = ()) -> MethodStages:
    """Stages of given entries; blocks are polynomials modulo powers of their variable."""
    relation = [0] * size if blocks else []
    if any(isinstance(entry, float) for entry in (*a, *b)):
        return FloatStages(Stages(size, [to_float(x) for x in a], [to_float(x) for x in b], relation, blocks))
    if all(isinstance(entry, Fraction) for entry in (*a, *b)):
        bounds = Stages(size, [abs(x) for x in a], [abs(x) for x in b], relation, blocks)
        return RationalStages(Stages(size, a, b, relation, blocks), bounds)
    try:
        ring, elements, step = ring_and_elements([*a, *b])
    except ZeroDivisionError:
        raise SeriesError("method must have entries that can be evaluated, but one divides by zero") from None
    return RingStages(Stages(size, elements[: len(a)], elements[len(a) :], relation, blocks), ring, step)


def stages_in_field(method: Method, order: int) -> MethodStages:
    """A method's stages without a common denominator, where entries are no rationals in the field of fractions."""
    stages = stages_of(method, order)
    return _in_ring(stages, stages.ring.get_field()) if isinstance(stages, RingStages) else stages


def in_one_domain(method: Method, order: int, values: Sequence[Values]) -> tuple[MethodStages, list[Values]]:
    """A method's stages and values of series, brought to one kind and, if it is no other, to one field."""
    stages, operands = stages_in_field(method, order), alike(values)
    if stages.kind == "float" or operands[0].kind == "float":
        return _float_stages(method, stages), [as_floats(x) for x in operands]
    rings: list[Any] = [x.ring for x in (stages, *operands) if isinstance(x, RingStages | RingValues)]
    if not rings:
        return stages, operands
    ring = rings[0]
    for other in rings[1:]:
        ring = ring.unify(other)
    field = ring.get_field()
    return _in_ring(stages, field), [divided(as_ring(x)).in_ring(field, field.one) for x in operands]


def _in_ring(stages: Any, field: Any) -> RingStages:
    """The same stages over a field."""
    own = stages.stages
    if isinstance(stages, RationalStages):
        a, b = ([ring_element(field, x) for x in row] for row in (own.a, own.b))
    else:
        step = converted(stages.step, stages.ring, field)
        a, b = ([converted(x, stages.ring, field) / step for x in row] for row in (own.a, own.b))
    return RingStages(Stages(own.size, a, b, own.relation, own.sizes if own.relation else ()), field, field.one)


def _float_stages(method: Any, stages: Any) -> MethodStages:
    own = stages.stages
    if isinstance(stages, RationalStages) and any(own.relation):  # powers of nodes would be badly conditioned
        return stages_of(method.to_float(), 1)
    a, b = ([to_float(x) for x in row] for row in (own.a, own.b))
    return FloatStages(Stages(own.size, a, b, own.relation, own.sizes if own.relation else ()))


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
    return RationalStages(Stages(count, a, b, relation, [count]), _bounds(algebras, count))


def _bounds(algebras: Sequence[StageAlgebra], count: int) -> Stages:
    """Bounds on the tableau's entries, which are known to a few units in the last place."""
    tableaus = [algebra.tableau_float() for algebra in algebras]
    a = [_bound(entry) for A, _, _ in tableaus for row in A for entry in row]
    b = [_bound(entry) for _, b, _ in tableaus for entry in b]
    return Stages(count, a, b)


def _bound(entry: float) -> Fraction:
    return abs(Fraction(entry)) * (1 + Fraction(1, 2**40)) + Fraction(1, 2**60)
