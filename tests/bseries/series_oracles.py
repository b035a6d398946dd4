"""Slow, obvious versions of fast algorithms: what the definitions say, in Fractions."""

from fractions import Fraction
from itertools import product
from math import prod

from trees import Tree


def rooted_cuts(tree):
    """(subtree that keeps the root, branches cut off) for every ordered subtree (HLW, section III.1.3)."""
    choices = []
    for child in tree.children:
        kept = [([part], cut) for part, cut in rooted_cuts(child)]
        choices.append([([], [child]), *kept])
    for choice in product(*choices):
        yield Tree.join([t for parts, _ in choice for t in parts], tree.color), [b for _, cut in choice for b in cut]


def composed(a, c, tree):
    """(a · c)(τ): first a, then c, as a sum over ordered subtrees (HLW, theorem III.1.10)."""
    total = c["∅"] * a[tree]
    return total + sum(c[kept] * prod((a[b] for b in cut), start=Fraction(1)) for kept, cut in rooted_cuts(tree))


def derived(b, c, tree):
    """(∂_b c)(τ) by cutting each edge (HLW, lemma IX.9.1)."""
    return c["∅"] * b[tree] + sum(c[kept] * b[cut[0]] for kept, cut in rooted_cuts(tree) if len(cut) == 1)


def weight(parts, tree):
    """Elementary weight of a partitioned method, parts = [(A, b), …] by colour, straight from the definition."""
    _, b = parts[tree.color]
    return sum(b[i] * stage(parts, tree, i) for i in range(len(b)))


def stage(parts, tree, i):
    """Φ_i(τ) = Π over the children of Σ_j a_ij Φ_j(child)."""
    value = Fraction(1)
    for child in tree.children:
        A, b = parts[child.color]
        value *= sum(A[i][j] * stage(parts, child, j) for j in range(len(b)))
    return value


def partitions(tree):
    """(skeleton, parts) for every way to cut some edges of a tree; the first part holds the root."""
    for skeleton, part, others in _partitions(tree):
        yield skeleton, [part, *others]


def _partitions(tree):
    found = [([], [], [])]
    for child in tree.children:
        grown = []
        for skeleton, part, others in found:
            for child_skeleton, child_part, child_others in _partitions(child):
                cut = [*skeleton, child_skeleton], part, [*others, child_part, *child_others]
                kept = [*skeleton, *child_skeleton.children], [*part, child_part], [*others, *child_others]
                grown += [cut, kept]
        found = grown
    for skeleton, part, others in found:
        yield Tree.join(skeleton, tree.color), Tree.join(part, tree.color), others


def substituted(b, a, tree):
    """(b ★ a)(τ) as a sum over partitions (Chartier, Hairer, Vilmart 2010, theorem 3.2)."""
    return sum(a[skeleton] * prod((b[p] for p in parts), start=Fraction(1)) for skeleton, parts in partitions(tree))
