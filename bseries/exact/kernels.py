"""Inner loops of Lie series and of substitution, for every kind of number.

Each kernel is one source. Compiled, it runs on float64, on int64 modulo 2^64, and on residues modulo a prime below 2^30
(sums of up to 30 products in int64); interpreted, on lists of Python or SymPy numbers. A `modulus` of 0 means no
reduction.
"""

from __future__ import annotations

from bseries.exact.power_kernels import FEW, add_multiple, reduce_range
from bseries_base.lowering.flat_kernels import flat_kernel


@flat_kernel
def add_weighted(terms, at, weights, tails, has_tails, first, count, total, to):
    """total[to] += Σ terms[at + j] · weights[first + j] over j < count; for floats, as if in twice the precision.

    These sums cancel: terms of size 1/γ leave the small error coefficients of a method of high order. Exact numbers
    have no tails. For floats a factor is weights[j] + tails[j], where weights[j] has 24 bits; Veltkamp's splitting
    leaves 26 bits of the term, so that their product is exact. Knuth's two-sum finds the rounding errors of the sum,
    which are added at the end (T. Ogita, S. M. Rump, S. Oishi, *Accurate sum and dot product*, SIAM J. Sci. Comput. 26
    (2005), algorithm 5.3).
    """
    if has_tails:
        now = total[to]
        rest = now * 0
        for j in range(count):
            term = terms[at + j]
            shifted = term * 134217729
            high = shifted - (shifted - term)
            product = high * weights[first + j]
            rest += (term - high) * weights[first + j] + term * tails[first + j]
            longer = now + product
            gained = longer - now
            rest += (now - (longer - gained)) + (product - gained)
            now = longer
        total[to] = now + rest
    else:
        for j in range(count):
            total[to] += terms[at + j] * weights[first + j]


@flat_kernel
def lie_series(
    first, last, order, start, trunk, branch, multiplicity, is_weighted, width, top, solve, sparse, field, base,
    has_base, empty, weights, tails, has_tails, modulus, rows, result, terms,
):  # fmt: skip
    """Σ_j weights[j] · ∂_b^j c for the elements first … last−1 of a basis, or the b for which that sum is given.

    The Lie derivative of c along the field b (for rooted trees HLW, Lemma IX.9.1):

        (∂_b c)(τ) = c(∅) b(τ) + Σ_{cuts of τ} multiplicity · c(trunk) b(branch).

    Args:
        first, last: Range of ids; smaller elements are done.
        order: Number of nodes of every element.
        start, trunk, branch, multiplicity: Cuts, as `trees.basis.Cuts` describes them.
        is_weighted: Whether there are multiplicities.
        width: Length of a row.
        top: Rows are kept for ids below this one.
        solve: If true, c is the identity (c(∅) = 1, else 0), `result` is given and `field` is solved for: the sum
            begins with b itself, and the factors of the other derivatives are negated.
        sparse: Whether b vanishes at most elements, so that testing for zero pays.
        field: b at every element; read, or written when solving.
        base, has_base, empty: c at every element (without: zero) and, as a vector of one number, at ∅.
        weights, tails, has_tails: Factor of the j-th derivative, j = 0 … n (see `add_weighted`; the first two have no
            tails).
        modulus: 0, or the prime.
        rows: For each element a row of ∂_b^j c, from j = 0 (from j = 1 without `base`), with zeros after j = n.
        result: Output, or the given sum.
        terms: Scratch of one more than `width` entries.
    """
    shift = 1 if has_base else 0
    inverse = 1.0 / modulus if modulus else 0.0
    for tree in range(first, last):
        n = order[tree]
        for j in range(width):
            terms[j] = 0
        begin = start[tree - first]
        for k in range(begin, start[tree - first + 1]):
            factor = field[branch[k]]
            if is_weighted:
                terms[width] = factor * multiplicity[k]
                if modulus:
                    reduce_range(terms, width, width + 1, modulus, inverse)
                factor = terms[width]
            if not sparse or factor != 0:
                add_multiple(factor, rows, trunk[k] * width, width, terms, 0)
            if modulus and (k - begin) % FEW == FEW - 1:
                reduce_range(terms, 0, width, modulus, inverse)
        if modulus:
            reduce_range(terms, 0, width, modulus, inverse)
        # Now terms[j] = ∂_b^(j+2−shift) c at the tree; for j = 0 with a base still without c(∅) b(τ).
        if solve:
            field[tree] = result[tree]
            add_weighted(terms, 0, weights, tails, has_tails, 2, n - 1, field, tree)
            if modulus:
                reduce_range(field, tree, tree + 1, modulus, inverse)
            derivative = field[tree]
        else:
            derivative = terms[0] * shift + empty[0] * field[tree]
            terms[width] = derivative
            if modulus:
                reduce_range(terms, width, width + 1, modulus, inverse)
            derivative = terms[width]
            result[tree] = derivative * weights[1]
            if has_base:
                result[tree] += base[tree] * weights[0]
            add_weighted(terms, shift, weights, tails, has_tails, 2, n - 1, result, tree)
            if modulus:
                reduce_range(result, tree, tree + 1, modulus, inverse)
        if tree < top:
            row = tree * width
            if has_base:
                rows[row] = base[tree]
            rows[row + shift] = derivative
            for j in range(shift, n - 1 + shift):
                rows[row + 1 + j] = terms[j]


@flat_kernel
def substitute_in_stages(
    first, last, order, color, start, trunk, branch, width, top, blocks, ends, live, degrees, relation, row_start,
    row_column, a, b, moved, solve, scale, lift, weights, tails, has_tails, negated, negated_tails, modulus, rows, logs,
    generators, field, result, value, inner, terms, log_terms, sums,
):  # fmt: skip
    """Apply a method to the field b in place of f, or find the b for which the result is given.

    Stage i evaluates the substituted field at its own point Y_i = y + Σ_j a_ij k_j: its stage derivative is
    k_i = b(Y_i) = Σ_j ∂_ℓ^j b / j! with the generator ℓ = log Y_i. On a tree, ∂_ℓ^j b for j ≥ 1 and the nonlinear part
    of log Y_i need smaller trees only, so one sweep over the trees suffices; the result is Σ_i b_i k_i.

    Args:
        first, last, order, color, start, trunk, branch, width, top, modulus, has_tails: As for `lie_series`; the cuts
            have no multiplicities.
        blocks, ends, relation, row_start, row_column, a, b: As for `sum_of_powers`.
        live: For each block the index of its first component among those of stages with Y_i ≠ y; `moved` for stages
            with Y_i = y, where k is b itself.
        degrees: For each block the number of coefficients of a product that can be nonzero.
        moved: Number of live components.
        solve: Whether `result` is given and `field` sought.
        scale: For each colour the factors of the result and of the known part: 1/B and −1/B, B = Σ b_i.
        lift: Factor on the known part of the stage derivatives (1 except in `arithmetic.WrappedStages`).
        weights, tails, negated, negated_tails: 1/j!, and −1/j!, j = 0, 1, … (see `add_weighted`).
        rows, logs: ∂_ℓ^j b from j = 0 and ∂_ℓ^j id from j = 1, for each tree and live component, then zeros.
        generators: ℓ, for each tree and live component.
        field, result: b and the result, for each tree.
        value, inner: Scratch, one entry per component.
        terms, log_terms: Scratch, `width` entries for each coefficient of the longest product.
        sums: Scratch of one entry.
    """
    inverse = 1.0 / modulus if modulus else 0.0
    size = ends[blocks]
    for tree in range(first, last):
        n = order[tree]
        paint = color[tree] * size
        for i in range(size):
            value[i] = 0
            inner[i] = 0
        for e in range(blocks):
            at = ends[e]
            length = ends[e + 1] - at
            place = live[e]
            if place < moved:
                differentiate(
                    start[tree - first], start[tree - first + 1], trunk, branch, width, moved, place, length,
                    degrees[e], relation, at, modulus, inverse, rows, logs, generators, terms, log_terms,
                )  # fmt: skip
                for x in range(length):
                    add_weighted(log_terms, x * width, negated, negated_tails, has_tails, 2, n - 1, inner, at + x)
                    add_weighted(terms, x * width, weights, tails, has_tails, 1, n - 1, value, at + x)
                    if modulus:
                        reduce_range(inner, at + x, at + x + 1, modulus, inverse)
                        reduce_range(value, at + x, at + x + 1, modulus, inverse)
                    if tree < top:
                        row = (tree * moved + place + x) * width
                        for j in range(n - 1):
                            rows[row + 1 + j] = terms[x * width + j]
                            logs[row + 1 + j] = log_terms[x * width + j]
        if solve:
            weigh(value, b, paint, size, modulus, inverse, sums)
            field[tree] = result[tree] * scale[2 * color[tree]] + sums[0] * scale[2 * color[tree] + 1]
            if modulus:
                reduce_range(field, tree, tree + 1, modulus, inverse)
        for i in range(size):
            value[i] *= lift
        for e in range(blocks):
            value[ends[e]] += field[tree]
        if modulus:
            reduce_range(value, 0, size, modulus, inverse)
        if not solve:
            weigh(value, b, paint, size, modulus, inverse, sums)
            result[tree] = sums[0]
        if tree < top:
            for e in range(blocks):
                if live[e] < moved:
                    rows[(tree * moved + live[e]) * width] = field[tree]
                    for i in range(ends[e], ends[e + 1]):
                        at = tree * moved + live[e] + i - ends[e]
                        sums[0] = inner[i]
                        for k in range(row_start[paint + i], row_start[paint + i + 1]):
                            sums[0] += value[row_column[k]] * a[k]
                            if modulus and k % 15 == 0:
                                reduce_range(sums, 0, 1, modulus, inverse)
                        if modulus:
                            reduce_range(sums, 0, 1, modulus, inverse)
                        generators[at] = sums[0]
                        logs[at * width] = sums[0]


@flat_kernel
def weigh(value, b, first, count, modulus, inverse, sums):
    """sums[0] = Σ value[i] · b[first + i] over i < count."""
    sums[0] = 0
    for i in range(count):
        sums[0] += value[i] * b[first + i]
        if modulus and i % 15 == 14:
            reduce_range(sums, 0, 1, modulus, inverse)
    if modulus:
        reduce_range(sums, 0, 1, modulus, inverse)


@flat_kernel
def differentiate(
    first, last, trunk, branch, width, moved, place, size, many, relation, at, modulus, inverse, rows, logs, generators,
    terms, log_terms,
):  # fmt: skip
    """∂_ℓ^(j+1) b and ∂_ℓ^(j+2) id for the stages of one block, on the tree whose cuts are first … last−1.

    The block has `size` components, from index `place` among the live ones and from `at` among all; a product has
    `many` coefficients. `terms` and `log_terms` receive the result, `width` entries for each component.
    """
    for j in range(many * width):
        terms[j] = 0
        log_terms[j] = 0
    for k in range(first, last):
        low = branch[k] * moved + place
        row = (trunk[k] * moved + place) * width
        for x in range(size):
            for y in range(min(size, many - x)):
                add_multiple(generators[low + y], rows, row + x * width, width, terms, (x + y) * width)
                add_multiple(generators[low + y], logs, row + x * width, width, log_terms, (x + y) * width)
            if modulus and size > 1 and (x % 16 == 15 or x == size - 1):
                reduce_range(terms, 0, many * width, modulus, inverse)
                reduce_range(log_terms, 0, many * width, modulus, inverse)
    if modulus and size == 1:
        reduce_range(terms, 0, width, modulus, inverse)
        reduce_range(log_terms, 0, width, modulus, inverse)
    for k in range(many - size):
        d = many - 1 - k
        for x in range(size):
            if relation[at + x] != 0:
                back = (d - size + x) * width
                for j in range(width):
                    terms[back + j] -= terms[d * width + j] * relation[at + x]
                    log_terms[back + j] -= log_terms[d * width + j] * relation[at + x]
                if modulus:
                    reduce_range(terms, back, back + width, modulus, inverse)
                    reduce_range(log_terms, back, back + width, modulus, inverse)


@flat_kernel
def substitute_in_series(
    first, last, top, colors, order, color, left, right, start, skeleton, part, a, solve, scale, modulus, rests, parts,
    field, result, work,
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
        work: Scratch of seven entries.
    """
    inverse = 1.0 / modulus if modulus else 0.0
    for tree in range(first, last):
        n = order[tree]
        here = start[n] + tree * (1 << (n - 1))
        paint = color[tree]
        work[6] = a[paint] * 0
        if tree >= colors:
            u = left[tree]
            v = right[tree]
            many_u = 1 << (order[u] - 1)
            many_v = 1 << (order[v] - 1)
            of_u = start[order[u]] + u * many_u
            of_v = start[order[v]] + v * many_v
            at = here
            for i in range(of_u, of_u + many_u):
                for j in range(of_v, of_v + many_v):
                    work[0] = rests[i] * rests[j]
                    work[1] = rests[i] * parts[j]
                    work[2] = parts[i] * parts[j]
                    if modulus:
                        reduce_range(work, 0, 3, modulus, inverse)
                    # The first partition, whose only part is the tree itself, is added below.
                    work[3] = field[part[at]] * work[0] if at > here else work[0] * 0
                    if modulus:
                        reduce_range(work, 3, 4, modulus, inverse)
                    work[4] = a[skeleton[at]] * work[3]
                    work[5] = a[skeleton[at + 1]] * work[2]
                    if modulus:
                        reduce_range(work, 4, 6, modulus, inverse)
                    work[6] += work[4] + work[5]
                    if tree < top:
                        rests[at] = work[0]
                        rests[at + 1] = work[1]
                        parts[at] = work[3]
                        parts[at + 1] = work[2]
                    at += 2
            if modulus:
                reduce_range(work, 6, 7, modulus, inverse)
        elif tree < top:
            rests[here] = 1
        if solve:
            field[tree] = result[tree] * scale[2 * paint] + work[6] * scale[2 * paint + 1]
            if modulus:
                reduce_range(field, tree, tree + 1, modulus, inverse)
        else:
            result[tree] = work[6] + a[paint] * field[tree]
            if modulus:
                reduce_range(result, tree, tree + 1, modulus, inverse)
        if tree < top:
            parts[here] = field[tree]
