"""Arrays of numbers in source text of Python, Julia and C, which is read and never evaluated.

Values assigned to given names are cut out of the text, arrays of Julia and C are rewritten as Python lists, and
Python's `ast` parses these. Lists, tuples, ``array(…)``, numbers, + - * / **, ``Rational(a, b)``, ``Fraction(a, b)``,
``sqrt(x)``, pi and cosines are all that is read; everything else is refused. Entries become formulas for `read_entry`,
so that decimals are exact.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import Any, NamedTuple, NoReturn

from bseries_base.errors import shorten
from bseries_base.syntax_trees import syntax_tree
from integrators.core.errors import IntegratorError

MOST_CHARACTERS = 1_000_000
MOST_BRACKETS = 20
"""Of nested brackets."""
MOST_ENTRIES = 100_000
MOST_TOKENS = 200
"""Between two commas; the parser's stack is as deep as an entry."""
ARRAYS = ("array", "asarray")
QUOTIENTS = ("Rational", "Fraction")
CALLED = ("sqrt", "cos", "sin", "tan")
"""Functions that entries may have, of numbers and of multiples of pi."""
ABSENT = ("NULL", "nullptr", "None", "nothing")
SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**", ast.UAdd: "+", ast.USub: "-"}
TOKEN = re.compile(r"[^\W\d]\w*|\d[\w.]*|\S")


class Language(NamedTuple):
    """The arrays of a language."""

    skipped: str  # what is no code: comments and text in quotes
    to_lists: Callable[[str], str]  # rewrites the value of an assignment as a Python expression


def read_arrays(text: str, names: Iterable[str], language: Language) -> dict[str, Any]:
    """The values that a text assigns to names, as nested lists of formulas.

    Example:
        >>> read_arrays("A = [0 0; 1//2 0]; b = [0, 1] # weights", ["A", "b"], JULIA)
        {'A': [['0', '0'], ['(1)/(2)', '0']], 'b': ['0', '1']}
    """
    if len(text) > MOST_CHARACTERS:
        raise IntegratorError(f"text must have at most {MOST_CHARACTERS:,} characters, but has {len(text):,}")

    def blank(match: re.Match[str]) -> str:
        """Text in quotes becomes empty quotes, a comment a space."""
        return '""' if match[0][0] in "\"'" else "\n" * match[0].count("\n") or " "

    code = re.sub(language.skipped, blank, text, flags=re.DOTALL | re.MULTILINE)
    found = {}
    for name in names:
        values = list(islice((value for value in _assigned(code, name) if not _is_empty(value, name)), 2))
        if len(values) > 1:
            raise IntegratorError(f"{name} must be assigned once, as a whole, but was more than once")
        for value in values:
            found[name] = _Reader(name, language.to_lists(value)).read()
    return found


def _assigned(code: str, name: str) -> Iterator[str]:
    """The texts of the values assigned to a name, also to its entries and as argument of a call."""
    for match in re.finditer(rf"(?<![\w.>]){re.escape(name)}\s*(?:\[[^][=\n]*\]\s*)*=(?!=)\s*", code):
        depth, end = 0, match.end()
        for end in range(match.end(), len(code) + 1):
            character = code[end : end + 1]
            depth += (character in "([{" and character != "") - (character in ")]}" and character != "")
            if depth < 0 or (depth == 0 and character in ",;\n"):  # "" at the end of the text is in it
                break
        yield code[match.end() : end].strip()


def _is_empty(value: str, name: str) -> bool:
    """Whether a value is nothing, or the array of this name with its numbers converted."""
    own = re.escape(name)
    return value in ABSENT or re.fullmatch(rf"{own}|map\(\w+,\s*{own}\)|convert\.\(\w+,\s*{own}\)", value) is not None


class _Reader:
    """The value of one name, from Python source."""

    def __init__(self, name: str, source: str) -> None:
        self.name = name
        self.source = " ".join(source.split())
        self.bytes = self.source.encode(errors="surrogatepass")  # which Python refuses to parse

    def read(self) -> Any:
        if self.source.count(",") > MOST_ENTRIES:
            raise IntegratorError(f"{self.name} must have at most {MOST_ENTRIES:,} entries, but has more")
        depth = tokens = 0
        for token in TOKEN.findall(self.source):  # refuses what would overflow the stack of the parser
            depth += (token in "([{") - (token in ")]}")
            tokens = 0 if token in ",[" else tokens + 1
            if depth > MOST_BRACKETS or tokens > MOST_TOKENS:
                what = f"at most {MOST_BRACKETS} nested brackets and entries of at most {MOST_TOKENS} parts"
                raise IntegratorError(f"{self.name} must have {what}, but has more")
        try:
            tree = syntax_tree(self.source, "eval")
        except (SyntaxError, ValueError, MemoryError, RecursionError):
            self._refuse(self.source)
        return self._array(tree.body)

    def _array(self, node: ast.expr) -> Any:
        """Nested lists of formulas."""
        if isinstance(node, ast.List | ast.Tuple):
            return [self._array(entry) for entry in node.elts]
        if isinstance(node, ast.Call) and _called(node) in ARRAYS and node.args:
            return self._array(node.args[0])
        return self._formula(node)

    def _formula(self, node: ast.expr) -> str:
        """A number or an operation as text that `parse_number` reads."""
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            return self._text(node)
        if isinstance(node, ast.UnaryOp) and type(node.op) in SIGNS:
            return f"{SIGNS[type(node.op)]}({self._formula(node.operand)})"
        if isinstance(node, ast.BinOp) and type(node.op) in SIGNS:
            return f"({self._formula(node.left)}){SIGNS[type(node.op)]}({self._formula(node.right)})"
        if isinstance(node, ast.Call) and not node.keywords:
            parts = [self._formula(argument) for argument in node.args]
            if _called(node) in QUOTIENTS and 1 <= len(parts) <= 2:
                return "/".join(f"({part})" for part in parts)
            if _called(node) in CALLED and len(parts) == 1:
                return f"{_called(node)}({parts[0]})"
        if isinstance(node, ast.Name) and node.id == "pi":
            return node.id
        return self._refuse(self._text(node))

    def _text(self, node: ast.expr) -> str:
        """The source of a node: all digits of a number."""
        return self.bytes[node.col_offset : node.end_col_offset].decode()

    def _refuse(self, text: str) -> NoReturn:
        raise IntegratorError(
            f"{self.name} must be an array of numbers, with + - * /, sqrt and cosines only, but has {shorten(text)!r}"
        ) from None


def _called(node: ast.Call) -> str:
    """The last part of the name of a called function."""
    function = node.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def _c_lists(value: str) -> str:
    """Braces as brackets; macros for constants and suffixes of numbers are dropped."""
    value = re.sub(r"\b(?:RC|SUN_RCONST|PetscRealConstant)\s*\(", "(", value)
    if quotient := re.search(r"(?<![\w.])\d+\s?/\s?\d+(?![\w.])", value):
        raise IntegratorError(f"quotients must have decimal points in C, which rounds {quotient[0]}, but one has none")
    value = re.sub(r"(?<![\w.])(\d+(?:\.\d*)?(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?)[fFlL]\b", r"\1", value)
    return value.translate(str.maketrans("{}", "[]"))


def _julia_lists(value: str) -> str:
    """Rows that end with ; or the line and entries between spaces, as nested lists."""
    value = re.sub(r"[ \t]+", " ", value)
    if re.search(r"(?<!/)/(?!/)[^][\s,;()+*/-]*//", re.sub(r" ?(//?) ?", r"\1", value)):
        raise IntegratorError("a quotient a//b behind / must be in parentheses, as Julia computes it first, but is not")
    value = re.sub(r"^(?:@big\s*)?(?:[A-Za-z]\w*(?:\{\w+\})?(?=\[))?", "", value)
    value = re.sub(r"√\s*(\d+|(?=\())", lambda match: f"sqrt({match[1]})" if match[1] else "sqrt", value)
    value = re.sub(r" ?(//|[/*^]) ?", lambda match: {"//": "/", "^": "**"}.get(match[1], match[1]), value)
    value = re.sub(r"(?<=[\w)])[ \t]+([-+])[ \t]+", r"\1", value)
    value = re.sub(r"\([^][()]*\)", lambda match: re.sub(r"\s", "", match[0]), value)
    return re.sub(r"\[([^][]*)\]", _julia_list, re.sub(r"\][\s;]*\[", "],[", value))


def _julia_list(match: re.Match[str]) -> str:
    """An array without brackets inside."""
    if "," in match[1]:
        return match[0]
    rows = [row.split() for row in re.split(r"[;\n]", match[1]) if row.strip()]
    if all(len(row) == 1 for row in rows):
        return f"[{','.join(row[0] for row in rows)}]"
    lists = [f"[{','.join(row)}]" for row in rows]
    return lists[0] if len(lists) == 1 else f"[{','.join(lists)}]"


QUOTED = r'"(?:\\.|[^"\\\n])*\\?(?:"|$)'
"""Text without a closing quote ends with the line: nothing is scanned twice."""
PYTHON = Language(
    rf"\"\"\".*?(?:\"\"\"|\Z)|'''.*?(?:'''|\Z)|{QUOTED}|'(?:\\.|[^'\\\n])*\\?(?:'|$)|#[^\n]*", lambda value: value
)
JULIA = Language(rf"\"\"\".*?(?:\"\"\"|\Z)|{QUOTED}|#=.*?(?:=#|\Z)|#[^\n]*", _julia_lists)
C = Language(rf"{QUOTED}|/\*.*?(?:\*/|\Z)|//[^\n]*", _c_lists)
