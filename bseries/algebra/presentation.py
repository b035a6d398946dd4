"""Terms of a series as rows of tables, JSON-ready data and LaTeX."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from bseries.exceptions import SeriesError
from bseries_base.numbers import broken_sum, latex_number, number_text
from integrators.exact.arithmetic import FLOATS
from trees.basis import Basis
from trees.table import TreeTable


class SeriesTerm(NamedTuple):
    """A tree of a series, its coefficient, weight, σ and γ; `digits` are those to print, for a method in decimals."""

    basis: Basis[Any]
    coefficient: Any
    weight: Any
    is_zero: bool
    digits: int | None
    symmetry: int
    at: int  # the id of the element

    @property
    def element(self) -> Any:
        """The tree, or other element of the basis."""
        return self.basis[self.at]

    @property
    def coefficient_text(self) -> str:
        """The coefficient as text."""
        return number_text(self.coefficient, self.digits, is_zero=self.is_zero)

    @property
    def weight_text(self) -> str:
        """The weight as text."""
        return number_text(self.weight, self.digits, is_zero=self.is_zero)


def to_latex(terms: Iterable[SeriesTerm], empty: Any, differential: Callable[[SeriesTerm], tuple[int, str]]) -> str:
    """Terms as a sum of weights times powers of h times elementary differentials; without a factor h for fields."""
    return " + ".join(_summands(terms, empty, differential)).replace("+ -", "- ").replace("-  ", "- ") or "0"


def display(terms: Iterable[SeriesTerm], empty: Any, differential: Callable[[SeriesTerm], tuple[int, str]]) -> str:
    """The sum of `to_latex`, in an align where it takes several lines."""
    formula = broken_sum(_summands(terms, empty, differential)) or "0"
    return f"\\begin{{align*}}\n&{formula}\n\\end{{align*}}\n" if "\n" in formula else f"{formula}\n"


def _summands(
    terms: Iterable[SeriesTerm], empty: Any, differential: Callable[[SeriesTerm], tuple[int, str]]
) -> list[str]:
    shift = 1 if empty == 0 else 0
    number = latex_number(empty, None)
    summands = [] if shift else ["y" if empty == 1 else f"{_factor(number)} y"]
    for term in terms:
        order, formula = differential(term)
        power = order - shift
        h = {0: "", 1: "h\\, "}.get(power, f"h^{{{power}}}\\, ")
        number = latex_number(term.weight, term.digits, is_zero=term.is_zero)
        number = {"1": "", "-1": "-"}.get(number, f"{_factor(number)} ")
        summands.append(f"{number}{h}{formula}")
    return summands


def _factor(number: str) -> str:
    """A number as a factor in LaTeX: sums in parentheses."""
    return f"\\left({number}\\right)" if " + " in number or " - " in number[1:] else number


def to_julia(terms: Iterable[SeriesTerm], empty: Any, table: TreeTable, *, inexact: bool) -> str:
    """Terms as source text for BSeries.jl: a dictionary from level sequences, counted from 1, to coefficients."""
    if table.max_children is not None:
        raise SeriesError(f"max_children must be None for BSeries.jl, but was {table.max_children}")
    if table.colors > 2:
        raise SeriesError(f"series must have one or two colours for BSeries.jl, but has {table.colors}")
    colored = table.colors > 1
    texts = [("Int[]", "Bool[]", number_text(empty))]
    for term in terms:
        levels = ", ".join(str(level + 1) for level in term.element.levels)
        colors = ", ".join(("false", "true")[color] for color in term.element.colors)
        texts.append((f"[{levels}]", f"[{colors}]", term.coefficient_text))
    lines = []
    for levels, colors, number in texts:
        tree = f"{levels}, {colors}" if colored else levels
        lines.append(f"    rootedtree({tree}) => {number.replace('/', '//')},\n")
    is_long = any(len(part) > INT64_DIGITS for *_, number in texts for part in number.lstrip("-").split("/"))
    kind = "Float64" if inexact else f"Rational{{{'BigInt' if is_long else 'Int'}}}"
    trees = ", BicoloredRootedTreeIterator" if colored else ""
    return f"""using BSeries, RootedTrees

# Modified equations have the coefficient 0 of the empty tree, methods 1.
coefficients = Dict{{Any, {kind}}}(
{"".join(lines)})
series = bseries((t, _) -> coefficients[t], {table.max_order}{trees})
"""


INT64_DIGITS = 18
"""Decimal digits that all fit into 64 bits."""
KINDS = {
    "modified": "Modified equation",
    "modifying": "Modifying integrator",
    "series": "B-series",
    "field": "Field",
}
FIELD = "f_h = Σ h^(|τ|-1) · weight(τ) · F(τ); weight = coefficient/σ"
MEANINGS = {
    "field": FIELD,
    "modified": f"y' = f_h(y) with {FIELD}",
    "modifying": f"y' = f_h(y) with {FIELD}; the method applied to it follows the exact flow of y' = f(y)",
    "series": "y1 = y0 + Σ h^|τ| · weight(τ) · F(τ)(y0); weight = coefficient/σ",
}


def meaning(kind: str, what: str) -> str:
    """What the terms of a series on trees, or other elements, stand for."""
    return MEANINGS[kind] if what == "trees" else MEANINGS[kind].replace("τ", what[0])


def title(kind: str, label: str, order: int, what: str, unit: str) -> str:
    """The title of a table of the terms of a series on trees, or other elements."""
    nodes = f"1 to {order} {unit}s" if order > 1 else f"1 {unit}"
    least, most = (1, order) if kind == "series" else (0, order - 1)
    powers = f"h^{least} to h^{most}" if most > least else f"h^{least}"
    of = f" of {label}" if label else ""
    name = KINDS[kind] if what == "trees" else KINDS[kind].replace("B-series", "Series")
    return f"{name}{of}: {what} with {nodes}, powers {powers}"


def number_notes(domain: str, digits: int | None, what: str, *, nonzero: bool, as_float: bool) -> Iterator[str]:
    """Sentences on the numbers of a series."""
    if as_float:
        yield "Floating point (RR): exact coefficients, each rounded to the nearest float."
    elif domain == "RR":
        yield f"Floating point (RR): {FLOATS}, so the coefficients carry rounding errors."
    elif digits is None:
        yield f"Exact coefficients, in {domain}."
    if digits is not None and domain != "RR":
        yield (
            f"The tableau has decimals with {digits} correct digits: numbers are rounded accordingly, and "
            "those that are zero within these digits are 0."
        )
    if nonzero:
        yield f"{what.capitalize()} whose coefficient is zero are left out."
