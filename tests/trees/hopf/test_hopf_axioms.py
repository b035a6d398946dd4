from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from itertools import product
from math import prod
from typing import Any

import pytest
from tree_oracles import grown

import bseries as bs
from trees import (
    Forest,
    FormalSum,
    Tree,
    TreeError,
    antipode,
    coproduct,
    counit,
    grossman_larson,
    grossman_larson_antipode,
    grossman_larson_coproduct,
    substitution_antipode,
    substitution_coproduct,
    substitution_counit,
)

SIZES = [(6, 1), (5, 2)]
NONE = Forest()


def trees_to(order: int, colors: int = 1) -> list[Tree]:
    return [tree for n in range(1, order + 1) for tree in grown(n, colors)]


def forests_to(order: int, colors: int = 1) -> list[Forest]:
    """All forests of at most so many nodes, the empty one included."""
    return [Forest(tree.children) for tree in trees_to(order + 1, colors) if tree.color == 0]


def assembled(nodes: list[int], edges: dict[int, int], colors: tuple[int, ...]) -> Tree:
    """The tree of these nodes, ascending from the root, with edges[child] = parent."""
    children: dict[int, list[Tree]] = {node: [] for node in nodes}
    for node in reversed(nodes):
        tree = Tree.join(children[node], colors[node])
        if node in edges:
            children[edges[node]].append(tree)
    return Tree.join(children[nodes[0]], colors[nodes[0]])


def enumerated(tree: Tree) -> tuple[Counter[Any], Counter[Any], Counter[Any]]:
    """Cuts, partitions, and signed forests of parts, by deleting every set of edges, one by one."""
    levels, colors = tree.levels, tree.colors
    edges = {k: max(i for i in range(k) if levels[i] == levels[k] - 1) for k in range(1, len(levels))}
    cuts: Counter[Any] = Counter({(Forest(tree), NONE): 1})
    partitions: Counter[Any] = Counter()
    signed: Counter[Any] = Counter()
    for deleted in product([False, True], repeat=len(edges)):
        roots = [0] + [k for k in edges if deleted[k - 1]]
        root_of = {0: 0}
        for k, parent in edges.items():
            root_of[k] = k if k in roots else root_of[parent]
        kept = {k: parent for k, parent in edges.items() if k not in roots}
        parts = {root: assembled([k for k in root_of if root_of[k] == root], kept, colors) for root in roots}
        skeleton = assembled(roots, {k: root_of[edges[k]] for k in roots if k}, colors)
        partitions[Forest(parts.values()), Forest(skeleton)] += 1
        signed[Forest(parts.values())] += (-1) ** len(parts)
        if skeleton.height <= 1:  # no two of the deleted edges lie on one path
            cuts[Forest(parts[root] for root in roots if root), Forest(parts[0])] += 1
    return cuts, partitions, signed


@pytest.mark.parametrize(("order", "colors"), [(7, 1), (4, 2), (3, 3)])
def test_coproducts_and_antipode_are_the_sums_over_all_sets_of_edges(order: int, colors: int) -> None:
    for tree in trees_to(order, colors):
        cuts, partitions, signed = enumerated(tree)
        assert dict(coproduct(tree).items()) == cuts
        assert dict(substitution_coproduct(tree).items()) == partitions
        assert dict(antipode(tree).items()) == signed


def left(delta: FormalSum, rule: Callable[[Forest], Any]) -> FormalSum:
    """(rule⊗id) of a sum of tensor products of two forests."""
    return delta.map(lambda pair: FormalSum(rule(pair[0])).tensor(pair[1]))


def right(delta: FormalSum, rule: Callable[[Forest], Any]) -> FormalSum:
    """(id⊗rule)."""
    return delta.map(lambda pair: FormalSum(pair[0]).tensor(rule(pair[1])))


def convolution(first: Callable, second: Callable, delta: FormalSum, multiply: Callable | None = None) -> FormalSum:
    """m (first⊗second) of a coproduct."""
    return delta.map(
        lambda pair: (multiply or FormalSum.__mul__)(FormalSum(first(pair[0])), FormalSum(second(pair[1])))
    )


def identity(forest: Forest) -> Forest:
    return forest


def reduced(x: Any) -> FormalSum:
    """Single nodes set to the unit."""
    return FormalSum(x).map(lambda forest: Forest(tree for tree in forest if tree.order > 1))


COPRODUCTS = [
    pytest.param(coproduct, counit, id="Connes-Kreimer"),
    pytest.param(substitution_coproduct, substitution_counit, id="substitution"),
    pytest.param(grossman_larson_coproduct, counit, id="Grossman-Larson"),
]


@pytest.mark.parametrize(("delta", "unit"), COPRODUCTS)
@pytest.mark.parametrize(("order", "colors"), SIZES)
def test_coproducts_are_coassociative_with_counit(delta, unit, order: int, colors: int) -> None:
    for x in [*map(Forest, trees_to(order, colors)), *forests_to(order - 2, colors)]:
        once = delta(x)
        assert left(once, delta) == right(once, delta), x
        assert left(once, lambda y: unit(y) * FormalSum(NONE)) == FormalSum((NONE, x))
        assert right(once, lambda y: unit(y) * FormalSum(NONE)) == FormalSum((x, NONE))


@pytest.mark.parametrize(("delta", "unit"), COPRODUCTS)
@pytest.mark.parametrize(("order", "colors"), SIZES)
def test_coproducts_respect_products(delta, unit, order: int, colors: int) -> None:
    for x, y in product(forests_to(order - 1, colors), repeat=2):
        if x.order + y.order <= order - 1:
            assert delta(x * y) == delta(x) * delta(y)
            assert unit(x * y) == unit(x) * unit(y)


def without_multiplicities(delta: Callable[[Any], FormalSum]) -> Callable[[Any], FormalSum]:
    """The morphism that counts equal terms of the coproduct of a tree once."""

    def wrong(x: Any) -> FormalSum:
        return prod((FormalSum(dict.fromkeys(delta(tree), 1)) for tree in Forest(x)), start=FormalSum((NONE, NONE)))

    return wrong


@pytest.mark.parametrize("delta", [coproduct, substitution_coproduct])
def test_without_multiplicities_coproducts_are_not_coassociative(delta) -> None:
    wrong = without_multiplicities(delta)
    assert any(left(wrong(x), wrong) != right(wrong(x), wrong) for x in map(Forest, trees_to(4)))


@pytest.mark.parametrize(("order", "colors"), SIZES)
def test_connes_kreimer_antipode_from_both_sides(order: int, colors: int) -> None:
    for x in [*map(Forest, trees_to(order, colors)), *forests_to(order - 2, colors)]:
        expected = counit(x) * FormalSum(NONE)
        assert convolution(antipode, identity, coproduct(x)) == expected
        assert convolution(identity, antipode, coproduct(x)) == expected
        assert antipode(antipode(x)) == FormalSum(x)  # as in every commutative Hopf algebra


@pytest.mark.parametrize(("order", "colors"), SIZES)
def test_substitution_antipode_from_both_sides(order: int, colors: int) -> None:
    for x in map(Forest, trees_to(order, colors)):
        delta = substitution_coproduct(x)
        expected = substitution_counit(x) * FormalSum(NONE)
        assert reduced(convolution(substitution_antipode, identity, delta)) == expected
        assert reduced(convolution(identity, substitution_antipode, delta)) == expected
        assert substitution_antipode(substitution_antipode(x)) == reduced(x)


@pytest.mark.parametrize(("order", "colors"), [(6, 1), (4, 2)])
def test_grossman_larson_antipode_from_both_sides(order: int, colors: int) -> None:
    for x in forests_to(order, colors):
        delta, expected = grossman_larson_coproduct(x), counit(x) * FormalSum(NONE)
        assert convolution(grossman_larson_antipode, identity, delta, grossman_larson) == expected
        assert convolution(identity, grossman_larson_antipode, delta, grossman_larson) == expected
        ways = grossman_larson_antipode(x).evaluate(lambda tree: 1)
        assert not x or ways == (-1) ** len(x) * (x.order + 1) ** (len(x) - 1)


@pytest.mark.parametrize(("order", "colors"), [(6, 1), (4, 2)])
def test_grossman_larson_product_and_coproduct_make_a_bialgebra(order: int, colors: int) -> None:
    for x, y in product(forests_to(order, colors), repeat=2):
        if x.order + y.order <= order:
            expected = grossman_larson_coproduct(x).map(
                lambda first, y=y: grossman_larson_coproduct(y).map(
                    lambda second, first=first: grossman_larson(first[0], second[0]).tensor(
                        grossman_larson(first[1], second[1])
                    )
                )
            )
            assert grossman_larson_coproduct(grossman_larson(x, y)) == expected


def test_wrong_signs_make_no_antipode() -> None:
    def wrong(x: Forest) -> FormalSum:
        return FormalSum({y: abs(count) for y, count in antipode(x).items()})

    assert convolution(wrong, identity, coproduct("[τ]"))
    assert convolution(antipode, antipode, coproduct("[τ]"))


@pytest.mark.parametrize(("order", "colors"), [(6, 1), (3, 2)])
def test_grossman_larson_is_dual_to_connes_kreimer(order: int, colors: int) -> None:
    """⟨x ∗ y, z⟩ = ⟨x⊗y, Δz⟩ with ⟨φ, φ⟩ = σ(φ), and so for the antipodes."""
    swapped = unweighted = 0
    for z in forests_to(order, colors):
        delta, inverse = coproduct(z), antipode(z)
        for x, y in product(forests_to(order, colors), repeat=2):
            if x.order + y.order == z.order:
                value = grossman_larson(x, y)[z] * z.symmetry
                assert value == delta[x, y] * x.symmetry * y.symmetry
                swapped += value != delta[y, x] * x.symmetry * y.symmetry
                unweighted += grossman_larson(x, y)[z] != delta[x, y]
        for x in forests_to(order, colors):
            if x.order == z.order:
                assert grossman_larson_antipode(x)[z] * z.symmetry == inverse[x] * x.symmetry
    assert swapped > 0
    assert unweighted > 0


def interact(cut: Callable[[Any], FormalSum], contract: Callable[[Any], FormalSum], tree: Tree) -> bool:
    """Whether (id⊗Δ_CK) Δ_CEM = m^{1,3} (Δ_CEM⊗Δ_CEM) Δ_CK on this tree."""

    def both(pair: tuple[Forest, Forest]) -> FormalSum:
        first, second = map(contract, pair)
        return first.tensor(second).map(lambda four: (four[0] * four[2], four[1], four[3]))

    return right(contract(tree), cut) == cut(tree).map(both)


@pytest.mark.parametrize(("order", "colors"), [(5, 1), (4, 2)])
def test_substitution_acts_on_composition(order: int, colors: int) -> None:
    """Calaque, Ebrahimi-Fard, Manchon (2011), theorem 8."""
    assert all(interact(coproduct, substitution_coproduct, tree) for tree in trees_to(order, colors))


@pytest.mark.parametrize(
    ("cut", "contract"),
    [
        pytest.param(without_multiplicities(coproduct), substitution_coproduct, id="cuts counted once"),
        pytest.param(coproduct, without_multiplicities(substitution_coproduct), id="partitions counted once"),
        pytest.param(coproduct, lambda x: substitution_coproduct(x).map(lambda pair: pair[::-1]), id="sides swapped"),
    ],
)
def test_wrong_coproducts_do_not_interact(cut, contract) -> None:
    assert not all(interact(cut, contract, tree) for tree in trees_to(4))


# Derived by hand from the definitions; to order 3 printed by Connes and Kreimer (1998) and by Calaque et al. (2011).
TABLES = {
    coproduct: {
        "τ": {("∅", "τ"): 1, ("τ", "∅"): 1},
        "[[τ]]": {("∅", "[[τ]]"): 1, ("τ", "[τ]"): 1, ("[τ]", "τ"): 1, ("[[τ]]", "∅"): 1},
        "[τ,τ]": {("∅", "[τ,τ]"): 1, ("τ", "[τ]"): 2, ("τ^2", "τ"): 1, ("[τ,τ]", "∅"): 1},
        "[τ,[τ]]": {
            ("∅", "[τ,[τ]]"): 1,
            ("τ", "[τ,τ]"): 1,
            ("τ", "[[τ]]"): 1,
            ("[τ]", "[τ]"): 1,
            ("τ^2", "[τ]"): 1,
            ("τ·[τ]", "τ"): 1,
            ("[τ,[τ]]", "∅"): 1,
        },
        "[[τ,τ]]": {
            ("∅", "[[τ,τ]]"): 1,
            ("τ", "[[τ]]"): 2,
            ("τ^2", "[τ]"): 1,
            ("[τ,τ]", "τ"): 1,
            ("[[τ,τ]]", "∅"): 1,
        },
        "p[q,q]": {("∅", "p[q,q]"): 1, ("q", "p[q]"): 2, ("q^2", "p"): 1, ("p[q,q]", "∅"): 1},
    },
    antipode: {
        "τ": {"τ": -1},
        "[τ]": {"[τ]": -1, "τ^2": 1},
        "[τ,τ]": {"[τ,τ]": -1, "τ·[τ]": 2, "τ^3": -1},
        "[[τ]]": {"[[τ]]": -1, "τ·[τ]": 2, "τ^3": -1},
        "[τ,τ,τ]": {"[τ,τ,τ]": -1, "τ·[τ,τ]": 3, "τ^2·[τ]": -3, "τ^4": 1},
        "[τ,[τ]]": {"[τ,[τ]]": -1, "τ·[τ,τ]": 1, "τ·[[τ]]": 1, "[τ]^2": 1, "τ^2·[τ]": -3, "τ^4": 1},
        "[[τ,τ]]": {"[[τ,τ]]": -1, "τ·[τ,τ]": 1, "τ·[[τ]]": 2, "τ^2·[τ]": -3, "τ^4": 1},
        "[[[τ]]]": {"[[[τ]]]": -1, "τ·[[τ]]": 2, "[τ]^2": 1, "τ^2·[τ]": -3, "τ^4": 1},
        "p[q]": {"p[q]": -1, "p·q": 1},
    },
    substitution_coproduct: {
        "τ": {("τ", "τ"): 1},
        "[τ]": {("τ^2", "[τ]"): 1, ("[τ]", "τ"): 1},
        "[τ,τ,τ]": {("τ^4", "[τ,τ,τ]"): 1, ("τ^2·[τ]", "[τ,τ]"): 3, ("τ·[τ,τ]", "[τ]"): 3, ("[τ,τ,τ]", "τ"): 1},
        "[[[τ]]]": {
            ("τ^4", "[[[τ]]]"): 1,
            ("τ^2·[τ]", "[[τ]]"): 3,
            ("[τ]^2", "[τ]"): 1,
            ("τ·[[τ]]", "[τ]"): 2,
            ("[[[τ]]]", "τ"): 1,
        },
        "p[q[p]]": {("p^2·q", "p[q[p]]"): 1, ("p·p[q]", "p[p]"): 1, ("p·q[p]", "p[q]"): 1, ("p[q[p]]", "p"): 1},
    },
    substitution_antipode: {
        "τ": {"∅": 1},
        "[τ]": {"[τ]": -1},
        "[τ,τ]": {"[τ,τ]": -1, "[τ]^2": 2},
        "[[τ]]": {"[[τ]]": -1, "[τ]^2": 2},
        "[τ,τ,τ]": {"[τ,τ,τ]": -1, "[τ]·[τ,τ]": 6, "[τ]^3": -6},
        "[[[τ]]]": {"[[[τ]]]": -1, "[τ]·[[τ]]": 5, "[τ]^3": -5},
        "p[q[p]]": {"p[q[p]]": -1, "p[q]·p[p]": 1, "q[p]·p[q]": 1},
    },
    grossman_larson_coproduct: {"τ·[τ]": {("∅", "τ·[τ]"): 1, ("τ", "[τ]"): 1, ("[τ]", "τ"): 1, ("τ·[τ]", "∅"): 1}},
    grossman_larson_antipode: {"τ^2": {"τ^2": 1, "[τ]": 2}, "p·q": {"p·q": 1, "p[q]": 1, "q[p]": 1}},
}


@pytest.mark.parametrize(
    ("operation", "text"), [pytest.param(f, text, id=f"{f.__name__} {text}") for f in TABLES for text in TABLES[f]]
)
def test_tables(operation, text: str) -> None:
    assert operation(text) == operation(Forest(text)) == FormalSum(TABLES[operation][text])


def test_operations_are_linear() -> None:
    x = FormalSum({"[τ]": 2, "τ^2": Fraction(1, 3)})
    for operation in TABLES:
        assert operation(x) == 2 * operation("[τ]") + operation("τ^2") / 3
    assert (counit(x + 5 * FormalSum(NONE)), substitution_counit(x)) == (5, Fraction(1, 3))


def test_numbers_of_splittings_and_partitions() -> None:
    """Chartier, Hairer, Vilmart (2010): this tree has 271 splittings; a tree with n nodes has 2^(n−1) partitions."""
    tree = Tree.from_levels([level - 1 for level in (1, 2, 3, 4, 4, 2, 3, 3, 2, 3, 2, 3)])
    assert coproduct(tree).evaluate(lambda branch: 1, lambda trunk: 1) == 271
    assert substitution_coproduct(tree).evaluate(lambda part: 1, lambda skeleton: 1) == 2**11
    assert antipode(tree).evaluate(lambda part: -1) == 2**11


def random_series(order: int, colors: int, seed: int, empty: int) -> bs.BSeries:
    """Coefficients without pattern, the same in every run, 1 for single nodes of a field."""
    values = {
        tree: Fraction(1)
        if tree.order == 1 and not empty
        else Fraction((7 * k + seed) % 11 - 5, 1 + (3 * k + seed) % 4)
        for k, tree in enumerate(trees_to(order, colors))
    }
    return bs.BSeries.from_rule(values.__getitem__, order, empty=empty, colors=colors)


@pytest.mark.parametrize(("order", "colors"), [(6, 1), (4, 2), (3, 3)])
def test_connes_kreimer_coproduct_composes_and_antipode_inverts(order: int, colors: int) -> None:
    a, c = random_series(order, colors, 1, 1), random_series(order, colors, 2, 1)
    composed, opposite, inverse = bs.compose(a, c), bs.compose(c, a), a.inverse()
    for tree in a:
        assert coproduct(tree).evaluate(a.__getitem__, c.__getitem__) == composed[tree]
        assert antipode(tree).evaluate(a.__getitem__) == inverse[tree]
    assert any(opposite[tree] != composed[tree] for tree in a)


@pytest.mark.parametrize(("order", "colors"), [(6, 1), (4, 2), (3, 3)])
def test_substitution_coproduct_and_antipode_give_exp_and_log(order: int, colors: int) -> None:
    """b ★ (exact flow) = exp b, and so, for a(τ) = 1 at single nodes, a ★ (log of the flow 1 + f) = log a."""
    b, flow = random_series(order, colors, 3, 0), bs.exact_flow(order, colors=colors)
    exponential, logarithm = b.exp(), b.with_empty(1).log()
    for tree in b:
        delta = substitution_coproduct(tree)
        assert delta.evaluate(b.__getitem__, flow.__getitem__) == exponential[tree]
        assert delta.evaluate(b.__getitem__, omega) == logarithm[tree]
    assert any(
        substitution_coproduct(tree).evaluate(flow.__getitem__, b.__getitem__) != exponential[tree] for tree in b
    )


def omega(tree: Tree) -> Fraction:
    """The modified equation of the explicit Euler method: the inverse of 1/γ under substitution."""
    return substitution_antipode(tree).evaluate(lambda part: Fraction(1, part.density))


def test_modified_equation_of_the_explicit_euler_method() -> None:
    """Calaque, Ebrahimi-Fard, Manchon (2011): ω = 1, −1/2, 1/6, 1/3, 0, −1/12, −1/6, −1/4."""
    texts = ["τ", "[τ]", "[τ,τ]", "[[τ]]", "[τ,τ,τ]", "[τ,[τ]]", "[[τ,τ]]", "[[[τ]]]"]
    assert [str(omega(Tree(text))) for text in texts] == ["1", "-1/2", "1/6", "1/3", "0", "-1/12", "-1/6", "-1/4"]
    modified = bs.modified_equation(bs.method("explicit-euler"), 7)
    assert all(modified[tree] == omega(tree) for tree in modified)


def test_coloured_skeletons_take_the_colour_of_the_root_of_each_part() -> None:
    assert substitution_coproduct("p[q]")["p[q]", "p"] == 1
    assert substitution_coproduct("p[q]")["p[q]", "q"] == 0


def test_large_trees_are_served() -> None:
    chain, star = Tree.from_levels(range(200)), Tree("[τ^100]")
    assert len(coproduct(chain)) == 201
    assert coproduct(star)["τ^50", "[τ^50]"] == -antipode(star)["τ^50·[τ^50]"]
    assert len(substitution_coproduct(star)) == 101
    assert len(antipode(Tree.from_levels(range(20)))) == 627  # the partitions of 20


@pytest.mark.parametrize(
    ("operation", "x"),
    [
        (coproduct, Forest("[τ,[τ],[τ,[τ]],[[[τ]]],[[τ],[τ,τ]],[[τ,[τ]]]]")),
        (coproduct, Forest(Tree.from_levels(range(5000)))),
        (coproduct, Forest("τ^5000")),
        (antipode, Forest("[τ,[τ],[τ,[τ]],[[[τ]]],[[τ],[τ,τ]]]")),
        (substitution_coproduct, Forest("[τ,[τ],[τ,[τ]],[[[τ]]],[[τ],[τ,τ]]]")),
        (substitution_antipode, Forest("[τ,[τ],[τ,[τ]],[[[τ]]],[[τ],[τ,τ]]]")),
        (grossman_larson_coproduct, Forest(grown(7)[:12])),
        (grossman_larson_antipode, Forest("τ^20")),
    ],
)
def test_work_that_would_seem_to_hang_is_refused(operation, x: Forest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trees.hopf.sums.MOST_PRODUCTS", 1000)
    with pytest.raises(TreeError, match="order must be smaller: this takes more than 1000 products of terms"):
        operation(x)


def test_the_antipode_of_a_very_large_tree_is_refused() -> None:
    with pytest.raises(TreeError, match="x must have trees of at most 60 nodes, but has one of 61"):
        substitution_antipode("[τ^60]")


def test_wrong_operands_are_refused() -> None:
    for operation in (*TABLES, counit, substitution_counit):
        with pytest.raises(TreeError, match="x must be a tree, a forest or a sum of forests, but was 3"):
            operation(3)  # pyright: ignore[reportArgumentType]
        with pytest.raises(TreeError, match="x must be a tree, a forest or a sum of forests, but was τ⊗τ"):
            operation(FormalSum(("τ", "τ")))
