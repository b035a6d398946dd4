"""Planning of a step: evaluations by block, explicit calls, implicit groups, and what the next step reuses.

Coefficients become rational numbers within 10^-40 of the exact ones, so that sums are exact and equal points compare
equal. Simplifications that follow from the scene are made first (`Nodes`): the flow of a piece that does not depend on
the variables it moves is a multiple of its field, the derivative of a linear piece is the piece itself, and evaluations
of the same piece at the same point are merged. Then the plan is made:

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

from integrators.core.errors import IntegratorError
from integrators.methods.programs.evaluations import Average, Derivative, Evaluation, Field, Flow, LinearForm, operands
from integrators.methods.programs.program import Method
from integrators.steppers.multistep import MultistepNodes
from integrators.steppers.step_model import DECIMALS, Call, Form, Group, Key, Node, Past, Plan, Point, fraction
from integrators.steppers.structure import Structure


class Nodes:
    """The nodes of a method on a scene, without duplicates, and for each block the end of a step (`result`)."""

    past: Past = ()

    def __init__(self, method: Method, structure: Structure):
        program = method.rational_program(DECIMALS)
        if program.parameters:
            raise IntegratorError(f"parameters must have values before a step, but {program.parameters[0]} had none")
        self.structure = structure
        self._program = program
        self._factors: dict[Key, Fraction] = {}
        self._same: dict[Key, int] = {}
        self._moves: dict[int, frozenset[int]] = {}
        self._right_sides: dict[int, Form] = {}
        self.nodes: dict[Key, Node] = {}
        for e, evaluation in enumerate(program.evaluations):
            for block in sorted(self._moved(e)):
                self.nodes[e, block], self._factors[e, block] = self._node(e, evaluation, block)
        nodes = self._merged()
        end = _rational(program.result)
        self.result = {block: self._scaled(end, block) for block in range(len(structure.blocks))}
        waiting = [(e, block) for block, form in self.result.items() for e, _ in form.terms]
        needed: set[Key] = set()
        while waiting:
            key = waiting.pop()
            if key not in needed:
                needed.add(key)
                waiting += nodes[key].reads
        self.nodes = {key: node for key, node in nodes.items() if key in needed}

    def _merged(self) -> dict[Key, Node]:
        """The nodes, with forms in stage derivatives, after equal ones are merged until none are left."""
        while True:
            first: dict[tuple[int, Node], int] = {}
            before = len(self._same)
            nodes = {key: node.changed(self._scaled) for key, node in self.nodes.items()}
            for (e, block), node in nodes.items():
                if (e, block) not in self._same and (other := first.setdefault((block, node), e)) != e:
                    self._same[e, block] = other
            if len(self._same) == before:
                return {key: node for key, node in nodes.items() if key not in self._same}

    def _scaled(self, form: Form, block: int) -> Form:
        """The form in stage derivatives, with factors of flows multiplied in and merged nodes replaced."""
        total: dict[int, Fraction] = {}
        for e, x in form.terms:
            if (e, block) in self._factors:
                same = e
                while (same, block) in self._same:
                    same = self._same[same, block]
                total[same] = total.get(same, Fraction(0)) + x * self._factors[e, block]
                if e in self._right_sides:
                    for other, y in self._scaled(self._right_sides[e], block).terms:
                        total[other] = total.get(other, Fraction(0)) - x * y
        return Form.of(form.start, total)

    def abscissa(self, e: int) -> Fraction:
        """The abscissa of an evaluation: its point for y' = 1, y(0) = 0 and h = 1."""
        (at, *_) = operands(self._program.evaluations[e])
        for part in range(len(self._program.names)):
            total = sum((fraction(x * self._program.total(other, part)) for other, x in at.terms.items()), Fraction(0))
            if total:
                return total
        return Fraction(0)

    def _piece(self, evaluation: Evaluation) -> int:
        """The piece of an evaluation; of several pieces the last is the whole field."""
        return len(self.structure.pieces) - 1 if evaluation.part is None else evaluation.part

    def _moved(self, e: int) -> frozenset[int]:
        """The blocks in which an evaluation is not zero, those of the forcing of a flow included."""
        if e not in self._moves:
            forced = map(self._moved, sorted(self._program.same_order_registers(e)))
            self._moves[e] = frozenset(self.structure.writes(self._piece(self._program.evaluations[e]))).union(*forced)
        return self._moves[e]

    def _resolvent(self, e: int, piece: int, at: LinearForm, along: LinearForm) -> Node:
        """The node of k = h F′(at) (γ k + Σ x_j k_j), solved for s = k + r = (I − hγ F′)⁻¹ r with r = Σ x_j / γ k_j.

        Where F′ is large, s is small, unlike k and r.

        References:
            E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, formula (IV.7.25).
        """
        terms = dict(_rational(along).terms)
        own = terms.pop(e)
        self._right_sides[e] = right = Form.of(Fraction(0), {other: x / own for other, x in terms.items()})
        dependences = (self.structure.dependence(piece, block) for block in self.structure.writes(piece))
        needed = frozenset[int]().union(*(dependence.blocks for dependence in dependences if not dependence.is_linear))
        every = range(len(self.structure.blocks))
        return Node("resolvent", piece, (_point(at, needed), tuple((block, right) for block in every)), own)

    def _is_linear_system(self, e: int, at: LinearForm, along: LinearForm) -> bool:
        """Whether k = h F′(at) (γ k + …) is linear in k: neither the point nor the other terms depend on k."""
        waiting, seen = [*at.terms, *(other for other in along.terms if other != e)], set[int]()
        while waiting:
            other = waiting.pop()
            if other not in seen:
                seen.add(other)
                waiting += [f for form in operands(self._program.evaluations[other]) for f in form.terms]
        return e in along.terms and e not in seen

    def _node(self, e: int, evaluation: Evaluation, block: int) -> tuple[Node, Fraction]:
        """The node of an evaluation in a block, and the factor of its stage derivative."""
        piece, one = self._piece(evaluation), Fraction(1)
        dependence = self.structure.dependence(piece, block)
        match evaluation:
            case Field(_, at):
                return Node("field", piece, (_point(at, dependence.blocks),)), one
            case Derivative(_, at, along):
                if self._is_linear_system(e, at, along):
                    return self._resolvent(e, piece, at, along), one
                if dependence.is_linear:
                    return Node("field", piece, (_point(along, dependence.blocks),)), one
                return Node("derivative", piece, (_point(at, dependence.blocks), _point(along, dependence.blocks))), one
            case Average(_, path, power):
                if not dependence.blocks:
                    return Node("field", piece, ((),)), one / (power + 1)
                if dependence.is_linear:
                    return Node("field", piece, (_point(_averaged(path, power), dependence.blocks),)), one
                return Node("average", piece, tuple(_point(form, dependence.blocks) for form in path), power), one
            case Flow(_, at, time, forcing):
                duration = fraction(time)
                if not forcing and dependence.blocks.isdisjoint(self.structure.writes(piece)):
                    return Node("field", piece, (_point(at, dependence.blocks),)), duration
                needed = self.structure.reach(piece, block)
                return Node("flow", piece, tuple(_point(form, needed) for form in (at, *forcing)), duration), one
        raise AssertionError(evaluation)


def _point(form: LinearForm, blocks: Iterable[int]) -> Point:
    rational = _rational(form)
    return tuple((block, rational) for block in sorted(blocks))


def _averaged(path: Sequence[LinearForm], power: int) -> LinearForm:
    """∫₀¹ θ^power Σ θ^j path_j dθ."""
    total, *rest = (form.times(Fraction(1, power + 1 + j)) for j, form in enumerate(path))
    return sum(rest, total)


def _rational(form: LinearForm) -> Form:
    return Form.of(fraction(form.start), {e: fraction(x) for e, x in form.terms.items()})


def plan(nodes: Nodes | MultistepNodes, *, stagger: bool = True) -> Plan:
    """Plan a step; kicks of successive steps may be merged (`stagger`) if steps are of equal size."""
    found = _Planner(nodes).plan()
    return _numbered(_staggered(found) if stagger else found, nodes)


class _Planner:
    def __init__(self, nodes: Nodes | MultistepNodes):
        self.structure, self.past = nodes.structure, nodes.past
        self.nodes, self.result = dict(nodes.nodes), dict(nodes.result)
        self.next = 1 + max((e for e, _ in self.nodes), default=0)
        self.work: list[Call | Group] = []

    def plan(self) -> Plan:
        needs = {key: node.reads & self.nodes.keys() for key, node in self.nodes.items()}
        try:
            components = [[key] for key in _topological_order(needs)]
        except CycleError:
            components = _strong_components(needs)
        for component in components:
            if len(component) == 1 and component[0] not in self.nodes[component[0]].reads:
                e, block = component[0]
                self.work.append(Call(e, (block,), self.nodes[component[0]]))
            else:
                self._add_group(component)
        reused = self._reused()
        apart = {*reused, *reused.values()}
        return Plan(tuple(_merged(self.work, apart=apart)), self.result, reused, {}, {}, self.past)

    def _add_group(self, keys: Sequence[Key]) -> None:
        """Add an implicit group, with linear blocks substituted into the points of the others."""
        linear = self._linear_blocks(keys)
        inner = {key for key in keys if key[1] in linear}
        calls: list[Call] = []
        unknowns = [key for key in keys if key not in inner]
        for e, block in unknowns:
            node = self.nodes[e, block].changed(lambda form, block: self._substituted(form, block, inner, calls))
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
        done = {*keys, *(key for work in self.work for key in work.written)}
        for key, node in list(self.nodes.items()):
            if key not in done and node.reads & inner:
                self.nodes[key] = node.changed(lambda form, block: self._substituted(form, block, inner, self.work))
        self.result = {block: self._substituted(form, block, inner, self.work) for block, form in self.result.items()}

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
        known = next((call.evaluation for call in calls if call[1:] == ((block,), node)), None)
        if known is None:
            known, self.next = self.next, self.next + 1
            calls.append(Call(known, (block,), node))
        kept = {e: x for e, x in form.terms if (e, block) not in inner}
        return Form.of(form.start, kept | {known: Fraction(1)})

    def _reused(self) -> dict[Key, Key]:
        """Pairs of equal nodes, one at y and the other at the end of the step."""
        calls = [(*key, work.node) for work in self.work if isinstance(work, Call) for key in work.written]
        ends: dict[tuple[int, Node], int] = {}
        for e, block, node in calls:
            ends.setdefault((block, node), e)
        found: dict[Key, Key] = {}
        for e, block, node in calls:
            if node.kind == "field" and all(form.is_start for point in node.points for _, form in point):
                other = ends.get((block, node.changed(lambda _, c: self.result[c])))
                if other is not None and other != e:
                    found[e, block] = other, block
        return found


def _staggered(found: Plan) -> Plan:
    """Merge the last kick of a step with the first kick of the next, where possible."""
    result = dict(found.result)
    staggered: dict[int, tuple[tuple[int, Fraction], ...]] = {}
    work, minus = list(found.work), Fraction(-1)
    for (first, block), (last, _) in found.reused.items():
        others = [call for item in work for call in item.calls if item is not call or call.evaluation != first]
        points = [point for call in others for point in call.node.points]
        forms = [form for point in points for c, form in point if c == block] + [result[block]]
        factors = {dict(form.terms).get(first) for form in forms}
        factor = next(iter(factors))
        if len(factors) > 1 or factor is None or any(form.start != 1 for form in forms):
            continue
        kick = Form(Fraction(0), ((first, factor),))

        def after_kick(form: Form, c: int, block: int = block, kick: Form = kick) -> Form:
            return form.plus(kick, minus) if c == block else form

        work = [item.changed(after_kick) for item in work]
        result[block] = result[block].plus(kick, minus).plus(Form(Fraction(0), ((last, factor),)))
        staggered[block] = (*staggered.get(block, ()), (first, factor))
    return found._replace(work=tuple(work), result=result, staggered=staggered)


def _numbered(found: Plan, nodes: Nodes | MultistepNodes) -> Plan:
    """Number evaluations in order of computation, so that methods that come to the same steps have the same source."""
    number: dict[int, int] = {}
    for work in found.work:
        for e, _ in work.written:
            number.setdefault(e, len(number))
    for e, _ in found.past:
        number.setdefault(e, len(number))

    def terms(old: Iterable[tuple[int, Fraction]]) -> tuple[tuple[int, Fraction], ...]:
        return tuple((number[e], x) for e, x in old)

    def form(old: Form, _: int) -> Form:
        return Form(old.start, terms(old.terms))

    def renumbered(old: Call | Group) -> Call | Group:
        if isinstance(old, Call):
            return Call(number[old.evaluation], old.blocks, old.node.changed(form))
        calls = [Call(number[call.evaluation], call.blocks, call.node.changed(form)) for call in old.calls]
        return Group(tuple(calls), tuple((number[e], block) for e, block in old.unknowns))

    return Plan(
        tuple(map(renumbered, found.work)),
        {block: form(old, block) for block, old in found.result.items()},
        {(number[e], block): (number[end], block) for (e, block), (end, _) in found.reused.items()},
        {block: terms(kicks) for block, kicks in found.staggered.items()},
        {number[e]: nodes.abscissa(e) for implicit in found.groups for e, _ in implicit.unknowns},
        tuple((number[e], terms(old)) for e, old in found.past),
    )


def _topological_order(needs: Mapping[Key, Iterable[Key]]) -> list[Key]:
    """Sort topologically, and otherwise in ascending order."""
    sorter = TopologicalSorter(needs)
    sorter.prepare()
    waiting: list[Key] = []
    found: list[Key] = []
    while sorter.is_active():
        waiting = sorted([*waiting, *sorter.get_ready()], reverse=True)
        found.append(waiting.pop())
        sorter.done(found[-1])
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


def _merged(work: Sequence, *, old: Iterable[Key] = (), apart: Iterable[Key] = ()) -> list:
    """Merge neighbouring calls of one evaluation and piece, so that common subexpressions are computed once."""
    merged: list = []
    for item in work:
        last = merged[-1] if merged else None
        if isinstance(item, Call) and isinstance(last, Call) and _can_merge(last, item, set(old), set(apart)):
            pairs = zip(last.node.points, item.node.points, strict=True)
            points = tuple(tuple(sorted({**dict(one), **dict(other)}.items())) for one, other in pairs)
            blocks = tuple(sorted({*last.blocks, *item.blocks}))
            merged[-1] = Call(last.evaluation, blocks, last.node._replace(points=points))
        else:
            merged.append(item)
    return merged


def _can_merge(one: Call, other: Call, old: set[Key], apart: set[Key]) -> bool:
    """Whether two calls agree in the blocks that both read, and neither reads what the other writes."""
    written = {*one.written, *other.written}
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
