"""Slow, obvious ways to get at trees, for the tests of the fast ones."""

from __future__ import annotations

from functools import cache
from itertools import permutations
from math import factorial

from hypothesis import strategies as st

from trees.tree import Tree


@cache
def grown(order: int, colors: int = 1) -> tuple[Tree, ...]:
    """All trees of one order: a leaf of each colour added at every node of every smaller tree."""
    if order == 1:
        return tuple(Tree.from_levels([0], [color]) for color in range(colors))
    found = set()
    for tree in grown(order - 1, colors):
        levels, paints = list(tree.levels), list(tree.colors)
        for node, level in enumerate(levels, start=1):
            for color in range(colors):
                leveled = [*levels[:node], level + 1, *levels[node:]]
                painted = [*paints[:node], color, *paints[node:]]
                found.add(Tree.from_levels(leveled, painted))
    return tuple(found)


def monotonic_labellings(tree: Tree) -> int:
    """Labellings that grow away from the root, counted one by one, up to the tree's symmetries."""
    levels = tree.levels
    parents = {}
    for node, level in enumerate(levels):
        if level:
            parents[node] = max(k for k in range(node) if levels[k] == level - 1)
    growing = sum(
        all(labels[parent] < labels[child] for child, parent in parents.items())
        for labels in permutations(range(len(levels)))
    )
    assert growing * tree.density == factorial(tree.order)  # the hook length formula
    return growing // tree.symmetry


@st.composite
def level_sequences(draw: st.DrawFn, colors: int = 1, largest: int = 25) -> tuple[list[int], list[int]]:
    """The levels and colours of a random tree, siblings in any order."""
    levels = [0]
    for _ in range(draw(st.integers(0, largest - 1))):
        levels.append(draw(st.integers(1, levels[-1] + 1)))
    paints = draw(st.lists(st.integers(0, colors - 1), min_size=len(levels), max_size=len(levels)))
    return levels, paints


def random_trees(colors: int = 1, largest: int = 25) -> st.SearchStrategy[Tree]:
    """Random trees of at most so many nodes."""
    return level_sequences(colors, largest).map(lambda pair: Tree.from_levels(*pair))
