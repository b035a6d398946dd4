"""Shadow energies of stored trajectories: any way in gives the same, statistics are right, wrong data are refused."""

from __future__ import annotations

import io
import json
import sys
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from shadow_oracles import evaluated

import bseries as bs
from bseries.shadow import files, kernels, trajectory_energies
from bseries.shadow.formulas import shadow_formula
from bseries.shadow.report import check_picture
from bseries.shadow.roundings import written
from bseries.shadow.statistics import BLOCKS, Statistics, slope_error
from bseries.shadow.trajectory_energies import formula_arrays
from integrators.core import stored_arrays, text_files

H = 0.1


@pytest.fixture(scope="module")
def run():
    """A run whose coordinates are not those of one particle only, with masses."""
    return bs.integrate(problem(), "stormer-verlet", h=H, steps=600)


def problem():
    energy = "p1^2/4 + p2^2/6 + 1 - cos(q1) + q2^2/2 + q1*q2/5"
    return bs.Scene({"p": 2, "q": 2}, hamiltonian=energy, start={"p": [0.3, -1], "q": [1, 0.5]})


@pytest.fixture(scope="module")
def arrays(run):
    """The same as arrays that say everything."""
    found = {"t": run.t} | columns_of(run.y) | {"mass": np.array([2.0, 3.0])}
    for array in found.values():
        array.setflags(write=False)
    return found


def columns_of(y):
    """Positions, momenta, potentials and their gradients of states."""
    p, q = y[:2].T.copy(), y[2:].T.copy()
    u = 1 - np.cos(q[:, 0]) + q[:, 1] ** 2 / 2 + q[:, 0] * q[:, 1] / 5
    gradient = np.stack((np.sin(q[:, 0]) + q[:, 1] / 5, q[:, 1] + q[:, 0] / 5), axis=1)
    return {"q": q, "p": p, "U": u, "gradU": gradient}


def table(arrays, separator=",", digits=17, start="", skip=()):
    """The arrays as text."""
    columns = {"t": arrays["t"], "U": arrays["U"]}
    for role in ("q", "p", "gradU"):
        columns |= {f"{role}{k + 1}": column for k, column in enumerate(arrays[role].T)}
    columns = {name: column for name, column in columns.items() if name not in skip}
    lines = (separator.join(f"{x:.{digits}g}" for x in row) for row in zip(*columns.values(), strict=True))
    return start + separator.join(columns) + "\n" + "\n".join(lines) + "\n"


def same(report, other, rel=1e-9):
    for row, wanted in zip(report.rows, other.rows, strict=True):
        assert row.mean == pytest.approx(wanted.mean, abs=1e-14)
        assert row.deviation == pytest.approx(wanted.deviation, rel=rel, abs=4e-15)
        assert row.scatter == pytest.approx(wanted.scatter, rel=rel, abs=4e-15)


@pytest.fixture(scope="module")
def report(run):
    return bs.shadow_energy(run)


def test_values_are_those_of_the_exact_formulas(run, arrays):
    report = bs.shadow_energy(run, order=24, keep=True)
    states = list(zip(arrays["p"], arrays["U"], arrays["gradU"], strict=True))
    assert len(report.times) == len(run.t) - 12
    for order, values in report.values.items():
        for k in (0, 1, 250, len(values) - 1):
            with mpmath.workdps(30):
                exact = evaluated(shadow_formula(order), states, [2, 3], mpmath.mpf(H), k + 6)
            assert values[k] == pytest.approx(float(exact), abs=1e-14)
    assert report.times[[0, -1]] == pytest.approx(run.t[[6, -7]])


def test_each_order_is_steadier_until_rounding(report):
    deviations = [row.deviation for row in report.rows]
    assert all(low > 10 * high for low, high in pairwise(deviations[:5]))
    assert report.limit == "rounding"
    assert report.noise_floor < 1e-14
    assert report.best.order >= 10
    assert bs.shadow_energy(run_of(200), order=4).limit == "order"


def run_of(steps, h=H, **options):
    return bs.integrate(problem(), options.pop("method", "stormer-verlet"), h=h, steps=steps, **options)


@pytest.mark.parametrize(
    "way",
    ["arrays", "columns last", "forces", "velocities", "scene", "npz", "packed", "own", "csv", "blanks", "stream"],
)
def test_every_way_in_gives_the_same(way, run, arrays, report, tmp_path):
    path = tmp_path / "run.npz"
    scene = None
    if way == "arrays":
        data = arrays
    elif way == "columns last":
        data = {name: x.T if x.ndim == 2 else x for name, x in arrays.items()}
    elif way == "forces":
        data = {"time": arrays["t"], "x": arrays["q"], "momenta": arrays["p"], "PotEng": arrays["U"]}
        data |= {"forces": -arrays["gradU"], "masses": arrays["mass"]}
    elif way == "velocities":
        data = {name: x for name, x in arrays.items() if name != "p"} | {"v": arrays["p"] / arrays["mass"]}
    elif way == "scene":
        data, scene = {name: arrays[name] for name in ("t", "q", "p")}, problem()
    elif way == "npz":
        np.savez(path, **arrays)
        data = path
    elif way == "packed":
        np.savez_compressed(path, **arrays)
        data = path
    elif way == "own":
        run.save(path)
        data = str(path)
    elif way == "stream":
        data = io.StringIO(table(arrays))
        return same(bs.shadow_energy(data, mass=[2, 3]), report)
    else:
        path = tmp_path / "run.txt"
        path.write_text(table(arrays, *((" ", 17, "# ") if way == "blanks" else (",",))))
        return same(bs.shadow_energy(path, mass=[2, 3]), report)
    return same(bs.shadow_energy(data, scene), report)


def test_columns_can_be_called_anything(arrays, report, tmp_path):
    path = tmp_path / "md.csv"
    text = table(arrays).replace("gradU", "slope_").replace("q", "pos.").replace("U", "Epot")
    path.write_text(text)
    found = bs.shadow_energy(path, mass=[2, 3], columns={"q": "pos.*", "gradU": "slope_*", "U": "Epot"})
    same(found, report)


def test_x_y_vx_vy_are_paired_by_their_names(arrays, tmp_path):
    names = ["t", "PotEng", "x1", "y1", "vy1", "vx1", "fx1", "fy1", "temp"]
    v, f = arrays["p"] / arrays["mass"], -arrays["gradU"]
    rows = np.column_stack((arrays["t"], arrays["U"], arrays["q"], v[:, ::-1], f, arrays["U"]))
    path = tmp_path / "md.txt"
    np.savetxt(path, rows, header="\t".join(names), delimiter="\t", fmt="%.17g")
    assert bs.shadow_energy(path, mass=[2, 3]).limit == "rounding"


def test_pieces_do_not_matter(run, report, monkeypatch):
    monkeypatch.setattr(trajectory_energies, "CHUNK_NUMBERS", 1)  # 256 states at a time
    pieces = []
    found = bs.shadow_energy(run, progress=lambda done, total: pieces.append((done, total)), keep=True)
    assert pieces == [(256, 601), (512, 601), (601, 601)]
    assert found.rows == report.rows
    whole = bs.shadow_energy(run_of(600), keep=True)
    assert all(np.array_equal(found.values[order], whole.values[order]) for order in whole.values)


def test_a_mass_matrix_that_is_not_diagonal():
    energy = "p1^2/2 + p2^2/3 + p1*p2/4 + 1 - cos(q1) + q2^2/2 + q1*q2/5"
    coupled = bs.Scene({"p": 2, "q": 2}, hamiltonian=energy, start={"p": [0.3, -1], "q": [1, 0.5]})
    report = bs.shadow_energy(bs.integrate(coupled, "stormer-verlet", h=0.05, steps=400))
    assert report.noise_floor < 1e-14


@pytest.mark.parametrize("layout", ["half-behind", "half-ahead"])
def test_momenta_of_leapfrog(layout, arrays, report):
    sign = 1 if layout == "half-behind" else -1
    shifted = arrays | {"p": arrays["p"] + sign * H / 2 * arrays["gradU"]}
    same(bs.shadow_energy(shifted, layout=layout), report)
    with pytest.raises(bs.SeriesError, match=f"kick–drift–kick.*but they are of the layout '{layout}'"):
        bs.shadow_energy(shifted)


def test_drift_kick_drift_with_a_scene():
    run = run_of(600, method="position-verlet")
    assert bs.shadow_energy(run, layout="drift-kick-drift").noise_floor < 1e-14
    with pytest.raises(bs.SeriesError, match="layout 'drift-kick-drift'"):
        bs.shadow_energy(run)


def test_wrapped_positions_are_unwrapped_if_the_period_is_known():
    pendulum = bs.scene("pendulum").with_start(p=[3], q=[0])
    run = bs.integrate(pendulum, "stormer-verlet", h=0.05, steps=1000)
    p, q = run.y
    data = {"t": run.t, "p": p, "q": np.mod(q, 2 * np.pi), "U": -np.cos(q), "gradU": np.sin(q)}
    with pytest.raises(bs.SeriesError, match=r"positions jump by 6\.28319, as if wrapped into a box \(period"):
        bs.shadow_energy(data)
    for scene in (None, pendulum):
        assert bs.shadow_energy(data, scene, period=2 * np.pi).noise_floor < 1e-13


def test_few_digits_are_enough_for_low_orders(arrays, tmp_path):
    single = {name: x.astype(np.float32) if name in "qp" else x for name, x in arrays.items()}
    report = bs.shadow_energy(single)
    assert 1e-9 < report.noise_floor < 1e-6
    path = tmp_path / "short.csv"
    path.write_text(table(arrays, digits=7))
    report = bs.shadow_energy(path, mass=[2, 3])
    assert 1e-9 < report.noise_floor < 1e-5


def written_as(arrays, formats, offset=0.0, rows=slice(None)):
    """A table of a step, times, positions, velocities, forces and potentials, each in a format."""
    v = arrays["p"] / arrays["mass"]
    columns = np.column_stack((arrays["t"], arrays["q"], v, -arrays["gradU"], arrays["U"] + offset))[rows]
    kinds = [formats.get(role, formats["other"]) for role in ("t", "q", "q", "v", "v", "F", "F", "U")]
    lines = (",".join([str(k), *map(str.__mod__, kinds, row)]) for k, row in enumerate(columns.tolist()))
    return io.StringIO("\n".join(["step,t,x,y,vx,vy,fx,fy,PotEng", *lines]))


FORMATS = {
    "fixed": ({"other": "%.8f"}, 1e-7),
    "short": ({"other": "%g"}, 1e-4),
    "long": ({"other": "%.9g"}, 1e-6),
    "scientific": ({"other": "%.8e"}, 1e-6),
    "thermo": ({"t": "%g", "U": "%.10g", "other": "%.8f"}, 1e-6),
    "gro": ({"t": "%.3f", "q": "%.4f", "v": "%.4f", "other": "%.6f"}, 1e-2),
    "doubles": ({"other": "%r"}, 1e-9),
}


@pytest.mark.parametrize("offset", [0.0, 1e4, -1e6])
@pytest.mark.parametrize("name", FORMATS)
def test_a_large_potential_makes_no_other_column_exact(name, offset, arrays):
    """What is written of a run is that run, in the format of any program, and its noise is that of its digits."""
    formats, noise = FORMATS[name]
    report = bs.shadow_energy(written_as(arrays, formats, offset), mass=[2, 3], order=8)
    blind = 0 if formats.get("U", formats["other"]) in ("%.8f", "%.6f", "%r") else abs(offset)
    assert report.rows[-1].deviation < noise + 1e-5 * blind
    assert report.rows[-1].mean == pytest.approx(0.75 + offset, abs=0.2 + 1e-5 * blind)


@pytest.mark.parametrize("name", ["fixed", "short", "long", "scientific", "thermo", "doubles"])
def test_rounded_text_that_is_no_such_run_is_refused_all_the_same(name, arrays):
    formats, _ = FORMATS[name]
    thin = {x: y if x in ("t", "mass") else y[::2] for x, y in arrays.items()}
    with pytest.raises(bs.SeriesError, match="as if only one in 2 states was kept"):
        bs.shadow_energy(written_as(thin | {"t": arrays["t"][:301]}, formats, 1e4), mass=[2, 3])
    p, q = np.split(run_of(600, method="rk4", h=0.3).y, 2)
    other = {"t": 0.3 * np.arange(601), "mass": arrays["mass"]} | columns_of(np.vstack((p, q)))
    with pytest.raises(bs.SeriesError, match="must have consecutive steps of Störmer–Verlet"):
        bs.shadow_energy(written_as(other, formats, 1e4), mass=[2, 3])


def test_roundings_of_text_are_those_of_each_column():
    fixed, short, whole, tiny = written([["0.300", "12.125"], ["0.3", "12.1251"], ["7", "12"], ["1.25e-9", "2.50e3"]])
    assert (fixed.absolute, short.absolute, whole.absolute) == (1e-3, 0.0, 0.0)
    assert (short.relative, whole.relative, tiny.relative) == pytest.approx((1e-5, 1e-5, 1e-2))
    assert written([["7", "12"]])[0].relative < 1e-14


@pytest.mark.parametrize("role", ["q", "p", "U", "gradU", "mass"])
def test_any_array_in_single_precision_will_do(role, arrays, report):
    data = arrays | {role: arrays[role].astype(np.float32)}
    if role == "mass":  # 2.2 is no number in single precision
        root = np.sqrt(1.1)
        data |= {"q": arrays["q"] / root, "p": arrays["p"] * root, "gradU": arrays["gradU"] * root}
        data["mass"] = (1.1 * arrays["mass"]).astype(np.float32)
    found = bs.shadow_energy(data, order=6)
    assert found.rows[0].deviation == pytest.approx(report.rows[0].deviation, rel=1e-3)
    assert found.rows[-1].deviation < 1e-6


@pytest.mark.parametrize("role", ["t", "h"])
def test_steps_in_single_precision_are_not_exact(role, arrays):
    run = run_of(427, h=0.3)  # neither 0.3 nor the last time is a number in single precision
    data = columns_of(run.y) | {"mass": arrays["mass"]}
    told = {"t": run.t.astype(np.float32)} if role == "t" else {"h": np.float32(0.3)}
    report, wanted = bs.shadow_energy(data | told, order=6), bs.shadow_energy(run, order=6)
    assert [row.deviation for row in report.rows] == pytest.approx([row.deviation for row in wanted.rows], rel=1e-3)


def test_one_of_two_arrays_that_differ_can_be_chosen(arrays, report):
    both = arrays | {"v": arrays["p"] / arrays["mass"], "F": -arrays["gradU"]}
    same(bs.shadow_energy(both), report)
    wrong = both | {"v": arrays["p"], "F": arrays["gradU"]}
    same(bs.shadow_energy(wrong, columns={"p": "p", "gradU": "gradU"}), report)


def test_an_equilibrium_tells_nothing_of_the_step():
    zeros = np.zeros(500)
    report = bs.shadow_energy({"q": zeros, "p": zeros, "U": zeros - 1, "gradU": zeros}, h=H)
    assert report.largest_step is None
    assert "the energy does not change by more than rounding, which tells nothing of the step" in str(report)
    assert "too large" not in str(report)


def test_the_step_for_a_bound_keeps_it():
    pendulum = bs.scene("pendulum")
    report = bs.shadow_energy(bs.integrate(pendulum, "stormer-verlet", h=0.1, steps=3000))
    for bound in (1e-2, 1e-4, 1e-6):
        step = report.step_for(bound)
        longer = bs.shadow_energy(bs.integrate(pendulum, "stormer-verlet", h=step, steps=3000))
        assert longer.rows[0].deviation == pytest.approx(bound, rel=0.1)
    assert 1 < report.largest_step < 2  # steps of 2 are unstable


def test_bounds_of_any_size(report):
    assert report.step_for(1e9) == report.step_for(1e300) == report.largest_step
    assert report.step_for(np.float32(1e-4)) == pytest.approx(report.step_for(Fraction(1, 10**4)), rel=1e-6)
    assert bs.shadow_energy(run_of(200), order=4).step_for(1e300) > 1e150  # one gap alone sets no largest step
    for bound in (True, 10**400, float("nan"), float("inf"), "1"):
        with pytest.raises(bs.SeriesError, match="bound must be a finite number, but was "):
            report.step_for(bound)
    with pytest.raises(bs.SeriesError, match="bound must be a positive energy, but was -1"):
        report.step_for(-1)


def test_backwards_in_time(report):
    found = bs.shadow_energy(run_of(600, h=-H))
    assert found.noise_floor < 1e-14
    assert found.largest_step == pytest.approx(-report.largest_step, rel=0.2)
    assert -H < found.step_for(1e-4) < 0


def test_an_energy_that_does_not_change_asks_for_no_step():
    report = bs.shadow_energy(free(1.0))
    assert report.rows[-1].mean == 0.5
    assert not report.has_drift
    assert str(report)
    with pytest.raises(bs.SeriesError, match="bound must be on an energy whose changes a higher order explains"):
        report.step_for(1.0)


def test_kernels_compiled_and_not_are_the_same(arrays):
    formulas = [shadow_formula(order) for order in (2, 8, 10)]
    q, p, g = (np.ascontiguousarray(arrays[name][:30].T) for name in ("q", "p", "gradU"))
    tables = formula_arrays(formulas)
    known = H, p, g, arrays["U"][:30], *tables, *(np.empty((table.shape[1], 30)) for table in tables[1:])
    found, residuals = [], []
    for kernel in (kernels.shadow_values, kernels.step_residuals):
        for function in (kernel.compiled, kernel.py_func):
            if kernel is kernels.shadow_values:
                found.append(np.empty((3, 26)))
                function(*known, found[-1])
            else:
                residuals.append([np.empty(29), np.empty(29)])
                assert function(H, q, p, g, *residuals[-1]) == (abs(q).max(), abs(p).max(), abs(g).max())
    assert np.allclose(*found, rtol=1e-14)
    assert np.allclose(*residuals, atol=1e-14)


def test_large_arrays_that_are_packed_go_through_the_disk(arrays, report, tmp_path, monkeypatch):
    monkeypatch.setattr(stored_arrays, "LARGE", 1000)
    np.savez_compressed(tmp_path / "run.npz", **arrays)
    found = files.open_source(tmp_path / "run.npz")
    assert isinstance(next(found.blocks(10))["q"].base, np.ndarray)
    same(bs.shadow_energy(tmp_path / "run.npz"), report)


def test_a_drift_that_the_energy_hides_is_found(arrays):
    """A potential that changes slowly in what is told: the energy goes up and down a thousand times as much."""
    drifting = arrays | {"U": arrays["U"] + 1e-7 * arrays["t"]}
    report = bs.shadow_energy(drifting)
    energy = report.rows[0]
    assert report.has_drift
    assert report.best.drift == pytest.approx(1e-7, rel=1e-4)
    assert energy.drift_error > 1e-6  # ten times the drift
    assert not bs.shadow_energy(arrays).has_drift


def test_too_large_a_step_is_called_so():
    report = bs.shadow_energy(bs.integrate(bs.scene("pendulum"), "stormer-verlet", h=1.4, steps=2000))
    assert report.h > 0.5 * report.largest_step
    assert "h = 1.4 is large" in str(report)


def test_statistics_in_one_pass_are_those_of_all_values():
    rng = np.random.default_rng(7)
    values = rng.normal(size=(2, 3 * BLOCKS + 77)) + 1e-3 * np.arange(3 * BLOCKS + 77)
    statistics = Statistics((2, 4))
    for piece in np.array_split(values, 13, axis=1):
        statistics.add(np.ascontiguousarray(piece))
    n = np.arange(values.shape[1])
    for row, v in zip(statistics.results(0.5), values, strict=True):
        slope, at_zero = np.polyfit(n, v, 1)
        assert row.mean == pytest.approx(v.mean(), rel=1e-12)
        assert row.drift == pytest.approx(slope / 0.5, rel=1e-9)
        assert row.scatter == pytest.approx(np.std(v - at_zero - slope * n) * np.sqrt(len(n) / (len(n) - 2)), rel=1e-6)
        assert row.deviation == pytest.approx(np.ptp(v) / 2)
    assert statistics.results(0.5)[1].gap == pytest.approx(np.ptp(values[1] - values[0]) / 2)
    assert statistics.size == 4
    assert statistics.blocks()[0, 5, 0] == pytest.approx(values[0, 20:24].mean() - values[0, 0])


@pytest.mark.parametrize(
    ("kind", "least", "most"), [("white", 0.85, 1.1), ("correlated", 0.8, 1.6), ("walk", 0.5, 3.0)]
)
def test_errors_of_slopes_are_those_that_slopes_have(kind, least, most):
    rng = np.random.default_rng(3)
    parts = []
    for _ in range(200):
        noise = rng.normal(size=1024)
        if kind == "walk":
            noise = np.cumsum(noise)
        if kind == "correlated":
            noise = np.convolve(noise, 0.9 ** np.arange(100))[: len(noise)]
        parts.append(np.polyfit(np.arange(1024), noise, 1)[0] / slope_error(noise))
    assert least < np.sqrt(np.mean(np.square(parts))) < most


def broken(arrays, **changes):
    return {name: x for name, x in (arrays | changes).items() if x is not None}


def taken(arrays, rows):
    """Some of the states."""
    return {name: x if name == "mass" else x[rows] for name, x in arrays.items()}


def with_gap(arrays):
    return taken(arrays, np.delete(np.arange(601), 77))


def thermostat(arrays):
    """Momenta that lose a little after step 300."""
    before = np.hstack((arrays["p"], arrays["q"]))[:301].T
    slowed = before[:, -1] * [0.9999, 0.9999, 1, 1]
    after = run_of(99, y0=slowed).y
    return {"t": arrays["t"][:400], "mass": arrays["mass"]} | columns_of(np.hstack((before[:, :-1], after)))


def with_nan(arrays, role="q"):
    values = arrays[role].copy()
    values[5] = np.nan
    return broken(arrays, **{role: values})


def with_inf(arrays, role, k):
    values = arrays[role].copy()
    values[k] = np.inf
    return broken(arrays, **{role: values})


def free(momentum):
    """A particle without forces, in steps of size 1."""
    n = np.arange(50.0)
    return {"t": n, "q": momentum * n, "p": np.full(50, momentum), "U": 0 * n, "F": 0 * n}


REFUSED = [
    (
        "every second",
        lambda a: taken(a, slice(None, None, 2)) | {"h": H},
        {},
        "must have every step, one after the other, but its states are 2 steps of size 0.1",
    ),
    (
        "every second, no times",
        lambda a: broken(taken(a, slice(None, None, 2)), t=None),
        {"h": H},
        "as far as h says, as if only one in 2 states was kept",
    ),
    (
        "every 30th, no h",
        lambda a: taken(a, slice(None, None, 30)),
        {},
        "there is no such step: states were left out, or the scene, the method, h or masses are others",
    ),
    (
        "a gap, no h",
        with_gap,
        {},
        r"t must advance by one step, 0\.100167, each time, but from state 1 to 2 it advanced by 0\.1$",
    ),
    (
        "a gap",
        with_gap,
        {"h": H},
        r"must have every step, one after the other, but its states are 2 steps of size 0\.1 apart$",
    ),
    (
        "a gap, no times",
        lambda a: broken(with_gap(a), t=None),
        {"h": H},
        "from state 77 to 78 there is no such step: states were left out",
    ),
    ("wrong h", lambda a: broken(a, t=None), {"h": 0.12}, "positions move 0.83.* times as far as h says"),
    ("wrong masses", lambda a: a, {"mass": 1}, "coordinate 2 moves 0.333333 times as far as its mass says"),
    ("all masses wrong", lambda a: broken(a, mass=2 * a["mass"]), {}, "positions move 2 times as far as masses say"),
    (
        "sign of forces",
        lambda a: broken(a, gradU=None, F=a["gradU"]),
        {},
        "momenta change by -1 times what the forces say: units, sign or masses are others",
    ),
    (
        "units of forces",
        lambda a: broken(a, gradU=4 * a["gradU"]),
        {},
        r"momenta change by 0\.25 times what the forces say: units, sign or masses are others",
    ),
    ("thermostat", thermostat, {}, "from state 300 to 301 momenta change by more than the forces: a thermostat"),
    ("units", lambda a: broken(a, U=a["U"] * 4.184), {}, r"the potential of its forces, but it changes by 4.18. times"),
    ("constant", lambda a: broken(a, U=0 * a["U"]), {}, "the potential of its forces, but it changes by 0 times"),
    ("nan", with_nan, {}, "must have finite positions, but those of state 6 are not"),
    ("nan time", lambda a: with_nan(a, "t"), {}, "must have finite times, but those of state 6 are not"),
    ("nan time, h", lambda a: with_nan(a, "t"), {"h": H}, "must have finite times, but those of state 6 are not"),
    ("inf time", lambda a: with_inf(a, "t", 300), {}, "must have finite times, but those of state 301 are not"),
    (
        "inf at last",
        lambda a: with_inf(a, "t", 600),
        {"h": H},
        "must have finite times, but those of state 601 are not",
    ),
    ("inf, box", lambda a: with_inf(a, "q", 9), {"period": 9}, "must have finite positions, but those of state 10 "),
    ("inf force", lambda a: with_inf(a, "gradU", 9), {}, "must have finite forces, but those of state 10 are not"),
    ("F, gradU", lambda a: broken(a, F=a["gradU"]), {}, "must have gradU = -F, but its gradU and F differ"),
    ("p, v", lambda a: broken(a, v=a["p"]), {}, r"must have p = M v, but its p and v differ \(columns chooses one\)"),
    ("tolerance", lambda a: a, {"tolerance": -1}, "tolerance must be 0 or more, but was -1"),
    ("progress", lambda a: a, {"progress": 5}, "progress must be a function of two numbers, but was 5"),
    ("overflow", lambda a: free(1e200), {}, "must have finite shadow energies, but those of state 5 are not"),
    (
        "no potential",
        lambda a: broken(a, U=None),
        {},
        r"must have the potential \(U\), but has .*; a scene would supply it",
    ),
    ("no momenta", lambda a: broken(a, p=None), {}, r"must have momenta \(p\) or velocities \(v\)"),
    ("no step", lambda a: broken(a, t=None), {}, "h must be given where there are no times"),
    ("short", lambda a: taken(a, slice(12)), {}, "must have at least 18 states, but has 12"),
    (
        "short for the order",
        lambda a: taken(a, slice(20)),
        {"order": 24},
        "order must be at most 10 for 20 states, but was 24",
    ),
    (
        "lengths",
        lambda a: broken(a, p=a["p"][1:]),
        {},
        r"p must have 601 states along its first axis, but has the shape \(600, 2\)",
    ),
    (
        "turned round",
        lambda a: {"q": np.zeros((2, 100)), "p": np.zeros((2, 100))},
        {"scene": bs.scene("henon-heiles"), "h": 0.1},
        r"q must have the shape \(states, 2\), as the scene has 2 positions, but has 100 numbers for each state",
    ),
    ("widths", lambda a: broken(a, p=a["p"][:, :1]), {}, "p must have as many coordinates as q, 2, but has 1"),
    (
        "masses",
        lambda a: a,
        {"mass": [1, 2, 3]},
        "mass must be one number, or one for each particle or coordinate, but there were 3 for 2",
    ),
    ("negative mass", lambda a: a, {"mass": -1}, "mass must be positive, but one was -1"),
    (
        "layout",
        lambda a: a,
        {"layout": "leap"},
        "layout must be one of full, half-behind, half-ahead, drift-kick-drift, but was 'leap'",
    ),
    (
        "layout without scene",
        lambda a: a,
        {"layout": "drift-kick-drift"},
        "scene must be given for the layout drift-kick-drift",
    ),
    ("order", lambda a: a, {"order": 5}, "order must be an even number from 2 to 24, but was 5"),
    ("period", lambda a: a, {"period": 0}, "period must be a positive number"),
    ("tolerance", lambda a: a, {"tolerance": "x"}, "tolerance must be a finite number, but was 'x'"),
    (
        "columns",
        lambda a: a,
        {"columns": {"w": "x"}},
        "columns must be for t, q, p, v, U, F, gradU, mass, h, but one was for 'w'",
    ),
    (
        "fits nothing",
        lambda a: a,
        {"columns": {"q": "x*"}},
        r"columns must fit names in trajectory, but 'x\*' fits none of t, q, p",
    ),
    ("kind", lambda a: broken(a, q=a["q"].astype(str)), {}, "q must be an array of real numbers"),
    ("zero h", lambda a: broken(a, t=None), {"h": 0}, "h must be a finite number other than 0, but was 0"),
    ("huge h", lambda a: broken(a, t=None), {"h": 10**400}, "h must be a finite number, but was 1000"),
    ("nan h", lambda a: broken(a, t=None, h=np.array([np.nan])), {}, r"h must be one finite number, but was \[nan\]"),
    ("inf h", lambda a: broken(a, t=None, h=np.inf), {}, "h must be a finite number other than 0, but was inf"),
    ("no h", lambda a: broken(a, t=None, h=np.array([])), {}, r"h must be one finite number, but was \[\]"),
    ("two h", lambda a: a | {"h": np.array([H, 2 * H])}, {}, r"h must be one finite number, but was \[0\.1 0\.2\]"),
    (
        "nothing",
        lambda a: taken(a, slice(0)),
        {},
        r"t must have numbers for at least one state, but has the shape \(0,\)",
    ),
    ("huge mass", lambda a: a, {"mass": 10**400}, "mass must be numbers, but was 1000"),
    ("huge period", lambda a: a, {"period": 10**400}, "period must be numbers, but was 1000"),
    ("no trajectory", lambda a: 5, {}, "trajectory must be a Trajectory, arrays by name, or a path, but was 5"),
]


@pytest.mark.parametrize(
    ("make", "options", "reason"), [case[1:] for case in REFUSED], ids=[case[0] for case in REFUSED]
)
def test_what_is_no_run_of_the_method_is_refused_with_the_reason(make, options, reason, arrays):
    with pytest.raises(bs.SeriesError, match=reason) as caught:
        bs.shadow_energy(make(arrays), **options)
    assert "\n" not in str(caught.value)


def test_a_trajectory_has_names_of_its_own(run):
    with pytest.raises(bs.SeriesError, match="columns must be left out for a Trajectory, which has names of its own"):
        bs.shadow_energy(run, columns={"q": "q*"})


def test_a_step_told_at_each_step_is_one(arrays, report):
    same(bs.shadow_energy(broken(arrays, t=None, h=np.full(601, H))), report)


def test_own_runs_of_other_kinds_are_refused(tmp_path):
    with pytest.raises(bs.SeriesError, match="must have every step, one after the other, but its states are every 5th"):
        bs.shadow_energy(run_of(100, save_every=5))
    with pytest.raises(bs.SeriesError, match="but its states are its start and end"):
        bs.shadow_energy(run_of(100, save_every=None))
    with pytest.raises(bs.SeriesError, match="trajectory, made by rk4, must have consecutive steps of Störmer–Verlet"):
        bs.shadow_energy(run_of(100, method="rk4"))
    with pytest.raises(bs.SeriesError, match=r"scene must have the Hamiltonian .* double-pendulum is another"):
        bs.shadow_energy(run_of(100), bs.scene("double-pendulum"))
    with pytest.raises(
        bs.SeriesError, match="scene must have a Hamiltonian of momenta and positions, but lorenz has none"
    ):
        bs.shadow_energy(run_of(100), bs.scene("lorenz"))
    for name in ("none.npz", "none.csv"):
        with pytest.raises(bs.SeriesError, match=f"{name} must be a trajectory file, but there is none"):
            bs.shadow_energy(tmp_path / name)
    (tmp_path / "bad.npz").write_bytes(b"PK no archive")
    with pytest.raises(bs.IntegratorError, match=r"bad\.npz must be a trajectory file, but was not"):
        bs.shadow_energy(tmp_path / "bad.npz")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: text.partition("\n")[2], "must begin with the names of its columns, but began with '0,"),
        (lambda text: text.replace("q2", "q1", 1), "must have different names, but has 'q1' twice"),
        (lambda text: text.replace("p2", "w2", 1), "must have a column p2 beside q2, but has none"),
        (lambda text: text[:4000] + "x" + text[4000:], r"must have numbers in state \d+, but one was '.*x"),
        (lambda text: text[:-30] + "\n", "must have 8 numbers for state 601, but has 7"),
        (lambda text: text.replace(",1.", ",1_0.", 1), r"must have numbers in state \d+, but one was '1_0\."),
        (lambda text: text.replace(",1.", ",\u0661.", 1), r"must have numbers in state \d+, but one was '\u0661\."),
        (lambda text: "", "must begin with the names of its columns, but began with ''"),
    ],
)
def test_broken_text_is_refused_with_the_reason(change, reason, arrays, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(change(table(arrays)))
    with pytest.raises(bs.SeriesError, match=reason):
        bs.shadow_energy(path, mass=[2, 3])


def test_lines_without_end_are_not_read(monkeypatch):
    monkeypatch.setattr(text_files, "MAX_BYTES", 1000)
    with pytest.raises(bs.IntegratorError, match="standard input must have lines of at most 1000 bytes, but one has"):
        bs.shadow_energy(io.StringIO("t,q,p\n" + "1" * 10**6))


@pytest.mark.parametrize(
    "meta", ['{"scene": {"variables": null}}', '{"scene": {"variables": {"q": 1}, "effects": [1]}}', '{"scene": null}']
)
def test_damaged_metadata_is_refused(meta, tmp_path):
    arrays = {"t": np.arange(5.0), "y": np.ones((2, 5)), "h": 1.0, "variables": ["p", "q"], "meta": meta}
    np.savez(tmp_path / "run.npz", **arrays)
    with pytest.raises(bs.errors):
        bs.shadow_energy(tmp_path / "run.npz")


def test_arrays_of_other_programs_are_checked_first(arrays, tmp_path):
    np.savez(tmp_path / "run.npz", **arrays, notes=np.array([{}]))
    bs.shadow_energy(tmp_path / "run.npz")  # what is not needed is not looked at
    data = bytearray((tmp_path / "run.npz").read_bytes())
    data[data.find(b"PK\1\2") + 6] = 255
    (tmp_path / "new.npz").write_bytes(data)
    with pytest.raises(bs.IntegratorError, match=r"new\.npz must be a trajectory file, but was not: zip file version"):
        bs.shadow_energy(tmp_path / "new.npz")
    np.savez(tmp_path / "run.npz", **{**arrays, "q": np.array([{}])})
    with pytest.raises(
        bs.IntegratorError, match=r"run\.npz must be an NPZ file, but was not: q must be an array of num"
    ):
        bs.shadow_energy(tmp_path / "run.npz")


def test_binary_files_are_no_text(tmp_path):
    path = tmp_path / "run.dat"
    path.write_bytes(b"\xff\xfe\x80" * 100)
    with pytest.raises(bs.SeriesError, match="must be text or an NPZ file, but was neither"):
        bs.shadow_energy(path)


@pytest.mark.parametrize("is_stream", [False, True])
@pytest.mark.parametrize(("encoding", "name"), [("latin-1", "Latin-1"), ("utf-16", "UTF-16")])
def test_other_encodings_are_named(encoding, name, is_stream, arrays, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(table(arrays, start="# énergie,\n"), encoding=encoding)
    with (
        open(path, "rb") as file,
        pytest.raises(bs.SeriesError, match=f"must be text in UTF-8, but seems to be in {name}$"),
    ):
        bs.shadow_energy(file if is_stream else path)


def test_folders_are_no_files(tmp_path):
    with pytest.raises(bs.SeriesError, match=r"must be a trajectory file, but was a folder$"):
        bs.shadow_energy(tmp_path)


def test_report_as_text_and_data(report):
    data = json.loads(json.dumps(report.to_dict()))
    assert data["kind"] == "shadow"
    assert data["rows"][1]["gap"] == report.rows[1].gap
    assert data["limit"] == "rounding"
    text = str(report)
    assert text.splitlines()[0] == "trajectory: 601 states, h = 0.1, t = 0 to 60"
    assert "Best order: " in text
    assert repr(report) == "<ShadowReport of trajectory: orders 2 to 16, 601 states, h = 0.1>"


def test_a_picture_is_the_same_each_time(report, tmp_path):
    pytest.importorskip("matplotlib")
    paths = [tmp_path / "one.svg", tmp_path / "other.SVG"]
    for path in paths:
        report.save_plot(path)
    assert paths[0].read_bytes().startswith(b"<?xml")
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_formats_of_pictures():
    pytest.importorskip("matplotlib")
    assert [check_picture(f"run.{ending}") for ending in ("png", "svg", "PDF")] == ["png", "svg", "pdf"]


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("run.gif", r"the ending of the plot 'run\.gif' must be one of png, svg, pdf, but was 'gif'"),
        ("nowhere/run.png", "plot must be a file in a folder that is there, but was 'nowhere/run.png'"),
        (5, "plot must be a path, but was 5"),
    ],
)
def test_other_pictures_are_refused(path, reason, report, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(bs.errors, match=reason):
        report.save_plot(path)
    assert not list(tmp_path.iterdir())


def test_pictures_need_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(bs.IntegratorError, match="matplotlib must be installed for pictures"):
        check_picture("run.png")
