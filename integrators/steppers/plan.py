"""Planning of a step: explicit calls, implicit groups, and stage derivatives that the next step reuses.

- Nyström form: in an implicit group, blocks that enter linearly (q' = M⁻¹ p) are substituted into the points of the
  others, which halves the unknowns.
- First same as last: a stage derivative at the end of a step is kept if the next step needs it at its start.
- Merged kicks: if each step begins with an update by such a stage derivative, as in kick–drift–kick, steps run from
  the state y + h x k after the first kick to the same state of the next step, so that two kicks become one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter
from heapq import heapify, heappop, heappush

from integrators.steppers.nodes import Nodes
from integrators.steppers.step_model import Call, Form, Group, Key, Node, Plan, Point


def plan(nodes: Nodes, *, stagger: bool = True) -> Plan:
    """Plan a step.

    Kicks of successive steps may be merged (`stagger`) if steps are of equal size.
    """
    found = _Planner(nodes).plan()
    return _numbered(_staggered(found) if stagger else found, nodes)


class _Planner:
    def __init__(self, nodes: Nodes):
        self.structure = nodes.structure
        self.nodes, self.result = dict(nodes.nodes), dict(nodes.result)
        self.next = 1 + max((e for e, _ in self.nodes), default=0)
        self.work: list[Call | Group] = []

    def plan(self) -> Plan:
        for component in self._components():
            if len(component) == 1 and component[0] not in self.nodes[component[0]].reads:
                e, block = component[0]
                self.work.append(Call(e, (block,), self.nodes[component[0]]))
            else:
                self._add_group(component)
        reused = self._reused()
        apart = {*reused, *reused.values()}
        return Plan(tuple(_merged(self.work, apart=apart)), self.result, reused, {}, {})

    def _components(self) -> list[list[Key]]:
        """Strongly connected components of the stage derivatives, in order of computation."""
        needs = {key: node.reads & self.nodes.keys() for key, node in self.nodes.items()}
        try:
            return [[key] for key in _topological_order(needs)]
        except CycleError:
            return _strong_components(needs)

    def _add_group(self, keys: Sequence[Key]) -> None:
        """Add an implicit group, with linear blocks substituted into the points of the others."""
        linear = self._linear_blocks(keys)
        inner = {key for key in keys if key[1] in linear}
        calls: list[Call] = []
        unknowns = [key for key in keys if key not in inner]
        for e, block in unknowns:
            node = self._substituted_node(self.nodes[e, block], inner, calls)
            self.nodes[e, block] = node
            calls.append(Call(e, (block,), node))
        self.work.append(Group(tuple(_merged(calls, old=set(unknowns))), tuple(unknowns)))
        self._substitute_later(keys, inner)

    def _linear_blocks(self, keys: Sequence[Key]) -> set[int]:
        """Blocks of a group that depend linearly on blocks that stay unknown."""
        blocks = {block for _, block in keys}
        found: set[int] = set()
        for block in sorted(blocks, reverse=True):
            own = [self.nodes[key] for key in keys if key[1] == block]
            dependences = [self.structure.dependence(node.piece, block) for node in own]
            needed = frozenset[int]().union(*(dependence.blocks for dependence in dependences))
            if (
                all(node.kind == "field" for node in own)
                and all(dependence.is_linear for dependence in dependences)
                and needed.isdisjoint({*found, block})
                and len({node.piece for node in own}) == 1
                and not any(
                    block in self.structure.dependence(self.nodes[e, c].piece, c).blocks for e, c in keys if c in found
                )
                and len(found) + 1 < len(blocks)
            ):
                found.add(block)
        return found

    def _substitute_later(self, keys: Sequence[Key], inner: set[Key]) -> None:
        """Substitute linear stage derivatives into later work; one that is alone in its block is computed instead."""
        single = sorted(key for key in inner if sum(block == key[1] for _, block in inner) == 1)
        self.work += [Call(e, (block,), self.nodes[e, block]) for e, block in single]
        inner = inner.difference(single)
        if not inner:
            return
        done = {*keys, *(key for work in self.work for key in _written(work))}
        for key, node in list(self.nodes.items()):
            if key not in done and node.reads & inner:
                self.nodes[key] = self._substituted_node(node, inner, self.work)
        self.result = {block: self._substituted(form, block, inner, self.work) for block, form in self.result.items()}

    def _substituted_node(self, node: Node, inner: set[Key], calls: list[Call | Group] | list[Call]) -> Node:
        points = tuple(
            tuple((block, self._substituted(form, block, inner, calls)) for block, form in point)
            for point in node.points
        )
        return node._replace(points=points)

    def _substituted(self, form: Form, block: int, inner: set[Key], calls: list) -> Form:
        """The form with Σ x_e k_e = V(Σ x_e · point of k_e) in place of the linear stage derivatives k_e."""
        replaced = [(e, x) for e, x in form.terms if (e, block) in inner]
        if not replaced:
            return form
        template = self.nodes[replaced[0][0], block]
        point: list[tuple[int, Form]] = []
        for k, (other, _) in enumerate(template.points[0]):
            total = Form(Fraction(0), ())
            for e, x in replaced:
                total = total.plus(self.nodes[e, block].points[0][k][1], x)
            point.append((other, total))
        node = template._replace(points=(tuple(point),))
        known = next(
            (call.evaluation for call in calls if isinstance(call, Call) and call[1:] == ((block,), node)), None
        )
        if known is None:
            known, self.next = self.next, self.next + 1
            calls.append(Call(known, (block,), node))
        kept = {e: x for e, x in form.terms if (e, block) not in inner}
        return Form.of(form.start, kept | {known: Fraction(1)})

    def _reused(self) -> dict[Key, Key]:
        """Pairs of equal nodes, one at y and the other at the end of the step."""
        ends: dict[tuple[int, Node], int] = {}
        for (e, block), node in self._calls():
            ends.setdefault((block, node), e)
        found: dict[Key, Key] = {}
        for (e, block), node in self._calls():
            if node.kind == "field" and all(form.is_start for point in node.points for _, form in point):
                moved = node._replace(points=(_at_end(node.points[0], self.result),))
                other = ends.get((block, moved))
                if other is not None and other != e:
                    found[e, block] = other, block
        return found

    def _calls(self) -> Iterable[tuple[Key, Node]]:
        for work in self.work:
            if isinstance(work, Call):
                for block in work.blocks:
                    yield (work.evaluation, block), work.node


def _staggered(found: Plan) -> Plan:
    """Merge the last kick of a step with the first kick of the next, where possible."""
    result = dict(found.result)
    staggered: dict[int, tuple[tuple[int, Fraction], ...]] = {}
    work = list(found.work)
    for (first, block), (last, _) in found.reused.items():
        calls = [item for item in work if not (isinstance(item, Call) and (item.evaluation, block) == (first, block))]
        forms = [form for item in calls for form in _forms(item, block)] + [result[block]]
        factors = {dict(form.terms).get(first) for form in forms}
        factor = next(iter(factors))
        if len(factors) > 1 or factor is None or any(form.start != 1 for form in forms):
            continue
        kick = Form(Fraction(0), ((first, factor),))
        work = [_without(item, block, kick) for item in work]
        result[block] = result[block].plus(kick, Fraction(-1)).plus(Form(Fraction(0), ((last, factor),)))
        staggered[block] = (*staggered.get(block, ()), (first, factor))
    return found._replace(work=tuple(work), result=result, staggered=staggered)


def _numbered(found: Plan, nodes: Nodes) -> Plan:
    """Number evaluations in order of computation, so that methods that come to the same steps have the same source."""
    number: dict[int, int] = {}
    for work in found.work:
        for e, _ in _written(work):
            number.setdefault(e, len(number))

    def terms(old: Iterable[tuple[int, Fraction]]) -> tuple[tuple[int, Fraction], ...]:
        return tuple((number[e], x) for e, x in old)

    def call(old: Call) -> Call:
        points = (tuple((b, Form(f.start, terms(f.terms))) for b, f in point) for point in old.node.points)
        return Call(number[old.evaluation], old.blocks, old.node._replace(points=tuple(points)))

    def group(old: Group) -> Group:
        return Group(tuple(map(call, old.calls)), tuple((number[e], block) for e, block in old.unknowns))

    return Plan(
        tuple(call(work) if isinstance(work, Call) else group(work) for work in found.work),
        {block: Form(form.start, terms(form.terms)) for block, form in found.result.items()},
        {(number[e], block): (number[end], block) for (e, block), (end, _) in found.reused.items()},
        {block: terms(kicks) for block, kicks in found.staggered.items()},
        {number[e]: nodes.abscissa(e) for implicit in found.groups for e, _ in implicit.unknowns},
    )


def _forms(work: Call | Group, block: int) -> list[Form]:
    calls = work.calls if isinstance(work, Group) else (work,)
    return [form for call in calls for point in call.node.points for c, form in point if c == block]


def _without(work: Call | Group, block: int, kick: Form) -> Call | Group:
    """Write the points of one block in terms of the state after a kick."""
    if isinstance(work, Group):
        return work._replace(calls=tuple(_without(call, block, kick) for call in work.calls))
    points = tuple(
        tuple((c, form.plus(kick, Fraction(-1)) if c == block else form) for c, form in point)
        for point in work.node.points
    )
    return work._replace(node=work.node._replace(points=points))


def _topological_order(needs: Mapping[Key, Iterable[Key]]) -> list[Key]:
    """Sort topologically, and otherwise in ascending order."""
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
    """Strongly connected components in topological order."""
    import networkx as nx  # takes longer to import than an explicit method takes to plan

    graph = nx.DiGraph()
    graph.add_nodes_from(needs)
    graph.add_edges_from((other, key) for key, others in needs.items() for other in others)
    condensed = nx.condensation(graph)
    members = {c: sorted(condensed.nodes[c]["members"]) for c in condensed}
    return [members[c] for c in nx.lexicographical_topological_sort(condensed, key=members.__getitem__)]


def _at_end(point: Point, result: Mapping[int, Form]) -> Point:
    """The same point at the end of the step."""
    return tuple((block, result[block]) for block, _ in point)


def _written(work: Call | Group) -> Iterable[Key]:
    calls = work.calls if isinstance(work, Group) else (work,)
    return ((call.evaluation, block) for call in calls for block in call.blocks)


def _merged(work: Sequence, *, old: Iterable[Key] = (), apart: Iterable[Key] = ()) -> list:
    """Merge neighbouring calls of one evaluation and piece, so that common subexpressions are computed once."""
    merged: list = []
    for item in work:
        last = merged[-1] if merged else None
        if isinstance(item, Call) and isinstance(last, Call) and _can_merge(last, item, set(old), set(apart)):
            node = last.node._replace(points=tuple(map(_union, last.node.points, item.node.points)))
            merged[-1] = Call(last.evaluation, tuple(sorted({*last.blocks, *item.blocks})), node)
        else:
            merged.append(item)
    return merged


def _can_merge(one: Call, other: Call, old: set[Key], apart: set[Key]) -> bool:
    """Whether two calls agree in the blocks that both read, and neither reads what the other writes."""
    written = {*_written(one), *_written(other)}
    return (
        one.evaluation == other.evaluation
        and one.node._replace(points=()) == other.node._replace(points=())
        and not other.node.reads & written - old
        and not apart & written
        and all(
            dict(mine).get(block, form) == form
            for mine, theirs in zip(one.node.points, other.node.points, strict=True)
            for block, form in theirs
        )
    )


def _union(one: Point, other: Point) -> Point:
    return tuple(sorted({**dict(one), **dict(other)}.items()))
