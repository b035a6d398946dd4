from __future__ import annotations

import pickle
from fractions import Fraction
from itertools import product
from math import factorial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tree_oracles import grown, random_trees

from trees import Forest, FormalSum, Tree, TreeError

forests = st.lists(random_trees(colors=3, largest=8), max_size=4).map(Forest)
small = [Forest(tree.children) for order in range(1, 6) for tree in grown(order)]  # all forests to order 4
sums = st.dictionaries(st.sampled_from(small), st.fractions(max_denominator=6), max_size=4).map(FormalSum)


@given(forests)
def test_forests_are_read_back_from_their_text(forest: Forest) -> None:
    assert Forest(forest.text()) == forest == pickle.loads(pickle.dumps(forest)) == Forest(reversed(forest.trees))
    assert Forest(forest.text(["x", "y", "z"]), names=["x", "y", "z"]) == forest
    assert hash(Forest(reversed(forest.trees))) == hash(forest)


@given(forests)
def test_a_common_root_turns_forests_into_trees(forest: Forest) -> None:
    tree = Tree.join(forest, color=2)
    assert Forest(tree.children) == forest
    assert (forest.order, forest.symmetry, len(forest)) == (tree.order - 1, tree.symmetry, len(tree.children))


@given(forests, forests, forests)
def test_forests_are_a_commutative_monoid(x: Forest, y: Forest, z: Forest) -> None:
    assert x * y == y * x == Forest(x.trees + y.trees)
    assert hash(x * y) == hash(Forest(x.trees + y.trees))
    assert (x * y) * z == x * (y * z)
    assert x * Forest() == Forest() * x == x


def test_forests_are_ordered_by_nodes_then_trees() -> None:
    listing = [str(forest) for forest in sorted(small) if forest.order <= 3]
    assert listing == ["∅", "τ", "τ·τ", "[τ]", "τ·τ·τ", "τ·[τ]", "[[τ]]", "[τ,τ]"]
    for x, y in product(small, small):
        assert (x < y) + (x == y) + (x > y) == 1
        assert (x <= y) == (not y < x)


def test_notations_of_forests() -> None:
    assert Forest() == Forest("∅") == Forest(" 1 ") == Forest([])
    assert Forest("τ^2·[t]") == Forest("[0,1]·[0]^2") == Tree("τ") * Forest("[τ]") * Tree("τ")
    assert str(Forest("p·q[p]")) == "p·q[p]"
    assert (str(Forest("p^2")), str(Forest("c"))) == ("τ·τ", "c")
    assert Forest("[τ^3]^2").symmetry == 6 * 6 * 2
    assert Forest("p·p·q").symmetry == 2
    assert Forest("p[q]·q").to_latex() == r"q \cdot p[q]"
    assert Forest("τ").to_latex(["a_b"]) == r"\mathrm{a\_b}"
    assert (Forest().to_latex(), repr(Forest()), Forest("τ")._repr_latex_()) == ("\\emptyset", "Forest('∅')", r"$\tau$")


@pytest.mark.parametrize(
    ("argument", "sentence"),
    [
        ("τ··τ", "text must be one tree .* but is empty"),
        ("τ^0", "stray"),
        ("[τ", "a bracket that is never closed at position 1"),
        ("p·a", "text must name the colours of all its trees in one way, but was 'p·a'"),
        ("τ·q", "text must name the colours of all its trees in one way"),
        ("τ^9000·[τ]^999", "text must be a forest of at most 10000 nodes"),
        ("τ^10001", "text must be a forest of at most 10000 nodes"),
        (3, "trees must be trees, or a text such as 'τ·\\[τ\\]', but was 3"),
        (["τ"], "trees must be trees, but one was 'τ'"),
        ([Tree("[τ^9000]")] * 2, "trees must have at most 10000 nodes together, but have 18002"),
    ],
)
def test_what_is_no_forest_is_refused(argument, sentence: str) -> None:
    with pytest.raises(TreeError, match=sentence):
        Forest(argument)


def test_the_largest_forests_are_read() -> None:
    assert Forest("τ^10000").order == Forest("τ^9000·[τ]^500").order == 10_000


def test_names_of_forests_are_checked() -> None:
    with pytest.raises(TreeError, match="names must name the colours 0 to 1"):
        Forest("p·q").text(["x"])
    with pytest.raises(TreeError, match="names must be different words"):
        Forest("p·q").text(5)  # pyright: ignore[reportArgumentType]
    with pytest.raises(TreeError, match="not one of x"):
        Forest("y", names=["x"])


@pytest.mark.parametrize("name", ["order", "trees", "anything"])
def test_forests_are_immutable(name: str) -> None:
    with pytest.raises(AttributeError):
        setattr(Forest("τ"), name, 1)


@settings(max_examples=50)
@given(sums, sums, sums)
def test_sums_are_a_commutative_algebra(x: FormalSum, y: FormalSum, z: FormalSum) -> None:
    one, zero = FormalSum(Forest()), FormalSum()
    assert x + y == y + x == sum([x, y])
    assert x - x == zero == 0 * x
    assert x - y == -(y - x)
    assert x * y == y * x
    assert (x * y) * z == x * (y * z)
    assert x * (y + z) == x * y + x * z
    assert x * one == x == x + zero == (3 * x) / 3
    assert x == FormalSum(dict(x.items())) == pickle.loads(pickle.dumps(x))
    assert hash(x + y) == hash(y + x)


@settings(max_examples=30)
@given(sums, sums, sums, sums)
def test_tensor_products_multiply_factor_by_factor(x: FormalSum, y: FormalSum, z: FormalSum, w: FormalSum) -> None:
    assert x.tensor(y) * z.tensor(w) == (x * z).tensor(y * w)
    assert (x + z).tensor(y) == x.tensor(y) + z.tensor(y)
    assert x.tensor(y).tensor(z) == x.tensor(y.tensor(z))
    assert x.tensor(y).map(lambda pair: pair[0] * pair[1]) == x * y
    assert x.tensor(y).evaluate(value, factorial_of) == x.evaluate(value) * y.evaluate(factorial_of)


def value(tree: Tree) -> Fraction:
    return Fraction(1, tree.density + 1)


def factorial_of(tree: Tree) -> int:
    return factorial(tree.order)


@given(sums, sums)
def test_values_are_multiplicative_and_linear(x: FormalSum, y: FormalSum) -> None:
    assert (x * y).evaluate(value) == x.evaluate(value) * y.evaluate(value)
    assert (x + 2 * y).evaluate(value) == x.evaluate(value) + 2 * y.evaluate(value)


def test_a_sum_is_a_mapping_that_gives_zero() -> None:
    x = FormalSum({"τ·[τ]": 2, Tree("τ"): Fraction(6, 3), "∅": 0, "[τ]·τ": Fraction(-1, 2)})
    assert list(x.items()) == [(Forest("τ"), 2), (Forest("τ·[τ]"), Fraction(3, 2))]
    assert (x["[τ]·τ"], x[Tree("τ")], x["∅"], x["τ", "τ"]) == (Fraction(3, 2), 2, 0, 0)
    assert (len(x), x.factors, bool(FormalSum()), FormalSum().factors) == (2, 1, False, 0)
    assert "τ" in x
    assert "∅" not in x
    assert list(FormalSum({("τ", "∅"): 1})) == [(Forest("τ"), Forest("∅"))]
    assert FormalSum("τ") != Forest("τ")
    assert Tree("τ") + FormalSum("∅") - Forest("τ") == FormalSum("∅") == Tree("τ") - FormalSum({"τ": 1, "∅": -1})


def test_texts_of_sums() -> None:
    x = FormalSum({("τ", "q"): 1, ("∅", "p[q]"): -1, ("q^2", "∅"): Fraction(-1, 2)})
    assert str(x) == "-∅⊗p[q] + p⊗q - 1/2 q·q⊗∅"
    assert x.to_latex() == r"-\emptyset \otimes p[q] + p \otimes q - \frac{1}{2} q \cdot q \otimes \emptyset"
    assert x.text(["u", "v"]) == "-∅⊗u[v] + u⊗v - 1/2 v·v⊗∅"
    assert (repr(FormalSum()), FormalSum().to_latex()) == ("0", "0")
    assert FormalSum("τ")._repr_latex_() == r"$\displaystyle \tau$"


def test_default_names_of_sums_are_those_of_the_largest_colour() -> None:
    leaves = [Tree.from_levels([0], [color]) for color in range(3)]
    assert str(FormalSum(leaves[0])) == "τ"
    assert str(FormalSum(leaves[1])) == "q"
    assert str(FormalSum(leaves[2])) == "c"
    assert str(leaves[0] + FormalSum(leaves[1])) == "p + q"
    assert (str(FormalSum("∅")), str(leaves[0] + FormalSum(leaves[2]))) == ("∅", "a + c")


def test_symbols_and_roots_are_exact_coefficients() -> None:
    sympy = pytest.importorskip("sympy")
    g, root = sympy.Symbol("g"), sympy.sqrt(2)
    x = FormalSum({"τ": 1, "[τ]": 2})
    assert g * x == x * g
    assert (g + 1) * (g - 1) * x == x * (g**2 - 1)
    assert not (1 + root) * (root - 1) * x - x
    assert not x / (1 + root) - x * (root - 1)
    assert x / (1 + root) == x * (root - 1)
    assert hash(x / (1 + root)) == hash(x * (root - 1))
    assert type((root * x * root)["τ"]) is int
    assert (root - 1) * ((1 + root) * x / 3) == x * Fraction(1, 3)
    assert str((g + 1) * x) == "(g + 1) τ + (2*g + 2) [τ]"
    assert (-root * x).to_latex() == r"-\sqrt{2} \tau - 2 \sqrt{2} [\tau]"


def test_numbers_of_numpy_are_accepted_if_they_are_integers() -> None:
    numpy = pytest.importorskip("numpy")
    x = FormalSum("τ")
    assert numpy.int64(3) * x == x * numpy.int64(3) == 3 * x
    with pytest.raises(TreeError, match="coefficient must be an int, a Fraction or an exact SymPy expression"):
        numpy.float64(3) * x


@pytest.mark.parametrize("bad", [0.5, 1.0, True, "2", None, float("nan"), 1j])
def test_inexact_coefficients_are_refused(bad) -> None:
    sentence = "coefficient must be an int, a Fraction or an exact SymPy expression, but was "
    with pytest.raises(TreeError, match=sentence):
        FormalSum({"τ": bad})
    if not isinstance(bad, str):
        for operation in (lambda x: x * bad, lambda x: bad * x, lambda x: x / bad):
            with pytest.raises(TreeError, match=sentence):
                operation(FormalSum("τ"))


def test_expressions_that_are_no_exact_numbers_are_refused() -> None:
    sympy = pytest.importorskip("sympy")
    for bad in (sympy.Float(1), 0.5 * sympy.Symbol("g"), sympy.oo, sympy.nan, sympy.Symbol("A", commutative=False)):
        with pytest.raises(TreeError, match="coefficient must be"):
            FormalSum({"τ": bad})


def test_misuse_of_sums_is_refused() -> None:
    x, pair = FormalSum("τ"), FormalSum(("τ", "τ"))
    with pytest.raises(TreeError, match="divisor must not be zero, but was 0"):
        x / 0
    with pytest.raises(TreeError, match="other must have terms of 1 tensor factors, as the first sum has, but has 2"):
        x + pair
    with pytest.raises(TreeError, match="other must have terms of 2 tensor factors"):
        pair * Tree("τ")
    with pytest.raises(TreeError, match="terms must have equally many tensor factors, but had 1 and 2"):
        FormalSum({"τ": 1, ("τ", "τ"): 1})
    with pytest.raises(TreeError, match=r"rule\(element\) must have equally many tensor factors, but had 1 and 3"):
        (x + Forest("∅")).map(lambda forest: forest if len(forest) else (forest, forest, forest))
    with pytest.raises(TreeError, match=r"rule\(element\) must be a tree, a forest or a sum of forests, but was 7"):
        x.map(lambda forest: 7)
    with pytest.raises(TreeError, match="rules must be as many as tensor factors, 2, but were 1"):
        pair.evaluate(value)
    with pytest.raises(TreeError, match="element must have two or more tensor factors to be a tuple"):
        FormalSum((Tree("τ"),))
    with pytest.raises(TreeError, match="element must be a tree, a forest, or a tuple of these, but was 3"):
        x[3]  # pyright: ignore[reportArgumentType]
    with pytest.raises(TreeError, match="terms must be a mapping from forests to coefficients, but was 3"):
        FormalSum(3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError):
        x + 1  # pyright: ignore[reportOperatorIssue]
    with pytest.raises(TypeError):
        Forest("τ") * 3  # pyright: ignore[reportOperatorIssue]
    with pytest.raises(TypeError):
        assert Forest("τ") < 3  # pyright: ignore[reportOperatorIssue]


def test_products_that_would_seem_to_hang_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trees.hopf.sums.MOST_PRODUCTS", 1000)
    many = FormalSum({Tree.join([], color): 1 for color in range(40)})
    with pytest.raises(TreeError, match="order must be smaller: this takes more than 1000 products of terms"):
        many * many
    with pytest.raises(TreeError, match="order must be smaller: this takes more than 1000 products of terms"):
        many.tensor(many)
    monkeypatch.setattr("trees.hopf.sums.MOST_PRODUCTS", 1600)
    assert len(many * many) == 820
