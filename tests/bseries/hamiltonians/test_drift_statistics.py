"""How often the verdicts on sampled quantities err: the thresholds against made-up walks, bands, lines and escapes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from math import log, pi

import numpy as np
import pytest

import bseries as bs
from bseries.hamiltonians.drift_statistics import THRESHOLDS, drift_statistics

LENGTH, DT = 4096, 0.1
TIMES = np.arange(LENGTH) / LENGTH


def remembered(noise: np.ndarray, a: float) -> np.ndarray:
    """x' = a x + noise, from rest."""
    x = np.zeros(len(noise))
    for n in range(1, len(x)):
        x[n] = a * x[n - 1] + noise[n]
    return x


def waves(random: np.random.Generator, slowest: float) -> np.ndarray:
    """A function of two frequencies, of which none is below `slowest` periods."""
    first, second = np.exp(random.uniform(log(slowest), log(400), 2))
    frequencies = [first, second, first + second, 2 * first, 2 * second]
    parts = [random.standard_normal() * np.cos(2 * pi * f * TIMES + random.uniform(0, 7)) for f in frequencies]
    return np.sum(parts, axis=0)


Process = Callable[[np.random.Generator], np.ndarray]
PROCESSES: dict[str, tuple[Process, str, float]] = {
    "walk": (lambda random: np.cumsum(random.standard_normal(LENGTH)), "square-root drift", 0.9),
    "short walk": (lambda random: np.cumsum(random.standard_normal(512)), "square-root drift", 0.9),
    "walk with memory": (
        lambda random: np.cumsum(remembered(random.standard_normal(LENGTH), 0.9)), "square-root drift", 0.9,
    ),
    "walk under a wave": (
        lambda random: np.cumsum(random.standard_normal(LENGTH)) + 30 * np.cos(2 * pi * 200 * TIMES),
        "square-root drift", 0.9,
    ),
    "noise": (lambda random: random.standard_normal(LENGTH), "bounded", 1.0),
    "noise with memory": (lambda random: remembered(random.standard_normal(LENGTH), 0.3), "bounded", 0.9),
    "waves": (lambda random: waves(random, 12), "bounded", 0.9),
    "line under noise": (lambda random: 100 * TIMES + random.standard_normal(LENGTH), "linear drift", 1.0),
    "line under a wave": (lambda random: 3 * TIMES + waves(random, 200), "linear drift", 0.85),
    "line and walk": (lambda random: np.cumsum(0.3 + random.standard_normal(LENGTH)), "linear drift", 1.0),
    "decay": (lambda random: np.exp(-random.uniform(3, 300) * TIMES), "unsteady drift", 1.0),
    "growth": (lambda random: np.exp(random.uniform(3, 300) * TIMES), "unsteady drift", 1.0),
    "jump": (lambda random: (random.uniform(0.01, 0.99) < TIMES) - TIMES / 3, "unsteady drift", 1.0),
}  # fmt: skip
"""Processes, with what they are, and the least part of them for which that is seen."""
CLAIMS = {"linear drift", "square-root drift", "unsteady drift"}


@pytest.mark.parametrize("name", PROCESSES)
def test_what_a_process_is_called(name):
    process, expected, least = PROCESSES[name]
    random, count = np.random.default_rng(5), 100
    kinds = Counter(drift_statistics(process(random), DT).kind for _ in range(count))
    assert kinds[expected] >= least * count, kinds
    if expected in ("bounded", "square-root drift"):  # the rest claims nothing
        assert sum(kinds[kind] for kind in (CLAIMS | {"bounded"}) - {expected}) <= 0.02 * count, kinds


def test_a_wave_slower_than_the_run_claims_nothing_or_one_way():
    random = np.random.default_rng(6)
    kinds = Counter(drift_statistics(waves(random, 1), DT).kind for _ in range(300))
    assert kinds["square-root drift"] <= 0.03 * 300, kinds


def test_a_walk_is_close_to_a_line_as_rarely_as_said():
    random = np.random.default_rng(7)
    w = np.cumsum(random.standard_normal((100_000, 128), dtype=np.float32), axis=1)
    tau = np.arange(1, 129, dtype=np.float32) / 128
    bends = np.abs(w - w[:, -1:] * tau).max(axis=1) / np.abs(w[:, -1])
    assert np.mean(bends < THRESHOLDS.bend) == pytest.approx(1e-4, abs=1e-4)


def test_the_size_and_the_errors_of_a_walk():
    """x' = a x + noise sums up to a walk with D = dt/(1 − a)²/2, in units of dt; its mean has the error √(2D/T)."""
    random, a = np.random.default_rng(3), 0.9
    found = [drift_statistics(DT * np.cumsum(remembered(random.standard_normal(8192), a)), DT) for _ in range(100)]
    expected = DT / (1 - a) ** 2 / 2
    sizes, means = (np.array([getattr(s, name) for s in found]) for name in ("diffusion", "mean"))
    assert sizes.mean() == pytest.approx(expected, rel=0.08)
    assert sizes.std() == pytest.approx(np.mean([s.diffusion_error for s in found]), rel=0.3)
    assert means.std() == pytest.approx((2 * expected / found[0].time) ** 0.5, rel=0.3)
    assert np.mean([s.error for s in found]) == pytest.approx(means.std(), rel=0.3)


@pytest.mark.parametrize("length", [512, 513, 1000, 1025, 5000])
def test_all_values_count(length):
    found = drift_statistics(0.25 * DT * np.arange(length), DT)
    assert (found.time, found.kind) == (pytest.approx((length - 1) * DT), "linear drift")
    assert (found.mean, found.error) == (pytest.approx(0.25), pytest.approx(0, abs=1e-3))
    values = np.zeros(length)
    values[-1] = 1
    assert drift_statistics(values, DT).high == 1


def test_what_is_too_small_is_nothing():
    noise = 1e-15 * np.cumsum(np.random.default_rng(1).standard_normal(4096))
    assert drift_statistics(noise, DT).kind == "square-root drift"
    assert drift_statistics(noise, DT, rounding=1e-12).kind == "bounded"
    assert drift_statistics(np.zeros(512), DT).kind == "bounded"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.ones(9), "values must be 512 or more to tell drifts apart, but were 9"),
        (np.full(600, np.nan), "values must be finite, but one was not"),
    ],
)
def test_what_has_no_statistics(values, message):
    with pytest.raises(bs.SeriesError, match=message):
        drift_statistics(values, DT)
