"""The search that recommendations are compared with: on made-up methods whose cheapest steps are known, on scenes."""

import math
import sys
from functools import partial
from pathlib import Path

import pytest
from steady_budgets import for_steps, stop_the_clock

import bseries as bs
from bseries.advice.timing import Timing
from bseries.advice.work_precision import recommendation, sweeps
from bseries.advice.work_precision.sweeps import Candidate, Curve, Judge, Row, RunErrors

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks import advice_cases  # noqa: E402
from benchmarks.advice_cases import fewest, meets_error, search  # noqa: E402

LAWS = {
    "second": lambda n: 10 / n**2,
    "fourth": lambda n: 100 / n**4,
    "lucky": lambda n: 1e-6 if n == 16 else 1 / n,
    "gap": lambda n: 1e-3 if 40 <= n < 50 else 100 / n**4,
    "rounded": lambda n: 1e-8 * math.exp(-n / 10) + 1e-13 * n,
}
"""The error of so many steps: without gaps 317 of the second order and 32 of the fourth are the fewest for 1e-4."""
PRICES = {"second": 1e-7, "fourth": 4e-7, "lucky": 1e-7, "gap": 1e-7, "rounded": 1e-3}
"""Of a step, in seconds."""


class MadeUp:
    """In place of a judge."""

    scene, span, problem, available = bs.scene("pendulum"), 1.0, None, ("solution",)

    def run(self, candidate, steps):
        return RunErrors(LAWS[candidate.name](steps))

    def work(self, candidate, steps):
        return candidate.name


def always(prices, name):
    """What all steps of a method cost."""
    return Timing(prices[name], prices[name], prices[name], 5)


@pytest.fixture
def made_up(monkeypatch):
    """Makes methods and what they are found to cost, with fixed prices."""
    for module in (advice_cases, recommendation):
        monkeypatch.setattr(
            module, "step_costs", lambda work, **_: {key: always(PRICES, name) for key, name in work.items()}
        )

    def make(*names):
        curves = []
        for name in names:
            rows = (Row(1 / n, n, always(PRICES, name), RunErrors(LAWS[name](n))) for n in (2**k for k in range(2, 12)))
            curves.append(Curve(Candidate(name, bs.method("rk4")), tuple(rows)))
        return bs.advice.WorkPrecision(MadeUp(), (1e-2, 1e-8), curves, {})  # pyright: ignore[reportArgumentType]

    return make


def test_the_search_finds_the_known_cheapest(made_up):
    everything = made_up("second", "fourth", "lucky", "gap")
    found = search(made_up("second"), everything, MadeUp(), 1e-4)
    assert (found.best, found.recommended) == ("gap", "second")
    assert found.best_seconds == pytest.approx(50 * PRICES["gap"])  # beyond the gap, though 32 steps meet it too
    assert found.seconds == pytest.approx(317 * PRICES["second"], rel=0.02)
    assert found.ratio == pytest.approx(317 / 50, rel=0.02)
    found = search(made_up("second"), made_up("second", "fourth"), MadeUp(), 1e-4)
    assert (found.best, found.best_seconds) == ("fourth", pytest.approx(32 * PRICES["fourth"]))
    assert search(everything, everything, MadeUp(), 1e-4).ratio < 1.02


def test_the_search_knows_no_better_than_the_recommended(made_up):
    found = search(made_up("fourth"), made_up("second"), MadeUp(), 1e-4)
    assert (found.best, found.ratio) == ("fourth", 1.0)


def test_methods_that_do_not_reach_an_error_are_not_found(made_up):
    everything = made_up("lucky", "second", "rounded")
    assert search(made_up("fourth"), everything, MadeUp(), 1e-5).best == "fourth"
    assert [advice_cases.most_steps(curve, 1e-5) for curve in everything.curves] == [None, 2048, 16]
    assert advice_cases.most_steps(everything.curves[2], 1e-14) is None


def test_the_fewest_of_a_grid():
    assert fewest(lambda n: n >= 7, 100, 1.01) == 7
    assert fewest(lambda n: n >= 7 and n != 30, 100, 1.01) == 31
    assert fewest(lambda n: n < 100, 100, 1.01) is None
    assert fewest(lambda n: True, 100, 1.5) == 1


SCENES = {
    "pendulum": ("stormer-verlet", "rk4", "gauss2"),
    "lotka-volterra": ("rk4", "blanes-moan4", "gauss2"),
}


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_recommendations_against_a_search(scene, monkeypatch):
    """With what steps cost fixed, so that only the choice is tested."""
    prices = dict(zip(SCENES[scene], (1e-7, 3e-7, 2e-7), strict=True))
    for module in (sweeps, recommendation):
        monkeypatch.setattr(
            module, "step_costs", lambda work, **_: {key: always(prices, key.split(" ")[0]) for key in work}
        )
    stop_the_clock(monkeypatch)
    found = bs.work_precision(SCENES[scene], scene, span=10, errors=(1e-2, 1e-5), budget=for_steps(10_000))
    judge = Judge(found.scene, found.span, ("solution",))
    for error in (1e-2, 1e-4):
        chosen = found.best(error)
        assert chosen.error <= error
        assert chosen.seconds == pytest.approx(chosen.steps * prices[chosen.method])
        counts = {c.candidate.name: fewest(partial(meets_error, judge, c, error), 1400, 1.02) for c in found.curves}
        best = min(prices[name] * count for name, count in counts.items() if count is not None)
        assert best <= chosen.seconds * 1.001 <= 1.10 * best
