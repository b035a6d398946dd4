"""Predicted errors and times of runs over measured ones."""

from __future__ import annotations

from statistics import median
from time import perf_counter
from typing import NamedTuple

import bseries as bs
from bseries.advice.measures import energy_size, relative_change, relative_distance
from bseries.advice.predictions.expected_errors import ONLY_ROUNDING

from .kinds import Figure, Measurement

FACTOR, TIME = 3.0, 1.20
"""The bars: by what factor an error, and a time, may be off."""
UNKNOWN = {"energy": 0.06, "solution": 0.15}
"""The bars: of what part of the runs nothing is predicted, as where atoms are chaotic; else silence would pass."""
LONGEST = 2.0
"""Seconds that a run shall take whose time is predicted."""
LOOKS, ROUNDS = 1000, 3
TIMED = (
    ("pendulum", "stormer-verlet", 0.02), ("kepler", "rk4", 0.002), ("kepler", "gauss2", 0.02),
    ("lennard-jones", "stormer-verlet", 0.005), ("outer-solar-system", "yoshida6", 50),
)  # fmt: skip


class Setting(NamedTuple):
    """Runs of one scene with several methods, step sizes and spans, and by what their errors are measured.

    `exact` is the step size of gauss4 for the solution that others are compared with.
    """

    scene: str
    steps: tuple[float, ...]
    spans: tuple[float, ...]
    exact: float


METHODS = "stormer-verlet", "rk4", "gauss2", "yoshida6"
SETTINGS = (
    Setting("pendulum", (0.4, 0.1, 0.02), (20, 1_000, 20_000), 0.1),
    Setting("kepler", (0.05, 0.01), (60, 3_000), 0.01),
    Setting("henon-heiles", (0.3, 0.1), (60, 10_000), 0.1),
    Setting("toda", (0.1, 0.03), (60, 2_000), 0.03),
    Setting("lotka-volterra", (0.1, 0.03), (60, 3_000), 0.05),
    Setting("lennard-jones", (0.02, 0.005), (10, 100), 0.005),
    Setting("outer-solar-system", (100, 20), (1e5, 1e6), 50),
)


class Row(NamedTuple):
    """A run: what was expected of its energy and its solution, and what came (both None where it is not known)."""

    scene: str
    method: str
    h: float
    span: float
    energy: tuple[bs.advice.ExpectedError, float]
    solution: tuple[bs.advice.ExpectedError, float]


def rows(settings: tuple[Setting, ...] = SETTINGS, methods: tuple[str, ...] = METHODS) -> list[Row]:
    """Expected and measured errors of all runs."""
    return [
        _row(setting, method, h, span)
        for setting in settings
        for method in methods
        for h in setting.steps
        for span in setting.spans
    ]


def _row(setting: Setting, method: str, h: float, span: float) -> Row:
    scene, steps = bs.scene(setting.scene), round(span / h)
    expected = bs.predict_run(method, scene, h=h, steps=steps, timed=False)
    steps = round(expected.covered * steps) or steps  # over which errors are expected
    every, finer = max(1, steps // LOOKS), max(1, round(h / setting.exact))
    run = bs.integrate(method, scene, h=h, steps=steps, save_every=every, observe="energy")
    exact = bs.integrate("gauss4", scene, h=h / finer, steps=steps * finer, save_every=every * finer).y
    change = relative_change(run.observed["energy"], energy_size(scene, scene.y0))
    error = relative_distance(run.y, exact)
    return Row(setting.scene, method, h, span, (expected.energy, change), (expected.solution, error))


def table(found: list[Row]) -> str:
    """All runs as text."""
    lines = [f"{'scene':20}{'method':16}{'h':>8}{'span':>10}{'energy':>32}{'solution':>32}"]
    for row in found:
        cells = (_cell(*pair) for pair in (row.energy, row.solution))
        lines.append(f"{row.scene:20}{row.method:16}{row.h:8g}{row.span:10g}" + "".join(f"{x:>32}" for x in cells))
    return "\n".join(lines)


def _cell(expected: bs.advice.ExpectedError, value: float) -> str:
    if expected.value is None:
        return f"unknown, {value:.1e}"
    return f"{expected.value:.1e} / {value:.1e} = {expected.value / value:.2f}"


def error_figures() -> list[Figure]:
    """The largest factors by which errors were off, and how many were not given."""
    found, figures = rows(), []
    for what, most in UNKNOWN.items():
        pairs = [getattr(row, what) for row in found]
        known = [(x.value, value) for x, value in pairs if x.value and x.reason != ONLY_ROUNDING]
        worst = max(max(a / b, b / a) for a, b in known)
        figures.append(
            Figure(f"{what} error, predicted over measured or the inverse, {len(known)} runs", worst, FACTOR)
        )
        unknown = sum(expected.value is None for expected, _ in pairs)
        figures.append(
            Figure(f"{what} error: part of {len(pairs)} runs of which nothing is predicted", unknown / len(pairs), most)
        )
    return figures


def time_figures() -> list[Figure]:
    """Predicted times of runs over measured ones."""
    figures = []
    for name, method, h in TIMED:
        scene = bs.scene(name)
        run = {"h": h, "observe": "energy", "save_every": None}
        trial = bs.predict_run(method, scene, steps=10**6, observe_every=1000, **run).seconds or 1.0
        steps = max(10_000, int(10**6 * LONGEST / trial))
        every = steps // LOOKS
        ratios = []
        for _ in range(ROUNDS):
            expected = bs.predict_run(method, scene, steps=steps, observe_every=every, **run).seconds or 0.0
            began = perf_counter()
            bs.integrate(method, scene, steps=steps, observe_every=every, **run)
            ratios.append(expected / (perf_counter() - began))
        ratio = median(ratios)
        work = f"{method} on {name}, {steps:.0e} steps: time, predicted over measured or the inverse"
        figures.append(Figure(work, max(ratio, 1 / ratio), TIME))
    return figures


def measurements() -> list[Measurement]:
    """All that is measured here."""
    return [Measurement("prediction-errors", error_figures), Measurement("prediction-times", time_figures)]
