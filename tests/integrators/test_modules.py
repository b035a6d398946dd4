"""Modules from generated source: one file for each text, found again by numba, whatever happens to the files."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import traceback
from pathlib import Path

import pytest

from integrators import IntegratorError, modules
from integrators.modules import cache_directory, load_module

ROOT = Path(__file__).parents[2]
SOURCE = "def answer():\n    return {}\n"

COMPILED = '''
from numba import njit


@njit(cache=True)
def cube(x):
    """The cube, compiled."""
    return x*x*x
'''

PROGRAM = f"""
from integrators.modules import load_module
module = load_module({COMPILED!r})
assert module.cube(3.0) == 27.0
stats = module.cube.stats
print(module.__file__, sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
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
    path, hits, misses = output.split()
    return Path(path), int(hits), int(misses)


def forget(module):
    """Let this process load the source again."""
    del sys.modules[module.__name__]


def test_one_text_is_one_module(directory):
    first, second = load_module(SOURCE.format(1)), load_module(SOURCE.format(2))
    assert (first.answer(), second.answer()) == (1, 2)
    assert load_module(SOURCE.format(1)) is first
    assert Path(first.__file__).read_text(encoding="utf-8") == SOURCE.format(1)
    assert sorted(directory.glob("*.py")) == sorted(Path(module.__file__) for module in (first, second))
    assert first.answer.__module__ in sys.modules


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


@pytest.mark.parametrize("damage", ["", "def answer():\n    return 0\n", "\0", None])
def test_a_damaged_or_deleted_file_is_written_again(directory, damage):
    source = SOURCE.format(f"'{directory}'")
    module = load_module(source)
    path = Path(module.__file__)
    forget(module)
    if damage is None:
        path.unlink()
    else:
        path.write_text(damage)
    assert load_module(source).answer() == str(directory)
    assert path.read_text() == source


def test_bytecode_is_neither_read_nor_written(directory):
    module = load_module(SOURCE.format(4))
    assert list(directory.rglob("*.pyc")) == []
    forget(module)


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
    name, answer = module.__name__, module.answer
    assert name in modules._PASSING
    del module
    gc.collect()
    assert name not in modules._PASSING
    assert answer() == 6
    kept = load_module(SOURCE.format(6))
    assert kept.__name__ == name in sys.modules
    assert load_module(SOURCE.format(6), keep=False) is not kept
    assert [path.stem in name for path in directory.glob("*.py")] == [True]
    forget(kept)


def test_the_directory(monkeypatch):
    monkeypatch.setenv("BSERIES_CACHE", "~/elsewhere")
    assert cache_directory() == Path.home() / "elsewhere"
    monkeypatch.setenv("BSERIES_CACHE", "")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    monkeypatch.setenv("LOCALAPPDATA", "/data")
    for platform, expected in [
        ("linux", Path("/somewhere/bseries-engine")),
        ("darwin", Path.home() / "Library" / "Caches" / "bseries-engine"),
        ("win32", Path("/data/bseries-engine")),
    ]:
        monkeypatch.setattr(sys, "platform", platform)
        assert cache_directory() == expected.absolute()


def test_nothing_writable(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("BSERIES_CACHE", str(tmp_path / "file" / "cache"))
    module = load_module(SOURCE.format(5))
    assert module.answer() == 5
    assert Path(module.__file__).parent == modules._temporary_directory()
    forget(module)
    monkeypatch.setattr(modules, "_temporary_directory", lambda: tmp_path / "file")
    with pytest.raises(IntegratorError, match=r"BSERIES_CACHE must be a directory .* but was '.*cache'"):
        load_module(SOURCE.format(5))


def test_machine_code_is_found_by_the_next_process(directory):
    path, hits, misses = finish(start(directory))
    assert (path.parent, hits, misses) == (directory, 0, 1)
    assert finish(start(directory)) == (path, 1, 0)
    path.write_text(COMPILED.replace("x*x*x", "x*x*7"))  # numba asks the file whether it has changed
    found, hits, misses = finish(start(directory))
    assert (found, hits + misses) == (path, 1)


def test_processes_at_once(directory):
    results = [finish(process) for process in [start(directory) for _ in range(2)]]
    assert len({path for path, *_ in results}) == 1
    assert finish(start(directory))[1:] == (1, 0)
    assert [file for file in directory.rglob("*") if "tmp" in file.name] == []


def test_numba_compiles_where_nothing_is_writable(tmp_path):
    (tmp_path / "file").write_text("")
    path, hits, misses = finish(start(tmp_path / "file" / "cache"))
    assert (hits, misses) == (0, 1)
    assert not path.exists()  # it lived as long as the process
