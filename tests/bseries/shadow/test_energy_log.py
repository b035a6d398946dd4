"""Logs of energies in the formats of other programs, and the verdicts on them."""

from __future__ import annotations

import numpy as np
import pytest

import bseries as bs
from bseries.shadow import energy_log

N = 4000
RNG = np.random.default_rng(5)
T = 0.002 * np.arange(N)
RIPPLE = 1e-3 * np.cos(0.7 * np.arange(N)) + 1e-4 * RNG.normal(size=N)
WALK = 1e-4 * np.cumsum(RNG.normal(size=N))


def lammps(energy):
    head = ["LAMMPS (2 Aug 2023)", "Step Temp E_pair TotEng Press", "0 1.0 -6.0 -4.5 0.1", "Loop time of 0.01"]
    rows = [f"{10 * k:8d} 1.44 -5.9 {x:.12f} 0.3" for k, x in enumerate(energy)]
    return [*head, "run 40000", "   Step   Temp   E_pair   TotEng   Press", *rows, "Loop time of 12.3 on 1 procs"]


def gromacs(energy):
    head = ["# gmx energy", '@ title "GROMACS Energies"', '@ s0 legend "Potential"', '@ s1 legend "Total Energy"']
    return [*head, *(f"{t:.6f} -10.5 {x:.12f}" for t, x in zip(T, energy, strict=True))]


def openmm(energy):
    head = '#"Step","Time (ps)","Potential Energy (kJ/mole)","Total Energy (kJ/mole)"'
    return [head, *(f"{k},{t},{-x},{x}" for k, (t, x) in enumerate(zip(T, energy, strict=True)))]


@pytest.mark.parametrize(("write", "interval"), [(lammps, 10), (gromacs, 0.002), (openmm, 1)])
def test_a_drift_is_found_in_logs_of_other_programs(write, interval):
    found = energy_log(write(RIPPLE + 2e-6 * np.arange(N)))
    assert found.kind == "linear drift"
    assert found.interval == pytest.approx(interval)
    assert found.statistics.mean * interval == pytest.approx(2e-6, rel=0.02)
    assert energy_log(write(RIPPLE)).kind == "no drift seen"
    assert energy_log(write(RIPPLE + WALK)).kind == "square-root drift"


def test_the_numbers_are_those_of_the_statistics_of_a_run():
    run = bs.integrate("rk4", "pendulum", h=0.3, steps=4000, observe="energy", y0=[0.5, 1.0])
    lines = ["t,energy", *(f"{t!r},{x!r}" for t, x in zip(run.t.tolist(), run["energy"].tolist(), strict=True))]
    found = energy_log(lines)
    assert found.kind == "linear drift"
    assert found.statistics.mean == pytest.approx(np.polyfit(run.t, run["energy"], 1)[0], rel=0.02)


def test_columns_and_intervals_are_chosen():
    lines = ["a b", *(f"{x} {x + 2e-6 * k}" for k, x in enumerate(RIPPLE))]
    assert energy_log(lines, "b", h=0.5).statistics.mean == pytest.approx(4e-6, rel=0.02)
    assert energy_log([line.split()[1] for line in lines[1:]]).kind == "linear drift"


@pytest.mark.parametrize(
    ("lines", "column", "sentence"),
    [
        (["nothing here"], None, "source must have a table of numbers, but has none"),
        (
            ["t E1 E2", *["0 1 2"] * 600],
            None,
            "column must be one of t, E1, E2, but was None: there is no total energy",
        ),
        (["t E1 E2", *["0 1 2"] * 600], "E3", "columns must fit names in source, but 'E3' fits none of t, E1, E2"),
        (["t energy", *(f"{k**2} 1" for k in range(600))], None, "t must be equidistant, but its steps are 1 to 1197"),
        (["t energy", *(f"{k} 1" for k in range(100))], None, "values must be 512 or more"),
        (["t energy", *(f"{k} nan" for k in range(600))], None, "values must be finite"),
    ],
)
def test_what_is_no_log_is_refused(lines, column, sentence):
    with pytest.raises(bs.SeriesError, match=sentence):
        energy_log(lines, column)
