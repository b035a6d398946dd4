"""Formulas of a tree, given by the levels and colours of its nodes: elementary differential and elementary weight.

For one colour they are those of the textbooks. For f = Σ_ν f^[ν] with a Runge–Kutta matrix and weights for each part ν,
nodes of colour ν correspond to the part, written f_ν; primes are derivatives, each in the direction of one argument.
The matrix, weights and row sums of a part have its name as superscript: b^ν_i, a^ν_ij, c^ν_i = Σ_j a^ν_ij.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby

from trees.errors import TreeError
from trees.notation import nest, node_names, parents_of

_INDICES = "ijklmnrsuvwxyz"  # without p and q (blocks), t (node) and o (zero)


def elementary_differential(
    levels: Sequence[int], colors: Sequence[int], format: str, names: Iterable[str] | None
) -> str:
    """The formula of `Tree.differential`."""
    latex = is_latex(format)
    labels = []
    children = [0] * len(levels)
    for parent in parents_of(levels)[1:]:
        children[parent] += 1
    for count, name in zip(children, node_names(colors, names), strict=True):
        part = f"_{{{latex_name(name)}}}" if latex and name else f"_{name}" if name else ""
        labels.append("f" + part + derivative(count, latex))
    return nest(levels, labels, "(", ")")


def derivative(count: int, latex: bool = False) -> str:
    """The sign of the derivative of an order: primes, or a number."""
    return "'" * count if count <= 3 else f"^{{({count})}}" if latex else f"^({count})"


def elementary_weight(levels: Sequence[int], colors: Sequence[int], format: str, names: Iterable[str] | None) -> str:
    """The formula of `Tree.weight`."""
    latex = is_latex(format)
    name_of = node_names(colors, names)
    parents = parents_of(levels)
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


def _children(parents: list[int]) -> list[list[int]]:
    """The children of each node."""
    children: list[list[int]] = [[] for _ in parents]
    for node in range(1, len(parents)):
        children[parents[node]].append(node)
    return children


def is_latex(format: str) -> bool:
    """Whether a format is LaTeX rather than text."""
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
