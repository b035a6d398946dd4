"""Kinds of answers: how each is written, read and judged.

Linear combinations of elementary differentials, such as ``h/2 f'f + theta*f''(f,f'f)``, have the grammar

    differential = "f" | "f'" differential | "f'" {"'"} "(" differential {"," differential} ")"

A derivative of order k has k arguments. Coefficients are formulas; the sign * beside a differential may be left out.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple, NoReturn

import sympy

from bseries.course.equality import EXACTLY, agreeing_digits, equality, factor_between, first_wrong_power
from bseries.course.notation import plain
from bseries.exceptions import SeriesError
from bseries_base.errors import shorten
from integrators import RungeKutta
from integrators.core.arguments import split_row
from integrators.core.errors import IntegratorError
from integrators.exact.arithmetic import MOST_DEGREE, degree_bound
from integrators.exact.expressions import ELEMENTARY, parse_expression
from trees import Tree

MOST_NODES = 6
"""Methods are compared, and their structure is tested, on trees with up to this number of nodes."""
MOST_STAGES = 6
"""Of a tableau in an answer."""
START = re.compile(r"(?<![^\W\d])f(?!\w)")
"""An f that is no part of a name; a number may stand before it."""
MOST_FACTORS = 12
"""Of an elementary differential."""
LEAST_DIGITS, MOST_DIGITS = 3, 15
"""Of a decimal number that is taken for a rounded one: no double has more."""
DECIMAL = re.compile(r"\d*\.\d*")
BUT_EXACT = ", but an exact answer is asked for"
"""In remarks on them."""


def rounded_to(text: str) -> int:
    """The number of significant digits of an answer with rounded decimals; 0 if there are none.

    Decimals of less than half as many digits as the longest one are not rounded.

    Example:
        >>> [rounded_to(text) for text in ("0.1667", "0.5, 0; 0.666667, 0.33333", "1/6", "0.5*p", "2.50e-3")]
        [4, 5, 0, 0, 3]
    """
    digits = [len(x.replace(".", "").lstrip("0")) for x in DECIMAL.findall(text)]
    fewest = min((d for d in digits if 2 * d >= max(digits)), default=0)
    return min(fewest, MOST_DIGITS) if fewest >= LEAST_DIGITS else 0


class Judgement(NamedTuple):
    """Whether an answer is right, and a remark: how that was decided, or in what the answer differs."""

    right: bool
    remark: str


class AnswerKind(NamedTuple):
    """A kind of answers: how one is written, and a function of its text, the truth, and its name in messages.

    What the truth is depends on the kind. The function raises a SeriesError or an IntegratorError if it cannot read the
    text.
    """

    form: str
    judge: Callable[[str, Any, str], Judgement]


def formulas(
    names: Sequence[str] = (),
    count: int = 1,
    *,
    constant: bool = False,
    digits: int | None = None,
    others: Mapping[str, Callable[[], Sequence[Any]]] = {},
) -> AnswerKind:
    """Formulas in some symbols, or numbers without symbols; the truth is a tuple of formulas.

    Args:
        names: The symbols.
        count: The number of formulas.
        constant: Whether they may differ from the truth by a constant.
        digits: The number of significant digits asked for; None for exact numbers.
        others: Formulas that a wrong answer may be, by a sentence on each.
    """
    if names:
        what = "a formula in" if count == 1 else f"{count} formulas, separated by commas, in"
        form = f"{what} {', '.join(names)}{', up to a constant' if constant else ''}"
    else:
        form = "a number" if count == 1 else f"{count} numbers, separated by commas"
        form += ", exactly" if digits is None else f", to {digits} significant digits"
    # A factor h too many is a mistake to name, not an unknown symbol.
    known = dict.fromkeys((*names, "h")) if names else ()
    symbols = tuple(map(sympy.Symbol, known))

    def judge_one(given: sympy.Expr, wanted: sympy.Expr, place: int, rounded: int) -> Judgement:
        if digits is not None:
            right = agreeing_digits(given, wanted, ()) >= digits
            return Judgement(right, f"equal to {digits} digits" if right else "differs")
        alternatives = {sentence: make()[place] for sentence, make in others.items()}
        return compare(given, wanted, symbols, alternatives, constant=constant, rounded=rounded)

    def judge(text: str, truth: Any, argument: str) -> Judgement:
        entries = split_row(plain(text))
        if len(entries) != count:
            raise SeriesError(f"{argument} must be {form}, but had {len(entries)} entries")
        remark = EXACTLY
        for place, (entry, wanted) in enumerate(zip(entries, truth, strict=True)):
            given = parse_expression(entry, names=known, functions=ELEMENTARY, argument=argument)
            found = judge_one(given, sympy.sympify(wanted, strict=True), place, rounded_to(entry))
            if not found.right:
                return found if count == 1 else Judgement(False, f"entry {place + 1}: {found.remark}")
            remark = found.remark if remark == EXACTLY else remark
        return Judgement(True, remark)

    return AnswerKind(form, judge)


def differentials(names: Sequence[str] = ()) -> AnswerKind:
    """A linear combination of elementary differentials; the truth maps trees to its coefficients in these symbols."""
    symbols = f", with coefficients in {', '.join(names)}" if names else ""

    def judge(text: str, truth: Any, argument: str) -> Judgement:
        given = read_differentials(plain(text), names=dict.fromkeys((*names, "h")), argument=argument)
        wanted = combination(truth)
        symbols = {sympy.Symbol(name) for name in (*names, "h")} | given.free_symbols | wanted.free_symbols
        return compare(given, wanted, sorted(symbols, key=str), rounded=rounded_to(text))

    return AnswerKind(f"elementary differentials, such as 1/2*f'f - 1/3*f''(f,f'f){symbols}", judge)


def decisions(*things: str) -> AnswerKind:
    """Yes or no, for each of several things in order if there are any; the truth is a tuple of these words."""
    form, count = "yes or no", max(1, len(things))
    if things:
        form += f" for each, separated by commas: {', '.join(things)}"

    def judge(text: str, truth: Any, argument: str) -> Judgement:
        given = [word.strip(" .!").lower() for word in text.split(",")]
        if len(given) != count or not set(given) <= {"yes", "no"}:
            raise SeriesError(f"{argument} must be {form}; but was {shorten(text)!r}")
        wrong = sum(one != other for one, other in zip(given, truth, strict=True))
        # Which ones are wrong would tell the answer.
        return Judgement(not wrong, f"{wrong} of {count} wrong" if wrong and things else "")

    return AnswerKind(form, judge)


def tableau() -> AnswerKind:
    """A Runge–Kutta tableau; the truth is a function that says what a method lacks, or nothing."""
    form = "a tableau, exactly: the rows of A and then b, separated by semicolons, as in 0, 0; 1/2, 0; 0, 1"

    def judge(text: str, truth: Any, argument: str) -> Judgement:
        *rows, weights = [split_row(row) for row in plain(text).split(";")]
        if not 1 <= len(rows) <= MOST_STAGES or any(len(row) != len(rows) for row in (*rows, weights)):
            raise SeriesError(
                f"{argument} must be {form}, s + 1 rows of s entries with s up to {MOST_STAGES}, "
                f"but was {shorten(text)!r}"
            )
        method = RungeKutta(rows, weights, name=argument, warn=False)
        irrational: list[Any] = [x for row in (*method.A, method.b) for x in row if not isinstance(x, Fraction)]
        if degree_bound(irrational) > MOST_DEGREE:
            raise SeriesError(
                f"{argument} must have entries in a field of degree {MOST_DEGREE} at most, but had more roots"
            )
        lacks = truth(method)
        digits = rounded_to(text) if lacks else 0
        if digits and not truth(RungeKutta(rows, weights, name=argument, digits=digits, warn=False)):
            lacks = f"is right to {digits} digits{BUT_EXACT}"
        return Judgement(not lacks, lacks or f"tested on all trees with up to {MOST_NODES} nodes")

    return AnswerKind(form, judge)


def compare(
    given: sympy.Expr,
    wanted: sympy.Expr,
    symbols: Sequence[Any],
    others: Mapping[str, sympy.Expr] = {},
    *,
    constant: bool = False,
    rounded: int = 0,
) -> Judgement:
    """Compare two formulas, up to a constant if asked; the remark says how a wrong one differs.

    Decimals in the first one are rounded to so many digits, if there are any.
    """
    found = equality(given, wanted, symbols, constant=constant)
    if found:
        return Judgement(True, found)
    for sentence, other in others.items():
        if equality(given, other, symbols, constant=constant):
            return Judgement(False, sentence)
    agreeing = min(rounded, agreeing_digits(given, wanted, symbols, constant=constant)) if rounded else 0
    if agreeing >= LEAST_DIGITS:
        return Judgement(False, f"agrees to {agreeing} digits{BUT_EXACT}")
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
    return sympy.Symbol("F" + "_".join(map(str, tree.levels)))


def read_differentials(text: str, *, names: Iterable[str] = (), argument: str = "formula") -> sympy.Expr:
    """A combination of elementary differentials, with coefficients in symbols, as a formula in theirs.

    Example:
        >>> formula = read_differentials("h/2 f'f - (1/3)*f''(f, f'(f))", names=["h"])
        >>> formula
        F0_1*h/2 - F0_1_1_2/3
        >>> formula.coeff(differential_symbol(Tree("[τ,[τ]]")))
        -1/3
    """
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
