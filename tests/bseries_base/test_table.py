"""Tables in every format."""

from __future__ import annotations

import csv
import io
import json
from xml.etree import ElementTree

import pytest

import bseries as bs
from bseries_base.table import FORMATS, Column, Format, LazyRows, Table, aligned, csv_lines, latex_text

COLUMNS = (Column("n", True), Column("coefficient"), Column("formula"))
ROWS = [
    ("1", "1", "f"),
    ("10", "gamma**2 - 12*gamma + 1/6 + sqrt(3)", "f''(f'(f'(f'(f))),f'(f'(f)))"),
    ("2", "0.000012345678901234", "f'(f)"),
]


def test_table_without_a_width_is_as_wide_as_needed():
    assert aligned(COLUMNS[:2], [("1", "a"), None, ("10", "bbb")], None) == (
        " n  coefficient\n──  ───────────\n 1  a\n\n10  bbb\n"
    )


@pytest.mark.parametrize("width", [30, 40, 60, 80, 140])
def test_folded_tables_fit_and_lose_nothing(width):
    text = aligned(COLUMNS, ROWS, width)
    assert max(map(len, text.splitlines())) <= width
    letters = sorted("".join(cell for row in (*ROWS, [c.heading for c in COLUMNS]) for cell in row).replace(" ", ""))
    assert sorted(character for character in text if character not in " \n─") == letters


def test_numbers_are_folded_last():
    text = aligned(COLUMNS, ROWS, 50)
    assert "0.000012345678901234" in text  # whole, while formulas and sums are folded
    assert "gamma**2 - 12*gamma + 1/6 + sqrt(3)" not in text


def test_sections_and_their_headings():
    rows = [(1, "a"), (1, "b"), (2, "c")]
    columns = (Column("n"), Column("x"))
    below = Table("T", columns, rows, section=lambda row: row[0], titled=False).to_text().split("\n", 2)[2]
    assert below == "1  a\n1  b\n\n2  c"
    headed = Table("T", columns, rows, section=lambda row: f"PART {row[0]}").to_text().split("\n", 4)[4]
    assert headed == "PART 1\n1       a\n1       b\n\nPART 2\n2       c"


def test_csv_comes_in_pieces_and_is_read_back():
    rows = [(str(i), "[τ,τ]", 'quoted "x"') for i in range(2500)]
    pieces = list(csv_lines(("id", "tree", "text"), iter(rows)))
    assert len(pieces) == 4
    assert [tuple(row) for row in csv.reader(io.StringIO("".join(pieces)))][1:] == rows


def test_cells_that_are_no_text():
    columns = (Column("number"), Column("list"), Column("length", get=lambda row: len(row[1])))
    rows = [(0.1, (1, 2)), (None, [])]
    assert "".join(Table("", columns, rows).to_csv()) == "number,list,length\n0.1,1 2,2\n,,0\n"


def test_lazy_rows_are_made_anew_and_records_are_those_of_csv():
    rows = LazyRows(lambda: ((n, n * n) for n in range(3)), 3)
    table = Table(
        "T", [Column("n", get=lambda row: row[0])], rows, records=Table("", [Column("n"), Column("n²")], rows)
    )
    assert "".join(table.to_csv()) == "".join(table.to_csv()) == "n,n²\n0,0\n1,1\n2,4\n"
    assert (len(rows), (2, 4) in rows, (3, 9) in rows) == (3, True, False)
    assert table.to_markdown().endswith("| n |\n|---|\n| `0` |\n| `1` |\n| `2` |\n")


def test_json_has_one_item_to_a_line():
    data = {"schema": 1, "name": "τ", "terms": [{"a": [1, 2]}, {"a": []}]}
    text = Table("", (), (), data=lambda: data, items="terms").to_json()
    assert json.loads(text) == data
    assert text.splitlines()[1:3] == ['{"a": [1, 2]},', '{"a": []}']
    assert json.loads(Table("", (), (), data=lambda: {"terms": []}, items="terms").to_json()) == {"terms": []}


def test_markup_is_escaped():
    assert latex_text("50% of a_b & {s} ≥ |τ|") == r"50\% of a\_b \& \{s\} $\geq$ $|$$\tau$$|$"
    assert latex_text("λ² < ω₁ − 1") == r"$\lambda$$^{2}$ $<$ $\omega$$_{1}$ $-$ 1"
    table = Table("T", [Column("|a|")], [("x|y",)], ["N", ""])
    assert table.to_markdown() == "T\n\n| \\|a\\| |\n|---|\n| `x\\|y` |\n\nN\n"


def test_html_is_escaped_and_bounded():
    table = Table("a < b", [Column("n", True), Column("x")], [(n, "<&>\nλ") for n in range(205)], ["N & M"])
    page = ElementTree.fromstring(f"<div>{table._repr_html_().replace('<br>', '<br/>')}</div>")
    assert [p.text for p in page.findall("p")] == ["a < b", "… 5 more rows", "N & M"]
    rows = page.findall("table/tr")
    assert len(rows) == 201
    assert (rows[1][1].text, rows[1][0].get("style")) == ("<&>", "text-align: right")
    assert table.to_html().count("<tr>") == 206


def test_a_format_is_one_function(monkeypatch):
    monkeypatch.setitem(FORMATS, "count", Format(lambda table, width: [str(len(table.rows))], (".count",)))
    assert list(Table("", (), [(), ()]).write("count")) == ["2"]


RESULTS = {
    "check": lambda: bs.check(bs.method("rk4")),
    "conditions": lambda: bs.order_conditions("runge-kutta", 3),
    "drift": lambda: bs.energy_drift(bs.method("stormer-verlet"), bs.scene("pendulum")),
    "series": lambda: bs.modified_equation(bs.method("rk4"), 5),
    "brackets": lambda: bs.hamiltonians.bracket_hamiltonian(bs.method("strang"), 3),
    "hamiltonian": lambda: bs.modified_hamiltonian(bs.method("implicit-midpoint"), bs.scene("pendulum"), 3),
    "verdict": lambda: bs.hamiltonians.hamiltonian_verdict(bs.method("rk4"), bs.scene("pendulum"), 3),
    "field": lambda: bs.modified_field(bs.method("rk4"), bs.scene("pendulum"), 3),
    "modifying": lambda: bs.modifying_field(bs.method("implicit-midpoint"), bs.scene("riccati"), 3),
    "map": lambda: bs.series_map(bs.method("explicit-euler"), bs.scene("riccati"), 2),
}


@pytest.mark.parametrize("name", RESULTS)
def test_results_make_tables_in_all_formats(name):
    table = RESULTS[name]().to_table()
    texts = {format_: "".join(table.write(format_)) for format_ in FORMATS}
    assert all(texts.values())
    for format_ in ("table", "markdown", "html"):
        assert table.title in texts[format_]
    assert json.loads(texts["json"])["schema"] == 1
    records = table.records or table
    assert len(list(csv.reader(io.StringIO(texts["csv"])))) == 1 + len(list(records.rows))


def test_printing_shows_the_table():
    report = bs.check(bs.method("gauss2"))
    assert str(report) == report.to_table().to_text()
    assert str(report).startswith("Order and properties of gauss2\n\nquantity ")
    assert report._repr_html_().startswith("<p>Order and properties of gauss2</p>\n<table>")


def test_the_table_of_a_map():
    text = bs.series_map(bs.method("explicit-euler"), bs.scene("riccati"), 2).to_table().to_text()
    assert text.splitlines()[0] == "Series of explicit-euler on riccati: powers h^0 to h^2, 2 of 2 trees"
    assert [line.split() for line in text.splitlines()[4:9:2]] == [["0", "y", "y"], ["1", "y", "y**2"], ["2", "y", "0"]]


def test_a_row_of_latex_does_not_begin_with_a_bracket():
    """After a line break a bracket would be its optional argument."""
    rows = "".join(Table("", [Column("tree"), Column("n")], [("[τ]", 2), ("τ", 1)]).write("latex")).split("\n")[2:4]
    assert rows == [r"{}[$\tau$] & 2 \\", r"$\tau$ & 1 \\"]
