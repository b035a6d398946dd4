from __future__ import annotations

import copy
import pickle
from functools import cache
from itertools import pairwise, product
from math import factorial, prod

import pytest
from hypothesis import given
from hypothesis import strategies as st
from networkx.algorithms.isomorphism import DiGraphMatcher, categorical_node_match
from tree_oracles import grown, level_sequences, monotonic_labellings, random_trees

from trees.errors import TreeError
from trees.tree import Tree

# Butcher, Numerical Methods for Ordinary Differential Equations (2016), Table 301(I): σ, γ, α, β.
BUTCHER_TABLE = {
    "τ": (1, 1, 1, 1),
    "[τ]": (1, 2, 1, 2),
    "[τ^2]": (2, 3, 1, 3),
    "[[τ]]": (1, 6, 1, 6),
    "[τ^3]": (6, 4, 1, 4),
    "[τ,[τ]]": (1, 8, 3, 24),
    "[[τ^2]]": (2, 12, 1, 12),
    "[[[τ]]]": (1, 24, 1, 24),
    "[τ^4]": (24, 5, 1, 5),
    "[τ^2,[τ]]": (2, 10, 6, 60),
    "[τ,[τ^2]]": (2, 15, 4, 60),
    "[τ,[[τ]]]": (1, 30, 4, 120),
    "[[τ]^2]": (2, 20, 3, 60),
    "[[τ^3]]": (6, 20, 1, 20),
    "[[τ,[τ]]]": (1, 40, 3, 120),
    "[[[τ^2]]]": (2, 60, 1, 60),
    "[[[[τ]]]]": (1, 120, 1, 120),
}
TALL = 4_000


@pytest.mark.parametrize(("text", "values"), BUTCHER_TABLE.items())
def test_functions_of_trees_agree_with_butchers_table(text: str, values: tuple[int, ...]) -> None:
    tree = Tree(text)
    assert (tree.symmetry, tree.density, tree.alpha, tree.beta) == values


def test_butchers_table_holds_every_tree_to_order_five() -> None:
    assert {Tree(text) for text in BUTCHER_TABLE} == {tree for order in range(1, 6) for tree in grown(order)}


def test_a_tree_of_order_nine() -> None:
    tree = Tree("[τ^2,[τ,[τ]],[τ]]")
    assert (tree.order, tree.density, tree.symmetry) == (9, 144, 2)


@pytest.mark.parametrize("order", range(1, 9))
def test_sums_over_all_trees(order: int) -> None:
    trees = grown(order)
    assert sum(tree.alpha for tree in trees) == factorial(order - 1)
    assert sum(tree.alpha * 2 ** (order - 1) * factorial(order) // tree.density for tree in trees) == (
        factorial(order - 1) * factorial(order)
    )
    assert sum(tree.alpha * tree.density for tree in trees) == order ** (order - 1)
    assert all(factorial(order) == tree.alpha * tree.symmetry * tree.density for tree in trees)


@pytest.mark.parametrize("colors", [1, 2])
@pytest.mark.parametrize("order", range(1, 6))
def test_symmetry_counts_automorphisms_and_alpha_counts_labellings(order: int, colors: int) -> None:
    for tree in grown(order, colors):
        graph = tree.to_networkx()
        matcher = DiGraphMatcher(graph, graph, node_match=categorical_node_match("color", None))
        assert tree.symmetry == len(list(matcher.isomorphisms_iter()))
        assert tree.alpha == monotonic_labellings(tree)


@cache
def rank(tree: Tree) -> tuple:
    """What the order of ids compares, written down as it is defined."""
    if tree.left is None or tree.right is None:
        return tree.order, tree.color
    return tree.order, tree.color, rank(tree.left), rank(tree.right)


@pytest.mark.parametrize(("order", "colors"), [(7, 1), (4, 2), (3, 3)])
def test_trees_are_ordered_by_order_color_left_right(order: int, colors: int) -> None:
    trees = [tree for n in range(1, order + 1) for tree in grown(n, colors)]
    for u, v in product(trees, trees):
        assert (u < v, u <= v, u > v, u >= v) == (
            rank(u) < rank(v),
            rank(u) <= rank(v),
            rank(u) > rank(v),
            rank(u) >= rank(v),
        )
        assert (u == v) == (rank(u) == rank(v)) == (u is v)


def test_the_order_begins_as_it_should() -> None:
    listing = [str(tree) for order in range(1, 5) for tree in sorted(grown(order))]
    assert listing == ["τ", "[τ]", "[[τ]]", "[τ,τ]", "[[[τ]]]", "[[τ,τ]]", "[τ,[τ]]", "[τ,τ,τ]"]
    assert sorted([Tree("q"), Tree("p[q]"), Tree("p")]) == [Tree("p"), Tree("q"), Tree("p[q]")]


@given(random_trees(colors=3))
def test_every_tree_is_left_grafted_with_right(tree: Tree) -> None:
    assert all(first <= second for _, node in tree.preorder() for first, second in pairwise(node.children))
    if tree.order > 1:
        assert tree.left is not None
        assert tree.right is not None
        assert tree.right == max(tree.children)
        assert tree.left.butcher_product(tree.right) == tree
        assert tree.density == tree.left.density * tree.right.density * tree.order // tree.left.order


@given(level_sequences(colors=3), st.randoms(use_true_random=False))
def test_the_order_of_siblings_does_not_matter(sequences: tuple[list[int], list[int]], random) -> None:
    tree = Tree.from_levels(*sequences)

    def shuffled(node: Tree, level: int) -> list[tuple[int, int]]:
        children = list(node.children)
        random.shuffle(children)
        return [(level, node.color)] + [pair for child in children for pair in shuffled(child, level + 1)]

    levels, colors = zip(*shuffled(tree, 0), strict=True)
    again = Tree.from_levels(levels, colors)
    assert again == tree
    assert hash(again) == hash(tree)
    assert (again.levels, again.colors, str(again)) == (tree.levels, tree.colors, str(tree))


def test_hashes_tell_trees_apart() -> None:
    trees = [tree for order in range(1, 10) for tree in grown(order)]
    assert len(trees) == 486
    assert len({hash(tree) for tree in trees}) == 486
    assert Tree("τ") != "τ"
    assert Tree("[τ]") != Tree("[[τ]]")


@given(random_trees(colors=4))
def test_copies_and_pickles_are_equal(tree: Tree) -> None:
    for again in (pickle.loads(pickle.dumps(tree)), copy.copy(tree), copy.deepcopy(tree), Tree(tree)):
        assert again == tree
        assert hash(again) == hash(tree)
        assert again.levels == tree.levels


def test_levels_colors_and_height() -> None:
    tree = Tree("p[q,q[p]]")
    assert (tree.levels, tree.colors, tree.color, tree.height) == ((0, 1, 1, 2), (0, 1, 1, 0), 0, 2)
    assert (Tree("τ").left, Tree("τ").right, Tree("τ").children, Tree("τ").height) == (None, None, (), 0)


def test_butcher_product_is_not_commutative() -> None:
    u, v = Tree("τ"), Tree("[τ]")
    assert (u.butcher_product(v), v.butcher_product(u)) == (Tree("[[τ]]"), Tree("[τ,τ]"))


def test_join_accepts_any_iterable_and_order() -> None:
    assert Tree.join(iter([Tree("q[p]"), Tree("q")]), color=1) == Tree("q[q,q[p]]")
    assert Tree.join([]) == Tree("τ")


@pytest.mark.parametrize("name", ["color", "order", "children", "anything"])
def test_trees_are_immutable(name: str) -> None:
    with pytest.raises(AttributeError):
        setattr(Tree("τ"), name, 1)


def test_numpy_integers_are_integers() -> None:
    numpy = pytest.importorskip("numpy")
    tree = Tree.from_levels(numpy.array([0, 1, 1]), numpy.array([0, 1, 0]))
    assert tree == Tree("p[p,q]")
    assert all(type(color) is int for color in tree.colors)


@pytest.mark.slow
def test_tall_trees_do_not_run_out_of_stack() -> None:
    tall = Tree.from_levels(range(TALL))
    assert Tree(str(tall)) == tall == eval(repr(tall))
    assert tall.symmetry == 1
    assert tall.density == factorial(TALL)
    assert (tall.alpha, tall.height) == (1, TALL - 1)
    assert pickle.loads(pickle.dumps(tall)) == copy.deepcopy(tall) == tall
    assert Tree.from_networkx(tall.to_networkx()) == tall
    twin = Tree.from_levels(range(TALL), [0] * (TALL - 1) + [1])
    assert tall < twin
    assert tall != twin
    assert Tree.join([twin, tall]).children == (tall, twin)


def test_combs_do_not_run_out_of_stack() -> None:
    levels = [0]
    for level in range(1, TALL // 2):
        levels += [level, level]
    comb = Tree.from_levels(levels)
    assert Tree(comb.text()) == comb
    assert comb.symmetry == 2
    assert comb.density == prod(range(1, comb.order + 1, 2))


@pytest.mark.parametrize(
    ("levels", "colors", "sentence"),
    [
        ([], None, r"levels must start with 0, the root, but were \[\]"),
        ([1, 2], None, "levels must start with 0"),
        ([0, 1, 3], None, "levels must rise by 1 at a time, but entry 3 is 3 after 1"),
        ([0, 1, 0], None, "levels must have one root, but entry 3 is 0 again"),
        ([0, -1], None, "each of levels must be a whole number, 0 to 9999, but was -1"),
        ([0, 1.0], None, "each of levels must be a whole number, 0 to 9999, but was 1.0"),
        ("01", None, "each of levels must be a whole number"),
        (7, None, "levels must be a sequence of whole numbers, but was 7"),
        ([0] + [1] * 10_000, None, "levels must have at most 10000 entries, but have 10001"),
        (range(20_000), None, "each of levels must be a whole number, 0 to 9999, but was 10000"),
        ([0, 1], [0], "colors must be as many as levels, 2, but were 1"),
        ([0, 1], [0, -1], "each of colors must be a whole number, 0 to 9999, but was -1"),
        ([0, 1], [0, 10**30], "each of colors must be a whole number"),
    ],
)
def test_wrong_levels_are_refused(levels, colors, sentence: str) -> None:
    with pytest.raises(TreeError, match=sentence):
        Tree.from_levels(levels, colors)


def test_the_largest_tree_is_allowed_and_no_larger_one() -> None:
    star = Tree.from_levels([0] + [1] * 9_999)
    assert star.order == 10_000
    assert Tree("[τ^9999]") == star
    with pytest.raises(TreeError, match="children must have fewer than 10000 nodes together, but have 10000"):
        star.butcher_product(Tree("τ"))


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(TreeError, match="children must be trees, but one was 'τ'"):
        Tree.join(["τ"])  # pyright: ignore[reportArgumentType]
    with pytest.raises(TreeError, match="color must be a whole number, 0 to 9999, but was -1"):
        Tree.join([], color=-1)
    with pytest.raises(TreeError, match="children must be trees, but one was 3"):
        Tree("τ").butcher_product(3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(TreeError, match=r"text must be a string such as '\[τ,\[τ\]\]', but was 3"):
        Tree(3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError):
        Tree("τ") < 3  # noqa: B015
