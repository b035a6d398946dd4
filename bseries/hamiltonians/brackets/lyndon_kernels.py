"""Kernels for the Baker–Campbell–Hausdorff series in the Lyndon basis of the free Lie algebra in two letters.

Words of A = 0 and B = 1 are integers whose bits are the letters, the first letter in the highest bit. A Lyndon word
x = uv, where v is its longest proper Lyndon suffix, stands for the bracket P_x = [P_u, P_v]. As a sum of words, P_x is
x plus larger words, so that the coordinates c_x of an element of the Lie algebra with coefficients w_x solve the unit
triangular system c_x = w_x − Σ_{y<x} ⟨P_y, x⟩ c_y, for words with equal letters (H. Hofstätter, arXiv:2102.06570).
"""

from __future__ import annotations

from trees.compiled import kernel

LANES = 16
"""Words that are treated at once, in SIMD registers."""


@kernel
def lyndon_words(length, place, lengths, codes, left, right, norms):
    """List the Lyndon words of up to `length` letters by length and code, with their standard factors.

    ``place[2^n + code]`` becomes the index of a word of n letters, −1 if it is no Lyndon word. `norms` are the sums of
    the coefficients, all positive, of the dual basis S: c_x = Σ_w ⟨S_x, w⟩ w_x is at most norm · max |w_x|. For x = av
    with a letter a and a product v of Lyndon words l_1 ≥ l_2 ≥ …, S_x is a times the shuffle product of the S_(l_i),
    divided by k! for k equal factors (C. Reutenauer, *Free Lie Algebras*, theorem 5.3).
    """
    place[:] = -1
    count = 0
    for n in range(1, length + 1):
        for code in range(1 << n):
            if _is_lyndon(code, n):
                place[(1 << n) + code] = count
                lengths[count], codes[count] = n, code
                cut = n - 1  # letters of the longest proper suffix
                while n > 1 and place[(1 << cut) + (code & ((1 << cut) - 1))] < 0:
                    cut -= 1
                if n > 1:
                    left[count] = place[(1 << (n - cut)) + (code >> cut)]
                    right[count] = place[(1 << cut) + (code & ((1 << cut) - 1))]
                norms[count] = _dual_norm(code & ((1 << (n - 1)) - 1), n - 1, place, norms)
                count += 1


@kernel
def _dual_norm(code, n, place, norms):
    """The sum of the coefficients of S_v for any word v of n letters."""
    norm, last, equal = 1.0, -1, 0
    while n > 0:
        cut = n  # letters of the longest Lyndon prefix
        while place[(1 << cut) + (code >> (n - cut))] < 0:
            cut -= 1
        factor = place[(1 << cut) + (code >> (n - cut))]
        equal = equal + 1 if factor == last else 1
        norm *= norms[factor] / equal
        for k in range(cut):  # the binomial coefficient of n and cut
            norm *= (n - k) / (k + 1)
        n, last = n - cut, factor
        code &= (1 << n) - 1
    return norm


@kernel
def _is_lyndon(code, n):
    """Whether a word is smaller than all its rotations."""
    mask = (1 << n) - 1
    shift = 1
    while shift < n and ((code << shift) & mask) | (code >> (n - shift)) > code:
        shift += 1
    return shift >= n


@kernel
def heinz_numbers(codes, n, primes, numbers):
    """The product of primes[s] over the blocks of s equal letters; it identifies their lengths, without order."""
    for x in range(len(codes)):
        product, block = 1, 1
        for position in range(1, n):
            if (codes[x] >> position) & 1 == (codes[x] >> (position - 1)) & 1:
                block += 1
            else:
                product *= primes[block]
                block = 1
        numbers[x] = product * primes[block]


@kernel
def needed_numbers(members, n, lengths, left, right, ids):
    """Number the ⟨P_b, x[start : start + |b|]⟩ from which all ⟨P_y, x⟩ of one class of words x, y follow.

    ``ids[b, start]`` becomes 0, 1, …, ascending with b, or −1 for numbers that are not needed; returns how many are.
    """
    ids[:] = -1
    for y in members:
        _need(left[y], right[y], 0, lengths, ids)
    for b in range(len(ids) - 1, 1, -1):
        for start in range(n):
            if ids[b, start] >= 0:
                _need(left[b], right[b], start, lengths, ids)
    count = 0
    for b in range(len(ids)):
        for start in range(n):
            if ids[b, start] >= 0:
                ids[b, start] = count
                count += 1
    return count


@kernel
def _need(u, v, start, lengths, ids):
    """Mark the four numbers of ⟨[P_u, P_v], x[start:]⟩."""
    ids[u, start] = ids[v, start + lengths[u]] = ids[v, start] = ids[u, start + lengths[v]] = 0


@kernel
def straight_line(members, n, lengths, left, right, ids, program, operands):
    """The four numbers from which each number follows, and ⟨P_y, x⟩; for single letters the letter and its position."""
    for i in range(len(members)):
        _operands(left[members[i]], right[members[i]], 0, lengths, ids, operands[i])
    for b in range(len(ids)):
        for start in range(n):
            k = ids[b, start]
            if k >= 0:
                if lengths[b] == 1:
                    program[k, 0], program[k, 1] = b, start
                else:
                    _operands(left[b], right[b], start, lengths, ids, program[k])


@kernel
def _operands(u, v, start, lengths, ids, row):
    row[0], row[1] = ids[u, start], ids[v, start + lengths[u]]
    row[2], row[3] = ids[u, start + lengths[v]], ids[v, start]


@kernel
def solve_class(members, n, codes, program, letters, operands, wanted, residues, prime, work, found):
    """Solve the triangular system of the words with equal letters, modulo 2^64 and modulo a prime below 2^31.

    The words `members`, ascending, have n ≤ 31 letters, so that |⟨P_b, x⟩| ≤ 2^(|b|−1) fits into 32 bits. `codes` has
    the codes of all Lyndon words. `program` and `operands` are those of `straight_line`; the first `letters` rows are
    single letters. `wanted` has the coefficients w_x modulo 2^64, and `residues` modulo the prime; the two columns of
    `found` become the coordinates. `work` has rows of `LANES` entries: int32 with a row for each of `program` and one
    more, two of int64.
    """
    values, sums, sums_modulo = work
    size, count = len(members), len(program)
    products = values[count]
    for start in range(0, size, LANES):
        stop = min(start + LANES, size)
        for k in range(letters):
            shift = n - 1 - program[k, 1]
            for lane in range(LANES):
                x = codes[members[min(start + lane, size - 1)]]
                values[k, lane] = (x >> shift) & 1 == program[k, 0]
        for k in range(letters, count):
            a, b, c, d = values[program[k, 0]], values[program[k, 1]], values[program[k, 2]], values[program[k, 3]]
            for lane in range(LANES):
                values[k, lane] = a[lane] * b[lane] - c[lane] * d[lane]
        sums[:], sums_modulo[:] = 0, 0
        for y in range(stop):
            if y >= start:
                found[y, 0] = wanted[y] - sums[y - start]
                found[y, 1] = (residues[y] - sums_modulo[y - start]) % prime
            own, modulo = found[y, 0], found[y, 1]
            a, b = values[operands[y, 0]], values[operands[y, 1]]
            c, d = values[operands[y, 2]], values[operands[y, 3]]
            for lane in range(LANES):
                products[lane] = a[lane] * b[lane] - c[lane] * d[lane]
            for lane in range(LANES):
                sums[lane] += products[lane] * own
                sums_modulo[lane] += products[lane] * modulo
            if y % 1024 == 1023:
                for lane in range(LANES):
                    sums_modulo[lane] %= prime
