"""Rows on effects: what each one that is on adds, and that those which are off cost nothing."""

from __future__ import annotations

from statistics import median

import bseries as bs
from bseries.advice.timing import MOST_STEPS, Work, step_costs

from .kinds import Figure, Measurement

MEASURED = {"pendulum": ("rk4", 0.1), "kepler": ("stormer-verlet", 0.01), "outer-solar-system": ("stormer-verlet", 10)}
"""Scenes, each with a method and a step size."""
MANY = 10
REPEATED = 5
"""The ratio of two equal times is the median of so many measurements."""
TOLERANCE = 1.05


def against_effects_on() -> list[Figure]:
    """Time for a step and for a field evaluation, and trees, against the number of effects that are on."""
    found = []
    for scene, (method, h) in MEASURED.items():
        for row in bs.effect_costs(method, scene, h=h):
            work = f"{scene}, {len(row.effects)} effects on"
            found += [
                Figure(f"{work}: a step of {method}", row.step.seconds, unit="s"),
                Figure(f"{work}: an evaluation of the field", row.field.seconds, unit="s"),
            ]
            if row.trees and row.all_trees:
                what = f"trees to order 6 in the modified equation of {method}, of all {row.all_trees:,}"
                found.append(Figure(f"{work}: {what}", row.trees / row.all_trees))
    return found


def off_against_never() -> list[Figure]:
    """Scenes whose effects are all off, over the same ones that never had any: 1 but for noise."""
    effects = {f"e{k}": bs.Effect(field={"p": f"-c{k}*p^{k}"}, parameters={f"c{k}": 1}) for k in range(1, MANY + 1)}
    given = {"hamiltonian": "p^2/2 - cos(q)", "start": {"p": [0], "q": ["3/2"]}}
    rich = bs.Scene({"p": 1, "q": 1}, effects=effects, name="with effects", **given)
    scenes = {"never": bs.Scene({"p": 1, "q": 1}, name="plain", **given), "off": rich}
    kinds = {
        "a step of rk4": ("rk4", 0.1, {}),
        "an evaluation of the field": ("explicit-euler", 0.1 / MOST_STEPS, {"compensated": False}),
    }
    found = []
    for what, (method, h, options) in kinds.items():
        both = {name: Work(scene, method, h, options=options) for name, scene in scenes.items()}
        times = [step_costs(both) for _ in range(REPEATED)]
        ratio = median(time["off"].seconds / time["never"].seconds for time in times)
        work = f"pendulum with {MANY} effects that are off: {what}, over the same without any effects"
        found.append(Figure(work, ratio, TOLERANCE))
    return found


def measurements() -> list[Measurement]:
    """All rows."""
    return [
        Measurement("effects-on", against_effects_on),
        Measurement("effects-off", off_against_never),
    ]
