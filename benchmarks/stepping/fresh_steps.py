"""Steps in a process of its own; prints what has been measured as JSON.

`memory STEPS` prints three peaks of memory; `fresh SCENE:METHOD` and `loaded SCENE:METHOD …` print the seconds that
each pair takes from the scene to its first step.
"""

import json
import sys
from time import perf_counter

import bseries as bs
from benchmarks.timing import peak_memory

SHORTER = 100
ROWS = 10_000


def memory(steps: int) -> list[int]:
    """Peaks of memory: after a step, after steps/100, and after all; with as many observations."""

    def run(count: int) -> int:
        every = max(1, count // ROWS)
        bs.integrate(
            "stormer-verlet", bs.scene("pendulum"), h=0.1, steps=count, save_every=None,
            observe="energy", observe_every=every,
        )  # fmt: skip
        return peak_memory()

    return [run(1), run(steps // SHORTER), run(steps)]


def first_step(scene: str, method: str) -> float:
    """Seconds to the end of the first step of a method on a scene that is at hand."""
    model = bs.scene(scene)
    begin = perf_counter()
    stepper = bs.stepper(method, model)
    stepper.advance(stepper.start(h=1e-3), 1)
    return perf_counter() - begin


if __name__ == "__main__":
    task, *arguments = sys.argv[1:]
    if task == "memory":
        print(json.dumps(memory(int(arguments[0]))))
    else:
        if task == "loaded":
            first_step("nonlinear-oscillator", "implicit-midpoint")
        print(json.dumps([first_step(*pair.split(":")) for pair in arguments]))
