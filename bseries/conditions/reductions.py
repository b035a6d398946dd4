"""Which order conditions are needed: under simplifying assumptions, and for scalar equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.exceptions import SeriesError

if TYPE_CHECKING:
    from trees.tree import Tree

SCALAR = ("autonomous", "nonautonomous")


class Simplifying(NamedTuple):
    """The simplifying assumptions B(p), C(q), D(r), for k = 1, …, p (q, r):

    B: Σ b_i c_i^(k−1) = 1/k;  C: Σ_j a_ij c_j^(k−1) = c_i^k/k;  D: Σ_i b_i c_i^(k−1) a_ij = b_j (1 − c_j^k)/k.
    """

    B: int = 0
    C: int = 0
    D: int = 0

    def __str__(self) -> str:
        return ", ".join(f"{name}({k})" for name, k in zip("BCD", self, strict=True) if k)

    def implies(self, tree: Tree) -> bool:
        """Whether the tree's condition follows from the assumptions and from conditions of simpler trees.

        B: the trees [τ^(k−1)] themselves. C: where [τ^(k−1)] sits on a node it can be replaced by k leaves on that
        node; weight and 1/γ are both divided by k. D: if the root carries k−1 leaves and one more tree t, the weight is
        (a(t) − a(t'))/k, with t' = t and k more leaves on its root, and 1/γ likewise; for t = τ this says that
        (k + 1) a([τ^k]) = a(τ). Either way the new trees have fewer inner nodes and no more nodes, so by induction the
        trees for which this is False suffice (Butcher 1964; Hairer–Nørsett–Wanner, section II.7).
        """
        if _is_bush(tree) and (tree.order <= self.B or 2 <= tree.order <= self.D + 1):
            return True
        if any(_is_bush(t) and 2 <= t.order <= self.C for level, t in tree.preorder() if level > 0):
            return True
        inner = [child for child in tree.children if child.children]
        return len(inner) == 1 and len(tree.children) <= self.D


def _is_bush(tree: Tree) -> bool:
    return not any(child.children for child in tree.children)


def read_assumptions(given: str | Mapping[str, int] | None) -> Simplifying:
    """The assumptions that a text such as ``"B5 C2 D1"`` or ``"B(5), C(2)"``, or a mapping such as {"C": 2}, denotes.

    Raises:
        SeriesError: It denotes none.
    """
    if given is None or isinstance(given, Simplifying):
        return given or Simplifying()
    refusal = SeriesError(f"assumptions must be like 'B5 C2 D1' or {{'B': 5, 'C': 2, 'D': 1}}, but were {given!r:.60}")
    if isinstance(given, str):
        words = given.upper().translate({ord("("): None, ord(")"): None, ord(","): " "}).split()
        pairs = [(word[0], word[1:]) for word in words]
    elif isinstance(given, Mapping):
        pairs = [(str(name).upper(), value) for name, value in given.items()]
    else:
        raise refusal
    found: dict[str, int] = {}
    for name, value in pairs:
        number = int(value) if isinstance(value, str) and value.isascii() and value.isdigit() else value
        if name not in ("B", "C", "D") or name in found or type(number) is not int or not 0 <= number < 1000:
            raise refusal
        found[name] = number
    if not found:
        raise refusal
    return Simplifying(**found)


def autonomous_class(tree: Tree) -> tuple[int, ...]:
    """What the elementary differential of a scalar y' = f(y) depends on: the numbers of children, Π f^(m).

    A tree with n nodes gives a partition of n−1, and each partition comes from some tree.
    """
    return tuple(sorted(len(t.children) for _, t in tree.preorder() if t.children))


def nonautonomous_class(tree: Tree) -> tuple[tuple[int, int], ...]:
    """The same for a scalar y' = f(t, y): at each inner node the numbers of leaves and of other children.

    A leaf stands for a derivative along (1, f), another child for one by y, so a node with l leaves and m others is
    (∂_t + f ∂_y)^l ∂_y^m f: what Butcher calls an atom.
    """
    atoms = []
    for _, t in tree.preorder():
        others = sum(1 for child in t.children if child.children)
        if t.children:
            atoms.append((len(t.children) - others, others))
    return tuple(sorted(atoms))


def isomeric(trees: Iterable[Tree], scalar: str) -> list[list[Tree]]:
    """The trees in classes with one elementary differential; classes in the order of their first trees."""
    key: Callable[[Tree], Any] = autonomous_class if scalar == "autonomous" else nonautonomous_class
    classes: dict[Any, list[Tree]] = {}
    for tree in trees:
        classes.setdefault(key(tree), []).append(tree)
    return list(classes.values())


def class_weights(trees: Iterable[Tree]) -> list[Fraction]:
    """Coprime integers proportional to 1/σ: a class's condition is Σ (a(τ) − 1/γ(τ))/σ(τ) = 0."""
    symmetries = [tree.symmetry for tree in trees]
    multiple = math.lcm(*symmetries)
    return [Fraction(multiple, symmetry) for symmetry in symmetries]
