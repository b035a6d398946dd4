"""Preorder sequences of trees as networkx graphs and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from trees.errors import TreeError
from trees.notation import parents_of

if TYPE_CHECKING:
    import networkx as nx


def to_networkx(levels: Sequence[int], colors: Sequence[int]) -> nx.DiGraph:
    """A tree as a directed graph.

    Args:
        levels: The level of each node in preorder.
        colors: The colour of each node.

    Returns:
        Nodes 0, 1, … in preorder, 0 the root, each with its attribute ``color``; edges from parent to child.

    Example:
        >>> list(to_networkx((0, 1, 1, 2), (0, 0, 0, 0)).edges)
        [(0, 1), (0, 2), (2, 3)]
    """
    import networkx as nx

    graph = nx.DiGraph()
    for node, parent in enumerate(parents_of(levels)):
        graph.add_node(node, color=colors[node])
        if node:
            graph.add_edge(parent, node)
    return graph


def from_networkx(graph: nx.Graph, root: Any = None) -> tuple[list[int], list[Any]]:
    """Levels and colours, in preorder, of the tree that a graph holds.

    Args:
        graph: A tree: directed, with edges from parent to child, or undirected. The attribute ``color`` of a node is
            its colour, 0 where it is missing.
        root: The root; needed if the graph is undirected, and otherwise the only node without a parent.

    Returns:
        Levels, and the colours as they are given.

    Raises:
        TreeError: If the graph is not a tree with this root.

    Example:
        >>> import networkx as nx
        >>> from_networkx(nx.path_graph(3), root=1)
        ([0, 1, 1], [0, 0, 0])
    """
    if not all(hasattr(graph, name) for name in ("is_directed", "adj", "nodes")):
        raise TreeError(f"graph must be a networkx graph, but was {graph!r:.60}")
    if graph.number_of_edges() != len(graph) - 1:
        raise TreeError(
            "graph must be a tree, with one edge fewer than nodes, "
            f"but has {len(graph)} nodes and {graph.number_of_edges()} edges"
        )
    root = _root(graph, root)
    levels, colors = [], []
    seen = {root}
    stack = [(0, root)]
    while stack:
        level, node = stack.pop()
        levels.append(level)
        colors.append(graph.nodes[node].get("color", 0))
        children = [neighbor for neighbor in graph.adj[node] if neighbor not in seen]
        seen.update(children)
        stack += [(level + 1, child) for child in children]
    if len(seen) < len(graph):
        missing = next(node for node in graph if node not in seen)
        raise TreeError(
            f"graph must be connected and without cycles, but node {missing!r:.60} is not reached from the root"
        )
    return levels, colors


def _root(graph: nx.Graph, root: Any) -> Any:
    """The root of a graph, given or found."""
    if root is not None:
        if root not in graph:
            raise TreeError(f"root must be a node of the graph, but was {root!r:.60}")
        return root
    if not graph.is_directed():
        raise TreeError("root must be given if the graph is undirected, but was None")
    parents = {child for node in graph for child in graph.adj[node]}
    roots = [node for node in graph if node not in parents]
    if len(roots) != 1:
        raise TreeError(f"graph must have one node without a parent, the root, but has {len(roots)}")
    return roots[0]
