"""Series of splitting methods: chains of exact flows, composed without logarithms.

From the last flow to the first, a ↦ (flow of c f^[ν], then a) is the Lie series Σ_j ∂_b^j a / j! along the field b
that is c at one single node and zero elsewhere: only leaves are cut. This costs much less than the stages of the
method's program.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exact import recursions
from bseries.exact.domains import converted, ring_and_elements, to_float
from bseries.exact.rationals import primorial
from integrators.methods.program.evaluations import LinearForm
from integrators.methods.program.program import Flow

if TYPE_CHECKING:
    from bseries.exact.arithmetic import Exact
    from integrators.methods.program.program import Program
    from trees.table import TreeTable


class FlowSteps(NamedTuple):
    """The flows of a splitting method, in order, with their times in one domain.

    Attributes:
        parts: The part of each flow; None: all.
        times: The times.
        kind: The domain of the times: rational, ring or float.
        ring: For the kind ring, the field of the times.
    """

    parts: Sequence[int | None]
    times: Sequence[Any]
    kind: str
    ring: Any = None


@lru_cache(maxsize=64)
def flow_steps(program: Program) -> FlowSteps | None:
    """The flows of a program that is a chain of exact flows; None for other programs."""
    parts: list[int | None] = []
    times: list[Any] = []
    point = LinearForm(1)
    for e, evaluation in enumerate(program.evaluations):
        if not isinstance(evaluation, Flow) or evaluation.forcing or evaluation.at != point:
            return None
        parts.append(evaluation.part)
        times.append(evaluation.time)
        point = point + LinearForm(0, {e: 1})
    return _in_domain(tuple(parts), tuple(times)) if times and program.result == point else None


def _in_domain(parts: Sequence[int | None], times: Sequence[Any]) -> FlowSteps:
    if any(isinstance(time, float) for time in times):
        return FlowSteps(parts, tuple(map(to_float, times)), "float")
    if all(isinstance(time, Fraction) for time in times):
        return FlowSteps(parts, times, "rational")
    ring, elements, common = ring_and_elements(times)  # takes seconds where roots are of high degree
    field = ring.get_field()
    divisor = converted(common, ring, field)
    return FlowSteps(parts, tuple(converted(x, ring, field) / divisor for x in elements), "ring", field)


class FlowChain:
    """The flows of a splitting method as an input of operations on series.

    Args:
        steps: The flows.
        order: Largest number of nodes.
    """

    terms = 1
    units = 2
    """Even: excludes arithmetic modulo 2^64 for fields, in which the values of a flow cannot be halved."""

    def __init__(self, steps: FlowSteps, order: int):
        self._steps = steps
        self._order = order
        self.kind, self.ring = steps.kind, steps.ring

    @property
    def step(self) -> Any:
        """L such that values at trees with n nodes times L^n are integers; 1 in a field of fractions."""
        if self.kind == "ring":
            return self.ring.one
        return math.lcm(*(time.denominator for time in self._steps.times)) * primorial(self._order)

    @property
    def exponent(self) -> int:
        """k such that |a(τ)| ≤ 2^(k·n): the exact flow over the sum of all |times| is larger tree by tree."""
        return max(0, (math.ceil(sum(map(abs, self._steps.times))) - 1).bit_length())

    def perturbed(self, source: random.Random, digits: int) -> FlowChain:
        """The same flows with every time t changed to t (1 ± 5 · 10^−digits)."""
        change = 5 * Fraction(10) ** -digits
        times = [time * (1 + source.choice((-change, change))) for time in self._steps.times]
        return FlowChain(self._steps._replace(times=times), self._order)

    def load(self, table: TreeTable, arithmetic: Exact, *, field: bool = False) -> Any:
        """The coefficients of the method."""
        values = None
        for part, time in zip(reversed(self._steps.parts), reversed(self._steps.times), strict=True):
            node = arithmetic.vector([time * arithmetic.node_factor(field=True)])[0]
            along = arithmetic.zeros(len(table))
            for color in range(table.colors) if part is None else (part,):
                along[color] = node
            values = recursions.lie_series(along, values, 1, table, arithmetic, sparse=True)
        return values
