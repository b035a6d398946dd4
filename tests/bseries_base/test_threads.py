"""First uses from many threads at once, and forks while other threads compile or import."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from bseries_base.extras import loaded_module

ROOT = Path(__file__).parents[2]
FORKS = pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")


def test_a_module_is_waited_for_while_another_thread_imports_it(tmp_path, monkeypatch):
    (tmp_path / "slowly.py").write_text("import sys, time\nsys.begun.set()\ntime.sleep(0.2)\nname = 'complete'\n")
    monkeypatch.syspath_prepend(tmp_path)
    begun = threading.Event()
    monkeypatch.setattr(sys, "begun", begun, raising=False)
    assert loaded_module("slowly") is None
    thread = threading.Thread(target=lambda: __import__("slowly"))
    thread.start()
    assert begun.wait(60)
    assert not hasattr(sys.modules["slowly"], "name")  # what asking `sys.modules` would see
    assert loaded_module("slowly").name == "complete"
    thread.join()


FIRST_USES = """
import sys, threading, traceback
import bseries as bs

def rational(k):
    import sympy
    bs.RungeKutta([[0, 0], [sympy.Rational(1, k + 1), 0]], [0, 1])

uses = [
    lambda k: bs.order_of(bs.RungeKutta([["0", "0"], ["1/2", "0"]], ["0", "1"])),
    lambda k: bs.modified_equation("gauss2", 4),
    lambda k: bs.integrate("rk4", "pendulum", h=0.1, steps=10, y0=[0, 1.0], observe="energy"),
    lambda k: bs.ensemble("rk4", "pendulum", h=0.1, steps=10, y0=[[0, 1.0]] * 3),
    lambda k: bs.modified_hamiltonian("implicit-midpoint", "pendulum", 3),
    rational,
    lambda k: bs.integrate("gauss2", "kepler", h=0.1, steps=10, observe={"a": lambda t, y: y[0]}),
    lambda k: bs.check("rk4"),
]
together, errors = threading.Barrier(16), []

def run(k):
    together.wait()
    try:
        uses[k % len(uses)](k)
    except BaseException:
        errors.append(traceback.format_exc())

sys.setswitchinterval(1e-4)
threads = [threading.Thread(target=run, args=(k,)) for k in range(16)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
print(*errors)
"""


@pytest.mark.slow
@pytest.mark.parametrize("run", range(5))
def test_sixteen_threads_may_begin_at_once(run):
    job = subprocess.run([sys.executable, "-c", FIRST_USES], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (job.returncode, job.stdout.strip(), job.stderr) == (0, "", "")


FORK = """
import faulthandler, os, sys, threading, time, warnings
warnings.simplefilter("ignore", DeprecationWarning)
import bseries as bs

def run(k):
    scene = bs.Scene({"p": 1, "q": 1}, hamiltonian=f"p^2/2 + {k}*q^2", start={"p": [0.0], "q": [1.0]})
    return bs.integrate("rk4", scene, h=0.01, steps=10, observe={"a": lambda t, y: y[0]})

thread = threading.Thread(target=lambda: [run(k) for k in range(2)])
thread.start()
time.sleep(float(sys.argv[1]))
child = os.fork()
if child == 0:
    faulthandler.dump_traceback_later(60, exit=True)
    run(3)
    os._exit(7)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
thread.join()
"""


@FORKS
@pytest.mark.slow
@pytest.mark.parametrize("delay", ["0.05", "0.4", "1", "2"])
def test_children_of_a_fork_compile_while_another_thread_does(delay, tmp_path):
    job = subprocess.run(
        [sys.executable, "-c", FORK, delay],
        cwd=ROOT, env={**os.environ, "BSERIES_CACHE": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (job.stdout.strip(), job.stderr) == ("7", "")


HELD = """
import faulthandler, os, threading, warnings
warnings.simplefilter("ignore", DeprecationWarning)
from bseries_base.forks import {lock} as lock

held, ends = threading.Event(), threading.Event()

def hold():
    with lock:
        held.set()
        ends.wait(0.2)

thread = threading.Thread(target=hold)
thread.start()
held.wait()
child = os.fork()
if child == 0:
    os._exit(7 if lock.acquire(timeout=10) else 1)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
thread.join()
"""


@FORKS
@pytest.mark.parametrize("lock", ["MODULES", "SYNTAX"])
def test_locks_are_free_in_children(lock):
    script = HELD.format(lock=lock)
    job = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (job.stdout.strip(), job.stderr) == ("7", "")
