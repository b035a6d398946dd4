"""Terms of a series as rows of tables, JSON-ready data, LaTeX, text and HTML."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from decimal import Context, Decimal
from fractions import Fraction
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

from trees.drawing import svg

if TYPE_CHECKING:
    from trees.tree import Tree


class SeriesTerm(NamedTuple):
    """A tree of a series with its coefficient and weight; `digits` are those to print, for a method in decimals."""

    tree: Tree
    coefficient: Any
    weight: Any
    is_zero: bool
    digits: int | None

    @property
    def coefficient_text(self) -> str:
        """The coefficient as text."""
        return number_text(self.coefficient, self.digits, is_zero=self.is_zero)

    @property
    def weight_text(self) -> str:
        """The weight as text."""
        return number_text(self.weight, self.digits, is_zero=self.is_zero)

    def to_dict(self, names: Sequence[str] | None) -> dict[str, Any]:
        """The term as JSON-ready data."""
        return {
            "tree": self.tree.text(names),
            "levels": list(self.tree.levels),
            "colors": list(self.tree.colors),
            "order": self.tree.order,
            "symmetry": self.tree.symmetry,
            "density": self.tree.density,
            "coefficient": self.coefficient_text,
            "weight": self.weight_text,
            "differential": self.tree.differential(names=names),
        }


def known_digits(coefficient: Any, error: float, digits: int | None) -> int | None:
    """Significant digits of a coefficient with this error, for a method whose decimals have `digits`."""
    if digits is None or error == 0:
        return digits
    return max(1, min(digits, 1 + math.floor(math.log10(abs(coefficient) / error))))


def number_text(value: Any, digits: int | None, *, is_zero: bool = False) -> str:
    """A coefficient as text, rounded to `digits` for methods in decimals."""
    if digits is not None and is_zero:
        return "0"
    if digits is None or not isinstance(value, Fraction):
        return str(value)
    if value.denominator == 1 and abs(value) < 10**digits:
        return str(value)
    rounded = Context(prec=digits).divide(Decimal(value.numerator), Decimal(value.denominator)).normalize()
    return f"{rounded:e}" if rounded.adjusted() < -4 else str(rounded)


def latex_number(value: Any, digits: int | None, *, is_zero: bool = False) -> str:
    """A coefficient as LaTeX."""
    if isinstance(value, Fraction) and digits is None:
        if value.denominator == 1:
            return str(value)
        return f"{'-' if value < 0 else ''}\\frac{{{abs(value.numerator)}}}{{{value.denominator}}}"
    if isinstance(value, Fraction | float):
        mantissa, _, exponent = number_text(value, digits, is_zero=is_zero).lower().partition("e")
        return f"{mantissa} \\cdot 10^{{{int(exponent)}}}" if exponent else mantissa
    import sympy

    return sympy.latex(value)


def to_latex(terms: Iterable[SeriesTerm], empty: Any, names: Sequence[str] | None) -> str:
    """Terms as a sum of weights times powers of h times elementary differentials; without a factor h for fields."""
    shift = 1 if empty == 0 else 0
    number = latex_number(empty, None)
    summands = [] if shift else ["y" if empty == 1 else f"{_factor(number)} y"]
    for term in terms:
        power = term.tree.order - shift
        h = {0: "", 1: "h\\, "}.get(power, f"h^{{{power}}}\\, ")
        number = latex_number(term.weight, term.digits, is_zero=term.is_zero)
        number = {"1": "", "-1": "-"}.get(number, f"{_factor(number)} ")
        summands.append(f"{number}{h}{term.tree.differential('latex', names)}")
    return " + ".join(summands).replace("+ -", "- ").replace("-  ", "- ") or "0"


def _factor(number: str) -> str:
    """A number as a factor in LaTeX: sums in parentheses."""
    return f"\\left({number}\\right)" if " + " in number or " - " in number[1:] else number


def to_text(terms: Iterable[SeriesTerm], names: Sequence[str] | None) -> str:
    """Terms as a plain table, one tree per line."""
    rows = [("tree", "coefficient", "weight", "differential")]
    rows += [
        (
            term.tree.text(names),
            term.coefficient_text,
            term.weight_text,
            term.tree.differential(names=names),
        )
        for term in terms
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "\n".join(lines)


def to_html(terms: Iterable[SeriesTerm], names: Sequence[str] | None, *, title: str, count: int) -> str:
    """The first 200 of `count` terms as an HTML table with pictures of the trees."""
    rows = "".join(
        f"<tr><td>{svg(term.tree, names=names)}</td><td>{escape(term.tree.text(names))}</td>"
        f"<td>{escape(term.coefficient_text)}</td>"
        f"<td>{escape(term.weight_text)}</td>"
        f"<td>{escape(term.tree.differential(names=names))}</td></tr>"
        for _, term in zip(range(200), terms, strict=False)
    )
    more = f"<p>… {count - 200} more trees</p>" if count > 200 else ""
    head = "<tr><th></th><th>tree</th><th>coefficient</th><th>weight</th><th>differential</th></tr>"
    return f"<p>{escape(title)}</p><table>{head}{rows}</table>{more}"
