"""`bseries simulate`, against the library and against itself in all formats."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from integrators import scene
from integrators.runs.integration import integrate
from integrators.runs.trajectory import load_trajectory

RUN = ("simulate", "pendulum", "--method", "stormer-verlet", "--step", "0.1", "--steps", "1000")


@pytest.fixture
def rows(answer):
    """The rows of the answer in JSON, by name."""

    def read(*arguments):
        data = json.loads(answer("simulate", *arguments, "--format", "json"))
        return data, {row["what"]: row for row in data["rows"]}

    return read


def test_json_says_what_the_library_computes(rows):
    data, found = rows(*RUN[1:])
    run = integrate("stormer-verlet", scene("pendulum"), h=0.1, steps=1000, observe="energy")
    assert [found[x]["end"] for x in ("p", "q")] == run.y[:, -1].tolist()
    energy = run.observed["energy"]
    assert found["energy"]["change"] == abs(energy - energy[0]).max()
    assert found["energy"]["relative"] == found["energy"]["change"] / abs(energy[0])
    head = {key: data[key] for key in ("schema", "kind", "method", "scene", "effects", "h", "steps", "t", "file")}
    assert head == {
        "schema": 1, "kind": "simulation", "method": "stormer-verlet-kdk", "scene": "pendulum", "effects": [],
        "h": 0.1, "steps": 1000, "t": [0.0, 100.0], "file": None,
    }  # fmt: skip


def test_table_and_markdown_say_the_same(answer):
    table, markdown = answer(*RUN), answer(*RUN, "--format", "markdown")
    title = "stormer-verlet-kdk on pendulum: 1,000 steps of 0.1, t = 0 to 100"
    assert table.splitlines()[0] == markdown.splitlines()[0] == title
    for name in ("energy", "p", "q"):
        line = next(line for line in table.splitlines() if line.startswith(f"{name} "))
        assert all(f"`{cell}`" in markdown for cell in line.split())


def test_csv_is_the_trajectory(answer):
    lines = list(csv.reader(io.StringIO(answer(*RUN, "--save-every", "300", "--format", "csv"))))
    run = integrate("stormer-verlet", scene("pendulum"), h=0.1, steps=1000, save_every=300, observe="energy")
    assert lines[0] == ["t", "p", "q", "energy"]
    np.testing.assert_array_equal(np.array(lines[1:], dtype=float).T, [run.t, *run.y, run.observed["energy"]])


def test_the_file_holds_the_trajectory(answer, tmp_path):
    path = tmp_path / "run.npz"
    text = answer(*RUN, "--save-every", "10", "--observe-every", "5", "-o", str(path))
    assert f"{path} has 101 states.\n" in text
    run = load_trajectory(path)
    assert (len(run.t), len(run.observed_t)) == (101, 201)
    assert list(tmp_path.iterdir()) == [path]


def test_effects_parameters_starts_and_observers(rows):
    data, found = rows(
        "kepler", "--effect", "drag", "--start", "p=0,1;q=1,0", "--method", "gauss2", "--step", "1/100", "--span", "1",
        "--observe", "energy", "--observe", "angular_momentum",
    )  # fmt: skip
    assert (data["effects"], data["steps"]) == (["drag"], 100)
    assert list(found) == ["energy", "angular_momentum", "p1", "p2", "q1", "q2"]
    assert (found["angular_momentum"]["start"], found["p2"]["start"]) == (1.0, 1.0)
    assert found["angular_momentum"]["end"] < 1


@pytest.mark.parametrize(
    ("span", "step", "steps"), [("1", "0.1", 10), ("1", "-1/10", 10), ("2*sqrt(2)", "0.1", 29), ("0", "1", 0)]
)
def test_spans(rows, span, step, steps):
    assert rows("pendulum", "--method", "rk4", "--step", step, "--span", span)[0]["steps"] == steps


def test_text_for_scene_and_method(rows):
    _, found = rows(
        "--hamiltonian", "p^2/2 + q^2/2", "--start", "p=0;q=1", "--A", "0,0;1/2,0", "--b", "0,1", "--step", "1/2",
        "--steps", "1",
    )  # fmt: skip
    assert (found["p"]["end"], found["q"]["end"]) == (-0.5, 0.875)


def test_scenes_without_energy_show_the_state(rows):
    assert list(rows("lorenz", "--method", "rk4", "--step", "0.01", "--steps", "3")[1]) == ["x", "y", "z"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--steps", "3"], "step must be given, as in --step 1/10, but was not"),
        (["--step", "x", "--steps", "3"], "step must"),
        (["--step", "0", "--steps", "3"], "h must not be zero, but was 0"),
        (["--step", "1"], "steps or span must be given, but neither was"),
        (["--step", "1", "--steps", "1", "--span", "1"], "steps or span must be given, but both were"),
        (["--step", "1", "--span", "-1"], "span must be at least 0, and h not 0, but they were '-1'"),
        (["--step", "0", "--span", "1"], "span must be at least 0, and h not 0, but they were '1'"),
        (["--step", "1", "--steps", "-1"], "steps must be a whole number from 0 to 2^53, but was -1"),
        (["--step", "1", "--steps", "1", "--save-every", "0"], "save_every must be a whole number from 1"),
        (
            ["--step", "1", "--steps", "1", "--observe", "mass"],
            "observe must hold functions, or quantities of pendulum (energy)",
        ),
        (["--step", "1", "--steps", "1", "--start", "p"], "start must be NAME=VALUE"),
        (["--step", "1", "--steps", "1", "--start", "x=1"], "there is no block x; the blocks are p, q"),
        (
            ["--step", "1", "--steps", "1", "--format", "latex"],
            "format must be one of table, json, csv, markdown, html, but",
        ),
        (["--step", "1", "--steps", "1", "-o", "run.xyz"], "where --format is not given, but was 'run.xyz'"),
        (["--step", "1", "--steps", "1", "-o", "no/run.npz"], "must be a folder that can be written, but was not"),
        (["--step", "1", "--steps", "9", "--observe-every", "2", "--format", "csv"], "observe-every must be left out"),
        (["--step", "1e400", "--steps", "1"], "h must be a finite number"),
    ],
)
def test_bad_arguments(run, arguments, message):
    result = run("simulate", "pendulum", "--method", "rk4", *arguments)
    assert result.exit_code == 2
    assert result.stderr.startswith("bseries: error: ")
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
    assert not result.stdout


def test_a_method_is_needed(run):
    result = run("simulate", "pendulum", "--step", "1", "--steps", "1")
    assert result.exit_code == 2
    assert "method must be given: --method with a name such as rk4" in result.stderr


def test_a_failed_step_leaves_the_file(run, tmp_path):
    path = tmp_path / "run.npz"
    result = run(
        "simulate", "riccati", "--start", "y=1", "--method", "rk4", "--step", "0.01", "--steps", "500", "-o", str(path)
    )
    assert result.exit_code == 2
    assert "did not end in finite numbers; the states before it are in" in result.stderr
    assert 100 < len(load_trajectory(path).t) < 110


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_interrupt_and_resume(tmp_path):
    def command(name, check):
        code = "from bseries.cli import main; main()"
        arguments = ["kepler", "--method", "gauss2", "--step", "1/50", "--steps", "3000000", "--save-every", "1000"]
        files = ["-o", str(tmp_path / name), "--checkpoint", str(tmp_path / check), "--format", "json"]
        return [sys.executable, "-c", code, "simulate", *arguments, *files]

    job = subprocess.Popen(command("run.npz", "check"), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    rows = tmp_path / "run.npz.part" / "t.f64"
    while job.poll() is None and not (rows.exists() and rows.stat().st_size > 2000):
        time.sleep(0.01)
    job.send_signal(signal.SIGINT)
    out, err = job.communicate()
    assert (job.returncode, out) == (130, b"")
    assert err.startswith(b"bseries: warning: stopped after ")
    assert f"the same command continues from {tmp_path / 'check'}\n".encode() in err
    assert len(load_trajectory(tmp_path / "run.npz").t) > 200
    subprocess.run(command("run.npz", "check"), check=True, stdout=subprocess.DEVNULL)
    subprocess.run(command("whole.npz", "other"), check=True, stdout=subprocess.DEVNULL)
    assert (tmp_path / "run.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.npz", "whole.npz"]


def test_the_suffix_of_the_output_is_its_format(answer, tmp_path):
    path = tmp_path / "k.csv"
    command = ("simulate", "kepler", "--method", "rk4", "--step", "0.1", "--steps", "3")
    assert answer(*command, "-o", str(path)) == ""
    assert path.read_text(encoding="utf-8") == answer(*command, "--format", "csv")
    assert len(path.read_text(encoding="utf-8").splitlines()) == 5
