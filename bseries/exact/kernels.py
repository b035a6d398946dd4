"""Compiled recursions on the coefficients of series: elementary weights, Lie derivatives, Chinese remainders.

Each kernel is one source for every kind of number. Compiled it runs on float64, on int64 that wraps modulo 2^64, and on
int32 residues of a prime below 2^30 (sums of up to 30 products in int64); uncompiled on lists of Python or SymPy
numbers. `modulus` is 0 where nothing is to be reduced.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from trees.compiled import Kernel, kernel


def inlined(function: Callable[..., Any]) -> Kernel:
    """Mark a function as a kernel that is copied into its callers: handing over arrays costs as much as a short sum."""
    return Kernel(function, inline="always")


@kernel
def reduced(x, modulus, inverse):
    """A representative of x modulo `modulus` of absolute value at most half of it (up to rounding of x · inverse).

    Machine division would cost more than the sum it reduces. With |x| < 2^63 and modulus > 2^29 the rounded quotient
    is off by less than 2^-17, so the result stays below (1/2 + 2^-17) · modulus.
    """
    return x - math.floor(x * inverse + 0.5) * modulus


@kernel
def reduce_all(x, count, modulus, inverse):
    """Reduce the first `count` entries."""
    for i in range(count):
        x[i] = reduced(x[i], modulus, inverse)


@inlined
def weighted_sum(x, weights, first, count, modulus, inverse):
    """Σ x[i] · weights[first + i] over i < count, for count ≥ 1."""
    total = x[0] * weights[first]
    for i in range(1, count):
        total += x[i] * weights[first + i]
        if modulus and i % 16 == 0:
            total = reduced(total, modulus, inverse)
    return reduced(total, modulus, inverse) if modulus else total


@inlined
def row_sum(total, x, column, a, first, last, modulus, inverse):
    """A number plus Σ a[k] · x[column[k]] over first ≤ k < last: a row of a matrix without its zeros."""
    for k in range(first, last):
        total += x[column[k]] * a[k]
        if modulus and k % 16 == 0:
            total = reduced(total, modulus, inverse)
    return reduced(total, modulus, inverse) if modulus else total


@inlined
def weighted_terms(total, terms, at, weights, tails, first, count):
    """A number plus Σ terms[at + j] · weights[first + j] over j < count; in floats as if in twice the precision.

    These sums cancel: terms of the size of 1/γ leave what a method of high order does wrong. Exact numbers have no
    tails. With tails, a factor is weights[j] + tails[j], the first of 24 bits; Veltkamp's splitting leaves 26 bits of
    the term, and their product is exact; what a sum loses is found by Knuth's two-sum, and all that is small is added
    at the end (T. Ogita, S. M. Rump, S. Oishi, *Accurate sum and dot product*, SIAM J. Sci. Comput. 26 (2005),
    algorithm 5.3).
    """
    if len(tails) > 0:
        rest = total * 0
        for j in range(count):
            term = terms[at + j]
            shifted = term * 134217729
            high = shifted - (shifted - term)
            product = high * weights[first + j]
            rest += (term - high) * weights[first + j] + term * tails[first + j]
            longer = total + product
            gained = longer - total
            rest += (total - (longer - gained)) + (product - gained)
            total = longer
        total += rest
    else:
        for j in range(count):
            total += terms[at + j] * weights[first + j]
    return total


@kernel
def elementary_weights(
    first, last, top, colors, left, right, color, stages, blocks, start, column, a, b, relation, modulus, stage,
    applied, weight, g, scratch,
):  # fmt: skip
    """Elementary weights of a method made of stages for the trees first … last−1.

    The stage vector of u ∘ v is g(u) · (A g(v)), with the matrix A of the colour of v; the weight of a tree is b · g.
    Row i of the matrix of colour c has its entries other than zero in `column` and `a` from start[c·stages + i] on; `b`
    is flat, colour by colour. `stage` and `applied` keep g and A g for the ids below `top`. The product of stage
    vectors is componentwise, or, where `blocks` holds the ends of blocks (from 0), in each block of length s the
    product of polynomials modulo z^s + q_{s−1} z^{s−1} + … + q₀, whose q are the block's entries of `relation` (see
    `bseries.exact.recursions.Stages`). Ids below `colors` are single nodes; `stages`, `blocks`, `start`, `column` and
    the columns of the table are unsigned, see `lie_series`.
    """
    inverse = 1.0 / modulus if modulus else 0.0
    for tree in range(first, last):
        if tree < colors:
            for i in range(stages):
                g[i] = 1
            for e in range(1, len(blocks)):
                for i in range(blocks[e - 1] + 1, blocks[e]):
                    g[i] = 0
        else:
            u = left[tree] * stages
            v = right[tree] * stages
            if len(blocks) > 0:
                multiply_blocks(blocks, stage, u, applied, v, relation, modulus, inverse, scratch, g)
            else:
                for i in range(stages):
                    g[i] = stage[u + i] * applied[v + i]
                if modulus:
                    for i in range(stages):
                        g[i] = reduced(g[i], modulus, inverse)
        row = color[tree] * stages
        weight[tree] = weighted_sum(g, b, row, stages, modulus, inverse)
        if tree >= top:
            continue
        for i in range(stages):
            stage[tree * stages + i] = g[i]
            applied[tree * stages + i] = row_sum(
                g[0] * 0, g, column, a, start[row + i], start[row + i + 1], modulus, inverse
            )


@kernel
def multiply_blocks(blocks, x, at_x, y, at_y, relation, modulus, inverse, product, out):
    """Products of the polynomials x[at_x:], y[at_y:] (ascending), block by block modulo z^s + Σ relation_k z^k."""
    for e in range(1, len(blocks)):
        first = int(blocks[e - 1])
        size = int(blocks[e]) - first
        many = 2 * size - 1
        returning = False
        for i in range(size):
            if relation[first + i]:
                returning = True
        if not returning:  # modulo a power of z nothing comes back from above
            many -= size - 1
        for k in range(many):
            low = max(0, k - size + 1)
            total = x[at_x + first + low] * y[at_y + first + k - low]
            for i in range(low + 1, min(k, size - 1) + 1):
                total += x[at_x + first + i] * y[at_y + first + k - i]
                if modulus and i % 16 == 0:
                    total = reduced(total, modulus, inverse)
            product[k] = reduced(total, modulus, inverse) if modulus else total
        for k in range(many - 1, size - 1, -1):
            for i in range(size):
                total = product[k - size + i] - product[k] * relation[first + i]
                product[k - size + i] = reduced(total, modulus, inverse) if modulus else total
        for i in range(size):
            out[first + i] = product[i]


@kernel
def lie_series(
    first, last, order, start, trunk, branch, width, top, solve, sparse, field, base, base_empty, weights, tails,
    modulus, rows, result, terms,
):  # fmt: skip
    """Σ_j weights[j] · ∂_b^j c for the trees first … last−1, or the b for which that sum is given.

    The Lie derivative of c along the field b (HLW, Lemma IX.9.1):

        (∂_b c)(τ) = c(∅) b(τ) + Σ_{splits of τ} c(trunk) b(branch).

    Args:
        first, last: Range of ids; all trees below `first` have been done.
        order: Number of nodes of every tree.
        start, trunk, branch: Splits, as `trees.table.Splits` describes them.
        width: Length of a row; unsigned, like `trunk` and `branch`: without checks for negative indices the inner loop
            runs in vector registers, four times as fast.
        top: Rows are kept for ids below this one.
        solve: If true, c is the identity (c(∅) = 1, else 0), `result` is given and `field` is solved for: the sum
            begins with b itself, and the factors of the other derivatives are negated.
        sparse: Whether b is zero at most trees, so that looking first pays.
        field: b at every tree; read, or written when solving.
        base, base_empty: c at every tree (empty: zero) and at ∅.
        weights, tails: Factor of the j-th derivative, j = 0 … n (see `weighted_terms`; the first two have no tails).
        modulus: 0, or the prime that everything is reduced by.
        rows: Row by row ∂_b^j c at one tree, from j = 0 (from j = 1 if `base` is empty), zeros behind j = n.
        result: Output.
        terms: Scratch of `width` entries.
    """
    shift = 1 if len(base) > 0 else 0
    inverse = 1.0 / modulus if modulus else 0.0
    for tree in range(first, last):
        n = order[tree]
        for j in range(width):
            terms[j] = 0
        for k in range(start[n] + tree * (n - 1), start[n] + (tree + 1) * (n - 1)):
            b = field[branch[k]]
            if sparse and not b:
                continue
            row = trunk[k] * width
            for j in range(width):
                terms[j] += rows[row + j] * b
        if modulus:
            for j in range(width):
                terms[j] = reduced(terms[j], modulus, inverse)
        # Now terms[j] is ∂_b^(j+2−shift) c at the tree, for j = 0 and shift = 1 but for the part c(∅) b(τ).
        if solve:
            total = weighted_terms(terms[0] * 0 + result[tree], terms, 0, weights, tails, 2, n - 1)
            total = reduced(total, modulus, inverse) if modulus else total
            derivative = field[tree] = total
        else:
            derivative = terms[0] * shift + base_empty * field[tree]
            derivative = reduced(derivative, modulus, inverse) if modulus else derivative
            total = derivative * weights[1]
            if shift:
                total += base[tree] * weights[0]
            total = weighted_terms(total, terms, shift, weights, tails, 2, n - 1)
            result[tree] = reduced(total, modulus, inverse) if modulus else total
        if tree < top:
            row = tree * width
            if shift:
                rows[row] = base[tree]
            rows[row + shift] = derivative
            for j in range(shift, n - 1 + shift):
                rows[row + 1 + j] = terms[j]


@kernel
def balanced(x, modulus, inverse):
    """The representative of x modulo an odd `modulus` between −(modulus−1)/2 and (modulus−1)/2, for |x| < 2^61."""
    rest = reduced(x, modulus, inverse)
    half = modulus // 2
    if rest > half:
        return rest - modulus
    if rest < -half:
        return rest + modulus
    return rest


@kernel
def chinese_remainder(residues, primes, inverses, words, digits, limbs):
    """Signed integers from their residues, as `words` 32-bit words each (two's complement, low word first).

    Garner's mixed radix with balanced digits d_i: x = d_0 + p_0 (d_1 + p_1 (d_2 + …)) is the representative of least
    absolute value, whatever its sign. inverses[i, j] is 1/p_j modulo p_i; `digits` has a row for each prime, and its
    length is the number of trees done at a time, in vector registers.
    """
    count = len(primes)
    size = residues.shape[1]
    block = digits.shape[1]
    for first in range(0, size, block):
        many = min(block, size - first)
        for i in range(count):
            p = primes[i]
            inverse = 1.0 / p
            digit = digits[i]
            for t in range(many):
                digit[t] = balanced(residues[i, first + t] * 1, p, inverse)
            for j in range(i):
                factor = inverses[i, j]
                earlier = digits[j]
                for t in range(many):
                    digit[t] = balanced((digit[t] - earlier[t]) * factor, p, inverse)
        for t in range(many):
            limb = limbs[first + t]
            for w in range(words):
                limb[w] = 0
            for i in range(count - 1, -1, -1):
                carry = digits[i, t]
                for w in range(words):
                    carry += limb[w] * primes[i]
                    limb[w] = carry & 0xFFFFFFFF
                    carry >>= 32
