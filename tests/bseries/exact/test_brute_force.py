"""Series of methods against brute force: trees as nested tuples, Fractions, and sums over all ordered subtrees."""

import random
from fractions import Fraction
from functools import cache

import pytest

import bseries as bs
from bseries.algebra.stages import RationalStages, stages_of
from bseries.exact import bounds, denominators, recursions, residues, stage_sizes
from bseries_base.lowering import flat_kernels

PRIMES = 1073741789, 1073741783, 1073741741  # the first moduli
NUMBERS = {
    "zeros": [0, 0, 1, -1, Fraction(1, 2)],
    "primes": [*PRIMES, *(Fraction(x, p) for p in PRIMES for x in (1, p + 1, -2)), Fraction(1, PRIMES[0] ** 2), 0],
    "powers of two": [Fraction(1, 2**63), Fraction(-3, 2**31), 2**62, Fraction(5, 2), 2**64, 0],
    "sizes": [10**60, -(10**20), Fraction(1, 10**60 + 1), Fraction(-7, 3), 0],
    "small": [Fraction(p, q) for p in range(-4, 5) for q in (1, 2, 3, 5)],
}


def nested(tree):
    """A tree as its colour and the sorted tuple of its branches."""
    pairs = list(zip(tree.levels, tree.colors, strict=True))

    def read():
        level, color = pairs.pop(0)
        branches = []
        while pairs and pairs[0][0] == level + 1:
            branches.append(read())
        return color, tuple(sorted(branches))

    return read()


def nodes(tree):
    return 1 + sum(map(nodes, tree[1]))


@cache
def subtrees(tree):
    """The ordered subtrees with the root, each with the branches that are cut off."""
    found = [((), ())]
    for branch in tree[1]:
        kept = [((*a, s), b + cut) for a, b in found for s, cut in subtrees(branch)]
        found = [(a, (*b, branch)) for a, b in found] + kept
    return [((tree[0], tuple(sorted(a))), b) for a, b in found]


def weights(all_trees, matrices, rows):
    """Elementary weights, by their definition."""

    @cache
    def values(tree):
        found = [Fraction(1)] * len(rows[0])
        for branch in tree[1]:
            inner = values(branch)
            sums = [sum(a * x for a, x in zip(row, inner, strict=True)) for row in matrices[branch[0]]]
            found = [x * y for x, y in zip(found, sums, strict=True)]
        return found

    return {tree: Fraction(sum(b * x for b, x in zip(rows[tree[0]], values(tree), strict=True))) for tree in all_trees}


def product(a, tree, cut):
    found = Fraction(1)
    for branch in cut:
        found *= a[branch]
    return found


def composed(a, c, empty=1):
    """First the flow a, then c."""
    return {t: empty * a[t] + sum(c[s] * product(a, t, cut) for s, cut in subtrees(t) if c[s]) for t in a}


def inverted(a):
    found = {}
    for tree in sorted(a, key=nodes):
        found[tree] = -a[tree] - sum(found[s] * product(a, tree, cut) for s, cut in subtrees(tree) if cut)
    return found


def combined(a, factor):
    """Σ factor(j) (a − ε)^j in the convolution algebra."""
    term, found = a, dict.fromkeys(a, Fraction(0))
    for j in range(1, max(map(nodes, a)) + 1):
        found = {tree: x + factor(j) * term[tree] for tree, x in found.items()}
        longer = composed(a, term, 0)
        term = {tree: x - term[tree] for tree, x in longer.items()}
    return found


def logarithm(a):
    return combined(a, lambda j: Fraction((-1) ** (j + 1), j))


def power(a, s):
    binomials = [Fraction(1)]
    for j in range(8):
        binomials.append(binomials[-1] * Fraction(s - j) / (j + 1))
    return combined(a, binomials.__getitem__)


def scaled(a, factor):
    return {tree: x * factor ** nodes(tree) for tree, x in a.items()}


def random_method(source, numbers, colors):
    stages = source.choice([1, 1, 2, 3])
    draw = lambda: [Fraction(source.choice(numbers)) for _ in range(stages)]  # noqa: E731
    matrices, rows = [[draw() for _ in range(stages)] for _ in range(colors)], [draw() for _ in range(colors)]
    for A, b in zip(matrices, rows, strict=True):
        A[-1] = source.choice([A[-1], A[0], b, [Fraction(0)] * stages])  # stages may be repeated, or be 0
    tableaus = [bs.RungeKutta(A, b, warn=False) for A, b in zip(matrices, rows, strict=True)]
    method = tableaus[0] if colors == 1 else bs.PartitionedRungeKutta(dict(zip("pqr", tableaus, strict=False)))
    return method, matrices, rows


EXECUTIONS = {
    "interpreter": {"FEW_PRODUCTS": 10**30},
    "machine code": {"FEW_PRODUCTS": -1},
    "primes in threads": {"FEW_PRODUCTS": -1, "SMALL": 0},
    "trees in threads": {"FEW_PRODUCTS": -1, "LARGE": 12},
}


@pytest.fixture(params=EXECUTIONS)
def execution_of_all_kinds(request, monkeypatch):
    for name, value in EXECUTIONS[request.param].items():
        for module in (flat_kernels, residues, recursions):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, value)


@pytest.mark.few(20)
@pytest.mark.parametrize("numbers", NUMBERS)
@pytest.mark.parametrize(("order", "colors", "max_children"), [(5, 1, None), (6, 1, 2), (1, 2, None), (3, 2, None)])
def test_all_that_is_made_of_stages(numbers, order, colors, max_children, execution_of_all_kinds):
    source = random.Random(f"{numbers} {order} {colors}")
    every = list(map(nested, bs.TreeTable(order, colors)))
    table = bs.TreeTable(order, colors, max_children)
    shown = list(map(nested, table))
    method, matrices, rows = random_method(source, NUMBERS[numbers], colors)
    factor, s = Fraction(source.choice([-1, 2, PRIMES[0]]), source.choice([1, 2, PRIMES[1]])), Fraction(-5, 2 * 3)
    a, expected = bs.series(method, table), weights(every, matrices, rows)
    other, smaller = a.scale_step(factor), scaled(expected, factor)
    pairs = [
        (a, expected),
        (bs.modified_equation(method, table), logarithm(expected)),
        (other.log(), logarithm(smaller)),
        (a**s, power(expected, s)),
        (other ** Fraction(1, PRIMES[0]), power(smaller, Fraction(1, PRIMES[0]))),
        (other.inverse(), inverted(smaller)),
        (bs.compose(other, a), composed(smaller, expected)),
        (bs.compose(a, other.inverse()).log(), logarithm(composed(expected, inverted(smaller)))),
    ]
    for found, truth in pairs:
        assert found.coefficients() == [truth[tree] for tree in shown]


@pytest.mark.parametrize("head", [0, 4, 60])
@pytest.mark.parametrize("name", ["dop853", "gauss3", "lobatto-iiic3", "tdrk5", "avf", "lawson4", "rkn-nystrom4"])
def test_sizes_by_order_bound_powers(name, head, monkeypatch):
    """Of the stages of tableaus, families and programs, of inverses, compositions and scaled steps."""
    monkeypatch.setattr(stage_sizes, "HEAD", head)
    method = bs.method(name)
    colors = len(method.names)
    order = 5 if colors == 1 else 3
    table = bs.TreeTable(order, colors)
    stages = stages_of(method, order)
    assert isinstance(stages, RationalStages)
    short = stages.scaled(Fraction(-3, 4))
    for made in (stages, stages.inverse(), short, stages.then(short), short.then(stages.inverse()).inverse()):
        flow = stage_sizes.denominators.__wrapped__(made.stages, order)
        many = denominators.of_powers(flow)
        rough = sharp = stage_sizes.rough_bound(made.real, order)
        if not made.real.error:
            sharp = stage_sizes.bound.__wrapped__(made.real, order)
            assert colors > 1 or all(x <= y + 100 for x, y in zip(sharp, rough, strict=True))  # all is rounded up
        a = dict(zip(map(nested, table), made.series(table).coefficients(), strict=True))
        for k in (1, 2, order):
            bound = sharp if k == 1 else bounds.sum_of_powers([[0] * (k - 1) + [1]] * (order + 1), sharp)
            for tree, x in power(a, k).items():
                n = nodes(tree)
                assert (x * (flow if k == 1 else many)[n]).denominator == 1
                assert abs(x) * bounds.ONE <= bound[n]


def test_sizes_by_order_are_near_the_truth():
    """Beyond the trees whose values are computed, for a method with large entries."""
    stages = stages_of(bs.method("dormand-prince54"), 9)
    a = bs.series("dormand-prince54", 9)
    sharp, rough = stage_sizes.bound(stages.real, 9), stage_sizes.rough_bound(stages.real, 9)
    largest = max(map(abs, a.coefficients()[a.basis.offsets[8] :])) * bounds.ONE
    assert largest <= sharp[9] < 2**9 * largest < 2**30 * largest < rough[9]
    common = stage_sizes.denominators(stages.stages, 9)[9]
    assert common.bit_length() < 90 < 300 < (stages.step**9).bit_length()
