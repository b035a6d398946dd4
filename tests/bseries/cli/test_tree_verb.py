from __future__ import annotations

import csv
import io
import json

import pytest

# Hairer, Lubich, Wanner, Geometric Numerical Integration, Table III.1.1: order, γ, σ, differential, Σ
TABLE_III_1_1 = {
    "[τ]": (2, 2, 1, "f'(f)", "Σ b_i c_i"),
    "[τ,τ]": (3, 3, 2, "f''(f,f)", "Σ b_i c_i^2"),
    "[[τ]]": (3, 6, 1, "f'(f'(f))", "Σ b_i a_ij c_j"),
    "[τ,τ,τ]": (4, 4, 6, "f'''(f,f,f)", "Σ b_i c_i^3"),
    "[τ,[τ]]": (4, 8, 1, "f''(f,f'(f))", "Σ b_i c_i a_ij c_j"),
    "[[τ,τ]]": (4, 12, 2, "f'(f''(f,f))", "Σ b_i a_ij c_j^2"),
    "[[[τ]]]": (4, 24, 1, "f'(f'(f'(f)))", "Σ b_i a_ij a_jk c_k"),
}


def test_json_against_the_book(answer):
    data = json.loads(answer("trees", "--order", "4", "--format", "json"))
    assert (data["schema"], data["kind"], data["order"], data["colors"]) == (1, "trees", 4, [""])
    found = {
        t["tree"]: (t["order"], t["density"], t["symmetry"], t["differential"], t["weight"]) for t in data["trees"]
    }
    assert found == {"τ": (1, 1, 1, "f", "Σ b_i"), **TABLE_III_1_1}
    assert [t["id"] for t in data["trees"]] == list(range(8))
    assert [t["alpha"] for t in data["trees"]] == [1, 1, 1, 1, 1, 1, 3, 1]


def test_csv_holds_the_same(answer):
    data = json.loads(answer("trees", "--order", "5", "--colors", "2", "--format", "json"))
    rows = list(csv.DictReader(io.StringIO(answer("trees", "--order", "5", "--colors", "2", "--format", "csv"))))
    assert len(rows) == 2 + 4 + 14 + 52 + 214
    for row, tree in zip(rows, data["trees"], strict=True):
        assert row["levels"] == " ".join(map(str, tree.pop("levels")))
        assert row["colors"] == " ".join(map(str, tree.pop("colors")))
        assert all(row[key] == str(value) for key, value in tree.items())


@pytest.mark.parametrize(
    ("arguments", "counts"),
    [
        ((), [1, 1, 2, 4, 9, 20, 48, 115, 286, 719]),
        (("--colors", "2"), [2, 4, 14, 52, 214, 916, 4116]),
        (("--colors", "3"), [3, 9, 45, 246, 1485]),
        (("--colors", "2", "--max-children", "0,inf;inf,0"), [2, 2, 4, 8, 18, 40, 96, 230]),
        (("--max-children", "2"), [1, 1, 2, 3, 6, 11, 23, 46]),
    ],
)
def test_counts(answer, arguments, counts):
    call = "trees", "--count", "--order", str(len(counts)), *arguments
    data = json.loads(answer(*call, "--format", "json"))
    assert [row["trees"] for row in data["counts"]] == counts
    assert data["counts"][-1]["total"] == sum(counts)
    rows = list(csv.DictReader(io.StringIO(answer(*call, "--format", "csv"))))
    assert [int(row["trees"]) for row in rows] == counts
    last = [str(len(counts)), str(counts[-1]), str(sum(counts))]
    assert answer(*call).split()[-3:] == last
    assert answer(*call, "--format", "latex").splitlines()[-2] == " & ".join(last) + r" \\"
    assert answer(*call, "--format", "markdown").strip().endswith("| " + " | ".join(f"`{n}`" for n in last) + " |")


def test_count_goes_where_no_table_can(answer):
    # OEIS A000081
    assert "45007066269" in answer("trees", "--order", "28", "--count")
    assert len(answer("trees", "--order", "40", "--count").splitlines()) == 42


def test_table_and_markdown_and_latex(answer):
    table = answer("trees", "--order", "4")
    assert table.startswith("8 rooted trees with at most 4 nodes\n")
    assert " 6    4  [τ,[τ]]  1   8  3  f''(f,f'(f))   Σ b_i c_i a_ij c_j\n" in table
    markdown = answer("trees", "--order", "4", "--format", "markdown")
    assert r"| id | \|τ\| | tree τ |" in markdown
    assert "| `6` | `4` | `[τ,[τ]]` | `1` | `8` | `3` | `f''(f,f'(f))` | `Σ b_i c_i a_ij c_j` |" in markdown
    latex = answer("trees", "--order", "4", "--format", "latex")
    assert r"6 & 4 & $[\tau ,[\tau ]]$ & 1 & 8 & 3 & $f''(f,f'(f))$ & $\sum_{i,j} b_{i} c_{i} a_{ij} c_{j}$ \\" in latex
