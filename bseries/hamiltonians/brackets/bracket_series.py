"""Sums of nested brackets of the parts of a Hamiltonian."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import accumulate
from operator import itemgetter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.fields.inputs import check_power
from bseries.scene_text import ENERGY, align, span
from bseries_base.numbers import latex_number, number_text
from bseries_base.table import MOST_ROWS, Column, Table, listed, short_latex

if TYPE_CHECKING:
    from bseries.exact.domains import Coefficient

Bracket = tuple[str, ...]  # the names in a right-nested bracket: ("T", "T", "U") stands for {T,{T,U}}

BRACES, COMMUTATORS = "{}", "[]"


class BracketSeries(Mapping[Bracket, "Coefficient"]):
    """Sum of nested brackets of the parts of a Hamiltonian; brackets with n letters have the factor h^(n−1).

    As a mapping it contains a basis of all brackets up to the order, with exact coefficients; ``s["{T,{T,U}}"]`` and
    ``s["T", "T", "U"]`` are equal. For methods published as decimals, coefficients within their uncertainty are 0.

    Attributes:
        parts: The names of the parts.
        order: Largest number of letters.
        kinetic: The part T that is quadratic in the momenta, while the others do not depend on them, so that some
            brackets vanish; None for general parts.
        label: The name of the method.
        domain: The smallest domain that contains the coefficients.
        digits: The significant digits of a method published as decimals.
        basis: ``nested``: a word stands for the right-nested bracket; ``lyndon``: for the bracket of a Lyndon word.

    Example:
        >>> import bseries as bs
        >>> verlet = bs.hamiltonians.bracket_hamiltonian(bs.method("stormer-verlet"), 3)
        >>> verlet["{T,{T,U}}"], verlet["U", "U", "T"], len(verlet)
        (Fraction(1, 12), Fraction(-1, 24), 5)
        >>> print(verlet.to_latex())
        T + U + h^{2} \\left(\\frac{1}{12} \\{T,\\{T,U\\}\\} - \\frac{1}{24} \\{U,\\{U,T\\}\\}\\right)
    """

    def __init__(
        self,
        parts: Sequence[str],
        terms: Sequence[Mapping[Bracket, Coefficient]],
        *,
        kinetic: str | None = None,
        label: str = "",
        domain: str = "QQ",
        digits: int | None = None,
        errors: Mapping[Bracket, float] = MappingProxyType({}),
        fences: str = BRACES,
        basis: str = "nested",
    ):
        self.parts, self.kinetic, self.label, self.domain = tuple(parts), kinetic, label, domain
        self.digits, self.basis = digits, basis
        self._errors, self._fences = errors, fences
        self._terms = tuple(map(dict, terms))

    @property
    def order(self) -> int:
        """Largest number of letters."""
        return len(self._terms)

    def term(self, k: int) -> dict[Bracket, Coefficient]:
        """The brackets with the factor h^k and nonzero coefficients.

        Raises:
            SeriesError: The power is out of range.
        """
        check_power(k, self.order - 1)
        return {word: value for word, value in self._terms[k].items() if value}

    @cached_property
    def _values(self) -> dict[Bracket, Coefficient]:
        return {word: value for term in self._terms for word, value in term.items()}

    @cached_property
    def _words(self) -> dict[str, Bracket]:
        return {self._text(word): word for word in self._values}

    def _text(self, word: Bracket, fences: Sequence[str] = ()) -> str:
        left, right = fences or self._fences
        if self.basis == "nested":
            return "".join(f"{left}{name}," for name in word[:-1]) + word[-1] + right * (len(word) - 1)
        return lyndon_text(word, (left, right), self.parts)

    def _word(self, bracket: Bracket | str) -> Bracket:
        return self._words.get(bracket.replace(" ", ""), ()) if isinstance(bracket, str) else bracket

    def __getitem__(self, bracket: Bracket | str) -> Coefficient:
        if bracket not in self:
            last = next(reversed(self._words))
            raise SeriesError(f"bracket must be one of the basis, such as {last:.60}, but was {bracket!s:.60}")
        return self._values[self._word(bracket)]

    def __contains__(self, bracket: object) -> bool:
        return isinstance(bracket, str | tuple) and self._word(bracket) in self._values

    def get(self, bracket: Any, default: Any = None) -> Any:
        """The coefficient of a bracket, or `default` if the bracket is not in the basis."""
        return self._values.get(self._word(bracket), default)

    def __iter__(self) -> Iterator[Bracket]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        of = f" of {self.label}" if self.label else ""
        return f"<BracketSeries{of}: {len(self)} brackets of {', '.join(self.parts)} to order {self.order}>"

    def __str__(self) -> str:
        powers = self._short_powers()
        rows = [f"h^{k:<3} {self.term_text(k)}" for k in powers if self.term(k)]
        title = self.label if self._fences == COMMUTATORS else f"modified Hamiltonian of {self.label}"
        return "\n".join([title, *rows, *(["…"] if len(powers) < self.order else [])])

    def _short_powers(self) -> range:
        """The first powers of h, with at most `MOST_ROWS` brackets."""
        counts = accumulate(len(self.term(k)) for k in range(self.order))
        return range(sum(count <= MOST_ROWS for count in counts))

    def term_text(self, k: int) -> str:
        """The coefficient of h^k as text.

        Raises:
            SeriesError: The power is out of range.
        """
        return _sum((self._number_text(word), self._text(word)) for word in self.term(k))

    def _number_text(self, word: Bracket) -> str:
        return number_text(self._values[word], self._digits(word))

    def _digits(self, word: Bracket) -> int | None:
        """The significant digits of a coefficient, from those of the method."""
        value, error = self._values[word], self._errors.get(word, 0.0)
        if self.digits is None or not value or not error:
            return self.digits
        return max(1, min(self.digits, 1 + math.floor(math.log10(abs(value) / error))))

    def term_latex(self, k: int) -> str:
        """The coefficient of h^k as LaTeX.

        Raises:
            SeriesError: The power is out of range.
        """
        left, right = ("\\" + fence if fence in BRACES else fence for fence in self._fences)
        return _sum(
            (latex_number(x, self._digits(word)), self._text(word, (left, right))) for word, x in self.term(k).items()
        )

    def to_latex(self, powers: Sequence[int] | None = None) -> str:
        """The sum as LaTeX; by default all powers of h."""
        return " + ".join(_summands(self, range(self.order) if powers is None else powers)) or "0"

    def _repr_latex_(self) -> str | None:
        powers = self._short_powers()
        return short_latex(self.to_latex(powers) + (" + \\cdots" if len(powers) < self.order else ""))

    def to_dict(self) -> dict[str, Any]:
        """The sum as plain data."""
        data: dict[str, Any] = {
            "schema": 1,
            "kind": "brackets",
            "method": self.label,
            "order": self.order,
            "domain": self.domain,
            "parts": list(self.parts),
            "kinetic": self.kinetic,
        }
        if self.digits is not None:
            data["digits"] = self.digits
        if self.basis != "nested":
            data["basis"] = self.basis
        data["terms"] = [
            {"power": k, "bracket": self._text(word), "letters": list(word), "coefficient": self._number_text(word)}
            for k, term in enumerate(self._terms)
            for word in term
        ]
        return data

    def to_table(
        self, powers: Sequence[int] | None = None, *, nonzero: bool = False, issues: Sequence[str] = ()
    ) -> Table:
        """The sum as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            powers: Consecutive powers of h; by default all.
            nonzero: Leave out brackets whose coefficient is zero.
            issues: Contradictions in the method's tableau.
        """
        powers = range(self.order) if powers is None else powers
        data = self.to_dict()
        data |= {"issues": list(issues)} if issues else {}
        kept = [x for x in data.pop("terms") if x["power"] in powers and (x["coefficient"] != "0" or not nonzero)]
        return Table(
            f"Modified Hamiltonian of {self.label}: {span(powers)}, in brackets of {', '.join(self.parts)}",
            (Column("k", True), Column("coefficient of h^k")),
            [(k, self.term_text(k)) for k in powers if self.term(k) or not nonzero],
            list(_notes(self, issues, nonzero=nonzero)),
            data=lambda: {**data, "terms": kept},
            items="terms",
            records=listed([(name, itemgetter(name)) for name in ("power", "bracket", "coefficient")], kept),
            own={"latex": lambda width: align([(ENERGY, _summands(self, powers))], powers[0], powers[-1])},
        )


def lyndon_text(word: Sequence[str], fences: Sequence[str], letters: Sequence[str]) -> str:
    """The bracket [P_u, P_v] of a Lyndon word uv, where v is its smallest proper suffix, as text."""
    if len(word) == 1:
        return word[0]
    cut = min(range(1, len(word)), key=lambda start: [letters.index(x) for x in word[start:]])
    left, right = (lyndon_text(part, fences, letters) for part in (word[:cut], word[cut:]))
    return f"{fences[0]}{left},{right}{fences[1]}"


def _sum(terms: Iterable[tuple[str, str]]) -> str:
    """A sum of numbers times brackets, as text."""
    text = ""
    for number, bracket in terms:
        compound = " + " in number or " - " in number
        sign = "-" if number.startswith("-") and not compound else "+"
        factor = f"({number})" if compound else number.removeprefix("-")
        summand = bracket if factor == "1" else f"{factor} {bracket}"
        text += f" {sign} {summand}" if text else f"-{summand}" if sign == "-" else summand
    return text or "0"


def _summands(brackets: BracketSeries, powers: Sequence[int]) -> list[str]:
    """The terms that are not zero, with their powers of h, as LaTeX."""
    terms = [(k, brackets.term_latex(k)) for k in powers if brackets.term(k)]
    steps = {k: "h" if k == 1 else f"h^{{{k}}}" for k, _ in terms}
    return [f"{steps[k]} \\left({text}\\right)" if k else text for k, text in terms]


def _notes(brackets: BracketSeries, issues: Sequence[str], *, nonzero: bool) -> Iterator[str]:
    """Sentences on the brackets and their coefficients."""
    yield "{A,B} = A_q·B_p − A_p·B_q, or the bracket of a Poisson system."
    if brackets.kinetic is not None:
        yield (
            f"{brackets.kinetic} is taken to be quadratic in variables that the other parts do not depend on: "
            "brackets that vanish are left out."
        )
    if brackets.digits is not None:
        yield f"The method has decimals with {brackets.digits} correct digits, and so are these numbers."
    if nonzero:
        yield "Zero terms are left out."
    for issue in issues:
        yield f"Warning: {issue}."
