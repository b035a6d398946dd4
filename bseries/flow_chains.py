"""Splitting methods: chains of exact flows, composed without logarithms.

With the last flow first, a ↦ (flow of c f^[ν], then a) is the Lie series Σ_j ∂_b^j a / j! along the field b that is c
at one single node and zero elsewhere: only leaves are cut. That is cheaper by far than the stages of
`bseries.lowering`.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from integrators.linear_forms import LinearForm
from integrators.program import Flow

from . import recursions
from .domains import converted, ring_and_elements, to_float
from .rationals import primorial

if TYPE_CHECKING:
    from integrators.program import Program
    from trees.table import TreeTable

    from .arithmetic import Exact


def flow_steps(program: Program) -> list[tuple[int | None, Any]] | None:
    """The parts and times of a program that is a chain of exact flows; None if it is anything else."""
    steps: list[tuple[int | None, Any]] = []
    point = LinearForm(1)
    for e, evaluation in enumerate(program.evaluations):
        if not isinstance(evaluation, Flow) or evaluation.forcing or evaluation.at != point:
            return None
        steps.append((evaluation.part, evaluation.time))
        point = point + LinearForm(0, {e: 1})
    return steps if steps and program.result == point else None


class FlowChain:
    """The flows of a splitting method, as an input of operations on series.

    Args:
        steps: Part (None: all) and time of each flow, in order.
        order: Largest number of nodes.
    """

    terms = 1
    units = 2
    """Even: no arithmetic modulo 2^64 where a field is wanted, since a flow's values cannot be halved there."""

    def __init__(self, steps: Sequence[tuple[int | None, Any]], order: int):
        self._order = order
        self._parts = [part for part, _ in steps]
        times = [time for _, time in steps]
        self.ring: Any = None
        self.step: Any = None
        if any(isinstance(time, float) for time in times):
            self.kind, self.times = "float", [to_float(time) for time in times]
        elif all(isinstance(time, Fraction) for time in times):
            self.kind, self.times = "rational", times
            self.step = math.lcm(*(time.denominator for time in times)) * primorial(order)
        else:
            ring, elements, common = ring_and_elements(times)
            self.kind, self.ring = "ring", ring.get_field()
            self.step = self.ring.one
            divisor = converted(common, ring, self.ring)
            self.times = [converted(x, ring, self.ring) / divisor for x in elements]

    @property
    def exponent(self) -> int:
        """k such that |a(τ)| ≤ 2^(k·n): the exact flow over the sum of all |times| is larger tree by tree."""
        return max(0, (math.ceil(sum(map(abs, self.times))) - 1).bit_length())

    def perturbed(self, source: random.Random, digits: int) -> FlowChain:
        """The same flows with every time t changed to t (1 ± 5 · 10^−digits)."""
        change = 5 * Fraction(10) ** -digits
        times = [time * (1 + source.choice((-change, change))) for time in self.times]
        return FlowChain(list(zip(self._parts, times, strict=True)), self._order)

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool = False) -> Any:
        """The coefficients of the method."""
        values = None
        for part, time in zip(reversed(self._parts), reversed(self.times), strict=True):
            node = arithmetic.vector([time * arithmetic.node_factor(field=True)])[0]
            along = arithmetic.zeros(len(table))
            for color in range(table.colors) if part is None else (part,):
                along[color] = node
            values = recursions.lie_series(along, values, 1, table, arithmetic, sparse=True)
        return values
