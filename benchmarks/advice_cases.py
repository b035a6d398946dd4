"""Whether recommended methods are the best: against a search through methods and fine grids of steps."""

from __future__ import annotations

import sysconfig
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import bseries as bs
from bseries.advice.measures import SOLUTION
from bseries.advice.timing import step_costs
from bseries.advice.work_precision.precision_curves import WorkPrecision
from bseries.advice.work_precision.recommendation import bracket
from bseries.advice.work_precision.sweeps import Curve, Judge

from .kinds import Figure, Measurement
from .timing import run

SCENES = ("pendulum", "kepler", "henon-heiles", "toda", "lotka-volterra")
ERRORS = (1e-3, 1e-6, 1e-9)
FINER = 4.0
"""A search begins with so many times the fewest steps of the coarse curve, or the most that it has."""
GRID = 1.01
"""From one number of steps to the next."""
BAR = 1.10
LONGEST = 60.0
"""Seconds for the command."""
REDUCED = {
    "pendulum": ("rk4", "blanes-moan-rkn6-11", "blanes-casas-rkn8", "chin4c", "gauss3", "dop853", "pefrl4"),
    "lotka-volterra": ("rk4", "tsit5", "dop853", "blanes-moan4", "gauss3", "yoshida6"),
}
"""Scenes and methods for a search that takes half a minute."""


class Found(NamedTuple):
    """What a search has found, and what was recommended: names, and CPU seconds taken in turn."""

    best: str
    best_seconds: float
    recommended: str
    seconds: float

    @property
    def ratio(self) -> float:
        """How many times as long as the best the recommended method takes."""
        return self.seconds / self.best_seconds


def search(advice: WorkPrecision, everything: WorkPrecision, judge: Judge, error: float) -> Found:
    """The best of all methods with the largest step of a fine grid that meets an error as all smaller ones do.

    Args:
        advice: What recommends.
        everything: The methods that are searched.
        judge: What makes runs, over the span of both.
        error: The error.
    """
    choice = advice.best(error)
    steps = {}
    for curve in everything.curves:
        most, meets = most_steps(curve, error), partial(meets_error, judge, curve, error)
        if most is not None and (count := fewest(meets, most, GRID)) is not None:
            steps[curve.candidate] = count
    work = {candidate.name: judge.work(candidate, count) for candidate, count in steps.items()}
    mine = next(curve for curve in advice.curves if curve.candidate.name == choice.method)
    work["recommended"] = judge.work(mine.candidate, choice.steps)
    costs = step_costs(work)
    seconds = {candidate.name: costs[candidate.name].seconds * count for candidate, count in steps.items()}
    best = min(seconds, key=seconds.__getitem__)
    own = costs["recommended"].seconds * choice.steps
    if own < seconds[best]:
        best, seconds = choice.method, {choice.method: own}
    return Found(best, seconds[best], choice.method, own)


def most_steps(curve: Curve, error: float) -> int | None:
    """Where a search among the steps of a method begins; None if its coarse curve does not reach the error."""
    sizes = curve.sizes(SOLUTION)
    good, _ = bracket(sizes, error)
    return None if good is None else max(n for n, size in sizes.items() if size <= error and n <= FINER * good)


def meets_error(judge: Judge, curve: Curve, error: float, steps: int) -> bool:
    """Whether a run with so many steps meets the error."""
    found = judge.run(curve.candidate, steps).error(SOLUTION)
    return found is not None and found <= error


def fewest(meets: Callable[[int], bool], most: int, grid: float) -> int | None:
    """The fewest steps of a grid, from the most downwards, as far as all meet an error; None if not even the most do.

    Args:
        meets: Whether a number of steps does.
        most: The most steps.
        grid: The factor from one number of steps to the next.
    """
    found, steps = None, most
    while steps >= 1 and meets(steps):
        found, steps = steps, min(steps - 1, round(steps / grid))
    return found


def recommended(name: str, methods: Sequence[str] | str = "all", errors: Sequence[float] = ERRORS) -> list[Figure]:
    """How recommended methods compare with the best ones on a scene."""
    scene = bs.scene(name)
    advice = bs.work_precision("auto", scene, measure=SOLUTION)
    everything = bs.work_precision(methods, scene, span=advice.span, measure=SOLUTION)
    judge = Judge(scene, advice.span, (SOLUTION,))
    figures = []
    for error in errors:
        found = search(advice, everything, judge, error)
        work = (
            f"{name}, error {error:.0e}: time of {found.recommended}, recommended, over that of {found.best}, the best"
        )
        figures.append(Figure(work, found.ratio, BAR))
    return figures


def whole_command() -> list[Figure]:
    """`bseries cost kepler` as a user runs it: for the first time, when everything has to be compiled, and again."""
    command = [str(Path(sysconfig.get_path("scripts"), "bseries")), "cost", "kepler"]
    with tempfile.TemporaryDirectory() as cache:
        places = {"BSERIES_CACHE": cache}
        first, again = (run(command, places)[0] for _ in range(2))
    return [
        Figure("bseries cost kepler, with nothing compiled yet", first, LONGEST, unit="s"),
        Figure("bseries cost kepler, again", again, LONGEST, unit="s"),
    ]


def measurements() -> list[Measurement]:
    """The command, a search on two scenes through some methods, and on five through all."""
    return [
        Measurement("cost-kepler", whole_command),
        *(
            Measurement(f"advice-{name}", lambda name=name, methods=methods: recommended(name, methods, ERRORS[:2]))
            for name, methods in REDUCED.items()
        ),
        *(Measurement(f"advice-{name}-full", lambda name=name: recommended(name), full=True) for name in SCENES),
    ]
