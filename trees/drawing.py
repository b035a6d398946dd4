"""Pictures of trees: one tree or a whole table, as SVG or through matplotlib."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from foundation.extras import how_to_install

from .layout import FONT, LINE, RADIUS, arrange

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes

    from .tree import Tree

PALETTE = ("#000000", "#ffffff", "#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7")
"""The fill of colours 0, 1, …, from the start again beyond the last: black and white as in the literature on
partitioned methods, then the colours of Okabe and Ito (2008), which the colour-blind can tell apart."""


def svg(
    trees: Tree | Iterable[Tree],
    columns: int | None = None,
    labels: bool | Iterable[str] = False,
    names: Iterable[str] | None = None,
) -> str:
    """A picture of one tree, or of many as one table, as SVG.

    The roots are below. Each tree has its text as title, which viewers show under the pointer.

    Args:
        trees: A tree, or at most 2,000 of them, each of at most 1,000 nodes.
        columns: The number of trees side by side; None for at most 10.
        labels: What to write below the trees: True for their texts, or one string per tree.
        names: The names of the colours in texts; None for the default names.

    Returns:
        The SVG document.

    Raises:
        TreeError: If there is no tree, too much to draw, or not one label per tree.

    Example:
        >>> from trees import Tree
        >>> svg(Tree("[τ,[τ]]")).count("<circle")
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
    trees: Tree | Iterable[Tree],
    ax: Axes | None = None,
    columns: int | None = None,
    labels: bool | Iterable[str] = False,
    names: Iterable[str] | None = None,
) -> Axes:
    """The picture that `svg` makes, drawn by matplotlib.

    Args:
        trees: A tree, or at most 2,000 of them, each of at most 1,000 nodes.
        ax: The axes to draw on, whose frame is hidden; None for a new figure of fitting size.
        columns: The number of trees side by side; None for at most 10.
        labels: What to write below the trees: True for their texts, or one string per tree.
        names: The names of the colours in texts; None for the default names.

    Returns:
        The axes.

    Raises:
        TreeError: If there is no tree, too much to draw, or not one label per tree.
        ImportError: If matplotlib is not installed.

    Example:
        >>> from matplotlib.figure import Figure
        >>> from trees import Tree
        >>> len(draw(Tree("[τ,[τ]]"), Figure().add_subplot()).collections)
        2
    """
    picture = arrange(trees, columns, labels, names)
    try:
        from matplotlib.collections import EllipseCollection, LineCollection
    except ImportError as missing:
        raise ImportError(f"draw needs matplotlib: {how_to_install('plot')}") from missing
    if ax is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=(picture.width / 72, picture.height / 72))  # one point for one pixel
        ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, picture.width), ylim=(picture.height, 0), aspect="equal")
    ax.axis("off")
    # What matplotlib measures in points grows with the picture, as the rest does.
    extent = ax.get_window_extent()
    scale = 72 / ax.figure.dpi * min(extent.width / picture.width, extent.height / picture.height)
    nodes = [node for tree in picture.drawn for node in tree.nodes]
    edges = [[(x, y), (u, v)] for tree in picture.drawn for x, y, u, v in tree.edges]
    diameters = [2 * RADIUS] * len(nodes)
    circles = EllipseCollection(
        diameters,
        diameters,
        [0.0] * len(nodes),
        units="xy",
        offsets=[(x, y) for x, y, _ in nodes],
        offset_transform=ax.transData,
        facecolors=[_fill(color) for _, _, color in nodes],
        edgecolors="black",
        linewidths=LINE * scale,
        zorder=2,
    )
    ax.add_collection(LineCollection(edges, colors="black", linewidths=LINE * scale, zorder=1))
    ax.add_collection(circles)
    for tree in picture.drawn:
        ax.text(*tree.below, tree.caption, ha="center", va="baseline", fontsize=FONT * scale, parse_math=False)
    return ax


def _fill(color: int) -> str:
    return PALETTE[color % len(PALETTE)]


def _escape(text: str) -> str:
    """Text as XML holds it: special characters escaped, control characters left out."""
    return escape("".join(character if character.isprintable() else " " for character in text))
