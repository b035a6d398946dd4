"""Data of a step: linear forms, nodes, calls, implicit groups and the plan.

The analysis (`nodes`) makes nodes, the planner (`plan`) puts them in order, and the writers turn the plan into source.
All of them share these types, in which a stage derivative k is a value of the field, without the factor h.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

import sympy

from integrators.exact.arithmetic import simplest

DECIMALS = 40
"""Relative accuracy of the rational coefficients: 10^-40."""

Key = tuple[int, int]
"""A stage derivative: the number of its evaluation, and the block of variables."""


class Form(NamedTuple):
    """start · y + h Σ x_e k_e in one block of variables, with stage derivatives k_e."""

    start: Fraction
    terms: tuple[tuple[int, Fraction], ...]

    @classmethod
    def of(cls, start: Fraction, terms: Mapping[int, Fraction]) -> Form:
        """Sort the terms, drop zeros, and round a start within 10^-30 of an integer to that integer."""
        whole = Fraction(round(start))
        start = whole if abs(start - whole) < Fraction(1, 10**30) else start
        return cls(start, tuple(sorted((e, x) for e, x in terms.items() if x)))

    def plus(self, other: Form, factor: Fraction = Fraction(1)) -> Form:
        """Add a multiple of another form."""
        terms = dict(self.terms)
        for e, x in other.terms:
            terms[e] = terms.get(e, Fraction(0)) + factor * x
        return Form.of(self.start + factor * other.start, terms)

    @property
    def is_start(self) -> bool:
        """Whether the form is y itself."""
        return self == (1, ())


Point = tuple[tuple[int, Form], ...]
"""Pairs (block, form), in ascending order of the blocks."""


class Node(NamedTuple):
    """One evaluation in one block of variables.

    Attributes:
        kind: ``field`` at one point, ``derivative`` at a point along a vector, ``average`` along a path of points,
            ``flow`` from a point with forcing, or ``resolvent`` (I − hγ F′)⁻¹ at a point, of a vector without h.
        piece: The piece of the field.
        points: The arguments.
        detail: The power of an average, the time of a flow, or γ of a resolvent.
    """

    kind: str
    piece: int
    points: tuple[Point, ...]
    detail: Fraction | int = 0

    @property
    def reads(self) -> set[Key]:
        """The stage derivatives that the points depend on."""
        return {(e, block) for point in self.points for block, form in point for e, _ in form.terms}

    def changed(self, change: Callable[[Form, int], Form]) -> Node:
        """The node with another form in each block of its points."""
        points = (tuple((block, change(form, block)) for block, form in point) for point in self.points)
        return self._replace(points=tuple(points))


class Call(NamedTuple):
    """One evaluation in several blocks, computed together."""

    evaluation: int
    blocks: tuple[int, ...]
    node: Node

    @property
    def calls(self) -> tuple[Call]:
        """The call itself, as the only one of its kind of work."""
        return (self,)

    @property
    def written(self) -> list[Key]:
        """The stage derivatives that it computes."""
        return [(self.evaluation, block) for block in self.blocks]

    def changed(self, change: Callable[[Form, int], Form]) -> Call:
        """The call with other forms, see `Node.changed`."""
        return self._replace(node=self.node.changed(change))


class Group(NamedTuple):
    """Implicit stages: the calls of one iteration, in order, and the stage derivatives that are iterated."""

    calls: tuple[Call, ...]
    unknowns: tuple[Key, ...]

    @property
    def written(self) -> list[Key]:
        """The stage derivatives that an iteration computes."""
        return [key for call in self.calls for key in call.written]

    def changed(self, change: Callable[[Form, int], Form]) -> Group:
        """The group with other forms, see `Node.changed`."""
        return self._replace(calls=tuple(call.changed(change) for call in self.calls))

    @property
    def blocks(self) -> list[int]:
        """The blocks of the unknowns, in ascending order."""
        return sorted({block for _, block in self.unknowns})


Past: TypeAlias = tuple[tuple[int, tuple[tuple[int, Fraction], ...]], ...]
"""Vectors kept from step to step, and the sums of vectors that they become."""


class Plan(NamedTuple):
    """One step.

    Attributes:
        work: Calls and groups, in order of computation.
        result: The end of the step, for each block.
        reused: Stage derivatives at the start of a step (keys) and those at the end of the step before (values) that
            they equal (first same as last).
        staggered: Kicks, with their coefficients, by the blocks in which a step begins after the first kick; there y
            in `work` and `result` stands for y + h x k.
        abscissas: The abscissa of each evaluation of an implicit group.
        past: Vectors k_e that a multistep method keeps, and the sums Σ x_i k_i that they become, in this order, at the
            end of a step.
    """

    work: tuple[Call | Group, ...]
    result: Mapping[int, Form]
    reused: Mapping[Key, Key]
    staggered: Mapping[int, tuple[tuple[int, Fraction], ...]]
    abscissas: Mapping[int, Fraction]
    past: Past = ()

    @property
    def moved(self) -> list[int]:
        """The blocks that change in a step."""
        return [block for block, form in self.result.items() if not form.is_start]

    @property
    def groups(self) -> list[Group]:
        """The implicit groups."""
        return [work for work in self.work if isinstance(work, Group)]

    @property
    def computed(self) -> list[Call | Group]:
        """The work of each step but the first: everything except calls that the step before has made."""
        return [work for work in self.work if not self.is_reused(work)]

    def is_reused(self, work: Call | Group) -> bool:
        """Whether the step before has made this call."""
        return isinstance(work, Call) and (work.evaluation, work.blocks[0]) in self.reused

    def points(self) -> Counter[int]:
        """How many points a step computes in each block."""
        calls = (work for work in self.computed if isinstance(work, Call))
        return Counter(block for call in calls for point in call.node.points for block, _ in point)


class Options(NamedTuple):
    """Options of the source of a step, as for `stepper`; the solver is ``fixed-point`` or ``newton``."""

    solver: str
    compensated: bool
    split: bool
    average_nodes: int | None
    control: sympy.Expr | None


def fraction(number: Any) -> Fraction:
    """Approximate a coefficient by a rational number, to `DECIMALS` digits."""
    if hasattr(number, "evalf"):
        return simplest(sympy.Rational(number.evalf(DECIMALS)))
    return Fraction(number)
