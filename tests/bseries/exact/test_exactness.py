"""The fast exact path against plain Fractions: residues, bounds, denominators, and their negative controls."""

import json
import math
import random
import subprocess
import sys
from fractions import Fraction

import numba  # noqa: F401
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bseries as bs
import trees.table
from bseries.exact import kernels, rationals, recursions
from bseries.exact.arithmetic import Exact, Majorant, factorial_weights, floats, majorants, primes_beyond
from bseries.exact.rationals import (
    Operation,
    RationalValues,
    combine,
    evaluate,
    log_denominator,
    smallest_step,
    wider_step,
)

ORDER = 6
KINDS = "import math, trees.compiled\ntrees.compiled.LOADING = math.inf\n", "import numba\n"


def table(order, compiled, colors=1):
    """A new table with compiled kernels, or with interpreted ones."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trees.table, "compiling_pays", lambda work: compiled)
        return trees.TreeTable(order, colors)


FAST, PLAIN = table(ORDER, True), table(ORDER, False)


def modified(method, on):
    from bseries.algebra.stages import stages_of

    def expression(arithmetic, weights):
        return recursions.logarithm(weights(field=True), on, arithmetic)

    return evaluate(
        on, [stages_of(method, on.max_order)], Operation(expression, log_denominator, wider_step, field=True)
    )


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
    assert modified(method, FAST).coefficients() == modified(method, PLAIN).coefficients()


@pytest.mark.parametrize("bits", [10, 20, 40, 62, 63, 64, 126, 127, 128, 300])
def test_every_size_of_numerators_has_been_seen(bits, monkeypatch):
    """Denominators chosen such that numerators of the top order have about so many bits."""
    used = []
    for name in ("_run_wrapped", "_run_primes"):
        run = getattr(rationals, name)
        monkeypatch.setattr(rationals, name, lambda *a, name=name, run=run: used.append(name) or run(*a))
    odd = max(3, round(2 ** (bits / ORDER)) | 1)
    method = bs.RungeKutta([[0, 0], [Fraction(-1, odd), 0]], [Fraction(odd - 1, odd), Fraction(1, odd)], warn=False)
    found = modified(method, FAST)
    assert found.coefficients() == modified(method, PLAIN).coefficients()
    largest = max(abs(int(x)) for x in found.raw).bit_length()
    assert abs(largest - bits) < 12
    assert used == ["_run_wrapped" if largest < 48 else "_run_primes"]


def test_many_stages_and_families():
    for name in ("dop853", "gauss4", "radau-ia3", "lobatto-iiib4"):
        method = bs.method(name)
        assert modified(method, FAST).coefficients() == modified(method, PLAIN).coefficients()


def test_bounds_hold_and_are_not_absurd():
    """On one tall tree after another the bound solves 2β + 1 − exp β = x, hence grows like 1/(2 log 2 − 1) = 2.59."""
    source = random.Random(1)
    values = [Fraction(source.randint(-20, 20), source.randint(1, 9)) for _ in FAST]
    fast, plain = (RationalValues.from_fractions(on, values) for on in (FAST, PLAIN))
    field = fast.load(FAST, (bound := majorants(fast.exponent, ORDER)), field=True)
    scale = [2.0 ** (bound.exponent * tree.order) for tree in FAST]
    limits = recursions.logarithm(field, FAST, bound) * scale * Majorant.SLACK
    exact = recursions.logarithm(plain.load(PLAIN, Exact(), field=True), PLAIN, Exact())
    assert all(abs(x) <= limit for x, limit in zip(exact, limits, strict=True))
    assert np.median([limit / abs(x) for x, limit in zip(exact, limits, strict=True) if x]) < 2.6**ORDER
    flow = recursions.lie_series(field, field, 1, FAST, bound, Fraction(-3, 2)) * scale * Majorant.SLACK
    raw = plain.load(PLAIN, Exact(), field=True)
    exact = recursions.lie_series(raw, raw, 1, PLAIN, Exact(), Fraction(-3, 2))
    assert all(abs(x) <= limit for x, limit in zip(exact, flow, strict=True))


def test_bounds_neither_underflow_nor_overflow():
    for entry in (Fraction(1, 10**200), Fraction(10**200), Fraction(1)):
        method = bs.RungeKutta([[0, 0], [entry, 0]], [entry, 1 / entry], warn=False)
        assert modified(method, FAST).coefficients() == modified(method, PLAIN).coefficients()


@pytest.mark.parametrize("bits", [1, 20, 61, 62, 63, 64, 100, 128, 1000])
def test_chinese_remainders_give_back_integers_of_either_sign(bits):
    source = random.Random(bits)
    top = 2**bits
    integers = [0, 1, -1, top, -top, *(source.randint(-top, top) for _ in range(600))]
    primes = primes_beyond(bits + 2, 1)
    residues = np.array([[x % p for x in integers] for p in primes], np.int32)
    assert list(combine(residues, primes, bits)) == integers
    if len(primes) > 1:  # one prime less, and they are lost: the count of primes is not generous by more than one
        assert list(combine(residues[:-1], primes[:-1], bits)) != integers


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
    assert modified(method, FAST).coefficients() == modified(method, PLAIN).coefficients()


def test_a_wrong_denominator_bound_is_noticed():
    method = bs.method("rk4")

    def expression(arithmetic, weights):
        return recursions.logarithm(weights(field=True), PLAIN, arithmetic)

    from bseries.algebra.stages import stages_of

    wrong = Operation(expression, lambda n, step: step**n, wider_step, field=True)
    with pytest.raises(ArithmeticError, match="denominator bound is wrong"):
        evaluate(PLAIN, [stages_of(method, PLAIN.max_order)], wrong)


@pytest.mark.parametrize("scale", [1, Fraction(1, 7), 3, 10**40, Fraction(1, 10**40)])
def test_growth_bounds_every_coefficient(scale):
    s = bs.series(bs.method("rk4"), 6)
    values = RationalValues.from_fractions(s.table, [x * scale for x in s.coefficients()])
    exponent, nodes = values.exponent, s.table.order.tolist()
    found = values.coefficients()
    assert all(abs(x) <= Fraction(2) ** (exponent * n) for n, x in zip(nodes, found, strict=True))
    smaller = any(abs(x) > Fraction(2) ** ((exponent - 1) * n) for n, x in zip(nodes, found, strict=True))
    assert exponent == 0 or smaller


def test_smallest_step():
    assert smallest_step([1, 2, 4, 8], 2**10 * 5) == 2
    assert smallest_step([1, 1, 2, 6, 24, 120], 120) == 30


def test_denominators_of_an_operation_itself():
    """Powers and scaled operands whose denominators are large, or primes of the pool."""
    prime = primes_beyond(10, 1)[0]
    a = bs.BSeries(FAST, modified(bs.method("rk4"), FAST), 0).exp()
    assert (a ** Fraction(1, prime)) ** prime == a
    assert a ** Fraction(1, 6) == (a ** Fraction(1, 2)) ** Fraction(1, 3)
    assert (a ** Fraction(0.1)).log() == a.log() * Fraction(0.1)
    assert (
        bs.compose(a, a.with_empty(Fraction(1, 2 * prime)))["[τ]"]
        == a["[τ]"] * Fraction(1, 2 * prime) + a["τ"] + a["[τ]"]
    )


def test_the_least_int64():
    """|−2^63| is no int64: a bound taken from it would collapse."""
    values = [2**63 if tree == bs.Tree("[[[[[τ]]]]]") else 0 for tree in FAST]
    a = bs.BSeries(FAST, RationalValues.from_fractions(FAST, values), 1)
    top = a.inverse()
    assert top["[[[[[τ]]]]]"] == -(2**63)
    assert top.inverse() == a
    assert (top**5)["[[[[[τ]]]]]"] == -5 * 2**63


def test_common_divisors_beyond_int64():
    """Those of numerators that all vanish, or that all are −2^63."""
    numerators = np.array([{1: 1, ORDER: -(2**63)}.get(int(n), 0) for n in FAST.order])
    values = RationalValues(FAST, numerators, [1, 3, 3**50, 2**63, 2**64, 1, 2**64], 6**50)
    assert values.reduced.denominators == (1, 3, 1, 1, 1, 1, 2)
    assert values.reduced.coefficients() == values.coefficients()


@pytest.mark.parametrize("number", [Fraction(1, 2), Fraction(3, 2), Fraction(7)])
def test_growth_bounds_all_values(number):
    growth = bs.BSeries.from_rule(lambda tree: number, 5).stored.growth
    assert all(number <= 2 ** (growth * n) for n in range(1, 6))


def test_bounds_beyond_floats_fall_back_to_fractions():
    a = bs.BSeries(FAST, modified(bs.method("heun2"), FAST), 0).exp()
    huge = a ** (10**400)
    assert huge["[τ]"] == Fraction(10**800, 2)
    assert (huge ** Fraction(1, 10**400)) == a


def test_orders_without_trees():
    on = trees.TreeTable(5, 1, 0)
    assert on.sizes == [1, 0, 0, 0, 0]
    for compiled in (True, False):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(trees.table, "compiling_pays", lambda work, compiled=compiled: compiled)
            assert bs.modified_equation(bs.method("rk4"), trees.TreeTable(5, 1, 0)).coefficients() == [1]


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
    run = getattr(kernels.weighted_terms, implementation)
    left = run(-float(exact), terms, 0, *factorial_weights(floats(), 16, 1, False), 2, 15)
    assert abs(Fraction(left) - (exact - Fraction(float(exact)))) < Fraction(1, 2**74)


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
    yield bs.analysis.bracket(b, a.inverse().log())
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
json.dump([found, "numba" in sys.modules], sys.stdout)
'''


@pytest.fixture(scope="module")
def results():
    """What fresh processes find, in the order of `KINDS`, and whether numba is loaded at the end."""
    jobs = [subprocess.Popen([sys.executable, "-c", first + RESULTS], stdout=subprocess.PIPE) for first in KINDS]
    return [json.loads(job.communicate()[0]) for job in jobs]


@pytest.mark.slow
def test_results_do_not_depend_on_numba(results):
    (interpreted, unloaded), (compiled, loaded) = results
    assert (unloaded, loaded) == (False, True)
    assert interpreted.keys() == compiled.keys()
    assert [name for name in compiled if compiled[name] != interpreted[name]] == []


@pytest.mark.slow
def test_few_methods_are_refused(results):
    """The comparison compares numbers: hardly a method has sums of weights that vanish, or an extra part."""
    refused = {name: r for name, r in results[0][0].items() if isinstance(r, str) or any(isinstance(x, str) for x in r)}
    assert len(refused) < len(results[0][0]) / 10


@pytest.mark.parametrize(
    "make",
    [
        lambda: bs.series("rk4", 8),
        lambda: bs.modified_equation("explicit-midpoint", 10),
        lambda: bs.modified_equation("gauss2", 7),  # a block of stages
        lambda: bs.modified_equation("stormer-verlet-kdk", 6),  # two colours
        lambda: bs.series("lie-trotter", 5).inverse(),
        lambda: bs.compose(bs.series("rk4", 7), bs.series("heun2", 7)),
        lambda: bs.modified_equation("heun2", 7).exp(),
        lambda: bs.series("heun2", 7) ** Fraction(1, 2),
        lambda: bs.modified_equation("dormand-prince54", 8),  # beyond 64 bits
        lambda: bs.modified_equation("explicit-euler", 1),
    ],
)
def test_whole_orders_give_what_kernels_give(monkeypatch, make):
    found = []
    monkeypatch.setattr(rationals, "arrays_pay", lambda seconds: True)
    for compiled in (False, True):
        monkeypatch.setattr(trees.table, "compiling_pays", lambda work, compiled=compiled: compiled)
        trees.table._kept_table.cache_clear()
        found.append(make())
    trees.table._kept_table.cache_clear()
    assert [b.table.compiled for b in found] == [False, True]
    assert found[0].coefficients() == found[1].coefficients()


def test_numbers_beyond_64_bits_are_not_computed_by_order(monkeypatch):
    monkeypatch.setattr(rationals, "arrays_pay", lambda seconds: True)
    monkeypatch.setattr(trees.table, "compiling_pays", lambda work: False)
    trees.table._kept_table.cache_clear()
    wrapped = []
    monkeypatch.setattr(rationals, "_run_wrapped", lambda *inputs: wrapped.append(inputs))
    assert bs.modified_equation("dormand-prince54", 8).order == 8
    assert not wrapped
    trees.table._kept_table.cache_clear()
