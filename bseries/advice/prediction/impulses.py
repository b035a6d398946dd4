"""Compiled: an observer that kicks what it observes."""

from __future__ import annotations

from typing import Any

from numba import types

from foundation.machine_code import cfunc
from integrators.compile.machine import DOUBLE, DOUBLES, OPTIONS


def _kick(t, y, row):
    """Add the kick in a row to a state, twice, and put the state between into the row.

    Args:
        t: The time.
        y: The state; solvers that carry nothing from step to step do not mind that it changes.
        row: The number of variables, and the kick.
    """
    for i in range(int(row[0])):
        kick = row[i + 1]
        row[i + 1] = y[i] + kick
        y[i] = row[i + 1] + kick


kick: Any = cfunc(types.void(DOUBLE, DOUBLES, DOUBLES), **OPTIONS)(_kick)
