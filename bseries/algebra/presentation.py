"""Terms of a series as rows of tables, JSON-ready data, LaTeX, text and HTML."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from decimal import Context, Decimal
from fractions import Fraction
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.table import Column, LazyRows, Table, listed
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


KINDS = {"modified": "Modified equation", "modifying": "Modifying integrator", "series": "B-series"}
FIELD = "y' = f_h(y) with f_h = Σ h^(|τ|-1) · weight(τ) · F(τ); weight = coefficient/σ"
MEANINGS = {
    "modified": FIELD,
    "modifying": f"{FIELD}; the method applied to it follows the exact flow of y' = f(y)",
    "series": "y1 = y0 + Σ h^|τ| · weight(τ) · F(τ)(y0); weight = coefficient/σ",
}


def series_table(s: Any, kind: str, *, nonzero: bool, as_float: bool) -> Table:
    """The terms of a series as a table; see `BSeries.to_table`."""
    shown = s.to_float() if as_float else s
    names = s.names if len(s.names) > 1 else None
    rows = LazyRows(lambda: shown.terms(nonzero=nonzero), len(s))
    columns = (
        Column("|τ|", True, lambda term: term.tree.order),
        Column("tree τ", get=lambda term: term.tree.text(names)),
        Column("coefficient", get=lambda term: term.coefficient_text),
        Column("weight", get=lambda term: term.weight_text),
        Column("F(τ)", get=lambda term: term.tree.differential(names=names)),
    )
    fields = [
        ("tree", columns[1].get),
        ("levels", lambda term: term.tree.levels),
        ("colors", lambda term: term.tree.colors),
        ("order", columns[0].get),
        ("symmetry", lambda term: term.tree.symmetry),
        ("density", lambda term: term.tree.density),
        ("coefficient", columns[2].get),
        ("weight", columns[3].get),
        ("differential", columns[4].get),
    ]
    nodes = f"1 to {s.order} nodes" if s.order > 1 else "1 node"
    least, most = (1, s.order) if kind == "series" else (0, s.order - 1)
    powers = f"h^{least} to h^{most}" if most > least else f"h^{least}"
    return Table(
        f"{KINDS[kind]} of {s.label}: trees with {nodes}, powers {powers}",
        columns,
        rows,
        [MEANINGS[kind], *_number_notes(shown, nonzero=nonzero, as_float=as_float)],
        data=lambda: shown.to_dict(kind, nonzero=nonzero),
        items="terms",
        section=lambda term: term.tree.order,
        records=listed(fields, rows),
        own={"latex": lambda width: shown.to_latex(nonzero=True) + "\n"},
    )


def _number_notes(s: Any, *, nonzero: bool, as_float: bool) -> Iterator[str]:
    """Sentences on the numbers of a series."""
    if as_float:
        yield "Floating point (RR): exact coefficients, each rounded to the nearest float."
    elif not s.is_exact:
        yield "Floating point (RR): the tableau holds floats, so the coefficients carry rounding errors."
    elif s.digits is None:
        yield f"Exact coefficients, in {s.domain}."
    if s.digits is not None:
        yield (
            f"The tableau is published as decimals with {s.digits} digits: numbers are rounded to what these tell, and "
            "what they cannot tell from zero is 0."
        )
    if nonzero:
        yield "Trees whose coefficient is zero are left out."
