"""Texts of the trees of a table, each made from those of its factors: left ∘ right adds one child to a root."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Generic, TypeVar

from trees.formulas import derivative

if TYPE_CHECKING:
    from trees.table import TreeTable

T = TypeVar("T")


class Fold(Generic[T]):
    """Values of trees, by their ids; what smaller trees have is kept.

    Args:
        table: The trees.
        node: The value of a single node of a colour.
        graft: The value of left ∘ right from those of left and right.
    """

    def __init__(self, table: TreeTable, node: Callable[[int], T], graft: Callable[[T, T], T]):
        self._columns, self._node, self._graft = table.columns, node, graft
        self._kept: dict[int, T] = {}

    def __call__(self, at: int) -> T:
        """The value of the tree with an id."""
        left = int(self._columns.left[at])
        if left < 0:
            return self._node(int(self._columns.color[at]))
        return self._graft(self._part(left), self._part(int(self._columns.right[at])))

    def _part(self, at: int) -> T:
        value = self._kept.get(at)
        if value is None:
            value = self._kept[at] = self(at)
        return value


def tree_texts(table: TreeTable, names: Sequence[str] | None) -> Fold[str]:
    """`Tree.text` of the trees of a table; names are None for one colour."""
    labels = names or ("",)

    def graft(u: str, v: str) -> str:
        root = u[:-1] + "," if u[-1] == "]" else "[" if u == "τ" else u + "["
        return f"{root}{v}]"

    return Fold(table, lambda color: labels[color] or "τ", graft)


def levels(table: TreeTable) -> Fold[tuple[int, ...]]:
    """`Tree.levels` of the trees of a table."""
    return Fold(table, lambda color: (0,), lambda u, v: (*u, *[level + 1 for level in v]))


def colors(table: TreeTable) -> Fold[tuple[int, ...]]:
    """`Tree.colors` of the trees of a table."""
    return Fold(table, lambda color: (color,), lambda u, v: u + v)


def differentials(table: TreeTable, names: Sequence[str] | None) -> Callable[[int], str]:
    """`Tree.differential` of the trees of a table, as text; names are None for one colour."""
    labels = names or ("",)

    def text(symbol: str, count: int, arguments: str) -> str:
        return f"{symbol}{derivative(count)}({arguments})" if count else symbol

    def graft(u: tuple[str, int, str], v: tuple[str, int, str]) -> tuple[str, int, str]:
        symbol, count, arguments = u
        return symbol, count + 1, f"{arguments},{text(*v)}" if count else text(*v)

    fold = Fold(table, lambda color: (f"f_{labels[color]}" if labels[color] else "f", 0, ""), graft)
    return lambda at: text(*fold(at))
