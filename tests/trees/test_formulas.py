from __future__ import annotations

import re
from fractions import Fraction
from itertools import product

import pytest
from hypothesis import given
from tree_oracles import grown, random_trees

from trees.errors import TreeError
from trees.tree import Tree

# HLW, Table III.1.1 (b and c for the sums over the row of A, as below it).
HLW_TABLE = {
    "τ": ("f", "Σ b_i = 1"),
    "[τ]": ("f'(f)", "Σ b_i c_i = 1/2"),
    "[τ,τ]": ("f''(f,f)", "Σ b_i c_i^2 = 1/3"),
    "[[τ]]": ("f'(f'(f))", "Σ b_i a_ij c_j = 1/6"),
    "[τ,τ,τ]": ("f'''(f,f,f)", "Σ b_i c_i^3 = 1/4"),
    "[[τ],τ]": ("f''(f,f'(f))", "Σ b_i c_i a_ij c_j = 1/8"),
    "[[τ,τ]]": ("f'(f''(f,f))", "Σ b_i a_ij c_j^2 = 1/12"),
    "[[[τ]]]": ("f'(f'(f'(f)))", "Σ b_i a_ij a_jk c_k = 1/24"),
    "[τ^4]": ("f^(4)(f,f,f,f)", "Σ b_i c_i^4 = 1/5"),
    "[τ^2,[τ]]": ("f'''(f,f,f'(f))", "Σ b_i c_i^2 a_ij c_j = 1/10"),
    "[[τ],[τ]]": ("f''(f'(f),f'(f))", "Σ b_i a_ij c_j a_ik c_k = 1/20"),
    "[[τ,[τ]]]": ("f'(f''(f,f'(f)))", "Σ b_i a_ij c_j a_jk c_k = 1/40"),
}

A = [[Fraction(1, 3), Fraction(-1, 2), 0], [Fraction(2, 7), 1, Fraction(1, 5)], [4, Fraction(-3, 4), Fraction(1, 6)]]
B = [Fraction(1, 2), Fraction(-2, 3), Fraction(5, 4)]


def method(name: str) -> tuple[list, list]:
    """A Runge–Kutta matrix and weights without any structure, another for each colour."""
    shift = ord(name) - ord("a") + 1 if name else 0
    return [[entry + Fraction(shift, i + 2 * j + 1) for j, entry in enumerate(row)] for i, row in enumerate(A)], [
        entry * (shift + 1) for entry in B
    ]


def value_of_text(text: str) -> Fraction:
    """The sum that a weight's text stands for, term by term."""
    factors = [re.fullmatch(r"\(?([abc])(?:\^(\w))?_([a-z0-9,]+)\)?(?:\^(\d+))?", word) for word in text.split()[1:]]
    parsed = []
    for match in factors:
        assert match
        symbol, name, subscript, power = match.groups()
        parsed.append((symbol, name or "", re.findall(r"[a-z]\d*", subscript), int(power or 1)))
    indices = sorted({index for _, _, pair, _ in parsed for index in pair})
    total = Fraction(0)
    for values in product(range(3), repeat=len(indices)):
        at = dict(zip(indices, values, strict=True))
        term = Fraction(1)
        for symbol, name, pair, power in parsed:
            matrix, weights = method(name)
            entry = {
                "a": lambda m, w, k: m[k[0]][k[-1]],
                "b": lambda m, w, k: w[k[0]],
                "c": lambda m, w, k: sum(m[k[0]]),
            }
            term *= entry[symbol](matrix, weights, [at[index] for index in pair]) ** power
        total += term
    return total


def weight(tree: Tree, names: str) -> Fraction:
    """The elementary weight by recursion: weights of the root's part times the product of its children's stages."""

    def stages(node: Tree) -> list[Fraction]:
        result = [Fraction(1)] * 3
        for child in node.children:
            matrix, _ = method(names[child.color] if names else "")
            inner = stages(child)
            result = [result[i] * sum(matrix[i][j] * inner[j] for j in range(3)) for i in range(3)]
        return result

    _, weights = method(names[tree.color] if names else "")
    return sum((b * stage for b, stage in zip(weights, stages(tree), strict=True)), Fraction(0))


@pytest.mark.parametrize(("text", "formulas"), HLW_TABLE.items())
def test_formulas_of_the_textbook(text: str, formulas: tuple[str, str]) -> None:
    assert (Tree(text).differential(), Tree(text).condition()) == formulas


@pytest.mark.parametrize("order", range(1, 7))
def test_weights_say_what_the_recursion_computes(order: int) -> None:
    for tree in grown(order):
        assert value_of_text(tree.weight()) == weight(tree, "")


@pytest.mark.parametrize(("colors", "order", "names"), [(2, 4, "pq"), (3, 3, "abc")])
def test_colored_weights_say_what_the_recursion_computes(colors: int, order: int, names: str) -> None:
    for tree in grown(order, colors):
        assert value_of_text(tree.weight(names=names)) == weight(tree, names)


@given(random_trees(colors=3))
def test_differentials_determine_the_tree(tree: Tree) -> None:
    text = tree.differential(names=["x", "y", "z"])
    nodes = r"f_([xyz])('+|\^\(\d+\))?"
    arities = [len(node.children) for _, node in tree.preorder()]
    assert [match[2] or "" for match in re.finditer(nodes, text)] == [
        "'" * arity if arity <= 3 else f"^({arity})" for arity in arities
    ]
    brackets = re.sub(nodes, r"\1", text).replace("(", "[").replace(")", "]")
    assert Tree(brackets, names=["x", "y", "z"]) == tree


@pytest.mark.parametrize(
    ("text", "differential", "condition"),
    [
        ("q", "f_q", "Σ b^q_i = 1"),
        ("p[q,q[p]]", "f_p''(f_q,f_q'(f_p))", "Σ b^p_i c^q_i a^q_ij c^p_j = 1/8"),
        ("q[p^2,q^3]", "f_q^(5)(f_p,f_p,f_q,f_q,f_q)", "Σ b^q_i (c^p_i)^2 (c^q_i)^3 = 1/6"),
        ("a[b[c]]", "f_a'(f_b'(f_c))", "Σ b^a_i a^b_ij c^c_j = 1/6"),
    ],
)
def test_colored_formulas(text: str, differential: str, condition: str) -> None:
    assert (Tree(text).differential(), Tree(text).condition()) == (differential, condition)


@pytest.mark.parametrize(
    ("text", "differential", "condition"),
    [
        ("τ", "f", r"\sum_{i} b_{i} = 1"),
        ("[τ,τ]", "f''(f,f)", r"\sum_{i} b_{i} c_{i}^{2} = \frac{1}{3}"),
        ("[τ^4,[τ]]", "f^{(5)}(f,f,f,f,f'(f))", r"\sum_{i,j} b_{i} c_{i}^{4} a_{ij} c_{j} = \frac{1}{14}"),
        (
            "p[q^2,q[p]]",
            "f_{p}'''(f_{q},f_{q},f_{q}'(f_{p}))",
            r"\sum_{i,j} b^{p}_{i} (c^{q}_{i})^{2} a^{q}_{ij} c^{p}_{j} = \frac{1}{10}",
        ),
    ],
)
def test_latex(text: str, differential: str, condition: str) -> None:
    tree = Tree(text)
    assert (tree.differential("latex"), tree.condition("latex")) == (differential, condition)


def test_long_names() -> None:
    tree, names = Tree("p[q]"), ("kin", "pot_2")
    assert tree.differential(names=names) == "f_kin'(f_pot_2)"
    assert tree.differential("latex", names) == r"f_{\mathrm{kin}}'(f_{\mathrm{pot\_2}})"
    assert tree.weight(names=names) == "Σ b^kin_i c^pot_2_i"
    assert tree.weight("latex", names) == r"\sum_{i} b^{\mathrm{kin}}_{i} c^{\mathrm{pot\_2}}_{i}"


def test_many_indices() -> None:
    assert Tree.from_levels(range(15)).weight().endswith("a_xy a_yz c_z")
    tall = Tree.from_levels(range(16))
    assert tall.weight().startswith("Σ b_i1 a_i1,i2 a_i2,i3 ")
    assert tall.weight().endswith(" a_i14,i15 c_i15")
    assert tall.weight("latex").endswith(" a_{i_{14}i_{15}} c_{i_{15}}")
    assert value_of_text("Σ b_i1 a_i1,i2 c_i2^2") == weight(Tree("[[τ,τ]]"), "")


def test_tall_trees_have_formulas() -> None:
    tall = Tree.from_levels(range(4_000))
    assert tall.differential().endswith("f" + ")" * 3_999)
    assert tall.weight().endswith("c_i3999")
    with pytest.raises(TreeError, match="tree must have a density of at most 3000 digits"):
        tall.condition()


def test_wrong_arguments_are_refused() -> None:
    for formula in (Tree.differential, Tree.weight, Tree.condition):
        with pytest.raises(TreeError, match="format must be 'text' or 'latex', but was 'html'"):
            formula(Tree("[τ]"), "html")
        with pytest.raises(TreeError, match=r"names must name the colours 0 to 1, but were \('p',\)"):
            formula(Tree("p[q]"), names=["p"])
