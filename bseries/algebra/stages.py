"""Inputs of recursions made from methods: stages from tableaux or programs, and chains of flows from splitting methods.

Every evaluation of a program is the field at a point with coefficients in a commutative algebra, its block (see
`bseries.exact.recursions.Stages`), followed by a linear functional:

- Field: the numbers.
- Derivative: dual numbers, ε² = 0. The coefficient of ε in h f(Y + ε v) is h f′(Y) v.
- Flow: polynomials in θ. The path z(θ) = Y + ∫₀^θ (time · h f(z) + forcing) solves the differential equation, so its
  coefficient of θ^(l+1) is time/(l+1) times the coefficient of θ^l of h f(z).
- Average: polynomials in θ along the given path, integrated at the end.

A tree with n nodes needs polynomials of degree at most (n−1)d, where d is the degree of the path for one node, so
arithmetic modulo a higher power of θ is exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, lru_cache, reduce
from itertools import accumulate
from operator import mul
from typing import Any, TypeAlias, cast

from bseries.algebra.general_linear import GeneralLinearInputs
from bseries.algebra.multistep import MultistepInputs
from bseries.exact import domains, lie, powers, recursions, stage_sizes
from bseries.exact.arithmetic import Exact, Wrapped, wrapped_stages
from bseries.exact.bounds import Bound, scaled
from bseries.exact.denominators import primorial, smallest_step, twos
from bseries.exact.domains import RingValues, Values, alike, converted, narrowest, ring_element, to_float
from bseries.exact.powers import PowerWeights
from bseries.exact.rationals import Operation, RationalValues
from bseries.exact.recursions import Stages, lie_series
from bseries.exceptions import SeriesError
from bseries_base.errors import shown
from integrators import PartitionedRungeKutta, RungeKutta, StageAlgebra
from integrators.core.immutable import cached_method
from integrators.exact.entries import multiply_entries, sum_entries
from integrators.methods.kinds.memory import GeneralLinear, LinearMultistep, MethodWithMemory
from integrators.methods.programs.evaluations import LinearForm
from integrators.methods.programs.program import Average, Derivative, Evaluation, Field, Flow, Method, Program
from trees.basis import Basis
from trees.counting import check_order
from trees.table import TreeTable
from trees.words import Words

MOST_STAGES = 1000
"""Stages of a method, those of flows counted as often as an order needs."""


class MethodStages:
    """The stages of a method, in one domain of numbers (`kind`), which give its series and the logarithm of that."""

    kind: str
    ring: Any = None

    def __init__(self, stages: Stages):
        self.stages = stages

    def weight_sums(self, colors: int) -> list[Any]:
        """For each colour the sum of the weights: the coefficient of the single node."""
        size, firsts = self.stages.size, self.stages.ends[:-1]
        return [sum(self.stages.b[c * size + at] for at in firsts) for c in range(colors)]

    def load(self, table: TreeTable, arithmetic: Exact) -> Stages:
        """The stages, for recursions that start from them."""
        return self.stages

    def series(self, table: TreeTable) -> Values:
        """The elementary weights."""
        raise NotImplementedError

    def logarithm(self, table: TreeTable) -> Values:
        """The logarithm of the series."""
        raise NotImplementedError


class ExactStages(MethodStages):
    """Stages whose entries are elements of a SymPy `ring`, divided by `step`: powers and inverses are stages, too."""

    kind = "ring"

    def __init__(self, stages: Stages, ring: Any, step: Any):
        super().__init__(stages)
        self.ring, self.step = ring, step

    def series(self, table: TreeTable) -> Values:
        """The elementary weights."""
        return self._sum(table, powers.one_step(table.max_order))

    def logarithm(self, table: TreeTable) -> Values:
        """The logarithm of the series."""
        return self._sum(table, powers.logarithm(table.max_order))

    def power(self, table: TreeTable, s: Fraction) -> Values:
        """The series of s steps."""
        return self._sum(table, powers.power(table.max_order, s))

    def _sum(self, table: TreeTable, weights: PowerWeights) -> Values:
        arithmetic = domains.interpreted(self)
        total = recursions.sum_of_powers(table, self.stages, 1, weights.numerators, arithmetic)
        inverses = [arithmetic.number(Fraction(1, d)) for d in weights.denominators]
        elements = [arithmetic.element(x * inverses[n]) for x, n in zip(total, table.columns.order, strict=True)]
        return domains.narrowed(RingValues(table, self.ring, elements, self.step))

    def inverse(self) -> ExactStages:
        """The inverse map."""
        return self._made(Stages.inverse)

    def scaled(self, factor: Fraction) -> ExactStages:
        """The method with `factor` times the step size; in a ring, a whole number."""
        number = int(factor) if factor.denominator == 1 else factor
        return self._made(lambda stages: stages.scaled(number))

    def _made(self, change: Callable[[Stages], Stages]) -> ExactStages:
        return ExactStages(change(self.stages), self.ring, self.step)


class FloatStages(MethodStages):
    """The stages of a method in floats."""

    kind = "float"

    def series(self, table: TreeTable) -> Values:
        """The elementary weights."""
        return domains.float_values(table, powers.float_series(table, self.stages))

    def logarithm(self, table: TreeTable) -> Values:
        """The logarithm of the series, by Lie derivatives: sums of powers are unstable."""
        return lie.logarithm(self.series(table))


class RationalStages(ExactStages):
    """The stages of a method with rational series.

    Args:
        stages: Entries as Fractions, in any basis of the stage algebra in which products have integer coefficients.
        real: The stages of the tableau itself, which bounds are found from, if those are in another basis.
    """

    kind = "rational"

    def __init__(self, stages: Stages, real: Stages | None = None):
        super().__init__(stages, None, math.lcm(*(entry.denominator for entry in (*stages.a, *stages.b))))
        self.real = real or stages

    def _sum(self, table: TreeTable, weights: PowerWeights) -> RationalValues:
        return powers.rational_sum(table, self.stages, self.step, self.bound, weights)

    @cached_property
    def integers(self) -> Wrapped:
        """The arithmetic modulo 2^64 for recursions that start from the stages."""
        a, b = (max((twos(x.denominator) for x in row), default=0) for row in (self.stages.a, self.stages.b))
        return wrapped_stages(a, b)

    def bound(self, order: int) -> Bound:
        """Bounds on the series, by number of nodes."""
        rough = self.real.error or powers.fits_word(order, self.step)
        return (stage_sizes.rough_bound if rough else stage_sizes.bound)(self.real, order)

    def then(self, other: RationalStages) -> RationalStages:
        """The method that takes this step, then the other."""
        forms = dict.fromkeys([(self.stages, other.stages), (self.real, other.real)])
        return RationalStages(*(first.then(second) for first, second in forms))

    def _made(self, change: Callable[[Stages], Stages]) -> RationalStages:
        return RationalStages(*map(change, dict.fromkeys([self.stages, self.real])))


def check_method(method: object) -> Method:
    """Return the method; raise a SeriesError if it is no method."""
    if isinstance(method, Method):
        return method
    if callable(method):
        raise SeriesError(f"method must be a method, which bs.trace makes of a function, but was {shown(method)}")
    raise SeriesError(
        "method must be a method such as method('rk4') or a series on trees, or inherit `Method` and have a property "
        f"`program`, but was {method!r:.60}"
    )


def auxiliary_colors(method: Method) -> frozenset[int]:
    """The colours that are not parts of the field, such as the matrix of a W-method."""
    if isinstance(method, RungeKutta | PartitionedRungeKutta | MethodWithMemory):
        return frozenset()
    return frozenset(method.names.index(name) for name in method.program.auxiliary)


def stages_of(method: Method, order: int) -> MethodStages:
    """The stages of a method in the domain of its entries, exact for trees up to `order` nodes."""
    if isinstance(method, RungeKutta | PartitionedRungeKutta):
        return _tableau_stages(method)
    return _program_stages(method.program, order)


def size_without_cuts(method: Method) -> tuple[int, int] | None:
    """The number of stages of a tableau whose series is computed without cuts, and that of bits of its denominators.

    None for other methods, and floats.
    """
    if not isinstance(method, RungeKutta | PartitionedRungeKutta):
        return None
    stages = _tableau_stages(method)
    if not isinstance(stages, ExactStages):
        return None
    return method.stages, stages.step.bit_length() if isinstance(stages, RationalStages) else 0


def inputs_of(method: Method, order: int) -> MethodInputs:
    """The input for the coefficients of a method: its stages, a chain of flows, or those of a method with memory."""
    if isinstance(method, MethodWithMemory):
        return _memory_inputs(method, order)
    chain = None if isinstance(method, RungeKutta | PartitionedRungeKutta) else flow_chain(method.program)
    return stages_of(method, order) if chain is None else replace(chain, order=order)


@lru_cache(maxsize=64)
def _memory_inputs(method: MethodWithMemory, order: int) -> MultistepInputs | GeneralLinearInputs:
    if isinstance(method, LinearMultistep):
        return MultistepInputs(method, order)
    return GeneralLinearInputs(cast(GeneralLinear, method))


def is_chain(method: Method) -> bool:
    """Whether a method is a chain of flows."""
    return isinstance(inputs_of(method, 1), FlowChain)


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
    """Stages with these entries; blocks are polynomials modulo powers of their variable."""
    relation = [0] * size if blocks else []
    try:
        kind, entries, ring, step = narrowest([*a, *b])
    except ZeroDivisionError:
        raise SeriesError("method must have entries that can be evaluated, but one divides by zero") from None
    stages = Stages(size, entries[: len(a)], entries[len(a) :], relation, blocks)
    if kind == "float":
        return FloatStages(stages)
    if kind == "rational":
        return RationalStages(stages)
    return ExactStages(stages, ring, step)


def stages_in_field(method: Method, order: int) -> MethodStages:
    """The stages of a method without a common denominator; irrational entries in the field of fractions."""
    stages = stages_of(method, order)
    return _in_ring(stages, stages.ring.get_field()) if stages.kind == "ring" else stages


def in_one_domain(method: Method, order: int, values: Sequence[Values]) -> tuple[MethodStages, list[Values]]:
    """The stages of a method and the values of series in one domain: rationals, floats, or one field."""
    stages, operands = stages_in_field(method, order), alike(values)
    if stages.kind == "float" or operands[0].kind == "float":
        return _float_stages(method, stages), [domains.as_floats(x) for x in operands]
    rings: list[Any] = [x.ring for x in (stages, *operands) if x.kind == "ring"]
    if not rings:
        return stages, operands
    field = reduce(lambda ring, other: ring.unify(other), rings).get_field()
    return _in_ring(stages, field), [domains.as_ring(x).reduced.in_ring(field, field.one) for x in operands]


def _in_ring(stages: Any, field: Any) -> MethodStages:
    """The same stages over a field."""
    own = stages.stages
    if isinstance(stages, RationalStages):
        a, b = ([ring_element(field, x) for x in row] for row in (own.a, own.b))
    else:
        step = converted(stages.step, stages.ring, field)
        a, b = ([converted(x, stages.ring, field) / step for x in row] for row in (own.a, own.b))
    return ExactStages(own.with_entries(a, b), field, field.one)


def _float_stages(method: Any, stages: Any) -> MethodStages:
    own = stages.stages
    if isinstance(stages, RationalStages) and any(own.relation):  # powers of nodes are badly conditioned
        return stages_of(method.to_float(), 1)
    a, b = ([to_float(x) for x in row] for row in (own.a, own.b))
    return FloatStages(own.with_entries(a, b))


def _algebraic_stages(algebras: Sequence[StageAlgebra]) -> RationalStages:
    """Stages on the roots of a rational polynomial P, in the basis 1, z, z², … with z = ℓx.

    ℓ is the smallest integer for which P(z/ℓ) ℓ^s is monic with integer coefficients: products modulo it have integer
    structure constants, and only the entries of A and b have denominators.
    """
    polynomial, count = algebras[0].polynomial, len(algebras[0].b)
    denominators = [p.denominator for p in reversed(polynomial)]  # of the coefficients of z^s, z^(s−1), …, 1
    scale = smallest_step(denominators, math.lcm(*denominators))
    power = [Fraction(scale) ** k for k in range(count + 1)]
    relation = [polynomial[k] * power[count - k] for k in range(count)]
    a = [x.A[i][j] * power[j] / power[i] for x in algebras for i in range(count) for j in range(count)]
    b = [x.b[j] * power[j] for x in algebras for j in range(count)]
    return RationalStages(Stages(count, a, b, relation, [count]), _real_stages(algebras, count))


def _real_stages(algebras: Sequence[StageAlgebra], count: int) -> Stages:
    """The stages with entries from floats, which have errors of a few units in the last place."""
    tableaus = [algebra.tableau_float() for algebra in algebras]
    a = [Fraction(entry) for A, _, _ in tableaus for row in A for entry in row]
    b = [Fraction(entry) for _, b, _ in tableaus for entry in b]
    return Stages(count, a, b, error=scaled(Fraction(1, 2**40) * max(1, *map(abs, a), *map(abs, b))))


Row = dict[int, Any]
"""A row of a stage matrix: entries by column."""


class StageRows:
    """A program as rows of a stage matrix over the components of its blocks, exact for trees up to `order` nodes.

    Attributes:
        sizes: The length of the block of each evaluation.
        part: The part of the field of each component; None: all.
        rows: The row of each component.
        weights: The row of the result.
    """

    def __init__(self, program: Program, order: int):
        self.sizes = [block_size(evaluation, check_order(order)) for evaluation in program.evaluations]
        if sum(self.sizes) > MOST_STAGES:
            raise SeriesError(
                f"method must have at most {MOST_STAGES} stages, those of flows counted as often as this order needs, "
                f"but has {sum(self.sizes)}"
            )
        self._program = program
        self._first = [sum(self.sizes[:e]) for e in range(len(self.sizes))]
        self.part = [e.part for e, size in zip(program.evaluations, self.sizes, strict=True) for _ in range(size)]
        self.rows = [row for e in range(len(self.sizes)) for row in self._block(e)]
        self.weights = self._form(program.result)

    def _block(self, e: int) -> list[Row]:
        """The rows of one evaluation: the path on which the field is evaluated, coefficient by coefficient."""
        evaluation, size, first = self._program.evaluations[e], self.sizes[e], self._first[e]
        match evaluation:
            case Field(_, at):
                return [self._form(at)]
            case Derivative(_, at, along):
                return [self._form(at), self._form(along)]
            case Average(_, path):
                return [self._form(form) for form in path[:size]] + [{} for _ in range(size - len(path))]
            case Flow(_, at, time, forcing):
                rows: list[Row] = [self._form(at)]
                for k in range(1, size):
                    row: Row = {first + k - 1: multiply_entries(time, Fraction(1, k))}
                    if k <= len(forcing):
                        _add(row, self._form(forcing[k - 1]), Fraction(1, k))
                    rows.append(row)
                return rows

    def _form(self, form: LinearForm) -> Row:
        row: Row = {}
        for e, x in form.terms.items():
            _add(row, self._register(e), x)
        return row

    @cached_method
    def _register(self, e: int) -> Row:
        """The linear functional that gives k_e."""
        evaluation, first, size = self._program.evaluations[e], self._first[e], self.sizes[e]
        match evaluation:
            case Field():
                return {first: Fraction(1)}
            case Derivative():
                return {first + 1: Fraction(1)}
            case Average(_, _, power):
                return {first + k: Fraction(1, k + power + 1) for k in range(size)}
            case Flow(_, _, time, forcing):
                row: Row = {first + k: multiply_entries(time, Fraction(1, k + 1)) for k in range(size)}
                for j, form in enumerate(forcing):
                    _add(row, self._form(form), Fraction(1, j + 1))
                return row

    def flat(self, colors: int) -> tuple[list[Any], list[Any]]:
        """Matrices and weights, colour by colour, in the form of `Stages`."""
        zero = Fraction(0)
        a, b = (
            [
                row.get(j, zero) if part in (color, None) else zero
                for color in range(colors)
                for row in rows
                for j, part in enumerate(self.part)
            ]
            for rows in (self.rows, [self.weights])
        )
        return a, b


def block_size(evaluation: Evaluation, order: int) -> int:
    """The number of components for trees up to `order` nodes."""
    match evaluation:
        case Field():
            return 1
        case Derivative():
            return 2
        case Average(_, path):
            return (order - 1) * (len(path) - 1) + 1
        case Flow(_, _, _, forcing):
            return (order - 1) * max(len(forcing), 1) + 1


def _add(row: Row, other: Row, factor: Any) -> None:
    for j, x in other.items():
        row[j] = sum_entries((row.get(j, Fraction(0)), multiply_entries(factor, x)))


@lru_cache(maxsize=64)
def flow_chain(program: Program) -> FlowChain | None:
    """A program as a chain of flows, for trees with one node; None if it is not such a chain."""
    parts: list[int | None] = []
    times: list[Any] = []
    point = LinearForm(1)
    for e, evaluation in enumerate(program.evaluations):
        if not isinstance(evaluation, Flow) or evaluation.forcing or evaluation.at != point:
            return None
        parts.append(evaluation.part)
        times.append(evaluation.time)
        point = point + LinearForm(0, {e: 1})
    if not times or program.result != point:
        return None
    kind, entries, ring, step = narrowest(times)
    if kind == "ring":
        ring, own = ring.get_field(), ring
        divisor = converted(step, own, ring)
        entries = [converted(x, own, ring) / divisor for x in entries]
    return FlowChain(tuple(parts), tuple(entries), kind, ring)


@dataclass(frozen=True, eq=False)
class FlowChain:
    """The flows of a splitting method as an input of operations on series.

    From the last flow to the first, a ↦ (flow of c f^[ν], then a) is the Lie series Σ_j ∂_b^j a / j! along the field b
    that is c at one single node and zero elsewhere: only leaves are cut. This costs much less than the stages of the
    method's program.
    """

    parts: Sequence[int | None]  # the part of each flow, in order; None: all
    times: Sequence[Any]  # in one domain
    kind: str  # that domain: rational, ring or float
    ring: Any = None  # for the kind ring, the field of the times
    order: int = 1  # the largest number of nodes

    @cached_property
    def denominator(self) -> int:
        """The common denominator of rational times; 1 in other domains."""
        return math.lcm(*(time.denominator for time in self.times)) if self.kind == "rational" else 1

    @property
    def step(self) -> Any:
        """L such that values at trees with n nodes times L^n are integers; 1 in a field of fractions."""
        return self.ring.one if self.kind == "ring" else self.denominator * primorial(self.order)

    def series(self, table: Basis[Any]) -> Values:
        """The coefficients of the method."""
        if isinstance(table, Words):
            return self._on_words(table)
        size = sum(map(abs, self.times)) if self.kind == "rational" else 0
        bound = tuple(
            scaled(size**n) for n in range(table.max_order + 1)
        )  # the exact flow over all times is larger tree by tree
        operation = Operation(
            lambda arithmetic, weights: weights(field=False), lambda known: bound, units=2, passes=len(self.times)
        )  # even units: modulo 2^64 the values of a flow cannot be halved
        return domains.apply(table, [self], operation)

    def _on_words(self, words: Words) -> Values:
        """The product of the exponentials of the flows, in which the letters of the last flow come first."""
        arithmetic = domains.interpreted(self)
        found = arithmetic.vector([1] + [0] * len(words))  # n! L^n times the values, that of the empty word first
        for part, time in zip(self.parts, self.times, strict=True):
            factors = [1] + [time * self.denominator] * words.max_order
            powers = arithmetic.vector([*accumulate(factors, mul)])  # not by **: SymPy has no 0**0 in some fields
            for n, k, longer, rest in words.prefixes(part):
                factor = math.comb(n, k) * powers[k]
                found[longer] = [x + factor * y for x, y in zip(found[longer], found[rest], strict=True)]
        denominators = [math.factorial(n) * self.denominator**n for n in range(words.max_order + 1)]
        if self.kind == "rational":
            return RationalValues(words, [int(x.p) for x in found[1:]], denominators, self.step)
        elements = [
            arithmetic.element(x * arithmetic.number(Fraction(1, denominators[n])))
            for x, n in zip(found[1:], words.orders, strict=True)
        ]
        if self.kind == "float":
            return domains.float_values(words, elements)
        return domains.narrowed(RingValues(words, self.ring, elements, self.ring.one))

    def logarithm(self, table: TreeTable) -> Values:
        """The logarithm of the series."""
        return lie.logarithm(self.series(table))

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool = False) -> Any:
        """The coefficients in an arithmetic, by Lie series from the last flow to the first."""
        values = None
        for part, time in zip(reversed(self.parts), reversed(self.times), strict=True):
            node = arithmetic.vector([time * arithmetic.node_factor(field=True)])[0]
            along = arithmetic.zeros(len(table))
            for color in range(table.colors) if part is None else (part,):
                along[color] = node
            values = lie_series(along, values, 1, table, arithmetic, sparse=True)
        return values


MethodInputs: TypeAlias = MethodStages | FlowChain | MultistepInputs | GeneralLinearInputs
"""What the series of a method and its logarithm are computed from."""
