"""Forests: commutative products of trees, and the empty product."""

from __future__ import annotations

import sys
from bisect import insort
from collections.abc import Iterable, Iterator
from functools import lru_cache, total_ordering
from itertools import groupby
from math import factorial, prod
from typing import Any

from trees.errors import TreeError
from trees.formulas import latex_name
from trees.notation import MAX_ORDER, check_names, default_names, is_name, is_number, nest, node_names
from trees.tree import Tree

EMPTY = "∅"


@total_ordering
class Forest:
    """A forest: a finite multiset of coloured rooted trees.

    Forests are the monomials in coproducts and antipodes; the empty forest ∅ is their unit 1. They are ordered by their
    number of nodes, then by their trees in ascending order.

    Args:
        trees: The forest as text: trees separated by ``·``, powers allowed, ``∅`` or ``1`` for none. Or a tree, or any
            number of trees.
        names: The names of the colours in the text, as for `Tree`.

    Raises:
        TreeError: If the text is not a forest, or has more than 10,000 nodes.

    Example:
        >>> import bseries as bs
        >>> forest = bs.hopf.Forest("[τ]·τ^2")
        >>> forest, forest.order, forest.symmetry, len(forest)
        (Forest('τ·τ·[τ]'), 4, 2, 3)
        >>> forest * bs.Tree("τ") == bs.hopf.Forest("τ^3·[τ]"), bs.hopf.Forest() == bs.hopf.Forest("∅")
        (True, True)
        >>> bs.Tree.join(forest), bs.hopf.Forest(bs.Tree("[τ,[τ]]").children)  # B₊ and its inverse B₋
        (Tree('[τ,τ,[τ]]'), Forest('τ·[τ]'))

    References:
        Connes, Kreimer: Hopf algebras, renormalization and noncommutative geometry (1998), doi:10.1007/s002200050499.
    """

    __slots__ = ("_hash", "_order", "_trees")

    _trees: tuple[Tree, ...]
    _order: int
    _hash: int

    def __new__(cls, trees: str | Tree | Forest | Iterable[Tree] = (), *, names: Iterable[str] | None = None) -> Forest:
        """Read the text, or sort the trees."""
        if isinstance(trees, Forest):
            return trees
        if isinstance(trees, str):
            return Forest.from_sorted(tuple(sorted(_read(trees, names))))
        if isinstance(trees, Tree):
            return Forest.from_sorted((trees,))
        if not hasattr(trees, "__iter__"):
            raise TreeError(f"trees must be trees, or a text such as 'τ·[τ]', but was {trees!r:.60}")
        members = list(trees)
        for tree in members:
            if not isinstance(tree, Tree):
                raise TreeError(f"trees must be trees, but one was {tree!r:.60}")
        return Forest.from_sorted(tuple(sorted(members)))

    @staticmethod
    def from_sorted(trees: tuple[Tree, ...]) -> Forest:
        """The forest of these trees, which must ascend (not checked)."""
        return Forest._make(trees, sum([tree.order for tree in trees]), sum([hash(tree) for tree in trees]))

    @staticmethod
    def _make(trees: tuple[Tree, ...], order: int, hash_sum: int) -> Forest:
        if order > MAX_ORDER:
            raise TreeError(f"trees must have at most {MAX_ORDER} nodes together, but have {order}")
        forest = object.__new__(Forest)
        forest._trees = trees
        forest._order = order
        forest._hash = hash_sum % sys.hash_info.modulus
        return forest

    @property
    def trees(self) -> tuple[Tree, ...]:
        """The trees, ascending."""
        return self._trees

    @property
    def order(self) -> int:
        """The total number of nodes."""
        return self._order

    @property
    def symmetry(self) -> int:
        """σ of the trees on a common root: the product of their σ, times m! for each tree of multiplicity m."""
        repeated = prod(factorial(len(list(equal))) for _, equal in groupby(self._trees))
        return repeated * prod(tree.symmetry for tree in self._trees)

    def __mul__(self, other: Forest | Tree) -> Forest:
        if isinstance(other, Tree):
            other = Forest(other)
        if not isinstance(other, Forest):
            return NotImplemented
        small, large = (self, other) if len(self._trees) < len(other._trees) else (other, self)
        if not small._trees:
            return large
        trees = list(large._trees)
        for tree in small._trees:
            insort(trees, tree)
        return Forest._make(tuple(trees), self._order + other._order, self._hash + other._hash)

    __rmul__ = __mul__

    def text(self, names: Iterable[str] | None = None) -> str:
        """The forest as text, which `Forest` reads back: its trees, ascending, with ``·`` between them; or ``∅``.

        The argument and the errors are those of `Tree.text`.

        Example:
            >>> import bseries as bs
            >>> bs.hopf.Forest("q·p[q]").text(), bs.hopf.Forest("q·p[q]").text(["fast", "slow"])
            ('q·p[q]', 'slow·fast[slow]')
        """
        common = common_names(self._trees, names)
        return "·".join([tree.text(common) for tree in self._trees]) or EMPTY

    def to_latex(self, names: Iterable[str] | None = None) -> str:
        r"""The forest in LaTeX; the arguments are those of `text`.

        Example:
            >>> import bseries as bs
            >>> print(bs.hopf.Forest("τ·[τ]").to_latex())
            \tau \cdot [\tau]
        """
        common = common_names(self._trees, names)
        if not common[0]:
            return self.text().replace("τ", "\\tau").replace("·", " \\cdot ").replace(EMPTY, "\\emptyset")
        trees = (nest(tree.levels, map(latex_name, node_names(tree.colors, common)), "[", "]") for tree in self._trees)
        return " \\cdot ".join(trees) or "\\emptyset"

    def _repr_latex_(self) -> str:
        return f"${self.to_latex()}$"

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        return f"Forest('{self.text()}')"

    def __len__(self) -> int:
        return len(self._trees)

    def __iter__(self) -> Iterator[Tree]:
        return iter(self._trees)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Forest):
            return NotImplemented
        return self is other or (self._hash == other._hash and self._trees == other._trees)

    def __lt__(self, other: Forest) -> bool:
        if not isinstance(other, Forest):
            return NotImplemented
        return (self._order, self._trees) < (other._order, other._trees)

    def __reduce__(self) -> tuple[Any, ...]:
        return Forest, (self._trees,)


@lru_cache(maxsize=2**14)
def rooted(forest: Forest, color: int) -> Forest:
    """B₊ as a forest of one tree, cached because comparing equal trees is fast only for identical objects."""
    return Forest.from_sorted((Tree.from_sorted(color, forest._trees),))


def common_names(trees: Iterable[Tree], names: Iterable[str] | None) -> tuple[str, ...]:
    """The names of colours for all these trees: those given, or the default names."""
    if names is not None:
        return check_names(names)
    return default_names(1 + max((color for tree in trees for color in tree.colors), default=0))


def _read(text: str, names: Iterable[str] | None) -> list[Tree]:
    """The trees of a text, in order."""
    if text.strip() in (EMPTY, "1"):
        return []
    common = None if names is None else check_names(names)
    parts = text.split("·")
    if common is None:
        _check_naming(text, parts)
    trees: list[Tree] = []
    order = 0
    for part in parts:
        base, _, exponent = part.rpartition("^")
        copies = int(exponent) if base and is_number(exponent.strip()) else 0  # powers in brackets are parts of trees
        tree = Tree(base if copies else part, names=common)
        order += tree.order * max(copies, 1)
        if order > MAX_ORDER:
            raise TreeError(f"text must be a forest of at most {MAX_ORDER} nodes, but was {text!r:.60}")
        trees += [tree] * max(copies, 1)
    return trees


def _check_naming(text: str, parts: Iterable[str]) -> None:
    """Refuse colours that are named in different ways in different trees."""
    named = []
    for part in parts:
        words = "".join([c if c.isalnum() or c == "_" else " " for c in part.replace("τ", " ")]).split()
        named.append({word for word in words if is_name(word)})
    every = set().union(*named)
    if every and not (all(named) and (every <= {"p", "q"} or every.isdisjoint(("p", "q")))):
        raise TreeError(f"text must name the colours of all its trees in one way, but was {text!r:.60}")
