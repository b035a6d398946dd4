"""What a step costs, as a ratio to C: interleaved rounds, medians over rounds, geometric means over scenes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from statistics import geometric_mean, median
from time import process_time
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import bseries as bs

from .c_steps import METHODS, STEP_SIZES, Run, c_steps

if TYPE_CHECKING:
    import numpy as np

Stepping: TypeAlias = Callable[[str, str], Run]
"""Makes run(y, h, steps) for a scene and a method, by their names; what is compiled is compiled by its first call."""

SAMPLE = 0.02
"""Seconds of steps in one sample."""


class Cell(NamedTuple):
    """One scene with one method: seconds a step, ours and theirs, in every round."""

    scene: str
    method: str
    ours: list[float]
    theirs: list[float]

    @property
    def ratio(self) -> float:
        """The median of the ratios of the rounds."""
        return median(mine / other for mine, other in zip(self.ours, self.theirs, strict=True))


def compare(
    ours: Stepping,
    theirs: Stepping = c_steps,
    *,
    scenes: Iterable[str] = tuple(STEP_SIZES),
    methods: Iterable[str] = METHODS,
    rounds: int = 9,
    sample: float = SAMPLE,
    progress: Callable[[int, str], None] = lambda done, name: None,
) -> list[Cell]:
    """Time both sides on every scene with every method, a sample of each in every round.

    The side that goes first changes from round to round. All samples begin at the scene's start and have the same
    number of steps, in one call.
    """
    contests = [_Contest(ours, theirs, scene, method, sample) for method in methods for scene in scenes]
    for done in range(rounds):
        for contest in contests:
            progress(done, f"{contest.cell.method} on {contest.cell.scene}")
            contest.sample(ours_first=done % 2 == 0)
    return [contest.cell for contest in contests]


def means(cells: Iterable[Cell]) -> dict[str, float]:
    """For every method the geometric mean of its ratios on the scenes."""
    found: dict[str, list[float]] = {}
    for cell in cells:
        found.setdefault(cell.method, []).append(cell.ratio)
    return {method: geometric_mean(ratios) for method, ratios in found.items()}


class _Contest:
    """Both sides on one scene with one method, compiled and with their number of steps."""

    def __init__(self, ours: Stepping, theirs: Stepping, scene: str, method: str, sample: float) -> None:
        self.cell = Cell(scene, method, [], [])
        self.sides = ((ours(scene, method), self.cell.ours), (theirs(scene, method), self.cell.theirs))
        self.start, self.h = bs.scene(scene).y0, STEP_SIZES[scene]
        for run, _ in self.sides:
            self._time(run, 1)
        self.steps = self._fill(sample)

    def sample(self, *, ours_first: bool) -> None:
        """One sample of each side."""
        for run, seconds in self.sides if ours_first else self.sides[::-1]:
            seconds.append(self._time(run, self.steps) / self.steps)

    def _fill(self, sample: float) -> int:
        """So many steps that the second side takes as long as one sample."""
        steps, seconds = 100, 0.0
        while seconds < sample / 4:
            steps *= 4
            seconds = self._time(self.sides[1][0], steps)
        return max(1, round(steps * sample / seconds))

    def _time(self, run: Run, steps: int) -> float:
        y: np.ndarray = self.start.copy()
        begin = process_time()
        run(y, self.h, steps)
        return process_time() - begin
