from __future__ import annotations

import csv
import io
import json

import pytest

from bseries.cli import table
from bseries.cli.options.method_argument import split_row
from bseries.cli.progress import Progress
from bseries.cli.table import Column

COLUMNS = (Column("n", True), Column("coefficient"), Column("formula"))
ROWS = [
    ("1", "1", "f"),
    ("10", "gamma**2 - 12*gamma + 1/6 + sqrt(3)", "f''(f'(f'(f'(f))),f'(f'(f)))"),
    ("2", "0.000012345678901234", "f'(f)"),
]


def test_table_without_a_width_is_as_wide_as_needed():
    assert table.text(COLUMNS[:2], [("1", "a"), None, ("10", "bbb")], None) == (
        " n  coefficient\n──  ───────────\n 1  a\n\n10  bbb\n"
    )


@pytest.mark.parametrize("width", [30, 40, 60, 80, 140])
def test_folded_tables_fit_and_lose_nothing(width):
    text = table.text(COLUMNS, ROWS, width)
    assert max(map(len, text.splitlines())) <= width
    letters = sorted("".join(cell for row in (*ROWS, [c.heading for c in COLUMNS]) for cell in row).replace(" ", ""))
    assert sorted(character for character in text if character not in " \n─") == letters


def test_numbers_are_folded_last():
    text = table.text(COLUMNS, ROWS, 50)
    assert "0.000012345678901234" in text  # whole, while formulas and sums are folded
    assert "gamma**2 - 12*gamma + 1/6 + sqrt(3)" not in text


def test_sections():
    rows = [("1", "a"), ("1", "b"), ("2", "c")]
    assert list(table.sections(rows, 0)) == [("1", "a"), ("1", "b"), None, ("2", "c")]


def test_csv_comes_in_pieces_and_is_read_back():
    rows = [(str(i), "[τ,τ]", 'quoted "x"') for i in range(2500)]
    pieces = list(table.csv(("id", "tree", "text"), iter(rows)))
    assert len(pieces) == 4
    assert [tuple(row) for row in csv.reader(io.StringIO("".join(pieces)))][1:] == rows


def test_json_has_one_item_to_a_line():
    data = {"schema": 1, "name": "τ", "terms": [{"a": [1, 2]}, {"a": []}]}
    text = table.json(data, "terms")
    assert json.loads(text) == data
    assert text.splitlines()[1:3] == ['{"a": [1, 2]},', '{"a": []}']
    assert json.loads(table.json({"terms": []}, "terms")) == {"terms": []}


def test_markup_is_escaped():
    assert table.latex_text("50% of a_b & {s} ≥ |τ|") == r"50\% of a\_b \& \{s\} $\geq$ $|$$\tau$$|$"
    text = table.markdown([Column("|a|")], [("x|y",)], title="T", notes=["N"])
    assert text == "T\n\n| \\|a\\| |\n|---|\n| `x\\|y` |\n\nN\n"


@pytest.mark.parametrize(
    ("text", "entries"),
    [
        ("", []),
        ("1", ["1"]),
        ("1,root(2,3),-(1,2)", ["1", "root(2,3)", "-(1,2)"]),
        (",", ["", ""]),
        ("(" * 10_000, ["(" * 10_000]),
    ],
)
def test_rows_are_split_outside_parentheses(text, entries):
    assert split_row(text) == entries


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_bar_appears_and_goes(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr("bseries.cli.progress.PATIENCE", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    with Progress() as progress:
        progress._timer.join()
        progress.update(1, 2)
    assert "computing" in terminal.getvalue()
    assert progress._bar is None


def test_no_bar_for_quick_work_or_without_a_terminal(monkeypatch):
    for stream in (Terminal(), io.StringIO()):
        monkeypatch.setattr("sys.stderr", stream)
        with Progress() as progress:
            progress.update(1, 2)
        assert stream.getvalue() == ""
