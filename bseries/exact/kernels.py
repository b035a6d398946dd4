"""Inner loops of the series algebra: elementary weights, Lie derivatives, substitution, Chinese remainders.

Each kernel is one source for every kind of number. Compiled, it runs on float64, on int64 modulo 2^64, and on int32
residues modulo a prime below 2^30 (sums of up to 30 products in int64); interpreted, on lists of Python or SymPy
numbers. A `modulus` of 0 means no reduction.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from trees.compiled import Kernel, kernel


def inlined(function: Callable[..., Any]) -> Kernel:
    """Mark a kernel as inlined: passing arrays costs as much as a short sum."""
    return Kernel(function, inline="always")


@kernel
def reduced(x, modulus, inverse):
    """A representative of x modulo `modulus` of absolute value at most half of it (up to rounding of x · inverse).

    An integer division would cost more than the sum itself. With |x| < 2^63 and modulus > 2^29 the rounded quotient is
    off by less than 2^-17, so the result stays below (1/2 + 2^-17) · modulus.
    """
    return x - math.floor(x * inverse + 0.5) * modulus


@kernel
def reduce_all(x, count, modulus, inverse):
    """Reduce the first `count` entries in place."""
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
    """total + Σ a[k] · x[column[k]] over first ≤ k < last: one row of a sparse matrix times a vector."""
    for k in range(first, last):
        total += x[column[k]] * a[k]
        if modulus and k % 16 == 0:
            total = reduced(total, modulus, inverse)
    return reduced(total, modulus, inverse) if modulus else total


@inlined
def weighted_terms(total, terms, at, weights, tails, first, count):
    """total + Σ terms[at + j] · weights[first + j] over j < count; for floats, as if in twice the precision.

    These sums cancel: terms of size 1/γ leave the small error coefficients of a method of high order. Exact numbers
    have no tails. For floats a factor is weights[j] + tails[j], where weights[j] has 24 bits; Veltkamp's splitting
    leaves 26 bits of the term, so that their product is exact. Knuth's two-sum finds the rounding errors of the sum,
    which are added at the end (T. Ogita, S. M. Rump, S. Oishi, *Accurate sum and dot product*, SIAM J. Sci. Comput. 26
    (2005), algorithm 5.3).
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
    """Elementary weights of a method with stages, for the trees first … last−1.

    The stage vector of u ∘ v is g(u) · (A g(v)), with the matrix A of the colour of v; the weight of a tree is b · g.
    Row i of the matrix of colour c has its nonzero entries in `column` and `a` from start[c·stages + i] on; `b` is
    flat, colour by colour. `stage` and `applied` keep g and A g for the ids below `top`. Stage vectors are multiplied
    componentwise, or, where `blocks` holds the ends of blocks (from 0), as polynomials: in a block of length s modulo
    z^s + q_{s−1} z^{s−1} + … + q₀, whose q are the block's entries of `relation` (see
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
    """Multiply x[at_x:] by y[at_y:], block by block as polynomials (ascending) modulo z^s + Σ relation_k z^k."""
    for e in range(1, len(blocks)):
        first = int(blocks[e - 1])
        size = int(blocks[e]) - first
        many = 2 * size - 1
        has_relation = False
        for i in range(size):
            if relation[first + i]:
                has_relation = True
        if not has_relation:  # modulo z^s, higher coefficients vanish
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
        first, last: Range of ids; smaller trees are done.
        order: Number of nodes of every tree.
        start, trunk, branch: Splits, as `trees.table.Splits` describes them.
        width: Length of a row; unsigned, like `trunk` and `branch`: without checks for negative indices the inner loop
            is vectorised, four times as fast.
        top: Rows are kept for ids below this one.
        solve: If true, c is the identity (c(∅) = 1, else 0), `result` is given and `field` is solved for: the sum
            begins with b itself, and the factors of the other derivatives are negated.
        sparse: Whether b vanishes at most trees, so that testing for zero pays.
        field: b at every tree; read, or written when solving.
        base, base_empty: c at every tree (empty: zero) and at ∅.
        weights, tails: Factor of the j-th derivative, j = 0 … n (see `weighted_terms`; the first two have no tails).
        modulus: 0, or the prime.
        rows: For each tree a row of ∂_b^j c, from j = 0 (from j = 1 if `base` is empty), with zeros after j = n.
        result: Output, or the given sum.
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
        # Now terms[j] = ∂_b^(j+2−shift) c at the tree; for j = 0 and shift = 1 still without c(∅) b(τ).
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
def substitute_in_stages(
    first, last, order, color, start, trunk, branch, width, top, stages, blocks, live, relation, degrees, row_start,
    row_column, a, b, moved, solve, scale, lift, weights, tails, negated, negated_tails, modulus, rows, logs,
    generators, field, result, value, inner, terms, log_terms,
):  # fmt: skip
    """Apply a method to the field b in place of f, or find the b for which the result is given.

    Stage i evaluates the substituted field at its own point Y_i = y + Σ_j a_ij k_j: its stage derivative is
    k_i = b(Y_i) = Σ_j ∂_ℓ^j b / j! with the generator ℓ = log Y_i. On a tree, ∂_ℓ^j b for j ≥ 1 and the nonlinear part
    of log Y_i need smaller trees only, so one sweep over the trees suffices; the result is Σ_i b_i k_i.

    Args:
        first, last, order, color, start, trunk, branch, width, top, modulus: As for `lie_series`.
        stages: Number of components of stage vectors.
        blocks, relation: Blocks that multiply as polynomials, as for `elementary_weights`; every component is a block
            where products are componentwise.
        live: For each block the index of its first component among those of stages with Y_i ≠ y; `moved` for stages
            with Y_i = y, where k is b itself.
        degrees: For each block the number of coefficients of a product that can be nonzero.
        row_start, row_column, a: The stage matrices, as for `elementary_weights`.
        b: Weights, colour by colour.
        moved: Number of live components.
        solve: Whether `result` is given and `field` sought.
        scale: For each colour the factors of the result and of the known part: 1/B and −1/B, B = Σ b_i.
        lift: Factor on the known part of the stage derivatives (1 except in `arithmetic.WrappedStages`).
        weights, tails, negated, negated_tails: 1/j!, and −1/j! (for bounds 1/j!), j = 0, 1, … (see `weighted_terms`).
        rows, logs: ∂_ℓ^j b from j = 0 and ∂_ℓ^j id from j = 1, for each tree and live component, then zeros.
        generators: ℓ, for each tree and live component.
        field, result: b and the result, for each tree.
        value, inner: Scratch, one entry per component.
        terms, log_terms: Scratch, `width` entries for each coefficient of the longest product.
    """
    inverse = 1.0 / modulus if modulus else 0.0
    for tree in range(first, last):
        n = order[tree]
        paint = color[tree] * stages
        splits = start[n] + tree * (n - 1)
        for i in range(stages):
            value[i] = inner[i] = 0
        for e in range(1, len(blocks)):
            at = blocks[e - 1]
            size = blocks[e] - at
            place = live[e - 1]
            if place >= moved:
                continue
            differentiate(
                splits, splits + n - 1, trunk, branch, width, moved, place, size, degrees[e - 1], relation, at, modulus,
                inverse, rows, logs, generators, terms, log_terms,
            )  # fmt: skip
            for x in range(size):
                total = terms[x * width] * 0
                nonlinear = weighted_terms(total, log_terms, x * width, negated, negated_tails, 2, n - 1)
                total = weighted_terms(total, terms, x * width, weights, tails, 1, n - 1)
                value[at + x] = reduced(total, modulus, inverse) if modulus else total
                inner[at + x] = reduced(nonlinear, modulus, inverse) if modulus else nonlinear
                if tree < top:
                    row = (tree * moved + place + x) * width
                    for j in range(n - 1):
                        rows[row + 1 + j] = terms[x * width + j]
                        logs[row + 1 + j] = log_terms[x * width + j]
        if solve:
            total = weighted_sum(value, b, paint, stages, modulus, inverse)
            total = result[tree] * scale[2 * color[tree]] + total * scale[2 * color[tree] + 1]
            field[tree] = reduced(total, modulus, inverse) if modulus else total
        for i in range(stages):
            value[i] *= lift
        for e in range(1, len(blocks)):
            total = value[blocks[e - 1]] + field[tree]
            value[blocks[e - 1]] = reduced(total, modulus, inverse) if modulus else total
        if not solve:
            result[tree] = weighted_sum(value, b, paint, stages, modulus, inverse)
        if tree >= top:
            continue
        for e in range(1, len(blocks)):
            if live[e - 1] >= moved:
                continue
            rows[(tree * moved + live[e - 1]) * width] = field[tree]
            for i in range(blocks[e - 1], blocks[e]):
                at = tree * moved + live[e - 1] + i - blocks[e - 1]
                generators[at] = logs[at * width] = row_sum(
                    inner[i], value, row_column, a, row_start[paint + i], row_start[paint + i + 1], modulus, inverse
                )


@inlined
def differentiate(
    first, last, trunk, branch, width, moved, place, size, many, relation, at, modulus, inverse, rows, logs, generators,
    terms, log_terms,
):  # fmt: skip
    """∂_ℓ^(j+1) b and ∂_ℓ^(j+2) id for the stages of one block, on the tree whose splits are first … last−1.

    The block has `size` components, from index `place` among the live ones and from `at` among all; a product has
    `many` coefficients. `terms` and `log_terms` receive the result, `width` entries for each component.
    """
    for j in range(many * width):
        terms[j] = log_terms[j] = 0
    for k in range(first, last):
        low = branch[k] * moved + place
        row = (trunk[k] * moved + place) * width
        for x in range(size):
            for y in range(min(size, many - x)):
                factor = generators[low + y]
                to = (x + y) * width
                from_row = row + x * width
                for j in range(width):
                    terms[to + j] += rows[from_row + j] * factor
                    log_terms[to + j] += logs[from_row + j] * factor
            if modulus and size > 1 and (x % 16 == 15 or x == size - 1):
                reduce_all(terms, many * width, modulus, inverse)
                reduce_all(log_terms, many * width, modulus, inverse)
    if modulus and size == 1:
        reduce_all(terms, width, modulus, inverse)
        reduce_all(log_terms, width, modulus, inverse)
    for d in range(int(many) - 1, int(size) - 1, -1):
        for x in range(size):
            factor = relation[at + x]
            for j in range(width):
                back = (d - size + x) * width + j
                terms[back] -= terms[d * width + j] * factor
                log_terms[back] -= log_terms[d * width + j] * factor
                if modulus:
                    terms[back] = reduced(terms[back], modulus, inverse)
                    log_terms[back] = reduced(log_terms[back], modulus, inverse)


@kernel
def substitute_in_series(
    first, last, top, colors, order, color, left, right, start, skeleton, part, a, solve, scale, modulus, rests, parts,
    field, result,
):  # fmt: skip
    """b ★ a = Σ over the partitions of a tree of a(skeleton) Π b(parts), or the b for which it is given.

    A partition cuts a subset of the edges: a tree with n nodes has 2^(n−1), listed from start[n] + tree · 2^(n−1) on
    (`trees.table.Partitions`). Each pair of partitions of u and v gives two of u ∘ v, the new edge kept and then cut.
    The first partition has no cut: its skeleton is a single node, its only part the tree.

    Args:
        first, last, modulus: As for `lie_series`; products are kept for ids below `top`.
        colors, order, color, left, right: Columns of the table; ids below `colors` are single nodes.
        start, skeleton, part: The partitions: skeleton, and the part that holds the root.
        a: The outer series.
        solve: Whether `result` is given and `field` sought.
        scale: For each colour the factors of the result and of the known part: 1/a(•) and −1/a(•).
        rests, parts: For each partition the product of b over its parts, without and with the part of the root.
        field, result: b and the result, for each tree.
    """
    inverse = 1.0 / modulus if modulus else 0.0
    for tree in range(first, last):
        n = order[tree]
        here = start[n] + tree * (1 << (n - 1))
        paint = color[tree]
        if tree < colors:
            if solve:
                total = result[tree] * scale[2 * paint]
                field[tree] = reduced(total, modulus, inverse) if modulus else total
            else:
                total = a[tree] * field[tree]
                result[tree] = reduced(total, modulus, inverse) if modulus else total
            if tree < top:
                rests[here] = 1
                parts[here] = field[tree]
            continue
        u = left[tree]
        v = right[tree]
        many_u = 1 << (order[u] - 1)
        many_v = 1 << (order[v] - 1)
        of_u = start[order[u]] + u * many_u
        of_v = start[order[v]] + v * many_v
        total = a[paint] * 0
        at = here
        for i in range(of_u, of_u + many_u):
            for j in range(of_v, of_v + many_v):
                kept = rests[i] * rests[j]
                cut = rests[i] * parts[j]
                whole = parts[i] * parts[j]
                if modulus:
                    kept = reduced(kept, modulus, inverse)
                    cut = reduced(cut, modulus, inverse)
                    whole = reduced(whole, modulus, inverse)
                # The first partition, whose only part is the tree itself, is added below.
                with_root = field[part[at]] * kept if at > here else kept * 0
                if modulus:
                    with_root = reduced(with_root, modulus, inverse)
                    total += reduced(a[skeleton[at]] * with_root, modulus, inverse)
                    total += reduced(a[skeleton[at + 1]] * whole, modulus, inverse)
                else:
                    total += a[skeleton[at]] * with_root + a[skeleton[at + 1]] * whole
                if tree < top:
                    rests[at] = kept
                    rests[at + 1] = cut
                    parts[at] = with_root
                    parts[at + 1] = whole
                at += 2
        if modulus:
            total = reduced(total, modulus, inverse)
        if solve:
            total = result[tree] * scale[2 * paint] + total * scale[2 * paint + 1]
            field[tree] = reduced(total, modulus, inverse) if modulus else total
        else:
            total += a[paint] * field[tree]
            result[tree] = reduced(total, modulus, inverse) if modulus else total
        if tree < top:
            parts[here] = field[tree]


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
    absolute value. inverses[i, j] is 1/p_j modulo p_i; `digits` has a row for each prime, as long as the number of
    trees handled together, in SIMD lanes.
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
