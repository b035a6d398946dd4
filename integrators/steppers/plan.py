"""The order of work in a step: slopes that are known at once, groups of slopes to be solved for, and what is kept.

- Cells that an implicit group only needs linearly (q' = M⁻¹ p) are put into the points of the others: this is the
  Nyström form of an implicit method, with half the unknowns.
- A slope at the end of a step that the next step needs at its start is kept (first same as last).
- Where such a slope is all that a step begins with, as in kick–drift–kick, steps go from y + h x k, the state after the
  first kick, to the same in the next step: the last kick of a step and the first one of the next are one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter
from heapq import heapify, heappop, heappush
from typing import TYPE_CHECKING, NamedTuple

from integrators.steppers.nodes import Form, Key, Node, Point

if TYPE_CHECKING:
    from integrators.steppers.nodes import Nodes
    from integrators.steppers.structure import Structure


class Call(NamedTuple):
    """Slopes of one evaluation, computed together."""

    evaluation: int
    cells: tuple[int, ...]
    node: Node


class Group(NamedTuple):
    """Slopes that depend on one another.

    Attributes:
        calls: What one sweep computes, in order.
        unknowns: The slopes that a sweep begins and ends with.
    """

    calls: tuple[Call, ...]
    unknowns: tuple[Key, ...]


class Plan(NamedTuple):
    """A step.

    Attributes:
        work: Calls and groups, in order.
        result: The end of the step, for each cell.
        carried: Slopes at the end of a step (values) that are slopes at the start of the next one (keys).
        staggered: Cells in which steps begin after the first kick, or kicks, with slopes and coefficients; `work` and
            `result` have y + h x k for y there.
    """

    work: tuple[Call | Group, ...]
    result: Mapping[int, Form]
    carried: Mapping[Key, Key]
    staggered: Mapping[int, tuple[tuple[int, Fraction], ...]]

    @property
    def groups(self) -> list[Group]:
        """The groups, which are solved by iteration."""
        return [work for work in self.work if isinstance(work, Group)]

    def is_carried(self, work: Call | Group) -> bool:
        """Whether a call is made by the step before."""
        return isinstance(work, Call) and (work.evaluation, work.cells[0]) in self.carried

    def points(self) -> Counter[int]:
        """How often a step makes a point in each cell."""
        calls = [work for work in self.work if isinstance(work, Call) and not self.is_carried(work)]
        return Counter(cell for call in calls for point in call.node.points for cell, _ in point)


def plan(nodes: Nodes, *, stagger: bool = True) -> Plan:
    """The plan of a step.

    Args:
        nodes: The nodes of a method on a scene.
        stagger: Whether steps may begin after their first kick; all steps must have the same size then.
    """
    found = _Planner(nodes).plan()
    return _staggered(found) if stagger else found


class _Planner:
    def __init__(self, nodes: Nodes):
        self.structure: Structure = nodes.structure
        self.nodes, self.result = dict(nodes.nodes), dict(nodes.result)
        self.next = 1 + max((e for e, _ in self.nodes), default=0)
        self.work: list[Call | Group] = []

    def plan(self) -> Plan:
        for component in self._components():
            if len(component) == 1 and component[0] not in self.nodes[component[0]].reads:
                e, cell = component[0]
                self.work.append(Call(e, (cell,), self.nodes[component[0]]))
            else:
                self._add_group(component)
        carried = self._carried()
        apart = {*carried, *carried.values()}
        return Plan(tuple(_merged(self.work, apart=apart)), self.result, carried, {})

    def _components(self) -> list[list[Key]]:
        """The strongly connected components of the slopes, those that others depend on first."""
        needs = {key: node.reads & self.nodes.keys() for key, node in self.nodes.items()}
        try:
            return [[key] for key in _ordered(needs)]
        except CycleError:
            return _strong_components(needs)

    def _add_group(self, keys: Sequence[Key]) -> None:
        """Add the group of these slopes; those of linear cells are put into the points of the others."""
        linear = self._linear_cells(keys)
        inner = {key for key in keys if key[1] in linear}
        calls: list[Call] = []
        unknowns = [key for key in keys if key not in inner]
        for e, cell in unknowns:
            node = self._substituted_node(self.nodes[e, cell], inner, calls)
            self.nodes[e, cell] = node
            calls.append(Call(e, (cell,), node))
        self.work.append(Group(tuple(_merged(calls, old=set(unknowns))), tuple(unknowns)))
        self._substitute_later(keys, inner)

    def _linear_cells(self, keys: Sequence[Key]) -> set[int]:
        """Cells of a group that depend linearly on other cells only, which stay unknowns."""
        cells = {cell for _, cell in keys}
        found: set[int] = set()
        for cell in sorted(cells, reverse=True):
            own = [self.nodes[key] for key in keys if key[1] == cell]
            flows = [self.structure.flow(node.piece, cell) for node in own]
            needed = frozenset[int]().union(*(flow.cells for flow in flows))
            if (
                all(node.kind == "field" and flow.is_linear for node, flow in zip(own, flows, strict=True))
                and needed.isdisjoint({*found, cell})
                and len({node.piece for node in own}) == 1
                and not any(cell in self.structure.flow(self.nodes[e, c].piece, c).cells for e, c in keys if c in found)
                and len(found) + 1 < len(cells)
            ):
                found.add(cell)
        return found

    def _substitute_later(self, keys: Sequence[Key], inner: set[Key]) -> None:
        """Put linear slopes of a group into everything that comes after it; the only one in its cell is computed."""
        single = sorted(key for key in inner if sum(cell == key[1] for _, cell in inner) == 1)
        self.work += [Call(e, (cell,), self.nodes[e, cell]) for e, cell in single]
        inner = inner.difference(single)
        if not inner:
            return
        done = {*keys, *(key for work in self.work for key in _written(work))}
        for key, node in list(self.nodes.items()):
            if key not in done and node.reads & inner:
                self.nodes[key] = self._substituted_node(node, inner, self.work)
        self.result = {cell: self._substituted(form, cell, inner, self.work) for cell, form in self.result.items()}

    def _substituted_node(self, node: Node, inner: set[Key], calls: list[Call | Group] | list[Call]) -> Node:
        points = tuple(
            tuple((cell, self._substituted(form, cell, inner, calls)) for cell, form in point) for point in node.points
        )
        return node._replace(points=points)

    def _substituted(self, form: Form, cell: int, inner: set[Key], calls: list) -> Form:
        """The form with one slope, Σ x_e k_e = V(Σ x_e · point of k_e), in place of the linear ones of a group."""
        replaced = [(e, x) for e, x in form.terms if (e, cell) in inner]
        if not replaced:
            return form
        template = self.nodes[replaced[0][0], cell]
        point: list[tuple[int, Form]] = []
        for k, (other, _) in enumerate(template.points[0]):
            total = Form(Fraction(0), ())
            for e, x in replaced:
                total = total.plus(self.nodes[e, cell].points[0][k][1], x)
            point.append((other, total))
        node = template._replace(points=(tuple(point),))
        known = next(
            (call.evaluation for call in calls if isinstance(call, Call) and call[1:] == ((cell,), node)), None
        )
        if known is None:
            known, self.next = self.next, self.next + 1
            calls.append(Call(known, (cell,), node))
        kept = {e: x for e, x in form.terms if (e, cell) not in inner}
        return Form.of(form.start, kept | {known: Fraction(1)})

    def _carried(self) -> dict[Key, Key]:
        """Pairs of slopes of the same piece, one at y, the other at the end of the step."""
        ends: dict[tuple[int, Node], int] = {}
        for (e, cell), node in self._calls():
            ends.setdefault((cell, node), e)
        found: dict[Key, Key] = {}
        for (e, cell), node in self._calls():
            if node.kind == "field" and all(form.is_start for point in node.points for _, form in point):
                moved = node._replace(points=(_moved(node.points[0], self.result),))
                other = ends.get((cell, moved))
                if other is not None and other != e:
                    found[e, cell] = other, cell
        return found

    def _calls(self) -> Iterable[tuple[Key, Node]]:
        for work in self.work:
            if isinstance(work, Call):
                for cell in work.cells:
                    yield (work.evaluation, cell), work.node


def _staggered(found: Plan) -> Plan:
    """The plan with its steps beginning after the first kick, where that is possible."""
    result = dict(found.result)
    staggered: dict[int, tuple[tuple[int, Fraction], ...]] = {}
    work = list(found.work)
    for (first, cell), (last, _) in found.carried.items():
        calls = [item for item in work if not (isinstance(item, Call) and (item.evaluation, cell) == (first, cell))]
        forms = [form for item in calls for form in _forms(item, cell)] + [result[cell]]
        factors = {dict(form.terms).get(first) for form in forms}
        factor = next(iter(factors))
        if len(factors) > 1 or factor is None or any(form.start != 1 for form in forms):
            continue
        kick = Form(Fraction(0), ((first, factor),))
        work = [_without(item, cell, kick) for item in work]
        result[cell] = result[cell].plus(kick, Fraction(-1)).plus(Form(Fraction(0), ((last, factor),)))
        staggered[cell] = (*staggered.get(cell, ()), (first, factor))
    return Plan(tuple(work), result, found.carried, staggered)


def _forms(work: Call | Group, cell: int) -> list[Form]:
    calls = work.calls if isinstance(work, Group) else (work,)
    return [form for call in calls for point in call.node.points for c, form in point if c == cell]


def _without(work: Call | Group, cell: int, kick: Form) -> Call | Group:
    """The work with the state after a kick in place of y in a cell."""
    if isinstance(work, Group):
        return work._replace(calls=tuple(_without(call, cell, kick) for call in work.calls))
    points = tuple(
        tuple((c, form.plus(kick, Fraction(-1)) if c == cell else form) for c, form in point)
        for point in work.node.points
    )
    return work._replace(node=work.node._replace(points=points))


def _ordered(needs: Mapping[Key, Iterable[Key]]) -> list[Key]:
    """Slopes after those that they need, and otherwise in ascending order.

    Raises:
        CycleError: Some need one another, or themselves.
    """
    sorter = TopologicalSorter(needs)
    sorter.prepare()
    waiting, found = list(sorter.get_ready()), []
    heapify(waiting)
    while waiting:
        found.append(heappop(waiting))
        sorter.done(found[-1])
        for key in sorter.get_ready():
            heappush(waiting, key)
    return found


def _strong_components(needs: Mapping[Key, Iterable[Key]]) -> list[list[Key]]:
    """Sets of slopes that need one another, after those that they need."""
    import networkx as nx  # takes longer to import than an explicit method takes to plan

    graph = nx.DiGraph()
    graph.add_nodes_from(needs)
    graph.add_edges_from((other, key) for key, others in needs.items() for other in others)
    condensed = nx.condensation(graph)
    members = {c: sorted(condensed.nodes[c]["members"]) for c in condensed}
    return [members[c] for c in nx.lexicographical_topological_sort(condensed, key=members.__getitem__)]


def _moved(point: Point, result: Mapping[int, Form]) -> Point:
    """The point with the end of the step in place of its start."""
    return tuple((cell, result[cell]) for cell, _ in point)


def _written(work: Call | Group) -> Iterable[Key]:
    calls = work.calls if isinstance(work, Group) else (work,)
    return ((call.evaluation, cell) for call in calls for cell in call.cells)


def _merged(work: Sequence, *, old: Iterable[Key] = (), apart: Iterable[Key] = ()) -> list:
    """The work with neighbouring calls of one evaluation and piece made together; what they share is computed once.

    Args:
        work: Calls and groups.
        old: Slopes whose values before the sweep are read, so that they may be read and written at once.
        apart: Slopes that stay by themselves.
    """
    merged: list = []
    for item in work:
        last = merged[-1] if merged else None
        if isinstance(item, Call) and isinstance(last, Call) and _fit(last, item, set(old), set(apart)):
            node = last.node._replace(points=tuple(map(_united, last.node.points, item.node.points)))
            merged[-1] = Call(last.evaluation, tuple(sorted({*last.cells, *item.cells})), node)
        else:
            merged.append(item)
    return merged


def _fit(one: Call, other: Call, old: set[Key], apart: set[Key]) -> bool:
    """Whether two calls can be made at once: equal forms where both read a cell, and no slope of one in the other."""
    written = {*_written(one), *_written(other)}
    return (
        one.evaluation == other.evaluation
        and one.node._replace(points=()) == other.node._replace(points=())
        and not other.node.reads & written - old
        and not apart & written
        and all(
            dict(mine).get(cell, form) == form
            for mine, theirs in zip(one.node.points, other.node.points, strict=True)
            for cell, form in theirs
        )
    )


def _united(one: Point, other: Point) -> Point:
    return tuple(sorted({**dict(one), **dict(other)}.items()))


def allocate(
    reads: Sequence[Collection[int]],
    writes: Sequence[Collection[int]],
    kept: Iterable[int],
    joined: Mapping[int, int],
) -> dict[int, int]:
    """A register for each slope.

    Args:
        reads: The slopes that each piece of work reads before it writes any.
        writes: The slopes that it writes.
        kept: Slopes that live from step to step and need a register of their own.
        joined: Slopes at the end of a step, and those at the start that take their place in the next one: they get the
            same register if the one is no longer read when the other is written.

    Returns:
        The number of the register of each slope.

    Example:
        Three slopes, each read by the work that computes the next one:

        >>> allocate([[], [0], [1], [2]], [[0], [1], [2], []], [], {})
        {0: 0, 1: 0, 2: 0}
    """
    last = {e: position for position, used in enumerate(reads) for e in used}
    first = {e: position for position, written in reversed(list(enumerate(writes))) for e in written}
    register: dict[int, int] = {}
    for e in kept:
        register.setdefault(e, len(register))
    for end, start in joined.items():
        if end not in register and last.get(start, 0) <= first[end]:
            register[end] = register[start]
    count, free = len(set(register.values())), []
    for position, written in enumerate(writes):
        free += [register[e] for e in register if last.get(e) == position and e not in kept and e not in joined]
        for e in sorted(written):
            if e not in register:
                if free:
                    register[e] = free.pop()
                else:
                    register[e], count = count, count + 1
    return register
