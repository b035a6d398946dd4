"""`bseries drift`, against the library, the lecture's drift, and itself in all formats."""

from __future__ import annotations

import csv
import io
import json
import re

import pytest

import bseries as bs

ASYMMETRIC = ("simplified-takahashi-imada", "--scene", "pendulum", "--effect", "asymmetry")
ORBIT = (*ASYMMETRIC, "--start", "p=5/2;q=0", "--step", "0.2")


@pytest.fixture
def drift(answer):
    """The answer in JSON."""
    return lambda *arguments: json.loads(answer("drift", *arguments, "--format", "json"))


def test_the_counter_example_of_the_lecture(drift):
    data = drift(*ORBIT)
    assert (data["kind"], data["verdict"], data["power"], data["effects"]) == (
        "drift",
        "linear drift",
        4,
        ["asymmetry"],
    )
    assert data["turns"][0]["gain"] == "-pi/240"
    assert float(data["slope"]) == pytest.approx(-6.54e-6, rel=1e-3)
    backwards = drift(*ASYMMETRIC, "--start", "p=-5/2;q=0", "--step", "0.2")
    assert float(backwards["slope"]) == pytest.approx(-float(data["slope"]))
    assert drift(*ASYMMETRIC, "--start", "p=1/2;q=0", "--step", "0.2")["verdict"] == "bounded"
    assert drift(*ASYMMETRIC[:3])["verdict"] == "bounded"  # the pendulum itself
    assert drift("takahashi-imada", *ASYMMETRIC[1:])["verdict"] == "bounded"


@pytest.mark.parametrize(("method", "verdict"), [("stormer-verlet", "bounded"), ("rk4", "linear drift")])
def test_the_harmonic_oscillator(drift, method, verdict):
    """|R(iy)|² = 1 − y⁶/72 + … for rk4, so that H = 1/2 changes by −h⁵/144 in a unit of time."""
    data = drift(method, "--scene", "harmonic-oscillator", "--step", "0.01")
    assert data["verdict"] == verdict
    if verdict == "linear drift":
        assert float(data["slope"]) == pytest.approx(-(0.01**5) / 144)


def test_json_says_what_the_library_computes(drift):
    report = bs.energy_drift(bs.method("rk4"), bs.scene("pendulum"), 6, y0=[2.5, 0], h=0.1)
    data = drift("rk4", "--scene", "pendulum", "--start", "p=5/2;q=0", "--step", "1/10", "--order", "6")
    assert data == report.to_dict() | {"h": 0.1, "slope": f"{report.slope():.10g}"}
    assert data["slope"].startswith("-")
    assert "slope" not in drift("rk4", "--scene", "pendulum")


def test_trajectories(drift, answer):
    call = ("rk4", "--scene", "henon-heiles", "--step", "0.1", "--steps", "2000")
    report = bs.energy_drift(bs.method("rk4"), bs.scene("henon-heiles"), h=0.1, steps=2000)
    assert drift(*call)["verdict"] == report.verdict
    assert re.search(r"mean of dH~/dt at h\^5 +-0.00\d+ ± \S+ over t = 200\n", answer("drift", *call))
    assert drift("rk4", "--scene", "henon-heiles")["verdict"] == "undecided"


def test_a_random_walk(answer):
    coupled = "(p1^2 + p2^2)/2 - cos(q1) - cos(q2) - cos(q1 - q2) + sin(2*q1)/5"
    arguments = ("simplified-takahashi-imada", "--hamiltonian", coupled, "--start", "p=1,-2;q=2,1", "--step", "0.1")
    found = answer("drift", *arguments, "--steps", "80000")
    assert re.search(r"\ndeviation of the energy after t, h = 0.1 +\S+\*sqrt\(t\)\n", found)


def test_all_formats_agree(answer):
    table, markdown = answer("drift", *ORBIT), answer("drift", *ORBIT, "--format", "markdown")
    rows = list(csv.reader(io.StringIO(answer("drift", *ORBIT, "--format", "csv"))))
    assert rows[:2] == [["what", "value"], ["verdict", "linear drift"]]
    assert ["leading slope of the energy at h = 0.2", "-6.5e-06"] in rows
    title = "Energy of simplified-takahashi-imada on pendulum with asymmetry: linear drift\n"
    assert table.startswith(title)
    assert markdown.startswith(title)
    for what, value in rows[1:]:
        assert re.search(rf"\n{re.escape(what)} +{re.escape(value)}\n", table)
        assert f"| `{what}` | `{value}` |\n" in markdown


def test_latex(answer):
    lines = answer("drift", *ORBIT, "--format", "latex").splitlines()
    assert lines[0] == r"\begin{tabular}{ll}"
    assert r"gain of the energy at h\textasciicircum{}4 in a period 2*pi of q & $- \frac{\pi}{240}$ \\" in lines
    assert any(line.startswith(r"dH\textasciitilde{}/dt at h\textasciicircum{}4 & $\frac{p") for line in lines)


def test_parameters_may_be_symbols(answer, drift):
    assert drift(*ASYMMETRIC, "--set", "alpha=1/5")["turns"][0]["gain"] == "-3*pi/125"
    symbolic = (*ASYMMETRIC, "--set", "alpha=alpha", "--start", "p=5/2;q=0", "--step", "0.2")
    assert drift(*symbolic)["turns"][0]["gain"] == "-3*pi*alpha**2/5"
    lines = r"mean of dH~/dt at h\^4 +-\S*alpha\*\*2\nleading slope of \D* 0.2 +-\S*alpha"
    assert re.search(lines, answer("drift", *symbolic))


MISTAKES = {
    "no scene": ("rk4", "SCENE must be given"),
    "no method": ("--scene pendulum", "METHOD must be given"),
    "no Hamiltonian": ("rk4 --scene riccati", "scene must have a Hamiltonian, but riccati has none"),
    "zero step": ("rk4 --scene pendulum --step 0", "h must be a number other than 0"),
    "no number": ("rk4 --scene pendulum --step x", "step must be a number|step must"),
    "few steps": ("rk4 --scene henon-heiles --step 0.1 --steps 10", "steps must be a whole number from 512 to 2"),
    "start": ("rk4 --scene pendulum --start 5/2", "start must be NAME=VALUE"),
    "block": ("rk4 --scene pendulum --start x=1", "there is no block x"),
    "no orbit": ("rk4 --hamiltonian p^2/2-q^2/2 --start p=1;q=1", "y0 must lie on a closed orbit"),
    "splitting": ("lawson4 --scene pendulum", "parts must say what L, N"),
    "blocks that are there": (
        "lawson4 --hamiltonian p^2/2-cos(q)",
        'parts must say what L, N .* in scene .blocks p, q., as in --parts "L=p;N=q"',
    ),
    "order zero": ("rk4 --scene pendulum --order 0", "order must be 1 or more, but was 0"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_end_in_one_line(run, mistake):
    line, sentence = MISTAKES[mistake]
    result = run("drift", *line.split())
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("bseries: error: ")
    assert result.stderr.count("\n") == 1
    assert re.search(sentence, result.stderr), result.stderr
