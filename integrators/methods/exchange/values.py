"""Values in source text: one grammar of numbers, arrays and the functions of tableaus. Nothing is evaluated as code.

sum      = product {("+" | "-") product}
product  = power {("*" | "/" | "//") power}
power    = atom [("^" | "**") power]
atom     = number | name {index} | call | "(" sum ")" | array
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from fractions import Fraction
from functools import partial
from typing import Any, NoReturn

from bseries_base.errors import shorten
from integrators.methods.exchange.arrays import Display, Slice, assembled, constant, place_of
from integrators.methods.exchange.numbers import (
    CIRCLE,
    FUNCTIONS,
    ONE,
    POWERS,
    QUOTIENTS,
    ZERO,
    Number,
    Struct,
    Value,
    apply,
    combine,
    each,
    elementwise,
    literal,
    negative,
)  # fmt: skip
from integrators.methods.exchange.tokens import CLOSING, LANGUAGES, OPENING, Source, Token

MOST_BRACKETS = 20
"""Of nested brackets."""
REVERSED = "reversed"
"""In place of the bounds of a slice."""
MOST_ENTRIES = 100_000
MOST_PARTS = 200
"""Of one entry."""
MOST_SHOWN = 100
"""Characters of what could not be read."""
KEPT_LAST = ("convert", "parse", "map", "oftype")
KEPT_FIRST = ("array", "asarray", "squeeze", "transpose", "N", "reshape", "list", "tuple", "copy", "ArrayPlot")
CAST = re.compile(
    r"(?:\w*_)?RCONST|RC|(?:[A-Z]\w*_)?REAL|PetscReal\w*|real|dble|float|double|int|Float\d*|Double|Big(?:Float|Int)|big"
    r"|[TR]\d?|U?Int\d*|Rational|Fraction|Decimal|mpf|mpq|S|sympify|Integer|constvalue|sunrealtype|realtype|str|vpa|sym"
    r"|(?:S|M)?(?:Vector|Matrix|Array)|float\d+|Number|static_cast|QQ"
)
"""Functions that convert one number."""
FILLED = {"zeros": ZERO, "ones": ONE, "zero": ZERO, "one": ONE, "Matrix": ZERO, "Vector": ZERO, "Array": ZERO}
NOTHING = ("NULL", "nullptr", "None", "nothing", "null", "Null")
WORDS = {
    **{name: Fraction(k) for k, name in enumerate(("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX"))},
    "HALF": Fraction(1, 2),
    "ONEHALF": Fraction(1, 2),
    "QUARTER": Fraction(1, 4),
    "TEN": Fraction(10),
}
"""Constants that headers of C define."""
METHODS = ("astype", "copy", "tolist", "evalf")
"""Of arrays, which they leave as they are."""


class Unread(Exception):
    """A value that is none, with the token where it ends to be one, or the predicate of a sentence."""

    def __init__(self, position: int, what: str) -> None:
        super().__init__(what)
        self.position = position


class Reader:
    """Reads values in the tokens of a source, from names that have values."""

    def __init__(self, source: Source, look_up: Callable[[str], Any]) -> None:
        self.source = source
        self.language = source.language
        self.tokens = source.tokens
        self.look_up = look_up
        self.i = 0
        self.depth = self.entries = self.parts = 0
        self.is_display = False
        """Whether spaces separate entries here."""
        self.ends_with_line = self.language.ends_with_line

    def read(self, start: int, *, in_line: bool = False) -> Value | Struct | None:
        """The value that starts at a token, of its line at most on request; None for names of nothing."""
        self.ends_with_line = in_line or self.language.ends_with_line
        self.i, self.depth, self.entries, self.parts, self.is_display = start, 0, 0, 0, False
        if self._token().text in NOTHING:
            self.i += 1
            return None
        value = self._entry()
        self._expect_end()
        return value

    def _expect_end(self) -> None:
        kind, text, _ = self._token(skip=False)
        if not (kind == "line" or text in (",", ";", "=", *CLOSING) or (kind == "text" and not text.strip())):
            if text == ":" and self.language.first == 0:
                return
            self._refuse()

    # Tokens.

    def _token(self, *, skip: bool = True) -> Token:
        """The token here, behind lines where these are no ends."""
        if not self.is_display and (skip or self.depth or not self.ends_with_line):
            while self.tokens[self.i].kind == "line" and self.i + 1 < len(self.tokens):
                self.i += 1
        return self.tokens[self.i]

    def _refuse(self, what: str = "", at: int | None = None) -> NoReturn:
        at = self.i if at is None else at
        if not what:
            token = self.tokens[at]
            piece = self.source.text[token.start : token.start + MOST_SHOWN].split("\n")[0]
            what = shorten(re.split(r"[,;)\]}]", piece, maxsplit=1)[0].strip() or piece.strip() or "nothing")
            what = f"has {what!r}"
        raise Unread(at, what)

    def _is_spaced(self, i: int) -> bool:
        """Whether there is a space between a token and the one before it."""
        before = self.tokens[i - 1]
        return before.start + len(before.text) < self.tokens[i].start

    # Entries.

    def _entry(self) -> Any:
        """A value with the text that it was written as."""
        self.parts = 0
        start = self.i
        while self.tokens[start].kind == "line" and start + 1 < len(self.tokens):
            start += 1
        value = self._sum()
        self.entries += 1
        if self.entries > MOST_ENTRIES:
            self._refuse(f"must have at most {MOST_ENTRIES:,} entries, but has more")
        if isinstance(value, Number) and not (self.i == start + 1 and self.tokens[start].kind == "name"):
            first, last = self.tokens[start], self.tokens[self.i - 1]
            text = self.source.text[first.start : last.start + len(last.text)]
            return value._replace(text=" ".join(text.split()), line=self.source.line(first.start))
        return value

    def _operator(self) -> int:
        """Go behind an operator and the end of its line; the index of the operator."""
        at, self.i = self.i, self.i + 1
        while self.tokens[self.i].kind == "line" and self.i + 1 < len(self.tokens):
            self.i += 1
        return at

    def _operate(self, sign: str, x: Any, y: Any, at: int) -> Any:
        if isinstance(x, Struct | Display | None) or isinstance(y, Struct | Display | None):
            self._refuse(at=at)
        is_whole = self.language.rounds and all(isinstance(v, Number) and v.is_whole for v in (x, y))
        if sign == "/" and is_whole and y.value and (x.value / y.value).denominator > 1:
            quotient = f"{x.value}/{y.value}"
            self._refuse(f"must have quotients with decimal points, since the language rounds {quotient}", at)
        try:
            return elementwise(partial(combine, sign), x, y)
        except ArithmeticError as error:
            self._refuse(str(error), at)

    def _sum(self) -> Any:
        value = self._product()
        while True:
            token = self._token(skip=False)
            sign = token.text.lstrip(".")
            if token.kind != "sign" or sign not in ("+", "-"):
                return value
            if self.is_display and self._is_spaced(self.i) and not self._is_spaced(self.i + 1):
                return value  # the next entry of a row
            at = self._operator()
            value = self._operate(sign, value, self._product(), at)

    def _product(self) -> Any:
        value = self._signed()
        while True:
            kind, text, _ = self._token(skip=False)
            sign = text.lstrip(".") if text.startswith(".") and len(text) == 2 else text
            if kind == "sign" and (sign in "*/×÷⋅" or (sign == "//" and self.language.has_rationals)):
                at = self._operator()
                # Julia computes a//b before products.
                value = self._operate("*" if sign in "*×⋅" else "/", value, self._signed(), at)
            elif self._is_factor(kind, text):
                value = self._operate("*", value, self._power(), self.i)
            else:
                return value

    def _is_factor(self, kind: str, text: str) -> bool:
        """Whether a name or a bracket behind a number is a factor of it, as in 2x."""
        before = self.tokens[self.i - 1]
        if self.language.first == 0 or self.language.rounds:
            return False
        if self._is_spaced(self.i) and self.language.called != "[":
            return False
        return (kind == "name" or text in ("(", "√")) and before.kind == "number"

    def _signed(self) -> Any:
        sign = 1
        while self._token().text in ("+", "-") and self.tokens[self.i].kind == "sign":
            sign = -sign if self.tokens[self.i].text == "-" else sign
            self.i += 1
            self._count()
        value = self._rational()
        if sign < 0:
            if isinstance(value, Struct | None):
                self._refuse()
            return each(negative, value)
        return value

    def _rational(self) -> Any:
        """Powers, and quotients a//b, which Julia computes before products."""
        value = self._power()
        while self.language.has_rationals and self._token(skip=False).text == "//":
            at = self._operator()
            negate = self._token().text == "-"
            self.i += negate
            other = self._power()
            value = self._operate("/", value, each(negative, other) if negate else other, at)
        return value

    def _power(self) -> Any:
        value = self._atom()
        if self._token(skip=False).text in ("^", "**", ".^") and self.tokens[self.i].kind == "sign":
            at = self._operator()
            self._count()
            return self._operate("^", value, self._signed(), at)
        return value

    def _count(self) -> None:
        self.parts += 1
        if self.parts > MOST_PARTS or self.depth > MOST_BRACKETS:
            what = f"at most {MOST_BRACKETS} nested brackets and entries of at most {MOST_PARTS} parts"
            self._refuse(f"must have {what}, but has more")

    # Atoms.

    def _atom(self) -> Any:
        self._count()
        kind, text, _ = self._token()
        at = self.i
        if kind == "number":
            self.i += 1
            return self._literal(text, at)
        if kind == "text":
            return self._quoted(text)
        if kind == "name":
            return self._named()
        if text in ("[", "{", "(/") or (text == "(" and self._is_tuple()):
            return self._array()
        if text == "(":
            closing = self.source.partner.get(at)
            if (
                closing is not None
                and closing == at + 2
                and CAST.fullmatch(self.tokens[at + 1].text)
                and self.language.rounds
            ):
                self.i = closing + 1  # (double) x
                return self._signed()
            return self._inside(self._sum)
        if text == "√":
            self.i += 1
            return self._apply("√", [self._atom()], at)
        if text in ("@", "\\", "&") and self.tokens[self.i + 1].kind == "name":
            self.i += 2  # a macro of Julia
            return self._sum() if text == "@" else self._refuse(at=at)
        return self._refuse()

    def _literal(self, text: str, at: int) -> Number:
        try:
            return literal(text)
        except ValueError:
            self._refuse(f"has {shorten(text)!r}", at)
        except ArithmeticError as error:
            self._refuse(str(error), at)

    def _quoted(self, text: str) -> Number:
        """A number in quotes: a//b, a/b or a decimal."""
        at, self.i = self.i, self.i + 1
        parts = [part.strip() for part in re.split(r"//?", text.strip("\"'"))]
        is_number = len(parts) <= 2 and all(re.fullmatch(r"[-+]?[\d.eE+-]+", part) for part in parts)
        if not is_number or (text.startswith("'") and self.tokens[at - 1].text != "("):
            self._refuse(at=at)
        numbers = [self._literal(part, at) for part in parts]
        return self._operate("/", numbers[0], numbers[1], at) if len(parts) == 2 else numbers[0]

    def _inside(self, rule: Callable[[], Any]) -> Any:
        """What is in brackets."""
        closing = OPENING[self.tokens[self.i].text]
        self.i += 1
        self.depth += 1
        display, self.is_display = self.is_display, False
        value = rule()
        if self._token().text != closing:
            self._refuse()
        self.i += 1
        self.depth -= 1
        self.is_display = display
        return value

    def _is_tuple(self) -> bool:
        """Whether a bracket here has a comma of its own."""
        end = self.source.partner.get(self.i)
        if end is None:
            return False
        i = self.i + 1
        while i < end:
            if self.tokens[i].text == "," and self.tokens[i].kind == "sign":
                return True
            i = self.source.partner.get(i, i) + 1 if self.tokens[i].text in OPENING else i + 1
        return False

    def _array(self) -> list[Any]:
        """An array in brackets: rows of entries."""
        closing = OPENING[self.tokens[self.i].text]
        is_spaced = self.language.spaced and closing == "]"
        self.i += 1
        self.depth += 1
        self._count()
        display, self.is_display = self.is_display, is_spaced
        rows: list[list[Any]] = [[]]
        expects = True  # an entry, behind a comma
        while self._token().text != closing or self.tokens[self.i].kind != "sign":
            kind, text, _ = self.tokens[self.i]
            if text == "," and kind == "sign" and not expects:
                expects = True
                self.i += 1
            elif is_spaced and (kind == "line" or text == ";") and self.i + 1 < len(self.tokens):
                if rows[-1] and not expects:
                    rows.append([])
                self.i += 1
            elif not (expects or is_spaced):
                self._refuse()
            else:
                rows[-1].append(self._entry())
                expects = False
        self.i += 1
        self.depth -= 1
        self.is_display = display
        if is_spaced:
            return assembled([row for row in rows if row])
        return Display(rows[0]) if self.language is LANGUAGES["python"] else rows[0]

    def _named(self) -> Any:
        """A name with members and indices, or a call."""
        at = self.i
        if self.language.has_rationals and self.tokens[at].text in ("big", "BigFloat"):
            quoted = self.tokens[at + 1]
            if quoted.kind == "text" and not self._is_spaced(at + 1):
                self.i += 1
                return self._quoted(quoted.text)
        path = self.path()
        called, text = path.rpartition(".")[2], self.tokens[self.i].text
        touches = not self._is_spaced(self.i)
        if text == "{" and self.language.has_rationals and touches:  # T{N}(x)
            self.i = self.source.partner.get(self.i, self.i) + 1
            text = self.tokens[self.i].text
        if text == "<" and called == "static_cast":
            while self.tokens[self.i].text not in ("(", ";") and self.tokens[self.i].kind != "line":
                self.i += 1
            text = self.tokens[self.i].text
        known = self.look_up(path)
        if text == "[" and self.language.called != "[" and known is None and self.language.spaced and touches:
            return self._array()  # an array of a type
        if (
            text == self.language.called
            and (known is None or self.language.indexed != "(")
            and (touches or self.language.first == 0)
        ):
            return self._call(called, at)
        if text == "." and self.tokens[self.i + 1].text == "(":  # f.(x)
            self.i += 1
            return self._call(called, at)
        if called in CIRCLE and known is None:
            return Number("pi", text="pi", estimate=math.pi)
        if known is None and self.language.rounds and path in WORDS:
            return Number(WORDS[path], text=path, line=self.source.line(self.tokens[at].start))
        if known is None or isinstance(known, Exception):
            self._refuse(at=at)
        return self._indexed(known, at)

    def path(self) -> str:
        """A name with its members, whose constant indices belong to it if more members follow."""
        parts = [self.tokens[self.i].text]
        self.i += 1
        while self.tokens[self.i].text in (".", "->", "%", "::") and self.tokens[self.i + 1].kind == "name":
            if self.language.spaced and self.tokens[self.i].text == "%":
                break
            if self.tokens[self.i + 1].text in METHODS:
                break
            parts.append(self.tokens[self.i + 1].text)
            self.i += 2
        return ".".join(parts)

    def _indexed(self, value: Any, at: int) -> Any:
        """An entry or a part of a value."""
        while self.tokens[self.i].text in self.language.indexed and not (self.is_display and self._is_spaced(self.i)):
            bracket = self.tokens[self.i].text
            indices = self.indices()
            if bracket == "{" or indices is None:
                self._refuse(at=at)
            value = self._part(value, indices, at)
        while self.tokens[self.i].text == "." and self.tokens[self.i + 1].text in METHODS:
            end = self.source.partner.get(self.i + 2)
            if end is None:
                self._refuse()
            self.i = end + 1
        return value

    def indices(self) -> list[Any] | None:
        """The indices in brackets here: numbers, pairs of the bounds of slices; None if they are no constants."""
        start, end = self.i, self.source.partner.get(self.i)
        if end is None:
            self._refuse()
        self.i = end + 1
        text = self.source.text[self.tokens[start].start + 1 : self.tokens[end].start]
        found: list[Any] = []
        for part in text.split(","):
            bounds = [bound.strip() for bound in part.split(":")]
            if bounds in (["end", "-1", "1"], ["end", "-1", "begin"], ["", "", "-1"]):
                found.append(REVERSED)
                continue
            if not all(re.fullmatch(r"(?:end(?:\s*-\s*\d{1,4})?|-?\d{1,6})?", bound) for bound in bounds):
                return None
            if len(bounds) > 2 or bounds == [""]:
                return None
            numbers = [place_of(bound) for bound in bounds]
            found.append(numbers[0] if len(numbers) == 1 else tuple(numbers))
        return found

    def _part(self, value: Any, indices: Iterable[Any], at: int) -> Any:
        first = self.language.first
        for depth, index in enumerate(indices):
            if depth and isinstance(index, int | tuple) and isinstance(value, Slice):
                value = [self._part(row, [index], at) for row in value]
                continue
            if not isinstance(value, list):
                self._refuse(at=at)
            if index is REVERSED:
                value = Slice(value[::-1])
                continue
            if isinstance(index, tuple):
                start, stop = index
                start = None if start is None else start - first if start >= 0 else start
                value = Slice(
                    value[start : stop if stop is None or first == 0 else stop if stop >= 0 else stop + 1 or None]
                )
                continue
            place = index - first if index >= 0 else index
            if not -len(value) <= place < len(value) or (place < 0 and index >= 0):
                self._refuse(f"has an index {index} beyond the {len(value)} entries of an array", at)
            value = value[place]
        return value

    def number_at(self, i: int) -> Number:
        """The number of one token."""
        return self._literal(self.tokens[i].text, i)._replace(
            text=self.tokens[i].text, line=self.source.line(self.tokens[i].start)
        )

    def negated(self, x: Number) -> Number:
        """The number with the other sign, as it was written."""
        return negative(x)._replace(text=f"-{x.text}")

    # Calls.

    def _call(self, name: str, at: int) -> Any:
        """The value of a function of values, which has to be known."""
        if name in ("zero", "one"):
            self.i = self.source.partner.get(self.i, self.i) + 1
            return FILLED[name]._replace(text=name, line=self.source.line(self.tokens[at].start))
        if name.endswith("Alloc"):
            arguments = self._arguments(skips=True)
            stages = next((x.value for x in arguments if isinstance(x, Number)), None)
            if isinstance(stages, Fraction) and stages.denominator == 1 and 0 < stages < MOST_ENTRIES:
                return Struct(int(stages))
            self._refuse(at=at)
        known = name in (*KEPT_LAST, *KEPT_FIRST, *FUNCTIONS, *POWERS, *QUOTIENTS, *FILLED)
        if not (known or CAST.fullmatch(name)):
            self._refuse(at=at)
        arguments = self._arguments(last_only=name in KEPT_LAST, skips=name in FILLED)
        values = [x for x in arguments if isinstance(x, Number | list)]
        if name in FILLED and (name not in ("Matrix", "Vector", "Array") or self._is_undefined(at)):
            return self._filled(FILLED[name], values, at)
        if name in KEPT_LAST and values:
            return values[-1]
        if name in KEPT_FIRST and values:
            kept = self._reshaped(values) if name == "reshape" else values[0]
            return list(kept) if isinstance(kept, Display) else kept
        if name in QUOTIENTS and len(values) == 2:
            return self._apply(name, values, at)
        if name in FUNCTIONS or name in POWERS:
            return self._apply(name, values, at)
        if len(values) == 1 and len(arguments) <= 2:
            return values[0]
        if "Matrix" in name and math.isqrt(len(values)) ** 2 == len(values):  # by columns
            return [values[i :: math.isqrt(len(values))] for i in range(math.isqrt(len(values)))]
        if "Vector" in name:
            return values
        return self._refuse(at=at)

    def arguments(self, opening: int) -> list[Any]:
        """The values among the arguments in brackets."""
        self.i, self.depth, self.entries, self.parts, self.is_display = opening, 0, 0, 0, False
        return self._arguments(skips=True)

    def _is_undefined(self, at: int) -> bool:
        """Whether a call makes an array without entries."""
        return any(token.text == "undef" for token in self.tokens[at : self.i])

    def _apply(self, name: str, values: list[Any], at: int) -> Any:
        if not values or not all(isinstance(x, Number) for x in values):
            self._refuse(at=at)
        try:
            return apply(name, values)
        except (ArithmeticError, ValueError) as error:
            self._refuse(str(error) if isinstance(error, ArithmeticError) else "", at)

    def _arguments(self, *, last_only: bool = False, skips: bool = False) -> list[Any]:
        """The arguments of a call that are values; keywords are left out, and names without values on request."""
        opening, end = self.i, self.source.partner.get(self.i)
        if end is None:
            self._refuse()
        self.depth += 1
        self._count()
        display, self.is_display = self.is_display, False
        found: list[Any] = []
        parts = self._argument_starts(opening, end)
        for start in parts[-1:] if last_only else parts:
            self.i = start
            if self.tokens[start].kind == "name" and self.tokens[start + 1].text == "=":
                continue
            if skips and self.tokens[start].text == ":":
                continue  # a symbol of Julia
            known = self.look_up(self.tokens[start].text) if self.tokens[start].kind == "name" else 0
            if (
                skips
                and (known is None or isinstance(known, Exception))
                and self.tokens[start + 1].text in (",", ")", "{", "]")
            ):
                continue
            if self.tokens[start].text == "&":
                self.i += 1
            value = self._sum()
            if self._token().text not in (",", ";", ")", "]") and self.i != end:
                self._refuse()
            found.append(value)
        self.i = end + 1
        self.depth -= 1
        self.is_display = display
        return found

    def _argument_starts(self, opening: int, end: int) -> list[int]:
        """The indices of the first tokens of arguments."""
        starts, i, expects = [], opening + 1, True
        while i < end:
            token = self.tokens[i]
            if token.text in (",", ";") and token.kind == "sign":
                expects = True
            elif token.kind != "line" and expects:
                starts.append(i)
                expects = False
            i = self.source.partner.get(i, i) + 1 if token.text in OPENING and token.kind == "sign" else i + 1
        return starts

    def _filled(self, number: Number, sizes: list[Any], at: int) -> Any:
        """An array of equal numbers."""
        flat = sizes[0] if sizes and isinstance(sizes[0], list) else sizes
        shape = []
        for size in flat:
            value = size.value if isinstance(size, Number) else None
            if not isinstance(value, Fraction) or value.denominator > 1 or not 0 <= value <= MOST_ENTRIES:
                self._refuse(at=at)
            shape.append(int(value))
        if len(shape) == 1 and self.language is LANGUAGES["matlab"]:
            shape *= 2
        if not shape or math.prod(shape) > MOST_ENTRIES:
            self._refuse(at=at)
        line = self.source.line(self.tokens[at].start)
        return constant(shape, number._replace(text=self.tokens[at].text, line=line))

    def _reshaped(self, values: list[Any]) -> Any:
        """A list as columns (Fortran) of a matrix."""
        entries, shape = values[0], values[1] if len(values) > 1 else None
        if not isinstance(shape, list) or len(shape) != 2 or not all(isinstance(x, Number) for x in shape):
            return entries
        rows, columns = (int(x.value) for x in shape)  # type: ignore[arg-type]
        if len(entries) != rows * columns or any(isinstance(x, list) for x in entries):
            self._refuse(f"has {len(entries)} entries for a matrix of {rows} rows and {columns} columns")
        if self.language.first == 0:
            return [entries[i * columns : (i + 1) * columns] for i in range(rows)]
        return [entries[i::rows] for i in range(rows)]
