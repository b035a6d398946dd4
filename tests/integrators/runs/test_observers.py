"""Functions of the user as observers: one compilation for equal ones, the right values, and code that is freed."""

from __future__ import annotations

import gc
import math
import subprocess
import sys
import types
import weakref

import numpy as np
import psutil
import pytest

from integrators import integrate, scene
from integrators.compile import user_functions
from integrators.compile.function_keys import function_key
from integrators.runs import observers as module
from integrators.runs.observers import observers

PENDULUM = scene("pendulum")
SETTINGS = types.ModuleType("settings")
SETTINGS.factor = 3.0  # type: ignore[attr-defined]
FACTOR = 5.0


def value(function):
    return observers(PENDULUM, {"a": function})(0.5, np.array([2.0, 3.0]))[0]


def times(factor):
    return lambda t, y: factor * y[0]


def test_functions_with_the_same_text_and_constants_are_compiled_once():
    one, other, another = (observers(PENDULUM, {"a": times(factor)}) for factor in (7.0, 7.0, 8.0))
    assert one.address == other.address != another.address
    assert [x(0.0, np.array([1.0, 0.0]))[0] for x in (one, other, another)] == [7.0, 7.0, 8.0]


def test_every_frozen_value_counts(monkeypatch):
    """A function that differs in one of them must not be given the code of another."""
    table = np.array([1.0, 2.0])

    def looking_up():
        return lambda t, y: table[1] * y[0]

    def with_module():
        return lambda t, y: SETTINGS.factor * y[0]

    def with_global():
        return lambda t, y: FACTOR * y[0]

    assert [value(times(factor)) for factor in (1, 1.5, True, 4)] == [2.0, 3.0, 2.0, 8.0]
    assert (value(looking_up()), value(with_module()), value(with_global())) == (4.0, 6.0, 10.0)
    table[1] = 10.0
    monkeypatch.setattr(SETTINGS, "factor", 20.0)
    monkeypatch.setitem(globals(), "FACTOR", 30.0)
    assert (value(looking_up()), value(with_module()), value(with_global())) == (20.0, 40.0, 60.0)


def test_keys_tell_types_and_signs_apart():
    keys = [function_key(times(x)) for x in (1, 1.0, True, 0.0, -0.0, np.float32(1), "1")]
    assert len(set(keys)) == len(keys)
    assert function_key(times(1.0)) == keys[1]


def test_what_cannot_be_pickled_is_compared_by_identity():
    class Untouchable:
        def __reduce_ex__(self, protocol):
            raise TypeError

    functions = [times(Untouchable()) for _ in range(2)]
    assert [function_key(function) for function in functions] == functions


def test_options_of_numba_are_kept():
    from numba import njit

    def risky(t, y):
        return 1.0 / (y[0] - 2.0)

    assert value(risky) == math.inf
    assert value(njit(error_model="numpy")(risky)) == math.inf
    assert math.isnan(value(njit(risky)))  # Python's division raises an error


def test_functions_may_call_allocate_and_print():
    script = """
import numpy as np
from numba import njit
from integrators import integrate

@njit
def helper(x):
    print("helper", x)
    return 2*x

def seen(t, y):
    print("at", t)
    return helper(y[0]) + np.sum(y[1:] * np.ones(1)) + len(str(7))

run = integrate("rk4", "pendulum", h=0.5, steps=1, y0=[0, 1], observe={"seen": seen, "both": lambda t, y: y.sum()})
assert run.observed["seen"].tolist() == (2*run.y[0] + run.y[1] + 1).tolist()
assert run.observed["both"].tolist() == (run.y[0] + run.y[1]).tolist()
"""
    job = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (job.returncode, job.stderr) == (0, "")
    lines = job.stdout.splitlines()
    assert lines[:2] == ["at 0.0", "helper 0.0"]
    assert lines[-2] == "at 0.5"


def test_the_code_goes_with_the_last_user(monkeypatch):
    made = []

    def recorded(*arguments, compiled=user_functions.observer_code):
        code = compiled(*arguments)
        made.append(weakref.ref(code))
        return code

    monkeypatch.setattr(user_functions, "observer_code", recorded)
    first, second = (observers(PENDULUM, {"a": times(1234.0)}) for _ in range(2))
    (code,) = made
    module.observer_codes.cache_clear()  # which keeps the latest for later calls
    del first
    gc.collect()
    assert code() is not None
    assert second(0.0, np.array([1.0, 0.0])) == [1234.0]
    del second
    gc.collect()
    assert code() is None


def growth(calls, function):
    """Bytes by which this process grows."""
    for k in range(70):  # more than are kept for later calls
        integrate("rk4", PENDULUM, h=0.1, steps=10, observe={"a": function(k)})
    gc.collect()
    before = psutil.Process().memory_info().rss
    for k in range(calls):
        integrate("rk4", PENDULUM, h=0.1, steps=10, observe={"a": function(70 + k)})
    gc.collect()
    return psutil.Process().memory_info().rss - before


@pytest.mark.slow
def test_ten_thousand_new_closures_take_no_memory():
    assert growth(10_000, lambda k: lambda t, y: y[0]) < 20e6


@pytest.mark.slow
def test_compilations_that_are_not_used_take_no_memory():
    """Numba would keep 0.9 MB of each, 180 MB."""
    assert growth(200, times) < 20e6
