"""Rows on the algebra: substitution, composition, structure tests, order conditions."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable

import bseries as bs
from trees import table as tables
from trees.table import partitions_of

from .kinds import GB, Case
from .timing import ROOT, Sample, Sampler, run, time_calls

MIDPOINT = "explicit-midpoint"


def modifying(method: str, order: int) -> Callable[[], Sampler]:
    """The modifying integrator with table and splits at hand."""

    def prepare() -> Sampler:
        chosen = bs.method(method)

        def sample() -> Sample:
            _ = next(tables.tree_table(order).cut_chunks())  # the next case may have thrown it away
            return time_calls(lambda: bs.modifying_integrator(chosen, order))

        bs.modifying_integrator(chosen, order)
        return sample

    return prepare


def composition(first: str, second: str, order: int) -> Callable[[], Sampler]:
    """Two methods' series, one after the other, splits at hand."""

    def prepare() -> Sampler:
        a, c = (bs.series(bs.method(name), order) for name in (first, second))
        bs.compose(a, c)
        return lambda: time_calls(lambda: bs.compose(a, c))

    return prepare


def substitution(order: int, *, kept: bool) -> Callable[[], Sampler]:
    """The modified equation of one method into the series of another, with the lists of partitions kept or not."""

    def prepare() -> Sampler:
        b, a = bs.modified_equation(bs.method(MIDPOINT), order), bs.series(bs.method("rk4"), order)

        def work() -> object:
            if not kept:
                partitions_of.cache_clear()
            return bs.substitute(b, a)

        def sample() -> Sample:
            work()  # keeps the lists, which another case may have thrown away
            return time_calls(work)

        return sample

    return prepare


def structure(test: Callable[..., object], method: str, order: int) -> Callable[[], Sampler]:
    """A test of a method, with trees and their classes at hand."""

    def prepare() -> Sampler:
        chosen = bs.method(method)
        test(chosen, order)
        return lambda: time_calls(lambda: test(chosen, order))

    return prepare


def conditions(order: int, stages: int) -> Callable[[], Sampler]:
    """Residuals of all Runge–Kutta order conditions and their Jacobian, compiled, at one random point."""

    def prepare() -> Sampler:
        import numpy as np

        source = random.Random(1)
        compiled = bs.order_conditions("runge-kutta", order).compile(stages)
        A = np.array([[source.uniform(-1, 1) for _ in range(stages)] for _ in range(stages)])
        b = np.array([source.uniform(-1, 1) for _ in range(stages)])

        def work() -> None:
            compiled.residual(A, b)
            compiled.jacobian(A, b)

        work()
        return lambda: time_calls(work)

    return prepare


def fresh_series(method: str, order: int) -> Callable[[], Sampler]:
    """A process that computes a method's modified equation from nothing."""

    def sample() -> Sample:
        command = [sys.executable, "-m", "benchmarks.fresh", method, str(order)]
        seconds, printed = run(command, {"PYTHONPATH": str(ROOT)})
        return Sample(seconds, int(printed))

    return lambda: sample


def cases() -> list[Case]:
    """All rows."""
    rows = [
        Case(f"modifying-{n}", f"{MIDPOINT}, modifying integrator, order {n}", modifying(MIDPOINT, n), bar)
        for n, bar in ((6, None), (9, 1e-3), (12, None), (15, 1.0))
    ]
    rows += [
        Case(f"compose-{n}", f"{MIDPOINT}, then rk4, order {n}", composition(MIDPOINT, "rk4", n), bar)
        for n, bar in ((7, None), (9, 0.5e-3), (12, 10e-3))
    ]
    for n, cold, kept in ((6, None, None), (9, 20e-3, 1e-3), (11, 0.5, 50e-3)):
        work = f"a modified equation into the series of rk4, order {n}"
        rows.append(Case(f"substitute-{n}", f"{work}, lists kept", substitution(n, kept=True), kept))
        rows.append(Case(f"substitute-{n}-cold", f"{work}, cold", substitution(n, kept=False), cold))
    return [
        *rows,
        Case("energy-7", "avf, energy preservation, order 7", structure(bs.energy_preservation, "avf", 7)),
        Case("energy-9", "avf, energy preservation, order 9", structure(bs.energy_preservation, "avf", 9), 10e-3),
        Case(
            "symplectic-9",
            "implicit-midpoint, symplecticity, order 9",
            structure(bs.symplecticity, "implicit-midpoint", 9),
            0.7e-3,
        ),
        Case(
            "errors-8",
            f"{MIDPOINT}, error coefficients, order 8",
            structure(bs.analysis.error_coefficients, MIDPOINT, 7),
        ),
        Case("order-7", "gauss3, order conditions, order 7", structure(bs.order_of, "gauss3", 7)),
        Case("conditions-10", "order conditions to order 10, residual and Jacobian, s = 17", conditions(10, 17), 5e-3),
        Case(
            "two-derivative-9",
            "tdrk5, modified equation, order 9, all from nothing",
            fresh_series("tdrk5", 9),
            None,
            1 * GB,
        ),
    ]
