"""Formal sums, coproducts and antipodes of another kind: planar forests, with the algebra of Munthe-Kaas and Wright.

Values and recursions: Munthe-Kaas, Wright, Found. Comput. Math. 8 (2008) 227–257, doi:10.1007/s10208-006-0222-5.
"""

from __future__ import annotations

from functools import cache, total_ordering
from itertools import combinations

import pytest

from trees import Forest, FormalSum, Tree, TreeError
from trees.hopf.coproducts import convolution_inverse
from trees.hopf.sums import add_terms


@total_ordering
class PlanarForest:
    """A word of planar trees, as a balanced text: a pair of brackets for each node."""

    def __init__(self, text):
        known = text.brackets if isinstance(text, PlanarForest) else text
        self.brackets = known.replace("τ", "[]").translate(str.maketrans("", "", "·,∅"))

    def split(self):
        """The trees, each by the forest of its branches."""
        depth, start = 0, 0
        for at, c in enumerate(self.brackets):
            depth += 1 if c == "[" else -1
            if depth == 0:
                yield PlanarForest(self.brackets[start + 1 : at])
                start = at + 1

    @property
    def order(self):
        return len(self.brackets) // 2

    def __mul__(self, other):
        return PlanarForest(self.brackets + other.brackets)

    def __iter__(self):
        return map(rooted, self.split())

    def __hash__(self):
        return hash(self.brackets)

    def __eq__(self, other):
        return isinstance(other, PlanarForest) and self.brackets == other.brackets

    def __lt__(self, other):
        return (self.order, self.brackets) < (other.order, other.brackets)

    colors = (0,)

    def text(self, names=None):
        """The trees with dots between them, and their branches with commas."""

        def trees(forest, between):
            return between.join(f"[{trees(x, ',')}]" if x.brackets else "τ" for x in forest.split())

        return trees(self, "·") or "∅"


class PlanarSum(FormalSum):
    forest = tree = PlanarForest


NONE = PlanarForest("")


def rooted(branches):
    return PlanarForest(f"[{branches.brackets}]")


@cache
def shuffles(x, y):
    """The shuffle product of two words."""
    first, second = list(x), list(y)
    total = {}
    for places in combinations(range(len(first) + len(second)), len(first)):
        rest, word = iter(second), NONE
        chosen = iter(first)
        for k in range(len(first) + len(second)):
            word = word * next(chosen if k in places else rest)
        add_terms(total, {(word,): 1})
    return total


def times(left, right):
    """The product of sums: shuffles of the left factors, and words of the right ones if there are any."""
    total = {}
    for (x, *trunk), a in left.items():
        for (y, *other), b in right.items():
            ends = [s * t for s, t in zip(trunk, other, strict=True)]
            add_terms(total, {(*word, *ends): n for word, n in shuffles(x, y).items()}, a * b)
    return total


@cache
def coproduct(x):
    """Δ(ω·τ) = ω·τ⊗∅ + Δ(ω) · (id⊗B₊)Δ(B₋(τ))."""
    if x == NONE:
        return PlanarSum.from_terms({(NONE, NONE): 1})
    *front, last = x
    before = coproduct(PlanarForest("".join(tree.brackets for tree in front)))
    (branches,) = last.split()
    lifted = {(cut, rooted(trunk)): n for (cut, trunk), n in coproduct(branches).terms.items()}
    return PlanarSum.from_terms(times(before.terms, lifted)) + PlanarSum((x, "∅"))


@cache
def antipode(x):
    if x == NONE:
        return PlanarSum(NONE)
    return PlanarSum.from_terms(convolution_inverse(x, coproduct(x).terms.items(), lambda y: antipode(y).terms, times))


def test_planar_coproducts_and_antipodes_need_no_second_copy():
    assert coproduct(PlanarForest("τ·[τ]")) == PlanarSum(
        {("τ·[τ]", "∅"): 1, ("τ·τ", "τ"): 2, ("τ", "τ·τ"): 1, ("τ", "[τ]"): 1, ("∅", "τ·[τ]"): 1}
    )
    found = antipode(PlanarForest("[τ,[τ]]"))
    wanted = {"τ·τ·τ·τ": 12, "τ·τ·[τ]": -2, "τ·[τ]·τ": -3, "τ·[τ,τ]": 1, "τ·[[τ]]": 1, "[τ]·τ·τ": -4, "[τ,τ]·τ": 1}
    assert found == PlanarSum(wanted | {"[[τ]]·τ": 1, "[τ,[τ]]": -1})
    assert found != antipode(PlanarForest("[[τ],τ]"))


@pytest.mark.parametrize("text", ["τ·τ·[τ]", "[[τ],[τ,τ]]", "[τ]·[[τ]]·τ", "[[[τ]·τ],τ]"])
def test_the_antipode_is_the_inverse_from_the_other_side_too(text):
    total = {}
    for (left, right), n in coproduct(PlanarForest(text)).terms.items():
        add_terms(total, times(antipode(left).terms, {(right,): 1}), n)
    assert not any(total.values())
    wrong = times(antipode(PlanarForest("τ")).terms, {(PlanarForest(text),): 1})
    assert any(add_terms(total, wrong).values())


def test_sums_of_one_kind_refuse_forests_of_another():
    planar = PlanarSum("[τ]")
    assert (repr(planar + planar), len(planar - PlanarForest("[τ]"))) == ("2 [τ]", 0)
    for other in (Forest("[τ]"), Tree("[τ]"), FormalSum("[τ]")):
        with pytest.raises(TypeError):
            planar + other
        with pytest.raises(TypeError):
            FormalSum("[τ]") + planar
    with pytest.raises(TreeError, match="element must be a tree, a forest, or a tuple of these"):
        PlanarSum({Forest("τ"): 1})
