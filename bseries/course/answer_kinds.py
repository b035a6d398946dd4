"""Kinds of answers: how each is written, read and judged.

Linear combinations of elementary differentials, such as ``h/2 f'f + theta*f''(f,f'f)``, have the grammar

    differential = "f" | "f'" differential | "f'" {"'"} "(" differential {"," differential} ")"

A derivative of order k has k arguments. Coefficients are formulas; the sign * beside a differential may be left out.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from bseries.course.equality import EXACTLY, equality, factor_between, first_wrong_power, has_digits
from bseries.exceptions import SeriesError
from integrators import RungeKutta
from integrators.core.arguments import split_row
from integrators.core.errors import IntegratorError, shorten
from integrators.exact.arithmetic import MOST_DEGREE, degree_bound
from integrators.exact.expressions import ELEMENTARY, parse_expression
from trees import Tree

if TYPE_CHECKING:
    import sympy

YES_NO = ("yes", "no")
MOST_NODES = 6
"""Methods are compared, and their structure is tested, on trees with up to this number of nodes."""
MOST_STAGES = 6
"""Of a tableau in an answer."""
START = re.compile(r"(?<![^\W\d])f(?!\w)")
"""An f that is no part of a name; a number may stand before it."""
MOST_FACTORS = 12
"""Of an elementary differential."""
SIGNS = {"·": "*", "⋅": "*", "×": "*", "’": "'", "′": "'", "π": "pi"}
SIGNS |= {"γ": "gamma", "ε": "eps", "θ": "theta", "φ": "phi", "ω": "omega"}
"""Signs in answers, and what the parser of formulas reads in their place."""
NO_SIGN = re.compile(r"(?<![\w.^/])(?<![\^/]\s)((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?=(?![eE][+-]?\d)[^\W\d]|\()")
"""A number before a name or a parenthesis, as in 3a^2/8; what 1/2a means would be a guess."""


def plain(text: str) -> str:
    """An answer with the signs that the parser of formulas reads.

    Example:
        >>> plain("3θ^2/8 + 2·sin(q) - 1e3"), plain("4(1 + p) + 1/2 f'f")
        ('3*theta^2/8 + 2*sin(q) - 1e3', "4*(1 + p) + 1/2 f'f")
    """
    for sign, word in SIGNS.items():
        text = text.replace(sign, word)
    return NO_SIGN.sub(r"\1*", text)


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
            exact = sympy.sympify(wanted, strict=True)
            if self.digits is not None:
                right = has_digits(given, exact, self.digits)
                found = Judgement(right, f"equal to {self.digits} digits" if right else "differs")
            else:
                found = compare(given, exact, symbols, others, constant=self.constant)
            if not found.right:
                return Judgement(False, found.remark if self.count == 1 else f"entry {k}: {found.remark}")
            remarks.append(found.remark)
        return Judgement(True, next((remark for remark in remarks if remark != EXACTLY), EXACTLY))


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
    """Compare two formulas, up to a constant if asked; the remark says how a wrong one differs."""
    found = equality(given, wanted, symbols, constant=constant)
    if found:
        return Judgement(True, found)
    for sentence, other in others.items():
        if equality(given, other, symbols, constant=constant):
            return Judgement(False, sentence)
    if equality(given, wanted * 0, symbols, constant=constant):
        return Judgement(False, "is a constant" if constant else "is zero")
    factor = factor_between(given, wanted, symbols, constant=constant)
    if factor == "-1":
        return Judgement(False, "has the other sign")
    if factor and symbols:  # of a number, the factor would tell the answer
        return Judgement(False, f"is {factor} times what is asked")
    power = 0 if constant else first_wrong_power(given, wanted, symbols)
    return Judgement(False, f"is right through h^{power - 1}, and wrong at h^{power}" if power > 0 else "differs")


def differential_symbol(tree: Tree) -> sympy.Symbol:
    """The symbol that stands for the elementary differential of a tree in formulas."""
    import sympy

    return sympy.Symbol("F" + "_".join(map(str, tree.levels)))


def read_differentials(text: str, *, names: Iterable[str] = (), argument: str = "formula") -> sympy.Expr:
    """A combination of elementary differentials as a formula in their symbols (`differential_symbol`).

    Args:
        text: The combination.
        names: The symbols in coefficients.
        argument: The name of the text in messages.

    Raises:
        SeriesError: The text is no linear combination of elementary differentials.

    Example:
        >>> formula = read_differentials("h/2 f'f - (1/3)*f''(f, f'(f))", names=["h"])
        >>> formula
        F0_1*h/2 - F0_1_1_2/3
        >>> formula.coeff(differential_symbol(Tree("[τ,[τ]]")))
        -1/3
    """
    import sympy

    reader = _Reader(text, argument)
    written = reader.written()
    try:
        formula = parse_expression(written, names=[*names, *reader.trees], functions=ELEMENTARY, argument=argument)
    except IntegratorError as error:
        raise SeriesError(reader.in_words(str(error))) from None
    symbols = tuple(map(sympy.Symbol, reader.trees))
    if formula.xreplace(dict.fromkeys(symbols, 0)) != 0 or any(formula.diff(f).has(*symbols) for f in symbols):
        raise SeriesError(
            f"{argument} must be a sum of numbers times elementary differentials such as f'f, but was {shorten(text)!r}"
        )
    return formula


def combination(coefficients: Mapping[Tree, Any]) -> sympy.Expr:
    """The formula of Σ c(τ) F(τ) in the symbols of elementary differentials."""
    import sympy

    return sympy.Add(*(sympy.sympify(c, strict=True) * differential_symbol(tree) for tree, c in coefficients.items()))


class _Reader:
    """The differentials of a text, each replaced by its symbol."""

    def __init__(self, text: str, argument: str):
        self.text, self.argument, self.place = text, argument, 0
        self.trees: dict[str, Tree] = {}

    def written(self) -> str:
        """The text with symbols for differentials, and with signs * beside them."""
        written, end = "", 0
        for match in START.finditer(self.text):
            if match.start() < end:  # inside the last one
                continue
            written += self.text[end : match.start()]
            self.place = match.start()
            tree = self.differential()
            end, name = self.place, differential_symbol(tree).name
            self.trees[name] = tree
            before = "*" if re.search(r"[\w).]\s*$", written) else ""
            after = "*" if re.match(r"\s*[\w(.]", self.text[end:]) else ""
            written += before + name + after
        return written + self.text[end:]

    def differential(self) -> Tree:
        """The tree of the differential that begins here."""
        self.skip("f")
        primes = 0
        while self.next() == "'":
            self.place += 1
            primes += 1
        if primes == 0:
            return Tree("τ")
        if primes == 1 and self.next() == "f":
            children = [self.differential()]
        else:
            self.skip("(")
            children = [self.differential()]
            while self.next() == ",":
                self.place += 1
                children.append(self.differential())
            self.skip(")")
        tree = Tree.join(children)
        if len(children) != primes:
            self.refuse(f"has a derivative of order {primes} with {len(children)} arguments")
        if tree.order > MOST_FACTORS:
            self.refuse(f"has a differential with more than {MOST_FACTORS} factors f")
        return tree

    def next(self) -> str:
        """The next character that is no space."""
        while self.text[self.place : self.place + 1].isspace():
            self.place += 1
        return self.text[self.place : self.place + 1]

    def skip(self, sign: str) -> None:
        """Go past a character, which must be the next one."""
        if self.next() != sign:
            self.refuse(f"has {self.next() or 'its end'!r} where {sign!r} is expected at position {self.place + 1}")
        self.place += 1

    def refuse(self, problem: str) -> NoReturn:
        """Raise an error that quotes the text."""
        raise SeriesError(
            f"{self.argument} must be a sum of elementary differentials, but {shorten(self.text)!r} {problem}"
        )

    def in_words(self, message: str) -> str:
        """A message of the parser with differentials in place of their symbols."""
        for name in sorted(self.trees, key=len, reverse=True):
            message = message.replace(name, self.trees[name].differential())
        return message
