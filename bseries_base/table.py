"""Tables of results, and one writer for each format.

A `Table` has rows of any type; its columns are functions from rows to cells. A new format is a function of a table
and an entry of `FORMATS`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import islice
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias, TypeVar
from unicodedata import decomposition
from unicodedata import name as unicode_name

from bseries_base.extras import optional_module
from bseries_base.formulas import formula_text

if TYPE_CHECKING:
    from pandas import DataFrame

T = TypeVar("T")

GAP = "  "
LEAST_WIDTH = 8
"""Least width of a folded column."""
MOST_ROWS = 200
"""The most rows that `print` and notebooks show."""

PRINT_WIDTH = 120
"""The width to which `print` folds tables."""
MOST_LATEX = 100_000
"""The most characters of LaTeX that a notebook shows."""

_LATEX = {"\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "|": "$|$", "≥": r"$\geq$"}
_LATEX |= {"−": "$-$", "<": "$<$", ">": "$>$"}
_LATEX |= {character: f"\\{character}" for character in "&%$#_{}"}
_GREEK = "GREEK SMALL LETTER "
_GREEK_NAMES = {"lamda": r"\lambda", "omicron": "o", "final sigma": r"\varsigma"}
_RAISED = {"<super>": "^", "<sub>": "_"}


Document: TypeAlias = dict[str, Any]
"""An object of JSON or TOML."""
Row: TypeAlias = Any  # whatever the columns of its table accept


class Column(NamedTuple):
    """A column of a table.

    `get` gives the value of a row, by default the entry of the row at the place of the column; as text, None is empty,
    and the entries of a list have spaces between them. `latex` and `html` give the cell in these formats, by default
    the text, escaped.
    """

    heading: str
    right: bool = False  # whether the cells are numbers, aligned at the right
    get: Callable[[Row], object] | None = None
    latex: Callable[[Row], str] | None = None
    html: Callable[[Row], str] | None = None


class LazyRows(Collection[Row]):
    """Rows computed by each iteration; `count` is their number, or a bound on it."""

    def __init__(self, make: Callable[[], Iterable[Row]], count: int):
        self._make, self._count = make, count

    def __iter__(self) -> Iterator[Row]:
        return iter(self._make())

    def __len__(self) -> int:
        return self._count

    def __contains__(self, row: object) -> bool:
        return any(row == other for other in self)


class Table(NamedTuple):
    """A result as rows and columns.

    Text has an empty line where the `section` of rows changes, followed by its value if that is text.

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

    title: str  # one line
    columns: Sequence[Column]
    rows: Collection[Row]
    notes: Sequence[str] = ()  # sentences below the rows
    data: Callable[[], Document] = dict  # makes the JSON document
    items: str = ""  # the key of the list in `data` that has one item to a line
    section: Callable[[Row], object] | None = None  # a value of a row
    records: Table | None = None  # the table for CSV, if it differs: all rows, with all digits
    own: Mapping[str, Callable[[int | None], str]] = {}  # replace the writers of formats
    titled: bool = True  # whether text begins with the title

    def __reduce__(self) -> tuple[object, ...]:
        """Cells, data and texts in place of the functions that make them, most of which cannot be pickled."""
        columns = list(zip(self.columns, _getters(self), strict=True))
        rows = [
            (
                [get(row) for _, get in columns],
                [column.latex and column.latex(row) for column in self.columns],
                [column.html and column.html(row) for column in self.columns],
                self.section and self.section(row),
            )
            for row in self.rows
        ]
        made = [
            column._replace(
                get=partial(_part, 0, k),
                latex=column.latex and partial(_part, 1, k),
                html=column.html and partial(_part, 2, k),
            )
            for k, column in enumerate(self.columns)
        ]
        section = self.section and itemgetter(3)
        own = {format_: partial(_given, write(None)) for format_, write in self.own.items()}
        data = partial(_given, dict(self.data()))
        return Table, (
            self.title,
            made,
            rows,
            list(self.notes),
            data,
            self.items,
            section,
            self.records,
            own,
            self.titled,
        )

    def extended(self, notes: Iterable[str] = (), **data: object) -> Table:
        """The table with further notes, and further entries of the JSON document."""
        return self._replace(notes=[*self.notes, *notes], data=lambda: {**self.data(), **data})

    def write(self, format_: str, width: int | None = None) -> Iterable[str]:
        """The table in one of `FORMATS`, in pieces; text for a terminal of some width."""
        own = self.own.get(format_)
        return FORMATS[format_].write(self, width) if own is None else [own(width)]

    def to_text(self, width: int | None = None) -> str:
        """Aligned columns; cells are folded if these are wider than `width`."""
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

    def to_html(self) -> str:
        """A title, a table and notes in HTML."""
        return "".join(self.write("html"))

    def to_json(self) -> str:
        """The JSON document."""
        return "".join(self.write("json"))

    def to_pandas(self) -> DataFrame:
        """The records as a ``pandas.DataFrame``; MissingPackage if pandas is not installed."""
        pandas = optional_module("pandas", "to_pandas")
        records = self.records or self
        gets = _getters(records)
        rows = [[get(row) for get in gets] for row in records.rows]
        return pandas.DataFrame(rows, columns=[column.heading for column in records.columns])

    def head(self) -> Table:
        """The table with its first rows only; a note says how many are left out."""
        left = len(self.rows) - MOST_ROWS
        if left <= 0:
            return self
        return self._replace(rows=list(islice(self.rows, MOST_ROWS)), notes=[f"… {left:,} more rows", *self.notes])

    def _repr_html_(self) -> str:
        return self.head().to_html()


class HasTable(Protocol):
    """A result that has a table."""

    def to_table(self) -> Table:
        """The table."""
        ...


def as_text(self: HasTable) -> str:
    """The first rows of a result that has a table, as text."""
    return self.to_table().head().to_text(PRINT_WIDTH)


def as_html(self: HasTable) -> str:
    """The first rows of a result that has a table, as HTML."""
    return self.to_table().head().to_html()


def as_frame(self: HasTable) -> DataFrame:
    """The rows of a result that has a table, as a ``pandas.DataFrame``."""
    return self.to_table().to_pandas()


def number_column(key: str, form: str, heading: str = "") -> Column:
    """A column of the numbers that records have under a key, empty where there is none."""
    return Column(heading or key, True, lambda record: "" if record.get(key) is None else format(record[key], form))


def fact_table(title: str, facts: Iterable[tuple[str, object]], notes: Sequence[str] = ()) -> Table:
    """Quantities and their values, without those that are None."""
    rows = [fact for fact in facts if fact[1] is not None]
    return Table(title, (Column("quantity"), Column("value")), rows, notes, data=lambda: dict(rows))


def short_latex(formula: str) -> str | None:
    """The formula for a notebook, which shows the text of the result instead if there is none."""
    return f"$\\displaystyle {formula}$" if len(formula) <= MOST_LATEX else None


class Tabular:
    """A result with `to_table()`: `print` and notebooks show the first rows of its table."""

    __slots__ = ()

    def to_table(self) -> Table:
        """The result as a table, which gives text, Markdown, CSV, LaTeX, HTML and JSON."""
        raise NotImplementedError

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame


class Format(NamedTuple):
    """A format: its writer, the suffixes of its files, and whether it writes rows without storing them (`streams`)."""

    write: Callable[[Table, int | None], Iterable[str]]
    suffixes: Sequence[str]
    streams: bool = False


def text(table: Table, width: int | None) -> Iterator[str]:
    """Title, aligned columns under a rule, and notes."""
    if table.titled:
        yield paragraphs([table.title, ""], width)
    if table.columns:
        yield aligned(table.columns, _with_sections(table), width)
    if table.notes:
        yield paragraphs([*([""] if table.columns else []), *table.notes], width)


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
    writers = [column.latex or _written(get, _latex_line) for column, get in zip(columns, _getters(table), strict=True)]
    for row in table.rows:
        cells = " & ".join(write(row) for write in writers)
        yield "{}" * cells.startswith("[") + cells + " \\\\\n"  # a bracket would be an argument of the line break above
    yield "\\end{tabular}\n"


def markdown(table: Table, width: int | None = None) -> Iterator[str]:
    """Title, rows and notes; cells are code, so that nothing in them is markup."""
    lines = [
        "| " + " | ".join(_one_line(column.heading for column in table.columns)) + " |",
        "|" + "|".join("--:" if column.right else "---" for column in table.columns) + "|",
    ]
    lines += ["| " + " | ".join(f"`{x}`" if x else "" for x in _one_line(row)) + " |" for row in _cells(table)]
    yield "\n\n".join([table.title, "\n".join(lines), *filter(None, table.notes)]) + "\n"


def html(table: Table, width: int | None = None) -> Iterator[str]:
    """Title, rows and notes."""
    from html import escape

    def escaped(content: str) -> str:
        return escape(content, quote=False).replace("\n", "<br>")

    def line(tag: str, cells: Iterable[str]) -> str:
        styles = (' style="text-align: right"' if column.right else "" for column in table.columns)
        return f"<tr>{''.join(f'<{tag}{style}>{x}</{tag}>' for style, x in zip(styles, cells, strict=True))}</tr>\n"

    yield f"<p>{escape(table.title, quote=False)}</p>\n<table>\n"
    yield line("th", (escaped(column.heading) for column in table.columns))
    columns = zip(table.columns, _getters(table), strict=True)
    writers = [column.html or _written(get, escaped) for column, get in columns]
    yield from (line("td", (write(row) for write in writers)) for row in table.rows)
    yield "</table>\n"
    yield from (f"<p>{escape(note, quote=False)}</p>\n" for note in filter(None, table.notes))


FORMATS = {
    "table": Format(text, ("", ".txt")),
    "json": Format(json, (".json",)),
    "csv": Format(csv, (".csv",), streams=True),
    "latex": Format(latex, (".tex",)),
    "markdown": Format(markdown, (".md",)),
    "html": Format(html, (".html",)),
}
"""The formats by their names; "table" is text."""


def _part(kind: int, k: int, row: Row) -> Any:
    """The value, the LaTeX or the HTML of a cell in a row that was made for pickling."""
    return row[kind][k]


def _given(value: T, _width: int | None = None) -> T:
    return value


def listed(columns: Iterable[tuple[str, Callable[[Row], object]]], rows: Collection[Row]) -> Table:
    """Records for CSV: headings with the values of a row."""
    return Table("", [Column(heading, get=get) for heading, get in columns], rows)


def cell_text(value: object) -> str:
    """A value as the text of a cell; numbers have all digits."""
    if isinstance(value, str):
        return value
    if isinstance(value, tuple | list):
        return " ".join(map(str, value))
    return "" if value is None else formula_text(value)


def _getters(table: Table) -> list[Callable[[Row], object]]:
    return [itemgetter(k) if column.get is None else column.get for k, column in enumerate(table.columns)]


def _cells(table: Table) -> Iterator[list[str]]:
    """The rows as text."""
    gets = _getters(table)
    return ([cell_text(get(row)) for get in gets] for row in table.rows)


def _written(get: Callable[[Row], object], escaped: Callable[[str], str]) -> Callable[[Row], str]:
    return lambda row: escaped(cell_text(get(row)))


def _latex_line(text: str) -> str:
    return latex_text(text.replace("\n", "; "))


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

    Wide cells are folded, not truncated, if the table is wider than `width` columns of a terminal.
    """
    body = list(rows)
    headings = [column.heading for column in columns]
    texts = ["\n".join(cells) for cells in zip(headings, *filter(None, body), strict=True)]
    widths = [max(map(len, text.split("\n"))) for text in texts]
    if width is not None:
        words = [max(map(len, text.split()), default=0) for text in texts]
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
