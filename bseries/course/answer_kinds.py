"""Kinds of answers: how each is written, read and judged."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.course.differential_text import combination, read_differentials
from bseries.course.equality import AT_POINTS, EXACTLY, equality, factor_between, first_wrong_power, has_digits
from bseries.exceptions import SeriesError
from integrators import RungeKutta
from integrators.core.arguments import split_row
from integrators.core.errors import shorten
from integrators.exact.arithmetic import MOST_DEGREE, degree_bound
from integrators.exact.expressions import ELEMENTARY, parse_expression

if TYPE_CHECKING:
    import sympy

YES_NO = ("yes", "no")
MOST_NODES = 6
"""Methods are compared, and their structure is tested, on trees with up to this number of nodes."""
MOST_STAGES = 6
"""Of a tableau in an answer."""


class Judgement(NamedTuple):
    """Whether an answer is right, and a remark: how that was decided, or in what the answer differs."""

    right: bool
    remark: str


class AnswerKind(ABC):
    """A kind of answers; the truth with which one is compared depends on the kind."""

    @property
    @abstractmethod
    def form(self) -> str:
        """How an answer is written."""

    @abstractmethod
    def judge(self, text: str, truth: Any, argument: str) -> Judgement:
        """Read an answer and compare it with the truth.

        Args:
            text: The answer.
            truth: What it must be.
            argument: The name of the answer in messages.

        Raises:
            SeriesError: The text is no answer of this kind.
            IntegratorError: A formula in it cannot be read.
        """


@dataclass(frozen=True)
class Formulas(AnswerKind):
    """Formulas in some symbols, or numbers; the truth is a tuple of formulas.

    Attributes:
        names: The symbols; none for numbers.
        count: The number of formulas.
        constant: Whether they may differ from the truth by a constant.
        digits: The number of significant digits asked for; None for exact numbers.
        others: Formulas that a wrong answer may be, by a sentence on each.
    """

    names: tuple[str, ...] = ()
    count: int = 1
    constant: bool = False
    digits: int | None = None
    others: Mapping[str, Callable[[], Sequence[Any]]] = field(default_factory=dict)

    @property
    def form(self) -> str:
        """How an answer is written."""
        if not self.names:
            one, many = "a number", f"{self.count} numbers, separated by commas"
            exact = ", exactly" if self.digits is None else f", to {self.digits} significant digits"
            return (one if self.count == 1 else many) + exact
        what = "a formula in" if self.count == 1 else f"{self.count} formulas, separated by commas, in"
        return f"{what} {', '.join(self.names)}{', up to a constant' if self.constant else ''}"

    def judge(self, text: str, truth: Any, argument: str) -> Judgement:
        """Compare formula by formula."""
        import sympy

        entries = split_row(text)
        if len(entries) != self.count:
            raise SeriesError(f"{argument} must be {self.form}, but had {len(entries)} entries")
        # A factor h too many is a mistake to name, not an unknown symbol.
        names = dict.fromkeys((*self.names, "h")) if self.names else ()
        symbols = tuple(map(sympy.Symbol, names))
        remarks = list[str]()
        for k, (entry, wanted) in enumerate(zip(entries, truth, strict=True), 1):
            given = parse_expression(entry, names=names, functions=ELEMENTARY, argument=argument)
            others = {sentence: make()[k - 1] for sentence, make in self.others.items()}
            found = self._compare(given, sympy.sympify(wanted, strict=True), symbols, others)
            if not found.right:
                return Judgement(False, found.remark if self.count == 1 else f"entry {k}: {found.remark}")
            remarks.append(found.remark)
        return Judgement(True, next((remark for remark in remarks if remark != EXACTLY), EXACTLY))

    def _compare(self, given: Any, wanted: Any, symbols: Sequence[Any], others: Mapping[str, Any]) -> Judgement:
        """One formula with another."""
        if self.digits is not None:
            right = has_digits(given, wanted, self.digits)
            return Judgement(right, f"equal to {self.digits} digits" if right else "differs")
        return compare(given, wanted, symbols, others, constant=self.constant)


@dataclass(frozen=True)
class Differentials(AnswerKind):
    """A linear combination of elementary differentials; the truth maps trees to its coefficients.

    Attributes:
        names: The symbols in coefficients.
        others: Combinations that a wrong answer may be, by a sentence on each.
    """

    names: tuple[str, ...] = ()
    others: Mapping[str, Callable[[], Mapping[Any, Any]]] = field(default_factory=dict)

    @property
    def form(self) -> str:
        """How an answer is written."""
        symbols = f", with coefficients in {', '.join(self.names)}" if self.names else ""
        return f"elementary differentials, such as 1/2*f'f - 1/3*f''(f,f'f){symbols}"

    def judge(self, text: str, truth: Any, argument: str) -> Judgement:
        """Compare the combinations as formulas in symbols of the differentials."""
        import sympy

        names = tuple(dict.fromkeys((*self.names, "h")))
        given = read_differentials(text, names=names, argument=argument)
        wanted = combination(truth)
        others = {sentence: combination(make()) for sentence, make in self.others.items()}
        symbols = {*map(sympy.Symbol, names), *given.free_symbols, *wanted.free_symbols}
        return compare(given, wanted, sorted(symbols, key=str), others)


@dataclass(frozen=True)
class Choices(AnswerKind):
    """One of several words for each of several things; the truth is a tuple of words.

    Attributes:
        things: What is to be decided, in order.
        words: The words.
    """

    things: tuple[str, ...] = ("",)
    words: tuple[str, ...] = YES_NO

    @property
    def form(self) -> str:
        """How an answer is written."""
        words = " or ".join(self.words)
        return words if len(self.things) == 1 else f"{words} for each, separated by commas: {', '.join(self.things)}"

    def judge(self, text: str, truth: Any, argument: str) -> Judgement:
        """Count the words that differ, without telling which."""
        given = [word.strip().lower() for word in text.split(",")]
        if len(given) != len(self.things) or not set(given) <= set(self.words):
            raise SeriesError(f"{argument} must be {self.form}; but was {shorten(text)!r}")
        wrong = sum(one != other for one, other in zip(given, truth, strict=True))
        return Judgement(not wrong, f"{wrong} of {len(given)} wrong" if wrong and len(given) > 1 else "")


@dataclass(frozen=True)
class Tableau(AnswerKind):
    """A Runge–Kutta tableau; the truth is a function that says what a method lacks, or nothing."""

    @property
    def form(self) -> str:
        """How an answer is written."""
        return "a tableau: the rows of A and then b, separated by semicolons, as in 0, 0; 1/2, 0; 0, 1"

    def judge(self, text: str, truth: Any, argument: str) -> Judgement:
        """Read the tableau, and ask what it lacks."""
        *rows, weights = [split_row(row) for row in text.split(";")]
        if not 1 <= len(rows) <= MOST_STAGES or any(len(row) != len(rows) for row in (*rows, weights)):
            raise SeriesError(
                f"{argument} must be {self.form}, s + 1 rows of s entries with s up to {MOST_STAGES}, "
                f"but was {shorten(text)!r}"
            )
        method = RungeKutta(rows, weights, name=argument, warn=False)
        irrational: list[Any] = [x for row in (*method.A, method.b) for x in row if not isinstance(x, Fraction)]
        if degree_bound(irrational) > MOST_DEGREE:
            raise SeriesError(
                f"{argument} must have entries in a field of degree {MOST_DEGREE} at most, but had more roots"
            )
        lacks = truth(method)
        return Judgement(not lacks, lacks or f"tested on all trees with up to {MOST_NODES} nodes")


def compare(
    given: sympy.Expr, wanted: sympy.Expr, symbols: Sequence[Any], others: Mapping[str, Any], *, constant: bool = False
) -> Judgement:
    """Compare two formulas, up to a constant if asked."""

    def pairs(other: Any) -> list[tuple[Any, Any]]:
        """What must be equal: the formulas, or their derivatives."""
        return [(given.diff(x), other.diff(x)) for x in symbols] if constant else [(given, other)]

    found = {equality(one, other, symbols) for one, other in pairs(wanted)}
    if "" not in found:
        return Judgement(True, EXACTLY if found == {EXACTLY} else AT_POINTS)
    for sentence, other in others.items():
        if all(equality(one, two, symbols) for one, two in pairs(other)):
            return Judgement(False, sentence)
    return Judgement(False, _in_what(pairs(wanted), symbols))


def _in_what(pairs: Sequence[tuple[Any, Any]], symbols: Sequence[Any]) -> str:
    """In what formulas differ that are not equal."""
    if all(equality(one, one * 0, symbols) for one, _ in pairs):
        return "is zero or a constant" if len(pairs) > 1 else "is zero"
    factors = {factor_between(one, two, symbols) for one, two in pairs if (one, two) != (0, 0)}
    if len(factors) == 1 and "" not in factors:
        factor = factors.pop()
        if factor == "-1" or symbols:  # of a number, other factors would tell the answer
            return "has the other sign" if factor == "-1" else f"is {factor} times what is asked"
    power = min((first_wrong_power(one, two, symbols) for one, two in pairs), default=0)
    if power > 0:
        return f"is right through h^{power - 1}, and wrong at h^{power}"
    return "differs"
