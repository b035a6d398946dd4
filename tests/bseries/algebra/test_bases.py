"""Bases: their cuts and texts, and the laws of the algebra on each kind, a toy kind among them."""

import json
import math
import random
from fractions import Fraction

import pytest

import bseries as bs
from bseries.algebra import Series, bracket, lie_derivative
from bseries.exact.arithmetic import Exact, prime_field
from bseries.exact.domains import make_values
from bseries.exact.recursions import lie_series
from bseries.exact.residues import primes_beyond
from bseries_base.lowering import flat_kernels
from trees import Basis, TreeError, TreeTable, Words
from trees.basis import Growth


class BinaryTrees(Basis):
    """Rooted trees all of whose nodes have at most one child in each of two places, left and right: nested pairs.

    A cut removes a child in its place. Equal cuts are one row with a multiplicity.
    """

    what, growth = "binary trees", Growth(lambda n, k: n - 1, lambda n: n - 1, lambda n: 2**n)

    def __init__(self, order):
        self.max_order, self.colors = order, 1
        by_order = [[None]]
        for n in range(1, order + 1):
            by_order.append([(a, b) for k in range(n) for a in by_order[k] for b in by_order[n - 1 - k]])
        self.sizes = [len(row) for row in by_order[1:]]
        self.elements = [tree for row in by_order[1:] for tree in row]
        self.known = {tree: at for at, tree in enumerate(self.elements)}

    def cuts(self, tree):
        for place in (0, 1):
            if (child := tree[place]) is not None:
                yield self.with_child(tree, place, None), child
                for trunk, branch in self.cuts(child):
                    yield self.with_child(tree, place, trunk), branch

    @staticmethod
    def with_child(tree, place, child):
        return (child, tree[1]) if place == 0 else (tree[0], child)

    def rows(self, at):
        pairs = [(self.known[trunk], self.known[branch]) for trunk, branch in self.cuts(self.elements[at])]
        return [(*pair, pairs.count(pair)) for pair in dict.fromkeys(pairs)]

    def element(self, at):
        return self.elements[at]

    def find(self, element):
        return self.known.get(element, -1)

    def letters(self, element):
        return (0,) * sum(1 for _ in self.cuts(element)) + (0,)

    def read(self, text, names=None):
        return next(tree for tree in self.elements if self.text(tree) == text)

    def text(self, element, names=None):
        return "".join("." if child is None else f"({self.text(child)})" for child in element)

    latex = text

    def truncated(self, order):
        return BinaryTrees(order)


BASES = [TreeTable(6), TreeTable(4, 2), TreeTable(5, 2, [[0, None], [1, 0]]), Words(5), Words(4, 3), Words(7, 1)]
BASES += [BinaryTrees(5)]


def some(basis, seed, empty):
    source = random.Random(seed)
    return Series.of(basis, lambda _: Fraction(source.randint(-5, 5), source.randint(1, 6)), empty=empty)


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_cuts_are_one_row_after_another_and_texts_are_read_back(basis):
    seen = 0
    for cuts in basis.cut_chunks():
        assert cuts.first == seen
        for at in range(cuts.first, cuts.last):
            rows = range(cuts.start[at - cuts.first], cuts.start[at - cuts.first + 1])
            times = [1 if cuts.multiplicity is None else cuts.multiplicity[k] for k in rows]
            given = [(cuts.trunk[k], cuts.branch[k], x) for k, x in zip(rows, times, strict=True)]
            assert sorted(given) == sorted(basis.rows(at))
            assert all(basis.order_of(t) + basis.order_of(b) == basis.order_of(at) for t, b, _ in given)
            sizes = [basis.order_of(b) for _, b, x in given for _ in range(x)]
            n = basis.order_of(at)
            assert len(sizes) <= basis.growth.cuts(n)
            assert all(sizes.count(k) <= basis.growth.branches(n, k) for k in range(1, n))
        seen = cuts.last
    assert seen == len(basis) == sum(basis.sizes)
    for at, element in enumerate(basis):
        assert basis.index(element) == basis.index(basis.text(element)) == at
        assert len(basis.letters(element)) == basis.order_of(at) == basis.orders[at] == basis.order[at]


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_laws(basis, execution):
    a, c, identity = some(basis, 1, 1), some(basis, 2, 1), Series.of(basis, lambda _: 0)
    assert a.log().exp() == a
    assert bs.compose(a, a.inverse()) == bs.compose(a.inverse(), a) == identity
    assert bs.compose(bs.compose(a, c), a) == bs.compose(a, bs.compose(c, a))
    assert bs.compose(a, a) == a**2 == (a ** Fraction(2, 3)) ** 3
    assert a.adjoint().adjoint() == a
    assert bs.compose(a, c).inverse() == bs.compose(c.inverse(), a.inverse())
    assert a.truncate(3).log() == a.log().truncate(3)


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_brackets(basis):
    x, y, z = (some(basis, seed, 0) for seed in (3, 4, 5))
    jacobi = bracket(x, bracket(y, z)) + bracket(y, bracket(z, x)) + bracket(z, bracket(x, y))
    assert jacobi == 0 * x
    assert bracket(x, y) == -bracket(y, x)
    # Leibniz: flows of commuting fields commute, others do not.
    assert bs.compose(x.exp(), (2 * x).exp()) == (3 * x).exp()
    assert (bs.compose(x.exp(), y.exp()) == bs.compose(y.exp(), x.exp())) == (bracket(x, y) == 0 * x)


def test_one_letter_is_the_algebra_of_power_series():
    words = Words(8, 1)
    a = Series.of(words, lambda word: Fraction(1, math.factorial(len(word))))
    assert a.log() == Series.of(words, lambda word: int(len(word) == 1), empty=0)
    assert a.inverse().coefficients() == [Fraction((-1) ** n, math.factorial(n)) for n in range(1, 9)]


def test_tall_trees_are_words(execution):
    tall, words = TreeTable(5, 2, 1), Words(5)
    coefficients = some(words, 7, 1).coefficients()
    a = Series.of(words, dict(zip(words, coefficients, strict=True)).get)
    b = Series.of(tall, lambda tree: a[tree.colors])
    assert a.log().coefficients() == b.log().coefficients()
    assert bs.compose(a, a.log()).coefficients() == bs.compose(b, b.log()).coefficients()
    method = bs.method("strang")
    assert bs.series(method, words).coefficients() == bs.series(method, tall).coefficients()


def test_products_of_matrices():
    """Words are products of matrices: log(exp A exp B) of nilpotent matrices, by its series of words."""
    import sympy

    A, B = sympy.Matrix(4, 4, lambda i, j: int(j == i + 1)), sympy.Matrix(4, 4, lambda i, j: (i + 2) * int(j == i + 1))
    words = Words(3)
    exp = [Series.of(words, lambda word, k=k: int(word == (k,)), empty=0).exp() for k in (0, 1)]
    log = bs.compose(exp[1], exp[0]).log()
    total = sympy.zeros(4, 4)
    for word, value in log.items():
        product = sympy.eye(4)
        for letter in word:
            product *= (A, B)[letter]
        total += sympy.Rational(value.numerator, value.denominator) * product
    assert total.exp() == A.exp() * B.exp()


def test_a_wrong_cut_breaks_the_laws():
    class Wrong(BinaryTrees):
        def rows(self, at):
            return [(trunk, branch, times + (branch == 1)) for trunk, branch, times in super().rows(at)]

    basis = Wrong(4)
    a, c = some(basis, 1, 1), some(basis, 2, 1)
    assert bs.compose(bs.compose(a, c), a) != bs.compose(a, bs.compose(c, a))


def test_multiplicities_and_many_rows_are_reduced_modulo_a_prime():
    """A bush with forty equal branches: sums of more products than fit into 63 bits, and factors beyond the prime."""

    class Bushes(BinaryTrees):
        def __init__(self):
            super().__init__(3)
            self.compiled = True

        def rows(self, at):
            n = self.order_of(at)
            return [(at2, 0, 2**31 + at2) for at2 in self.ids(n - 1) for _ in range(40)] if n > 1 else []

    basis, prime = Bushes(), primes_beyond(1)[0]
    half = Fraction(1, 2)
    run = lambda x: lie_series(x.vector([half] * len(basis)), x.vector([half] * len(basis)), 1, basis, x)  # noqa: E731
    exact, residues = run(Exact()), run(prime_field(prime))
    for x, residue in zip(exact, residues, strict=True):
        assert (Fraction(x).numerator - int(residue) * Fraction(x).denominator) % prime == 0


class Ladders(Basis):
    """One element for each number of nodes: power series."""

    what, growth = "ladders", Growth(lambda n, k: 1, lambda n: n - 1, lambda n: n + 1)

    def __init__(self, order):
        self.max_order, self.colors, self.sizes = order, 1, [1] * order

    def rows(self, at):
        return [(at - k, k - 1, 1) for k in range(1, at + 1)]

    def element(self, at):
        return at + 1

    find = letters = read = text = latex = truncated = None


def test_numbers_of_nodes_may_be_large(execution):
    """1/(1 − x) has the logarithm Σ x^n/n: numbers of nodes do not wrap around in arrays of bytes."""
    basis = Ladders(300)
    assert basis.order.tolist() == basis.orders
    field = Series(basis, make_values(basis, [1.0] * 300), 1).log()
    assert field.coefficients() == pytest.approx([1 / n for n in range(1, 301)], rel=1e-9)


@pytest.mark.parametrize("basis", [BinaryTrees(5), Words(4, 3), TreeTable(4, 2), TreeTable(6)], ids=repr)
def test_compositions_of_integers_are_integers(basis, monkeypatch):
    """What the claims on denominators rest on; the interpreter checks them."""
    monkeypatch.setattr(flat_kernels, "FEW_PRODUCTS", math.inf)
    source = random.Random(3)
    a, c = (Series.of(basis, lambda _: source.randint(-9, 9)) for _ in range(2))
    assert all(x.denominator == 1 for x in bs.compose(a, c).coefficients())


def test_elements_in_another_normalisation_are_refused():
    """Bushes with n leaves without the n ways to cut one: powers of a(τ) over factorials."""

    class Bushes(Ladders):
        def rows(self, at):
            return [(at - 1, 0, 1)] if at else []

    a = Series.of(Bushes(3), lambda n: 1)
    with pytest.raises(ArithmeticError, match="denominator bound is wrong: 7/2 is not an integer"):
        bs.compose(a, a)


def test_multiplicities_times_roots(execution):
    root = pytest.importorskip("sympy").sqrt(2)
    plain = some(BinaryTrees(4), 1, 0)
    assert (plain * root).scale_step(root).exp() == (plain * root).exp().scale_step(root)
    assert (plain * root).exp().log() == plain * root


def test_sums_of_series_on_trees_need_not_be_of_one_class():
    table = TreeTable(3)
    plain, method = Series.of(table, lambda tree: tree.order), bs.series("rk4", 3)
    assert plain + method == method + plain == method - (-1) * plain
    assert bracket(plain.log(), method.log()) == -bracket(method.log(), plain.log())


@pytest.mark.parametrize("times", [[0, "g", 1, "1-g", 0], [0, "g*sqrt(2)", 1, "1-g*sqrt(2)"]])
def test_flows_over_no_time_among_symbols(times):
    method = bs.Splitting(list(zip("babab", times, strict=False)), parameters=["g"])
    tall = bs.series(method, TreeTable(4, 2, 1))
    words = bs.series(method, Words(4))
    assert all(words[tree.colors] == value for tree, value in tall.items())
    assert bs.order_of(method, 4) == bs.order_of(bs.series(method, 4)) == 1


def test_errors_name_the_argument():
    with pytest.raises(bs.SeriesError, match=r"basis must be a basis, such as trees\.Words\(3\), but was 3"):
        Series.of(3, lambda word: 1)
    with pytest.raises(TreeError, match="text must be letters among p, q, with spaces between, but was 'p r'"):
        Words(3).read("p r")
    with pytest.raises(TreeError, match="word must be one of the 14 words of the table Words"):
        Words(3).index((0, 1, 0, 1))
    with pytest.raises(TreeError, match="order must be smaller"):
        Words(40, 2)
    with pytest.raises(bs.SeriesError, match="order must be a table of trees for rk4, which is no product of flows"):
        bs.series("rk4", Words(3, 1))
    with pytest.raises(bs.SeriesError, match="both series must have the same"):
        lie_derivative(some(Words(3), 1, 0), some(Words(4), 1, 0))
    with pytest.raises(bs.SeriesError, match="b must be a BSeries"):
        bs.substitute(some(Words(3), 1, 0), bs.method("rk4"))
    with pytest.raises(bs.SeriesError, match="both series must have the same words, but were on Words"):
        bs.compose(some(Words(3), 1, 1), bs.series("rk4", 3))
    with pytest.raises(bs.SeriesError, match=r"method must be a method .* or a series on trees"):
        bs.analysis.accuracy(some(Words(3), 1, 1), 3)
    with pytest.raises(bs.SeriesError, match=r"method must be a method .* or a series on trees"):
        bs.modified_equation(some(Words(3), 1, 1))
    document = some(Words(2), 1, 1).to_dict()
    with pytest.raises(bs.SeriesError, match="basis must be words, or left out for trees, but was 'wordz'"):
        bs.load_series(json.dumps({**document, "basis": "wordz"}))
    document["terms"][2]["coefficient"] = "nan"
    with pytest.raises(bs.SeriesError, match="coefficient of p p must be the text of a number"):
        bs.load_series(json.dumps(document))


def test_words_are_immutable_and_equal_letters_are_equal_words():
    words = Words(3)
    with pytest.raises(AttributeError, match="immutable"):
        words.max_order = 2
    with pytest.raises(AttributeError, match="immutable: sizes cannot be deleted"):
        del words.sizes
    assert [words.find(word) for word in ((0.0,), (True, 0.0), (0.5,))] == [0, words.index("q p"), -1]
    assert some(words, 1, 1)[(0.0, 1.0)] == some(words, 1, 1)["p q"]


def test_documents_of_series_on_words_are_read_back():
    one = Series.of(Words(3, 1), len, names=["x"])
    for s in (bs.series("strang", Words(4)), some(Words(3, 3), 9, 0), bs.series("mclachlan4", Words(3)), one):
        text = json.dumps(s.to_dict())
        again = bs.load_series(text)
        assert (type(again), again) == (Series, s)
        assert again.to_dict() == s.to_dict()
        twice = json.loads(text)
        twice["terms"][1] = twice["terms"][0]
        with pytest.raises(bs.SeriesError, match="terms must have each word once"):
            bs.load_series(json.dumps(twice))


def test_displays():
    s = bs.algebra.bracket(*(Series.of(Words(3), lambda w, k=k: int(w == (k,)), empty=0) for k in (0, 1)))
    assert (
        str(s.truncate(2).to_table(nonzero=True).to_text()).splitlines()[0]
        == "Field: words with 1 to 2 letters, powers h^0 to h^1"
    )
    assert s.to_latex() == "-h\\, p q + h\\, q p"
    assert repr(s) == "<Series: 14 words to order 3, QQ>"


def test_tables_speak_of_the_elements_of_their_basis():
    text = bs.algebra.Series.of(Words(2, 1), lambda word: 1, names=["x"]).to_table().to_text()
    assert "Series: words with 1 to 2 letters" in text
    assert "x x" in text
    assert "h^|w| · weight(w) · F(w)" in text
    assert "τ" not in text
    assert "τ" in bs.series("rk4", 2).to_table().to_text()
