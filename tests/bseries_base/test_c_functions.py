"""Object code of C functions on disk: loaded without numba, made anew where it is damaged, freed with its last user."""

from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys
import threading
import time
import weakref
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from math import sin
from pathlib import Path

import numpy as np
import pytest
from llvmlite.binding import ExecutionEngine

import bseries as bs
from bseries_base import machine_code
from bseries_base.machine_code import CHECKSUM, MachineCode, ObjectCode, c_address, c_function
from integrators.compile import c_functions
from integrators.core.immutable import cached_method
from integrators.runs.observers import observer_codes
from integrators.steppers import stepping

pytestmark = pytest.mark.minimum

ROOT = Path(__file__).parents[2]
POSIX = pytest.mark.skipif(os.name != "posix", reason="owners and modes of POSIX")
ROOT_ONLY = pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root gives files away")
SINE = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)


@pytest.fixture
def made():
    """A function that compiles x ↦ 2 sin x, and a list that grows with each of its calls."""
    from numba import types

    from bseries_base.lowering.objects import object_code

    calls = []

    def make():
        calls.append(len(calls))
        return object_code(double_sine, types.float64(types.float64))

    return make, calls


def double_sine(x):
    return 2.0 * sin(x)


def value(make, key="key"):
    return c_function(key, make).function(SINE)(1.0)


def test_code_is_found_again(directory, made):
    make, calls = made
    assert [value(make) for _ in range(3)] == [2 * np.sin(1.0)] * 3
    assert calls == [0]
    (file,) = directory.iterdir()
    assert file.suffix == ".code"
    if os.name == "posix":
        assert (directory.stat().st_mode & 0o777, file.stat().st_mode & 0o777) == (0o700, 0o600)


def test_the_key_versions_and_settings_count(directory, made, monkeypatch):
    make, calls = made
    value(make)
    value(make, "other key")
    assert len(calls) == 2
    for name in ("NUMBA_OPT", "NUMBA_CPU_NAME"):
        monkeypatch.setenv(name, "1")
        machine_code.surroundings.cache_clear()
        value(make)
    monkeypatch.undo()
    machine_code.surroundings.cache_clear()
    assert len(calls) == 4


@pytest.mark.parametrize("place", [0, CHECKSUM - 1, CHECKSUM, CHECKSUM + 1, 0.3, 0.6, -1])
@pytest.mark.parametrize("damage", ["bit", "end"])
def test_damaged_files_are_made_anew(directory, made, place, damage):
    make, calls = made
    value(make)
    (file,) = directory.iterdir()
    content = bytearray(file.read_bytes())
    place = int(place * len(content)) if isinstance(place, float) else place
    if damage == "bit":
        content[place] ^= 4
    else:
        del content[place:]
    file.write_bytes(content)
    assert [value(make) for _ in range(2)] == [2 * np.sin(1.0)] * 2
    assert calls == [0, 1]


def test_code_of_another_function_is_not_loaded(directory, made):
    make, calls = made
    value(make)
    (file,) = directory.iterdir()
    value(make, "other key")
    (other,) = set(directory.iterdir()) - {file}
    other.write_bytes(file.read_bytes())
    assert value(make, "other key") == 2 * np.sin(1.0)
    assert calls == [0, 1, 2]


def test_functions_that_the_c_library_lacks(directory, made):
    make, calls = made
    value(make)
    (file,) = directory.iterdir()
    content = file.read_bytes()[CHECKSUM:].replace(b"sin\n", b"no_such_function\n", 1)
    file.write_bytes(sha256(file.name.encode() + content).digest() + content)
    assert value(make) == 2 * np.sin(1.0)
    assert calls == [0, 1]
    with pytest.raises(AttributeError):
        c_address("no_such_function")


@ROOT_ONLY
@pytest.mark.parametrize("place", ["file", "folder"])
def test_code_of_another_user_is_not_loaded(directory, made, monkeypatch, place):
    make, calls = made
    value(make)
    (file,) = directory.iterdir()
    os.chown(file if place == "file" else directory, 12345, 12345)
    if place == "folder":
        with pytest.warns(RuntimeWarning, match="others may write to the cache"):
            value(make)
    else:
        value(make)
    assert calls == [0, 1]


@POSIX
def test_code_that_others_can_write_is_not_loaded(directory, made):
    make, calls = made
    value(make)
    (file,) = directory.iterdir()
    file.chmod(0o622)
    value(make)
    assert calls == [0, 1]


def test_where_nothing_can_be_written_code_stays_in_memory(tmp_path, made, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("BSERIES_CACHE", str(tmp_path / "file" / "cache"))
    make, calls = made
    assert [value(make) for _ in range(2)] == [2 * np.sin(1.0)] * 2
    assert calls == [0, 1]


def test_code_that_refers_to_this_process_is_not_kept(directory, made):
    make, _ = made
    code = c_function("here", lambda: make()._replace(is_lasting=False))
    assert code.function(SINE)(1.0) == 2 * np.sin(1.0)
    assert not directory.exists()


def test_compiling_is_known_while_it_lasts(directory, made):
    make, _ = made
    seen = []
    c_function("key", lambda: (seen.append(machine_code.is_compiling()), make())[1])
    assert (seen, machine_code.is_compiling()) == ([True], False)


def alive():
    gc.collect()
    return sum(type(thing) is MachineCode for thing in gc.get_objects())  # others may be proxies of what is gone


def oscillator(k):
    return bs.Scene({"p": 1, "q": 1}, hamiltonian=f"p^2/2 + {k}*q^2", start={"p": [0.0], "q": [1.0]})


@pytest.mark.slow
def test_the_code_of_fifty_scenes_is_freed(directory):
    bs.integrate("rk4", oscillator(1000), h=0.01, steps=10, observe="energy")
    forget()  # also what other tests have made
    before, modules = alive(), len(sys.modules)
    for k in range(50):
        bs.integrate("rk4", oscillator(k), h=0.01, steps=10, observe="energy")
    assert alive() == before + 100  # steps and energies, which the last steppers and observers keep
    forget()
    assert alive() <= before
    assert len(sys.modules) == modules


def forget():
    """Drop the steppers and observers that are kept for later calls."""
    for cache in (stepping.kept_stepper, observer_codes):
        cache.cache_clear()


def engines():
    return [thing for thing in gc.get_objects() if type(thing) is ExecutionEngine]


@pytest.mark.slow
def test_the_engine_goes_with_the_code(directory, made):
    make, _ = made
    code = make()
    assert isinstance(code, ObjectCode)
    others = {id(engine): engine for engine in engines()}
    function = MachineCode(code).function(SINE)
    (engine,) = (weakref.ref(engine) for engine in engines() if id(engine) not in others)
    gc.collect()
    assert engine() is not None
    assert function(1.0) == 2 * np.sin(1.0)
    del function
    gc.collect()
    assert engine() is None


@pytest.mark.slow
def test_a_run_keeps_its_code_while_all_else_forgets_it(directory, monkeypatch):
    compiled, codes = stepping.compile_step, []

    def recorded(*arguments):
        source = compiled(*arguments)
        codes.append(weakref.ref(source.code))
        return source

    monkeypatch.setattr(stepping, "compile_step", recorded)
    scene = oscillator(2000)
    expected = bs.integrate("rk4", scene, h=0.001, steps=200_000, save_every=None).y[:, -1]
    made = stepping.Stepper(scene, bs.method("rk4"), None, stepping.Options("auto", True, True, None, None))
    stepping.kept_stepper.cache_clear()
    state, code = made.start(h=0.001), codes[-1]

    def run(stepper):
        for _ in range(200):
            stepper.advance(state, 1000)

    thread = threading.Thread(target=run, args=(made,))
    thread.start()
    del made
    while thread.is_alive():
        gc.collect()
        for k in range(3):
            bs.integrate("rk4", oscillator(3000 + k), h=0.01, steps=10)
        stepping.kept_stepper.cache_clear()
    thread.join()
    del thread
    gc.collect()
    assert (state.y == expected).all()
    assert code() is None


RUN = """
import sys
import bseries as bs
run = bs.integrate("stormer-verlet", "pendulum", h=0.1, steps=1000, observe="energy")
print(run.y[:, -1].tobytes().hex(), run.observed["energy"][-1].hex(), "numba" in sys.modules)
"""


@pytest.mark.slow
def test_a_later_process_runs_without_numba_to_the_same_bits(directory):
    lines = [
        subprocess.run([sys.executable, "-c", RUN], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
        for _ in range(2)
    ]
    assert [line.pop() for line in lines] == ["True", "False"]
    assert lines[0] == lines[1]


def test_threads_that_compile_at_once_share_the_code(directory, made, monkeypatch):
    """Otherwise the code of one would be freed while another thread runs it."""
    make, _ = made
    together = threading.Barrier(2, timeout=60)

    def compiled(key, make_it):
        together.wait()
        return MachineCode(make())

    monkeypatch.setattr(machine_code, "c_function", compiled)
    with ThreadPoolExecutor(2) as threads:
        one, other = threads.map(lambda _: c_functions.c_function("x = 1", "advance"), range(2))
    assert one is other


def test_threads_that_cache_a_result_at_once_share_it():
    together = threading.Barrier(2, timeout=60)

    class Owner:
        @cached_method
        def value(self):
            together.wait()
            return object()

    owner = Owner()
    with ThreadPoolExecutor(2) as threads:
        one, other = threads.map(lambda _: owner.value(), range(2))
    assert one is other
    assert owner.value() is one


@pytest.fixture
def small_cache(tmp_path, monkeypatch):
    """A cache of at most 10,000 bytes, in which five files of 4,000 bytes were used on different days."""
    folder = tmp_path / "cache"
    folder.mkdir(mode=0o700)
    monkeypatch.setenv("BSERIES_CACHE", str(folder))
    monkeypatch.setattr(machine_code, "MOST_BYTES", 10_000)
    machine_code._prune.cache_clear()
    files = [folder / (sha256(bytes([k])).hexdigest() + ".code") for k in range(5)]
    for age, path in enumerate(files, 2):
        path.write_bytes(b"x" * 4_000)
        os.utime(path, (time.time() - age * machine_code.DAY,) * 2)
    (folder / "notes.code").write_bytes(b"y" * 100_000)  # not ours
    yield folder, files
    machine_code._prune.cache_clear()


def test_files_that_were_used_longest_ago_are_removed(small_cache, made):
    folder, files = small_cache
    assert value(made[0]) == 2 * sin(1.0)
    sizes = {path.name: path.stat().st_size for path in folder.iterdir()}
    assert sizes.pop("notes.code") == 100_000
    assert sum(sizes.values()) <= 0.75 * 10_000
    assert [path.name in sizes for path in files] == [True, False, False, False, False]
    assert value(made[0]) == 2 * sin(1.0)
    assert made[1] == [0]  # what was written last is still there


def test_a_cache_that_is_small_keeps_everything(small_cache, made, monkeypatch):
    _, files = small_cache
    monkeypatch.setattr(machine_code, "MOST_BYTES", 1_000_000)
    value(made[0])
    assert all(path.exists() for path in files)


def test_reading_marks_files_as_used(small_cache, made):
    folder, files = small_cache
    value(made[0])
    (path,) = set(folder.glob("?" * 64 + ".code")) - set(files)
    os.utime(path, (time.time() - 3 * machine_code.DAY,) * 2)
    value(made[0])
    assert path.stat().st_mtime > time.time() - machine_code.DAY
    assert made[1] == [0]


def test_pruning_beside_others_that_prune(small_cache, made, monkeypatch):
    """Files that vanish between the listing and their removal are no error."""
    _, files = small_cache
    scan = os.scandir

    def listed_then_removed(directory):
        entries = scan(directory)
        for path in files[2:]:
            path.unlink()
        return entries

    monkeypatch.setattr(os, "scandir", listed_then_removed)
    assert value(made[0]) == 2 * sin(1.0)
    monkeypatch.undo()
    assert not any(path.exists() for path in files[2:])
