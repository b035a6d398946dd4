"""Sums that must be reduced, primes that must be avoided, bounds that must not vanish: what residues rest on."""

import math
from fractions import Fraction

import pytest

import bseries as bs
import trees.basis
import trees.table
from bseries.exact import powers, recursions
from bseries.exact.arithmetic import Exact, prime_field
from bseries.exact.recursions import Stages

with pytest.MonkeyPatch.context() as patch:
    patch.setattr(trees.basis, "machine_code_pays", lambda products: True)
    TABLE = trees.TreeTable(5)

PRIME = 1073741789  # the largest below 2^30, the first that is used


def residues_agree(run):
    """Residues agree with exact numbers."""
    exact, residues = run(Exact()), run(prime_field(PRIME))
    for x, residue in zip(exact, residues, strict=True):
        assert (Fraction(x).numerator - int(residue) * Fraction(x).denominator) % PRIME == 0


HALVES = [Fraction(1)] + [Fraction(1, 2)] * (len(TABLE) - 1)


@pytest.mark.parametrize("stages", [2, 17, 40])
def test_long_sums_over_stages_are_reduced(stages):
    """Residues of 1/2 lie at half the prime: seventeen products of them with a sum that is not reduced overflow."""
    size, half = stages, Fraction(1, 2)
    a = [half if j == 0 else Fraction(0) for _ in range(size) for j in range(size)]
    method = Stages(size, a, [half] * size)

    residues_agree(lambda x: recursions.into_stages(method, TABLE, x, field=x.vector(HALVES)))
    residues_agree(lambda x: recursions.sum_of_powers(TABLE, method, 1, powers.logarithm(5).numerators, x))


def test_long_sums_over_partitions_are_reduced():
    """With b = 1 and a = 2, 1/2, 1/2, …, all terms are 1/2; 128 of them times 1/a(•) would overflow."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trees.basis, "machine_code_pays", lambda products: True)
        table = trees.TreeTable(8)
    a, ones = [2] + [Fraction(1, 2)] * (len(table) - 1), [1] * len(table)
    target = recursions.into_series(a, table, Exact(), field=ones)
    assert [target[first] for first in table.offsets[:-1]] == [Fraction(2 ** (n - 1) + 3, 2) for n in range(1, 9)]
    prime = prime_field(PRIME)
    vectors = [prime.vector(x) for x in (a, target)]
    found = recursions.into_series(vectors[0], table, prime, target=vectors[1], inverses=[Fraction(1, 2)])
    assert found.tolist() == ones


@pytest.mark.slow
@pytest.mark.parametrize("length", [3, 62])
def test_long_blocks_are_reduced(length):
    """A path of many halves: products of polynomials with more terms than residues can add up."""
    half = Fraction(1, 2)
    a = [half * (i > 0) if j == 0 else Fraction(0) for i in range(length) for j in range(length)]
    b = [half] * length
    method = Stages(length, a, b, [0] * length, [length])
    residues_agree(lambda x: recursions.sum_of_powers(TABLE, method, 1, powers.logarithm(5).numerators, x))
    residues_agree(lambda x: recursions.into_stages(method, TABLE, x, field=x.vector(HALVES)))


def test_numbers_that_are_divided_by_may_be_primes_in_use(execution):
    identity = bs.BSeries.from_rule(lambda tree: int(tree.order == 1), 6, empty=0)
    b = bs.BSeries.from_rule(lambda tree: Fraction(PRIME) if tree.order == 1 else Fraction(1, 7), 6, empty=0)
    assert bs.substitute(bs.algebra.substitution_inverse(b), b) == identity
    weights = [Fraction(PRIME, 2)] * 2
    method = bs.RungeKutta([[Fraction(1, 3), Fraction(1, 6)], [Fraction(1, 5), Fraction(1, 7)]], weights, warn=False)
    assert bs.substitute(bs.modifying_integrator(method, 6), method) == bs.exact_flow(6)


@pytest.mark.parametrize("t", [Fraction(3**50, 2**240), Fraction(3**30, 2**170), Fraction(1, 10**80)])
def test_tiny_numbers_do_not_vanish_from_bounds(execution, t):
    """The inverse of f + t h f'f has Catalan numbers, with signs, at chains: bounds that underflow lose them."""
    b = bs.BSeries.from_rule(lambda tree: {1: 1, 2: t}.get(tree.order, 0), 8, empty=0)
    x = bs.algebra.substitution_inverse(b)
    chain, expected = bs.Tree("τ"), []
    for n in range(1, 9):
        expected.append((-t) ** (n - 1) * math.comb(2 * n - 2, n - 1) / n)
        assert x[chain] == expected[-1]
        chain = bs.Tree.join([chain])
