from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import product
from math import factorial

import pytest
from tree_oracles import grown

import bseries as bs
from trees import Forest, FormalSum, Tree, TreeError, graft, grossman_larson, tree_commutator


def trees_to(order: int, colors: int = 1) -> list[Tree]:
    return [tree for n in range(1, order + 1) for tree in grown(n, colors)]


def forests_to(order: int, colors: int = 1) -> list[Forest]:
    """All forests of at most so many nodes, the empty one included."""
    return [Forest(tree.children) for tree in trees_to(order + 1, colors) if tree.color == 0]


def triples(order: int, colors: int) -> list[tuple[Tree, Tree, Tree]]:
    """All triples of trees with at most so many nodes together."""
    trees = trees_to(order - 2, colors)
    return [(u, v, w) for u, v, w in product(trees, repeat=3) if u.order + v.order + w.order <= order]


def attached(x: Forest, y: Forest, beside: bool) -> Counter[Forest]:
    """All attachments one by one: each tree of x chooses a node of y, numbered in preorder, or none (−1)."""
    root = [(0, -1)]  # of B₊(y): each node's level and colour
    for tree in y:
        root += [(level + 1, node.color) for level, node in tree.preorder()]
    found: Counter[Forest] = Counter()
    for choice in product(range(0 if beside else 1, len(root)), repeat=len(x)):
        levels, colors = [], []
        for node, (level, color) in enumerate(root):
            levels.append(level)
            colors.append(max(color, 0))
            for tree, place in zip(x, choice, strict=True):
                if place == node:
                    levels += [level + 1 + above for above in tree.levels]
                    colors += tree.colors
        found[Forest(Tree.from_levels(levels, colors).children)] += 1
    return found


SIZES = [(6, 1), (4, 2)]


@pytest.mark.parametrize(("order", "colors"), SIZES)
@pytest.mark.parametrize("beside", [True, False])
def test_products_are_the_sums_over_all_attachments(order: int, colors: int, beside: bool) -> None:
    multiply = grossman_larson if beside else graft
    for x, y in product(forests_to(order, colors), repeat=2):
        if x.order + y.order <= order:
            assert dict(multiply(x, y).items()) == dict(attached(x, y, beside)), (x, y)


@pytest.mark.parametrize("text", ["τ^3·[τ]", "[τ]·[τ,τ]·[τ]", "τ^2·[[τ]]·[[τ]]"])
def test_numbers_of_ways_are_powers(text: str) -> None:
    x, y = Forest(text), Forest("[τ,[τ]]·[τ]")
    assert grossman_larson(x, y).evaluate(lambda tree: 1) == 7 ** len(x)
    assert graft(x, y).evaluate(lambda tree: 1) == 6 ** len(x)


def test_grafting_attaches_the_first_to_the_second() -> None:
    assert graft("τ", "[τ,τ]") == FormalSum({"[τ,τ,τ]": 1, "[τ,[τ]]": 2})
    assert graft("[τ,τ]", "τ") == FormalSum("[[τ,τ]]")
    assert graft("q", "p[q]") == FormalSum({"p[q,q]": 1, "p[q[q]]": 1})
    assert graft(2 * FormalSum("τ") - Forest("[τ]"), "τ") == FormalSum({"[τ]": 2, "[[τ]]": -1})
    assert graft("τ^2", "[τ]") == FormalSum({"[τ,τ,τ]": 1, "[τ,[τ]]": 2, "[[τ,τ]]": 1})
    assert graft("∅", "[τ]") == FormalSum("[τ]")
    assert not graft("τ", "∅")


@pytest.mark.parametrize("n", range(1, 9))
def test_repeated_grafting_of_a_node_differentiates_the_flow(n: int) -> None:
    """y^(n) = Σ α(τ) F(τ)(y) (Butcher 2016, section 311), whose sums over α Brouder's identities give."""
    derivative = FormalSum("τ")
    for _ in range(n - 1):
        derivative = graft("τ", derivative)
    assert derivative == FormalSum({tree: tree.alpha for tree in grown(n)})
    assert derivative.evaluate(lambda tree: 1) == factorial(n - 1)
    assert derivative.evaluate(lambda tree: Fraction(1, tree.density)) == Fraction(factorial(n - 1), 2 ** (n - 1))
    assert derivative.evaluate(lambda tree: tree.density) == n ** (n - 1)


def test_hoffmans_products_of_rooted_trees() -> None:
    """Hoffman (2007): chain₂∘cherry = corolla₃ + 2·[τ,[τ]], and cherry∘chain₂ has B₊(cherry) besides."""

    def rooted_product(s: str, t: str) -> FormalSum:
        return grossman_larson(Forest(Tree(s).children), Forest(Tree(t).children)).map(Tree.join)

    assert rooted_product("[τ]", "[τ,τ]") == FormalSum({"[τ,τ,τ]": 1, "[τ,[τ]]": 2})
    assert rooted_product("[τ,τ]", "[τ]") == FormalSum({"[τ,τ,τ]": 1, "[τ,[τ]]": 2, "[[τ,τ]]": 1})


@pytest.mark.parametrize(("order", "colors"), [(8, 1), (5, 2)])
def test_pre_lie_identity(order: int, colors: int) -> None:
    failures = 0
    for u, v, w in triples(order, colors):
        associator = graft(graft(u, v), w) - graft(u, graft(v, w))
        assert associator == graft(graft(v, u), w) - graft(v, graft(u, w)), (u, v, w)
        failures += associator != graft(graft(u, w), v) - graft(u, graft(w, v))  # the identity of the other side
    assert failures > 0


@pytest.mark.parametrize(("order", "colors"), [(8, 1), (5, 2)])
def test_jacobi_identity(order: int, colors: int) -> None:
    bracket = tree_commutator
    nonzero = 0
    for u, v, w in triples(order, colors):
        terms = bracket(u, bracket(v, w)), bracket(v, bracket(w, u)), bracket(w, bracket(u, v))
        assert not sum(terms), (u, v, w)
        assert bracket(u, v) == -bracket(v, u) == graft(u, v) - graft(v, u)
        nonzero += bool(terms[0] + terms[1])
    assert nonzero > 0


def test_brackets_of_pybs() -> None:
    assert not tree_commutator("τ", "τ")
    assert tree_commutator("τ", "[τ]") == FormalSum("[τ,τ]")  # with the other sign there


@pytest.mark.parametrize(("order", "colors"), SIZES)
def test_grossman_larson_product_is_associative_with_unit(order: int, colors: int) -> None:
    forests = forests_to(order, colors)
    different = 0
    for x, y, z in product(forests, repeat=3):
        if x.order + y.order + z.order <= order:
            assert grossman_larson(grossman_larson(x, y), z) == grossman_larson(x, grossman_larson(y, z)), (x, y, z)
    for x in forests:
        assert grossman_larson(x, "∅") == grossman_larson("∅", x) == FormalSum(x)
        different += grossman_larson(x, "τ") != grossman_larson("τ", x)
    assert different > 0


def test_grafting_is_not_associative() -> None:
    assert graft(graft("τ", "τ"), "τ") != graft("τ", graft("τ", "τ"))


def random_series(order: int, colors: int, seed: int, empty: int) -> bs.BSeries:
    """Coefficients without pattern, the same in every run."""
    table = {
        tree: Fraction((7 * k + seed) % 11 - 5, 1 + (3 * k + seed) % 4)
        for k, tree in enumerate(trees_to(order, colors))
    }
    return bs.BSeries.from_rule(table.__getitem__, order, empty=empty, colors=colors)


def weights(series: bs.BSeries) -> FormalSum:
    """A series as the sum of its trees times their weights a(τ)/σ(τ)."""
    return FormalSum({tree: value / tree.symmetry for tree, value in series.items()})


@pytest.mark.parametrize(("order", "colors"), [(5, 1), (3, 2)])
def test_grafting_is_the_lie_derivative_of_series(order: int, colors: int) -> None:
    b, c = random_series(order, colors, 1, 0), random_series(order, colors, 2, 0)
    derivative = bs.algebra.lie_derivative(b, c)
    grafted, swapped = graft(weights(b), weights(c)), graft(weights(c), weights(b))
    bracket = tree_commutator(weights(b), weights(c))
    opposite = bs.algebra.lie_derivative(c, b)
    for tree in b:
        assert grafted[tree] * tree.symmetry == derivative[tree]
        assert bracket[tree] * tree.symmetry == derivative[tree] - opposite[tree]
    assert any(swapped[tree] * tree.symmetry != derivative[tree] for tree in b)
    assert any(grafted[tree] != derivative[tree] for tree in b)


@pytest.mark.parametrize(("order", "colors"), [(4, 1), (3, 2)])
def test_grossman_larson_product_composes_flows(order: int, colors: int) -> None:
    """The pull-back by a map is Σ a(φ)/σ(φ) φ; for a composition, by the second map first, then by the first."""
    a, c = random_series(order, colors, 3, 1), random_series(order, colors, 4, 1)
    forests = forests_to(order, colors)

    def pull_back(series: bs.BSeries) -> FormalSum:
        return FormalSum({x: FormalSum(x).evaluate(series.__getitem__) / Fraction(x.symmetry) for x in forests})

    first, second, composed = pull_back(a), pull_back(c), pull_back(bs.compose(a, c))
    multiplied, swapped = grossman_larson(first, second), grossman_larson(second, first)
    assert all(multiplied[x] == composed[x] for x in forests)
    assert any(swapped[x] != composed[x] for x in forests)


def test_wrong_operands_are_refused() -> None:
    with pytest.raises(TreeError, match="y must be a tree, a forest or a sum of forests, but was 3"):
        graft("τ", 3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(TreeError, match="x must be a tree, a forest or a sum of forests, but was τ⊗τ"):
        grossman_larson(FormalSum(("τ", "τ")), "τ")
    with pytest.raises(TreeError, match=r"text must be one tree .* a bracket that is never closed"):
        tree_commutator("[τ", "τ")


def test_large_trees_are_grafted() -> None:
    tall, star = Tree.from_levels(range(150)), Tree("[τ^1000]")
    assert len(graft("τ", tall)) == 150
    assert graft("τ", star) == FormalSum({Tree("[τ^1001]"): 1, Tree("[τ^999,[τ]]"): 1000})
    with pytest.raises(TreeError, match="at most 10000 nodes together"):
        graft(Tree("[τ^9000]"), Tree("[τ^1000]"))


@pytest.mark.parametrize("y", [Tree.from_levels(range(1000)), Tree("[τ,[τ],[[τ]],[τ,τ]]"), Forest("τ^5000")])
def test_work_that_would_seem_to_hang_is_refused(y: Tree | Forest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trees.hopf.sums.MOST_PRODUCTS", 1000)
    with pytest.raises(TreeError, match="order must be smaller: this takes more than 1000 products of terms"):
        grossman_larson("τ^5·[τ]", y)
