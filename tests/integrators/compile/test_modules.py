"""Modules from generated source: one for each text, whose machine code is found again."""

from __future__ import annotations

import gc
import inspect
import os
import subprocess
import sys
import traceback
import weakref
from pathlib import Path

import pytest

from integrators.compile import modules
from integrators.compile.modules import load_module

pytestmark = pytest.mark.minimum

ROOT = Path(__file__).parents[3]
SOURCE = "def answer():\n    return {}\n"

COMPILED = '''
from bseries_base.machine_code import njit


@njit()
def cube(x):
    """The cube, compiled."""
    return x*x*x
'''

PROGRAM = f"""
from integrators.compile.modules import load_module
module = load_module({COMPILED!r})
assert module.cube(3.0) == 27.0
stats = module.cube.stats
print(module.__name__, sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


@pytest.fixture
def directory(tmp_path, monkeypatch):
    monkeypatch.setenv("BSERIES_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def start(directory, program=PROGRAM):
    environment = {**os.environ, "BSERIES_CACHE": str(directory), "PYTHONWARNINGS": "error"}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen([sys.executable, "-c", program], text=True, cwd=ROOT, env=environment, **pipes)


def finish(process):
    output, errors = process.communicate()
    assert process.returncode == 0, errors
    name, hits, misses = output.split()
    return name, int(hits), int(misses)


def forget(module):
    """Let this process load the source again."""
    del sys.modules[module.__name__]


def test_one_text_is_one_module(directory):
    first, second = load_module(SOURCE.format(1)), load_module(SOURCE.format(2))
    assert (first.answer(), second.answer()) == (1, 2)
    assert load_module(SOURCE.format(1)) is first
    assert inspect.getsource(first.answer) == SOURCE.format(1)
    assert first.answer.__module__ in sys.modules
    assert not directory.exists()


def test_text_outside_ascii(directory):
    assert load_module('def answer():\n    """τ, γ, …"""\n    return "σ"\n').answer() == "σ"


def test_helpers_enter_the_key(directory, tmp_path):
    helper = tmp_path / "helper.py"
    helper.write_text("a = 1\n")
    first = load_module(SOURCE.format(3), helpers=[helper, modules])
    assert load_module(SOURCE.format(3), helpers=[helper, modules]) is first
    helper.write_text("a = 2\n")
    assert load_module(SOURCE.format(3), helpers=[helper, modules]) is not first
    assert load_module(SOURCE.format(3)) is not first


def test_a_failing_module_leaves_nothing_behind(directory):
    before = set(sys.modules)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            load_module("answer = 1/0\n")
    assert set(sys.modules) == before


FLEETING = """
from numba import njit

@njit
def double(x):
    return x + x

@njit(nogil=True)
def answer(x):
    return double(x) + 1

def fail():
    return 1/0  # this line
"""


def test_what_is_not_kept_leaves_no_trace(directory):
    before = set(sys.modules)
    module = load_module(FLEETING, keep=False)
    assert module.answer(20.5) == 42
    assert load_module(FLEETING, keep=False) is module
    assert load_module(FLEETING, keep=False, helpers=[modules]) is not module
    with pytest.raises(ZeroDivisionError) as caught:
        module.fail()
    assert "return 1/0  # this line" in "".join(traceback.format_exception(caught.value))
    with pytest.raises(ZeroDivisionError):
        load_module("answer = 1/0\n", keep=False)
    assert not {name for name in set(sys.modules) - before if "generated" in name}
    assert not directory.exists()


def test_what_is_not_kept_goes_with_its_last_user(directory):
    module = load_module(SOURCE.format(6), keep=False)
    name, answer, passing = module.__name__, module.answer, weakref.ref(module)
    assert load_module(SOURCE.format(6), keep=False) is module
    del module
    gc.collect()
    assert passing() is None
    assert answer() == 6
    kept = load_module(SOURCE.format(6))
    assert kept.__name__ == name in sys.modules
    assert load_module(SOURCE.format(6), keep=False) is not kept
    forget(kept)


def test_machine_code_is_found_by_the_next_process(directory):
    name, hits, misses = finish(start(directory))
    assert (hits, misses) == (0, 1)
    assert finish(start(directory)) == (name, 1, 0)


@pytest.mark.slow
def test_processes_at_once(directory):
    results = [finish(process) for process in [start(directory) for _ in range(2)]]
    assert len({name for name, *_ in results}) == 1
    assert finish(start(directory))[1:] == (1, 0)
    assert len(list(directory.iterdir())) == 1
