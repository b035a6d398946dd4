"""Splitting and composition methods of high order: orders from words, sources' numbers, and schemes for any method.

A splitting method is a product of exponentials exp(c h A) exp(d h B) …; it has order p if and only if its expansion has
the coefficient 1/n! at every word of n ≤ p letters A and B, as exp(h (A + B)) has (HLW III.5.1). Few thousand words
decide on orders for which there are millions of trees.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from math import factorial

import mpmath
import pytest
import sympy
import taylor_oracle
from mpmath import mpf
from power_series_oracle import random_field

from integrators import IntegratorError, Splitting, adjoint_method, catalogue, composition, lie_trotter, method, strang
from integrators.methods.catalogue.registry import RECOMMENDED, recommended
from integrators.methods.kinds.compositions import SCHEMES, adjoint_composition, symmetric_composition
from integrators.methods.kinds.second_order import ForceGradient
from integrators.methods.kinds.splitting import NystromSplitting
from integrators.reference.plain_steps import block_parts, plain_step

SPLITTINGS = [entry for entry in catalogue() if entry.kind == "splitting"]
NYSTROM = [entry for entry in catalogue() if entry.kind == "nystrom splitting"]
NOT_SYMMETRIC = {"lie-trotter", "ruth3", "mclachlan-atela4", "mclachlan-atela5"}
ONE = 10**60


def named(entries):
    return {"argvalues": entries, "ids": [entry.name for entry in entries]}


def exact_flows(made):
    """Parts by number, with times as fractions, those of roots to 60 digits."""
    times = [x if isinstance(x, Fraction) else Fraction(str(sympy.N(x, 60))) for _, x in made.flows]
    return tuple((made.names.index(part), x) for (part, _), x in zip(made.flows, times, strict=True))


def word_coefficients(flows, order, letters=2):
    """The expansion of the product of exponentials, for each length: multiples of 1/ONE; the last letter is w mod k."""
    found = [[ONE], *([0] * letters**n for n in range(1, order + 1))]
    for letter, time in flows:
        powers = [ONE]
        for j in range(1, order + 1):
            powers.append(powers[-1] * time.numerator // (time.denominator * j))
        for n in range(order, 0, -1):  # longer words first: they need the shorter ones as they were
            for word in range(letters**n):
                start, j = word, 0
                while j < n and start % letters == letter:
                    start, j = start // letters, j + 1
                    found[n][word] += powers[j] * found[n - j][start] // ONE
    return found


@cache
def word_errors(flows, order, letters=2):
    """Differences from 1/n! at all words, for each length n ≥ 1."""
    words = word_coefficients(flows, order, letters)
    return [[float(Fraction(x, ONE) - Fraction(1, factorial(n))) for x in words[n]] for n in range(1, order + 1)]


def order_by_words(flows, *, limit, tolerance, letters=2):
    large = [max(map(abs, errors)) > tolerance for errors in word_errors(flows, limit, letters)]
    return large.index(True) if True in large else limit


def tolerance(made):
    return 10.0 ** (2 - made.digits) if made.digits else 1e-50


# Orders


@pytest.mark.parametrize("entry", **named(SPLITTINGS))
def test_order_by_words(entry):
    made = method(entry.name)
    flows = exact_flows(made)
    assert len(flows) == entry.stages == made.stages
    assert order_by_words(flows, limit=entry.order + 1, tolerance=tolerance(made)) == entry.order
    assert max(map(abs, word_errors(flows, entry.order + 1)[-1])) > 1e-9


@pytest.mark.parametrize("entry", **named([e for e in SPLITTINGS if method(e.name).digits]))
def test_one_wrong_digit_and_the_order_is_lost(entry):
    flows = list(exact_flows(method(entry.name)))
    middle, wrong = len(flows) // 2, Fraction(1, 10**9)
    for change, place in ((wrong, middle - 2), (-2 * wrong, middle), (wrong, middle + 2)):
        flows[place] = flows[place][0], flows[place][1] + change
    assert order_by_words(tuple(flows), limit=entry.order, tolerance=1e-12) == 2


IN_GENERAL = {
    "mclachlan-atela4": 3,
    "blanes-moan-rkn4": 4,  # conditions of odd orders suffice, and brackets of up to three letters do not vanish
    "mclachlan-atela5": 3,
    "okunbor-skeel6": 4,
    "blanes-moan-rkn6": 4,
    "blanes-moan-rkn6-11": 4,
    "blanes-casas-rkn8": 4,
}


@pytest.mark.parametrize("entry", **named(NYSTROM))
def test_methods_for_second_order_equations_have_a_lower_order_in_general(entry):
    """Their order on trees of such equations is checked with those of the whole catalogue."""
    found = order_by_words(exact_flows(method(entry.name)), limit=entry.order + 1, tolerance=1e-9)
    assert found == IN_GENERAL[entry.name]


@pytest.mark.parametrize("entry", **named(SPLITTINGS + NYSTROM))
def test_flows_of_each_part_add_up_to_a_step(entry):
    made = method(entry.name)
    assert isinstance(made, NystromSplitting) is (entry.kind == "nystrom splitting")
    for part in made.names:
        total = sum(x for name, x in made.flows if name == part)
        # Where the last number is not computed from the others the sum is 1 within the printed digits.
        assert abs(sympy.N(total - 1, 30)) < (tolerance(made) if entry.name in NOT_SYMMETRIC else 1e-28)
    assert (made.flows == made.flows[::-1]) is (entry.name not in NOT_SYMMETRIC)


def test_order_of_a_composition_of_three_parts():
    flows = exact_flows(symmetric_composition(strang(["a", "b", "c"]), "yoshida6"))
    assert order_by_words(flows, limit=7, tolerance=1e-23, letters=3) == 6


# Numbers that the sources print and that follow from others here: (method, flow, number, its digits)

PRINTED = [
    ("yoshida6", 7, "1.31518632068391121888424973", 25),
    ("kahan-li6", 9, "0.79854399093482996339895035", 25),
    ("mclachlan6", 9, "0.9432033015235617027", 18),
    ("sofroniou-spaletta6", 11, "0.50405474843802736404832781714239", 31),
    ("sofroniou-spaletta6-13", 13, "0.39907751534871587459988795520665", 31),
    ("suzuki-umeno8", 15, "-0.79688793935291635401978884", 25),
    ("kahan-li8", 17, "-0.60550853383003451169892108", 25),
    ("mclachlan8", 17, "-0.626994825405133975", 18),
    ("sofroniou-spaletta8", 21, "-0.38263596012643665350944670744040", 31),
    ("kahan-li10", 33, "0.44373380805019087955111365", 24),
    ("sofroniou-spaletta10", 35, "0.049317735759594537917680008339338", 31),
    ("blanes-moan6", 9, "-0.016404589403618", 14),
    ("blanes-moan6", 10, "-0.725525558508690", 14),
    ("blanes-moan-rkn4", 5, "-0.350171622895351", 14),
    ("blanes-moan-rkn4", 6, "0.119524194013151", 14),
    ("blanes-moan-rkn6-11", 10, "0.236669924786931", 14),
    ("blanes-moan-rkn6-11", 11, "0.204777054291470", 14),
    ("blanes-moan-rkn6", 13, "-0.196411466486454", 14),
    ("blanes-moan-rkn6", 14, "0.207305069056895", 14),
    ("okunbor-skeel6", 6, "0.34399425728109261313", 18),
    ("okunbor-skeel6", 7, "0.38064159097092574080", 18),
]


@pytest.mark.parametrize(("name", "place", "printed", "digits"), PRINTED, ids=lambda value: str(value)[:20])
def test_numbers_that_the_sources_print(name, place, printed, digits):
    assert abs(method(name).flows[place][1] - Fraction(printed)) < Fraction(3, 10**digits)


# Numbers refined from the order conditions, as printed: the first half of the step.
REFINED = {
    "blanes-moan6": "0.050262764400392 0.148816447901042 0.413514300428344 -0.132385865767784 0.045079889794398 "
    "0.067307604692185 -0.188054853819569 0.432666402578175 0.541960678450780",
    "blanes-moan-rkn4": "0.0829844064174052 0.245298957184271 0.396309801498368 0.604872665711080 -0.0390563049223486",
    "blanes-moan-rkn6-11": "0.0414649985182624 0.123229775946271 0.198128671918067 0.290553797799558 "
    "-0.0400061921041533 -0.127049212625417 0.0752539843015807 -0.246331761062075 -0.0115113874206879 "
    "0.357208872795928",
    "blanes-moan-rkn6": "0.0378593198406116 0.0917191526244617 0.102635633102435 0.183983170005006 "
    "-0.0258678882665587 -0.0565343658328883 0.314241403071447 0.00491468877471285 -0.130144459517415 "
    "0.143761127168358 0.106417700369543 0.328567693746804 -0.00879424312851058",
    "okunbor-skeel6": "-1.0130879789171747298 0.00016600692650009894 1.1874295737325427070 -0.37962421426377360608 "
    "-0.018335852096460590340 0.68913741185181063674",
}


@pytest.mark.parametrize("name", REFINED)
def test_refined_numbers_round_to_the_printed_ones(name):
    printed = [Fraction(number) for number in REFINED[name].split()]
    allowed = Fraction(1, 10**18) if name == "okunbor-skeel6" else Fraction(6, 10**15)
    for (_, time), number in zip(method(name).flows, printed, strict=False):
        assert abs(time - number) < allowed


# What is recommended


def effective_error(name):
    made = method(name)
    order = next(entry.order for entry in SPLITTINGS if entry.name == name)
    flows = exact_flows(made)
    stages = min(sum(part == letter for part, _ in flows) for letter in (0, 1))
    return stages * sum(x * x for x in word_errors(flows, order + 1)[-1]) ** (1 / (2 * order))


@pytest.mark.parametrize(("kind", "order"), [(k, p) for k in ("splitting", "composition") for p in RECOMMENDED[k]])
def test_recommended_methods_have_the_smallest_effective_error(kind, order):
    schemes = {"triple-jump4", "suzuki4", *SCHEMES}
    names = [e.name for e in SPLITTINGS if e.order == order and (kind == "splitting" or e.name in schemes)]
    assert len(names) > 1
    assert min(names, key=effective_error) == recommended(order, kind)


def test_effective_errors_grow_with_the_length_of_steps_back():
    errors = [effective_error(n) for n in ("sofroniou-spaletta8", "kahan-li8", "mclachlan8", "suzuki-umeno8")]
    assert errors == sorted(errors)
    assert [round(x, 2) for x in errors] == [3.98, 4.18, 4.25, 4.91]


def test_descriptions_say_what_is_recommended():
    said = {entry.name for entry in catalogue() if "recommended" in entry.description}
    assert said == {name for names in RECOMMENDED.values() for name in names.values()}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((5,), "order must be one of 4, 6, 8, 10, but was 5"),
        ((10, "nystrom splitting"), "order must be one of 4, 6, 8, but was 10"),
        ((True,), "order must be one of"),
        (("4",), "order must be one of"),
        ((4, "rkn"), "kind must be one of splitting, nystrom splitting, composition, but was 'rkn'"),
        ((4, None), "kind must be one of"),
    ],
)
def test_nothing_to_recommend(arguments, message):
    with pytest.raises(IntegratorError, match=message):
        recommended(*arguments)


# Schemes for any method


@pytest.mark.parametrize("scheme", ["triple-jump4", "suzuki4", *SCHEMES])
def test_schemes_of_strang_are_the_catalogue(scheme):
    assert symmetric_composition(strang(), scheme) == method(scheme)
    assert symmetric_composition(strang(), scheme.upper().replace("-", "_")) == method(scheme)


PENDULUM = block_parts(lambda y: [-mpmath.sin(y[1]), y[0]], {"p": [0], "q": [1]})


@pytest.mark.parametrize(("verlet", "first"), [("stormer-verlet-kdk", "p"), ("stormer-verlet-dkd", "q")])
def test_schemes_of_tableaux_are_the_same_steps(verlet, first):
    second = "q" if first == "p" else "p"
    flows = [(first, "1/2"), (second, 1), (first, "1/2")]
    composed = symmetric_composition(method(verlet), "sofroniou-spaletta6")
    splitting = symmetric_composition(Splitting(flows, parts=("p", "q")), "sofroniou-spaletta6")
    assert (composed.digits, splitting.digits) == (30, 30)
    ends = [plain_step(made, PENDULUM, ["3/10", "1/2"], "1/5", digits=25) for made in (composed, splitting)]
    assert max(abs(x - y) for x, y in zip(*ends, strict=True)) < 1e-24


@pytest.mark.parametrize(("scheme", "order"), [("suzuki4", 4), ("mclachlan6", 6), ("sofroniou-spaletta8", 8)])
def test_schemes_of_the_implicit_midpoint_rule(scheme, order):
    field, start = random_field(8), [Fraction(1, 2), Fraction(-2, 3)]
    made = symmetric_composition(method("implicit-midpoint"), scheme)
    with mpmath.workdps(45):
        series = taylor_oracle.taylor(field, [mpf(x.numerator) / x.denominator for x in start], 28)

        def error(n):
            end = plain_step(made, taylor_oracle.function(field), start, Fraction(1, n), digits=35)
            return max(abs(x - y) for x, y in zip(end, taylor_oracle.at(series, mpf(1) / n), strict=True))

        coarse, middle, fine = error(100), error(200), error(400)
        slopes = mpmath.log(coarse / middle, 2), mpmath.log(middle / fine, 2)
    assert abs(2 * slopes[1] - slopes[0] - (order + 1)) < 0.05


@pytest.mark.parametrize("name", ["strang", "suzuki4", "pefrl4", "blanes-moan4", "blanes-moan6", "kahan-li8"])
def test_adjoint_steps_of_lie_trotter_are_the_splitting(name):
    made = method(name)
    first = [part for part, _ in made.flows[:2]]
    composed = adjoint_composition(Splitting([(part, 1) for part in first], parts=("a", "b")), made)
    assert isinstance(composed, Splitting)
    assert composed == made


@pytest.mark.parametrize("name", ["strang", "ruth3", "mclachlan4", "blanes-moan4", "blanes-moan6"])
def test_adjoint_steps_of_three_parts_keep_the_order(name):
    made = method(name)
    if made.domain == "algebraic":
        made = Splitting([(made.names[part], x) for part, x in exact_flows(made)], parts=made.names, digits=40)
    order = next(entry.order for entry in SPLITTINGS if entry.name == name)
    flows = exact_flows(adjoint_composition(lie_trotter(["a", "b", "c"]), made))
    assert order_by_words(flows, limit=order + 1, tolerance=tolerance(made), letters=3) == order


def test_adjoint_steps_of_the_symplectic_euler_method():
    made = method("blanes-moan4")
    euler = adjoint_composition(method("symplectic-euler-p"), made)
    parts = {"a": "p", "b": "q"}
    splitting = Splitting([(parts[part], x) for part, x in made.flows], parts=("p", "q"))
    ends = [plain_step(x, PENDULUM, ["3/10", "1/2"], "1/5", digits=25) for x in (euler, splitting)]
    assert max(abs(x - y) for x, y in zip(*ends, strict=True)) < 1e-24
    assert euler.digits == 15


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: symmetric_composition(strang(), "yoshida7"),
            "scheme must be one of triple.*but was 'yoshida7'",
        ),
        (lambda: symmetric_composition(strang(), 6), "scheme must be one of .*, but was 6$"),  # type: ignore[arg-type]
        (lambda: symmetric_composition(strang(), "x" * 1000), "but was 'x{50,60}"),
        (lambda: symmetric_composition("strang", "suzuki4"), r"steps\[1\] must be a method"),  # type: ignore[arg-type]
        (lambda: adjoint_composition(strang(), method("blanes-moan-rkn4")), "splitting must be .* blanes-moan-rkn4$"),
        (lambda: adjoint_composition(strang(), lie_trotter(["a", "b", "c"])), "was lie-trotter$"),
        (lambda: adjoint_composition(strang(), method("rk4")), "splitting must be .* rk4$"),  # type: ignore[arg-type]
        (lambda: adjoint_composition(strang(), Splitting([("a", 1), ("b", 2)])), "must be a consistent splitting"),
        (lambda: adjoint_composition(1, strang()), "method must be a method, but was 1"),  # type: ignore[arg-type]
        (lambda: NystromSplitting([("p", 1)], parts=("p",)), "parts must be 2 names, but were 1"),
        (lambda: NystromSplitting([("a", 1)]), "flows must be of the parts p, q, but one was of 'a'"),
        (lambda: ForceGradient([1], [1], [0]), "drifts must have 2 entries, but has 1"),
        (lambda: ForceGradient([0, 1], [1], []), "gradients must have 1 entry, but has 0"),
        (lambda: ForceGradient([0, 1], [], []), "kicks must have from 1 to"),
        (lambda: ForceGradient([0, "x"], [1], [0]), "drifts"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(IntegratorError, match=message):
        call()


# Kicks with the gradient of the force


def step_matrix(made, terms):
    """The step for q'' = −q as a matrix on (p, q), its entries as coefficients of powers of h."""

    def times(x, y):
        return [sum(x[i] * y[n - i] for i in range(n + 1)) for n in range(terms)]

    def entry(row, column):
        return [sum(terms) for terms in zip(*map(times, row, column), strict=True)]

    def product(x, y):
        return [[entry(row, column) for column in zip(*y, strict=True)] for row in x]

    def power(*entries):
        return [*entries, *[Fraction(0)] * (terms - len(entries))]

    matrix = [[power(Fraction(1)), power()], [power(), power(Fraction(1))]]
    for a, b, c in zip(made.drifts, made.kicks, (*made.gradients, 0), strict=False):
        matrix = product([[power(Fraction(1)), power()], [power(0, a), power(Fraction(1))]], matrix)
        # g(q) = −q, and g'(q) g(q) = q
        matrix = product([[power(Fraction(1)), power(0, -b, 0, c)], [power(), power(Fraction(1))]], matrix)
    return product([[power(Fraction(1)), power()], [power(0, made.drifts[-1]), power(Fraction(1))]], matrix)


def rotation(terms):
    cos = [Fraction((-1) ** (n // 2), factorial(n)) * (n % 2 == 0) for n in range(terms)]
    sin = [Fraction((-1) ** (n // 2), factorial(n)) * (n % 2) for n in range(terms)]
    return [[cos, [-x for x in sin]], [sin, cos]]


@pytest.mark.parametrize("name", ["chin4a", "chin4c"])
def test_force_gradient_on_the_oscillator(name):
    made = method(name)
    assert step_matrix(made, 5) == rotation(5)
    assert step_matrix(made, 6) != rotation(6)
    wrong = ForceGradient(made.drifts, made.kicks, [-c for c in made.gradients])
    assert step_matrix(wrong, 3) == rotation(3)
    assert step_matrix(wrong, 4) != rotation(4)


@pytest.mark.parametrize("name", ["chin4a", "chin4b", "chin4c"])
def test_no_step_of_chins_goes_backwards(name):
    made = method(name)
    assert all(x >= 0 for row in (made.drifts, made.kicks, made.gradients) for x in row)
    assert made.stages == next(entry.stages for entry in catalogue() if entry.name == name)
    assert any(x < 0 for _, x in method("blanes-moan-rkn4").flows)


def test_takahashi_imada_is_a_force_gradient_method():
    made = ForceGradient([0, 1, 0], ["1/2", "1/2"], ["1/24", "1/24"])
    parts = {"p": lambda y: [-mpmath.sin(y[1]), 0], "q": lambda y: [0, y[0]]}
    ends = [plain_step(x, parts, ["3/10", "1/2"], "1/5", digits=25) for x in (made, method("takahashi-imada"))]
    assert max(abs(x - y) for x, y in zip(*ends, strict=True)) < 1e-24


def test_force_gradient_methods_are_symmetric():
    made = method("chin4c")
    parts = {"p": lambda y: [-mpmath.sin(y[1]), 0], "q": lambda y: [0, y[0]]}
    there = plain_step(made, parts, ["3/10", "1/2"], "1/5", digits=25)
    back = plain_step(made, parts, there, "-1/5", digits=25)
    assert max(abs(back[0] - mpf(3) / 10), abs(back[1] - mpf(1) / 2)) < 1e-16


def test_nystrom_splittings_compose():
    made = method("blanes-moan-rkn4")
    twice = composition([(made, "1/2"), (made, "1/2")])
    assert twice.stages == 2 * made.stages - 1
    assert adjoint_method(made).flows == made.flows
