"""Points and sums of slopes as statements: loops over the entries of cells.

Points of a chain of kicks and drifts are made from the ones before; with split coefficients the tails, whose rounding
errors are random, are added up apart from the heads, which are exact.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from ..site_loops import indented
from .nodes import Form, Point

if TYPE_CHECKING:
    from .structure import Structure

HEAD_BITS = 10


class FormWriter:
    """Writes linear forms, and remembers what the arrays hold.

    Args:
        structure: The cells.
        following: For each cell its points in the order in which they will be made, groups left out.
        split: Whether coefficients are split.
    """

    def __init__(self, structure: Structure, following: Mapping[int, Sequence[Form]], split: bool):
        self.structure, self.following, self.split = structure, following, split
        self._content: dict[tuple[str, int], Form] = {}
        self._sums: dict[int, Form] = {}

    def forget(self) -> None:
        """What the arrays hold is not known any more."""
        self._content.clear()
        self._sums.clear()

    def loop(self, cell: int, lines: Iterable[str]) -> list[str]:
        """A loop over the entries of a cell."""
        body = indented(lines)
        return [line for a, b in self.structure.cells[cell] for line in (f"for i in range({a}, {b}):", *body)]

    def point(self, point: Point, array: str) -> tuple[list[str], str]:
        """Statements that make a point, and the array where it then is: y itself, if it is the start."""
        if all(form.is_start for _, form in point):
            return [], "y"
        lines: list[str] = []
        for cell, form in point:
            if self._content.get((array, cell)) != form:
                lines += self.loop(cell, self.entry(cell, form, f"{array}[i] = "))
                self._content[array, cell] = form
        return lines, array

    def entry(self, cell: int, form: Form, target: str, after: str = "") -> list[str]:
        """Statements for an entry of a form; a sum that the next form of the cell begins with is kept in d.

        Args:
            cell: The cell.
            form: The form.
            target: The left-hand side with its ``=``.
            after: What is added to the form.
        """
        start = _start(form)
        if not form.terms:
            return [target + (start or "0.0") + after]
        known, terms = self._sums.get(cell), dict(form.terms)
        if known is not None and dict(known.terms).items() <= terms.items():
            rest = [(e, x) for e, x in form.terms if e not in dict(known.terms)]
            total = " + ".join(["d[i]", *map(product, rest)])
        else:
            total = self.sum(form.terms)
        lines = []
        if self._is_beginning(cell, form):
            lines, total = [f"d[i] = {tidy(total)}"], "d[i]"
            self._sums[cell] = form
        scaled = f"h*({total})" if " " in total else f"h*{total}"
        return [*lines, tidy(f"{target}{start} + {scaled}{after}" if start else f"{target}{scaled}{after}")]

    def _is_beginning(self, cell: int, form: Form) -> bool:
        """Whether the next form of the cell goes on where this one ends."""
        forms = self.following[cell]
        if form not in forms:
            return False
        after = forms[forms.index(form) + 1 :]
        return bool(after) and dict(form.terms).items() < dict(after[0].terms).items()

    def sum(self, terms: Sequence[tuple[int, Fraction]]) -> str:
        """Σ x_e k_e."""
        if not self.split:
            return " + ".join(map(product, terms))
        heads = [(e, Fraction(round(x * 2**HEAD_BITS), 2**HEAD_BITS)) for e, x in terms]
        tails = [(e, x - head) for (e, x), (_, head) in zip(terms, heads, strict=True) if x != head]
        parts = [product(term) for term in heads if term[1]]
        if tails:
            parts.append(f"({' + '.join(map(product, tails))})")
        return " + ".join(parts)

    def update(self, cell: int, form: Form, compensated: bool) -> list[str]:
        """Statements that put the end of a step in place of its start."""
        if form.is_start:
            return []
        if not compensated:
            return self.loop(cell, self.entry(cell, form, "y[i] = "))
        lines = self.entry(cell, form._replace(start=form.start - 1), "c = ", " + e[i]")
        return self.loop(cell, [*lines, "x = y[i] + c", "e[i] = c - (x - y[i])", "y[i] = x"])


def product(term: tuple[int, Fraction]) -> str:
    """x_e k_e."""
    e, x = term
    return f"k{e}[i]" if x == 1 else f"-k{e}[i]" if x == -1 else f"{float(x)!r}*k{e}[i]"


def tidy(text: str) -> str:
    """The text without plus signs before minus signs."""
    return text.replace("+ -", "- ")


def _start(form: Form) -> str:
    if form.start in (0, 1):
        return "y[i]" if form.start else ""
    return f"{float(form.start)!r}*y[i]"
