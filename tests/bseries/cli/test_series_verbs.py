from __future__ import annotations

import csv
import io
import json
from fractions import Fraction

import pytest

import bseries as bs

# The modified equation of RK4 at h^4: weights b(τ)/σ(τ), which are the classical principal error coefficients
# (Butcher, Numerical Methods for Ordinary Differential Equations, section 318).
RK4_WEIGHTS = {
    "[[[[τ]]]]": "-1/120",
    "[[[τ,τ]]]": "1/480",
    "[[τ,[τ]]]": "-1/240",
    "[[τ,τ,τ]]": "-1/720",
    "[τ,[[τ]]]": "1/120",
    "[τ,[τ,τ]]": "-1/480",
    "[[τ],[τ]]": "1/160",
    "[τ,τ,[τ]]": "1/480",
    "[τ,τ,τ,τ]": "1/2880",
}

# y' = y²: coefficients of h^k y^(k+2) in the modified equation, from power series without trees
# (Hairer, Lubich, Wanner, Geometric Numerical Integration, examples IX.1.1 and following).
SQUARE = {
    "explicit-euler": "1 -1 3/2 -8/3 31/6 -157/15",
    "implicit-midpoint": "1 0 1/4 0 1/8 0 11/192",
    "rk4": "1 0 0 0 -1/24 0 65/576 -17/96 19/144",
}


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def table_rows(text: str) -> list[list[str]]:
    """The rows of a printed table, cells split at two or more blanks."""
    lines = [line for line in text.splitlines() if line.startswith("  ") and line.strip()]
    return [[cell for cell in line.split("  ") if cell] for line in lines]


def markdown_rows(text: str) -> list[list[str]]:
    lines = [line for line in text.splitlines() if line.startswith("| ")][1:]
    return [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in lines]


def test_json_follows_the_schema(answer):
    data = json.loads(answer("modified", "rk4", "--format", "json"))
    head = {key: data[key] for key in ("schema", "kind", "method", "order", "domain", "colors", "empty")}
    assert head == {
        "schema": 1,
        "kind": "modified",
        "method": "rk4",
        "order": 5,
        "domain": "QQ",
        "colors": [""],
        "empty": "0",
    }
    assert len(data["terms"]) == 17
    assert data["terms"][6] == {
        "tree": "[τ,[τ]]",
        "levels": [0, 1, 1, 2],
        "colors": [0, 0, 0, 0],
        "order": 4,
        "symmetry": 1,
        "density": 8,
        "coefficient": "0",
        "weight": "0",
        "differential": "f''(f,f'(f))",
    }


def test_all_formats_give_the_published_weights(answer):
    expected = {"τ": "1", **RK4_WEIGHTS}
    call = "modified", "rk4", "--nonzero", "--format"
    data = json.loads(answer(*call, "json"))
    assert {term["tree"]: term["weight"] for term in data["terms"]} == expected
    assert {row["tree"]: row["weight"] for row in rows_of(answer(*call, "csv"))} == expected
    assert {row[1].strip(): row[3].strip() for row in table_rows(answer(*call, "table"))} == expected
    assert {row[1]: row[3] for row in markdown_rows(answer(*call, "markdown"))} == expected
    assert r"- \frac{1}{720} h^{4}\, f'(f'''(f,f,f))" in answer(*call, "latex")


def test_long_series_break_in_latex(answer):
    """The lines of the align are the terms of the sum in one line, and fit a page."""
    formula = bs.modified_equation("rk4", 6).to_latex()
    text = answer("modified", "rk4", "--order", "6", "--format", "latex")
    first, *lines, last = text.splitlines()
    assert (first, last) == (r"\begin{align*}", r"\end{align*}")
    assert len(lines) > 5
    assert all(len(line) < 140 and line.endswith(r" \\") for line in lines[:-1])
    assert " ".join(line.removeprefix("&").removeprefix(r"\quad ").removesuffix(r" \\") for line in lines) == formula
    assert "\n" not in formula
    short = answer("modified", "rk4", "--order", "4", "--format", "latex")
    assert short == "f\n"
    assert answer("series", "explicit-euler", "--order", "2", "--format", "latex") == "y + h\\, f\n"


def test_zeros_are_listed_unless_nonzero(answer):
    everything = rows_of(answer("modified", "rk4", "--format", "csv"))
    nonzero = rows_of(answer("modified", "rk4", "--nonzero", "--format", "csv"))
    assert len(everything) == 17
    assert nonzero == [row for row in everything if row["coefficient"] != "0"]


@pytest.mark.parametrize("name", SQUARE)
def test_square_equation_without_trees(answer, name):
    expected = [Fraction(c) for c in SQUARE[name].split()]
    factor = {0: 1, 1: 2, 2: 2}  # f = y², f' = 2y, f'' = 2
    found = [Fraction(0)] * len(expected)
    for row in rows_of(answer("modified", name, "--order", str(len(expected)), "--format", "csv")):
        levels = [int(level) for level in row["levels"].split()]
        children = [0] * len(levels)
        for at, level in enumerate(levels[1:], 1):
            children[max(i for i in range(at) if levels[i] == level - 1)] += 1
        term = Fraction(row["weight"])
        for count in children:
            term *= factor.get(count, 0)
        found[int(row["order"]) - 1] += term
    assert found == expected


def test_sum_over_all_trees_of_the_explicit_midpoint_rule(answer):
    rows = rows_of(answer("modified", "--A", "0,0;1/2,0", "--b", "0,1", "--order", "9", "--format", "csv"))
    assert len(rows) == 486
    assert sum(Fraction(row["coefficient"]) for row in rows) == Fraction(19063, 26880)


def test_series_of_a_method(answer):
    data = json.loads(answer("series", "heun", "--order", "3", "--format", "json"))
    assert data["kind"] == "series"
    assert data["empty"] == "1"
    assert [term["coefficient"] for term in data["terms"]] == ["1", "1/2", "0", "1/2"]
    assert "B-series of heun2: trees with 1 to 3 nodes, powers h^1 to h^3" in answer("series", "heun", "--order", "3")


def test_coloured_series_restricted_to_separable_systems(answer):
    limits = "0,inf;inf,0"
    rows = rows_of(answer("modified", "leapfrog", "--order", "8", "--max-children", limits, "--format", "csv"))
    assert len(rows) == 400
    weights = {row["tree"]: row["weight"] for row in rows}
    # p' = −U'(q), q' = p: h² terms of the modified Hamiltonian p²U''/12 − U'²/24 (Hairer, Lubich, Wanner, IX.3)
    assert (weights["p[q[p]]"], weights["p[q,q]"], weights["q[p[q]]"]) == ("1/12", "1/12", "-1/6")
    assert "p" in answer("modified", "leapfrog", "--order", "1")


def test_symbols_and_their_values(answer):
    family = json.loads(answer("modified", "sdirk2", "--order", "3", "--format", "json"))
    assert family["domain"] == "QQ[gamma]"
    assert family["terms"][2]["coefficient"] == "-gamma**2 + gamma - 1/6"
    value = json.loads(answer("modified", "sdirk2", "--set", "gamma=1/4", "--order", "3", "--format", "json"))
    assert value["domain"] == "QQ"
    assert value["terms"][2]["coefficient"] == "1/48"
    inline = "--A", "gamma,0;1-2*gamma,gamma", "--b", "1/2,1/2", "--symbols", "gamma", "--order", "3"
    assert json.loads(answer("modified", *inline, "--format", "json"))["terms"] == family["terms"]
    at_value = answer("modified", *inline, "--set", "gamma=1/4", "--format", "json")
    assert json.loads(at_value)["terms"] == value["terms"]


def test_floats_say_so(answer):
    data = json.loads(answer("modified", "rk4", "--float", "--format", "json"))
    assert data["domain"] == "RR"
    assert data["terms"][8]["coefficient"] == repr(-1 / 120)
    assert "Floating point (RR): exact coefficients, each rounded" in answer("modified", "rk4", "--float")
    assert "Floating" not in answer("modified", "rk4")
    assert "Exact coefficients, in QQ." in answer("modified", "rk4")


def test_decimals_say_so(answer):
    text = answer("modified", "tsit5", "--order", "3")
    assert "decimals with 16 correct digits" in text
    assert "rounded accordingly" in text
    assert "Exact" not in text
    assert json.loads(answer("modified", "tsit5", "--order", "3", "--format", "json"))["digits"] == 16


@pytest.mark.parametrize("form", ["json", "toml"])
def test_files_and_standard_input(answer, tmp_path, form):
    content = {
        "json": '{"name": "mine", "A": [[0, 0], ["1/2", 0]], "b": [0, 1]}',
        "toml": 'name = "mine"\nA = [[0, 0], ["1/2", 0]]\nb = [0, 1]\n',
    }[form]
    path = tmp_path / f"tableau.{form}"
    path.write_text(content)
    from_file = answer("modified", str(path), "--format", "csv")
    assert from_file == answer("modified", "-", "--format", "csv", stdin=content)
    assert from_file == answer("modified", "explicit-midpoint", "--format", "csv")
    assert "Modified equation of mine" in answer("modified", str(path))


def test_float_tableau_says_so(answer):
    content = '{"A": [[0.5]], "b": [1.0], "domain": "float"}'
    assert "the tableau holds floats" in answer("modified", "-", stdin=content)


@pytest.mark.parametrize("format", ["table", "json", "csv", "latex", "markdown"])
@pytest.mark.parametrize("call", ["modified gauss2 --order 4", "series trapezoidal", "modified leapfrog --order 2"])
def test_file_and_stdout_agree(answer, tmp_path, format, call):
    suffix = {"table": ".txt", "json": ".json", "csv": ".csv", "latex": ".tex", "markdown": ".md"}[format]
    path = tmp_path / f"out{suffix}"
    assert answer(*call.split(), "-o", str(path)) == ""
    assert path.read_text(encoding="utf-8") == answer(*call.split(), "--format", format)
    assert answer(*call.split(), "--format", format, "-o", "-") == path.read_text(encoding="utf-8")
    assert list(tmp_path.iterdir()) == [path]


def test_inconsistent_methods_are_computed_and_said_to_be(run):
    call = "modified", "--A", "0,0;1/2,0", "--b", "0,1/2", "--c", "0,1/3", "--order", "2"
    result = run(*call)
    assert result.exit_code == 0
    assert result.stderr.splitlines() == [
        "bseries: warning: row 2 of A sums to 1/2, but c[2] is 1/3",
        "bseries: warning: weights b sum to 1/2, not 1: the method is inconsistent",
    ]
    assert "inconsistent" in result.stdout
    data = json.loads(run(*call, "--format", "json").stdout)
    assert data["terms"][0]["coefficient"] == "1/2"
    assert "inconsistent" in data["issues"][1]
    assert "issues" not in json.loads(run("modified", "rk4", "--format", "json").stdout)


def test_values_can_repair_a_family(run):
    call = "modified", "--A", "0", "--b", "beta", "--symbols", "beta", "--set"
    assert run(*call, "beta=1").stderr == ""
    assert "inconsistent" in run(*call, "beta=2").stderr
