"""Extreme steps and missing energies through the command: one sentence, an exit code, and JSON that others can read."""

from __future__ import annotations

import json
from fractions import Fraction

import pytest
from click.testing import CliRunner

import bseries as bs
from bseries.cli.application import application

pytestmark = pytest.mark.slow


def simulate(*arguments):
    return CliRunner().invoke(application, ["simulate", *arguments], prog_name="bseries")


MISTAKES = {
    "--step 0 --steps 3": "h must not be zero",
    "--step 1e-400 --steps 3": "h must not be zero",
    "--step nan --steps 3": "step must be a number, but 'nan' is not finite",
    "--step inf --steps 3": "step must be a number, but 'inf' is not finite",
    "--step -inf --steps 3": "step must be a number, but '-inf' is not finite",
    "--step 1e400 --steps 3": "h must be a finite number",
    "--step 1e300 --steps 3": "h must be small enough for rk4 on pendulum",
    "--step 1e308 --steps 3": "h must be small enough for a finite time",
    "--step tenth --steps 3": "step must be a number",
    "--step 0.1 --steps -3": "steps must be a whole number",
    "--step 0.1 --steps 2.5": "steps must be a whole number",
    "--step 0.1 --span nan": "span must be a number, but 'nan' is not finite",
    "--step 1e-300 --span 1": "span must take from 0 to 2^53 steps of 1/1000000",
    "--step 0 --span 1": "span must be at least 0, and h not 0",
    "--step 0.1 --steps 3 --start p=nan;q=0": "is not finite",
    "--step 1e300 --steps 3 --ensemble 2": "spread",
}  # fmt: skip


@pytest.mark.parametrize("line", MISTAKES)
def test_the_command_refuses_in_one_sentence(line, measured):
    result = simulate("pendulum", "--method", "rk4", *line.split())
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("bseries: error: ")
    assert result.stderr.count("\n") == 1
    assert MISTAKES[line] in result.stderr
    measured.said(
        f"`bseries simulate pendulum --method rk4 {line}`", "one sentence, exit code 2", f"“{MISTAKES[line]} …”"
    )


@pytest.mark.parametrize("step", ["1e-300", "-1/10", "1", "5e-324"])
def test_the_command_makes_all_other_steps(step):
    result = simulate("pendulum", "--method", "rk4", "--step", step, "--steps", "3", "--format", "json")
    assert result.exit_code == 0
    assert not result.stderr
    rows = {row["what"]: row for row in json.loads(result.stdout)["rows"]}
    assert rows["p"]["end"] == bs.integrate("rk4", bs.scene("pendulum"), h=float(Fraction(step)), steps=3).y[0, -1]


def test_the_command_warns_where_there_is_no_energy(measured):
    """And JSON has null: it knows no NaN."""
    line = ("lotka-volterra", "--method", "explicit-euler", "--step", "1", "--steps", "8")
    result = simulate(*line, "--format", "json")
    assert result.exit_code == 0
    assert (
        result.stderr
        == "bseries: warning: energy must be finite at the states that are observed, but was nan at t = 2\n"
    )
    rows = json.loads(result.stdout, parse_constant=pytest.fail)["rows"]
    assert rows[0] == {
        "what": "energy",
        "start": pytest.approx(1.92055845832016),
        "end": None,
        "change": None,
        "relative": None,
    }
    assert "nan" not in simulate(*line).stdout
    measured.said(f"`bseries simulate {' '.join(line)}`", "warns, null in JSON", "“energy must be finite …”")
