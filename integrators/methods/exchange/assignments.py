"""Assignments in source text, by blocks: what every name has been given, exactly, and where."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from integrators.core.errors import IntegratorError
from integrators.methods.exchange.arrays import copied, is_constant, put
from integrators.methods.exchange.numbers import ONE, ZERO, Number
from integrators.methods.exchange.tokens import LANGUAGES, MOST_UNCLOSED, OPENING, Source, Token
from integrators.methods.exchange.values import MOST_ENTRIES, Reader, Unread

LARGEST_INDEX = 1000
START = {"t": ZERO, "h": ONE, "dt": ONE, "x": ONE, "y": ONE, "u": ONE}
"""The time, the length and the state of a step, as steps are written."""
CONSTRUCTORS = {
    "SplittingCoefficientsGeneral": ("a", "b"),
    "SplittingCoefficientsNonSymmetric": ("method", "adjoint"),
    "SplittingCoefficientsSS": ("half",),
}
"""Of GeometricIntegrators.jl: times of two flows; of a method and its adjoint; half of those of symmetric steps."""
MOST_STAGES = 200
MOST_DECLARED = 200
"""Tokens before a name that are searched for its type."""
MOST_BLOCKS = 200
"""Of nested blocks; blocks further inside have no names of their own."""


class Unknown(NamedTuple):
    """Something that could not be read as a value."""

    what: str
    """The predicate of a sentence."""


class Variable:
    """A name, and the value or the entries that it has been given."""

    def __init__(self, name: str, line: int) -> None:
        self.name = name
        self.line = line
        self.value: Any = None
        self.entries: dict[tuple[int, ...], Number] = {}
        """By index, if there is no value."""
        self.shape: tuple[int, ...] | None = None
        """The declared sizes."""
        self.times = 0
        """How often it was assigned as a whole, or changed after that."""
        self.is_filled = False
        """Whether its value is zeros, whose entries follow."""
        self.is_moved = False
        """Whether its value is that of another name."""

    def dense(self, first: int) -> Any:
        """The value; entries by index become nested lists."""
        if self.value is not None or not self.entries:
            return self.value
        if len({len(index) for index in self.entries}) > 1:
            return Unknown("has entries of one and of two indices")
        rank = len(next(iter(self.entries)))
        shape = self.shape or tuple(max(index[k] for index in self.entries) + 1 - first for k in range(rank))
        return _nested(shape, self.entries, first)


def _nested(
    shape: tuple[int, ...], entries: dict[tuple[int, ...], Number], first: int, *, at: tuple[int, ...] = ()
) -> Any:
    if not shape:
        return entries.get(at, ZERO)
    return [_nested(shape[1:], entries, first, at=(*at, i + first)) for i in range(shape[0])]


class Block:
    """A function, a pair of brackets or a file, with the variables assigned in it, one table for each method."""

    def __init__(
        self, name: str, start: int, parent: Block | None, *, end: int | None = None, indent: int = -1
    ) -> None:
        self.name = name
        self.start = start
        self.end = end
        self.parent = parent
        self.indent = indent
        self.depth: int = parent.depth + 1 if parent else 0
        self.tables: list[dict[str, Variable]] = [{}]
        self.starts: list[int] = [start]
        """The tokens from which the tables are."""

        self.stages: list[tuple[Number, list[Number]]] = []
        """For methods written as steps: the time and the state at which the field is evaluated. With h = 1, a state is
        the row of its coefficients of the first state and of the stages before."""
        self.most_stages = 0

    def find(self, name: str) -> Variable | None:
        """The variable of this name here or around."""
        block: Block | None = self
        while block is not None:
            for table in reversed(block.tables):
                if name in table:
                    return table[name]
            if block.most_stages and name in START:
                found = Variable(name, 0)
                found.value = START[name] if name in ("t", "h", "dt") else block.unit(0)
                return found
            block = block.parent
        return None

    def unit(self, k: int) -> list[Number]:
        """The state at the start for 0, the field at stage k otherwise."""
        return [ONE if i == k else ZERO for i in range(self.most_stages + 1)]


class Assignments:
    """Reads the assignments of a source; `blocks` are those that have some."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.language = source.language
        self.tokens = source.tokens
        self.block = Block("", 0, None, end=len(self.tokens))
        self.blocks: list[Block] = []
        self.reader = Reader(source, self._value)
        self._walk()

    def _value(self, name: str) -> Any:
        """What a value may use a name for."""
        found = self.block.find(name)
        if found is None:
            return None
        value = found.dense(self.language.first)
        return Unread(0, value.what) if isinstance(value, Unknown) else value

    # Blocks.

    def _walk(self) -> None:
        i, tokens = 0, self.tokens
        is_new_line = True
        last = len(tokens) - 1
        while i < last:
            kind, text, _ = tokens[i]
            while self.block.end is not None and i >= self.block.end and self.block.parent is not None:
                self._close(i)
            if kind == "line":
                is_new_line = True
                i += 1
                continue
            if is_new_line:
                self._indented(i)
                is_new_line = False
                if self._begins_section(i):
                    self._open_section(i)
            if kind == "sign":
                if text in OPENING:
                    if text == "{" and (end := self._initialised(i)) is not None:
                        i = end
                        continue
                    self._open(i)
                elif text == "#" and tokens[i + 1].text == "define" and tokens[i + 2].kind == "name":
                    self._read(tokens[i + 2].text, [], i + 2, is_line=True)
                    i += 2
                elif (end := self._assigned(i, text)) is not None:
                    i = end
                    continue
            elif kind == "name" and text.lower() == "call" and self.language.indexed == "(":
                self._evaluate(i)
            elif kind == "name" and text in CONSTRUCTORS and tokens[i + 1].text == "(":
                self._construct(i)
            elif kind == "name" and text.lower() == "data" and self.language.indexed == "(":
                end = self._data(i)
                if end is not None:
                    i = end
                    continue
            i += 1
        while self.block.parent is not None:
            self._close(last)
        self._close(last)

    def _close(self, i: int) -> None:
        """Leave a block, which ends at a token unless it has an end."""
        self.block.end = self.block.end or i
        if any(self.block.tables):
            self.blocks.append(self.block)
        if self.block.parent is not None:
            self.block = self.block.parent

    def _open(self, i: int) -> None:
        """A bracket that is not an index becomes a block, which lasts to its partner."""
        end = self.source.partner.get(i)
        if self.tokens[i - 1].text.lower() in ("associate", "parameter") and i:
            return  # its names are those of the subroutine
        if end is None or self.block.depth >= MOST_BLOCKS or self.tokens[i].text == "[" or end == i + 1:
            return
        self.block = Block(self._title(i), i, self.block, end=end, indent=self.block.indent)

    def _begins_section(self, i: int) -> bool:
        """Whether a line is a header of TOML, with an assignment in the next line."""
        end = self.source.partner.get(i, i)
        behind = self.tokens[end + 1 : end + 4]
        return (
            self.tokens[i].text == "["
            and self.language is LANGUAGES["python"]
            and self.source.column(self.tokens[i].start) == 0
            and [token.kind for token in behind[:2]] in (["line", "name"], ["line", "text"])
            and behind[2].text in ("=", ".")
        )

    def _open_section(self, i: int) -> None:
        """A block from a header of TOML to the next one; its name is the last part of the header."""
        if self.block.parent is not None:
            self._close(i)
        names = [token.text for token in self.tokens[i : self.source.partner[i]] if token.kind in ("name", "text")]
        self.block = Block(names[-1].strip("\"'") if names else "", i, self.block, end=len(self.tokens))

    def _title(self, i: int) -> str:
        """The name of the block that a bracket opens: of a function, a macro, or what it is assigned to."""
        before = i - 1
        while before > 0 and self.tokens[before].kind == "line":
            before -= 1
        text = self.tokens[before].text
        if text == ")" and before in self.source.partner:
            before = self.source.partner[before] - 1
            return self.tokens[before].text if before >= 0 and self.tokens[before].kind == "name" else ""
        if text == "," and self.block.start < before:  # MACRO(NAME, { … })
            first = self.tokens[self.block.start + 1]
            return first.text if first.kind == "name" else ""
        while before > 0 and (self.tokens[before].kind == "name" or self.tokens[before].text in (".", "::", "}", "{")):
            before -= 1
        if self.tokens[before].text in ("=", ":") and before > 0:
            name = self.tokens[before - 1]
            return name.text.strip("\"'") if name.kind in ("name", "text") else ""
        return ""

    def _indented(self, i: int) -> None:
        """Close the functions that end at a line, and open one that starts there."""
        if self.language.opens == "(?!)":
            return
        column = self.source.column(self.tokens[i].start)
        words = [token.text for token in self.tokens[i : i + 8]]
        opener = next(
            (k for k, word in enumerate(words[:4]) if re.fullmatch(self.language.opens, word, re.IGNORECASE)), None
        )
        ends = re.fullmatch("end.*", words[0], re.IGNORECASE) is not None
        while self.block.end is None and column <= self.block.indent:
            if not (opener is not None or ends or self.language.first == 0):
                break
            self._close(i)
            if ends:
                break
        if opener is None or ends or self.block.end not in (None, len(self.tokens)):
            return
        start = i + opener + 1
        if self.language is LANGUAGES["matlab"] and self.tokens[start].text == "[" and start in self.source.partner:
            start = self.source.partner[start] + 2  # function [A, b] = name
        name = next((t.text for t in self.tokens[start : start + 7] if t.kind == "name"), "")
        if "=" in words[1 : opener + 1] or "." in words[:opener]:
            return
        self.block = Block(name, i, self.block, indent=column)
        if self.language.indexed == "(":
            self.block.most_stages = self._count_calls(i + opener + 1)

    # Steps.

    def _count_calls(self, i: int) -> int:
        """The number of calls of a subroutine, up to the end of it."""
        count = 0
        for k in range(i, len(self.tokens)):
            text = self.tokens[k].text.lower()
            if text in ("subroutine", "procedure", "function"):
                break
            count += text == "call"
        return min(count, MOST_STAGES)

    def _evaluate(self, i: int) -> None:
        """A call of a field at a time and a state, whose last argument gets the value."""
        block: Block | None = self.block
        while block is not None and not block.most_stages:
            block = block.parent
        opening = next((k for k in range(i + 1, i + 6) if self.tokens[k].text == "("), None)
        if block is None or opening is None or len(block.stages) >= block.most_stages:
            return
        try:
            found = self.reader.arguments(opening)
        except Unread:
            return
        match found:
            case [Number() as time, list() as state, *_] if len(state) == block.most_stages + 1:
                block.stages.append((time, state))
                end = self.source.partner[opening]
                target = Variable(self.tokens[end - 1].text, self.source.line(self.tokens[i].start))
                target.value = block.unit(len(block.stages))
                block.tables[-1][target.name] = target

    def _construct(self, i: int) -> None:
        """A call of a constructor whose last arguments are rows of times, which get names in this block."""
        try:
            rows = [x for x in self.reader.arguments(i + 1) if isinstance(x, list)]
        except Unread:
            return
        names = CONSTRUCTORS[self.tokens[i].text]
        for name, row in zip(names, rows if len(rows) == len(names) else (), strict=False):
            variable = Variable(f"{self.tokens[i].text}.{name}", self.source.line(self.tokens[i].start))
            variable.value = row
            self.block.tables[-1][variable.name] = variable

    def _initialised(self, i: int) -> int | None:
        """Read what a declaration of C++ gives in braces, as in `double b[2]{0.5, 0.5}`; the index behind it."""
        target = self._target(i) if self.language.rounds and self.language.first == 0 else None
        if target is None or not self._declares(self._start_of_name(i - 1)):
            return None
        name, indices, is_declared = target
        try:
            value = self.reader.read(i)
        except (Unread, RecursionError):
            return None
        end = self.reader.i
        self._assign(name, indices, value, i, is_declared=is_declared)
        return end

    def _start_of_name(self, j: int) -> int:
        """The index of a name in front of its sizes, which end at a token."""
        while self.tokens[j].text == "]" and j in self.source.partner:
            j = self.source.partner[j] - 1
        return j

    def _assigned(self, i: int, sign: str) -> int | None:
        """Read what is assigned at a sign; the index behind it, or None if that cannot be read."""
        if sign not in ("=", ":=", ":", ".=", "->", "=>") or i == 0 or (sign == "=>" and self.language.indexed != "("):
            return None
        if sign in (":", "->") and not self._is_key(i, sign):
            return None
        target = self._target(i)
        if target is None:
            return None
        name, indices, is_declared = target
        return self._read(name, indices, i, is_declared=is_declared)

    def _read(
        self, name: str, indices: list[Any], i: int, *, is_declared: bool = False, is_line: bool = False
    ) -> int | None:
        """Assign the value behind a token; the index behind it, or None if it could not be read."""
        try:
            value = self.reader.read(i + 1, in_line=is_line)
            end: int | None = self.reader.i
            if is_line and any(token.text in "+-" and token.kind == "sign" for token in self._outside(i + 2, end)):
                value = Unknown("is a macro of a sum without brackets")
        except Unread as error:
            value, end = Unknown(str(error)), None
            if self.tokens[i + 1].text == name and self.tokens[i + 2].text in (";", ",", ")", "\n", ""):
                value = None  # itself
        except RecursionError:
            value, end = Unknown("has too many nested brackets"), None
        self._assign(name, indices, value, i, is_declared=is_declared)
        return end

    def _outside(self, i: int, end: int) -> Iterator[Token]:
        """The tokens that are in no brackets."""
        while i < end:
            yield self.tokens[i]
            i = self.source.partner.get(i, i) + 1 if self.tokens[i].text in OPENING else i + 1

    def _is_key(self, i: int, sign: str) -> bool:
        """Whether a sign stands between a key and its value."""
        before = self.tokens[i - 1]
        if sign == "->":
            return self.language.called == "[" and before.kind == "name"
        return before.kind == "text" and self.tokens[self.block.start].text == "{" and self.language.first == 0

    def _target(self, i: int) -> tuple[str, list[Any], bool] | None:
        """The name before a sign, with members, its indices, and whether it is declared with sizes."""
        j = i - 1
        if self.tokens[j].kind == "text":
            name = self.tokens[j].text.strip("\"'")
            return (name, [], False) if name else None
        annotated = self._annotated(i)
        if annotated is not None:
            return annotated, [], False
        opened: list[int] = []
        while self.tokens[j].text in ("]", ")", "}") and j in self.source.partner:
            start = self.source.partner[j]
            if self.tokens[start].text not in self.language.indexed + ("[" if self.language.first == 0 else ""):
                return None
            opened.insert(0, start)
            j = start - 1
        if self.tokens[j].kind != "name":
            return None
        parts = [self.tokens[j].text]
        while j >= 2 and self.tokens[j - 1].text in (".", "->", "%", "::"):
            if self.tokens[j - 1].text == "::" and self.language.rounds and self.language.indexed == "(":
                break
            k = j - 2
            while self.tokens[k].text in ("]", ")") and k in self.source.partner:
                k = self.source.partner[k] - 1
            if self.tokens[k].kind != "name":
                break
            parts.insert(0, "".join(t.text for t in self.tokens[k : j - 1]))
            j = k
        is_declared = bool(opened) and self._declares(j)
        indices: list[Any] = []
        for start in opened:
            self.reader.i = start
            found = None if self.source.partner[start] == start + 1 else self.reader.indices()
            if found is None and not is_declared:
                return ".".join(parts), [None], False
            indices += found or [0]  # a size that is not given
        return ".".join(parts), indices, is_declared

    def _declares(self, j: int) -> bool:
        """Whether a name with brackets is declared here, with sizes."""
        if self.language.indexed == "(":
            return self._is_declaration(j)
        k = self._before(j)
        before = self.tokens[k]
        if k < 0 or not self.language.rounds:
            return False
        if before.kind == "name" or before.text in ("*", "&", ">"):
            return before.text != "return"
        return before.text == "," and self._is_declaration(k)

    def _before(self, j: int) -> int:
        """The index of the token before another that is not the end of a line."""
        j -= 1
        while j > 0 and self.tokens[j].kind == "line":
            j -= 1
        return j

    def _annotated(self, i: int) -> str | None:
        """The name in front of an annotation `name: type =` or `name::type =`."""
        if self.language.rounds or self.tokens[i].text != "=":
            return None
        j = i - 1
        while j > self.block.start and self.tokens[j].kind != "line" and self.tokens[j].text not in ("=", ";"):
            token, name = self.tokens[j], self.tokens[j - 1]
            starts = j < 2 or self.tokens[j - 2].kind == "line" or self.tokens[j - 2].text in (";", ",", "(", "const")
            if token.kind == "sign" and token.text in (":", "::") and name.kind == "name" and starts:
                return name.text
            j = self.source.partner.get(j, j) - 1
        return None

    def _is_declaration(self, j: int) -> bool:
        """Whether the statement of a token declares names: it starts with two words, or has ``::``."""
        for _ in range(MOST_DECLARED):
            token = self.tokens[j]
            before = j - 1 if self.language.ends_with_line else self._before(j)
            if token.text in (")", "]", "}") and j in self.source.partner:
                before = self.source.partner[j]
            elif token.text in (";", "{", "(") or j <= 0 or (token.kind == "line" and self.language.ends_with_line):
                return False
            elif (token.text == "::" and self.language.indexed == "(") or token.kind == self.tokens[
                before
            ].kind == "name":
                return True
            j = before
            if self.tokens[j].text in ("(", "[", "{"):
                j = j - 1 if self.language.ends_with_line else self._before(j)
        return False

    def _assign(self, name: str, indices: list[Any], value: Any, i: int, *, is_declared: bool) -> None:
        line = self.source.line(self.tokens[i].start)
        table = self.block.tables[-1]
        known = self.block.find(name) if indices and not is_declared else table.get(name)
        variable = known
        if variable is None:
            variable = table[name] = Variable(name, line)
        if indices and not is_declared:
            self._change(variable, indices, value)
            return
        if isinstance(value, Unknown) and isinstance(variable.value, list | Unknown) and self._mentions(i, name):
            return  # converted numbers
        is_conversion = self._mentions(i, name)
        is_next = isinstance(value, list) and not variable.is_filled and self._is_table(variable)
        if is_next and not is_conversion:
            self.block.tables.append({})
            self.block.starts.append(i)
            variable = self.block.tables[-1][name] = Variable(name, line)
        if not is_conversion or variable.value is None:
            variable.times += value is not None
            variable.line = line
        is_name = self.tokens[i + 1].kind == "name" and self.reader.i == i + 2
        variable.is_moved = is_name and not isinstance(value, Unknown)
        variable.is_filled = is_constant(value)
        variable.value = copied(value)
        if is_declared and all(isinstance(size, int) for size in indices) and any(indices):
            variable.shape = tuple(indices)
            variable.value = _declared(value, indices)

    def _is_table(self, variable: Variable) -> bool:
        """Whether an array has rows: another one in its place belongs to the next method."""
        return isinstance(variable.value, list) and any(isinstance(row, list) for row in variable.value)

    def _mentions(self, i: int, name: str) -> bool:
        """Whether a call converts the value of a name, as in a = map(T, a)."""
        j = i + 1
        names = set()
        while j < i + 12 and self.tokens[j].kind != "line" and self.tokens[j].text != ";":
            names.add(self.tokens[j].text)
            j += 1
        return name.rpartition(".")[2] in names and "[" not in names and not names & set("+-*/")

    def _change(self, variable: Variable, indices: list[Any], value: Any) -> None:
        """Assign an entry or a part of an array."""
        first = self.language.first
        if None in indices or isinstance(value, Unknown):
            if not any(isinstance(index, int) for index in indices) or isinstance(value, Unknown):
                variable.value = value if isinstance(value, Unknown) else Unknown("has indices that are no numbers")
            return
        if isinstance(variable.value, Unknown) or value is None:
            return
        if isinstance(variable.value, Number) and not variable.value.value:
            variable.value = None  # A = 0 fills an array
        if isinstance(variable.value, list):
            if not variable.is_filled:
                variable.times += 1
            if not put(variable.value, indices, value, first):
                variable.value = Unknown(f"has no entry {_shown(indices)}")
            return
        if not all(isinstance(index, int) and 0 <= index <= LARGEST_INDEX for index in indices):
            variable.value = Unknown(f"has an index beyond {LARGEST_INDEX} or before 0")
        elif isinstance(value, Number) and len(variable.entries) < MOST_ENTRIES:
            variable.entries[tuple(indices)] = value
        elif isinstance(value, list) and all(isinstance(x, Number) for x in value):
            for k, x in enumerate(value):
                variable.entries[(*indices, k + first)] = x

    def _data(self, i: int) -> int | None:
        """Read ``data a /1, 2, 3/`` of Fortran."""
        name, opening = self.tokens[i + 1], self.tokens[i + 2]
        if name.kind != "name" or opening.text != "/":
            return None
        values, j, sign = [], i + 3, 1
        try:
            while j < len(self.tokens) and self.tokens[j].text != "/" and self.tokens[j].kind != "line":
                token = self.tokens[j]
                if token.kind == "number":
                    self.reader.i = j
                    number = self.reader.number_at(j)
                    values.append(number if sign > 0 else self.reader.negated(number))
                    sign = 1
                elif token.text == "-":
                    sign = -sign
                elif token.text not in (",", "+"):
                    return None
                j += 1
        except Unread:
            return None
        self._assign(
            name.text, [], values if len(values) > 1 else values[0] if values else None, i + 2, is_declared=False
        )
        return j + 1


def _shown(indices: list[Any]) -> str:
    return "[" + ", ".join(map(str, indices)) + "]"


def _declared(value: Any, shape: list[int]) -> Any:
    """An array of a declared shape: missing entries are zeros, and more are a fault."""
    if not isinstance(value, list) or not shape:
        return value
    if shape[0] and len(value) > shape[0]:
        flat = len(shape) > 1 and not any(isinstance(x, list) for x in value)
        if flat and len(value) <= shape[0] * shape[1]:
            value = [value[k * shape[1] : (k + 1) * shape[1]] for k in range(shape[0])]
        else:
            return Unknown(f"has {len(value)} entries, but is declared with {shape[0]}")
    rows = [_declared(row, shape[1:]) for row in value]
    wrong = next((row for row in rows if isinstance(row, Unknown)), None)
    if wrong is not None:
        return wrong
    if len(shape) == 1:
        return rows + [ZERO] * min(shape[0] - len(rows), MOST_ENTRIES)
    return rows + [[ZERO] * shape[1] for _ in range(min(shape[0] - len(rows), LARGEST_INDEX))]


def read_arrays(text: str, names: Iterable[str], language: str) -> dict[str, Any]:
    """The values that a text assigns to names, each once, as nested lists of numbers.

    Example:
        >>> found = read_arrays("A = [0 0; 1//2 0]; b = [0, 1] # weights", ["A", "b"], "julia")
        >>> str(found["A"][1][0].value)
        '1/2'
    """
    source = Source(text, LANGUAGES[language])
    if source.unclosed > MOST_UNCLOSED:
        raise IntegratorError(f"text must have brackets that are closed, but {source.unclosed:,} are not")
    tables = [table for block in Assignments(source).blocks for table in block.tables]
    found = {}
    for name in names:
        variables = [table[name] for table in tables if name in table]
        given = [(v, v.dense(source.language.first)) for v in variables if not v.is_moved]
        given = [(variable, value) for variable, value in given if value is not None]
        if len(given) > 1 or any(variable.times > 1 for variable, _ in given):
            raise IntegratorError(f"{name} must be assigned once, as a whole, but was more than once")
        for _, value in given:
            if isinstance(value, Unknown):
                what = "must be an array of numbers, with + - * /, sqrt and cosines only, but "
                raise IntegratorError(f"{name} {what if value.what.startswith('has') else ''}{value.what}")
            found[name] = value
    return found
