"""`bseries equation`, against values computed without trees and against itself in all formats."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import sympy

from integrators.exact.expressions import parse_expression

REFERENCE = Path(__file__).parents[2] / "reference" / "lecture_values.json"
LECTURE = json.loads(REFERENCE.read_text(encoding="utf-8"))
RICCATI = LECTURE["example1_and_fig1"]["coefficients"]
LOTKA_VOLTERRA = LECTURE["example2_lotka_volterra_and_exercise2"]
LINEAR = LECTURE["example3_linear"]["b"]
PENDULUM = LECTURE["example5_midpoint_pendulum"]["vector_field_h^k"]
PAIR = ("p", "q")
DAMPED = ("equation", "rk4", "--scene", "pendulum", "--effect", "damping", "--parameter", "gamma=1/5")


@pytest.fixture
def equation(answer):
    """The equation in JSON: the data, and the formulas by power."""

    def read(*arguments: str, stdin: str | None = None):
        data = json.loads(answer("equation", *arguments, "--format", "json", stdin=stdin))
        return data, {
            term["power"]: [formula(text, data["variables"]) for text in term["field"]] for term in data["terms"]
        }

    return read


def formula(text: str, names=PAIR) -> sympy.Expr:
    return parse_expression(text, names=names)


def same(found, expected) -> bool:
    return all(sympy.simplify(x - y) == 0 for x, y in zip(found, expected, strict=True))


@pytest.mark.parametrize("method", RICCATI)
def test_square_equation(equation, method):
    coefficients = RICCATI[method]
    data, terms = equation(method, "--scene", "riccati", "--order", str(len(coefficients)))
    y = sympy.Symbol("y")
    assert data["variables"] == ["y"]
    assert terms == {k: [sympy.Rational(c) * y ** (k + 2)] for k, c in enumerate(coefficients)}


@pytest.mark.parametrize(
    ("method", "key"),
    [
        ("explicit-euler", "explicit_euler"),
        ("symplectic-euler-p", "symplectic_euler_p_implicit"),
        ("symplectic-euler-q", "symplectic_euler_q_implicit"),
    ],
)
def test_lotka_volterra(equation, method, key):
    expected = LOTKA_VOLTERRA[key]
    built_in = equation(method, "--scene", "lotka-volterra", "--order", "3")[1]
    text = "q' = q*(p-1); p' = p*(2-q)"
    typed, typed_terms = equation(method, "--ode", text, "--order", "3")
    blocked = equation(method, "--ode", text, "--blocks", "q=q;p=p", "--order", "3")[1]
    assert sorted(typed["variables"]) == ["p", "q"]
    for k in range(3):
        field = {x: formula(expected[x][k]) for x in PAIR}
        assert same(built_in[k], [field["p"], field["q"]])
        assert same(typed_terms[k], [field[x] for x in typed["variables"]])
        assert same(blocked[k], [field["q"], field["p"]])


@pytest.mark.parametrize("source", [("--scene", "pendulum"), ("--hamiltonian", "p^2/2 - cos(q)")])
def test_midpoint_rule_on_the_pendulum(equation, source):
    data, terms = equation("implicit-midpoint", *source, "--order", "5")
    assert (data["variables"], sorted(terms)) == (["p", "q"], [0, 1, 2, 3, 4])
    assert terms[1] == terms[3] == [0, 0]
    circle = {sympy.Symbol("c"): sympy.cos(sympy.Symbol("q")), sympy.Symbol("s"): sympy.sin(sympy.Symbol("q"))}
    for k, field in PENDULUM.items():
        expected = [formula(field[x], ["p", "q", "c", "s"]).subs(circle) for x in PAIR]
        assert same(terms[int(k)], expected)
        assert int(k) == 0 or not same(terms[int(k)], [-g for g in expected])


@pytest.mark.parametrize("method", ["rk4", "heun", "implicit_midpoint"])
def test_linear_systems(equation, method):
    b, matrix = LINEAR[method], sympy.Matrix([[0, -1, 2], [1, 0, 0], [0, 3, 1]])
    data, terms = equation(method, "--scene", "linear", "--parameter", "matrix=0,-1,2;1,0,0;0,3,1", "--order", "6")
    y = sympy.Matrix([sympy.Symbol(name) for name in data["variables"]])
    for k, coefficient in enumerate(b):
        assert same(terms[k], sympy.Rational(coefficient) * matrix ** (k + 1) * y)
    assert data["trees"] == {"needed": 6, "total": 37}  # only the tall trees


def test_modifying_integrator(equation):
    # y + h f_h(y) = y/(1 - h y), the exact flow of y' = y², for f_h = y²/(1 - h y)
    data, terms = equation("explicit-euler", "--scene", "riccati", "--order", "5", "--modifying")
    assert data["modifying"]
    assert terms == {k: [sympy.Symbol("y") ** (k + 2)] for k in range(5)}


def test_json_follows_the_schema(answer):
    data = json.loads(answer("equation", "stormer-verlet", "--scene", "pendulum", "--order", "3", "--format", "json"))
    assert data == {
        "schema": 1,
        "kind": "equation",
        "method": "stormer-verlet-kdk",
        "scene": "pendulum",
        "effects": [],
        "order": 3,
        "modifying": False,
        "domain": "QQ",
        "trees": {"needed": 7, "total": 20},
        "variables": ["p", "q"],
        "terms": [
            {"power": 0, "field": ["-sin(q)", "p"]},
            {"power": 1, "field": ["0", "0"]},
            {"power": 2, "field": ["(p**2 + cos(q))*sin(q)/12", "p*cos(q)/6"]},
        ],
    }


def test_all_formats_agree(answer):
    data = json.loads(answer(*DAMPED, "--format", "json"))
    assert data["effects"] == ["damping"]
    cells = [(term["power"], x, g) for term in data["terms"] for x, g in zip(PAIR, term["field"], strict=True)]
    rows = csv.DictReader(io.StringIO(answer(*DAMPED, "--format", "csv")))
    assert [(int(row["power"]), row["variable"], row["field"]) for row in rows] == cells
    table = answer(*DAMPED)
    title = "Modified equation of rk4 on pendulum with damping: powers h^0 to h^4, 17 of 17 trees"
    assert table.startswith(title + "\n")
    lines = [line.split(maxsplit=2) for line in table.splitlines() if re.match(r"\d  [pq] ", line)]
    assert [(int(k), x, g) for k, x, g in lines] == cells
    markdown = answer(*DAMPED, "--format", "markdown")
    assert markdown.startswith(title + "\n")
    assert all(f"| `{k}` | `{x}` | `{g}` |\n" in markdown for k, x, g in cells)


def test_powers_and_zeros(answer, equation):
    everything = equation("rk4", "--scene", "pendulum", "--order", "5")[1]
    assert equation("rk4", "--scene", "pendulum", "--nonzero")[1] == {k: everything[k] for k in (0, 4)}
    data, only = equation("rk4", "--scene", "pendulum", "--power", "4")
    assert (data["order"], only) == (5, {4: everything[4]})
    assert equation("rk4", "--scene", "pendulum", "--order", "6", "--power", "4")[1] == only
    title = answer("equation", "rk4", "--scene", "pendulum", "--power", "4").splitlines()[0]
    assert title == "Modified equation of rk4 on pendulum: power h^4, 17 of 17 trees"
    rows = answer("equation", "symplectic-euler-p", "--scene", "pendulum", "--nonzero", "--format", "csv").splitlines()
    assert rows[1:3] == ["0,p,-sin(q)", "0,q,p"]
    assert not any(row.endswith(",0") for row in rows)


def test_parts_of_splittings(equation):
    # kick–drift–kick either way: a is what half steps are taken of
    verlet = equation("stormer-verlet", "--scene", "pendulum", "--order", "4")[1]
    assert equation("strang", "--scene", "pendulum", "--parts", "a=p;b=q", "--order", "4")[1] == verlet
    assert equation("strang", "--scene", "pendulum", "--parts", "a=q;b=p", "--order", "4")[1] != verlet
    named = ("--ode", "x' = -sin(y); y' = x", "--blocks", "a=x;b=y", "--order", "4")
    renamed = {sympy.Symbol("x"): sympy.Symbol("p"), sympy.Symbol("y"): sympy.Symbol("q")}
    for k, field in equation("strang", *named)[1].items():
        assert [g.subs(renamed) for g in field] == verlet[k]
    springs = equation("strang", "--scene", "fpu", "--parts", "a=linear;b=nonlinear", "--power", "2")[0]
    assert springs["trees"]["needed"] < springs["trees"]["total"]


def test_time_is_made_a_variable(answer, equation):
    call = ("stormer-verlet", "--scene", "pendulum", "--effect", "drive", "--order", "3")
    data, terms = equation(*call)
    assert (data["variables"], terms[0][2]) == (["p", "q", "t"], 1)
    assert data["notes"] == ["the field depends on the time t: made autonomous by the variable t with t' = 1"]
    assert "The field depends on the time t: made autonomous by the variable t" in answer("equation", *call)


def test_scene_files_and_standard_input(answer, equation, tmp_path):
    path = tmp_path / "damped.toml"
    answer("scenes", *DAMPED[3:], "-o", str(path))
    expected = json.loads(answer(*DAMPED, "--format", "json"))
    assert equation("rk4", "--scene", str(path))[0] == expected
    assert equation("rk4", "--scene", "-", stdin=path.read_text())[0] == expected
    changed = equation("rk4", "--scene", str(path), "--parameter", "gamma=1/3", "--order", "1")[1]
    assert str(changed[0][0]) == "-p/3 - sin(q)"
    driven = equation("rk4", "--scene", str(path), "--effect", "drive", "--order", "1")[0]
    assert (driven["effects"], driven["variables"]) == (["drive"], ["p", "q", "t"])


def test_inexact_methods_say_so(answer, equation, run):
    tsit5 = answer("equation", "tsit5", "--scene", "riccati", "--order", "7", "--nonzero")
    assert "decimals with 16 correct digits" in tsit5
    assert [line[:3] for line in tsit5.splitlines() if "y**" in line] == ["0  ", "5  ", "6  "]
    assert equation("tsit5", "--scene", "riccati", "--order", "1")[0]["digits"] == 16
    floats = '{"A": [[0.5]], "b": [1.0], "domain": "float"}'
    assert "Floating point" in answer("equation", "-", "--scene", "riccati", stdin=floats)
    result = run("equation", "--A", "0", "--b", "1/2", "--scene", "riccati", "--format", "json")
    assert result.exit_code == 0
    assert "inconsistent" in json.loads(result.stdout)["issues"][0]
    assert "inconsistent" in result.stderr


LATEX_CALLS = {
    "powers": ("explicit-euler", "--scene", "riccati"),
    "components": ("stormer-verlet", "--scene", "n-body", "--parameter", "masses=1,1",
                   "--parameter", "positions=1,0;-1,0", "--parameter", "velocities=0,1/2;0,-1/2", "--order", "1"),
    "names": ("rk4", "--order", "2",
              "--ode", "θ_1' = omega_b*_x; omega_b' = -sqrt(xi2)*exp(θ_1); xi2' = 1/θ_1; _x' = atan(_x)"),
    "symbols": ("sdirk2", "--scene", "riccati", "--order", "3"),
    "roots": ("gauss2", "--scene", "pendulum", "--effect", "damping"),
    "one power": ("rk4", "--scene", "pendulum", "--power", "4"),
    "inexact": ("tsit5", "--scene", "riccati", "--order", "6"),
}  # fmt: skip


@pytest.mark.parametrize("call", LATEX_CALLS)
def test_latex_is_well_formed(answer, call):
    from matplotlib.mathtext import MathTextParser

    text = answer("equation", *LATEX_CALLS[call], "--format", "latex")
    assert text.startswith("\\begin{align*}\n\\dot{")
    assert text.endswith("\n\\end{align*}\n")
    lines = text.splitlines()[1:-1]
    assert all(line.endswith(r" \\") for line in lines[:-1])
    parser = MathTextParser("agg")
    for line in lines:
        assert line.count("&") == 1
        parser.parse(f"${line.removesuffix(' ' + chr(92) * 2).replace('&', '')}$")


def test_latex(answer):
    square = (
        r"\dot{y} &= y^{2} - h\, y^{3} + h^{2}\, \frac{3 y^{4}}{2} - h^{3}\, \frac{8 y^{5}}{3} + \mathcal{O}(h^{4})"
    )
    found = answer("equation", *LATEX_CALLS["powers"], "--order", "4", "--format", "latex")
    assert found == f"\\begin{{align*}}\n{square}\n\\end{{align*}}\n"
    verlet = answer("equation", "stormer-verlet", "--scene", "pendulum", "--power", "2", "--format", "latex")
    assert "\\dot{q} &= \\cdots + h^{2}\\, \\frac{p \\cos{\\left(q \\right)}}{6} + \\mathcal{O}(h^{3})\n" in verlet
    nothing = answer("equation", "rk4", "--ode", "x' = 0; y' = -x - 1", "--order", "1", "--format", "latex")
    assert "\\dot{x} &= 0 + \\mathcal{O}(h) \\\\\n\\dot{y} &= - x - 1 + \\mathcal{O}(h)\n" in nothing
    names = answer("equation", *LATEX_CALLS["names"], "--format", "latex")
    assert r"\dot{\theta}_{1} &=" in names
    assert r"\dot{\omega}_{b} &=" in names
    assert r"\dot{\mathrm{\_x}} &=" in names
    assert r"\dot{p}_{x,1} &=" in answer("equation", *LATEX_CALLS["components"], "--format", "latex")


MISTAKES = {
    "no scene": ("rk4", "SCENE must be given: a name"),
    "no method": ("--scene pendulum", "METHOD must be given"),
    "two scenes": ("rk4 --scene pendulum --ode y'=y", "SCENE must be given in one way, but was by --scene and --ode"),
    "blocks of a scene": ("rk4 --scene pendulum --blocks p=x", "blocks must come with --ode or --hamiltonian"),
    "nothing but an effect": ("rk4 --effect damping", "effect and parameter must come with a SCENE"),
    "unknown scene": ("rk4 --scene pendulun", "scene must be one of the catalogue.*did you mean pendulum"),
    "unknown effect": ("rk4 --scene pendulum --effect damp", "the effects are asymmetry, damping, drive"),
    "parameter of an effect that is off": ("rk4 --scene pendulum --parameter gamma=1", "unless .* is on"),
    "keyword": ("rk4 --scene pendulum --parameter self=1", "parameter must be one of the scene's, but was 'self'"),
    "no value": ("rk4 --scene kepler --parameter mu", "parameter must be NAME=VALUE, as in mu=1/2, but was 'mu'"),
    "two values": ("rk4 --scene kepler --parameter mu=1 --parameter mu=2", "parameter must give each name once"),
    "value is code": ("rk4 --scene kepler --parameter mu=open('x')", "parameters.mu must"),
    "splitting": ("lawson4 --scene pendulum", 'parts must say what L, N .* as in --parts "L=p;N=q"'),
    "parts of the field": ("strang --scene fpu", '--parts "a=linear;b=nonlinear", but were not given'),
    "no blocks": ("stormer-verlet --ode u'=v;v'=-u", 'blocks must say which of u, v the parts p, q .* "p=…;q=…"'),
    "one variable": ("stormer-verlet --scene riccati", "scene must have blocks or parts for p, q of stormer-verlet"),
    "parts of one": ("rk4 --scene pendulum --parts a=p", "parts must be left out for rk4"),
    "misspelt part": ("strang --scene pendulum --parts a=p;c=q", "parts must map a, b to blocks or parts"),
    "unknown part": ("strang --scene pendulum --parts a=p;b=z", "parts.b must be of the scene's p, q"),
    "half the field": ("strang --scene abc --parts a=a;b=b", "parts must be the whole field of abc-flow"),
    "no parts": ("strang --scene pendulum --parts a", "parts must be NAME=VALUE, as in a=q;b=p, but was 'a'"),
    "matrix as a part": ("ros34pw2 --scene pendulum", "ros34pw2 has an auxiliary matrix"),
    "special method": ("rkn-nystrom4 --scene double-pendulum", "of the kind that rkn-nystrom4 is meant for"),
    "order zero": ("rk4 --scene pendulum --order 0", "order must be 1 or more, but was 0"),
    "order beyond tables": ("rk4 --scene pendulum --order 61", "order must be 60 or less"),
    "power beyond the order": ("rk4 --scene pendulum --order 3 --power 3", "power must be from 0 to 2, but was 3"),
    "negative power": ("rk4 --scene pendulum --power -1", "power must be from 0 to 4, but was -1"),
    "wordy power": ("rk4 --scene pendulum --power two", "power must be a whole number, but was 'two'"),
    "code": ("rk4 --ode y'=__import__('os')", "os is undefined|must be a formula"),
    "attribute": ("rk4 --ode y'=y.__class__", "must be a formula|is undefined"),
    "no equation": ("rk4 --ode=", "equations must be as in"),
    "second order": ("rk4 --ode y''=-y", "equations must be of first order"),
    "unknown name": ("rk4 --ode y'=z", "z is undefined"),
    "two equations": ("rk4 --ode y'=y;y'=2", "equations must be one for each variable, but y had two"),
    "no Hamiltonian": ("rk4 --hamiltonian x+y", "hamiltonian must have|has neither|must be known"),
    "missing file": ("rk4 --scene missing.toml", "missing.toml must be a readable file"),
    "unknown format": ("rk4 --scene pendulum --format xml", "format must be one of table"),
    "misspelt option": ("rk4 --scene pendulum --efect x", "No such option.*see `bseries equation --help`"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_end_in_one_line(run, tmp_path, monkeypatch, mistake):
    monkeypatch.chdir(tmp_path)
    line, sentence = MISTAKES[mistake]
    result = run("equation", *line.split(), "-o", "never.csv", *(["--format", "csv"] if "--format" not in line else []))
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("bseries: error: ")
    assert result.stderr.count("\n") == 1
    assert re.search(sentence, result.stderr), result.stderr
    assert os.listdir() == []


def test_two_files_on_one_standard_input(run):
    result = run("equation", "-", "--scene", "-", stdin='{"A": [[0]], "b": [1]}')
    assert (result.exit_code, result.stdout) == (2, "")
    assert "METHOD and SCENE must not both be -" in result.stderr


def complete(monkeypatch, words: str) -> set[str]:
    from click.shell_completion import BashComplete

    from bseries.cli.application import application

    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split(" ")) - 1))
    lines = BashComplete(application, {}, "bseries", "_BSERIES_COMPLETE").complete().splitlines()
    return {line.partition(",")[2] for line in lines}


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("bseries equation rk4 --scene pert", {"perturbed-kepler"}),
        ("bseries equation rk4 --scene pendulum --effect d", {"damping", "drive"}),
        ("bseries equation rk4 --scene fpu --effect ", set()),
        ("bseries equation rk4 --effect so", {"softening"}),
        ("bseries equation rk4 --scene ./sc", {"./sc"}),
        ("bseries scenes pert", {"perturbed-kepler"}),
        ("bseries scenes kepler --effect r", {"relativity"}),
        ("bseries equa", {"equation"}),
    ],
)
def test_completion(monkeypatch, words, expected):
    assert complete(monkeypatch, words) == expected


def test_help_is_fast_and_answers_do_not_depend_on_hashes():
    code = (
        "import sys; from bseries.cli.application import application\n"
        "for line in (['equation', '--help'], ['scenes', '--help']):\n"
        "    application(line, standalone_mode=False)\n"
        "    assert not {'numpy', 'sympy', 'fractions', 'bseries.fields.modified_fields'} & set(sys.modules)\n"
        "for form in ('csv', 'latex'):\n"
        "    application(['equation', 'strang', '--scene', 'pendulum', '--effect', 'drive', '--parts', 'a=p,t;b=q',"
        " '--order', '4', '--format', form], standalone_mode=False)\n"
        "application(['scenes', 'kepler', '--effect', 'drag', '--toml'], standalone_mode=False)\n"
    )
    answers = set()
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        answers.add(
            subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, env=environment).stdout
        )
    assert len(answers) == 1
