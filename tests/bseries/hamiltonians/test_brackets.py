"""Modified Hamiltonians from nested brackets: the free Lie algebra, the BCH series, and brackets on scenes."""

import json
from fractions import Fraction
from functools import cache
from itertools import chain, groupby, product
from pathlib import Path

import pytest
import sympy

import bseries as bs
from bseries.fields.differential_rings import DifferentialRing
from bseries.hamiltonians.brackets.campbell_hausdorff import bch, bracket_hamiltonian
from bseries.hamiltonians.brackets.lie_algebra import LieAlgebra
from bseries.hamiltonians.brackets.poisson_brackets import bracket_terms
from integrators.scenes.model.terms import Term
from integrators.scenes.particles.expansion import hamiltonian_field
from trees.lyndon_words import count_lyndon_words
from trees.table import tree_table
from trees.words import Words

LECTURE = json.loads((Path(__file__).parents[2] / "reference" / "lecture_values.json").read_text())
EXAMPLE6 = LECTURE["example6_stoermer_verlet"]
METHODS = {"UTU": "stormer-verlet", "TUT": "position-verlet"}
P, Q, T = sympy.symbols("p q t")


# The algebra of words: an independent way to logarithms of products of exponentials.


def times(x, y, order):
    found = {}
    for (u, a), (v, b) in product(x.items(), y.items()):
        if len(u) + len(v) <= order:
            found[u + v] = found.get(u + v, 0) + a * b
    return found


def logarithm(factors, order):
    """log(exp(c_1 x_1) exp(c_2 x_2) …) for pairs (letter, number)."""
    x = {(): Fraction(1)}
    for letter, c in factors:
        power, exponential = Fraction(1), {}
        for n in range(order + 1):
            exponential[(letter,) * n] = power
            power = power * c / (n + 1)
        x = times(x, exponential, order)
    del x[()]
    found, power = {}, {(): Fraction(1)}
    for n in range(1, order + 1):
        power = times(power, x, order)
        for word, value in power.items():
            found[word] = found.get(word, 0) + Fraction((-1) ** (n + 1), n) * value
    return found


@cache
def expanded(word):
    """A right-nested commutator in words."""
    if len(word) == 1:
        return {word: 1}
    found = {}
    for rest, x in expanded(word[1:]).items():
        for longer, sign in (((word[0], *rest), 1), ((*rest, word[0]), -1)):
            found[longer] = found.get(longer, 0) + sign * x
    return found


def in_words(brackets):
    found = {}
    for word, value in brackets.items():
        for letters, x in expanded(word).items():
            found[letters] = found.get(letters, 0) + value * x
    return {letters: value for letters, value in found.items() if value}


def nonzero(words):
    return {letters: value for letters, value in words.items() if value}


def goldberg(word):
    """The coefficient of a word in log(exp A exp B) (K. Goldberg, Duke Math. J. 23 (1956), 13–21)."""
    runs = [len(list(run)) for _, run in groupby(word)]
    t = sympy.Poly(T)
    integrand = sympy.prod(map(goldberg_polynomial, runs)) * t ** (len(runs) // 2) * (t - 1) ** ((len(runs) - 1) // 2)
    value = integrand.integrate().eval(1)
    return value if word[0] == "A" else (-1) ** (len(word) - 1) * value


@cache
def goldberg_polynomial(s):
    """s G_s = (t (t − 1) G_(s−1))' with G_1 = 1."""
    t = sympy.Poly(T)
    return t**0 if s == 1 else (t * (t - 1) * goldberg_polynomial(s - 1)).diff() / s


FLOWS = {
    "stormer-verlet": [("U", Fraction(1, 2)), ("T", Fraction(1)), ("U", Fraction(1, 2))],
    "position-verlet": [("T", Fraction(1, 2)), ("U", Fraction(1)), ("T", Fraction(1, 2))],
    "symplectic-euler-p": [("U", Fraction(1)), ("T", Fraction(1))],
}


@pytest.mark.parametrize(("name", "order"), [("stormer-verlet", 9), ("position-verlet", 7), ("symplectic-euler-p", 7)])
def test_brackets_are_logarithms_of_products_of_exponentials(name, order):
    """The flow that acts last is the first factor."""
    found = bracket_hamiltonian(bs.method(name), order)
    assert in_words(found) == nonzero(logarithm(FLOWS[name][::-1], order))


def test_three_parts_and_any_coefficients():
    flows = [("a", Fraction(1, 3)), ("b", Fraction(2)), ("c", Fraction(1)), ("a", Fraction(2, 3)), ("b", Fraction(-1))]
    found = bracket_hamiltonian(bs.Splitting(flows), 5)
    assert found.parts == ("a", "b", "c")
    assert in_words(found) == nonzero(logarithm(flows[::-1], 5))
    changed = [*flows[:-1], ("b", Fraction(-1001, 1000))]
    assert in_words(found) != nonzero(logarithm(changed[::-1], 5))


def test_goldberg_coefficients():
    words = in_words(bch(6))
    for word in chain.from_iterable(product("AB", repeat=n) for n in range(1, 7)):
        assert words.get(word, 0) == goldberg(word), word


def test_bch_series():
    rows = ["A + B", "1/2 [A,B]", "1/12 [A,[A,B]] + 1/12 [B,[B,A]]", "-1/24 [B,[A,[A,B]]]"]
    assert str(bch(4)).splitlines() == ["log(exp A exp B)", *(f"h^{k}   {row}" for k, row in enumerate(rows))]
    symmetric = bch(7, symmetric=True)
    assert str(symmetric).splitlines()[2] == "h^2   -1/24 [A,[A,B]] + 1/12 [B,[B,A]]"
    half, one = Fraction(1, 2), Fraction(1)
    assert in_words(symmetric) == nonzero(logarithm([("A", half), ("B", one), ("A", half)], 7))
    three = [("X", half), ("Y", half), ("Z", one), ("Y", half), ("X", half)]
    assert in_words(bch(4, ("X", "Y", "Z"), symmetric=True)) == nonzero(logarithm(three, 4))
    assert in_words(bch(4, ("X", "Y", "Z"))) == nonzero(logarithm([("X", one), ("Y", one), ("Z", one)], 4))
    assert bch(2)["[A, B]"] == half
    assert bch(2).to_latex() == "A + B + h \\left(\\frac{1}{2} [A,B]\\right)"


# The lecture's values.


@pytest.mark.parametrize("variant", METHODS)
def test_the_lecture_s_brackets(variant):
    """Example 6: the same basis, for general and for quadratic T."""
    found = bracket_hamiltonian(bs.method(METHODS[variant]), 5)
    for k, kind in ((2, "h^2"), (4, "h^4_general")):
        expected = {tuple(word): Fraction(x) for word, x in EXAMPLE6[variant][kind].items()}
        assert found.term(k) == expected
    quadratic = bracket_hamiltonian(bs.method(METHODS[variant]), 5, quadratic_kinetic=True)
    expected = {tuple(word): Fraction(x) for word, x in EXAMPLE6[variant]["h^4_T_quadratic"].items()}
    assert quadratic.term(4) == expected
    assert found.term(0) == {("T",): 1, ("U",): 1}
    assert found.term(1) == found.term(3) == {}


def test_lecture_s_form():
    found = bracket_hamiltonian(bs.method("stormer-verlet"), 5, quadratic_kinetic=True)
    assert str(found).splitlines() == [
        "modified Hamiltonian of stormer-verlet-kdk",
        "h^0   T + U",
        "h^2   1/12 {T,{T,U}} - 1/24 {U,{U,T}}",
        "h^4   -1/720 {T,{T,{T,{T,U}}}} + 1/360 {U,{T,{T,{T,U}}}} - 1/480 {U,{U,{T,{T,U}}}} + 1/120 {T,{T,{U,{U,T}}}}",
    ]


@pytest.mark.parametrize("variant", METHODS)
def test_one_degree_of_freedom_with_general_kinetic_energy(variant):
    kinetic, potential = P**4 / 4 + P**2 / 2 - P, Q**5 + Q**3 / 3
    scene = bs.Scene({"p": 1, "q": 1}, hamiltonian=kinetic + potential)
    names = {f"T{k}": kinetic.diff(P, k) for k in range(1, 6)} | {f"U{k}": potential.diff(Q, k) for k in range(1, 6)}
    found = bracket_terms(bs.method(METHODS[variant]), scene, 5)
    for k in (2, 4):
        expected = sympy.sympify(EXAMPLE6["one_dof_general_T(p)+U(q)"][variant][f"h^{k}"], locals=names)
        assert sympy.expand(found[k] - expected) == 0


@pytest.mark.parametrize("variant", METHODS)
def test_the_pendulum(variant):
    found = bracket_terms(bs.method(METHODS[variant]), bs.scene("pendulum"), 5)
    for k in (2, 4):
        expected = sympy.sympify(EXAMPLE6["direct"]["pendulum"][variant][f"h^{k}"])
        assert sympy.simplify(found[k] - expected).is_number


def test_takahashi_imada_with_general_alpha():
    """Section 4: H3 and H5."""
    potential = Q**5 / 5 + Q**4 - Q**2
    scene = bs.Scene({"p": 1, "q": 1}, hamiltonian=P**2 / 2 + potential)
    names = {"alpha": sympy.Symbol("alpha"), "p": P} | {f"U{k}": potential.diff(Q, k) for k in range(1, 5)}
    method = bs.methods.TakahashiImada("alpha", parameters=["alpha"])
    values = LECTURE["section4_takahashi_imada"]
    found = bracket_terms(method, scene, 5)
    for k, name in ((2, "H3_general_alpha"), (4, "H5_general_alpha")):
        assert sympy.expand(found[k] - sympy.sympify(values[name], locals=names)) == 0
    assert bracket_hamiltonian(method, 3).domain == "QQ[alpha]"


@pytest.mark.parametrize(("name", "sign"), [("symplectic-euler-p", 1), ("symplectic-euler-q", -1)])
def test_formula_25(name, sign):
    """H − h/2 H_p H_q + h²/12 (H_pp H_q² + H_qq H_p²) for the variant implicit in p: the order of flows matters."""
    energy = P**4 / 4 + P**2 / 2 + sympy.exp(Q) + Q**3
    scene = bs.Scene({"p": 1, "q": 1}, hamiltonian=energy)
    slope, force = energy.diff(P), energy.diff(Q)
    expected = [-sign * slope * force / 2, (energy.diff(P, 2) * force**2 + energy.diff(Q, 2) * slope**2) / 12]
    flows = bs.Splitting([(part, 1) for part in "pq"[::sign]])
    for method in (bs.method(name), flows):
        found = bracket_terms(method, scene, 3)
        assert [sympy.expand(a - b) for a, b in zip(found[1:], expected, strict=True)] == [0, 0]


# The Lie algebra.


def test_free_algebras_have_the_dimensions_of_witt():
    for order, colors in ((9, 2), (6, 3)):
        algebra = LieAlgebra(Words(order, colors), range(colors))
        assert [len(algebra.brackets(n)) for n in range(1, order + 1)] == count_lyndon_words(order, colors)


def test_separable_systems_have_a_free_algebra():
    free = LieAlgebra(Words(8, 2), (0, 1))
    separable = LieAlgebra(tree_table(8, 2, [[0, None], [None, 0]]), (0, 1))
    assert all(free.brackets(n) == separable.brackets(n) for n in range(1, 9))


def test_quadratic_kinetic_energy():
    """The dimensions of McLachlan and Ryland; the basis is that of the free algebra without brackets that vanish."""
    free = LieAlgebra(Words(9, 2), (0, 1))
    quadratic = LieAlgebra(tree_table(10, 2, [[0, 1, 1], [None, 0]]), (0, 1))
    assert [len(quadratic.brackets(n)) for n in range(1, 11)] == [2, 1, 2, 2, 4, 5, 10, 14, 25, 39]
    for n in range(1, 10):
        vanishing = {word for word in free.brackets(n) if any(2 * sum(word[k:]) >= n - k + 2 for k in range(n))}
        assert set(quadratic.brackets(n)) == set(free.brackets(n)) - vanishing


def test_quadratic_kinetic_energy_leaves_terms_out_and_changes_none():
    general = bracket_hamiltonian(bs.method("stormer-verlet"), 9)
    quadratic = bracket_hamiltonian(bs.method("stormer-verlet"), 9, quadratic_kinetic=True)
    assert (general.kinetic, quadratic.kinetic) == (None, "T")
    assert all(general[word] == value for word, value in quadratic.items())
    assert 0 < len(quadratic.term(8)) < len(general.term(8))


def test_several_potentials_commute():
    found = bracket_hamiltonian(bs.methods.lie_trotter(["a", "b", "T"]), 4, quadratic_kinetic="T")
    assert ("a", "b") not in found
    assert found.parts == ("T", "a", "b")
    scene = bs.Scene(
        {"p": 1, "q": 1},
        terms=[
            Term(hamiltonian="p^2/2", part="T"),
            Term(hamiltonian="cos(q)", part="a"),
            Term(hamiltonian="q^4", part="b"),
        ],
    )
    check_against_trees(bs.methods.lie_trotter(["a", "b", "T"]), scene, 4)


# Against trees.


def check_against_trees(method, scene, order, parts=None):
    found = bracket_terms(method, scene, order, parts)
    field = bs.modified_field(method, scene, order, parts=parts)
    for k, energy in enumerate(found):
        pairs = list(zip(hamiltonian_field(energy, scene), field.symbolic(k), strict=True))
        ring = DifferentialRing([x for pair in pairs for x in pair], scene.symbols)
        assert all(ring.is_zero(ring.element(a) - ring.element(b)) for a, b in pairs), k
    return found


@pytest.mark.few(4)
@pytest.mark.parametrize(
    ("name", "scene", "order"),
    [
        ("stormer-verlet", "henon-heiles", 7),
        ("stormer-verlet", "kepler", 5),
        ("position-verlet", "pendulum", 7),
        ("lie-trotter", "pendulum", 6),
        ("lie-trotter", "lotka-volterra", 5),
        ("strang", "lotka-volterra", 7),
        ("takahashi-imada", "henon-heiles", 5),
        ("chin4a", "henon-heiles", 5),
        ("rkn-verlet", "pendulum", 5),
        ("symplectic-euler-q", "toda", 4),
        ("triple-jump4", "henon-heiles", 5),
    ],
)
def test_brackets_on_scenes_agree_with_trees(name, scene, order):
    found = check_against_trees(bs.method(name), bs.scene(scene), order)
    assert found[0] == bs.scene(scene).hamiltonian
    assert any(found[1:])


def test_a_lie_poisson_system_in_three_parts():
    """The free rigid body: three rotations about the axes."""
    structure = [[0, "-y3", "y2"], ["y3", 0, "-y1"], ["-y2", "y1", 0]]
    terms = [Term(hamiltonian=f"y{k}^2/(2*I{k})", part=name) for k, name in ((1, "a"), (2, "b"), (3, "c"))]
    scene = bs.Scene({"y": 3}, terms=terms, poisson=structure, parameters={"I1": 2, "I2": 1, "I3": "2/3"})
    check_against_trees(bs.methods.lie_trotter(["a", "b", "c"]), scene, 3)
    assert bracket_terms(bs.methods.strang(["a", "b", "c"]), scene, 4)[1::2] == (0, 0)


def test_parts_that_are_named():
    swapped = bracket_terms(bs.method("lie-trotter"), bs.scene("pendulum"), 3, {"a": "p", "b": "q"})
    assert swapped == bracket_terms(bs.method("symplectic-euler-p"), bs.scene("pendulum"), 3)
    assert swapped[1] == -bracket_terms(bs.method("lie-trotter"), bs.scene("pendulum"), 3)[1]


def test_a_symbolic_parameter():
    scene = bs.Scene({"p": 1, "q": 1}, hamiltonian="p^2/(2*m) + q^4", parameters={"m": "m"})
    m = sympy.Symbol("m")
    found = bracket_terms(bs.method("stormer-verlet"), scene, 3)[2]
    assert sympy.expand(found - (P**2 / m**2 * Q**2 - Q**6 * 2 / 3 / m)) == 0


def test_field_nijhoff():
    """Exercise 5: H − Σ h^k I^(−k) / (k(k+1))."""
    scene = bs.scene("field-nijhoff")
    integral = sympy.prod(symbol + 1 for symbol in scene.symbols)
    found = bracket_terms(bs.method("symplectic-euler-p"), scene, 9)
    for k, energy in enumerate(found[1:], 1):
        assert sympy.simplify(energy + integral**-k / (k * (k + 1))) == 0


# Methods.


def test_yoshida_s_method_has_no_second_power():
    found = bracket_hamiltonian(bs.method("triple-jump4"), 5)
    assert [bool(found.term(k)) for k in range(5)] == [True, False, False, False, True]
    gamma = Fraction(13512, 10000)  # close to 1/(2 − 2^(1/3)), but not equal
    steps = [(bs.method("strang"), x) for x in (gamma, 1 - 2 * gamma, gamma)]
    assert bracket_hamiltonian(bs.composition(steps), 3).term(2)


@pytest.mark.parametrize("name", ["blanes-moan4", "mclachlan-atela4"])
def test_decimals_are_zero_as_far_as_their_digits_tell(name):
    method = bs.method(name)
    found = bracket_hamiltonian(method, 5)
    assert [bool(found.term(k)) for k in range(5)] == [True, False, False, False, True]
    assert found.digits == method.digits == found.to_dict()["digits"]
    assert all(5 <= len(x["coefficient"]) < 24 for x in found.to_dict()["terms"] if x["power"] == 4)
    energy = bracket_terms(method, bs.scene("pendulum"), 5)[4]
    field = bs.modified_field(method, bs.scene("pendulum"), 5).symbolic(4)
    point = {P: Fraction(1, 3), Q: Fraction(2, 3)}
    for a, b in zip((-energy.diff(Q), energy.diff(P)), field, strict=True):
        assert float(a.subs(point)) == pytest.approx(float(b.subs(point)), rel=1e-9)


def test_methods_that_are_splittings_where_they_are_meant_to_be():
    verlet = bracket_hamiltonian(bs.method("stormer-verlet"), 7)
    steps = [(bs.method(f"symplectic-euler-{x}"), "1/2") for x in "pq"]
    assert bracket_hamiltonian(bs.composition(steps), 7) == verlet
    flows = bs.Splitting([("p", "1/2"), ("q", 1), ("p", "1/2")], parts=("p", "q"))
    assert bracket_hamiltonian(flows, 7) == verlet
    quadratic = bracket_hamiltonian(bs.method("stormer-verlet"), 7, quadratic_kinetic=True)
    assert bracket_hamiltonian(bs.method("rkn-verlet"), 7) == quadratic
    assert bracket_hamiltonian(bs.methods.NystromSplitting(flows.flows), 7) == quadratic
    assert bracket_hamiltonian(bs.methods.TakahashiImada(0), 7) == quadratic
    assert bracket_hamiltonian(bs.method("takahashi-imada"), 7) != quadratic
    assert bracket_hamiltonian(bs.methods.NystromSplitting(flows.flows), 7, quadratic_kinetic=False) == verlet


def test_series_as_methods():
    flow = bs.series(bs.method("stormer-verlet"), 5, max_children=[[0, None], [None, 0]])
    expected = bracket_hamiltonian(bs.method("stormer-verlet"), 5)
    assert bracket_hamiltonian(flow) == bracket_hamiltonian(flow.log()) == expected
    assert bracket_hamiltonian(flow, 3).order == 3


def test_simplified_takahashi_imada_is_in_brackets_up_to_the_perturbation_of_formula_17():
    method = bs.methods.TakahashiImada(simplified=True)
    assert bracket_hamiltonian(method, 4).term(2) == bracket_hamiltonian(bs.methods.TakahashiImada(), 4).term(2)
    with pytest.raises(bs.SeriesError, match=r"in brackets of its parts, .* but custom has none: at h\^4 the tree p\["):
        bracket_hamiltonian(method, 5)


def test_symplectic_methods_that_are_no_splittings():
    """From h^5 on there are more elementary Hamiltonians than brackets; the implicit midpoint rule needs no others."""
    lobatto = bs.method("lobatto-iiia-iiib4")
    assert not any(map(bracket_hamiltonian(lobatto, 6).term, range(1, 6)))
    with pytest.raises(bs.SeriesError, match=r"as splitting methods have, but lobatto-iiia-iiib4 has none: at h\^6 "):
        bracket_hamiltonian(lobatto, 7)
    midpoint = bs.PartitionedRungeKutta(dict.fromkeys("pq", bs.method("implicit-midpoint")))
    check_against_trees(midpoint, bs.scene("pendulum"), 7)


def test_a_series_of_brackets_is_a_mapping():
    found = bracket_hamiltonian(bs.method("stormer-verlet"), 5)
    assert found["{T,{T,U}}"] == found["{T, {T, U}}"] == found["T", "T", "U"] == Fraction(1, 12)
    assert found["T"] == found["T",] == 1
    assert found["{T,U}"] == 0
    assert ("U", "U", "T") in found
    assert ("U", "T") not in found
    assert found.get("{U,T}") is None
    assert len(found) == len(list(found)) == 14
    assert repr(found) == "<BracketSeries of stormer-verlet-kdk: 14 brackets of T, U to order 5>"
    assert found != bracket_hamiltonian(bs.method("position-verlet"), 5)
    data = found.to_dict()
    assert [data[key] for key in ("schema", "kind", "order", "domain")] == [1, "brackets", 5, "QQ"]
    term = {"power": 2, "bracket": "{U,{U,T}}", "letters": ["U", "U", "T"], "coefficient": "-1/24"}
    assert term in json.loads(json.dumps(data))["terms"]
    formula = "T + U + h \\left(\\frac{1}{2} \\{T,U\\}\\right)"
    assert bracket_hamiltonian(bs.method("symplectic-euler-p"), 2).to_latex() == formula
    assert bracket_hamiltonian(bs.method("symplectic-euler-p"), 2)._repr_latex_() == f"$\\displaystyle {formula}$"
    sums = bracket_hamiltonian(bs.methods.TakahashiImada("alpha", parameters=["alpha"]), 3)
    assert str(sums).splitlines()[2] == "h^2   1/12 {T,{T,U}} + (-alpha/2 - 1/24) {U,{U,T}}"
    assert "+ (- \\frac{\\alpha}{2} - \\frac{1}{24}) \\{U,\\{U,T\\}\\}" in sums.to_latex()


# What is refused.


@pytest.mark.parametrize(
    ("method", "options", "message"),
    [
        ("rk4", {}, "method must treat parts of the field differently, but rk4 has one part only"),
        ("stormer-verlet", {"order": None}, "order must be given for a method, but was None"),
        ("stormer-verlet", {"order": 25}, "order must be smaller: there are 2807196 brackets to order 25"),
        ("strang", {"quadratic_kinetic": "c"}, "quadratic_kinetic must be True, False or one of a, b, but was 'c'"),
        ("takahashi-imada", {"quadratic_kinetic": False}, "must not be False for takahashi-imada, which is made for"),
    ],
)
def test_methods_that_are_refused(method, options, message):
    with pytest.raises(bs.SeriesError, match=message):
        bracket_hamiltonian(bs.method(method), **({"order": 3} | options))


def test_arguments_that_are_refused():
    with pytest.raises(bs.SeriesError, match="quadratic_kinetic must be False or one of a, b, c, but was True"):
        bracket_hamiltonian(bs.methods.lie_trotter(["a", "b", "c"]), 3, quadratic_kinetic=True)
    with pytest.raises(bs.SeriesError, match="quadratic_kinetic must be None for a series, but was True"):
        bracket_hamiltonian(bs.series(bs.method("strang"), 2), quadratic_kinetic=True)
    with pytest.raises(bs.SeriesError, match="but a series has one part only"):
        bracket_hamiltonian(bs.exact_flow(3))
    with pytest.raises(bs.SeriesError, match="method must be a method such as"):
        bracket_hamiltonian(3, 3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(bs.SeriesError, match=r"none: at h\^2 the tree p\[p\[p\]\] breaks it"):
        bracket_hamiltonian(bs.series(bs.method("stormer-verlet"), 3))
    found = bracket_hamiltonian(bs.method("strang"), 3)
    with pytest.raises(bs.SeriesError, match=r"bracket must be one of the basis, such as {b,{b,a}}, but was {b,a}"):
        found["{b,a}"]
    with pytest.raises(bs.SeriesError, match="k must be a power of h from 0 to 2, but was 3"):
        found.term(3)
    with pytest.raises(bs.IntegratorError, match="parts must be two or more names, but were 1"):
        bch(3, ["A"])


@pytest.mark.parametrize(
    ("method", "scene", "message"),
    [
        ("rk4", "pendulum", "method must treat parts of the field differently, but rk4 has one part only"),
        ("symplectic-euler-p", "lotka-volterra", "separable for symplectic-euler-p, which is no chain of flows"),
        ("strang", "double-pendulum", "sum of Hamiltonians of the method's parts, but double-pendulum is not"),
    ],
)
def test_scenes_that_are_refused(method, scene, message):
    with pytest.raises(bs.SeriesError, match=message):
        bracket_terms(bs.method(method), bs.scene(scene), 3)


def test_parts_without_hamiltonians_are_refused():
    with pytest.raises(bs.SeriesError, match="scene must be Hamiltonian or Poisson, but abc-flow has no Hamiltonian"):
        bracket_terms(bs.methods.lie_trotter(["a", "b", "c"]), bs.scene("abc-flow"), 3)
    mixed = bs.Scene({"p": 1, "q": 1}, hamiltonian="(p + q)^2/2 + q^2/2")
    with pytest.raises(bs.SeriesError, match="sum of Hamiltonians of the method's parts, but scene is not"):
        bracket_terms(bs.method("strang"), mixed, 3)
    hidden = bs.Scene({"p": 1, "q": 1}, hamiltonian="(p + q)*(p - q)/2")  # T − U once it is multiplied out
    assert bracket_terms(bs.method("strang"), hidden, 3)[2] == P**2 / 24 + Q**2 / 12
