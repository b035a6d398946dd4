"""Drawings of trees, single or in tables, as SVG or with matplotlib."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from itertools import accumulate, islice
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

from bseries_base.plotting import PALETTE, drawing, fit_picture, in_centimetres
from trees.errors import TreeError
from trees.notation import check_names, default_names, parents_of, tree_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MAX_TREES = 2_000
"""The largest number of trees in one picture."""

MAX_NODES = 1_000
"""The largest number of nodes of one tree in a picture."""

STEP, RADIUS, LINE, FONT = 26.0, 5.5, 1.2, 12.0  # in pixels: node distance, radius, line width, font size
_GAP = 24.0  # pixels between neighbouring trees
_LETTER = 0.6 * FONT  # average width of a letter


@runtime_checkable
class TreeLike(Protocol):
    """What a drawing shows of a tree."""

    @property
    def levels(self) -> Sequence[int]:
        """The distance of each node from the root, in preorder."""
        ...

    @property
    def colors(self) -> Sequence[int]:
        """The colour of each node, in preorder."""
        ...


class Drawn(NamedTuple):
    """A tree in a picture, with coordinates in pixels to the right and down from the upper left corner."""

    title: str
    nodes: list[tuple[float, float, int]]  # coordinates and colour of each node, in preorder
    edges: list[tuple[float, float, float, float]]  # coordinates of both ends of each edge
    caption: str
    below: tuple[float, float]  # the centre of the caption's base line


class Picture(NamedTuple):
    """A picture: its size, and trees with coordinates."""

    width: float
    height: float
    drawn: list[Drawn]


def arrange(
    trees: TreeLike | Iterable[TreeLike], columns: int | None, labels: bool | Iterable[str], names: Iterable[str] | None
) -> Picture:
    """Arrange trees in rows and columns of individual sizes, with the roots of each row aligned."""
    members = _members(trees)
    levels, colors = [tree.levels for tree in members], [tree.colors for tree in members]
    if names is None:
        names = default_names(1 + max(map(max, colors)))  # the same for the whole picture
    names = check_names(names)
    titles = [tree_text(*tree, names) for tree in zip(levels, colors, strict=True)]
    captions = _captions(labels, titles)
    if columns is not None and (isinstance(columns, bool) or not isinstance(columns, int) or columns < 1):
        raise TreeError(f"columns must be a whole number, 1 or more, but was {columns!r:.60}")
    columns = min(10 if columns is None else columns, len(members))
    shapes = [*map(_tidy, levels)]
    widths, heights = [], []
    for (xs, ys), caption in zip(shapes, captions, strict=True):
        widths.append(max(max(xs) - min(xs) + 2 * RADIUS, _LETTER * len(caption)) + _GAP)
        heights.append(max(ys) + 2 * RADIUS + _GAP / 2)
    margin = _GAP / 2 + (1.5 * FONT if any(captions) else 0)  # between the roots of a row and its lower border
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
        nodes = [(left + x, root - y, color) for x, y, color in zip(xs, ys, colors[k], strict=True)]
        edges = [(*nodes[child][:2], *nodes[parent][:2]) for child, parent in _edges(levels[k])]
        drawn.append(Drawn(titles[k], nodes, edges, captions[k], (middle, bottom - _GAP / 2)))
    return Picture(borders[-1], bottoms[-1], drawn)


def _members(trees: TreeLike | Iterable[TreeLike]) -> list[TreeLike]:
    if isinstance(trees, TreeLike):
        trees = [trees]
    elif not hasattr(trees, "__iter__"):
        raise TreeError(f"trees must be a tree or trees, but was {trees!r:.60}")
    members = list(islice(trees, MAX_TREES + 1))
    if not members:
        raise TreeError("trees must have at least one tree to draw, but have none")
    if len(members) > MAX_TREES:
        raise TreeError(f"trees must be at most {MAX_TREES} in one picture, but are more")
    for tree in members:
        if not isinstance(tree, TreeLike):
            raise TreeError(f"trees must be trees, but one was {tree!r:.60}")
        if len(tree.levels) > MAX_NODES:
            raise TreeError(f"trees must have at most {MAX_NODES} nodes in a picture, but one has {len(tree.levels)}")
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


def _edges(levels: Sequence[int]) -> list[tuple[int, int]]:
    """Child and parent of each edge, as indices in preorder."""
    return list(enumerate(parents_of(levels)))[1:]


def _tidy(levels: Sequence[int]) -> tuple[list[float], list[float]]:
    """Coordinates of the nodes in preorder, to the right of the root and above it.

    Neighbouring subtrees are as close as their outlines allow, and parents are centred above their children (Reingold
    and Tilford 1981, doi:10.1109/TSE.1981.234519). An outline is the extreme coordinate on each level, relative to the
    root of the subtree.
    """
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
    rise = max(1.0, max(places) / 3)  # flatter edges would touch neighbouring nodes
    for child, parent in _edges(levels):
        places[child] += places[parent]
    return [STEP * place for place in places], [STEP * rise * level for level in levels]


def svg(
    trees: TreeLike | Iterable[TreeLike],
    columns: int | None = None,
    labels: bool | Iterable[str] = False,
    names: Iterable[str] | None = None,
) -> str:
    """A drawing of one tree, or of several in a table, as SVG.

    Roots are at the bottom. The title of each tree, shown by viewers as a tooltip, is its text.

    Args:
        trees: A tree, or at most 2,000 of them, each of at most 1,000 nodes.
        columns: The number of trees in a row; None for at most 10.
        labels: Captions below the trees: True for their texts, or one string per tree.
        names: The names of the colours in texts; None for the default names.

    Raises:
        TreeError: If there is no tree, there are too many trees or nodes, or not one label per tree.

    Example:
        >>> import bseries as bs
        >>> bs.trees.svg(bs.Tree("[τ,[τ]]")).count("<circle")
        4
    """
    picture = arrange(trees, columns, labels, names)
    width, height = f"{picture.width:g}", f"{picture.height:g}"
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}"'
        f' stroke="black" stroke-width="{LINE:g}" font-family="sans-serif" font-size="{FONT:g}" text-anchor="middle">',
        f'<rect width="{width}" height="{height}" fill="white" stroke="none"/>',
    ]
    for tree in picture.drawn:
        lines.append(f"<g><title>{_escape(tree.title)}</title>")
        if tree.edges:
            lines.append(f'<path d="{"".join(f"M{x:g} {y:g}L{u:g} {v:g}" for x, y, u, v in tree.edges)}"/>')
        for x, y, color in tree.nodes:
            lines.append(f'<circle cx="{x:g}" cy="{y:g}" r="{RADIUS:g}" fill="{_fill(color)}"/>')
        if tree.caption:
            x, y = tree.below
            lines.append(f'<text x="{x:g}" y="{y:g}" stroke="none">{_escape(tree.caption)}</text>')
        lines.append("</g>")
    return "\n".join([*lines, "</svg>\n"])


def draw(
    trees: TreeLike | Iterable[TreeLike],
    ax: Axes | None = None,
    columns: int | None = None,
    labels: bool | Iterable[str] = False,
    names: Iterable[str] | None = None,
) -> Axes:
    """The drawing of `svg` in matplotlib.

    Args:
        trees: As for `svg`, like `columns`, `labels` and `names`.
        ax: The axes, whose frame is hidden; None for a new figure of suitable size.

    Raises:
        TreeError: If there is no tree, there are too many trees or nodes, or not one label per tree, or
            `ax` is no axes.
        ImportError: If matplotlib is not installed.

    Example:
        >>> import bseries as bs
        >>> from matplotlib.figure import Figure
        >>> len(bs.draw(bs.Tree("[τ,[τ]]"), Figure().add_subplot()).collections)
        2
    """
    picture = arrange(trees, columns, labels, names)
    size = picture.width, picture.height  # one point per pixel
    with drawing(ax, TreeError, in_centimetres(size), frame=False) as axes:
        from matplotlib import collections

        scale = fit_picture(axes, size)  # of lengths in points
        nodes = [node for tree in picture.drawn for node in tree.nodes]
        edges = [[(x, y), (u, v)] for tree in picture.drawn for x, y, u, v in tree.edges]
        diameters = [2 * RADIUS] * len(nodes)
        circles = collections.EllipseCollection(
            diameters, diameters, [0.0] * len(nodes), units="xy",
            offsets=[(x, y) for x, y, _ in nodes], offset_transform=axes.transData,
            facecolors=[_fill(color) for _, _, color in nodes], edgecolors="black", linewidths=LINE * scale, zorder=2,
        )  # fmt: skip
        axes.add_collection(collections.LineCollection(edges, colors="black", linewidths=LINE * scale, zorder=1))
        axes.add_collection(circles)
        for tree in picture.drawn:
            axes.text(*tree.below, tree.caption, ha="center", va="baseline", fontsize=FONT * scale, parse_math=False)
    return axes


def _fill(color: int) -> str:
    return PALETTE[color % len(PALETTE)]


def _escape(text: str) -> str:
    """Text for XML, with special characters escaped and without control characters."""
    return escape("".join(character if character.isprintable() else " " for character in text))
