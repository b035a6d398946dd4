"""Verdicts on the drift of the energy, on random scenes of one to three degrees of freedom, against longer runs.

    python tests/bseries/random_drifts.py 200

judges so many runs, and compares every claim with a run from the same start that is ten times as long.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import bseries as bs

LONGER = 10
SYMPLECTIC = ("stormer-verlet", "symplectic-euler-p", "implicit-midpoint", "yoshida4", "gauss2")
OTHERS = ("rk4", "heun2", "kutta3", "explicit-euler", "simplified-takahashi-imada", "lobatto-iiib3")


class Case(NamedTuple):
    """A run to be judged."""

    method: str
    scene: bs.Scene
    h: float
    steps: int


def cases(count: int, seed: int) -> Iterator[Case]:
    """Random scenes with methods of all kinds; every second one is symplectic."""
    random = np.random.default_rng(seed)
    for k in range(count):
        scene = scene_of(random, 1 + k % 3)
        methods = SYMPLECTIC if k % 2 else OTHERS
        h = float(np.exp(random.uniform(np.log(0.01), np.log(0.5))))
        yield Case(
            methods[random.integers(len(methods))],
            scene,
            round(h, 4),
            int(np.exp(random.uniform(np.log(1000), np.log(20_000)))),
        )


def scene_of(random: np.random.Generator, degrees: int) -> bs.Scene:
    """Coupled oscillators, coupled pendulums, or with two and three degrees of freedom also an attracting centre."""
    kind = random.integers(3 if degrees > 1 else 2)
    p, q = ([f"{name}{i + 1}" if degrees > 1 else name for i in range(degrees)] for name in "pq")
    pairs = [(i, j) for j in range(degrees) for i in range(j)]

    def numbers(low: float, high: float) -> list[float]:
        return random.uniform(low, high, degrees).round(3).tolist()

    kinetic = " + ".join(f"{x}^2/2" for x in p)
    momenta, places = numbers(-1, 1), numbers(-1, 1)
    if kind == 0:
        terms = [f"{a}*{x}^2/2 + {b}*{x}^4/4" for a, b, x in zip(numbers(0.5, 3), numbers(0, 1), q, strict=True)]
        terms += [f"{a}*{q[i]}^2*{q[j]}" for a, (i, j) in zip(numbers(-0.3, 0.3), pairs, strict=False)]
        momenta, places = numbers(-0.4, 0.4), numbers(-0.4, 0.4)
    elif kind == 1:
        terms = [
            f"-{a}*cos({x}) + {b}*sin(2*{x})" for a, b, x in zip(numbers(0.5, 2), numbers(-0.3, 0.3), q, strict=True)
        ]
        terms += [f"-{a}*cos({q[i]} - {q[j]})" for a, (i, j) in zip(numbers(0.1, 1), pairs, strict=False)]
        momenta, places = numbers(-2.5, 2.5), numbers(-2, 2)
    else:
        terms = [f"-1/sqrt({' + '.join(f'{x}^2' for x in q)})"]
        places = [1.0] + [0.0] * (degrees - 1)
        momenta = [0.0, round(random.uniform(0.75, 1.1), 3), *numbers(-0.2, 0.2)[2:]]
    start = {"p": momenta, "q": places}
    return bs.Scene({"p": degrees, "q": degrees}, hamiltonian=" + ".join([kinetic, *terms]), start=start)


def fault(short: bs.hamiltonians.DriftReport, long: bs.hamiltonians.DriftReport) -> str:
    """What a longer run says against the verdict on a shorter one; empty if nothing."""
    few, many = short.evidence, long.evidence
    if few is None or many is None or short.verdict == "no drift seen":
        return ""
    if few.energy is None or many.energy is None:
        return "" if short.verdict in ("linear drift", "unsteady drift") else "the energy is lost"
    pairs = [(few.energy, many.energy)] if few.total is None else [(few.energy, many.energy), (few.total, many.total)]
    if short.verdict == "bounded":
        grown = [b.deviation / a.deviation for a, b in pairs if a.amplitude > few.rounding]
        return f"bands grow by {max(grown):.2g}" if grown and max(grown) > 1.5 else ""
    a, b = pairs[-1] if few.is_predicted else pairs[0]
    if short.verdict == "square-root drift":
        ratio = b.diffusion / a.diffusion
        return "" if 1 / 6 < ratio < 6 and long.verdict != "bounded" else f"D changes by {ratio:.2g}, {long.verdict}"
    further = b.end / a.end
    if short.verdict == "unsteady drift":
        return "" if further > 0.5 else f"comes back to {further:.2g}"
    return "" if further > 3 or (long.verdict == "unsteady drift" and further > 1) else f"goes on to {further:.2g} only"


def judged(case: Case) -> tuple[bs.hamiltonians.DriftReport, str]:
    """The verdict on a case, and what is wrong with it."""
    y0 = case.scene.y0
    short, long = (
        bs.energy_drift(case.method, case.scene, y0=y0, h=case.h, steps=n) for n in (case.steps, LONGER * case.steps)
    )
    return short, _fault_of_slope(case, short) if short.evidence is None else fault(short, long)


def _fault_of_slope(case: Case, report: bs.hamiltonians.DriftReport) -> str:
    """What a longer run says against a slope that is predicted from a closed orbit."""
    if report.verdict != "linear drift":
        return f"no evidence for {report.verdict}"
    try:
        run = bs.integrate(
            case.method, case.scene, h=case.h, steps=LONGER * case.steps, observe="energy", observe_every=1
        )
    except bs.errors:
        return ""
    changes = run.observed["energy"] - run.observed["energy"][0]
    band, end = np.ptp(changes[: case.steps // LONGER]), float(changes[-1])
    is_visible = abs(report.slope()) * run.t[-1] > 2 * band
    return f"no drift of slope {report.slope():.2g}" if is_visible and end * report.slope() <= 0 else ""


def main(count: int, seed: int = 0) -> None:
    """Judge random cases, print what is wrong, and count verdicts and faults by kind of method."""
    found: Counter[tuple[str, str, bool]] = Counter()
    for number, case in enumerate(cases(count, seed)):
        kind = "symplectic" if case.method in SYMPLECTIC else "other"
        try:
            report, wrong = judged(case)
        except bs.errors as error:
            found[kind, f"refused: {str(error)[:30]}", False] += 1
            continue
        found[kind, report.verdict, bool(wrong)] += 1
        if wrong:
            print(
                number,
                case.method,
                case.scene.hamiltonian,
                case.scene.start,
                case.h,
                case.steps,
                report.verdict,
                wrong,
                sep="; ",
                flush=True,
            )
        if number % 20 == 19:
            print(number + 1, sorted(found.items()), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), *map(int, sys.argv[2:]))
