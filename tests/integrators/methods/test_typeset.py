"""Tableaus in LaTeX and CSV: read as from other sources, each entry in its line."""

from __future__ import annotations

from fractions import Fraction

import pytest

from integrators.methods.catalogue.registry import method
from integrators.methods.exchange.reading import read_tableaus
from integrators.methods.exchange.tableaus import import_tableau

PAGE = r"""
\section{Methods}
Kutta's method has order 4, with % of the evaluations \begin{array}{c|c}
\[
  \renewcommand{\arraystretch}{1.2}
  \begin{array}{c|cccc}
    0 \\
    \frac{1}{2} & \frac12 \\
    \tfrac12 & 0 & \frac{1}{2} \\
    1 & 0 & 0 & 1 \\[2pt] \hline
      & \frac{1}{6} & \frac13 & \dfrac{1}{3} & \frac{1}{6}
  \end{array}
\]
and Crouzeix's
$\begin{array}{c|cc}
  \frac12+\frac{\sqrt3}{6} & \frac12+\frac{\sqrt3}{6} & 0 \\
  \frac12-\frac{\sqrt{3}}{6} & -\frac{\sqrt3}{3} & \frac12+\frac{\sqrt3}{6} \\ \hline
  & \frac{1}{2} & \frac12
\end{array}$
\begin{tabular}{lr}
  name & order \\ \hline
  rk4 & 4
\end{tabular}
"""


def values(rows):
    return [[entry.value for entry in row] for row in rows]


def test_arrays_of_a_page_are_tableaus():
    found = read_tableaus(PAGE, name="page.tex")
    assert [(record.name, record.line, record.kind) for record in found.records] == [
        ("tableau1", 7, "runge-kutta"),
        ("tableau2", 16, "runge-kutta"),
    ]
    rk4 = method("rk4")
    assert values(found.records[0].tables["A"]) == [list(row) for row in rk4.A]
    third = found.records[0].tables["A"][2][1]
    assert (third.line, third.text) == (9, "1/2")
    assert found.unread == ()


def test_roots_are_read_exactly():
    text = PAGE[PAGE.index("$") :]
    crouzeix = import_tableau(text)
    assert crouzeix == method("crouzeix3")


def test_rows_of_csv_are_a_tableau(tmp_path):
    path = tmp_path / "heun-euler.csv"
    path.write_text('0,,\n1,1,\n,"1/2",1/2\n,1,0\n')
    (record,) = read_tableaus(path).records
    assert record.line == 1
    assert values(record.tables["A"]) == [[0, 0], [1, 0]]
    assert values([record.tables["b"], *record.tables["embedded"]]) == [[Fraction(1, 2)] * 2, [1, 0]]


@pytest.mark.parametrize(
    "text",
    [
        r"\begin{array}{c|c} a & b \\ c & d \end{array}",
        r"\begin{array}{c|c} 0 & 1 \\ \hline & 1 & 2 \end{array}",
        r"\begin{array}{c|cc} 0 & \\ 1 & \write18{x} \\ \hline & 1 & 1 \end{array}",
        r"\begin{array}{c|c}" * 500,
        r"\frac{" * 500,
    ],
)
def test_other_arrays_are_no_tableaus(text):
    assert read_tableaus(text, name="other.tex").records == ()
