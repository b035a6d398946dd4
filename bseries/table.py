"""Tables that results make of themselves, and one writer for each format.

A `Table` holds rows of any kind; its columns say how a row becomes a cell. A new format is a function of a table and an
entry of `FORMATS`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from operator import itemgetter
from typing import Any, NamedTuple
from unicodedata import decomposition
from unicodedata import name as unicode_name

GAP = "  "
LEAST_WIDTH = 8
"""No column is folded to less than this."""
MOST_HTML_ROWS = 200
"""The most rows that a notebook shows."""

_LATEX = {"\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "|": "$|$", "≥": r"$\geq$"}
_LATEX |= {"−": "$-$", "<": "$<$", ">": "$>$"}
_LATEX |= {character: f"\\{character}" for character in "&%$#_{}"}
_GREEK = "GREEK SMALL LETTER "
_GREEK_NAMES = {"lamda": r"\lambda", "omicron": "o", "final sigma": r"\varsigma"}
_RAISED = {"<super>": "^", "<sub>": "_"}


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        heading: The heading.
        right: Whether the cells are numbers, aligned at the right.
        get: The value of a row in this column; by default the entry of the row at the place of the column. As text,
            None is empty, and the entries of a list have spaces between them.
        latex: The cell as LaTeX; by default the text, escaped.
    """

    heading: str
    right: bool = False
    get: Callable[[Any], object] | None = None
    latex: Callable[[Any], str] | None = None


class LazyRows(Collection[Any]):
    """Rows that are made anew by each iteration; `count` is their number, or a bound on it."""

    def __init__(self, make: Callable[[], Iterable[Any]], count: int):
        self._make, self._count = make, count

    def __iter__(self) -> Iterator[Any]:
        return iter(self._make())

    def __len__(self) -> int:
        return self._count

    def __contains__(self, row: object) -> bool:
        return any(row == other for other in self)


class Table(NamedTuple):
    """A result as rows and columns.

    Attributes:
        title: One line.
        columns: The columns.
        rows: The rows, of any kind that the columns understand.
        notes: Sentences below the rows.
        data: Makes the JSON document.
        items: The key of the list in `data` that has one item to a line.
        section: A value of a row: where it changes, text has an empty line, and under it the value if that is text.
        records: The table that CSV holds, if it is another: all rows, with all digits.
        own: Functions that write a format in a way of their own, such as LaTeX as a displayed formula.
        titled: Whether text begins with the title.

    Example:
        >>> columns = [Column("n", True), Column("n²", True)]
        >>> squares = Table("Squares", columns, [(2, 4), (10, 100)], ["Exact."])
        >>> print(squares.to_text())
        Squares
        <BLANKLINE>
         n   n²
        ──  ───
         2    4
        10  100
        <BLANKLINE>
        Exact.
        >>> list(squares.to_csv())
        ['n,n²\\n', '2,4\\n10,100\\n']
    """

    title: str
    columns: Sequence[Column]
    rows: Collection[Any]
    notes: Sequence[str] = ()
    data: Callable[[], Mapping[str, Any]] = dict
    items: str = ""
    section: Callable[[Any], object] | None = None
    records: Table | None = None
    own: Mapping[str, Callable[[int | None], str]] = {}
    titled: bool = True

    def extended(self, notes: Iterable[str] = (), **data: Any) -> Table:
        """The table with further notes, and further entries of the JSON document."""
        return self._replace(notes=[*self.notes, *notes], data=lambda: {**self.data(), **data})

    def write(self, format_: str, width: int | None = None) -> Iterable[str]:
        """The table in a format, in pieces.

        Args:
            format_: A key of `FORMATS`.
            width: The columns of a terminal, for text.
        """
        own = self.own.get(format_)
        return FORMATS[format_].write(self, width) if own is None else [own(width)]

    def to_text(self, width: int | None = None) -> str:
        """Aligned columns; where they are wider than `width`, cells are folded."""
        return "".join(self.write("table", width)).rstrip("\n")

    def to_markdown(self) -> str:
        """A title, a table and notes in Markdown."""
        return "".join(self.write("markdown"))

    def to_csv(self) -> Iterable[str]:
        """CSV in pieces of 1,000 rows."""
        return self.write("csv")

    def to_latex(self) -> str:
        """A tabular, or a formula."""
        return "".join(self.write("latex"))

    def to_html(self, most: int | None = None) -> str:
        """A title, a table and notes in HTML; `most` bounds the number of rows."""
        return "".join(html(self, most))

    def to_json(self) -> str:
        """The JSON document."""
        return "".join(self.write("json"))

    def _repr_html_(self) -> str:
        return self.to_html(MOST_HTML_ROWS)


def as_text(self: Any) -> str:
    """What `print` shows of a result that has a table."""
    return self.to_table().to_text()


def as_html(self: Any) -> str:
    """What notebooks show of a result that has a table."""
    return self.to_table().to_html(MOST_HTML_ROWS)


class Format(NamedTuple):
    """A format: what writes a table, and the endings of its files; `streams` means that it needs no memory for rows."""

    write: Callable[[Table, int | None], Iterable[str]]
    suffixes: Sequence[str]
    streams: bool = False


def text(table: Table, width: int | None) -> Iterator[str]:
    """Title, aligned columns under a rule, and notes."""
    if table.titled:
        yield paragraphs([table.title, ""], width)
    yield aligned(table.columns, _with_sections(table), width)
    if table.notes:
        yield paragraphs(["", *table.notes], width)


def json(table: Table, width: int | None = None) -> Iterator[str]:
    """The JSON document; the list `items` has one item to a line."""
    from json import dumps

    def encoded(value: object) -> str:
        return dumps(value, ensure_ascii=False)

    fields = []
    for key, value in table.data().items():
        lines = key == table.items and value
        items = "[\n" + ",\n".join(map(encoded, value)) + "\n]" if lines else encoded(value)
        fields.append(f"{encoded(key)}: {items}")
    yield "{" + ", ".join(fields) + "}\n"


def csv(table: Table, width: int | None = None) -> Iterator[str]:
    """A line for each row of the records."""
    records = table.records or table
    return csv_lines([column.heading for column in records.columns], _cells(records))


def latex(table: Table, width: int | None = None) -> Iterator[str]:
    """A tabular."""
    columns = table.columns
    yield f"\\begin{{tabular}}{{{''.join('r' if column.right else 'l' for column in columns)}}}\n"
    yield " & ".join(latex_text(column.heading) for column in columns) + " \\\\ \\hline\n"
    writers = [column.latex or _escaped(get) for column, get in zip(columns, _getters(table), strict=True)]
    for row in table.rows:
        yield " & ".join(write(row) for write in writers) + " \\\\\n"
    yield "\\end{tabular}\n"


def markdown(table: Table, width: int | None = None) -> Iterator[str]:
    """Title, rows and notes; cells are code, so that nothing in them is markup."""
    lines = [
        "| " + " | ".join(_one_line(column.heading for column in table.columns)) + " |",
        "|" + "|".join("--:" if column.right else "---" for column in table.columns) + "|",
    ]
    lines += ["| " + " | ".join(f"`{x}`" if x else "" for x in _one_line(row)) + " |" for row in _cells(table)]
    yield "\n\n".join([table.title, "\n".join(lines), *filter(None, table.notes)]) + "\n"


def html(table: Table, most: int | None = None) -> Iterator[str]:
    """Title, rows and notes; `most` bounds the number of rows."""
    from html import escape

    def cell(tag: str, column: Column, content: str) -> str:
        style = ' style="text-align: right"' if column.right else ""
        return f"<{tag}{style}>{escape(content, quote=False).replace(chr(10), '<br>')}</{tag}>"

    def line(tag: str, cells: Iterable[str]) -> str:
        return f"<tr>{''.join(cell(tag, *pair) for pair in zip(table.columns, cells, strict=True))}</tr>\n"

    yield f"<p>{escape(table.title, quote=False)}</p>\n<table>\n"
    yield line("th", (column.heading for column in table.columns))
    yield from (line("td", cells) for cells in islice(_cells(table), most))
    yield "</table>\n"
    if most is not None and len(table.rows) > most:
        yield f"<p>… {len(table.rows) - most:,} more rows</p>\n"
    yield from (f"<p>{escape(note, quote=False)}</p>\n" for note in filter(None, table.notes))


FORMATS = {
    "table": Format(text, ("", ".txt")),
    "json": Format(json, (".json",)),
    "csv": Format(csv, (".csv",), streams=True),
    "latex": Format(latex, (".tex",)),
    "markdown": Format(markdown, (".md",)),
    "html": Format(lambda table, width: html(table), (".html",)),
}
"""The formats by their names; "table" is text."""


def listed(columns: Iterable[tuple[str, Callable[[Any], object]]], rows: Collection[Any]) -> Table:
    """Records for CSV: headings with the values of a row."""
    return Table("", [Column(heading, get=get) for heading, get in columns], rows)


def cell_text(value: object) -> str:
    """A value as it stands in a cell; numbers read back the same."""
    if isinstance(value, str):
        return value
    if isinstance(value, tuple | list):
        return " ".join(map(str, value))
    return "" if value is None else str(value)


def _getters(table: Table) -> list[Callable[[Any], object]]:
    return [itemgetter(k) if column.get is None else column.get for k, column in enumerate(table.columns)]


def _cells(table: Table) -> Iterator[list[str]]:
    """The rows as text."""
    gets = _getters(table)
    return ([cell_text(get(row)) for get in gets] for row in table.rows)


def _escaped(get: Callable[[Any], object]) -> Callable[[Any], str]:
    return lambda row: latex_text(cell_text(get(row)).replace("\n", "; "))


def _with_sections(table: Table) -> Iterator[Sequence[str] | None]:
    """The rows as text, with None for an empty line."""
    gets, before = _getters(table), None
    for row in table.rows:
        now = None if table.section is None else table.section(row)
        if now != before:
            if before is not None:
                yield None
            if isinstance(now, str):
                yield [now, *[""] * (len(gets) - 1)]
        before = now
        yield [cell_text(get(row)) for get in gets]


def aligned(columns: Sequence[Column], rows: Iterable[Sequence[str] | None], width: int | None) -> str:
    """Aligned columns under a rule; None among the rows is an empty line.

    Where `width` columns of a terminal do not suffice, wide cells are folded, never cut.
    """
    body = list(rows)
    headings = [column.heading for column in columns]
    texts = ["\n".join(cells) for cells in zip(headings, *filter(None, body), strict=True)]
    widths = [_longest(text.split("\n")) for text in texts]
    if width is not None:
        words = [_longest(text.split()) for text in texts]
        widths = _narrowed(widths, words, width - len(GAP) * (len(widths) - 1))
    lines = [*_folded(headings, columns, widths), GAP.join("─" * w for w in widths)]
    for row in body:
        lines += [""] if row is None else _folded(row, columns, widths)
    return "\n".join(lines) + "\n"


def _narrowed(widths: Sequence[int], words: Sequence[int], available: int) -> list[int]:
    """Widths under a common bound that fit.

    Cells are folded between words; if need be, the last column within words, since it holds a formula or a sentence;
    and at worst all columns but the first, whose names are copied.
    """
    narrow = [*words[:1], *[LEAST_WIDTH] * (len(widths) - 1)]
    fitted = list(widths)
    for floors in (words, [*words[:-1], LEAST_WIDTH], narrow):
        bound = max(widths)
        while sum(fitted) > available and bound > LEAST_WIDTH:
            bound -= 1
            fitted = [min(width, max(floor, bound)) for width, floor in zip(widths, floors, strict=True)]
    return fitted


def _longest(pieces: Iterable[str]) -> int:
    return max(map(len, pieces), default=0)


def _folded(row: Sequence[str], columns: Sequence[Column], widths: Sequence[int]) -> list[str]:
    """The lines of a row."""
    cells = [_wrap(cell, w) for cell, w in zip(row, widths, strict=True)]
    lines = []
    for k in range(max(map(len, cells))):
        pieces = (cell[k] if k < len(cell) else "" for cell in cells)
        adjusted = (
            piece.rjust(w) if column.right else piece.ljust(w)
            for piece, column, w in zip(pieces, columns, widths, strict=True)
        )
        lines.append(GAP.join(adjusted).rstrip())
    return lines


def _wrap(cell: str, width: int) -> list[str]:
    if len(cell) <= width and "\n" not in cell:
        return [cell]
    from textwrap import wrap

    return [line for part in cell.split("\n") for line in wrap(part, width, break_on_hyphens=False) or [""]]


def paragraphs(sentences: Iterable[str], width: int | None) -> str:
    """Each sentence on lines of its own."""
    return "".join("\n".join(_wrap(sentence, width or len(sentence))) + "\n" for sentence in sentences)


def csv_lines(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """CSV in pieces, made while they are read."""
    from csv import writer
    from io import StringIO

    lines = iter(rows)
    piece: list[Sequence[str]] = [headings]
    while piece:
        buffer = StringIO()
        writer(buffer, lineterminator="\n").writerows(piece)
        yield buffer.getvalue()
        piece = list(islice(lines, 1000))


def latex_text(text: str) -> str:
    """Text as LaTeX: special characters escaped; Greek letters, raised and lowered digits and signs in math mode."""
    return "".join(map(_latex_character, text))


def _latex_character(character: str) -> str:
    if character.isascii():
        return _LATEX.get(character, character)
    kind, _, plain = decomposition(character).partition(" ")
    if kind in _RAISED:
        return f"${_RAISED[kind]}{{{chr(int(plain, 16))}}}$"
    name = unicode_name(character, "")
    if name.startswith(_GREEK):
        name = name.removeprefix(_GREEK).lower()
        return f"${_GREEK_NAMES.get(name, chr(92) + name)}$"
    return _LATEX.get(character, character)


def _one_line(row: Iterable[str]) -> Iterator[str]:
    return (" ".join(cell.replace("|", "\\|").split()) for cell in row)
