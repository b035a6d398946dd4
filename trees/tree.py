"""Coloured rooted trees as immutable values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from functools import total_ordering
from itertools import groupby
from math import factorial, prod
from operator import index
from typing import TYPE_CHECKING, Any

from bseries_base.numbers import latex_number
from trees.drawing import draw, svg
from trees.errors import TreeError
from trees.formulas import elementary_differential, elementary_weight, is_latex
from trees.notation import MAX_ORDER, parents_of, parse, tree_text

if TYPE_CHECKING:
    import networkx as nx
    from matplotlib.axes import Axes


@total_ordering
class Tree:
    """A rooted tree whose nodes have colours 0, 1, …; trees of one colour are those of the textbooks.

    Trees that differ only in the order of siblings are equal. Trees are ordered by number of nodes, colour of the root,
    `left` and `right`, as in a `TreeTable`; children are sorted in ascending order. A tree has at most 10,000 nodes; no
    operation is recursive.

    Args:
        text: The tree in any notation: ``[τ,[τ]]``, ``[[t]t]``, ``[τ^3]``, ``p[q,q[p]]``, the levels of its nodes
            ``[0,1,2,1]``, or levels and colours ``[0,1,1]:[0,1,1]``. A `Tree` is returned as it is.
        names: The names of the colours in the text; None for p and q if it has no others, and for a, b, c, … otherwise.

    Raises:
        TreeError: If the text is not one tree; the message gives the position.

    Example:
        >>> import bseries as bs
        >>> tree = bs.Tree("[[τ]τ]")
        >>> tree, tree.order, tree.symmetry, tree.density
        (Tree('[τ,[τ]]'), 4, 1, 8)
        >>> tree.left, tree.right
        (Tree('[τ]'), Tree('[τ]'))

    References:
        Hairer, Lubich, Wanner: Geometric Numerical Integration (2006), section III.1, doi:10.1007/3-540-30666-8.
        Butcher: Numerical Methods for Ordinary Differential Equations (2016), chapter 3, doi:10.1002/9781119121534.
    """

    __slots__ = ("_children", "_color", "_hash", "_order", "_shape")

    _children: tuple[Tree, ...]
    _color: int
    _hash: int
    _order: int
    _shape: tuple[tuple[int, ...], tuple[int, ...]]

    def __new__(cls, text: str | Tree, *, names: Iterable[str] | None = None) -> Tree:
        """Parse the text."""
        if isinstance(text, Tree):
            return text
        if not isinstance(text, str):
            raise TreeError(f"text must be a string such as '[τ,[τ]]', but was {text!r:.60}")
        return Tree.from_levels(*parse(text, names))

    @staticmethod
    def from_sorted(color: int, children: tuple[Tree, ...]) -> Tree:
        """The tree with these children, which must ascend and have fewer than `MAX_ORDER` nodes (not checked)."""
        tree = object.__new__(Tree)
        tree._color = color
        tree._children = children
        order = 1
        for child in children:
            order += child._order
        tree._order = order
        tree._hash = hash((color, children))
        return tree

    @staticmethod
    def join(children: Iterable[Tree], color: int = 0) -> Tree:
        """The tree with a new root and these children, B₊.

        Args:
            children: The children of the root, in any order.
            color: The colour of the root.

        Raises:
            TreeError: If a child is not a tree, the colour is not 0, 1, …, or there are too many nodes.

        Example:
            >>> import bseries as bs
            >>> bs.Tree.join([bs.Tree("[τ]"), bs.Tree("τ")])
            Tree('[τ,[τ]]')
        """
        members = list(children)
        for child in members:
            if not isinstance(child, Tree):
                raise TreeError(f"children must be trees, but one was {child!r:.60}")
        order = 1 + sum(child._order for child in members)
        if order > MAX_ORDER:
            raise TreeError(f"children must have fewer than {MAX_ORDER} nodes together, but have {order - 1}")
        return Tree.from_sorted(_integer("color", color), tuple(sorted(members)))

    @staticmethod
    def from_levels(levels: Iterable[int], colors: Iterable[int] | None = None) -> Tree:
        """The tree with these levels and colours of its nodes, in preorder.

        Args:
            levels: The distance of each node from the root: 0 for the root, then at most 1 more than the entry before.
            colors: The colour of each node; all 0 if None.

        Raises:
            TreeError: If these are not the levels and colours of one tree.

        Example:
            >>> import bseries as bs
            >>> bs.Tree.from_levels([0, 1, 2, 1])
            Tree('[τ,[τ]]')
        """
        depths = _integers("levels", levels)
        node_colors = [0] * len(depths) if colors is None else _integers("colors", colors)
        _check_levels(depths, node_colors)
        subtrees: list[list[Tree]] = [[] for _ in range(max(depths) + 2)]  # by level: subtrees without a parent so far
        for level, color in zip(reversed(depths), reversed(node_colors), strict=True):
            children = subtrees[level + 1]
            children.sort()
            subtrees[level].append(Tree.from_sorted(color, tuple(children)))
            children.clear()
        return subtrees[0][0]

    @staticmethod
    def from_networkx(graph: nx.Graph, root: Any = None) -> Tree:
        """The tree given by a networkx graph.

        Args:
            graph: A tree: directed, with edges from parent to child, or undirected. The attribute ``color`` of a node
                is its colour, by default 0.
            root: The root; needed if the graph is undirected, and otherwise the only node without a parent.

        Raises:
            TreeError: If the graph is not a tree with this root, or a colour is not 0, 1, ….

        Example:
            >>> import bseries as bs
            >>> import networkx as nx
            >>> bs.Tree.from_networkx(nx.path_graph(3), root=1)
            Tree('[τ,τ]')
        """
        if not all(hasattr(graph, name) for name in ("is_directed", "adj", "nodes")):
            raise TreeError(f"graph must be a networkx graph, but was {graph!r:.60}")
        if graph.number_of_edges() != len(graph) - 1:
            raise TreeError(
                "graph must be a tree, with one edge fewer than nodes, "
                f"but has {len(graph)} nodes and {graph.number_of_edges()} edges"
            )
        import networkx as nx

        root = _root(graph, root)
        depths = nx.single_source_shortest_path_length(graph, root)
        for node in graph:
            if node not in depths:
                raise TreeError(
                    f"graph must be connected and without cycles, but node {node!r:.60} is not reached from the root"
                )
        preorder = list(nx.dfs_preorder_nodes(graph, root))
        colors = (graph.nodes[node].get("color", 0) for node in preorder)
        return Tree.from_levels((depths[node] for node in preorder), colors)

    def to_networkx(self) -> nx.DiGraph:
        """The tree as a directed graph with the attribute ``color`` of nodes 0, 1, … in preorder.

        Example:
            >>> import bseries as bs
            >>> list(bs.Tree("[τ,[τ]]").to_networkx().edges)
            [(0, 1), (0, 2), (2, 3)]
        """
        import networkx as nx

        graph = nx.DiGraph()
        for node, (parent, color) in enumerate(zip(parents_of(self.levels), self.colors, strict=True)):
            graph.add_node(node, color=color)
            if node:
                graph.add_edge(parent, node)
        return graph

    @property
    def color(self) -> int:
        """The colour of the root."""
        return self._color

    @property
    def children(self) -> tuple[Tree, ...]:
        """The subtrees of the root, ascending."""
        return self._children

    @property
    def order(self) -> int:
        """The number of nodes, |τ|."""
        return self._order

    @property
    def left(self) -> Tree | None:
        """The tree without `right`: every tree of two or more nodes is uniquely ``left.butcher_product(right)``."""
        return Tree.from_sorted(self._color, self._children[:-1]) if self._children else None

    @property
    def right(self) -> Tree | None:
        """The largest child; None for a single node."""
        return self._children[-1] if self._children else None

    def preorder(self) -> Iterator[tuple[int, Tree]]:
        """The level and subtree of each node, in preorder.

        Example:
            >>> import bseries as bs
            >>> list(bs.Tree("[τ,[τ]]").preorder())[2:]
            [(1, Tree('[τ]')), (2, Tree('τ'))]
        """
        stack: list[tuple[int, Tree]] = [(0, self)]
        while stack:
            level, tree = stack.pop()
            yield level, tree
            stack.extend([(level + 1, child) for child in reversed(tree._children)])

    @property
    def levels(self) -> tuple[int, ...]:
        """The distance of each node from the root, in preorder."""
        return self._levels_and_colors[0]

    @property
    def colors(self) -> tuple[int, ...]:
        """The colour of each node, in preorder."""
        return self._levels_and_colors[1]

    @property
    def _levels_and_colors(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Levels and colours, computed at most once."""
        if not hasattr(self, "_shape"):
            levels, colors, stack = [], [], [(0, self)]
            while stack:
                level, tree = stack.pop()
                if hasattr(tree, "_shape"):  # as the trees of a table, which share their subtrees
                    levels += [level + below for below in tree._shape[0]]
                    colors += tree._shape[1]
                else:
                    levels.append(level)
                    colors.append(tree._color)
                    stack += [(level + 1, child) for child in reversed(tree._children)]
            self._shape = tuple(levels), tuple(colors)
        return self._shape

    @property
    def height(self) -> int:
        """The number of edges from the root to the farthest node."""
        return max(self.levels)

    @property
    def symmetry(self) -> int:
        """The symmetry coefficient σ(τ), the number of permutations of siblings that leave the tree unchanged."""
        return prod(factorial(len(list(equal))) for _, tree in self.preorder() for _, equal in groupby(tree._children))

    @property
    def density(self) -> int:
        """The density γ(τ), the product of the orders of all subtrees; the exact flow has the coefficients 1/γ."""
        return prod(tree._order for _, tree in self.preorder())

    @property
    def alpha(self) -> int:
        """Butcher's α = n!/(σγ), the number of monotonic labellings, which increase away from the root."""
        return factorial(self._order) // (self.symmetry * self.density)

    @property
    def beta(self) -> int:
        """Butcher's β = n!/σ = αγ, the number of labellings."""
        return factorial(self._order) // self.symmetry

    def butcher_product(self, other: Tree) -> Tree:
        """The Butcher product τ∘θ, neither commutative nor associative: `other` becomes one more child of the root.

        Args:
            other: The tree θ.

        Raises:
            TreeError: If `other` is not a tree, or there are too many nodes.

        Example:
            >>> import bseries as bs
            >>> bs.Tree("[[τ]]").butcher_product(bs.Tree("τ"))
            Tree('[τ,[τ]]')
        """
        return Tree.join((*self._children, other), self._color)

    def text(self, names: Iterable[str] | None = None) -> str:
        """The tree in bracket notation, unique for each tree; `Tree` reads it back.

        Args:
            names: One name per colour; None for the default names (none, p and q, or a, b, c, …).

        Raises:
            TreeError: If a name is invalid or a colour has none.

        Example:
            >>> import bseries as bs
            >>> bs.Tree("p[q,q[p]]").text(names=["fast", "slow"])
            'fast[slow,slow[fast]]'
        """
        return tree_text(self.levels, self.colors, names)

    def differential(self, format: str = "text", names: Iterable[str] | None = None) -> str:
        """The elementary differential F([τ1, …, τm]) = f^(m)(F(τ1), …, F(τm)).

        Args:
            format: ``"text"`` or ``"latex"``.
            names: As for `text`.

        Example:
            >>> import bseries as bs
            >>> bs.Tree("[τ,[τ]]").differential(), bs.Tree("[τ^4]").differential()
            ("f''(f,f'(f))", 'f^(4)(f,f,f,f)')
            >>> bs.Tree("p[q,q[p]]").differential("latex")
            "f_{p}''(f_{q},f_{q}'(f_{p}))"

        References:
            HLW, section III.1 and Table III.1.1; coloured, section III.2.
        """
        return elementary_differential(self.levels, self.colors, format, names)

    def weight(self, format: str = "text", names: Iterable[str] | None = None) -> str:
        """The elementary weight of a Runge–Kutta method; the arguments are those of `differential`.

        It is a sum with factors b for the root, a for inner edges and c for edges to leaves, over all indices: i, j,
        k, …, or i1, i2, … if there are not enough letters.

        Example:
            >>> import bseries as bs
            >>> bs.Tree("[τ,τ,[τ]]").weight(), bs.Tree("p[p,q[p,p]]").weight()
            ('Σ b_i c_i^2 a_ij c_j', 'Σ b^p_i c^p_i a^q_ij (c^p_j)^2')
            >>> print(bs.Tree("[[τ]]").weight("latex"))
            \\sum_{i,j} b_{i} a_{ij} c_{j}

        References:
            HLW, Table III.1.1 and section III.2.
        """
        return elementary_weight(self.levels, self.colors, format, names)

    def condition(self, format: str = "text", names: Iterable[str] | None = None) -> str:
        """The order condition of a Runge–Kutta method, elementary weight = 1/γ; see `weight`.

        Example:
            >>> import bseries as bs
            >>> bs.Tree("[τ,τ]").condition(), bs.Tree("τ").condition()
            ('Σ b_i c_i^2 = 1/3', 'Σ b_i = 1')
        """
        density = self.density
        if density.bit_length() > 9_966:  # Python does not print numbers of more than 4300 digits
            bits = density.bit_length()
            raise TreeError(f"tree must have a density of at most 3000 digits, but has one of {bits} bits")
        quotient = Fraction(1, density)
        return f"{self.weight(format, names)} = {latex_number(quotient) if is_latex(format) else quotient}"

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        return f"Tree('{self.text()}')"

    def _repr_svg_(self) -> str:
        return svg(self)

    def plot(self, ax: Axes | None = None, names: Iterable[str] | None = None) -> Axes:
        """The picture of the tree, with the root at the bottom; arguments and errors are those of `draw`.

        Example:
            >>> import bseries as bs
            >>> bs.Tree("[τ,[τ]]").plot().figure.savefig("/dev/null", format="pdf")
        """
        return draw(self, ax, names=names)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Tree):
            return NotImplemented
        return self is other or (self._hash == other._hash and _compare(self, other) == 0)

    def __lt__(self, other: Tree) -> bool:
        return _compare(self, other) < 0 if isinstance(other, Tree) else NotImplemented

    def __reduce__(self) -> tuple[Any, ...]:
        return Tree.from_levels, (self.levels, self.colors)  # pickle is recursive


def _compare(first: Tree, second: Tree) -> int:
    """Negative, zero or positive if the first tree is smaller than, equal to or larger than the second.

    Of two trees with equal order and colour, the one whose `right` has more nodes has the smaller `left`. So the orders
    of the children are compared from the last child on, and the larger order gives the smaller tree. If all orders are
    equal, the children themselves are compared from the first on.
    """
    pairs = [(first, second)]
    while pairs:
        u, v = pairs.pop()
        if u is v:
            continue
        if u._order != v._order:
            return u._order - v._order
        if u._color != v._color:
            return u._color - v._color
        children = list(zip(reversed(u._children), reversed(v._children), strict=False))
        for a, b in children:
            if a._order != b._order:
                return b._order - a._order
        pairs += children
    return 0


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


def _integers(argument: str, values: Iterable[int]) -> list[int]:
    if not hasattr(values, "__iter__"):
        raise TreeError(f"{argument} must be a sequence of whole numbers, but was {values!r:.60}")
    return [_integer(f"each of {argument}", value) for value in values]


def _integer(argument: str, value: int) -> int:
    """A level or a colour as an int; integers of NumPy are accepted."""
    try:
        number = index(value)
    except TypeError:
        number = -1
    if not 0 <= number < MAX_ORDER:
        raise TreeError(f"{argument} must be a whole number, 0 to {MAX_ORDER - 1}, but was {value!r:.60}")
    return number


def _check_levels(levels: Sequence[int], colors: Sequence[int]) -> None:
    if not levels or levels[0] != 0:
        raise TreeError(f"levels must start with 0, the root, but were {levels!r:.60}")
    if len(levels) > MAX_ORDER:
        raise TreeError(f"levels must have at most {MAX_ORDER} entries, but have {len(levels)}")
    if len(colors) != len(levels):
        raise TreeError(f"colors must be as many as levels, {len(levels)}, but were {len(colors)}")
    for position in range(1, len(levels)):
        before, level = levels[position - 1 : position + 1]
        if level == 0:
            raise TreeError(f"levels must have one root, but entry {position + 1} is 0 again: {levels!r:.60}")
        if level > before + 1:
            raise TreeError(
                f"levels must rise by 1 at a time, but entry {position + 1} is {level} after {before}: {levels!r:.60}"
            )
