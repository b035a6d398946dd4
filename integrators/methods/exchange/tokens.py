"""Source text as tokens: numbers, names, text in quotes, brackets and operators, in several languages."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from functools import cache
from pathlib import PurePath
from typing import NamedTuple

QUOTED = r'"(?:\\.|[^"\\\n])*+(?:"|(?=\n)|\Z)'
"""Text without a closing quote ends with the line: nothing is scanned twice."""
SINGLE = r"'(?:\\.|[^'\\\n])*+(?:'|(?=\n)|\Z)"
TRIPLE = r'"""(?:.*?"""|.*)'
NAME = r"[^\W\d][\w\u0300-\u036f]*[′!]*"


class Language(NamedTuple):
    """How a language writes assignments and arrays."""

    comment: str
    quoted: str
    exponent: str = "[eE]"
    suffix: str = ""
    """A pattern of what ends a number: its kind, which is dropped."""
    continued: str = r"(?!)"
    """A pattern of what joins lines."""
    name: str = NAME
    first: int = 1
    """The first index of arrays."""
    ends_with_line: bool = True
    spaced: bool = False
    """Whether spaces and lines separate the entries and rows of arrays."""
    called: str = "("
    """The brackets of calls."""
    indexed: str = "["
    rounds: bool = False
    """Whether quotients of integers are integers."""
    has_rationals: bool = False
    opens: str = r"(?!)"
    """A pattern of the keyword of a block that ends with its indentation."""


LANGUAGES = {
    "c": Language(
        r"/\*.*?(?:\*/|\Z)|//[^\n]*", f"{QUOTED}|{SINGLE}", suffix="(?:[fFlLuUqQ]+|_[a-z]+)?(?![\\w.])",
        continued=r"\\\r?\n", first=0, ends_with_line=False, rounds=True),
    "julia": Language(
        r"#=.*?(?:=#|\Z)|#[^\n]*", rf"{TRIPLE}|{QUOTED}", exponent="[ef]", spaced=True, has_rationals=True,
        opens="function|macro|struct"),
    "python": Language(
        r"#[^\n]*", suffix="[jJ]?",
        quoted=rf"{TRIPLE}|'''(?:.*?'''|.*)|{QUOTED}|{SINGLE}", continued=r"\\\r?\n", first=0, opens="def|class"),
    "fortran": Language(
        r"![^\n]*|^[*cC](?=[ \t]|$)[^\n]*", rf"{QUOTED}|{SINGLE}", exponent="[eEdDqQ]", suffix=r"(?:_\w+)?",
        continued=r"&[ \t]*(?:![^\n]*)?\r?\n(?:[ \t]*(?:![^\n]*)?\r?\n)*[ \t]*&?|\r?\n[ ]{5}[^\s0!]", indexed="(",
        rounds=True, opens="subroutine|function|procedure|program"),
    "matlab": Language(
        r"%\{\s*?\n.*?(?:%\}|\Z)|[%#][^\n]*", rf"{QUOTED}|(?<![\w)\]}}'.]){SINGLE}", exponent="[eEdD]",
        continued=r"\.\.\.[^\n]*\n", spaced=True, indexed="({", opens="function"),
    "mathematica": Language(
        r"\(\*.*?(?:\*\)|\Z)", QUOTED, exponent=r"\*\^", suffix=r"(?:`[\d.]*)?", name=r"[^\W\d_]\w*",
        called="[", ends_with_line=True),
}  # fmt: skip
SUFFIXES = {
    **dict.fromkeys((".c", ".h", ".cc", ".cpp", ".cxx", ".hpp", ".hh", ".cu", ".def", ".inc", ".java", ".rs"), "c"),
    **dict.fromkeys((".f", ".f90", ".f95", ".f03", ".f08", ".for"), "fortran"),
    **dict.fromkeys((".py", ".pyi", ".json", ".toml", ".csv", ".txt", ".ipynb"), "python"),
    **dict.fromkeys((".wl", ".wls", ".nb"), "mathematica"),
    ".jl": "julia",
    ".m": "matlab",
}
SIGNS = r"\*\*|->|::|:=|=>|==|!=|~=|<=|>=|&&|\|\||\+=|-=|\*=|/=|//=|\.=|//|/\)|\(/(?!/)|\.[-+*/^]|\S"


MOST_UNCLOSED = 1000
"""Brackets without partners: a text with more is no source."""
MOST_COMMENTS = 40
MOST_CHARACTERS_SAID = 4000


class Token(NamedTuple):
    """A piece of text."""

    kind: str  # number, name, text, line or sign
    text: str
    start: int


@cache
def _pattern(language: Language) -> re.Pattern[str]:
    digits = r"\d++(?:_\d++)*+"
    point = r"\.(?![.*/^\\'])" if language.spaced else r"\.(?!\.)"  # 1./x divides entries of arrays
    exponent = f"(?:{language.exponent}[-+]?\\d++)?"
    return re.compile(
        rf"(?P<comment>{language.comment})|(?P<text>{language.quoted})|(?P<joined>{language.continued})"
        rf"|(?P<line>\r?\n)|(?P<number>(?:{digits}(?:{point}(?:{digits})?)?|\.{digits}){exponent}{language.suffix})"
        rf"|(?P<name>{language.name})|(?P<sign>{SIGNS})|[ \t\f\v\xa0]++",
        re.DOTALL | re.MULTILINE,
    )


class Source:
    """The tokens of a text, the brackets that match, and its comments."""

    def __init__(self, text: str, language: Language, name: str = "text") -> None:
        self.text = text
        self.language = language
        self.name = name
        self.comments: list[tuple[int, int]] = []
        self.tokens: list[Token] = list(self._scan())
        self.tokens.append(Token("line", "", len(text)))
        self.starts = [token.start for token in self.tokens]
        self._lines = [match.start() for match in re.finditer("\n", text)]
        self.partner: dict[int, int] = {}
        """From an opening bracket's index to that of its closing bracket, and back."""
        opened: list[int] = []
        for i, (kind, sign, _) in enumerate(self.tokens):
            if kind == "sign" and sign in OPENING:
                opened.append(i)
            elif kind == "sign" and sign in CLOSING and opened and OPENING[self.tokens[opened[-1]].text] == sign:
                self.partner[i] = opened.pop()
                self.partner[self.partner[i]] = i
        self.unclosed = len(opened)
        """The number of brackets without partners."""

    def _scan(self) -> Iterator[Token]:
        for match in _pattern(self.language).finditer(self.text):
            kind = match.lastgroup
            if kind == "comment":
                self.comments.append(match.span())
            elif kind is not None and kind != "joined":
                yield Token(kind, match[0], match.start())

    def line(self, start: int) -> int:
        """The number of the line of a position, from 1."""
        return bisect_right(self._lines, start - 1) + 1

    def comment(self, start: int) -> str:
        """The comment or text in quotes that ends before a position, or that stands behind it in its line."""
        k = bisect_right(self.comments, (start, 0))
        found, end = [], self.text.rfind("\n", 0, start) + 1
        while k > 0 and not self.text[self.comments[k - 1][1] : end].strip() and len(found) < MOST_COMMENTS:
            k -= 1
            begin = self.comments[k][0]
            found.insert(0, self.text[begin : self.comments[k][1]])
            end = self.text.rfind("\n", 0, begin) + 1
            if self.text[end:begin].strip():
                break
        i = bisect_right(self.starts, start) - 1
        while i > 0 and self.tokens[i - 1].kind == "line":
            i -= 1
        while (
            i > 0
            and self.column(self.tokens[i].start)
            and self.tokens[i].kind != "text"
            and self.tokens[i - 1].kind != "line"
        ):
            i -= 1
        if not found and i > 0 and self.tokens[i - 1].kind == "text":
            found = [self.tokens[i - 1].text]
        behind = bisect_right(self.comments, (start, 0))
        if behind < len(self.comments) and "\n" not in self.text[start : self.comments[behind][0]]:
            found.append(self.text[slice(*self.comments[behind])])
        return "\n".join(found)[:MOST_CHARACTERS_SAID]

    def leading_comment(self, i: int) -> str:
        """The comments or the text in quotes with which the body of a block begins, behind the head at a token."""
        while self.tokens[i].kind != "line" and self.tokens[i].text != "{" and i + 1 < len(self.tokens):
            i = self.partner.get(i, i) + 1 if self.tokens[i].text in OPENING else i + 1
        end, found = self.tokens[i].start + len(self.tokens[i].text), []
        while i + 1 < len(self.tokens) and self.tokens[i].kind == "line":
            i += 1
        if self.tokens[i].kind == "text" and not self.text[end : self.tokens[i].start].strip():
            return self.tokens[i].text[:MOST_CHARACTERS_SAID]
        for begin, stop in self.comments[bisect_right(self.comments, (end, 0)) :][:MOST_COMMENTS]:
            if self.text[end:begin].strip():
                break
            found.append(self.text[begin:stop])
            end = stop
        return "\n".join(found)[:MOST_CHARACTERS_SAID]

    def column(self, start: int) -> int:
        """The number of characters before a position in its line."""
        line = bisect_right(self._lines, start - 1)
        return start - (self._lines[line - 1] + 1 if line else 0)


OPENING = {"(": ")", "[": "]", "{": "}", "(/": "/)"}
CLOSING = frozenset(OPENING.values())


def language_of(text: str, path: str = "") -> Language:
    """The language of a text, by the suffix of its path, or by its brackets and comments."""
    suffix = PurePath(path).suffix.lower()
    if suffix in SUFFIXES and not (suffix == ".m" and re.search(r"\(\*|:=|\{\s*\{", text)):
        return LANGUAGES[SUFFIXES[suffix]]
    marks = {  # spaces at the start of a line end with it, and words are tried from their first letter: once for each
        "python": r"^[^\S\n]*(?:import |from \w+ import|def \w+\(|class \w+.*:\s*$)|np\.array|\A\s*\{\s*\"",
        "fortran": r"(?im)^[^\S\n]*(?:real|double precision|integer)\b.*::|\d\.?d0\b|_wp\b|\(/",
        "mathematica": r"\bSqrt\[|\bRational\[|:=\s*\{|^[^\S\n]*\w+\s*=\s*\{\{",
        "c": r"->\s*\w+\s*\[|^[^\S\n]*#(?:include|define)|\]\s*=\s*\{\s*[{\d+-]|^[^\S\n]*(?:static|const\w*|double)\s",
        "julia": r"\d\s*//\s*\d|\bfunction \w+[({]|@\w+ |\bend\s*$|\b[^\WA-Z]*[A-Z]\w*\[\s*[-\d]|√",
        "matlab": r"^[^\S\n]*%|^[^\S\n]*function\s*\[|\.\.\.\s*$",
    }
    order = ("c", "python", "fortran", "julia", "mathematica", "matlab")
    for name in order:
        if re.search(marks[name], text, re.MULTILINE):
            return LANGUAGES[name]
    if "{" in text:
        return LANGUAGES["c"]
    return LANGUAGES["python" if re.search(r"[\[(]\s*[\[(]", text) else "julia"]
