"""The inner loops of repeated steps: products of stage vectors along left ∘ right, for any kind of number.

Stage vectors multiply block by block: a block of s components is a polynomial modulo z^s + q_{s−1} z^{s−1} + … + q₀.
Where products are componentwise, every component is a block. The product with one vector is a matrix, so that all trees
u ∘ v with the same u, whose v are neighbours, are done in one vectorised loop.

With a `modulus` of 0 nothing is reduced. Otherwise it is a prime just below 2^30, and numbers are kept at most
(1/2 + 2^−17) · modulus in size: `FEW` of their products, and one number more, fit into 63 bits.
"""

from __future__ import annotations

from math import floor

from bseries_base.lowering.flat_kernels import flat_kernel

FEW = 16
CHUNK = 1024
"""Trees that are done together, while their numbers are in the cache of the processor."""


@flat_kernel
def reduce_range(x, first, last, modulus, inverse):
    """Replace entries by their representatives of least absolute value (up to rounding of x · inverse).

    An integer division would cost more than all the rest. With |x| < 2^63 and modulus > 2^29 the rounded quotient is
    off by less than 2^−17.
    """
    for i in range(first, last):
        x[i] = x[i] - floor(x[i] * inverse + 0.5) * modulus


@flat_kernel
def add_multiple(factor, x, at, count, total, to):
    """Add a multiple of some entries to others."""
    for j in range(count):
        total[to + j] += factor * x[at + j]


@flat_kernel
def write_matrix(first, size, stage, stride, u, relation, modulus, inverse, matrix):
    """Write the matrix of the product with the vector g of u in a block, row by row: its columns are g, z g, z² g, …"""
    for i in range(size):
        matrix[i * size] = stage[(first + i) * stride + u]
    for m in range(1, size):
        lead = matrix[(size - 1) * size + m - 1]
        matrix[m] = 0 * lead
        for i in range(size):
            if i > 0:
                matrix[i * size + m] = matrix[(i - 1) * size + m - 1]
            matrix[i * size + m] -= lead * relation[first + i]
            if modulus:
                reduce_range(matrix, i * size + m, i * size + m + 1, modulus, inverse)


@flat_kernel
def multiply(u, v, to, count, blocks, ends, relation, modulus, inverse, stride, stage, applied, matrix):
    """The stage vectors of u ∘ v, u ∘ (v + 1), …, for `count` trees from `to` on."""
    for e in range(blocks):
        first = ends[e]
        size = ends[e + 1] - first
        write_matrix(first, size, stage, stride, u, relation, modulus, inverse, matrix)
        for i in range(size):
            at = (first + i) * stride + to
            for j in range(count):
                stage[at + j] = matrix[i * size] * applied[first * stride + v + j]
            for m in range(1, size):
                if matrix[i * size + m] != 0:
                    add_multiple(matrix[i * size + m], applied, (first + m) * stride + v, count, stage, at)
                if modulus and m % (FEW - 1) == 0:
                    reduce_range(stage, at, at + count, modulus, inverse)
            if modulus:
                reduce_range(stage, at, at + count, modulus, inverse)


@flat_kernel
def add_products(
    u, v, to, count, row, factor, blocks, ends, b, relation, modulus, inverse, stride, stage, applied, matrix, total
):
    """Add factor · b · g of the trees u ∘ v, u ∘ (v + 1), …, without their stage vectors g."""
    terms = 0
    for e in range(blocks):
        first = ends[e]
        size = ends[e + 1] - first
        write_matrix(first, size, stage, stride, u, relation, modulus, inverse, matrix)
        for m in range(size):
            weight = b[row + first] * matrix[m]
            for i in range(1, size):
                if modulus:
                    weight -= floor(weight * inverse + 0.5) * modulus
                weight += b[row + first + i] * matrix[i * size + m]
            if modulus:
                weight -= floor(weight * inverse + 0.5) * modulus
            weight *= factor
            if modulus:
                weight -= floor(weight * inverse + 0.5) * modulus
            if weight != 0:
                add_multiple(weight, applied, (first + m) * stride + v, count, total, to)
                terms += 1
                if modulus and terms % FEW == 0:
                    reduce_range(total, to, to + count, modulus, inverse)
    if modulus and terms % FEW != 0:
        reduce_range(total, to, to + count, modulus, inverse)


@flat_kernel
def finish(
    first, last, row, factor, blocks, ends, start, column, a, b, modulus, inverse, stride, stage, applied, prefix, total
):
    """Finish a step for the trees first … last−1: the vectors G, then the next power and its part of the total."""
    for e in range(blocks):
        for i in range(ends[e], ends[e + 1]):
            to = i * stride
            for t in range(first, last):
                applied[to + t] = prefix[t] if i == ends[e] else 0 * prefix[t]
            for k in range(start[row + i], start[row + i + 1]):
                add_multiple(a[k], stage, column[k] * stride + first, last - first, applied, to + first)
                if modulus and k % (FEW - 1) == 0:
                    reduce_range(applied, to + first, to + last, modulus, inverse)
            if modulus:
                reduce_range(applied, to + first, to + last, modulus, inverse)
    terms = 0
    for i in range(ends[blocks]):
        if b[row + i] != 0:
            add_multiple(b[row + i], stage, i * stride + first, last - first, prefix, first)
            terms += 1
            if modulus and terms % (FEW - 1) == 0:
                reduce_range(prefix, first, last, modulus, inverse)
    if modulus:
        reduce_range(prefix, first, last, modulus, inverse)
    if factor != 0:
        add_multiple(factor, prefix, first, last - first, total, first)
        if modulus:
            reduce_range(total, first, last, modulus, inverse)


@flat_kernel
def sum_of_powers(
    first_step, last_step, first_tree, last_tree, orders, colors, id_blocks, left, right, powers, tails, blocks, ends,
    relation, start, column, a, b, modulus, stride, stage, applied, prefix, matrix, total,
):  # fmt: skip
    """Add Σ_k powers[k, n] a^k(τ) to the total of every tree τ with n nodes, where a^k is the series of k steps.

    In step k the stage vector of u ∘ v is g(u) · G(v), with G(v) = a^(k−1)(v) + A g(v) and the matrix A of the colour
    of v; then a^k = a^(k−1) + b · g. Vectors of trees with the most nodes are not kept: for them the sum is that of
    tails[k] b · g, where tails[k] is the sum of the weights from k on.

    Args:
        first_step, last_step: The steps first … last−1, from 0 on; those before are done.
        first_tree, last_tree: Range of ids; smaller trees are done in all these steps. Several trees of one order can
            be done at once, in threads.
        orders, colors: Largest number of nodes, and number of colours.
        id_blocks: First ids, by number of nodes and root colour.
        left, right: The factors of every tree. The products of one tree with neighbours are neighbours.
        powers, tails: Weights (steps, orders + 1), flat.
        blocks, ends: Number of blocks, and their ends, from 0 on.
        relation: q, for every component.
        start, column, a: The rows of the matrices, colour by colour: the nonzero entries, and where each row begins.
        b: The weights of the method, colour by colour.
        stride: Number of trees whose vectors are kept.
        stage, applied: Scratch for g and G: a row of `stride` entries for each component.
        prefix: Scratch for a^(k−1): `stride` zeros.
        matrix: Scratch: s² entries for the longest block.
        total: Output.
    """
    inverse = 1.0 / modulus if modulus else 0.0
    size = ends[blocks]
    for step in range(first_step, last_step):
        for k in range(orders * colors):
            first = max(id_blocks[k], first_tree)
            last = min(id_blocks[k + 1], last_tree)
            order = k // colors + 1
            row = (k % colors) * size
            place = step * (orders + 1) + order
            if order == 1:
                for e in range(blocks):
                    for i in range(ends[e], ends[e + 1]):
                        for t in range(first, last):
                            stage[i * stride + t] = 1 if i == ends[e] else 0
            elif order < orders or tails[place] != 0:
                t = first
                while t < last:
                    u = left[t]
                    v = right[t]
                    end = t + 1
                    while end < last and left[end] == u and right[end] - v == end - t:
                        end += 1
                    if order < orders:
                        multiply(
                            u, v, t, end - t, blocks, ends, relation, modulus, inverse, stride, stage, applied, matrix
                        )  # fmt: skip
                    else:
                        add_products(
                            u, v, t, end - t, row, tails[place], blocks, ends, b, relation, modulus, inverse, stride,
                            stage, applied, matrix, total,
                        )  # fmt: skip
                    t = end
            if order < orders or order == 1:
                t = first
                while t < last:
                    end = min(t + CHUNK, last)
                    finish(
                        t, end, row, powers[place], blocks, ends, start, column, a, b, modulus, inverse, stride, stage,
                        applied, prefix, total,
                    )  # fmt: skip
                    t = end
