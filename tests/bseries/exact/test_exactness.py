"""The fast exact path against plain numbers: residues, bounds, denominators, and their negative controls."""

import json
import math
import random
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bseries as bs
import trees.table
from bseries.algebra.stages import stages_of
from bseries.exact import bounds, kernels, lie, powers, recursions
from bseries.exact.arithmetic import factorial_weights, floats
from bseries.exact.denominators import smallest_step
from bseries.exact.rationals import Operation, RationalValues, evaluate
from bseries.exact.residues import exact_integers, from_residues, primes_beyond
from bseries_base.lowering import flat_kernels

ORDER = 6
FAST, PLAIN = -1, math.inf
"""Of products: all of them in machine code, or none."""


def by(products, function, *arguments):
    """The result of a function in machine code, or in the interpreter."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flat_kernels, "FEW_PRODUCTS", products)
        return function(*arguments)


TABLE = by(FAST, trees.TreeTable, ORDER)


def modified(method, products=FAST, table=TABLE):
    return by(products, stages_of(method, table.max_order).logarithm, table)


def by_lie_derivatives(method, table=TABLE):
    """The logarithm by another method: cuts, in rational numbers."""
    return by(PLAIN, lambda: lie.logarithm(stages_of(method, table.max_order).series(table)))


numbers = st.one_of(
    st.fractions(-3, 3, max_denominator=12),
    st.fractions(max_denominator=10**12),
    st.integers(-(10**30), 10**30).map(Fraction),
    st.integers(1, 10**30).map(lambda n: Fraction(1, n)),
    st.just(Fraction(0)),
)


@st.composite
def tableaus(draw):
    stages = draw(st.integers(1, 4))
    row = st.lists(numbers, min_size=stages, max_size=stages)
    return bs.RungeKutta(draw(st.lists(row, min_size=stages, max_size=stages)), draw(row), warn=False)


@settings(max_examples=150, deadline=None)
@given(tableaus())
def test_modified_equations_of_random_tableaus(method):
    found = modified(method).coefficients()
    assert found == modified(method, PLAIN).coefficients() == by_lie_derivatives(method).coefficients()


@pytest.mark.parametrize("largest", [2**31, 2**62])
@pytest.mark.parametrize("seed", range(3))
def test_modified_equations_of_large_entries(largest, seed):
    source = random.Random(seed)
    number = lambda: Fraction(source.randint(-largest, largest), source.randint(1, largest))  # noqa: E731
    method = bs.RungeKutta([[number() for _ in range(3)] for _ in range(3)], [number() for _ in range(3)], warn=False)
    assert modified(method).coefficients() == by_lie_derivatives(method).coefficients()


def test_a_wrong_weight_is_noticed(monkeypatch):
    right, method = powers.logarithm(ORDER), bs.method("rk4")
    wrong = replace(right, numerators=(*right.numerators[:-1], (*right.numerators[-1][:-1], 2)))
    monkeypatch.setattr(powers, "logarithm", lambda order: wrong)
    assert modified(method).coefficients() != by_lie_derivatives(method).coefficients()


@pytest.mark.parametrize("name", ["explicit-midpoint", "rk4", "gauss2", "stormer-verlet-kdk", "tdrk5", "crouzeix3"])
@pytest.mark.parametrize("s", [Fraction(3), Fraction(-1), Fraction(1, 2), Fraction(-5, 6), Fraction(1000)])
def test_powers_are_those_by_lie_derivatives(name, s, execution):
    a = bs.series(name, 5)
    assert (a**s).coefficients() == lie.power(a.stored, s).coefficients()


@pytest.mark.parametrize("name", ["rk4", "gauss2", "stormer-verlet-kdk", "tdrk5", "lie-trotter", "symplectic-euler-p"])
def test_stages_of_inverses_and_compositions(name, execution):
    a = bs.series(name, 4)
    c = bs.exact_flow(4, colors=a.table.colors, names=a.names).scale_step(Fraction(1, 3))
    table, size = a.table, range(len(a))
    inverse = lie.power(a.stored, Fraction(-1))
    assert a.inverse().coefficients() == inverse.coefficients()
    assert a.adjoint().adjoint() == a
    twice = lie.composition(a.stored, a.stored, 1)
    assert bs.compose(a, a).coefficients() == twice.coefficients() == (a**2).coefficients()
    both = bs.compose(bs.compose(a, a.scale_step(Fraction(1, 2))), c)
    half = RationalValues.from_fractions(table, [a.coefficients()[i] / 2 ** int(table.order[i]) for i in size])
    expected = lie.composition(lie.composition(a.stored, half, 1), c.stored, 1)
    assert both.coefficients() == expected.coefficients()


def with_numerators_of(bits):
    """A method whose numerators of the top order have about so many bits."""
    odd = max(3, round(2 ** (bits / ORDER)) | 1)
    return bs.RungeKutta([[0, 0], [Fraction(-1, odd), 0]], [Fraction(odd - 1, odd), Fraction(1, odd)], warn=False)


@pytest.mark.parametrize("bits", [10, 20, 40, 62, 63, 64, 93, 94, 126, 127, 128, 300])
def test_every_size_of_numerators_has_been_seen(bits, monkeypatch):
    """Denominators chosen such that numerators of the top order have about so many bits."""
    used = []
    run = recursions.sum_of_powers
    monkeypatch.setattr(recursions, "sum_of_powers", lambda *a: used.append(a[-1].modulus) or run(*a))
    method = with_numerators_of(bits)
    found = modified(method)
    modulo, *primes = used
    assert found.coefficients() == by_lie_derivatives(method).coefficients()
    largest = max(abs(int(x)) for x in found.raw).bit_length()
    assert abs(largest - bits) < 12
    assert modulo == 0  # 2^64
    assert len(primes) == max(0, -(-(largest - 58) // 30)) or abs((largest - 63) % 30 - 15) > 8


def test_many_stages_and_families():
    for name in ("dop853", "gauss4", "radau-ia3", "lobatto-iiib4"):
        method = bs.method(name)
        assert modified(method).coefficients() == by_lie_derivatives(method).coefficients()


def largest_of(values):
    return [max(map(abs, values.coefficients()[i.start : i.stop])) for i in map(values.basis.ids, range(1, ORDER + 1))]


@pytest.mark.parametrize("seed", range(5))
def test_bounds_hold(seed):
    """Of every operation, over random values; and what is known makes that of the logarithm sharper."""
    source = random.Random(seed)
    numbers = [Fraction(source.randint(-20, 20), source.randint(1, 9)) for _ in range(2 * len(TABLE))]
    a, c = (RationalValues.from_fractions(TABLE, x) for x in (numbers[: len(TABLE)], numbers[len(TABLE) :]))
    seen = []

    def checked(table, operands, operation):
        found = evaluate(table, operands, operation)
        known = (bounds.ONE, *map(bounds.scaled, largest_of(found)[:-1]))
        loose, sharp = operation.bound((bounds.ONE,)), operation.bound(known)
        for n, x in enumerate(largest_of(found), 1):
            seen.append(Fraction(loose[n], bounds.ONE) / x if x else 1)
            assert x * bounds.ONE <= loose[n]
            assert n < ORDER or x * bounds.ONE <= sharp[n] <= loose[n]
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lie, "apply", checked)
        lie.logarithm(a), lie.exponential(a), lie.power(a, Fraction(-3, 2))
        lie.composition(a, c, 1), lie.composition(a, c, 0), lie.derivative(a, c, 1), lie.derivative(a, c, 0)
    assert min(seen) >= 1
    assert max(seen) < 10**7


@pytest.mark.parametrize("name", ["explicit-midpoint", "rk4", "heun2"])
def test_what_is_known_leaves_few_bits(name):
    """With the true sizes of smaller trees the bound of the logarithm is near the true size."""
    stages = stages_of(bs.method(name), ORDER)
    known = (bounds.ONE, *map(bounds.scaled, largest_of(modified(bs.method(name)))))
    bound = bounds.logarithm(trees.TreeTable.growth, stages.bound(ORDER), known[:-1])
    assert 1 <= bound[ORDER] / known[ORDER] < 2**8


def test_bounds_neither_underflow_nor_overflow():
    for entry in (Fraction(1, 10**200), Fraction(10**200), Fraction(1)):
        method = bs.RungeKutta([[0, 0], [entry, 0]], [entry, 1 / entry], warn=False)
        assert modified(method).coefficients() == by_lie_derivatives(method).coefficients()


def test_moduli_beyond_the_bound_change_nothing(monkeypatch):
    method, usual = with_numerators_of(100), bounds.numerator_bits
    found = modified(method)
    monkeypatch.setattr(bounds, "numerator_bits", lambda *a: [x + 100 for x in usual(*a)])
    more = modified(method)
    assert list(map(int, more.raw)) == list(map(int, found.raw))
    monkeypatch.setattr(bounds, "numerator_bits", lambda *a: [max(1, x - 60) for x in usual(*a)])
    assert modified(method).coefficients() != found.coefficients()


@pytest.mark.parametrize("wrapped", [True, False])
@pytest.mark.parametrize("bits", [1, 20, 61, 62, 63, 64, 92, 93, 100, 128, 1000])
def test_residues_give_back_integers_of_either_sign(bits, wrapped):
    source = random.Random(bits)
    top = 2**bits
    integers = [0, 1, -1, top, -top, *(source.randint(-top, top) for _ in range(600))]
    primes = primes_beyond(bits + 1.5 - 64 * wrapped) if bits > 62 or not wrapped else []
    low = np.array([(x + 2**63) % 2**64 - 2**63 for x in integers]) if wrapped else None
    given = [np.array([x % p for x in integers]) for p in primes]
    assert list(from_residues(given, primes, low)) == integers
    if len(primes) > 1:  # one prime less, and they are lost: the count of primes is not generous by more than one
        assert list(from_residues(given[:-1], primes[:-1], low)) != integers


def test_integers_are_known_order_by_order():
    """Sizes that are found at small orders prove those at larger ones."""
    integers = [3, -(2**50), 2**70, 2**20, -(2**120), 5]
    offsets, used = [0, 1, 2, 4, 6], []

    def run(prime):
        used.append(prime)
        return np.array([(x + 2**63) % 2**64 - 2**63 if not prime else x % prime for x in integers])

    def bits_of(largest):
        return [2, 51, 71 if len(largest) > 1 else 1000, 121 if len(largest) > 2 else 2000]

    assert list(exact_integers(run, offsets, bits_of, [1, 2, 3, 60])) == integers
    assert used[0] == 0
    assert len(used) < 5


def test_primes_are_prime_distinct_and_avoid_denominators():
    first = primes_beyond(200, 1)
    assert len(set(first)) == len(first)
    assert all(p % d for p in first for d in range(2, math.isqrt(p) + 1))
    assert first[0] not in primes_beyond(200, first[0] * 12)
    with pytest.raises(bs.SeriesError, match="must have coefficients of fewer digits"):
        primes_beyond(1e7, 1)


def test_a_denominator_that_is_a_prime_of_the_pool():
    prime = primes_beyond(10, 1)[0]
    method = bs.RungeKutta([[Fraction(1, prime)]], [1], warn=False)
    assert modified(method).coefficients() == by_lie_derivatives(method).coefficients()


def test_a_wrong_denominator_bound_is_noticed():
    a = stages_of(bs.method("rk4"), ORDER).series(TABLE)
    wrong = Operation(
        lambda arithmetic, target: recursions.logarithm(target(field=True), TABLE, arithmetic),
        lambda known: known,
        lambda n, step: step**n,
        field=True,
    )
    with pytest.raises(ArithmeticError, match="denominator bound is wrong"):
        by(PLAIN, evaluate, TABLE, [a], wrong)


def test_smallest_step():
    assert smallest_step([1, 2, 4, 8], 2**10 * 5) == 2
    assert smallest_step([1, 1, 2, 6, 24, 120], 120) == 30


def test_denominators_of_an_operation_itself():
    """Powers and scaled operands whose denominators are large, or primes of the pool."""
    prime = primes_beyond(10, 1)[0]
    a = bs.BSeries(TABLE, modified(bs.method("rk4")), 0).exp()
    assert (a ** Fraction(1, prime)) ** prime == a
    assert a ** Fraction(1, 6) == (a ** Fraction(1, 2)) ** Fraction(1, 3)
    assert (a ** Fraction(0.1)).log() == a.log() * Fraction(0.1)
    assert (
        bs.compose(a, a.with_empty(Fraction(1, 2 * prime)))["[τ]"]
        == a["[τ]"] * Fraction(1, 2 * prime) + a["τ"] + a["[τ]"]
    )


def test_the_least_int64():
    """|−2^63| is no int64: a bound taken from it would collapse."""
    values = [2**63 if tree == bs.Tree("[[[[[τ]]]]]") else 0 for tree in TABLE]
    a = bs.BSeries(TABLE, RationalValues.from_fractions(TABLE, values), 1)
    top = a.inverse()
    assert top["[[[[[τ]]]]]"] == -(2**63)
    assert top.inverse() == a
    assert (top**5)["[[[[[τ]]]]]"] == -5 * 2**63


def test_common_divisors_beyond_int64():
    """Those of numerators that all vanish, or that all are −2^63."""
    numerators = np.array([{1: 1, ORDER: -(2**63)}.get(int(n), 0) for n in TABLE.order])
    values = RationalValues(TABLE, numerators, [1, 3, 3**50, 2**63, 2**64, 1, 2**64], 6**50)
    assert values.reduced.denominators == (1, 3, 1, 1, 1, 1, 2)
    assert values.reduced.coefficients() == values.coefficients()


def test_numbers_beyond_floats():
    a = bs.BSeries(TABLE, modified(bs.method("heun2")), 0).exp()
    huge = a ** (10**400)
    assert huge["[τ]"] == Fraction(10**800, 2)
    assert (huge ** Fraction(1, 10**400)) == a


def test_orders_without_trees(execution):
    on = trees.TreeTable(5, 1, 0)
    assert on.sizes == [1, 0, 0, 0, 0]
    assert bs.modified_equation(bs.method("rk4"), on).coefficients() == [1]
    assert bs.modified_equation(bs.method("rk4"), on).exp().log().coefficients() == [1]


def test_tables_of_many_nodes(execution):
    """Tall trees with up to 40 nodes: R(z) = 1 + z + z²/2 of heun2 and its logarithm, as power series."""
    on = trees.TreeTable(40, 1, 1)
    b = bs.modified_equation("heun2", on)
    log = [Fraction(0)]  # R' = (log R)' R
    for n in range(1, 41):
        known = sum(k * log[k] * {1: 1, 2: Fraction(1, 2)}.get(n - k, 0) for k in range(1, n))
        log.append((Fraction(n < 3) - known) / n)
    assert b.coefficients() == log[1:]
    assert b.exp() == bs.series("heun2", on)


@pytest.mark.parametrize("order", [9, 12])
def test_floats_agree_with_exact_coefficients(order):
    exact = bs.modified_equation(bs.method("rk4"), order)
    rounded = bs.modified_equation(bs.method("rk4").to_float(), order)
    assert rounded.domain == "RR"
    assert np.allclose(rounded.coefficients(), [float(x) for x in exact.coefficients()], rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize("implementation", ["py_func", "compiled"])
def test_sums_of_floats_lose_nothing_when_they_cancel(implementation):
    """What is left of a sum less its rounded value, 2⁻⁵⁴ or so, still has twenty bits."""
    source = random.Random(1)
    terms = np.array([source.uniform(-1, 1) for _ in range(15)])
    exact = sum((Fraction(x) / math.factorial(j) for j, x in enumerate(terms, 2)), Fraction(0))
    run, total = getattr(kernels.add_weighted, implementation), np.array([-float(exact)])
    run(terms, 0, *factorial_weights(floats(), 16, 1, False), True, 2, 15, total, 0)
    assert abs(Fraction(total[0]) - (exact - Fraction(float(exact)))) < Fraction(1, 2**74)


RESULTS = '''
import json, random, sys
from fractions import Fraction

import bseries as bs
from integrators import catalogue


def unless_refused(function, *arguments, **options):
    try:
        return function(*arguments, **options)
    except bs.errors as error:
        return str(error)


def algebra(a, order):
    """What exact algebra makes of a flow."""
    exact = bs.exact_flow(order, colors=a.table.colors, names=a.names)
    b, half = a.log(), Fraction(1, 2)
    yield from (b, b.exp(), a.inverse(), a.adjoint(), a**half, a ** Fraction(-2, 3))
    yield from (bs.compose(a, exact), bs.compose(a.scale_step(half), a.adjoint()))
    yield bs.algebra.bracket(b, a.inverse().log())
    yield from (bs.substitute(b, exact), bs.substitute(b, a), bs.substitute(b, a - exact))
    yield from (unless_refused(bs.algebra.substitution_inverse, b), unless_refused(bs.modifying_integrator, a))


def series_of(method):
    """A method's series, to order 1 and further, and what algebra makes of it."""
    colors = len(method.names)
    table = bs.TreeTable(4 if colors == 1 else 2, colors)
    for function in (bs.series, bs.modified_equation, bs.modifying_integrator):
        yield unless_refused(function, method, 1)
        yield unless_refused(function, method, table)
    a = bs.series(method, table)
    yield from algebra(a, table.max_order)
    yield unless_refused(bs.substitute, a.log(), method)


def numbers(kind, seed):
    choose = random.Random(seed).choice
    sizes = {"least": [-(2**63)], "edge": [2**63 - 1, -(2**63), 0], "huge": [3**60, -2 * 3**60, 7 * 3**60]}
    sizes["powers"] = [Fraction(1, 2**70), Fraction(3**50), Fraction(5, 2**63), 0]
    return lambda tree: choose(sizes[kind]) if tree.order > 1 else Fraction(1)


def written(result):
    if not isinstance(result, bs.BSeries):
        return result
    few = result.order == 1 or result.table.colors == 1  # long splittings take seconds
    spread = [result.uncertainty(at) for at in range(len(result))] if few and result.uncertainty else None
    return list(map(str, result.coefficients())), spread


def exact_results():
    for entry in catalogue():
        if not entry.parameters:
            name = entry.name + "5" * entry.is_family
            yield name, unless_refused(lambda: list(series_of(bs.method(name))))
    for kind in ("least", "edge", "huge", "powers"):
        yield kind, list(algebra(bs.BSeries.from_rule(numbers(kind, 1), 4), 4))


found = {name: written(r) if isinstance(r, str) else list(map(written, r)) for name, r in exact_results()}
json.dump(found, sys.stdout)
'''


SETTINGS = "import math\nfrom bseries_base.lowering import flat_kernels\nflat_kernels.FEW_PRODUCTS = "


@pytest.fixture(scope="module")
def results():
    """What fresh processes find in the interpreter and in machine code."""
    commands = [[sys.executable, "-c", f"{SETTINGS}{products}\n{RESULTS}"] for products in ("math.inf", "-1")]
    jobs = [subprocess.Popen(command, stdout=subprocess.PIPE) for command in commands]
    return [json.loads(job.communicate()[0]) for job in jobs]


@pytest.mark.slow
def test_results_do_not_depend_on_the_execution(results):
    interpreted, compiled = results
    assert interpreted.keys() == compiled.keys()
    assert [name for name in compiled if compiled[name] != interpreted[name]] == []


@pytest.mark.slow
def test_few_methods_are_refused(results):
    """The comparison compares numbers: hardly a method has sums of weights that vanish, or an extra part."""
    refused = {name: r for name, r in results[0].items() if isinstance(r, str) or any(isinstance(x, str) for x in r)}
    assert len(refused) < len(results[0]) / 10
