"""Kernels of tree tables: enumeration, products, splits, partitions.

All kernels use the ids and columns of `trees.table.TreeTable`. Every tree with two or more nodes is uniquely u ∘ v
with v its largest child; the ids of all u ∘ v with fixed u and v of one order and colour are contiguous, so
id(u ∘ v) = base[u, |v|, colour(v)] + v without hashing.
"""

from __future__ import annotations

from bseries_base.lowering.flat_kernels import flat_kernel

OUTSIDE = -(2**31)
"""Base of products outside the table, negative after any id is added."""


@flat_kernel
def enumerate_trees(max_order, colors, limits, counts, block, order, color, left, right, base_start, base):
    """Fill the columns of the table, orders ascending.

    Ids sort by (order, root colour, left, right). `block[(n-1)*colors + c]` is the first id of order n and root colour
    c. `limits[c*(colors+1) + d]` bounds the children of colour d of a node of colour c; entry d = colors bounds all.
    `counts` is scratch of colors + 1 entries.
    """
    for c in range(colors):
        order[c], color[c], left[c], right[c] = 1, c, -1, -1
    tree = colors
    for n in range(2, max_order + 1):
        for c in range(colors):
            for m in range(1, n):
                r = n - m
                first_of_m = block[(m - 1) * colors]
                for u in range(block[(m - 1) * colors + c], block[(m - 1) * colors + c + 1]):
                    last = right[u]
                    count_children(u, colors, color, left, right, counts)
                    at = base_start[m] + ((u - first_of_m) * (max_order - m) + r - 1) * colors
                    for d in range(colors):
                        start = block[(r - 1) * colors + d]
                        if last > start:
                            start = last
                        stop = block[(r - 1) * colors + d + 1]
                        full = counts[d] >= limits[c * (colors + 1) + d]
                        if start >= stop or full or counts[colors] >= limits[c * (colors + 1) + colors]:
                            base[at + d] = OUTSIDE
                            continue
                        base[at + d] = tree - start
                        for v in range(start, stop):
                            order[tree], color[tree], left[tree], right[tree] = n, c, u, v
                            tree += 1


@flat_kernel
def count_children(tree, colors, color, left, right, counts):
    """Count the children of the root by colour, and in all (last entry)."""
    for d in range(colors + 1):
        counts[d] = 0
    while right[tree] >= 0:
        counts[color[right[tree]]] += 1
        counts[colors] += 1
        tree = left[tree]


@flat_kernel
def product(u, v, max_order, colors, block, order, color, base_start, base) -> int:
    """Id of u ∘ v if no child of u is larger than v; negative if outside the table."""
    m = int(order[u])
    r = int(order[v])
    if m + r > max_order:
        return OUTSIDE
    row = (u - block[(m - 1) * colors]) * (max_order - m) + r - 1
    return int(base[base_start[m] + row * colors + color[v]]) + v


@flat_kernel
def graft(u, v, max_order, colors, block, order, color, left, right, base_start, base, stack) -> int:
    """Id of u ∘ v for any u and v: remove the children of u above v, add v, add them again."""
    depth = 0
    tree = u + 0  # an id of 64 bits, whatever u has
    while right[tree] > v:
        stack[depth] = right[tree]
        depth += 1
        tree = left[tree]
    tree = product(tree, v, max_order, colors, block, order, color, base_start, base)
    while depth > 0 and tree >= 0:
        depth -= 1
        tree = product(tree, stack[depth], max_order, colors, block, order, color, base_start, base)
    return tree


@flat_kernel
def split_trees(
    first, last, max_order, colors, block, order, color, left, right, base_start, base, start, trunk, branch,
    to, to_trunk, to_branch, stack,
):  # fmt: skip
    """List the splits (trunk, branch) of the trees first … last−1, one for each edge.

    splits(u ∘ v) = {(u, v)} ∪ {(u' ∘ v, w) : (u', w) ∈ splits(u)} ∪ {(u ∘ v', w) : (v', w) ∈ splits(v)}.
    Those of a tree with n nodes begin at start[n] + tree·(n−1); new ones are written from to[n] + tree·(n−1).
    """
    for tree in range(first, last):
        n = order[tree]
        u = left[tree]
        if u < 0:
            continue
        v = right[tree]
        at = to[n] + tree * (n - 1)
        to_trunk[at] = u
        to_branch[at] = v
        m = order[u]
        for k in range(start[m] + u * (m - 1), start[m] + (u + 1) * (m - 1)):
            # A cut in u makes its children smaller, so v remains the largest.
            at += 1
            to_trunk[at] = product(trunk[k], v, max_order, colors, block, order, color, base_start, base)
            to_branch[at] = branch[k]
        m = order[v]
        for k in range(start[m] + v * (m - 1), start[m] + (v + 1) * (m - 1)):
            at += 1
            to_trunk[at] = graft(
                u, trunk[k], max_order, colors, block, order, color, left, right, base_start, base, stack
            )
            to_branch[at] = branch[k]


@flat_kernel
def list_partitions(
    first, last, max_order, colors, block, order, color, left, right, base_start, base, start, skeleton, part, stack
):
    """List the partitions of the trees first … last−1: skeleton and root part of each.

    A partition cuts some edges; the parts are the connected components, and the skeleton is obtained by contracting
    every part to a node of its root's colour. The partitions of u ∘ v are pairs of one of u and one of v, each with the
    new edge first kept (joining the root parts, and the roots of the skeletons) and then cut.
    Those of a tree with n nodes begin at start[n] + tree·2^(n−1).
    """
    for tree in range(first, last):
        n = order[tree]
        at = start[n] + tree * (1 << (n - 1))
        u = left[tree]
        if u < 0:
            skeleton[at], part[at] = tree, tree
            continue
        v = right[tree]
        of_u = start[order[u]] + u * (1 << (order[u] - 1))
        of_v = start[order[v]] + v * (1 << (order[v] - 1))
        for i in range(of_u, of_u + (1 << (order[u] - 1))):
            for j in range(of_v, of_v + (1 << (order[v] - 1))):
                merged = skeleton[i] + 0
                child = skeleton[j] + 0
                while right[child] >= 0:
                    merged = graft(
                        merged, right[child], max_order, colors, block, order, color, left, right, base_start, base,
                        stack,
                    )  # fmt: skip
                    child = left[child]
                skeleton[at] = merged
                part[at] = graft(
                    part[i], part[j], max_order, colors, block, order, color, left, right, base_start, base, stack
                )
                skeleton[at + 1] = graft(
                    skeleton[i], skeleton[j], max_order, colors, block, order, color, left, right, base_start, base,
                    stack,
                )  # fmt: skip
                part[at + 1] = part[i]
                at += 2


@flat_kernel
def symmetry_and_density(size, order, left, right, symmetry, density, multiplicity):
    """σ and γ of every tree u ∘ v from those of u and v.

    σ(u ∘ v) = σ(u) σ(v) μ, with μ the number of children equal to v; γ(u ∘ v) = |u ∘ v| · γ(u)/|u| · γ(v).
    """
    for tree in range(size):
        u = left[tree]
        v = right[tree]
        if u < 0:
            symmetry[tree], density[tree], multiplicity[tree] = 1, 1, 1
            continue
        multiplicity[tree] = multiplicity[u] + 1 if right[u] == v else 1
        symmetry[tree] = symmetry[u] * symmetry[v] * multiplicity[tree]
        density[tree] = density[u] // order[u] * density[v] * order[tree]
