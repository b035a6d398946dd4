"""Budgets of `work_precision` in steps, so that no test depends on how fast the machine is."""

from __future__ import annotations

import pytest

from bseries.advice.work_precision import sweeps
from bseries.advice.work_precision.sweeps import LEAST_SECONDS


def stop_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """No run takes any time: then each step is charged with the least."""
    monkeypatch.setattr(sweeps, "thread_time", lambda: 0.0)


def for_steps(steps: int) -> float:
    """The budget that ends sweeps before runs with more steps."""
    return steps * LEAST_SECONDS
