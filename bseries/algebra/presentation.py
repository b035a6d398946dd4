"""How a series is shown: rows for tables, JSON-ready data, LaTeX, text and HTML."""

from __future__ import annotations

import math
from collections.abc import Iterator
from decimal import Context, Decimal
from fractions import Fraction
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from bseries.algebra.bseries import BSeries
    from trees.tree import Tree


class Term(NamedTuple):
    """One tree of a series with all that is said about it; `digits` are those to show of a decimal method's numbers."""

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


def terms(series: BSeries, *, nonzero: bool = False) -> Iterator[Term]:
    """The terms of a series in the order of its table; `weight` is coefficient/σ, the number that textbooks print."""
    for at, (tree, coefficient) in enumerate(series.items()):
        zero = series._is_zero(at)
        if not (nonzero and zero):
            yield Term(tree, coefficient, coefficient / tree.symmetry, zero, _digits(series, at, coefficient))


def _digits(series: BSeries, at: int, coefficient: Any) -> int | None:
    """Significant digits that the digits of a method's decimals leave to a coefficient."""
    error = 0.0 if series.uncertainty is None or not coefficient else series.uncertainty(at)
    if series.digits is None or error == 0:
        return series.digits
    return max(1, min(series.digits, 1 + math.floor(math.log10(abs(coefficient) / error))))


def number_text(value: Any, digits: int | None, *, is_zero: bool = False) -> str:
    """A coefficient as text; those of decimal methods are rounded to `digits`."""
    if digits is not None and is_zero:
        return "0"
    if digits is None or not isinstance(value, Fraction):
        return str(value)
    if value.denominator == 1 and abs(value) < 10**digits:
        return str(value)
    rounded = Context(prec=digits).divide(Decimal(value.numerator), Decimal(value.denominator)).normalize()
    return f"{rounded:e}" if rounded.adjusted() < -4 else str(rounded)


def to_dict(series: BSeries, kind: str = "series", *, nonzero: bool = False) -> dict[str, Any]:
    """A series as JSON-ready data.

    Args:
        series: The series.
        kind: What it is: ``series``, ``modified``, ….
        nonzero: Leave out terms whose coefficient is zero.

    Returns:
        The keys schema, kind, method, order, domain, colors, empty, digits (for decimal methods) and terms, each term
        with tree, levels, colors, order, symmetry, density, coefficient, weight and differential.

    Example:
        >>> import bseries as bs
        >>> data = to_dict(bs.modified_equation(bs.method("explicit-euler"), 2), "modified")
        >>> data["terms"][1]["tree"], data["terms"][1]["coefficient"]
        ('[τ]', '-1/2')
    """
    data: dict[str, Any] = {
        "schema": 1,
        "kind": kind,
        "method": series.label,
        "order": series.order,
        "domain": series.domain,
        "colors": list(series.names),
        "empty": str(series.empty),
    }
    if series.digits is not None:
        data["digits"] = series.digits
    names = names_of(series)
    data["terms"] = [
        {
            "tree": term.tree.text(names),
            "levels": list(term.tree.levels),
            "colors": list(term.tree.colors),
            "order": term.tree.order,
            "symmetry": term.tree.symmetry,
            "density": term.tree.density,
            "coefficient": term.coefficient_text,
            "weight": term.weight_text,
            "differential": term.tree.differential(names=names),
        }
        for term in terms(series, nonzero=nonzero)
    ]
    return data


def names_of(series: BSeries) -> tuple[str, ...] | None:
    """The names of the colours for texts about trees; None where there is only one colour."""
    return series.names if series.table.colors > 1 else None


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


def to_latex(series: BSeries, *, nonzero: bool = False) -> str:
    """A series as a sum of weights, powers of h and elementary differentials.

    A field is written as the modified equation f_h, without the factor h.

    Example:
        >>> import bseries as bs
        >>> print(to_latex(bs.modified_equation(bs.method("explicit-euler"), 2)))
        f - \\frac{1}{2} h\\, f'(f)
    """
    shift = 1 if series.empty == 0 else 0
    empty = latex_number(series.empty, None)
    summands = [] if shift else ["y" if series.empty == 1 else f"{_factor(empty)} y"]
    for term in terms(series, nonzero=nonzero):
        power = term.tree.order - shift
        h = {0: "", 1: "h\\, "}.get(power, f"h^{{{power}}}\\, ")
        number = latex_number(term.weight, term.digits, is_zero=term.is_zero)
        number = {"1": "", "-1": "-"}.get(number, f"{_factor(number)} ")
        summands.append(f"{number}{h}{term.tree.differential('latex', names_of(series))}")
    return " + ".join(summands).replace("+ -", "- ").replace("-  ", "- ") or "0"


def _factor(number: str) -> str:
    """LaTeX of a number as a factor: sums in parentheses."""
    return f"\\left({number}\\right)" if " + " in number or " - " in number[1:] else number


def to_text(series: BSeries) -> str:
    """A series as a plain table, one tree a line."""
    names = names_of(series)
    rows = [("tree", "coefficient", "weight", "differential")]
    rows += [
        (
            term.tree.text(names),
            term.coefficient_text,
            term.weight_text,
            term.tree.differential(names=names),
        )
        for term in terms(series)
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "\n".join(lines)


def to_html(series: BSeries) -> str:
    """A series as an HTML table with pictures of the trees."""
    from trees.display.drawing import svg

    names = names_of(series)
    rows = "".join(
        f"<tr><td>{svg(term.tree, names=names)}</td><td>{escape(term.tree.text(names))}</td>"
        f"<td>{escape(term.coefficient_text)}</td>"
        f"<td>{escape(term.weight_text)}</td>"
        f"<td>{escape(term.tree.differential(names=names))}</td></tr>"
        for _, term in zip(range(200), terms(series), strict=False)
    )
    more = f"<p>… {len(series) - 200} more trees</p>" if len(series) > 200 else ""
    head = "<tr><th></th><th>tree</th><th>coefficient</th><th>weight</th><th>differential</th></tr>"
    return f"<p>{escape(repr(series))}</p><table>{head}{rows}</table>{more}"
