"""Rows on scenes: series written out, and evaluated by compiled elementary differentials."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import bseries as bs

from .kinds import Case
from .timing import ROOT, Sample, Sampler, run, time_calls

if TYPE_CHECKING:
    from bseries.fields.modified_fields import SceneSeries

POINTS = 400


def written_out(method: str, scene: str, order: int) -> Callable[[], Sampler]:
    """The modifying integrator's formulas through h^(order−1), simplified, with its coefficients at hand."""

    def prepare() -> Sampler:
        f = bs.modifying_field(bs.method(method), bs.scene(scene), order)

        def work() -> None:
            series = f.symbolic_series()
            for n in range(1, order + 1):
                series.term(n)

        return lambda: time_calls(work)

    return prepare


def pendulum_points() -> Any:
    """Points between −1 and 1, a row for each."""
    import numpy as np

    return np.random.default_rng(1).uniform(-1, 1, (POINTS, 2))


def per_point(make: Callable[[], SceneSeries | bs.hamiltonians.ModifiedHamiltonian]) -> Callable[[], Sampler]:
    """A value at one of many points near the start, in a compiled loop."""

    def prepare() -> Sampler:
        import numpy as np

        f = make()
        points = f.scene.y0[:, None] + 0.01 * np.random.default_rng(1).random((f.scene.dimension, POINTS))
        f(points, 0.01)

        def sample() -> Sample:
            return Sample(time_calls(lambda: f(points, 0.01)).seconds / POINTS)

        return sample

    return prepare


def pendulum(route: str = "auto") -> SceneSeries:
    """f_h of the pendulum, rk4, order 9."""
    return bs.modified_field(bs.method("rk4"), bs.scene("pendulum"), 9, route=route)


def atoms(count: int) -> SceneSeries:
    """f_h of Lennard-Jones atoms, Störmer–Verlet, order 5."""
    scene = bs.scene("lennard-jones", particles=count)
    return bs.modified_field(bs.method("stormer-verlet-kdk"), scene, 5)


def printed_formulas(*, compiled: bool) -> Callable[[], Sampler]:
    """The same formulas as SymPy prints them after common-subexpression elimination, at one point."""

    def prepare() -> Sampler:
        import sympy

        f, h = pendulum(), sympy.Symbol("h")
        sums = [sum(h**k * f.symbolic(k)[i] for k in range(f.order)) for i in range(2)]
        function = sympy.lambdify((*f.scene.symbols, h), sums, modules="math", cse=True)
        points = pendulum_points()
        rows = points if compiled else points.tolist()
        total = compiled_total(function) if compiled else lambda rows: sum(sum(function(p, q, 0.01)) for p, q in rows)
        total(rows)
        return lambda: Sample(time_calls(lambda: total(rows)).seconds / POINTS)

    return prepare


def compiled_total(function: Callable[..., Any]) -> Callable[[Any], float]:
    """A compiled loop that adds up the values of a function of (p, q, h) at many points."""
    import numba

    inner = numba.njit(function)

    @numba.njit
    def total(points: Any) -> float:
        found = 0.0
        for k in range(len(points)):
            p, q = inner(points[k, 0], points[k, 1], 0.01)
            found += p + q
        return found

    return total


def compile_time(*, cached: bool) -> Callable[[], Sampler]:
    """From a modified field to its first value by compiled code, in a fresh process, numba loaded."""

    def sample() -> Sample:
        command = [sys.executable, "-m", "benchmarks.fresh_field"]
        with tempfile.TemporaryDirectory() as folder:
            variables = {"PYTHONPATH": str(ROOT), "BSERIES_CACHE": folder}
            if cached:
                run(command, variables)
            return Sample(float(run(command, variables)[1]))

    return lambda: sample


def cases() -> list[Case]:
    """All rows."""
    oscillator = "explicit-midpoint on the nonlinear oscillator, modifying equation written out, order 8"
    field = "f_h of rk4 on the pendulum, order 9"
    particles = "f_h of stormer-verlet-kdk on lennard-jones, order 5, per point"
    return [
        Case("written-8", oscillator, written_out("explicit-midpoint", "nonlinear-oscillator", 8), 1.0),
        Case("field-9", f"{field}, per point", per_point(pendulum), 2e-6),
        Case("field-9-towers", f"{field}, per point, by towers", per_point(lambda: pendulum("towers"))),
        Case("field-9-lambdify", f"{field}, per point, sympy.lambdify(cse=True)", printed_formulas(compiled=False)),
        Case("field-9-cse", f"{field}, per point, the same compiled by numba", printed_formulas(compiled=True)),
        Case("field-9-first", f"{field}, compiled from nothing", compile_time(cached=False), 10.0),
        Case("field-9-cached", f"{field}, compiled code from the cache", compile_time(cached=True), 0.5),
        Case("atoms-9", f"{particles}, N = 9", per_point(lambda: atoms(9)), 25e-6),
        Case(
            "atoms-100", f"{particles}, N = 100 (138 times as many pairs)", per_point(lambda: atoms(100)), 25e-6 * 137.5
        ),
    ]
