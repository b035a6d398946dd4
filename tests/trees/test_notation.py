from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tree_oracles import random_trees

from trees.errors import TreeError
from trees.notation import check_names, default_color, default_names
from trees.tree import Tree


def levels_text(tree: Tree) -> str:
    return str(list(tree.levels))


def colored_levels_text(tree: Tree) -> str:
    return f"{list(tree.levels)}:{list(tree.colors)}"


@pytest.mark.parametrize("colors", [1, 2, 3, 4])
def test_reading_what_was_written_gives_the_same_tree(colors: int) -> None:
    names = ["fast", "slow", "x_1", "tt"][:colors]

    @given(random_trees(colors))
    def check(tree: Tree) -> None:
        assert Tree(str(tree)) == tree
        assert Tree(colored_levels_text(tree)) == tree
        assert Tree(tree.text(names), names=names) == tree
        if max(tree.colors) == 0:
            assert Tree(levels_text(tree)) == tree
            assert Tree(str(tree).replace(",", "")) == tree
            assert Tree(str(tree).replace("τ", " t ")) == tree

    check()


@given(st.lists(st.integers(0, 200), min_size=1, max_size=6))
def test_default_names_are_read_back_whatever_the_colors(colors: list[int]) -> None:
    tree = Tree.from_levels(range(len(colors)), colors)
    assert Tree(str(tree)) == tree


def test_default_names() -> None:
    names = default_names(60)
    assert len(set(names)) == 60
    assert not {"p", "q", "t"} & set(names)
    assert [default_color(name) for name in names] == list(range(60))
    assert names[22:25] == ("z", "a1", "b1")
    assert [default_color(name) for name in ("p", "a0", "a01", "ab", "A", "a" + "9" * 5000)] == [None] * 6


@pytest.mark.parametrize(
    ("text", "levels", "colors"),
    [
        ("τ", (0,), (0,)),
        ("t", (0,), (0,)),
        (" [ τ , [ τ ] ] ", (0, 1, 1, 2), (0, 0, 0, 0)),
        ("[[τ]τ]", (0, 1, 1, 2), (0, 0, 0, 0)),
        ("[[t],t]", (0, 1, 1, 2), (0, 0, 0, 0)),
        ("[ττ]", (0, 1, 1), (0, 0, 0)),
        ("[t t]", (0, 1, 1), (0, 0, 0)),
        ("[τ^3]", (0, 1, 1, 1), (0, 0, 0, 0)),
        ("[τ^1, [τ] ^ 2]", (0, 1, 1, 2, 1, 2), (0,) * 6),
        ("[[τ^2]^2]", (0, 1, 2, 2, 1, 2, 2), (0,) * 7),
        ("[0]", (0,), (0,)),
        ("[0,1,2,1]", (0, 1, 1, 2), (0, 0, 0, 0)),
        (" [0, 1,2 ,1] ", (0, 1, 1, 2), (0, 0, 0, 0)),
        ("[0,1,1]:[0,1,0]", (0, 1, 1), (0, 0, 1)),
        ("[0,1,1] : [0,1,1]", (0, 1, 1), (0, 1, 1)),
        ("p", (0,), (0,)),
        ("q", (0,), (1,)),
        ("p[q,q[p]]", (0, 1, 1, 2), (0, 1, 1, 0)),
        ("p [q [p] q]", (0, 1, 1, 2), (0, 1, 1, 0)),
        ("p[q^2,q[p]^2]", (0, 1, 1, 1, 2, 1, 2), (0, 1, 1, 1, 0, 1, 0)),
        ("a[b,c]", (0, 1, 1), (0, 1, 2)),
        ("a[r]", (0, 1), (0, 15)),
    ],
)
def test_notations(text: str, levels: tuple[int, ...], colors: tuple[int, ...]) -> None:
    tree = Tree(text)
    assert (tree.levels, tree.colors) == (levels, colors)


def test_names_of_colors() -> None:
    assert Tree("q[p]", names=("q", "p")) == Tree("p[q]")
    assert Tree("t2[t1]", names=("t1", "t2")) == Tree("q[p]")
    assert Tree("[τ]", names=("p", "q")) == Tree("p[p]", names=("p", "q")) == Tree("[0,1]", names=("p", "q"))
    assert Tree("[τ]", names=("",)).text(("",)) == "[τ]"
    assert Tree("[τ]").text(("p", "q")) == "p[p]"
    assert str(Tree("p[p]")) == "[τ]"
    assert repr(Tree("q")) == "Tree('q')"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "is empty: ''"),
        ("   ", "is empty"),
        ("∅", "has the empty tree ∅, which is no tree, at position 1"),
        ("[τ,∅]", "has the empty tree ∅, which is no tree, at position 4"),
        ("[τ", r"has a bracket that is never closed at position 1: '\[τ'"),
        ("[τ,[τ]", "has a bracket that is never closed at position 1"),
        ("[τ]]", "has a stray ']' at position 4"),
        ("]", "has a stray ']' at position 1"),
        ("[]", "has empty brackets at position 2"),
        ("[τ,[]]", "has empty brackets at position 5"),
        ("p[]", "has empty brackets at position 3"),
        ("[τ,]", "has a stray ']' at position 4"),
        ("[,τ]", "has a stray ',' at position 2"),
        ("[τ,,τ]", "has a stray ',' at position 4"),
        ("τ,τ", "has a stray ',' at position 2"),
        ("ττ", "has a second tree at position 2"),
        ("[τ] τ", "has a second tree at position 5"),
        ("[τ][τ]", "has a second tree at position 4"),
        ("p[q][q]", "has a second tree at position 5"),
        ("τ^2", r"has a stray '\^' at position 2"),
        ("[^2]", r"has a stray '\^' at position 2"),
        ("[τ^0]", r"has a '\^' without one positive number at position 3"),
        ("[τ^]", r"has a '\^' without one positive number at position 3"),
        ("[τ^-1]", r"has a '\^' without one positive number at position 3"),
        ("[τ^", r"has a '\^' without one positive number at position 3"),
        ("[τ^x]", r"has a '\^' without one positive number at position 3"),
        ("[τ^٣]", r"has a '\^' without one positive number at position 3"),
        ("[τ^²]", r"has a '\^' without one positive number at position 3"),
        ("[τ^2^2]", r"has a '\^' without one positive number at position 5"),
        ("[τ^1000000000]", "has more than 10000 nodes at position 3"),
        ("[τ^" + "9" * 5000 + "]", "has more than 10000 nodes at position 3"),
        ("[[[[τ^99]^99]^99]^99]", "has more than 10000 nodes at position 14"),
        ("[" * 10_001, "has more than 10000 nodes at position 10001"),
        ("[" * 1_000_000, "has more than 10000 nodes"),
        ("[τ;τ]", "has ';' at position 3"),
        ("[2τ]", "has '2τ' for a number at position 2"),
        ("[τ,2]", "has '2' at position 4"),
        ("__import__('os')", "has '_' at position 1"),
        ("p[τ]", "has a node without a colour at position 3"),
        ("[p,q]", "has a node without a colour at position 1"),
        ("p[a]", "has the colour 'p', not one of p, q alone or the other letters, at position 1"),
        ("f(f)", r"has '\(' at position 2"),
        ("τau", "has a second tree at position 2"),
        ("x" * 1_000_000, "has the colour 'xxxx"),
        ("[0,1,3]", "levels must rise by 1 at a time, but entry 3 is 3 after 1"),
        ("[1,2]", "levels must start with 0"),
        ("[0,1,0]", "levels must have one root, but entry 3 is 0 again"),
        ("[0,-1]", "has '-1' for a number at position 4"),
        ("[-1]", "has '-1' for a number at position 2"),
        ("[0,,1]", "has '' for a number at position 4"),
        ("[0,1", r"lacks a sequence \[0,1,…\] in brackets at position 1"),
        ("[0,1]x", "lacks a sequence .* at position 1"),
        ("[0,[1]]", r"has '\[1\]' for a number at position 4"),
        ("[0,1]:", "lacks a sequence .* at position 7"),
        ("[0,1]:[0,x]", "has 'x' for a number at position 10"),
        ("[0,1] :[0,1]:[0,1]", r"has '1\]:\[0' for a number at position 11"),
        ("[0,1]:[0]", "colors must be as many as levels, 2, but were 1"),
        ("[0," + "9" * 5000 + "]", "has '9999.* for a number at position 4"),
        ("[0,1000000000]", "has '1000000000' for a number at position 4"),
    ],
)
def test_mistakes_are_named_with_their_position(text: str, sentence: str) -> None:
    with pytest.raises(TreeError, match=sentence) as caught:
        Tree(text)
    assert len(str(caught.value)) < 250


@given(st.text(alphabet="[]τtpqa0123456789,:^ ∅-", max_size=30))
def test_any_text_is_a_tree_or_refused(text: str) -> None:
    try:
        tree = Tree(text)
    except TreeError:
        return
    assert Tree(str(tree)) == tree


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (["p", "p"], "names must be different words, one per colour, but were"),
        ([], "names must be different words"),
        (7, "names must be different words, one per colour, but were 7"),
        (["t"], "names must be words that start with a letter, none t or τ, but one was 't'"),
        (["aτ"], "but one was 'aτ'"),
        (["1a"], "but one was '1a'"),
        (["a b"], "but one was 'a b'"),
        (["", "q"], "but one was ''"),
        ([1], "but one was 1"),
    ],
)
def test_unusable_names_are_refused(names, sentence: str) -> None:
    with pytest.raises(TreeError, match=sentence):
        check_names(names)
    with pytest.raises(TreeError, match=sentence):
        Tree("τ", names=names)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(TreeError, match="has the colour 'r', not one of p, q, at position 3"):
        Tree("p[r]", names=("p", "q"))
    with pytest.raises(TreeError, match="names must name the colours 0 to 1, but were \\('p',\\)"):
        Tree("p[q]").text(names=("p",))
