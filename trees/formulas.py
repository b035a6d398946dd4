"""Formulas of a tree: elementary differential, elementary weight, and order condition.

For one colour they are those of the textbooks. For f = Σ_ν f^[ν] with a Runge–Kutta matrix and weights for each part ν,
nodes of colour ν correspond to the part, written f_ν; primes are derivatives, each in the direction of one argument.
The matrix, weights and row sums of a part have its name as superscript: b^ν_i, a^ν_ij, c^ν_i = Σ_j a^ν_ij.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import groupby

from foundation.numbers import latex_number
from trees.errors import TreeError
from trees.notation import TreeLike, nest, node_names, parents_of

_INDICES = "ijklmnrsuvwxyz"  # without p and q (blocks), t (node) and o (zero)


def elementary_differential(tree: TreeLike, format: str = "text", names: Iterable[str] | None = None) -> str:
    """The elementary differential F([τ1, …, τm]) = f^(m)(F(τ1), …, F(τm)) of a tree.

    Example:
        >>> from trees import Tree
        >>> elementary_differential(Tree("[τ,[τ]]")), elementary_differential(Tree("[τ^4]"))
        ("f''(f,f'(f))", 'f^(4)(f,f,f,f)')
        >>> elementary_differential(Tree("p[q,q[p]]"), "latex")
        "f_{p}''(f_{q},f_{q}'(f_{p}))"

    References:
        HLW, section III.1 and Table III.1.1; coloured, section III.2.
    """
    latex = _is_latex(format)
    levels, labels = tree.levels, []
    children = [0] * len(levels)
    for parent in parents_of(levels)[1:]:
        children[parent] += 1
    for count, name in zip(children, node_names(tree.colors, names), strict=True):
        part = f"_{{{latex_name(name)}}}" if latex and name else f"_{name}" if name else ""
        prime = "'" * count if count <= 3 else f"^{{({count})}}" if latex else f"^({count})"
        labels.append("f" + part + prime)
    return nest(levels, labels, "(", ")")


def elementary_weight(tree: TreeLike, format: str = "text", names: Iterable[str] | None = None) -> str:
    """The elementary weight of a tree: a sum with factors b for the root, a for inner edges, c for edges to leaves.

    It is summed over all indices: i, j, k, …, or i1, i2, … if there are not enough letters. The arguments are those of
    `elementary_differential`.

    Example:
        >>> from trees import Tree
        >>> elementary_weight(Tree("[τ,τ,[τ]]")), elementary_weight(Tree("p[p,q[p,p]]"))
        ('Σ b_i c_i^2 a_ij c_j', 'Σ b^p_i c^p_i a^q_ij (c^p_j)^2')
        >>> elementary_weight(Tree("[[τ]]"), "latex")
        '\\\\sum_{i,j} b_{i} a_{ij} c_{j}'

    References:
        HLW, Table III.1.1 and section III.2.
    """
    latex = _is_latex(format)
    name_of = node_names(tree.colors, names)
    parents = parents_of(tree.levels)
    children = _children(parents)
    inner = [node for node, above in enumerate(children) if node == 0 or above]
    indices = index_letters(len(inner), latex)
    index_of = dict(zip(inner, indices, strict=True))
    factors = []
    for node, own in index_of.items():
        separator = "," if len(own) > 1 and not latex else ""
        subscript = f"{index_of[parents[node]]}{separator}{own}" if node else own
        factors.append(factor_text("a" if node else "b", name_of[node], subscript, 1, latex))
        for name, equal in groupby(name_of[child] for child in children[node] if not children[child]):
            factors.append(factor_text("c", name, own, len(list(equal)), latex))
    sign = f"\\sum_{{{','.join(indices)}}}" if latex else "Σ"
    return " ".join([sign, *factors])


def order_condition(tree: TreeLike, format: str = "text", names: Iterable[str] | None = None) -> str:
    """The order condition of a Runge–Kutta method: the elementary weight of the tree is 1/γ.

    The arguments are those of `elementary_differential`.

    Example:
        >>> from trees import Tree
        >>> order_condition(Tree("[τ,τ]")), order_condition(Tree("τ"))
        ('Σ b_i c_i^2 = 1/3', 'Σ b_i = 1')

    References:
        HLW, section III.1 and Table III.1.1.
    """
    density = tree.density
    if density.bit_length() > 9_966:  # Python does not print numbers of more than 4300 digits
        raise TreeError(f"tree must have a density of at most 3000 digits, but has one of {density.bit_length()} bits")
    quotient = Fraction(1, density)
    return f"{elementary_weight(tree, format, names)} = {latex_number(quotient) if _is_latex(format) else quotient}"


def _children(parents: list[int]) -> list[list[int]]:
    """The children of each node."""
    children: list[list[int]] = [[] for _ in parents]
    for node in range(1, len(parents)):
        children[parents[node]].append(node)
    return children


def _is_latex(format: str) -> bool:
    if format not in ("text", "latex"):
        raise TreeError(f"format must be 'text' or 'latex', but was {format!r:.60}")
    return format == "latex"


def latex_name(name: str) -> str:
    """The name of a colour in LaTeX."""
    return name if len(name) == 1 else f"\\mathrm{{{name.replace('_', chr(92) + '_')}}}"


def index_letters(count: int, latex: bool) -> list[str]:
    """Names of summation indices: i, j, k, …, or numbered ones if there are not enough letters."""
    if count <= len(_INDICES):
        return list(_INDICES[:count])
    return [f"i_{{{k}}}" if latex else f"i{k}" for k in range(1, count + 1)]


def factor_text(symbol: str, name: str, subscript: str, power: int, latex: bool) -> str:
    """One factor such as a_ij, (c^p_i)^2 or c_i^2."""
    if latex:
        base = symbol + (f"^{{{latex_name(name)}}}" if name else "") + f"_{{{subscript}}}"
        exponent = f"^{{{power}}}"
    else:
        base = symbol + (f"^{name}" if name else "") + f"_{subscript}"
        exponent = f"^{power}"
    if power == 1:
        return base
    return (f"({base})" if name else base) + exponent
