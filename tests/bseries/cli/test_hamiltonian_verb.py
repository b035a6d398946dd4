"""`bseries hamiltonian`, against values computed without trees and against itself in all formats."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import pytest
import sympy

import bseries as bs
from integrators.exact.expressions import parse_expression

REFERENCE = Path(__file__).parents[2] / "reference" / "lecture_values.json"
LECTURE = json.loads(REFERENCE.read_text(encoding="utf-8"))
VERLET = LECTURE["example6_stoermer_verlet"]
MIDPOINT = {k: term["fourier"] for k, term in LECTURE["example5_midpoint_pendulum"]["H_h^k"].items()}
EULER = LECTURE["example7_symplectic_euler_eq25"]["pendulum"]
KICK_DRIFT_KICK, DRIFT_KICK_DRIFT = VERLET["direct"]["pendulum"]["UTU"], VERLET["direct"]["pendulum"]["TUT"]
PENDULUM = ("--scene", "pendulum")
ASYMMETRIC = ("simplified-takahashi-imada", *PENDULUM, "--effect", "asymmetry")


@pytest.fixture
def hamiltonian(answer):
    """The answer in JSON: the data, and the formulas by power."""

    def read(*arguments: str):
        data = json.loads(answer("hamiltonian", *arguments, "--format", "json"))
        names = (*data["variables"], "omega")
        return data, {term["power"]: formula(term["hamiltonian"], names) for term in data["terms"]}

    return read


def formula(text: str, names=("p", "q")) -> sympy.Expr:
    return parse_expression(text, names=names)


def same(found: sympy.Expr, expected: sympy.Expr) -> bool:
    """Whether two Hamiltonians differ by a constant."""
    return all(sympy.simplify((found - expected).diff(x)) == 0 for x in sympy.symbols("p q"))


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("implicit-midpoint", {f"h^{k}": text for k, text in MIDPOINT.items()}),
        ("stormer-verlet", KICK_DRIFT_KICK),
        ("position-verlet", DRIFT_KICK_DRIFT),
        ("symplectic-euler-p", EULER),
    ],
)
def test_the_pendulum_of_the_lecture(hamiltonian, method, expected):
    data, terms = hamiltonian(method, *PENDULUM)
    assert (data["route"], data["variables"], sorted(terms)) == ("trees", ["p", "q"], [0, 1, 2, 3, 4])
    powers = {int(key[2:]): text for key, text in expected.items() if key.startswith("h^")}
    assert len(powers) > 1
    for k, text in powers.items():
        assert same(terms[k], formula(text))
        assert k == 0 or not same(terms[k], -formula(text))


@pytest.mark.parametrize("route", ["trees", "brackets", "generating-function", "integration"])
def test_all_routes_agree(hamiltonian, route):
    data, terms = hamiltonian("stormer-verlet", *PENDULUM, "--route", route)
    assert data["route"] == route
    assert same(terms[2], formula(KICK_DRIFT_KICK["h^2"]))
    assert same(terms[4], formula(KICK_DRIFT_KICK["h^4"]))


def test_the_harmonic_oscillator(hamiltonian):
    """Steps of Störmer–Verlet turn by ψ with cos ψ = 1 − x²/2, x = hω, and those of the midpoint rule by 2 arctan x/2.

    What turns p + iωq by ψ is H̃ = ψ/x · H; for kick–drift–kick p² + ω² (1 − x²/4) q² takes the place of p² + ω² q².
    """
    p, q, omega, x = *sympy.symbols("p q omega"), sympy.Symbol("x", positive=True)
    exact = {
        "stormer-verlet": sympy.acos(1 - x**2 / 2) / (2 * x * sympy.sqrt(1 - x**2 / 4))
        * (p**2 + omega**2 * (1 - x**2 / 4) * q**2),
        "implicit-midpoint": sympy.atan(x / 2) / x * (p**2 + omega**2 * q**2),
    }  # fmt: skip
    for method, closed in exact.items():
        data, terms = hamiltonian(method, "--scene", "harmonic-oscillator", "--parameter", "omega=omega")
        assert data["variables"] == ["p", "q"]
        taylor = sympy.expand(sympy.series(closed, x, 0, 6).removeO())
        for k, term in terms.items():
            assert sympy.expand(term - taylor.coeff(x, k) * omega**k) == 0
        assert terms[2] != 0


def test_poisson_systems(hamiltonian):
    terms = hamiltonian("symplectic-euler-p", "--scene", "lotka-volterra", "--order", "2")[1]
    second = formula("-(p^2/4 + p*q/2 - 2*p + log(p)/2 + q^2/4 - 5*q/2 + 2*log(q))")
    assert same(terms[0], formula("p - log(p) + q - 2*log(q)"))
    assert same(terms[1], second)


def test_methods_that_are_symplectic_on_this_scene_only(hamiltonian, answer):
    data, terms = hamiltonian(*ASYMMETRIC)
    assert data["route"] == "integration"
    gain = sympy.expand(terms[4].subs(sympy.Symbol("q"), sympy.Symbol("q") + 2 * sympy.pi) - terms[4])
    assert sympy.simplify(gain - sympy.pi / 240) == 0  # no function on the cylinder
    assert "Found on this scene, not for all Hamiltonians" in answer("hamiltonian", *ASYMMETRIC)
    assert "Found on this scene" not in answer("hamiltonian", "implicit-midpoint", *PENDULUM)


def test_json_follows_the_schema(answer):
    data = json.loads(answer("hamiltonian", "stormer-verlet", *PENDULUM, "--order", "3", "--format", "json"))
    assert data == {
        "schema": 1,
        "kind": "hamiltonian",
        "method": "stormer-verlet-kdk",
        "scene": "pendulum",
        "effects": [],
        "order": 3,
        "route": "trees",
        "domain": "QQ",
        "variables": ["p", "q"],
        "exists_through": None,
        "verdict": {
            "tested_to": 3,
            "general": {"hamiltonians": "all H = T(p) + U(q)", "order": 3, "breaks": None},
            "order": 3,
            "holds": True,
        },
        "terms": [
            {"power": 0, "hamiltonian": "p**2/2 - cos(q)"},
            {"power": 1, "hamiltonian": "0"},
            {"power": 2, "hamiltonian": "p**2*cos(q)/12 - sin(q)**2/24"},
        ],
    }


def test_all_formats_agree(answer):
    call = ("hamiltonian", "stormer-verlet", "--scene", "kepler", "--effect", "relativity", "--order", "3")
    data = json.loads(answer(*call, "--format", "json"))
    assert data["effects"] == ["relativity"]
    cells = [(str(term["power"]), term["hamiltonian"]) for term in data["terms"]]
    assert [tuple(row) for row in csv.reader(io.StringIO(answer(*call, "--format", "csv")))][1:] == cells
    title = "Modified Hamiltonian of stormer-verlet-kdk on kepler with relativity: powers h^0 to h^2, by trees"
    table, markdown = answer(*call), answer(*call, "--format", "markdown")
    assert table.startswith(title + "\n")
    assert markdown.startswith(title + "\n")
    for k, text in cells:
        assert f"\n{k}  {text}\n" in table
        assert f"| `{k}` | `{text}` |\n" in markdown


def test_powers_and_zeros(answer, hamiltonian):
    everything = hamiltonian("implicit-midpoint", *PENDULUM)[1]
    assert hamiltonian("implicit-midpoint", *PENDULUM, "--nonzero")[1] == {k: everything[k] for k in (0, 2, 4)}
    data, only = hamiltonian("implicit-midpoint", *PENDULUM, "--power", "2")
    assert (data["order"], only) == (3, {2: everything[2]})
    title = answer("hamiltonian", "implicit-midpoint", *PENDULUM, "--power", "2").splitlines()[0]
    assert title == "Modified Hamiltonian of implicit-midpoint on pendulum: power h^2, by trees"


def test_scenes_as_text(hamiltonian):
    expected = hamiltonian("strang", *PENDULUM, "--parts", "a=p;b=q", "--order", "3")[1]
    assert hamiltonian("stormer-verlet", *PENDULUM, "--order", "3")[1] == expected
    typed = ("stormer-verlet", "--hamiltonian", "p^2/2 - g*cos(q)", "--parameter", "g=1", "--order", "3")
    assert hamiltonian(*typed)[1] == expected
    equations = ("stormer-verlet", "--ode", "p' = -sin(q); q' = p", "--order", "3")
    data, terms = hamiltonian(*equations)
    assert data["route"] == "integration"
    assert all(same(terms[k], expected[k]) for k in terms)


def test_decimals_say_so(answer, hamiltonian):
    call = ("mclachlan-atela4", *PENDULUM)
    data, terms = hamiltonian(*call)
    assert data["digits"] > 10
    assert [k for k, term in terms.items() if term != 0] == [0, 4]
    assert "correct digits" in answer("hamiltonian", *call)


# Brackets.


@pytest.mark.parametrize(("method", "order"), [("stormer-verlet", "UTU"), ("position-verlet", "TUT")])
@pytest.mark.parametrize(("options", "key"), [((), "h^4_general"), (("--kinetic", "T"), "h^4_T_quadratic")])
def test_brackets_of_the_lecture(answer, method, order, options, key):
    data = json.loads(answer("hamiltonian", method, "--brackets", *options, "--nonzero", "--format", "json"))
    assert (data["kind"], data["kinetic"]) == ("brackets", "T" if options else None)
    for power, name in ((2, "h^2"), (4, key)):
        found = {"".join(term["letters"]): term["coefficient"] for term in data["terms"] if term["power"] == power}
        assert found == VERLET[order][name]


def test_the_end_of_the_series_is_told_beside_csv(run):
    call = ("hamiltonian", "rk4", "--scene", "pendulum", "--order", "5", "--format")
    limit = bs.modified_hamiltonian(bs.method("rk4"), bs.scene("pendulum"), 5).verdict.limit()
    result = run(*call, "csv")
    assert (result.exit_code, result.stderr) == (0, f"bseries: warning: {limit}\n")
    assert run(*call, "table").stderr == ""


def test_brackets_in_all_formats(answer):
    call = ("hamiltonian", "stormer-verlet", "--brackets", "--kinetic", "T", "--order", "3")
    title = "Modified Hamiltonian of stormer-verlet-kdk: powers h^0 to h^2, in brackets of T, U\n"
    table, markdown = answer(*call), answer(*call, "--nonzero", "--format", "markdown")
    assert table.startswith(title)
    assert "\n0  T + U\n1  0\n2  1/12 {T,{T,U}} - 1/24 {U,{U,T}}\n" in table
    assert markdown.startswith(title)
    assert "| `0` | `T + U` |\n| `2` | `1/12 {T,{T,U}} - 1/24 {U,{U,T}}` |\n" in markdown
    rows = list(csv.reader(io.StringIO(answer(*call, "--power", "2", "--format", "csv"))))
    assert rows == [["power", "bracket", "coefficient"], ["2", "{T,{T,U}}", "1/12"], ["2", "{U,{U,T}}", "-1/24"]]
    everything = list(csv.reader(io.StringIO(answer(*call, "--format", "csv"))))
    assert ["1", "{T,U}", "0"] in everything


def test_brackets_of_methods_published_as_decimals(answer):
    call = ("hamiltonian", "mclachlan-atela4", "--brackets")
    shown = answer(*call)
    data = json.loads(answer(*call, "--nonzero", "--format", "json"))
    assert "correct digits" in shown
    assert data["digits"] > 10
    assert {term["power"] for term in data["terms"]} == {0, 4}  # order 4: what cancels is zero


# Verdicts.


def test_every_format_says_where_the_modified_hamiltonian_of_rk4_ends(answer):
    call = ("hamiltonian", "rk4", *PENDULUM)
    text = answer(*call)
    assert "H~ exists through h^4 only: on pendulum the term with h^5 has no Hamiltonian; the first tree" in text
    assert "[τ,[[τ]]]" in text
    assert "The numerical solution follows" not in text
    assert "The numerical solution follows" in answer("hamiltonian", "gauss2", *PENDULUM, "--order", "3")
    data = json.loads(answer(*call, "--format", "json"))
    assert (data["exists_through"], data["verdict"]["general"]["breaks"]) == (4, "[τ,[[τ]]]")
    latex = answer(*call, "--format", "latex")
    assert r"$\widetilde{H}$ exists through $h^{4}$ only: on this scene the term with $h^{5}$ has" in latex
    assert r"[$\tau$,[[$\tau$]]]" in latex


def test_a_verdict_is_an_answer(answer, run):
    call = ("hamiltonian", "rk4", *PENDULUM)
    data = json.loads(answer(*call, "--verdict", "--format", "json"))
    verdict = bs.hamiltonians.hamiltonian_verdict(bs.method("rk4"), bs.scene("pendulum"), 7)
    assert verdict.general is not None
    assert data == {
        "schema": 1,
        "kind": "hamiltonian-verdict",
        "method": "rk4",
        "scene": "pendulum",
        "effects": [],
        "tested_to": 7,
        "general": {"hamiltonians": "all H", "order": 4, "breaks": "[τ,[[τ]]]"},
        "order": verdict.order,
        "holds": False,
    }
    assert (data["general"]["order"], str(verdict.general.breaks)) == (verdict.general.order, "[τ,[[τ]]]")
    refused = run(*call, "--order", "7")
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert run(*call, "--order", "5").exit_code == 0  # what is asked for is Hamiltonian


@pytest.mark.parametrize(
    ("method", "scene", "order", "holds"),
    [
        ("implicit-midpoint", "pendulum", 5, True),
        ("explicit-euler", "pendulum", 1, False),
        ("simplified-takahashi-imada", "pendulum", 5, True),
        ("simplified-takahashi-imada", "henon-heiles", 4, False),
        ("symplectic-euler-p", "lotka-volterra", 4, True),
        ("implicit-midpoint", "lotka-volterra", 2, False),
    ],
)
def test_verdicts(answer, method, scene, order, holds):
    data = json.loads(answer("hamiltonian", method, "--scene", scene, "--verdict", "--format", "json"))
    assert (data["order"], data["holds"]) == (order, holds)
    assert (data["general"] is None) == (scene == "lotka-volterra")


def test_verdicts_in_all_formats(answer):
    call = ("hamiltonian", "simplified-takahashi-imada", *PENDULUM, "--verdict")
    everyone, here = ["all H = T(p) + U(q) with quadratic T", "4", "p[q[p[q[p]]]]"], ["pendulum", "5", ""]
    assert list(csv.reader(io.StringIO(answer(*call, "--format", "csv"))))[1:] == [everyone, here]
    table, markdown = answer(*call), answer(*call, "--format", "markdown")
    title = "Modified equation of simplified-takahashi-imada on pendulum: Hamiltonian to order 5, tested to 5\n"
    for text in (table, markdown):
        assert text.startswith(title)
        assert "It has one on this scene, although not for all Hamiltonians" in text
    assert " & ".join(everyone) + r" \\" in answer(*call, "--format", "latex")
    assert "broken by\n" in table
    assert "| `pendulum` | `5` |  |\n" in markdown


# LaTeX.

LATEX_CALLS = {
    "pendulum": ("implicit-midpoint", *PENDULUM),
    "power": ("stormer-verlet", *PENDULUM, "--power", "2"),
    "zero": ("stormer-verlet", *PENDULUM, "--power", "3"),
    "components": ("stormer-verlet", "--scene", "lennard-jones", "--parameter", "particles=2", "--order", "3"),
    "roots": ("stormer-verlet", "--scene", "kepler", "--order", "3"),
    "poisson": ("symplectic-euler-p", "--scene", "lotka-volterra", "--order", "3"),
    "brackets": ("stormer-verlet", "--brackets"),
    "bracket of Euler": ("symplectic-euler-p", "--brackets", "--power", "1"),
    "algebraic brackets": ("yoshida4", "--brackets"),
}


@pytest.mark.few(3)
@pytest.mark.parametrize("call", LATEX_CALLS)
def test_latex_is_well_formed(answer, call):
    from matplotlib.mathtext import MathTextParser

    text = answer("hamiltonian", *LATEX_CALLS[call], "--format", "latex")
    assert text.startswith("\\begin{align*}\n\\widetilde{H} &=")
    assert text.endswith("\n\\end{align*}\n")
    lines = text.splitlines()[1:-1]
    assert all(line.endswith(r" \\") for line in lines[:-1])
    parser = MathTextParser("agg")
    for line in lines:
        parser.parse(f"${line.removesuffix(' ' + chr(92) * 2).replace('&', '')}$")


def test_latex(answer):
    found = answer("hamiltonian", *LATEX_CALLS["power"], "--format", "latex")
    expected = (
        r"\cdots + h^{2} \left(\frac{p^{2} \cos{\left(q \right)}}{12} - \frac{\sin^{2}{\left(q \right)}}{24}\right)"
    )
    rest = r" \\" + "\n&\\quad + \\mathcal{O}(h^{3})"
    assert found == f"\\begin{{align*}}\n\\widetilde{{H}} &= {expected}{rest}\n\\end{{align*}}\n"
    first = answer("hamiltonian", *LATEX_CALLS["bracket of Euler"], "--format", "latex")
    assert r"\cdots + h \left(\frac{1}{2} \{T,U\}\right) + \mathcal{O}(h^{2})" in first


MISTAKES = {
    "not symplectic": ("rk4 --scene pendulum --order 7",
                       r"method must be symplectic on pendulum, but rk4 is Hamiltonian for all H to order 4, where "
                       r"\[τ,\[\[τ\]\]\] breaks it, and on pendulum to order 5, where the term with h\^5 breaks it"),
    "explicit Euler": ("explicit-euler --scene kepler", r"symplectic on kepler, .* the term with h\^1 breaks it"),
    "not Poisson": ("implicit-midpoint --scene lotka-volterra",
                    r"method must be a Poisson integrator on lotka-volterra, but .* the term with h\^2 breaks it"),
    "not Hamiltonian": ("implicit-midpoint --scene pendulum --effect damping", "scene must be Hamiltonian"),
    "time as a variable": ("gauss2 --scene pendulum --effect drive", "scene must be canonical or a Poisson system"),
    "no structure": ("implicit-midpoint --scene riccati", "scene must be canonical or a Poisson system"),
    "no structure for a verdict": ("rk4 --scene riccati --verdict", "scene must be canonical or a Poisson system"),
    "no scene": ("rk4", "SCENE must be given: .* or else --brackets"),
    "no scene for a verdict": ("rk4 --verdict", "SCENE must be given"),
    "no method": ("--scene pendulum", "METHOD must be given"),
    "scene with brackets": ("strang --brackets --scene pendulum", "SCENE must be left out with --brackets"),
    "parts with brackets": ("strang --brackets --parts a=p;b=q", "parts must be left out with --brackets"),
    "route with brackets": ("strang --brackets --route trees", "route must be left out with --brackets"),
    "verdict with brackets": ("strang --brackets --verdict", "verdict must be left out with --brackets"),
    "kinetic without": ("strang --scene pendulum --kinetic T", "kinetic must come with --brackets, but was 'T'"),
    "unknown kinetic": ("strang --brackets --kinetic T", "quadratic_kinetic must be .* one of a, b, but was 'T'"),
    "one part": ("rk4 --brackets", "method must treat parts of the field differently, but rk4 has one part only"),
    "route with a verdict": ("rk4 --scene pendulum --verdict --route trees", "route must be left out with --verdict"),
    "power with a verdict": ("rk4 --scene pendulum --verdict --power 2", "power must be left out with --verdict"),
    "unknown route": ("rk4 --scene pendulum --route x", "route must be one of auto, trees, brackets"),
    "route that leads nowhere": ("gauss2 --scene pendulum --route brackets", "method must treat parts"),
    "trees of what is not symplectic": ("rk4 --scene pendulum --route trees", "symplectic for the route 'trees'"),
    "order zero": ("strang --brackets --order 0", "order must be 1 or more, but was 0"),
    "too many brackets": ("strang --brackets --order 40", "order must be smaller: there are"),
    "power beyond the order": ("gauss2 --scene pendulum --order 3 --power 3", "power must be from 0 to 2, but was 3"),
    "unknown scene": ("rk4 --scene pendulun", "scene must be one of the catalogue.*did you mean pendulum"),
    "splitting": ("lawson4 --scene pendulum", 'parts must say what L, N .* as in --parts "L=p;N=q"'),
    "code": ("rk4 --hamiltonian p^2+__import__('os')", "is undefined|must be a formula"),
    "unknown format": ("rk4 --scene pendulum --format xml", "format must be one of table"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_end_in_one_line(run, tmp_path, monkeypatch, mistake):
    monkeypatch.chdir(tmp_path)
    line, sentence = MISTAKES[mistake]
    result = run("hamiltonian", *line.split(), "-o", "never.csv", *(["--format", "csv"] * ("--format" not in line)))
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("bseries: error: ")
    assert result.stderr.count("\n") == 1
    assert re.search(sentence, result.stderr), result.stderr
    assert not list(tmp_path.iterdir())


def test_functions_that_are_only_named(answer, run):
    named = "hamiltonian", "stormer-verlet", "--hamiltonian", "p^2/2+U(q)", "--order", "3"
    assert "-U'**2/24 + U''*p**2/12" in answer(*named)
    assert r"\frac{U'' p^{2}}{12}" in answer(*named, "--format", "latex")
    assert "verdict must be left out for functions that are only named" in run(*named, "--verdict").stderr
