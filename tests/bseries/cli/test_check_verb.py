from __future__ import annotations

import csv
import io
import json
import re

import pytest

import bseries as bs


def facts(text: str) -> dict[str, str]:
    return {row["quantity"]: row["value"] for row in csv.DictReader(io.StringIO(text))}


def test_rk4_in_json(answer):
    data = json.loads(answer("check", "rk4", "--format", "json"))
    assert (data["kind"], data["order"]) == ("check", 4)
    # Σ e² = 1745/2880² (Butcher, Numerical Methods for Ordinary Differential Equations, section 318)
    assert data["error"]["norm_squared"] == "349/1658880"
    assert data["error"]["terms"][0] == {"tree": "[[[[τ]]]]", "coefficient": "-1/120"}


@pytest.mark.parametrize("name", ["rk4", "heun2", "gauss2", "kutta3", "stormer-verlet"])
def test_principal_error_is_the_first_term_of_the_modified_equation(answer, name):
    report = json.loads(answer("check", name, "--format", "json"))
    leading = report["order"] + 1
    terms = json.loads(answer("modified", name, "--order", str(leading), "--format", "json"))["terms"]
    expected = [(term["tree"], term["weight"]) for term in terms if term["order"] == leading]
    assert [(term["tree"], term["coefficient"]) for term in report["error"]["terms"]] == expected


@pytest.mark.parametrize(
    ("name", "explicit", "symmetric", "symplectic"),
    [
        ("rk4", "yes", "no", "no"),
        ("implicit-midpoint", "no", "yes", "yes"),
        ("trapezoidal", "no", "yes", "no"),
        ("radau-iia2", "no", "no", "no"),
        ("lobatto-iiie2", "no", "yes", "yes"),
    ],
)
def test_properties(answer, name, explicit, symmetric, symplectic):
    found = facts(answer("check", name, "--format", "csv"))
    answers = (found["explicit"], found["symmetric tableau"], found["symplectic tableau"])
    assert answers == (explicit, symmetric, symplectic)
    assert (found["symmetric"] == "to all 7 nodes tested") == (symmetric == "yes")
    assert (found["symplectic"] == "to all 7 nodes tested") == (symplectic == "yes")


def test_structure_says_how_far_and_what_breaks_it(answer):
    found = facts(answer("check", "rk4", "--format", "csv"))
    assert found["symplectic"] == "to 4 nodes, not for [τ,[[τ]]]"
    assert found["stage order"] == "1"
    assert found["simplifying assumptions"] == "B(4), C(1), D(1)"
    assert (found["A-stable"], found["imaginary stability interval"]) == ("no", "2.8284271247461903")
    data = json.loads(answer("check", "stormer-verlet", "--order", "4", "--format", "json"))
    assert data["structure_tested_to"] == 4
    assert data["properties"]["energy_preserving"] == {"order": 2, "breaks": "p[p[q]]"}
    assert data["properties"]["symplectic"] == {"order": 4, "breaks": None}
    assert "Not decided: A-stable" not in answer("check", "rk4")
    assert "depends on gamma" in answer("check", "sdirk2")


@pytest.mark.parametrize("name", ["avf", "grk4a", "ros34pw2", "strang", "takahashi-imada", "lawson4", "tdrk4", "gark2"])
def test_methods_that_are_no_tableaux_are_checked_too(answer, name):
    data = json.loads(answer("check", name, "--order", "4", "--format", "json"))
    assert data["order"] >= 2
    assert data["row_sums"] == []
    assert answer("check", name, "--order", "3")


def test_rows_of_every_format_agree(answer):
    found = facts(answer("check", "fehlberg45", "--format", "csv"))
    assert found["order"] == "4"
    assert found["order of embedded weights"] == "5"
    assert found["row sums"] == "0, 1/4, 3/8, 12/13, 1, 1/2"
    table, markdown = answer("check", "fehlberg45"), answer("check", "fehlberg45", "--format", "markdown")
    for name, value in found.items():
        assert any(line.split("  ", 1)[0] == name and line.endswith(value) for line in table.splitlines())
        assert f"| `{name}` | `{value}` |" in markdown
    assert r"$e([[[[\tau]]]])$ & $\frac{1}{780}$ \\" in answer("check", "fehlberg45", "--format", "latex")


@pytest.mark.parametrize("method", ["rk4", "gauss2", "sdirk2", "crouzeix3", "stormer-verlet", "dop853"])
def test_every_number_tree_and_formula_in_latex_is_mathematics(answer, method):
    """Outside of dollars there are words only, with numbers of nodes and names of parts."""
    rows = answer("check", method, "--format", "latex").splitlines()[2:-1]
    for row in rows:
        name, value = row.removesuffix(r" \\").split(" & ")
        words = re.sub(r"\$[^$]*\$", "", value)
        assert re.fullmatch(r"[a-z ]*(\d+ nodes?[a-z, ]*)?[, ]*", words), row
        assert not re.search(r"[\[\]^\\]", re.sub(r"\$[^$]*\$", "", name)), row
    assert len(rows) > 10
    if method == "rk4":
        assert r"stability function & $1 + z + \frac{1}{2} z^{2} + \frac{1}{6} z^{3} + \frac{1}{24} z^{4}$ \\" in rows
        assert r"stability at infinity & $\infty$ \\" in rows
        assert r"symplectic & to 4 nodes, not for $[\tau,[[\tau]]]$ \\" in rows


def test_nonzero_and_long_lists(answer):
    full, short = (facts(answer("check", "crouzeix3", "--format", "csv", *more)) for more in ((), ("--nonzero",)))
    assert short == {name: value for name, value in full.items() if not (name.startswith("e(") and value == "0")}
    assert len(short) < len(full)
    data = json.loads(answer("check", "crouzeix3", "--nonzero", "--format", "json"))
    assert [term["coefficient"] for term in data["error"]["terms"]] == [v for k, v in short.items() if k[:2] == "e("]
    text = answer("check", "lobatto-iiia-iiib3")
    assert "principal error coefficients are listed by --format csv and json" in text
    assert "e(p" not in text
    assert "e(p[p[p[p[p]]]])" in answer("check", "lobatto-iiia-iiib3", "--format", "csv")


def test_symbolic_family(answer):
    found = facts(answer("check", "sdirk2", "--format", "csv"))
    assert found["order"] == "2"
    assert "principal error norm" not in found
    assert facts(answer("check", "sdirk2", "--set", "gamma=1/2+sqrt(3)/6", "--format", "csv"))["order"] == "3"


def test_order_limits_the_test(answer):
    assert facts(answer("check", "rk4", "--order", "3", "--format", "csv"))["order"] == "at least 3"
    assert facts(answer("check", "rk4", "--order", "9" * 20, "--format", "csv"))["order"] == "4"


def test_errors_of_floats_beyond_doubles_are_refused():
    with pytest.raises(bs.SeriesError, match="coefficients must stay within the range of floats, but some overflowed"):
        bs.check(bs.RungeKutta([[1e300]], [1], warn=False))


def test_decimals_and_inconsistent_methods(run, answer):
    assert "decimals with 16 correct digits" in answer("check", "tsit5")
    result = run("check", "--A", "0", "--b", "1/2")
    assert result.exit_code == 0
    assert "inconsistent" in result.stdout
    assert "inconsistent" in result.stderr


SDIRK = ("--A", "0.292893218813452,0;0.707106781186548,0.292893218813452", "--b", "0.707106781186548,0.292893218813452")


def test_rounded_decimals_have_an_order_to_some_digits(answer, tmp_path):
    found = facts(answer("check", *SDIRK, "--format", "csv"))
    assert (found["order"], found["order to 15 digits"]) == ("1", "2")
    assert json.loads(answer("check", *SDIRK, "--format", "json"))["rounded_order"] == {"order": 2, "digits": 15}
    assert facts(answer("check", *SDIRK, "--digits", "15", "--format", "csv"))["order"] == "2"
    path = tmp_path / "method.json"
    path.write_text('{"A": [["0.333333333"]], "b": ["0.999999999"]}')
    assert facts(answer("check", str(path), "--digits", "8", "--format", "csv"))["order"] == "1"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rk4", "--digits", "9"], "digits must be left out for a method of the catalogue, but was 9"),
        ([*SDIRK, "--digits", "0"], "digits must be an integer from 1 to 1000, but was 0"),
        (["--digits", "9"], "digits must come with a tableau, but there was none"),
    ],
)
def test_digits_that_mean_nothing_are_refused(run, arguments, message):
    result = run("check", *arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in result.stderr
