"""What a person waits for: programs in processes of their own, three times, with their bars."""

import sys
from pathlib import Path

import pytest

import bseries as bs

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks import waiting_cases  # noqa: E402
from benchmarks.waiting_cases import Wait, commanded, in_process, names_to_check, slowest_checks, waited  # noqa: E402


def test_bars_are_those_of_the_first_process_and_of_later_ones():
    figures = waited(Wait("x", "nothing", "found = 0.5", 0.25, 1.0, 2e9))
    assert [(figure.work, figure.bar) for figure in figures] == [
        ("nothing: nothing compiled", 0.25),
        ("nothing: again", 1.0),
        ("nothing: once more", 1.0),
        ("nothing: memory", 2000),
    ]
    assert [figure.value for figure in figures[:3]] == [0.5] * 3
    assert 5 < figures[3].value < 2000


def test_only_the_first_process_finds_nothing_compiled():
    program = (
        "import os; folder = os.environ['BSERIES_CACHE']; found = len(os.listdir(folder))\nopen(f'{folder}/x', 'w')"
    )
    assert [figure.value for figure in waited(Wait("x", "files", program, None, None))] == [0, 1, 1]


def test_commands_are_timed_as_whole_processes(tmp_path):
    seconds, peak = in_process(commanded("trees --order 3"), str(tmp_path))
    assert 0.01 < seconds < 60
    assert peak > 5e6
    with pytest.raises(RuntimeError, match="failed"):
        in_process(commanded("trees nothing"), str(tmp_path))


def test_every_entry_of_the_catalogue_is_checked():
    names = names_to_check()
    assert len(names) == len(bs.methods.catalogue())
    assert {bs.method(name).name for name in names} >= {"rk4", "gauss3"}


def test_the_slowest_check_of_each_kind_is_named(monkeypatch):
    taken = iter([9.0, 1.0, 8.0, 3.0, 3.5, 4.0, 2.0, 2.0, 2.0, 6.0, 7.0, 5.0])
    monkeypatch.setattr(waiting_cases, "in_process", lambda program, cache: (next(taken), 0))
    short, long = slowest_checks(["rk4", "gauss3", "heun2", "blanes-moan6"])
    assert (short.work.rpartition(": ")[2], short.value, short.bar) == ("gauss3", 3.0, 1.5)
    assert (long.work.rpartition(": ")[2], long.value, long.bar) == ("blanes-moan6", 5.0, 3.0)


@pytest.mark.slow
@pytest.mark.parametrize("use", ["", 'bs.integrate("rk4", scene, h=0.1, steps=3)'])
def test_scenes_are_made_and_run(use, tmp_path):
    growth, _ = in_process(waiting_cases.SCENES.format(warm=2, many=2, use=use), str(tmp_path))
    assert growth < 100


def test_programs_that_measure_themselves(tmp_path):
    wait = next(wait for wait in waiting_cases.waits() if wait.name == "repeated")
    assert 0 < in_process(wait.program, str(tmp_path))[0] < 60
