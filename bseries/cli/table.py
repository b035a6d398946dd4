"""Rows of text as a table for readers, as CSV, Markdown and LaTeX; data as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, NamedTuple

Row = Sequence[str]

GAP = "  "
LEAST_WIDTH = 8
"""No column is folded to less than this."""


_LATEX = {"\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "|": "$|$", "≥": r"$\geq$"}
_LATEX |= {character: f"\\{character}" for character in "&%$#_{}"}
_LATEX |= {"τ": r"$\tau$", "σ": r"$\sigma$", "γ": r"$\gamma$", "α": r"$\alpha$"}


class Column(NamedTuple):
    """The heading of a column, and whether it holds numbers to align at the right."""

    heading: str
    right: bool = False


def text(columns: Sequence[Column], rows: Iterable[Row | None], width: int | None) -> str:
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


def sections(rows: Iterable[Row], column: int) -> Iterator[Row | None]:
    """The rows with an empty line wherever a column changes."""
    before: str | None = None
    for row in rows:
        if before not in (None, row[column]):
            yield None
        before = row[column]
        yield row


def _narrowed(widths: Sequence[int], words: Sequence[int], available: int) -> list[int]:
    """Widths that fit under a common bound: cells are folded between words; if need be, the last column within words,
    for it holds a formula or a sentence; and at worst all columns but the first, whose names are to be copied.
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


def _folded(row: Row, columns: Sequence[Column], widths: Sequence[int]) -> list[str]:
    """The lines that a row takes."""
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


def values(*numbers: object) -> Row:
    """Numbers as text that reads back the same, for CSV; None is empty."""
    return ["" if number is None else str(number) for number in numbers]


def csv(headings: Row, rows: Iterable[Row]) -> Iterator[str]:
    """CSV in pieces, made as they are taken."""
    from csv import writer
    from io import StringIO

    lines = iter(rows)
    piece: list[Row] = [headings]
    while piece:
        text = StringIO()
        writer(text, lineterminator="\n").writerows(piece)
        yield text.getvalue()
        piece = list(islice(lines, 1000))


def markdown(columns: Sequence[Column], rows: Iterable[Row], *, title: str, notes: Iterable[str]) -> str:
    """A title, a table and notes in Markdown; cells are code, so that nothing in them is markup."""
    lines = [
        "| " + " | ".join(_one_line([column.heading for column in columns])) + " |",
        "|" + "|".join("--:" if column.right else "---" for column in columns) + "|",
    ]
    lines += ["| " + " | ".join(f"`{cell}`" if cell else "" for cell in _one_line(row)) + " |" for row in rows]
    return "\n\n".join([title, "\n".join(lines), *notes]) + "\n"


def latex(columns: Sequence[Column], rows: Iterable[Row]) -> str:
    """A LaTeX tabular; cells are LaTeX already."""
    lines = [f"\\begin{{tabular}}{{{''.join('r' if column.right else 'l' for column in columns)}}}"]
    lines.append(" & ".join(latex_text(column.heading) for column in columns) + r" \\ \hline")
    lines += [" & ".join(row) + r" \\" for row in rows]
    return "\n".join([*lines, r"\end{tabular}"]) + "\n"


def latex_text(text: str) -> str:
    """Text for LaTeX: special characters escaped, letters and signs of mathematics in math mode."""
    return "".join(_LATEX.get(character, character) for character in text)


def _one_line(row: Row) -> Iterator[str]:
    return (" ".join(cell.replace("|", "\\|").split()) for cell in row)


def json(data: Mapping[str, Any], lines: str | None = None) -> str:
    """JSON whose entry `lines`, a list, has one item to a line."""
    from json import dumps

    def text(value: object) -> str:
        return dumps(value, ensure_ascii=False)

    fields = []
    for key, value in data.items():
        items = "[\n" + ",\n".join(map(text, value)) + "\n]" if key == lines and value else text(value)
        fields.append(f"{text(key)}: {items}")
    return "{" + ", ".join(fields) + "}\n"
