"""Compiled recursions of substitution: another field in place of f, in a method's stages or in any series.

As in `bseries.exact.kernels`, each kernel is one source for all kinds of numbers. (Callees live there: whoever changes
one must touch this file too, or the machine code kept on disk grows stale.)
"""

from __future__ import annotations

from bseries.exact.kernels import inlined, reduce_all, reduced, row_sum, weighted_sum, weighted_terms
from trees.compiled import kernel


@kernel
def substitute_in_stages(
    first, last, order, color, start, trunk, branch, width, top, stages, blocks, live, relation, degrees, row_start,
    row_column, a, b, moved, solve, scale, lift, weights, tails, negated, negated_tails, modulus, rows, logs,
    generators, field, result, value, inner, terms, log_terms,
):  # fmt: skip
    """A method applied to the field b in place of f, or the b for which the method's result is given.

    Stage i evaluates the substituted field at its own point: the series k_i = b(Y_i) = Σ_j ∂_ℓ^j b / j! with the
    generator ℓ = log Y_i, and Y_i = y + Σ_j a_ij k_j. On a tree, ∂_ℓ^j b for j ≥ 1 and the nonlinear part of log Y_i
    need smaller trees only, so one sweep over the trees finds everything; the result is Σ_i b_i k_i.

    Args:
        first, last, order, color, start, trunk, branch, width, top, modulus: As for `bseries.exact.kernels.lie_series`.
        stages: Number of components of stage vectors.
        blocks, relation: Blocks that multiply as polynomials, as for `bseries.exact.kernels.elementary_weights`; every
            component is a block where products are componentwise.
        live: For each block the place of its first component among those of stages that do not sit at the start value;
            `moved` for those that do, where k is b itself.
        degrees: For each block the number of coefficients of a product that can differ from zero.
        row_start, row_column, a: The stage matrices, as for `elementary_weights`.
        b: Weights, colour by colour.
        moved: Number of live components.
        solve: Whether `result` is given and `field` sought.
        scale: For each colour the factors of the result and of the part known already: 1/B and −1/B, B = Σ b_i.
        lift: Factor on what is known already of the stages' values, towards b (1 but for `arithmetic.WrappedStages`).
        weights, tails, negated, negated_tails: 1/j!, and −1/j! (for bounds 1/j!), j = 0, 1, … (see
            `bseries.exact.kernels.weighted_terms`).
        rows, logs: ∂_ℓ^j b from j = 0 and ∂_ℓ^j id from j = 1, for each tree and live component, zeros behind.
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
    """∂_ℓ^(j+1) b and ∂_ℓ^(j+2) id on a tree, whose splits are first … last−1, for the stages of one block.

    The block has `size` components, the first of them at `place` among those kept and at `at` among all; a product has
    `many` coefficients. `terms` and `log_terms` hold the result, `width` entries for each component.
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

    The partitions of a tree with n nodes are the subsets of its edges that are cut, 2^(n−1) of them from
    start[n] + tree · 2^(n−1) on, as `trees.table.Partitions` lists them: those of u ∘ v come in pairs, one for
    each pair of partitions of u and v, the new edge first kept and then cut. The first partition has no cut at all:
    its skeleton is a single node, its only part the tree.

    Args:
        first, last: Range of ids; all trees below `first` have been done.
        top: Products are kept for ids below this one.
        colors: Number of colours; ids below are single nodes.
        order, color, left, right: Columns of the table.
        start, skeleton, part: The partitions: skeleton, and the part that holds the root.
        a: The series that b is put into.
        solve: Whether `result` is given and `field` sought.
        scale: For each colour the factors of the result and of the part known already: 1/a(•) and −1/a(•).
        modulus: 0, or the prime that everything is reduced by.
        rests, parts: For each partition the product of b over its parts without and with the root's.
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
                # The first partition has the tree itself as part, and nothing else: added below.
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
