"""`bseries simulate … --ensemble K`: answers in all formats, files, folders to go on from, and what is refused."""

from __future__ import annotations

import json
import re

import pytest

from integrators import method, scene
from integrators.runs.ensemble_results import load_ensemble
from integrators.runs.ensembles import ensemble
from integrators.runs.random_starts import perturbed_start, thermal_momenta

VERB = "simulate", "pendulum", "--method", "stormer-verlet", "--step", "1/10", "--steps", "20"
MANY = *VERB, "--ensemble", "6"


def expected(temperature=0.5, **options):
    pendulum = scene("pendulum")
    draw = thermal_momenta(pendulum, temperature)
    return ensemble("stormer-verlet", pendulum, h=0.1, steps=20, sample=draw, members=6, **options)


def test_the_table_says_what_came_of_it(answer):
    text = answer(*MANY, "--temperature", "1/2")
    result = expected()
    assert "6 runs of 20 steps of 0.1, to t = 2" in text
    for number in (result.mean["energy"][0], result.mean["energy"][-1], result.std["energy"][-1]):
        assert f"{number:.6g}" in text
    assert "at 21 times" in text


def test_json_has_the_same(answer):
    data = json.loads(answer(*MANY, "--temperature", "0.5", "--change", "absolute", "--seed", "3", "--format", "json"))
    result = expected(change="absolute", seed=3)
    assert (data["kind"], data["members"], data["seed"], data["failures"]) == ("ensemble", 6, 3, [])
    (row,) = data["rows"]
    assert (row["mean_at_start"], row["mean_at_end"]) == (0, result.mean["energy"][-1])
    assert (row["minimum"], row["maximum"]) == (result.minimum["energy"].min(), result.maximum["energy"].max())


def test_csv_has_a_line_for_each_time(answer):
    first, *lines = answer(*MANY, "--spread", "0.1", "--observe-every", "5", "--format", "csv").splitlines()
    assert first == "t,count,energy_mean,energy_std,energy_minimum,energy_maximum"
    draw = perturbed_start(scene("pendulum"), 0.1)
    result = ensemble("stormer-verlet", scene("pendulum"), h=0.1, steps=20, observe_every=5, sample=draw, members=6)
    assert [float(line.split(",")[2]) for line in lines] == result.mean["energy"].tolist()
    assert [line.split(",")[1] for line in lines] == ["6"] * 5


def test_files_and_folders(answer, tmp_path):
    folder, path = tmp_path / "blocks", tmp_path / "out.npz"
    options = *MANY, "--temperature", "0.5", "--keep", "2", "--checkpoint", str(folder), "-o", str(path)
    first = answer(*options, "--workers", "2")
    stored = path.read_bytes()
    assert len(list(folder.glob("block-*.npz"))) == 6
    assert answer(*options, "--workers", "1") == first
    assert path.read_bytes() == stored
    result = load_ensemble(path)
    assert result.series["energy"].tolist() == expected(keep=2).series["energy"].tolist()
    assert result.final.shape == (6, 2)
    assert result.meta["method"]["name"] == method("stormer-verlet").name


def test_failures_are_told(answer):
    text = answer("simulate", "--ode", "y' = y^2", "--start", "y=1", "--method", "rk4", "--step", "0.1", "--steps",
                  "30", "--ensemble", "9", "--spread", "0.5")  # fmt: skip
    assert "Run 0 failed: h must be small enough" in text
    assert "more runs failed" in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((*MANY,), "ensemble must come with either --temperature or --spread, .* but came with neither"),
        ((*MANY, "--spread", "1", "--temperature", "1"), "but came with both"),
        ((*VERB, "--ensemble", "0", "--spread", "1"), "ensemble must be a number of runs, 1 or more, but was 0"),
        ((*VERB, "--ensemble", "few", "--spread", "1"), "must be a whole number, but was 'few'"),
        ((*VERB, "--workers", "2"), "workers must come with --ensemble K, but came without"),
        ((*VERB, "--seed", "0"), "seed must come with --ensemble K"),
        ((*MANY, "--spread", "-1"), "spread must be a number from 0 on"),
        ((*MANY, "--spread", "wide"), "spread must be a number, but 'wide'"),
        ((*MANY, "--spread", "1", "--workers", "0"), "workers must be a positive integer, but was 0"),
        ((*MANY, "--spread", "1", "--scheduler", "tcp://a:1", "--workers", "2"), "scheduler must come without"),
        ((*MANY, "--spread", "1", "--save-every", "2"), "save-every must be left out with --ensemble"),
        ((*MANY, "--spread", "1", "--change", "much"), "change must be None, 'absolute' or 'relative', but was 'much'"),
    ],
)
def test_what_is_refused(run, options, message):
    result = run(*options)
    assert result.exit_code == 2
    assert re.search(message, result.stderr)
