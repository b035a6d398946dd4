from __future__ import annotations

import networkx as nx
import pytest
from hypothesis import given
from tree_oracles import random_trees

from trees.errors import TreeError
from trees.tree import Tree

pytestmark = pytest.mark.minimum


@given(random_trees(colors=3))
def test_graphs_are_read_back(tree: Tree) -> None:
    graph = tree.to_networkx()
    assert nx.is_arborescence(graph)
    assert list(graph) == list(nx.dfs_preorder_nodes(graph, 0)) == list(range(tree.order))
    assert tuple(color for _, color in graph.nodes.data("color")) == tree.colors
    assert tuple(nx.shortest_path_length(graph, 0)[node] for node in graph) == tree.levels
    assert Tree.from_networkx(graph) == Tree.from_networkx(graph, root=0) == tree
    assert Tree.from_networkx(graph.to_undirected(), root=0) == tree


def test_any_names_of_nodes_and_missing_colors() -> None:
    graph = nx.DiGraph([("c", "a"), ("c", "b"), ("b", "d")])
    graph.nodes["b"]["color"] = 1
    assert Tree.from_networkx(graph) == Tree("p[p,q[p]]")


def test_another_root_gives_another_tree() -> None:
    path = nx.path_graph(4)
    assert (Tree.from_networkx(path, 0), Tree.from_networkx(path, 1)) == (Tree("[[[τ]]]"), Tree("[τ,[τ]]"))


@pytest.mark.parametrize(
    ("graph", "root", "sentence"),
    [
        (nx.DiGraph(), None, "graph must be a tree, with one edge fewer than nodes, but has 0 nodes and 0 edges"),
        (nx.cycle_graph(3), 0, "but has 3 nodes and 3 edges"),
        (nx.empty_graph(2), 0, "but has 2 nodes and 0 edges"),
        (nx.MultiDiGraph([(0, 1), (0, 1)]), 0, "but has 2 nodes and 2 edges"),
        (nx.path_graph(2), None, "root must be given if the graph is undirected, but was None"),
        (nx.path_graph(2), 5, "root must be a node of the graph, but was 5"),
        (nx.path_graph(2), [], r"root must be a node of the graph, but was \[\]"),
        (nx.DiGraph([(0, 2), (1, 2)]), None, "graph must have one node without a parent, the root, but has 2"),
        (nx.DiGraph([(0, 1), (1, 2)]), 1, "node 0 is not reached from the root"),
        (nx.DiGraph([(0, 1), (2, 2)]), None, "node 2 is not reached from the root"),
        (nx.Graph([(0, 1), (2, 3), (3, 4), (4, 2)]), 0, "node 2 is not reached from the root"),
        ({0: [1]}, None, r"graph must be a networkx graph, but was \{0: \[1\]\}"),
        (None, None, "graph must be a networkx graph, but was None"),
    ],
)
def test_what_is_no_tree_is_refused(graph, root, sentence: str) -> None:
    with pytest.raises(TreeError, match=sentence):
        Tree.from_networkx(graph, root)


@pytest.mark.parametrize("color", [-1, "red", None, 0.5])
def test_wrong_colors_are_refused(color: object) -> None:
    graph = nx.DiGraph([(0, 1)])
    graph.nodes[1]["color"] = color
    with pytest.raises(TreeError, match="each of colors must be a whole number, 0 to 9999, but was"):
        Tree.from_networkx(graph)
