"""Parser of formulas written by users, whose text is never evaluated as code, and numbers as text.

    sum      = product {("+" | "-") product}
    product  = unary {("*" | "/") unary}
    unary    = {"+" | "-"} power
    power    = atom [("^" | "**") unary]
    atom     = number | name | function "(" sum ")" | "root(" sum "," sum ")" | "(" sum ")" | "√" atom
             | ("min" | "max") "(" sum {"," sum} ")" | "where(" sum (">" | "<" | ">=" | "<=") sum "," sum "," sum ")"

Decimals are read exactly, as fractions. Rational formulas give `Fraction`s without SymPy.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias, TypeVar

from bseries_base.errors import shorten, shown
from integrators.core.arguments import check_distinct, identifier
from integrators.core.errors import IntegratorError
from integrators.exact import arithmetic as exact
from integrators.exact.arithmetic import Exact

if TYPE_CHECKING:
    import sympy

T = TypeVar("T")

ELEMENTARY = (
    *("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
    *("exp", "log", "erf"),
)
"""The smooth functions of `parse_expression` besides roots."""

BRANCHES = ("abs", "sign", "heaviside", "min", "max", "where")
"""Its functions that are not smooth."""
FUNCTIONS = (*ELEMENTARY, *BRANCHES)

COSINES = ("cos", "sin", "tan")
"""The functions of `parse_number` besides roots: of rational multiples of pi they are algebraic."""

ROOTS = ("sqrt", "cbrt", "root")
NOT_FINITE = ("nan", "inf", "infinity", "oo", "zoo")
MAX_LENGTH = 10_000
MAX_DEPTH = 100
MOST_TERMS = 100_000
"""Of a power of a sum, when it is multiplied out."""

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)|(?P<name>[^\W\d]\w*)|(?P<sign>\*\*|[<>]=?|[-+*/^(),√]))"
)


def parse_number(text: str, *, names: Iterable[str] = (), argument: str = "entry") -> Exact:
    """Read a formula of algebraic numbers and declared symbols."""
    names = check_names(names, f"symbols of {argument}")
    value = _Parser(text, names, COSINES, argument).algebraic()
    # Reading SymPy's text of a formula can give another form, 1/(3*x + 3) for 1/(3*(x + 1)): repeat until stable.
    while not isinstance(value, Fraction):
        form = _Parser(format_number(value), names, COSINES, argument).algebraic()
        if form == value:
            break
        value = form
    return value


def parse_constant(text: str, *, argument: str = "number") -> Exact:
    """Read a number: a formula of numbers, roots, pi and elementary functions."""
    return _Parser(text, (), FUNCTIONS, argument, "a number").parse()


def parse_expression(
    text: str,
    *,
    names: Iterable[str],
    functions: Iterable[str] = FUNCTIONS,
    argument: str = "expression",
) -> sympy.Expr:
    """Read a formula of numbers, roots, declared symbols, pi, elementary functions and branches.

    ``heaviside(x)`` is (1 + sign(x))/2, ``min`` and ``max`` take two formulas or more, and ``where(x > y, a, b)`` is a
    where x > y, otherwise b. See `integrators.exact.branches` for their derivatives.

    Example:
        >>> parse_expression("p^2/2 - 0.5*cos(q)", names=["p", "q"])
        p**2/2 - cos(q)/2
        >>> parse_expression("max(q, 1) + abs(-q)", names=["q"])
        abs(q) + where(q - 1 > 0, q, 1)
    """
    value = _Parser(text, check_names(names, f"symbols of {argument}"), tuple(functions), argument).parse()
    return exact.in_sympy(value)


def format_number(value: object) -> str:
    """The text of a number or formula, from which `parse_number` reads an equal value."""
    return repr(value) if isinstance(value, float) else str(value)


def decimal_text(value: Fraction) -> str:
    """The text of a fraction: a terminating decimal if possible, else as `format_number`.

    Example:
        >>> decimal_text(Fraction(-161, 1000)), decimal_text(Fraction(1, 66))
        ('-0.161', '1/66')
    """
    places = value.denominator.bit_length()
    scaled = value * 10**places
    if scaled.denominator > 1 or places > exact.MAX_DIGITS:
        return str(value)
    digits = str(abs(scaled.numerator)).rjust(places + 1, "0")
    return "-" * (value < 0) + f"{digits[:-places]}.{digits[-places:]}".rstrip("0").rstrip(".")


def check_names(names: Iterable[str], argument: str) -> tuple[str, ...]:
    """The names of symbols as a tuple."""
    if isinstance(names, str):
        raise IntegratorError(f"{argument} must be a sequence of names, but was the text {shorten(names)!r}")
    checked = tuple(names)
    for name in checked:
        match = _TOKEN.fullmatch(name) if isinstance(name, str) else None
        if match is None or match["name"] != name or identifier(name) in (*ROOTS, *FUNCTIONS, *NOT_FINITE):
            raise IntegratorError(
                f"{argument} must be letters, digits and _ and not name a function, but one was {shorten(str(name))!r}"
            )
    check_distinct(checked, argument)
    return checked


class _Parser:
    """Recursive-descent parser of one text, with one method for each rule of the grammar above."""

    def __init__(
        self, text: str, names: tuple[str, ...], functions: tuple[str, ...], argument: str, wanted: str = "a formula"
    ) -> None:
        if not isinstance(text, str):
            raise IntegratorError(f"{argument} must be text, but was {shown(text)}")
        self.text, self.names, self.functions, self.argument = text, names, functions, argument
        self.wanted = wanted
        if len(text) > MAX_LENGTH:
            self.refuse(f"has {len(text)} characters, more than {MAX_LENGTH}")
        self.depth = 0
        self.tokens = iter(self.tokenize(text.replace("−", "-").rstrip()))
        self.advance()

    def refuse(self, problem: str, position: int | None = None) -> NoReturn:
        """Raise an error that quotes the formula."""
        where = "" if position is None else f" at position {position + 1}"
        raise IntegratorError(f"{self.argument} must be {self.wanted}, but {shorten(self.text)!r} {problem}{where}")

    def tokenize(self, text: str) -> list[tuple[str, str, int]]:
        """The tokens as (kind, text, position), and an end."""
        tokens, position = [], 0
        while position < len(text):
            match = _TOKEN.match(text, position)
            if match is None:
                position += len(text[position:]) - len(text[position:].lstrip())
                self.refuse(f"has {text[position]!r}", position)
            kind = match.lastgroup or ""
            tokens.append((kind, match[kind], match.start(kind)))
            position = match.end()
        return [*tokens, ("end", "", len(text))]

    def parse(self) -> Exact:
        try:
            value = self.sum()
        except RecursionError:
            self.refuse("is nested too deeply")
        if self.kind != "end":
            self.expected("an operator")
        return value

    def algebraic(self) -> Exact:
        """As `parse`, but numbers that are not algebraic are refused."""
        return self.compute(None, exact.algebraic, self.parse())

    def advance(self) -> None:
        """Read the next token."""
        self.kind, self.token, self.position = next(self.tokens)

    def expected(self, what: str) -> NoReturn:
        if self.kind == "end":
            self.refuse(f"ends where {what} is expected")
        self.refuse(f"has {shorten(self.token)!r} where {what} is expected", self.position)

    def skip(self, sign: str) -> None:
        if self.token != sign:
            self.expected(repr(sign))
        self.advance()

    def compute(self, position: int | None, operation: Callable[..., T], *arguments: object) -> T:
        """Perform an operation; its `ArithmeticError` becomes an error with the operation's position."""
        try:
            return operation(*arguments)
        except ArithmeticError as error:
            self.refuse(str(error), position)

    def nested(self, rule: Callable[[], T]) -> T:
        if self.depth == MAX_DEPTH:
            self.refuse(f"is nested more than {MAX_DEPTH} deep", self.position)
        self.depth += 1
        value = rule()
        self.depth -= 1
        return value

    def sum(self) -> Exact:
        start = self.position
        terms = [self.product()]
        while self.token in ("+", "-"):
            sign = Fraction(1 if self.token == "+" else -1)
            self.advance()
            terms.append(self.product(sign))
        return self.compute(start, exact.add, terms)

    def product(self, sign: Fraction = Fraction(1)) -> Exact:
        start = self.position
        sign, first = self.unary(sign)
        factors = [first]
        while self.token in ("*", "/"):
            divides, position = self.token == "/", self.position
            self.advance()
            sign, factor = self.unary(sign)
            factors.append(self.compute(position, exact.invert, factor) if divides else factor)
        return self.compute(start, exact.multiply, factors if sign == 1 else [sign, *factors])

    def unary(self, sign: Fraction) -> tuple[Fraction, Exact]:
        """The sign, multiplied by those read, and the operand; a product includes its sign as a factor."""
        while self.token in ("+", "-"):
            sign = -sign if self.token == "-" else sign
            self.advance()
        return sign, self.power()

    def power(self) -> Exact:
        base, position = self.atom(), self.position
        if self.token not in ("^", "**"):
            return base
        self.advance()
        sign, exponent = self.nested(lambda: self.unary(Fraction(1)))
        form: Any = base
        others = len(form.args) - 1 if getattr(form, "is_Add", False) and form.free_symbols else 0
        if isinstance(exponent, Fraction) and math.comb(abs(int(exponent)) + others, others) > MOST_TERMS:
            self.refuse(f"has a power of a sum with more than {MOST_TERMS:,} terms", position)
        if self.functions and not isinstance(exponent, Fraction):
            return self.compute(position, exact.transcendental_power, base, exact.multiply([sign, exponent]))
        return self.compute(position, exact.power, base, exact.multiply([sign, exponent]))

    def atom(self) -> Exact:
        kind, token, position = self.kind, self.token, self.position
        if kind == "number":
            self.advance()
            return self.number(token, position)
        if kind == "name":
            self.advance()
            return self.name(token, position)
        if token == "√":
            self.advance()
            return self.compute(position, exact.root, self.nested(self.atom), Fraction(2))
        if token != "(":
            self.expected("a number, a name or '('")
        return self.arguments()[0]

    def arguments(self, count: int = 1) -> list[Exact]:
        """`count` sums in parentheses, separated by commas."""
        self.skip("(")
        values = [self.nested(self.sum)]
        while len(values) < count:
            self.skip(",")
            values.append(self.nested(self.sum))
        self.skip(")")
        return values

    def branch(self, name: str, position: int) -> Exact:
        """A function that is not smooth, with its arguments."""
        self.skip("(")
        values, relation = [self.nested(self.sum)], ""
        if name == "where":
            relation = self.token
            if relation not in (">", "<", ">=", "<="):
                self.expected("'>', '<', '>=' or '<='")
            self.advance()
            values.append(self.nested(self.sum))
        more = {"where": 2, "min": 1, "max": 1}.get(name, 0)
        while more > 0 or (name in ("min", "max") and self.token == ","):
            self.skip(",")
            values.append(self.nested(self.sum))
            more -= 1
        self.skip(")")
        from integrators.exact.branches import branch

        return self.compute(position, lambda: exact.bounded(branch(name, relation, values)))

    def number(self, token: str, position: int) -> Exact:
        exponent = token.lower().partition("e")[2].lstrip("+-0")
        if len(token) > exact.MAX_DIGITS + 1 or len(exponent) > 4 or int(exponent or 0) > exact.MAX_DIGITS:
            self.refuse(f"has a number of more than {exact.MAX_DIGITS} digits", position)
        return self.compute(position, exact.bounded, Fraction(token))

    def name(self, name: str, position: int) -> Exact:
        if name in self.names:
            import sympy

            return sympy.Symbol(name)
        if name in ROOTS:
            values = self.arguments(2 if name == "root" else 1)
            degree = values[1] if name == "root" else Fraction(2 if name == "sqrt" else 3)
            return self.compute(position, exact.root, values[0], degree)
        if name in self.functions and name in BRANCHES:
            return self.branch(name, position)
        if name in self.functions:
            return self.compute(position, exact.apply, name, self.arguments()[0])
        if name == "pi" and self.functions:
            import sympy

            return sympy.pi
        if name.lower() in NOT_FINITE:
            self.refuse("is not finite", position)
        own = shorten(", ".join(self.names), 200)  # a scene may have thousands; functions are all listed
        known = ", ".join(filter(None, (own, *ROOTS, *self.functions, "pi" if self.functions else "")))
        return self.refuse(f"has the unknown name {shorten(name)!r} (known: {known})", position)


SUM, PRODUCT, ATOM = range(3)
"""Precedence of the outermost operation of a text."""
Part: TypeAlias = tuple[str, int]
"""A text with its precedence."""


def literal(value: Exact) -> str:
    """The nearest double to an exact number, as text."""
    try:
        return repr(nearest_double(value))
    except ArithmeticError:
        raise IntegratorError(
            f"formula must have numbers that doubles can stand for, but has {shorten(str(value))}"
        ) from None


def nearest_double(value: Any) -> float:
    """The nearest double to an exact number; ties are rounded to even.

    Python rounds fractions this way, SymPy does not. Irrational numbers are rounded to 40 digits first, which matters
    only for numbers that agree with the midpoint of two doubles to 40 digits.
    """
    if not hasattr(value, "evalf"):
        return float(value)
    import sympy

    digits: Any = sympy.Rational(value if value.is_Rational else value.evalf(40, strict=True))
    return int(digits.p) / int(digits.q)


def within(part: Part, precedence: int) -> str:
    """A text as an operand of an operation of given precedence."""
    return part[0] if part[1] >= precedence else f"({part[0]})"
