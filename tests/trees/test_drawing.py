from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterator
from xml.etree import ElementTree

import pytest
from hypothesis import given
from matplotlib import pyplot
from matplotlib.figure import Figure
from tree_oracles import grown, random_trees

from bseries_base.plotting import PALETTE
from trees.drawing import RADIUS, STEP, arrange, draw, svg
from trees.errors import TreeError
from trees.tree import Tree

SVG = "{http://www.w3.org/2000/svg}"
TABLE = [tree for order in range(1, 6) for tree in sorted(grown(order))]


def distance(point: tuple[float, float], edge: tuple[float, float, float, float]) -> float:
    """The distance of a point from a line segment."""
    (x, y), (a, b, c, d) = point, edge
    along = ((x - a) * (c - a) + (y - b) * (d - b)) / ((c - a) ** 2 + (d - b) ** 2)
    along = min(1.0, max(0.0, along))
    return math.hypot(x - a - along * (c - a), y - b - along * (d - b))


@given(random_trees(colors=2, largest=40))
def test_nothing_overlaps(tree: Tree) -> None:
    (drawn,) = arrange(tree, None, False, None).drawn
    points = [(x, y) for x, y, _ in drawn.nodes]
    assert all(math.dist(u, v) > 0.999 * STEP for u, v in itertools.combinations(points, 2))
    for edge in drawn.edges:
        beside = [point for point in points if point not in (edge[:2], edge[2:])]
        assert all(distance(point, edge) > 1.2 * RADIUS for point in beside)


@given(random_trees(largest=40))
def test_parents_stand_below_the_middle_of_their_children(tree: Tree) -> None:
    (drawn,) = arrange(tree, None, False, None).drawn
    children: dict[tuple[float, float], list[float]] = {}
    for x, y, u, v in drawn.edges:
        assert y < v
        children.setdefault((u, v), []).append(x)
    assert all(math.isclose(u, (min(xs) + max(xs)) / 2) for (u, _), xs in children.items())


@pytest.mark.parametrize("columns", [1, 3, None, 100])
def test_trees_of_a_table_keep_apart_and_inside(columns: int | None) -> None:
    picture = arrange(TABLE, columns, True, None)
    boxes = []
    for drawn in picture.drawn:
        xs, ys, _ = zip(*drawn.nodes, strict=True)
        boxes.append((min(xs) - RADIUS, min(ys) - RADIUS, max(xs) + RADIUS, max(*ys, drawn.below[1])))
    assert all(
        left > 0 and top > 0 and right < picture.width and low < picture.height for left, top, right, low in boxes
    )
    for (left, top, right, low), (other_left, other_top, other_right, other_low) in itertools.combinations(boxes, 2):
        assert right < other_left or other_right < left or low < other_top or other_low < top
    roots = {drawn.nodes[0][1] for drawn in picture.drawn}
    assert len(roots) == math.ceil(len(TABLE) / (columns or 10))


def test_svg_holds_every_node_and_edge() -> None:
    picture = ElementTree.fromstring(svg(TABLE, labels=True))
    groups = picture.findall(f"{SVG}g")
    assert [group.findtext(f"{SVG}title") for group in groups] == [str(tree) for tree in TABLE]
    assert [group.findtext(f"{SVG}text") for group in groups] == [str(tree) for tree in TABLE]
    for group, tree in zip(groups, TABLE, strict=True):
        path = group.find(f"{SVG}path")
        assert len(group.findall(f"{SVG}circle")) == tree.order
        assert (0 if path is None else path.attrib["d"].count("M")) == tree.order - 1


def test_colors_of_nodes() -> None:
    picture = ElementTree.fromstring(svg(Tree.from_levels(range(11), range(11))))
    fills = [circle.attrib["fill"] for circle in picture.iter(f"{SVG}circle")]
    assert fills == [*PALETTE, *PALETTE[:2]]
    assert fills[:2] == ["#000000", "#ffffff"]
    assert len(set(PALETTE)) == 9


def test_a_picture_uses_one_set_of_names() -> None:
    def titles(**options) -> list[str | None]:
        picture = ElementTree.fromstring(svg([Tree("[τ]"), Tree("q[p]")], **options))
        return [title.text for title in picture.iter(f"{SVG}title")]

    assert titles() == ["p[p]", "q[p]"]
    assert titles(names=iter(["x", "y"])) == ["x[x]", "y[x]"]


def test_labels_are_escaped() -> None:
    labels = ["<script>&\"'", "two\nlines\x00", "Σ b_i"]
    picture = ElementTree.fromstring(svg(TABLE[:3], labels=labels))
    assert [text.text for text in picture.iter(f"{SVG}text")] == ["<script>&\"'", "two lines ", "Σ b_i"]


def test_a_notebook_shows_a_tree() -> None:
    tree = Tree("p[q,q[p]]")
    assert tree._repr_svg_() == svg(tree) == svg(iter([tree]))


def test_matplotlib_draws_the_same_picture() -> None:
    picture = arrange(TABLE, 4, True, None)
    axes = draw(TABLE, Figure().add_subplot(), columns=4, labels=True)
    lines, circles = axes.collections
    assert len(lines.get_paths()) == sum(tree.order - 1 for tree in TABLE)  # pyright: ignore[reportAttributeAccessIssue]
    assert circles.get_offsets().tolist() == [[x, y] for drawn in picture.drawn for x, y, _ in drawn.nodes]  # pyright: ignore[reportAttributeAccessIssue]
    assert [text.get_text() for text in axes.texts] == [str(tree) for tree in TABLE]


def test_matplotlib_makes_a_figure_of_the_size_of_the_picture(tmp_path) -> None:
    picture = arrange(TABLE, None, True, None)
    figure = draw(TABLE, labels=["$x_i$ is no mathematics"] * len(TABLE)).figure
    figure.savefig(tmp_path / "trees.png")
    assert figure.get_size_inches().tolist()[1] == pytest.approx(picture.height / 72)
    assert not pyplot.get_fignums()
    assert (tmp_path / "trees.png").stat().st_size > 1_000


def test_without_matplotlib_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.axes", None)
    with pytest.raises(ImportError, match=r"a plot needs matplotlib: pip install '\.\[plot\]' in the clone"):
        draw(Tree("τ"))


def endless() -> Iterator[Tree]:
    while True:
        yield Tree("τ")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"trees": []}, "trees must have at least one tree to draw, but have none"),
        ({"trees": endless()}, "trees must be at most 2000 in one picture, but are more"),
        ({"trees": [Tree("τ"), "τ"]}, "trees must be trees, but one was 'τ'"),
        ({"trees": "τ"}, "trees must be trees, but one was 'τ'"),
        ({"trees": 3}, "trees must be a tree or trees, but was 3"),
        ({"trees": Tree("[τ^1000]")}, "trees must have at most 1000 nodes in a picture, but one has 1001"),
        ({"trees": TABLE, "labels": ["one"]}, "labels must be one per tree, 17, but were 1"),
        ({"trees": TABLE, "labels": 3}, "labels must be True, False or strings, but were 3"),
        ({"trees": TABLE, "columns": 0}, "columns must be a whole number, 1 or more, but was 0"),
        ({"trees": TABLE, "columns": 2.5}, "columns must be a whole number, 1 or more, but was 2.5"),
        ({"trees": Tree("p[q]"), "names": ["p"]}, r"names must name the colours 0 to 1, but were \('p',\)"),
    ],
)
def test_what_cannot_be_drawn_is_refused(arguments: dict, sentence: str) -> None:
    for picture in (svg, draw):
        with pytest.raises(TreeError, match=sentence):
            picture(**arguments)


def test_tall_and_wide_trees_are_drawn() -> None:
    for tree in (Tree.from_levels(range(1_000)), Tree("[τ^999]"), Tree.from_levels([0] + [1, 2] * 499)):
        assert svg(tree).count("<circle") == tree.order
