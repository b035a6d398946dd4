"""Tables of all trees up to an order, as columns of numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property, lru_cache
from itertools import accumulate
from math import factorial
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries_base.child_bounds import GivenBounds
from bseries_base.table import Column, LazyRows, Table, listed
from trees import counting, kernels
from trees.basis import Basis, Cuts, Growth
from trees.counting import Limits, normal_limits
from trees.drawing import MAX_TREES, draw, svg
from trees.errors import TreeError
from trees.notation import default_names
from trees.tree import Tree

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes


KEPT_SPLITS = 2**26
"""If the top order has more splits, they are made in chunks and not kept."""
CHUNK = 2**16


class _Splits(NamedTuple):
    """Cuts (trunk, branch) of the first trees; those of a tree with n nodes begin at start[n] + tree·(n−1)."""

    last: int
    start: Any
    trunk: Any
    branch: Any


class Columns(NamedTuple):
    """The columns for kernels: arrays if the table is compiled, else lists. Of every tree, those of `TreeTable`."""

    block: Any  # the first id, by number of nodes and root colour
    order: Any
    color: Any
    left: Any
    right: Any
    base_start: Any  # the start of `base`, by number of nodes
    base: Any  # the start of the Butcher products, by tree and block of the right factor


class Nodes(NamedTuple):
    """The columns of all trees, as arrays or as lists."""

    order: Any
    color: Any
    left: Any
    right: Any


class TreeTable(Basis[Tree]):
    """Every rooted tree with 1 … `order` nodes in `colors` colours, sorted and numbered.

    The id of a tree is its index in the order by (number of nodes, root colour, left, right), where
    tree = left ∘ right, right is the child with the largest id and left the rest. The table is a sequence of `Tree`s;
    its columns are arrays over the ids.

    Args:
        order: Largest number of nodes.
        colors: Number of colours K.
        max_children: Restriction to some trees: None for all; one number bounds the children of every node; K rows of
            K bounds limit the children of each colour of a node of each colour (None: unbounded), with an optional
            entry K for the total. Both parts of a split of a tree in such a table belong to it.

    Raises:
        TreeError: An argument is out of range, or the table would not fit in memory (refused before any work).

    Example:
        >>> import bseries as bs
        >>> table = bs.TreeTable(4)
        >>> len(table), str(table[5]), table.index("[τ,[τ]]")
        (8, '[[τ,τ]]', 6)
        >>> table.density.tolist()
        [1, 2, 6, 3, 24, 12, 8, 4]
        >>> separable = bs.TreeTable(8, colors=2, max_children=[[0, None], [None, 0]])
        >>> len(separable), len(bs.TreeTable(8, colors=2))
        (400, 24314)

    References:
        J. C. Butcher, *Numerical Methods for Ordinary Differential Equations*, 3rd ed., section 300 (β-product).
        E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, 2nd ed., section III.1.
    """

    what = "trees"
    growth = Growth(
        branches=lambda n, k: (n - 1) // k,  # the branches of one order are disjoint
        cuts=lambda n: n - 1,
        products=lambda n: 2**n,  # ordered subtrees
    )

    def __init__(self, order: int, colors: int = 1, max_children: GivenBounds = None):
        self.max_order, self.colors = counting.check_size(order, colors)
        self.limits: Limits = normal_limits(self.colors, max_children)
        self._counts = _counts_within_memory(self.max_order, self.limits)
        self.sizes = [sum(row) for row in self._counts[1:]]
        self._trees: dict[int, Tree] = {}
        self._enumerate()

    def _enumerate(self) -> None:
        """Allocate and fill the columns, as Python lists if not for compiled kernels."""
        order, colors = self.max_order, self.colors
        self.block = [0]
        for row in self._counts[1:]:
            for count in row:
                self.block.append(self.block[-1] + count)
        size = self.block[-1]
        per_order = [sum(row) for row in self._counts]
        base_start = [0, 0]
        for n in range(1, order):
            base_start.append(base_start[-1] + per_order[n] * (order - n) * colors)
        limits = [bound for row in self.limits for bound in row]
        self.columns = Columns(
            self.column(self.block), self.column(size), self.column(size), self.column(size, "int32"),
            self.column(size, "int32"), self.column(base_start), self.column(base_start[-1], "int32"),
        )  # fmt: skip
        self.run(kernels.enumerate_trees)(
            order, colors, self.column(limits), self.column(colors + 1, "int64"), *self.columns
        )
        self._complete = True

    def __reduce__(self) -> tuple[Any, ...]:
        return TreeTable, (self.max_order, self.colors, self.limits)

    def run(self, kernel: Any) -> Any:
        """The implementation of a kernel for the columns of this table."""
        return kernel.compiled if self.compiled else kernel.py_func

    def element(self, at: int) -> Tree:
        """The tree with an id."""
        tree = self._trees.get(at)
        if tree is None:
            color, left = int(self.columns.color[at]), int(self.columns.left[at])
            if left < 0:
                children = ()
            else:
                children = (*self.element(left).children, self.element(int(self.columns.right[at])))
            tree = self._trees[at] = Tree.from_sorted(color, children)
        return tree

    def find(self, element: object) -> int:
        """Id of a tree; negative if outside the table."""
        if not isinstance(element, Tree):
            return kernels.OUTSIDE
        tree = element
        if tree.order > self.max_order or tree.color >= self.colors:
            return kernels.OUTSIDE
        _, order, color, _, _, base_start, base = self.columns
        at = tree.color
        for child in tree.children:
            v = self.find(child)
            if v < 0:
                return v
            at = kernels.product.py_func(at, v, self.max_order, self.colors, self.block, order, color, base_start, base)
            if at < 0:
                return at
        return at

    def letters(self, element: Tree) -> tuple[int, ...]:
        """The colours of the nodes of a tree."""
        return element.colors

    def read(self, text: str, names: Sequence[str] | None = None) -> Tree:
        """The tree that a text stands for."""
        return Tree(text, names=names)

    def text(self, element: Tree, names: Sequence[str] | None = None) -> str:
        """The text of a tree."""
        return element.text(names)

    def latex(self, element: Tree, names: Sequence[str] | None = None) -> str:
        """The elementary differential of a tree in LaTeX."""
        return element.differential("latex", names)

    @property
    def restriction(self) -> dict[str, Any]:
        """The bounds on children."""
        return {"max_children": self.max_children}

    def truncated(self, order: int) -> TreeTable:
        """The table of the trees with at most `order` nodes."""
        return tree_table(order, self.colors, self.limits)

    @property
    def _key(self) -> tuple[int, Limits]:
        return self.max_order, self.limits

    @property
    def max_children(self) -> list[list[int | None]] | None:
        """The restriction, as the argument of that name; None if there is none."""
        if self.limits == normal_limits(self.colors, None):
            return None
        return [[None if bound == counting.UNBOUNDED else bound for bound in row] for row in self.limits]

    def __repr__(self) -> str:
        restricted = "" if self.max_children is None else f", max_children={self.max_children}"
        return f"TreeTable({self.max_order}, colors={self.colors}{restricted})"

    def to_table(self) -> Table:
        """The trees with their numbers and formulas.

        Example:
            >>> import bseries as bs
            >>> print(bs.TreeTable(2).to_table().to_text())
            2 rooted trees with at most 2 nodes
            <BLANKLINE>
            id  |τ|  tree τ  σ  γ  α  differential  elementary weight
            ──  ───  ──────  ─  ─  ─  ────────────  ─────────────────
             0    1  τ       1  1  1  f             Σ b_i
            <BLANKLINE>
             1    2  [τ]     1  2  1  f'(f)         Σ b_i c_i
            <BLANKLINE>
            σ: symmetry; γ: density, the exact flow has 1/γ; α = |τ|!/(σγ): number of monotonic labellings.
        """
        colors = default_names(self.colors)
        names = colors if len(colors) > 1 else None

        def latex(formula: str) -> Any:
            return lambda row: f"${getattr(row[1], formula)('latex', names)}$"

        fields = {
            "id": itemgetter(0),
            "tree": lambda row: row[1].text(names),
            "levels": lambda row: list(row[1].levels),
            "colors": lambda row: list(row[1].colors),
            "order": lambda row: row[1].order,
            "symmetry": lambda row: row[1].symmetry,
            "density": lambda row: row[1].density,
            "alpha": lambda row: row[1].alpha,
            "differential": lambda row: row[1].differential(names=names),
            "weight": lambda row: row[1].weight(names=names),
        }
        columns = (
            Column("id", True, fields["id"]),
            Column("|τ|", True, fields["order"]),
            Column("tree τ", get=fields["tree"], latex=lambda row: f"${fields['tree'](row)}$".replace("τ", r"\tau ")),
            Column("σ", True, fields["symmetry"]),
            Column("γ", True, fields["density"]),
            Column("α", True, fields["alpha"]),
            Column("differential", get=fields["differential"], latex=latex("differential")),
            Column("elementary weight", get=fields["weight"], latex=latex("weight")),
        )
        rows: LazyRows = LazyRows(lambda: enumerate(self), len(self))

        def data() -> dict[str, Any]:
            records = [{name: get(row) for name, get in fields.items()} for row in rows]
            return {"schema": 1, "kind": "trees", "order": self.max_order, "colors": list(colors), "trees": records}

        return Table(
            f"{len(self)} rooted trees with at most {self.max_order} nodes",
            columns,
            rows,
            ["σ: symmetry; γ: density, the exact flow has 1/γ; α = |τ|!/(σγ): number of monotonic labellings."],
            data=data,
            items="trees",
            section=fields["order"],
            records=listed(fields.items(), rows),
        )

    def _repr_svg_(self) -> str | None:
        return svg(self) if len(self) <= MAX_TREES else None

    def plot(self, ax: Axes | None = None, *, columns: int | None = None, labels: bool = True) -> Axes:
        """The picture of all trees, in the order of their ids; arguments and errors are those of `draw`.

        Example:
            >>> import bseries as bs
            >>> [text.get_text() for text in bs.TreeTable(3).plot().texts]
            ['τ', '[τ]', '[[τ]]', '[τ,τ]']
        """
        return draw(self, ax, columns, labels)

    @cached_property
    def order(self) -> np.ndarray:
        """Number of nodes of every tree."""
        return self._public(self.columns.order, "int8")

    @cached_property
    def color(self) -> np.ndarray:
        """Root colour of every tree."""
        return self._public(self.columns.color, "int8")

    @cached_property
    def left(self) -> np.ndarray:
        """Id of every tree without its largest child; −1 for single nodes."""
        return self._public(self.columns.left, "int32")

    @cached_property
    def right(self) -> np.ndarray:
        """Id of the largest child of every tree; −1 for single nodes."""
        return self._public(self.columns.right, "int32")

    @cached_property
    def arrays(self) -> Nodes:
        """Order, colour, left and right as unsigned arrays, which kernels index without testing the sign."""
        columns = (self.order, self.color, self.left, self.right)
        return Nodes(*(column.view(f"u{column.itemsize}") for column in columns))

    @cached_property
    def lists(self) -> Nodes:
        """Order, colour, left and right as lists, for kernels in the interpreter."""
        columns = self.columns[1:5]
        return Nodes(*(x if isinstance(x, list) else x.tolist() for x in columns))

    @property
    def orders(self) -> list[int]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Number of nodes of every tree, as a list."""
        return self.lists.order

    @property
    def symmetries(self) -> list[int]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Symmetry coefficient σ of every tree, as a list."""
        column = self.symmetry_and_density[0]
        return column if isinstance(column, list) else column.tolist()

    @property
    def exact_flow(self) -> list[int]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """n!/γ for every tree with n nodes, as a list."""
        column, labellings = self.symmetry_and_density[1], [factorial(n) for n in range(self.max_order + 1)]
        density = column if isinstance(column, list) else column.tolist()
        return [labellings[n] // gamma for n, gamma in zip(self.orders, density, strict=True)]

    @property
    def symmetry(self) -> np.ndarray:
        """Symmetry coefficient σ of every tree (Python integers beyond order 20, where int64 overflows)."""
        return self._public(self.symmetry_and_density[0], "int64" if self.max_order <= 20 else "object")

    @property
    def density(self) -> np.ndarray:
        """Density γ of every tree (Python integers beyond order 20, where int64 overflows)."""
        return self._public(self.symmetry_and_density[1], "int64" if self.max_order <= 20 else "object")

    @staticmethod
    def _public(column: Any, dtype: str) -> np.ndarray:
        import numpy as np

        view = np.asarray(column, dtype).view()
        view.flags.writeable = False
        return view

    @cached_property
    def symmetry_and_density(self) -> tuple[Any, Any]:
        """The columns σ and γ: arrays if the table is compiled and they fit in int64, else lists."""
        if self.compiled and self.max_order <= 20:
            run, (order, _, left, right) = kernels.symmetry_and_density.compiled, self.columns[1:5]
            symmetry, density, multiplicity = (self.column(len(self), dtype) for dtype in ("int64", "int64", "int8"))
        else:
            run, (order, _, left, right) = kernels.symmetry_and_density.py_func, self.lists
            symmetry, density, multiplicity = ([0] * len(self) for _ in range(3))
        run(len(self), order, left, right, symmetry, density, multiplicity)
        return symmetry, density

    def rows(self, at: int) -> list[tuple[int, int, int]]:
        """The cuts of a tree, one for each of its edges."""
        tree = self.element(at)
        n, chunk = tree.order, next(chunk for chunk in self.cut_chunks() if at < chunk.last)
        first = int(chunk.start[at - chunk.first])
        return [(int(chunk.trunk[k]), int(chunk.branch[k]), 1) for k in range(first, first + n - 1)]

    @cached_property
    def _splits(self) -> _Splits:
        """The cuts of all trees, without the top order if it has too many."""
        sizes = self.sizes
        needed = counting.memory_estimate(sizes, self.colors, splits=True)
        counting.refuse_table_beyond_memory(needed, f"the splits of {len(self)} trees")
        keep = self.max_order
        if sizes[-1] * (self.max_order - 1) > KEPT_SPLITS:
            keep -= 1
        start, begin = [0, 0], 0
        for n in range(2, self.max_order + 1):
            start.append(begin - self.ids(n).start * (n - 1))
            begin += sizes[n - 1] * (n - 1) if n <= keep else 0
        starts = self.column(start)
        trunk, branch = self.column(begin, "uint32"), self.column(begin, "uint32")
        splits = _Splits(self.ids(keep).stop, starts, trunk, branch)
        for n in range(2, keep + 1):
            self._split(self.ids(n).start, self.ids(n).stop, splits, splits)
        return splits

    def _split(self, first: int, last: int, known: _Splits, into: _Splits) -> None:
        self.run(kernels.split_trees)(
            first, last, self.max_order, self.colors, *self.columns, known.start, known.trunk, known.branch,
            into.start, into.trunk, into.branch, self.column(self.max_order, "int32"),
        )  # fmt: skip

    def cut_chunks(self) -> Iterator[Cuts]:
        """The cuts of all trees, ids ascending: first the kept ones, then the others in chunks.

        Cutting one edge of a tree gives trunk and branch: a tree with n nodes has n−1 cuts, with repetitions.
        """
        kept, n = self._splits, self.max_order
        yield Cuts(0, kept.last, self._kept_starts, kept.trunk, kept.branch)
        for first in range(kept.last, len(self), CHUNK):
            last = min(first + CHUNK, len(self))
            start = kept.start.copy()
            start[n] = -first * (n - 1)
            size = (last - first) * (n - 1)
            chunk = _Splits(last, start, self.column(size, "uint32"), self.column(size, "uint32"))
            self._split(first, last, kept, chunk)
            yield Cuts(first, last, self._starts(first, last), chunk.trunk, chunk.branch)

    @cached_property
    def _kept_starts(self) -> Any:
        return self._starts(0, self._splits.last)

    def _starts(self, first: int, last: int) -> Any:
        """Where the rows of the trees first … last−1 begin, and where the last of them end."""
        if not self.compiled:
            return [0, *accumulate(n - 1 for n in self.orders[first:last])]
        import numpy as np

        starts = np.zeros(last - first + 1, np.int64)
        np.cumsum(self.order[first:last] - 1, out=starts[1:])
        return starts


def _counts_within_memory(order: int, limits: Limits) -> tuple[tuple[int, ...], ...]:
    """The counts of a table, which is refused if it would not fit in memory."""
    what = f"a table of trees with {order} nodes in {len(limits)} colours"
    # Growth is geometric, so the first order that does not fit decides.
    for n in sorted({min(order, 10), min(order, 16), min(order, 24), min(order, 40), order}):
        counts = counting.count_by_color(n, limits)
        sizes = [sum(row) for row in counts[1:]]
        if sum(sizes) >= 2**31:
            raise TreeError(f"order must be smaller: {what} would hold more than 2^31 trees")
        counting.refuse_table_beyond_memory(counting.memory_estimate(sizes, len(limits)), what)
    return counting.count_by_color(order, limits)


@lru_cache(maxsize=16)
def kept_table(order: int, limits: Limits) -> TreeTable | None:
    """The table, if it is small; the last ones are kept."""
    small = sum(map(sum, _counts_within_memory(order, limits))) <= 1_000_000
    return TreeTable(order, len(limits), limits) if small else None


def tree_table(order: int, colors: int = 1, max_children: GivenBounds = None) -> TreeTable:
    """The table for these arguments; tables of up to a million trees are cached."""
    order, colors = counting.check_size(order, colors)
    limits = normal_limits(colors, max_children)
    return kept_table(order, limits) or TreeTable(order, colors, limits)


class Partitions(NamedTuple):
    """All partitions of the trees of a table; the 2^(n−1) of a tree with n nodes begin at start[n] + tree·2^(n−1)."""

    start: Any
    skeleton: Any  # id of the tree with every part contracted to a node
    part: Any  # id of the part that contains the root
    kept: int  # the number of partitions of trees below the largest order


@lru_cache(maxsize=4)
def partitions_of(table: TreeTable) -> Partitions:
    """The partitions of all trees of a table, cached for the last four tables.

    P. Chartier, E. Hairer, G. Vilmart, *Algebraic structures of B-series*, Found. Comput. Math. 10 (2010), §3.2,
    doi:10.1007/s10208-010-9065-1.
    """
    if table.limits != normal_limits(table.colors, None):
        raise TreeError(f"table must hold all trees, since skeletons have any number of children, but was {table!r}")
    sizes = table.sizes
    total = sum(size << n for n, size in enumerate(sizes))
    counting.refuse_table_beyond_memory(24 * total, f"a list of {total} partitions")
    start, begin = [0], 0
    for n in range(1, table.max_order + 1):
        start.append(begin - (table.ids(n).start << (n - 1)))
        begin += sizes[n - 1] << (n - 1)
    starts, skeleton, part = table.column(start), table.column(total, "uint32"), table.column(total, "uint32")
    stack = table.column(table.max_order, "int32")
    table.run(kernels.list_partitions)(
        0, len(table), table.max_order, table.colors, *table.columns, starts, skeleton, part, stack
    )
    return Partitions(starts, skeleton, part, total - (sizes[-1] << (table.max_order - 1)))
