"""Where a picture of trees has its nodes: each tree tidy, its root below, and all of them in rows and columns."""

from __future__ import annotations

from itertools import accumulate, islice
from typing import TYPE_CHECKING, NamedTuple

from .errors import TreeError
from .names import check_names, default_names
from .tree import Tree

if TYPE_CHECKING:
    from collections.abc import Iterable

MAX_TREES = 2_000
"""The largest number of trees in one picture."""

MAX_NODES = 1_000
"""The largest number of nodes of one tree in a picture."""

STEP, RADIUS, LINE, FONT = 26.0, 5.5, 1.2, 12.0  # pixels: between nodes, of a node, of a line, of a caption's letters
_GAP = 24.0  # pixels between neighbouring trees
_LETTER = 0.6 * FONT  # the width of a letter, about


class Drawn(NamedTuple):
    """One tree in its place: pixels to the right and down from the upper left corner of the picture."""

    title: str
    nodes: list[tuple[float, float, int]]
    """Place and colour of each node, in preorder."""
    edges: list[tuple[float, float, float, float]]
    """Both ends of each edge."""
    caption: str
    below: tuple[float, float]
    """The middle of the caption's base line."""


class Picture(NamedTuple):
    """Trees in their places, and the size of the whole."""

    width: float
    height: float
    drawn: list[Drawn]


def arrange(
    trees: Tree | Iterable[Tree], columns: int | None, labels: bool | Iterable[str], names: Iterable[str] | None
) -> Picture:
    """Place trees in rows and columns, each as wide and high as it needs, the roots of a row on one line.

    Args:
        trees: A tree, or at most `MAX_TREES` of them, each of at most `MAX_NODES` nodes.
        columns: The number of trees side by side; None for at most 10.
        labels: What to write below the trees: True for their texts, or one string per tree.
        names: The names of the colours in texts; None for the default names.

    Returns:
        The picture.

    Raises:
        TreeError: If there is no tree, too much to draw, or not one label per tree.
    """
    members = _members(trees)
    if names is None:
        names = default_names(1 + max(max(tree.colors) for tree in members))  # the same for the whole picture
    names = check_names(names)
    titles = [tree.text(names) for tree in members]
    captions = _captions(labels, titles)
    columns = _columns(columns, len(members))
    shapes = [_tidy(tree) for tree in members]
    widths, heights = [], []
    for (xs, ys), caption in zip(shapes, captions, strict=True):
        widths.append(max(max(xs) - min(xs) + 2 * RADIUS, _LETTER * len(caption)) + _GAP)
        heights.append(max(ys) + 2 * RADIUS + _GAP / 2)
    margin = _GAP / 2 + (1.5 * FONT if any(captions) else 0)  # between a row's roots and its lower border
    column_widths = [max(widths[k::columns]) for k in range(columns)]
    row_heights = [max(heights[k : k + columns]) + margin for k in range(0, len(members), columns)]
    borders = list(accumulate(column_widths))
    bottoms = list(accumulate(row_heights))
    drawn = []
    for k, (xs, ys) in enumerate(shapes):
        middle = borders[k % columns] - column_widths[k % columns] / 2
        left = middle - (max(xs) + min(xs)) / 2
        bottom = bottoms[k // columns]
        root = bottom - margin - RADIUS
        nodes = [(left + x, root - y, color) for x, y, color in zip(xs, ys, members[k].colors, strict=True)]
        edges = [(*nodes[child][:2], *nodes[parent][:2]) for child, parent in _edges(members[k].levels)]
        drawn.append(Drawn(titles[k], nodes, edges, captions[k], (middle, bottom - _GAP / 2)))
    return Picture(borders[-1], bottoms[-1], drawn)


def _members(trees: Tree | Iterable[Tree]) -> list[Tree]:
    if isinstance(trees, Tree):
        trees = [trees]
    elif not hasattr(trees, "__iter__"):
        raise TreeError(f"trees must be a tree or trees, but was {trees!r:.60}")
    members = list(islice(trees, MAX_TREES + 1))
    if not members:
        raise TreeError("trees must have at least one tree to draw, but have none")
    if len(members) > MAX_TREES:
        raise TreeError(f"trees must be at most {MAX_TREES} in one picture, but are more")
    for tree in members:
        if not isinstance(tree, Tree):
            raise TreeError(f"trees must be trees, but one was {tree!r:.60}")
        if tree.order > MAX_NODES:
            raise TreeError(f"trees must have at most {MAX_NODES} nodes in a picture, but one has {tree.order}")
    return members


def _captions(labels: bool | Iterable[str], titles: list[str]) -> list[str]:
    if isinstance(labels, bool):
        return titles if labels else [""] * len(titles)
    if not hasattr(labels, "__iter__"):
        raise TreeError(f"labels must be True, False or strings, but were {labels!r:.60}")
    captions = [labels] if isinstance(labels, str) else [str(label) for label in labels]
    if len(captions) != len(titles):
        raise TreeError(f"labels must be one per tree, {len(titles)}, but were {len(captions)}")
    return captions


def _columns(columns: int | None, count: int) -> int:
    if columns is None:
        return min(count, 10)
    if isinstance(columns, bool) or not isinstance(columns, int) or columns < 1:
        raise TreeError(f"columns must be a whole number, 1 or more, but was {columns!r:.60}")
    return min(columns, count)


def _edges(levels: tuple[int, ...]) -> list[tuple[int, int]]:
    """Child and parent of each edge, as numbers in preorder."""
    path: list[int] = []
    edges = []
    for node, level in enumerate(levels):
        path[level:] = [node]
        if level:
            edges.append((node, path[level - 1]))
    return edges


def _tidy(tree: Tree) -> tuple[list[float], list[float]]:
    """Places of the nodes in preorder, to the right of the root and above it.

    Subtrees stand side by side as close as their outlines allow, and parents in the middle of their children (Reingold
    and Tilford 1981, doi:10.1109/TSE.1981.234519). An outline is the extreme place on each level, seen from its root.
    """
    levels = tree.levels
    places = [0.0] * len(levels)  # relative to the parent, in steps
    waiting: list[list[tuple[int, list[float], list[float]]]] = [[] for _ in range(max(levels) + 2)]
    for node in reversed(range(len(levels))):
        children = waiting[levels[node] + 1]
        lefts: list[float] = []
        rights: list[float] = []
        for child, child_lefts, child_rights in reversed(children):
            shift = max((right - left for right, left in zip(rights, child_lefts, strict=False)), default=-1) + 1
            places[child] = shift
            lefts += [shift + left for left in child_lefts[len(lefts) :]]
            rights[: len(child_rights)] = [shift + right for right in child_rights]
        middle = places[children[0][0]] / 2 if children else 0.0
        for child, _, _ in children:
            places[child] -= middle
        children.clear()
        waiting[levels[node]].append((node, [0.0, *(x - middle for x in lefts)], [0.0, *(x - middle for x in rights)]))
    rise = max(1.0, max(places) / 3)  # an edge flatter than this would touch the nodes beside its ends
    for child, parent in _edges(levels):
        places[child] += places[parent]
    return [STEP * place for place in places], [STEP * rise * level for level in levels]
