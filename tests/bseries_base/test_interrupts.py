"""Interrupts wait for the start of threads and for llvmlite; what threads compute is given up."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from bseries_base.interrupts import in_llvmlite, interrupt_soon, mapped, outside_llvmlite, uninterrupted
from integrators.runs.ensembles import results_in_order

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")


@pytest.fixture(autouse=True)
def heard() -> Iterator[None]:
    """Interrupts are errors, also where these tests run in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def other_thread() -> Iterator[None]:
    """A thread that takes the signals which the main thread does not, as those of NumPy do."""
    ends = threading.Event()
    thread = threading.Thread(target=ends.wait)
    thread.start()
    yield
    ends.set()
    thread.join()


def interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def wait(times: int = 10) -> None:
    for _ in range(times):
        time.sleep(0.005)


def test_interrupts_come_after_a_block(other_thread):
    reached = []

    @uninterrupted()
    def block() -> None:
        interrupt()
        wait()
        reached.append(True)

    with pytest.raises(KeyboardInterrupt):
        block()
    assert reached == [True]


def test_errors_of_a_block_stay_and_nothing_comes_without_an_interrupt():
    with pytest.raises(ZeroDivisionError), uninterrupted():
        _ = 1 / 0
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == set()


def test_interrupts_that_are_ignored_stay_so():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with uninterrupted(), outside_llvmlite():
        interrupt()
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_threads_of_a_pool_do_not_take_interrupts():
    with ThreadPoolExecutor(2) as pool:
        found = list(mapped(pool, lambda _: signal.pthread_sigmask(signal.SIG_BLOCK, []), range(4)))
    assert all(signal.SIGINT in blocked for blocked in found)


BINDING = """
def handle(interrupt, wait):
    interrupt()
    wait()
    done.append(True)
"""


@pytest.mark.parametrize("name", ["llvmlite.binding.ffi", "elsewhere"])
def test_interrupts_wait_for_llvmlite(name):
    """A function of llvmlite that is interrupted where it calls another one."""
    done = []
    space = {"__name__": name, "done": done}
    exec(BINDING, space)

    @outside_llvmlite()
    def block() -> None:
        space["handle"](interrupt, wait)
        wait(10_000)

    with pytest.raises(KeyboardInterrupt):
        block()
    assert done == [True] * (name != "elsewhere")
    assert not in_llvmlite(None)


def test_an_interrupt_comes_again():
    interrupt_soon()
    with pytest.raises(KeyboardInterrupt):
        wait(10_000)


def test_threads_are_stopped_before_they_are_waited_for():
    begun, stopped, found = threading.Event(), threading.Event(), []

    def work(_: int) -> None:
        begun.set()
        found.append(stopped.wait(60))

    def after() -> None:
        begun.wait()
        interrupt()

    thread = threading.Thread(target=after)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        list(results_in_order("threads", 2, work, [(k,) for k in range(4)], stopped.set))
    thread.join()
    assert found == [True] * len(found) != []
