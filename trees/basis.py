"""Bases of series: graded objects with ids, and the cuts of each into a trunk and a branch.

A kind of objects (rooted trees, words, …) is a subclass of `Basis`. Logarithm, exponential, powers, composition and
brackets of series on it need no more than the cuts, since

    (∂_b c)(τ) = c(∅) b(τ) + Σ multiplicity · c(trunk) b(branch)

is the Lie derivative of the series c along the field b, a sum over the cuts of τ. Compositions of series with integer
coefficients must have integer coefficients: the claims on denominators rest on it (docs/exactness.md). Where they have
not, other multiples of the elements have: bushes with n leaves, say, need the multiplicity n of the cut of a leaf.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar, overload

from bseries_base.lowering.flat_kernels import machine_code_pays
from bseries_base.table import Column, LazyRows, Table, Tabular
from trees.counting import check_order
from trees.errors import TreeError
from trees.notation import default_names

if TYPE_CHECKING:
    import numpy as np

Element = TypeVar("Element")


class Cuts(NamedTuple):
    """The cuts of the elements first … last−1: the k-th of them has the rows start[k] … start[k+1]−1.

    The columns are arrays if the basis is compiled, else lists.
    """

    first: int
    last: int
    start: Any
    trunk: Any
    branch: Any
    multiplicity: Any = None  # None: 1 everywhere


class Growth(NamedTuple):
    """How many terms operations have at an element with n nodes: with them, sizes of results are bounded by order.

    Multiplicities count: a cut that occurs twice is two terms.
    """

    branches: Callable[[int, int], int]  # branches(n, k): cuts whose branch has k nodes, at most
    cuts: Callable[[int], int]  # all cuts, at most
    products: Callable[[int], int]  # terms c(trunk) a(branch) a(branch) … of a composition, at most


class Basis(Tabular, Sequence[Element], ABC, Generic[Element]):
    """All objects of a kind with 1 … `max_order` nodes, sorted by their number of nodes and numbered from 0.

    The elements with one node are the letters, in `colors` colours, and have the ids 0 … colors−1. A subclass sets
    `max_order`, `colors` and `sizes`, and may then set `_complete`, after which it is immutable. It gives the cuts, and
    reads and writes its elements. It may override `cut_chunks`, where the rows of one element after another are too
    slow.

    Attributes:
        max_order: Largest number of nodes.
        colors: Number of letters.
        sizes: Numbers of elements with 1, 2, …, `max_order` nodes.

    Example:
        Ladders, one for each number of nodes: series on them are power series, with their product:

        >>> import bseries as bs
        >>> from trees.basis import Basis, Growth
        >>> class Ladders(Basis):
        ...     what, growth = "ladders", Growth(lambda n, k: 1, lambda n: n - 1, lambda n: n + 1)
        ...     def __init__(self, order):
        ...         self.max_order, self.colors, self.sizes = order, 1, [1] * order
        ...     def rows(self, at):
        ...         return [(at - k, k - 1, 1) for k in range(1, at + 1)]
        ...     def element(self, at):
        ...         return at + 1
        ...     def find(self, element):
        ...         return element - 1 if element in range(1, self.max_order + 1) else -1
        ...     def letters(self, element):
        ...         return (0,) * element
        ...     def read(self, text, names=None):
        ...         return int(text)
        ...     def text(self, element, names=None):
        ...         return str(element)
        ...     latex = text
        ...     def truncated(self, order):
        ...         return Ladders(order)
        >>> a = bs.algebra.Series.of(Ladders(4), lambda n: 1)  # 1/(1 − x)
        >>> [str(x) for x in a.log().values()], [str(x) for x in a.inverse().values()]
        (['1', '1/2', '1/3', '1/4'], ['-1', '0', '0', '0'])
    """

    what: ClassVar[str]  # the elements in messages, such as "trees"
    unit: ClassVar[str] = "node"  # what the order counts
    growth: ClassVar[Growth]
    max_order: int
    colors: int
    sizes: list[int]

    @abstractmethod
    def rows(self, at: int) -> Iterable[tuple[int, int, int]]:
        """The cuts (trunk, branch, multiplicity) of an element, with multiplicities below 2^63."""

    @abstractmethod
    def element(self, at: int) -> Element:
        """The element with an id."""

    @abstractmethod
    def find(self, element: object) -> int:
        """The id of an element; negative if it is none."""

    @abstractmethod
    def letters(self, element: Element) -> tuple[int, ...]:
        """The letters that an element is made of."""

    @abstractmethod
    def read(self, text: str, names: Sequence[str] | None = None) -> Element:
        """The element that a text stands for, in the names of letters.

        Raises:
            TreeError: The text is no element.
        """

    @abstractmethod
    def text(self, element: Element, names: Sequence[str] | None = None) -> str:
        """The text of an element, which `read` reads back."""

    @abstractmethod
    def latex(self, element: Element, names: Sequence[str] | None = None) -> str:
        """The elementary differential of an element in LaTeX."""

    @abstractmethod
    def truncated(self, order: int) -> Basis[Element]:
        """The basis of the elements with at most `order` nodes."""

    @cached_property
    def offsets(self) -> list[int]:
        """The elements with n nodes have the ids offsets[n−1] … offsets[n]−1."""
        return [0, *accumulate(self.sizes)]

    @cached_property
    def compiled(self) -> bool:
        """Whether columns are arrays, for compiled kernels."""
        return machine_code_pays(self.max_order * len(self))

    @cached_property
    def orders(self) -> list[int]:
        """The number of nodes of every element, as a list."""
        return [n for n, size in enumerate(self.sizes, 1) for _ in range(size)]

    @cached_property
    def order(self) -> np.ndarray:
        """The number of nodes of every element."""
        import numpy as np

        dtype = np.int8 if self.max_order < 128 else np.int32
        column = np.repeat(np.arange(1, self.max_order + 1, dtype=dtype), self.sizes)
        column.flags.writeable = False
        return column

    def order_of(self, at: int) -> int:
        """The number of nodes of the element with an id."""
        return bisect_right(self.offsets, at)

    @cached_property
    def symmetries(self) -> list[int]:
        """The symmetry coefficient of every element: its term is coefficient/σ times its differential."""
        return [1] * len(self)

    @cached_property
    def exact_flow(self) -> list[int]:
        """n! times the coefficient of every element with n nodes in the exact flow of the sum of all letters.

        It is the number of ways to cut off one letter after another.
        """
        ways: list[int] = []
        for at, n in enumerate(self.orders):
            leaves = (m * ways[trunk] for trunk, branch, m in self.rows(at) if branch < self.colors)
            ways.append(sum(leaves) if n > 1 else 1)
        return ways

    def column(self, content: int | list[int], dtype: str | None = None) -> Any:
        """A column of zeros, or of given numbers, as a list, or as an array for compiled kernels."""
        if not self.compiled:
            return [0] * content if isinstance(content, int) else content
        import numpy as np

        if isinstance(content, int):
            return np.zeros(content, dtype or np.int8)
        return np.array(content, dtype or np.int64)

    def cut_chunks(self) -> Iterator[Cuts]:
        """The cuts of all elements, ids ascending."""
        rows = [list(self.rows(at)) for at in range(len(self))]
        columns = zip(*(row for group in rows for row in group), strict=True)
        trunk, branch, multiplicity = (self.column(list(x), "int64") for x in columns) if any(rows) else ([], [], [])
        start = self.column([0, *accumulate(map(len, rows))])
        yield Cuts(0, len(self), start, trunk, branch, multiplicity)

    @property
    def _key(self) -> tuple[Any, ...]:
        """What tells two bases of one kind apart."""
        return self.max_order, self.colors

    def __setattr__(self, name: str, value: object) -> None:
        if "_complete" in self.__dict__:
            raise AttributeError(f"a basis is immutable: {name} cannot be set")
        super().__setattr__(name, value)

    def __delattr__(self, name: str) -> None:
        if "_complete" in self.__dict__:
            raise AttributeError(f"a basis is immutable: {name} cannot be deleted")
        super().__delattr__(name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Basis) and type(self) is type(other) and self._key == other._key

    def __hash__(self) -> int:
        return hash((type(self).__name__, self._key))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.max_order}, colors={self.colors})"

    def to_table(self) -> Table:
        """The elements with their numbers."""
        fields: dict[str, Callable[[int], Any]] = {
            "id": lambda at: at,
            "order": self.order_of,
            self.what[:-1]: lambda at: self.text(self[at]),
            "symmetry": lambda at: self.symmetries[at],
        }
        rows = LazyRows(lambda: range(len(self)), len(self))

        def data() -> dict[str, Any]:
            records = [{key: get(at) for key, get in fields.items()} for at in rows]
            return {
                "schema": 1,
                "kind": self.what,
                "order": self.max_order,
                "colors": list(self.names),
                "items": records,
            }

        return Table(
            f"{len(self)} {self.what} with at most {self.max_order} {self.unit}s",
            [Column(key, key != self.what[:-1], get) for key, get in fields.items()],
            rows,
            data=data,
            items="items",
            section=fields["order"],
        )

    def __len__(self) -> int:
        return self.offsets[-1]

    @overload
    def __getitem__(self, index: int) -> Element: ...
    @overload
    def __getitem__(self, index: slice) -> list[Element]: ...
    def __getitem__(self, index: int | slice) -> Element | list[Element]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        at = index.__index__()
        if at < 0:
            at += len(self)
        if not 0 <= at < len(self):
            raise IndexError(f"index must be an id below {len(self)}, but was {index}")
        return self.element(at)

    def __iter__(self) -> Iterator[Element]:
        return map(self.element, range(len(self)))

    def __contains__(self, element: object) -> bool:
        return self.find(element) >= 0

    def index(self, element: Element | str) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Id of an element, or of one given as text.

        Raises:
            TreeError: The text is no element, or the element is not in the basis.

        Example:
            >>> import bseries as bs
            >>> bs.TreeTable(3, colors=2).index("p[q,q]")
            12
        """
        found: Any = self.read(element) if isinstance(element, str) else element
        at = self.find(found)
        if at < 0:
            what = self.what
            raise TreeError(f"{what[:-1]} must be one of the {len(self)} {what} of the table {self!r}, but was {found}")
        return at

    def ids(self, order: int) -> range:
        """Ids of the elements with `order` nodes."""
        n = check_order(order)
        if n > self.max_order:
            raise TreeError(f"order must be {self.max_order} or less in this table, but was {n}")
        return range(self.offsets[n - 1], self.offsets[n])

    @property
    def restriction(self) -> dict[str, Any]:
        """What documents must say of the basis beside its order and the names of letters."""
        return {"basis": self.what}

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The default names of the letters."""
        return tuple(default_names(self.colors))
