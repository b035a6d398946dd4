"""The benchmarks' pieces run, at tiny sizes. Nothing here asserts how long anything takes."""

import json
import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import click
import pytest

import bseries as bs

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks import algebra_cases, cases, hamiltonian_cases, rivals, scene_cases, texts, timing  # noqa: E402
from benchmarks.__main__ import main  # noqa: E402
from benchmarks.timing import Sample  # noqa: E402

EULER = bs.RungeKutta([[0.0]], [1.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    "prepare",
    [
        cases.at_hand("explicit-midpoint", 4),
        cases.at_hand("stormer-verlet-kdk", 3, bs.BSeries.coefficients),
        cases.at_hand(EULER, 4),
        cases.from_table("explicit-midpoint", 4),
        cases.of_series(EULER, 4),
        algebra_cases.modifying("explicit-midpoint", 4),
        algebra_cases.composition("explicit-midpoint", "rk4", 4),
        algebra_cases.substitution(4, kept=True),
        algebra_cases.substitution(4, kept=False),
        algebra_cases.structure(bs.symplecticity, "implicit-midpoint", 4),
        algebra_cases.conditions(4, 3),
        algebra_cases.fresh_series("tdrk5", 3),
        scene_cases.written_out("explicit-midpoint", "riccati", 3),
        scene_cases.per_point(lambda: bs.modified_field(bs.method("rk4"), bs.scene("riccati"), 3)),
        scene_cases.printed_formulas(compiled=False),
        scene_cases.compile_time(cached=True),
        hamiltonian_cases.once(lambda: hamiltonian_cases.verlet_brackets(3, quadratic=True)),
        scene_cases.per_point(lambda: hamiltonian_cases.energy("implicit-midpoint", "pendulum", 3)),
        cases.process(sys.executable, "-c", "pass"),
        cases.first_run(),
    ],
)
def test_every_kind_of_case_gives_a_sample(prepare):
    assert prepare()().seconds > 0


def test_a_process_of_its_own_reports_its_own_peak_memory():
    held = bytearray(200_000_000)
    held[::4096] = b"x" * len(held[::4096])
    sample = cases.fresh("float", 3)()()
    assert 5e6 < sample.peak < 180e6 < len(held) < timing.peak_memory()


def test_the_rows_hold_every_bar_of_the_table():
    rows = {case.name: case for case in cases.cases()}
    assert len(rows) == len(cases.cases())
    bars = {name: case.bar for name, case in rows.items() if case.bar is not None}
    assert bars["midpoint-9"] == 0.0002
    assert (bars["modifying-9"], bars["substitute-11"], bars["energy-9"]) == (0.001, 0.05, 0.01)
    assert (bars["brackets-9"], bars["hamiltonian-9"], bars["shadow-8"]) == (10, 2e-6, 2)
    assert len(bars) == 43
    assert all(case.peak_bar is not None for case in rows.values() if case.full)
    assert {rival.opponent for rival in rivals.RIVALS} <= rows.keys()
    assert {figure.opponent for figure in rivals.PUBLISHED} <= rows.keys()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "answer"),
    [
        ("modified equation", Fraction(233, 240)),
        ("composition", Fraction(251, 8)),
        ("substitution", Fraction(39, 20)),
        ("symplecticity", 5),
        ("energy preservation", 5),
        ("error coefficients", Fraction(-379, 1920)),
        ("order conditions of gauss3", 5),
    ],
)
def test_what_rivals_are_compared_with(task, answer):
    assert rivals.OURS[task](5) == answer
    assert {rival.task for rival in rivals.RIVALS} == rivals.OURS.keys()


def test_calls_are_timed_until_the_time_is_up_and_once_at_least():
    calls = []
    assert timing.time_calls(lambda: calls.append(1), least=0.0).seconds >= 0
    assert len(calls) == 1


@pytest.mark.parametrize("stale", [2, 6, 12])
def test_a_clock_that_stands_still_for_a_moment_makes_no_call_free(stale):
    now, readings = 0.0, []

    def call():
        nonlocal now
        now += 1e-4

    def clock():
        readings.append(readings[-1] if len(readings) == stale else now)
        return readings[-1]

    assert timing.time_calls(call, least=0.05, clock=clock).seconds == pytest.approx(1e-4)


def test_in_each_round_every_case_has_its_turn_until_its_budget_is_used():
    taken = []

    def sampler(name):
        return lambda: taken.append(name) or Sample(1.0)

    samplers = {"a": sampler("a"), "b": sampler("b")}
    samples = timing.interleave(samplers, 2, lambda done, name: None)
    assert taken == ["a", "b", "a", "b"]
    assert {name: len(found) for name, found in samples.items()} == {"a": 2, "b": 2}
    samples = timing.interleave(samplers, 3, lambda done, name: None, budget=-1.0)
    assert [len(found) for found in samples.values()] == [0, 0]


def test_best_is_the_least_time_and_the_least_peak():
    assert timing.best([Sample(2.0, 5), Sample(1.0, 7)]) == Sample(1.0, 5)
    assert timing.best([Sample(2.0), Sample(3.0)]) == Sample(2.0)


def test_a_process_that_fails_is_no_measurement():
    with pytest.raises(RuntimeError, match=r"failed: ZeroDivisionError: division by zero$"):
        timing.run([sys.executable, "-c", "1/0"])


def rival_environment(folder, answer):
    """A virtual environment whose Python says that everything is installed and gives one answer."""
    python = folder / "bin" / "python"
    python.parent.mkdir()
    python.write_text(f"#!/bin/sh\necho '{answer}'\n")
    python.chmod(0o755)
    return folder


needs_shell = pytest.mark.skipif(os.name == "nt", reason="the stand-in is a shell script")
MIDPOINT_9 = Fraction(19063, 26880)


@needs_shell
def test_a_rival_is_timed_by_what_it_reports(tmp_path):
    environment = rival_environment(tmp_path, json.dumps({"seconds": 2.5, "sum": str(MIDPOINT_9)}))
    versions = rivals.rival_versions(environment)
    case = rivals.rival_cases(environment, versions)[0]
    assert case.name == "midpoint-9-all/pybs"
    assert case.prepare()() == Sample(2.5)


@needs_shell
def test_a_rival_with_other_coefficients_is_no_rival(tmp_path):
    wrong = MIDPOINT_9 + Fraction(1, 10**9)
    environment = rival_environment(tmp_path, json.dumps({"seconds": 2.5, "sum": str(wrong)}))
    case = rivals.rival_cases(environment, rivals.rival_versions(environment))[0]
    with pytest.raises(RuntimeError, match="pybs gives another modified equation"):
        case.prepare()()


def test_rivals_that_are_not_installed_are_left_out(tmp_path):
    versions = rivals.rival_versions(tmp_path)
    assert set(versions.values()) == {None}
    assert rivals.rival_cases(tmp_path, versions) == []


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (None, "–"),
        (1.234e-7, "123 ns"),
        (1.234e-11, "0.0123 ns"),
        (0.00099949, "999 µs"),
        (0.00099951, "1 ms"),
        (61.4, "61.4 s"),
        (240, "240 s"),
    ],
)
def test_durations_have_three_digits(seconds, text):
    assert texts.duration(seconds) == text


def test_the_command_measures_prints_and_keeps(tmp_path):
    command = [sys.executable, "-m", "benchmarks", "--only", "midpoint-7*", "--rounds", "1", "--rivals", str(tmp_path)]
    kept, page = tmp_path / "run.json", tmp_path / "page.md"
    ended = subprocess.run(
        [*command, "--json", str(kept), "--output", str(page)], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert "Time and peak memory" in ended.stdout
    assert "not installed" in ended.stdout
    result = json.loads(kept.read_text())
    names = [row["name"] for row in result["rows"]]
    assert result["seconds"].keys() == {"rows"}
    assert names == ["calibration/compiled", "calibration/interpreted", "midpoint-7-all"]
    assert page.read_text().startswith("# Benchmarks\n")


def test_a_pattern_that_no_row_fits_is_refused():
    with pytest.raises(click.BadParameter, match="no row has a name like 'nothing'"):
        main.main(["--only", "nothing"], standalone_mode=False)


def test_an_output_that_cannot_be_written_is_refused_before_anything_is_measured(tmp_path):
    with pytest.raises(click.BadParameter, match=r"file must lie in a writable folder, but was .*page.md"):
        main.main(["--output", str(tmp_path / "missing" / "page.md")], standalone_mode=False)
