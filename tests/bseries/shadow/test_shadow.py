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
from bseries.picture_files import check_picture
from bseries.shadow import trajectory_energies
from bseries.shadow.formulas import shadow_formula
from bseries.shadow.report import BLOCKS, Statistics
from bseries.shadow.slope_noise import slope_noise
from bseries.shadow.trajectory_energies import formula_arrays
from integrators.core import text_files

H = 0.1


@pytest.fixture(scope="module")
def run():
    """A run whose coordinates are not those of one particle only, with masses."""
    return bs.integrate("stormer-verlet", problem(), h=H, steps=600)


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
    return bs.integrate(options.pop("method", "stormer-verlet"), problem(), h=h, steps=steps, **options)


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
        names = {"t": "time", "q": "x", "p": "momenta", "U": "PotEng", "F": "forces", "mass": "masses"}
        return same(bs.shadow_energy(data, columns=names), report)
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


def test_columns_can_be_chosen_by_place(arrays, report, tmp_path):
    rows = np.column_stack([arrays[name] for name in ("t", "p", "q", "U", "gradU")])
    places = {"t": 0, "p": "1:3", "q": "3:5", "U": "5", "gradU": [6, 7]}
    np.savetxt(tmp_path / "run.dat", rows, fmt="%.17g")
    np.save(tmp_path / "run.npy", rows)
    for data in (tmp_path / "run.dat", tmp_path / "run.npy", rows):
        with pytest.raises(bs.SeriesError, match=r"must begin with the names|must have positions"):
            bs.shadow_energy(data, mass=[2, 3])
        same(bs.shadow_energy(data, mass=[2, 3], columns=places), report)
    with pytest.raises(bs.SeriesError, match=r"columns must fit names in .*, but 8 fits none of 0, 1, 2"):
        bs.shadow_energy(rows, columns={"t": 8})
    with pytest.raises(bs.SeriesError, match=r"columns must be a dict, as in .*, but was 'q=x'"):
        bs.shadow_energy(rows, columns="q=x")


def test_tables_with_names_need_no_choice(arrays, report, tmp_path):
    text = table(arrays)
    (tmp_path / "run.csv").write_text(text)
    structured = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    np.save(tmp_path / "run.npy", structured)
    for data in (structured, tmp_path / "run.npy"):
        same(bs.shadow_energy(data, mass=[2, 3]), report)


def test_frames(arrays, report, tmp_path):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(np.genfromtxt(io.StringIO(table(arrays)), delimiter=",", names=True))
    same(bs.shadow_energy(frame.assign(step=range(len(frame))), mass=[2, 3]), report)
    same(bs.shadow_energy(frame.set_index("t"), mass=[2, 3]), report)
    xarray = pytest.importorskip("xarray")
    names = {"t": ("t",), "U": ("t",), "q": ("t", "k"), "p": ("t", "k"), "gradU": ("t", "k")}
    data = {name: (names[name], arrays[name]) for name in names if name != "t"}
    same(bs.shadow_energy(xarray.Dataset(data, {"t": arrays["t"]}), mass=[2, 3]), report)


def test_names_of_a_scene_leave_the_step_to_be_found():
    pendulum = bs.scene("pendulum")
    run = bs.integrate("stormer-verlet", pendulum, h=H, steps=200)
    p, q = run.y
    report = bs.shadow_energy(run)
    same(bs.shadow_energy({"p": p, "q": q, "h": np.array(H)}, pendulum), report)
    renamed = bs.Scene({"v": 1, "x": 1}, hamiltonian="v^2/2 - cos(x)")
    same(bs.shadow_energy({"v": p, "x": q, "U": q, "h": np.array(H)}, renamed), report)


def test_columns_without_numbers_do_not_matter(arrays, report):
    lines = table(arrays).splitlines()
    text = "\n".join([f"atom,{lines[0]}", *(f"Ar,{line}" for line in lines[1:])])
    same(bs.shadow_energy(io.StringIO(text), mass=[2, 3]), report)


def test_columns_can_be_called_anything(arrays, report, tmp_path):
    path = tmp_path / "md.csv"
    text = table(arrays).replace("gradU", "slope_").replace("q", "pos.").replace("U", "Epot")
    path.write_text(text)
    found = bs.shadow_energy(path, mass=[2, 3], columns={"q": "pos.*", "gradU": "slope_*", "U": "Epot"})
    same(found, report)


def test_x_y_vx_vy_are_chosen_by_their_names(arrays, tmp_path):
    names = ["t", "PotEng", "x1", "y1", "vy1", "vx1", "fx1", "fy1", "temp"]
    columns = {"U": "PotEng", "q": "[xy]1", "v": "vx1,vy1", "F": "f*"}
    v, f = arrays["p"] / arrays["mass"], -arrays["gradU"]
    rows = np.column_stack((arrays["t"], arrays["U"], arrays["q"], v[:, ::-1], f, arrays["U"]))
    path = tmp_path / "md.txt"
    np.savetxt(path, rows, header="\t".join(names), delimiter="\t", fmt="%.17g")
    assert bs.shadow_energy(path, mass=[2, 3], columns=columns).limit == "rounding"
    with pytest.raises(bs.SeriesError, match=r"have positions \(q\), but has .*; columns can name it, as in q=NAME"):
        bs.shadow_energy(path, mass=[2, 3])


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
    report = bs.shadow_energy(bs.integrate("stormer-verlet", coupled, h=0.05, steps=400))
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
    run = bs.integrate("stormer-verlet", pendulum, h=0.05, steps=1000)
    p, q = run.y
    data = {"t": run.t, "p": p, "q": np.mod(q, 2 * np.pi), "U": -np.cos(q), "gradU": np.sin(q)}
    with pytest.raises(bs.SeriesError, match=r"positions jump by 6\.28319, as if wrapped into a box \(period"):
        bs.shadow_energy(data)
    for scene in (None, pendulum):
        assert bs.shadow_energy(data, scene, period=2 * np.pi).noise_floor < 1e-13


def test_few_digits_are_enough_for_low_orders(arrays, tmp_path):
    single = {name: x.astype(np.float32) if name in "qp" else x for name, x in arrays.items()}
    with pytest.raises(bs.SeriesError, match="; if it is rounding, tolerance must be "):
        bs.shadow_energy(single)
    report = bs.shadow_energy(single, tolerance=2e-6)
    assert 1e-9 < report.noise_floor < 1e-6
    path = tmp_path / "short.csv"
    path.write_text(table(arrays, digits=7))
    report = bs.shadow_energy(path, mass=[2, 3], tolerance=1e-6)
    assert 1e-9 < report.noise_floor < 1e-5


WRITTEN = {"mass": [2, 3], "columns": {"t": "t", "q": "x,y", "v": "vx,vy", "F": "fx,fy", "U": "PotEng"}}


def written_as(arrays, formats):
    """A table of a step, times, positions, velocities, forces and potentials, each in a format."""
    v = arrays["p"] / arrays["mass"]
    columns = np.column_stack((arrays["t"], arrays["q"], v, -arrays["gradU"], arrays["U"]))
    kinds = [formats.get(role, formats["other"]) for role in ("t", "q", "q", "v", "v", "F", "F", "U")]
    lines = (",".join([str(k), *map(str.__mod__, kinds, row)]) for k, row in enumerate(columns.tolist()))
    return io.StringIO("\n".join(["step,t,x,y,vx,vy,fx,fy,PotEng", *lines]))


FORMATS = {
    "fixed": ({"other": "%.8f"}, 1e-7),
    "short": ({"other": "%g"}, 1e-4),
    "long": ({"other": "%.9g"}, 1e-6),
    "scientific": ({"other": "%.8e"}, 1e-6),
    "thermo": ({"t": "%g", "U": "%.10g", "other": "%.8f"}, 1e-6),
}


@pytest.mark.parametrize("name", FORMATS)
def test_rounded_text_needs_the_tolerance_that_the_refusal_names(name, arrays):
    formats, noise = FORMATS[name]
    with pytest.raises(bs.SeriesError, match="; if it is rounding, tolerance must be ") as caught:
        bs.shadow_energy(written_as(arrays, formats), **WRITTEN)
    tolerance = float(str(caught.value).split()[-1])
    report = bs.shadow_energy(written_as(arrays, formats), **WRITTEN, order=8, tolerance=tolerance)
    assert report.rows[-1].deviation < noise
    assert report.rows[-1].mean == pytest.approx(0.75, abs=0.2)
    assert bs.shadow_energy(written_as(arrays, {"other": "%r"}), **WRITTEN, order=8).rows[-1].deviation < 1e-9


def test_rounded_times_need_a_tolerance_too(arrays):
    late = arrays | {"t": 10_000 + arrays["t"]}
    text = written_as(late, {"t": "%.5g", "other": "%r"})
    with pytest.raises(bs.SeriesError, match="t must advance by one step") as caught:
        bs.shadow_energy(text, **WRITTEN, h=H)
    tolerance = float(str(caught.value).split()[-1])
    text.seek(0)
    assert bs.shadow_energy(text, **WRITTEN, h=H, tolerance=tolerance).rows[4].deviation < 1e-7


@pytest.mark.parametrize("name", FORMATS)
def test_rounded_text_that_is_no_such_run_is_refused_all_the_same(name, arrays):
    formats, _ = FORMATS[name]
    thin = {x: y if x in ("t", "mass") else y[::2] for x, y in arrays.items()}
    with pytest.raises(bs.SeriesError, match="as if only one in 2 states was kept"):
        bs.shadow_energy(written_as(thin | {"t": arrays["t"][:301]}, formats), **WRITTEN, tolerance=1e-4)
    p, q = np.split(run_of(600, method="rk4", h=0.3).y, 2)
    other = {"t": 0.3 * np.arange(601), "mass": arrays["mass"]} | columns_of(np.vstack((p, q)))
    with pytest.raises(bs.SeriesError, match="must have consecutive steps of Störmer–Verlet"):
        bs.shadow_energy(written_as(other, formats), **WRITTEN, tolerance=1e-4)


@pytest.mark.parametrize("role", ["q", "p", "U", "gradU", "mass"])
def test_any_array_in_single_precision_will_do(role, arrays, report):
    data = arrays | {role: arrays[role].astype(np.float32)}
    if role == "mass":  # 2.2 is no number in single precision
        root = np.sqrt(1.1)
        data |= {"q": arrays["q"] / root, "p": arrays["p"] * root, "gradU": arrays["gradU"] * root}
        data["mass"] = (1.1 * arrays["mass"]).astype(np.float32)
    found = bs.shadow_energy(data, order=6, tolerance=2e-6)
    assert found.rows[0].deviation == pytest.approx(report.rows[0].deviation, rel=1e-3)
    assert found.rows[-1].deviation < 1e-6


@pytest.mark.parametrize("role", ["t", "h"])
def test_steps_in_single_precision_are_not_exact(role, arrays):
    run = run_of(427, h=0.3)  # neither 0.3 nor the last time is a number in single precision
    data = columns_of(run.y) | {"mass": arrays["mass"]}
    told = {"t": run.t.astype(np.float32)} if role == "t" else {"h": np.float32(0.3)}
    report = bs.shadow_energy(data | told, order=6, tolerance=2e-6)
    wanted = bs.shadow_energy(run, order=6)
    assert [row.deviation for row in report.rows] == pytest.approx([row.deviation for row in wanted.rows], rel=1e-3)


def test_one_of_two_arrays_that_differ_can_be_chosen(arrays, report):
    both = arrays | {"v": arrays["p"] / arrays["mass"], "F": -arrays["gradU"]}
    same(bs.shadow_energy(both), report)
    wrong = both | {"p": 2 * arrays["p"], "gradU": -arrays["gradU"]}
    same(bs.shadow_energy(wrong, columns={"v": "v", "F": "F"}), report)
    with pytest.raises(bs.SeriesError, match="must have consecutive steps of Störmer–Verlet"):
        bs.shadow_energy(wrong)


def test_an_equilibrium_tells_nothing_of_the_step():
    zeros = np.zeros(500)
    report = bs.shadow_energy({"q": zeros, "p": zeros, "U": zeros - 1, "gradU": zeros}, h=H)
    assert report.largest_step is None
    assert "the energy changes by no more than rounding, so the step cannot be judged" in str(report)
    assert "too large" not in str(report)


def test_the_step_for_a_bound_keeps_it():
    pendulum = bs.scene("pendulum")
    report = bs.shadow_energy(bs.integrate("stormer-verlet", pendulum, h=0.1, steps=3000))
    for bound in (1e-2, 1e-4, 1e-6):
        step = report.step_for(bound)
        longer = bs.shadow_energy(bs.integrate("stormer-verlet", pendulum, h=step, steps=3000))
        assert longer.rows[0].deviation == pytest.approx(bound, rel=0.1)
    assert 1 < report.largest_step < 2  # steps of 2 are unstable


def test_bounds_of_any_size(report):
    assert report.step_for(1e9) == report.step_for(1e300) == report.largest_step
    assert report.step_for(np.float32(1e-4)) == pytest.approx(report.step_for(Fraction(1, 10**4)), rel=1e-6)
    assert bs.shadow_energy(run_of(200), order=4).step_for(1e300) > 1e150  # one gap alone sets no largest step
    for bound in (True, 10**400, float("nan"), float("inf"), "x"):
        with pytest.raises(bs.IntegratorError, match=r"bound must be a (finite )?number, but "):
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
    p, g = (np.ascontiguousarray(arrays[name][:30].T) for name in ("p", "gradU"))
    tables = formula_arrays(formulas)
    known = H, p, g, arrays["U"][:30], *tables, *(np.empty((table.shape[1], 30)) for table in tables[1:])
    found = [np.empty((3, 26)) for _ in range(2)]
    kernel = trajectory_energies.shadow_values
    for function, out in zip((kernel.compiled, kernel.py_func), found, strict=True):
        function(*known, out)
    assert np.allclose(*found, rtol=1e-14)


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
    report = bs.shadow_energy(bs.integrate("stormer-verlet", bs.scene("pendulum"), h=1.4, steps=2000))
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
        parts.append(np.polyfit(np.arange(1024), noise, 1)[0] / slope_noise(noise).error)
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
        "must contain every step, but its states are 2 steps of size 0.1",
    ),
    (
        "every second, no times",
        lambda a: broken(taken(a, slice(None, None, 2)), t=None),
        {"h": H},
        "as far as h implies, as if only one in 2 states was kept",
    ),
    (
        "every 30th, no h",
        lambda a: taken(a, slice(None, None, 30)),
        {},
        "there is no such step: states are missing, or the scene, the method, h or masses are wrong",
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
        r"must contain every step, but its states are 2 steps of size 0\.1 apart$",
    ),
    (
        "a gap, no times",
        lambda a: broken(with_gap(a), t=None),
        {"h": H},
        "from state 77 to 78 there is no such step: states are missing",
    ),
    ("wrong h", lambda a: broken(a, t=None), {"h": 0.12}, "positions move 0.83.* times as far as h implies"),
    ("wrong masses", lambda a: a, {"mass": 1}, "coordinate 2 moves 0.333333 times as far as its mass implies"),
    ("all masses wrong", lambda a: broken(a, mass=2 * a["mass"]), {}, "coordinate . moves 2 times as far as its mass "),
    (
        "sign of forces",
        lambda a: broken(a, gradU=None, F=a["gradU"]),
        {},
        "momenta change by -1 times the impulse of the forces: units, sign or masses are wrong",
    ),
    (
        "units of forces",
        lambda a: broken(a, gradU=4 * a["gradU"]),
        {},
        r"momenta change by 0\.25 times the impulse of the forces: units, sign or masses are wrong",
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
    ("tolerance", lambda a: a, {"tolerance": -1}, "tolerance must be 0 or more, but was -1"),
    ("progress", lambda a: a, {"progress": 5}, "progress must be a function of two numbers, True or None, but was 5"),
    ("overflow", lambda a: free(1e200), {}, "must have finite shadow energies, but those of state 5 are not"),
    (
        "no potential",
        lambda a: broken(a, U=None),
        {},
        r"must have the potential \(U\), but has .*; columns can name it, as in U=NAME, or a scene supply it",
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
        r"p must have 601 states along one axis, but has the shape \(600, 2\)",
    ),
    (
        "turned round",
        lambda a: {"q": np.zeros((3, 100)), "p": np.zeros((3, 100))},
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
    ("period", lambda a: a, {"period": 0}, "period must be positive, but one was 0"),
    ("tolerance", lambda a: a, {"tolerance": "x"}, "tolerance must be a number, but 'x' has the unknown name"),
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
    with pytest.raises(bs.errors, match=reason) as caught:
        bs.shadow_energy(make(arrays), **options)
    assert "\n" not in str(caught.value)


def test_a_trajectory_has_names_of_its_own(run):
    with pytest.raises(bs.SeriesError, match="columns must be left out for a Trajectory, which has names of its own"):
        bs.shadow_energy(run, columns={"q": "q*"})


def test_a_step_told_at_each_step_is_one(arrays, report):
    same(bs.shadow_energy(broken(arrays, t=None, h=np.full(601, H))), report)


def test_own_runs_of_other_kinds_are_refused(tmp_path):
    with pytest.raises(bs.SeriesError, match="must contain every step, but its states are every 5th"):
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
        with pytest.raises(bs.IntegratorError, match=f"{name} must be a trajectory file, but was not: No such file"):
            bs.shadow_energy(tmp_path / name)
    (tmp_path / "bad.npz").write_bytes(b"PK no archive")
    with pytest.raises(bs.SeriesError, match=r"bad\.npz must be text, an NPY or an NPZ file, but was not"):
        bs.shadow_energy(tmp_path / "bad.npz")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: text.partition("\n")[2], "must begin with the names of its columns, but began with '0,"),
        (lambda text: text.replace("q2", "q1", 1), "must have different names, but has 'q1' twice"),
        (lambda text: text.replace("p2", "w2", 1), "p must have as many coordinates as q, 2, but has 1"),
        (lambda text: text[:4000] + "x" + text[4000:], "numbers in its columns, but could not convert string '.*x"),
        (lambda text: text[:-30] + "\n", "numbers in its columns, but invalid column index 7 at row 601 with 7 col"),
        (lambda text: text.replace(",1.", ",1_0.", 1), r"numbers in its columns, but could not convert string '1_0\."),
        (
            lambda text: text.replace(",1.", ",\u0661.", 1),
            r"in its columns, but could not convert string '\u0661",
        ),
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
        bs.shadow_energy(io.StringIO("t,q,p,U,F\n" + "1" * 10**6))


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
    with pytest.raises(
        bs.SeriesError, match=r"new\.npz must be text, an NPY or an NPZ file, but was not: zip file version"
    ):
        bs.shadow_energy(tmp_path / "new.npz")
    np.savez(tmp_path / "run.npz", **{**arrays, "q": np.array([{}])})
    with pytest.raises(bs.SeriesError, match=r"run\.npz must have an array of real numbers q, but it cannot be read"):
        bs.shadow_energy(tmp_path / "run.npz")


def test_binary_files_are_no_text(tmp_path):
    path = tmp_path / "run.dat"
    path.write_bytes(b"\xff\xfe\x80" * 100)
    with pytest.raises(bs.SeriesError, match="must be text in UTF-8, an NPY or an NPZ file, but was neither"):
        bs.shadow_energy(path)


def test_damaged_headers_are_refused(arrays, tmp_path):
    np.save(tmp_path / "run.npy", arrays["q"])
    data = bytearray((tmp_path / "run.npy").read_bytes())
    data[11] = ord("]")  # within the description of the array
    (tmp_path / "run.npy").write_bytes(data)
    with pytest.raises(bs.SeriesError, match="must be text, an NPY or an NPZ file, but was not"):
        bs.shadow_energy(tmp_path / "run.npy")


def test_folders_are_no_files(tmp_path):
    with pytest.raises(bs.IntegratorError, match=r"must be a trajectory file, but was not: it has no run.json"):
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
    with pytest.raises(ImportError, match="a picture needs matplotlib"):
        check_picture("run.png")


@pytest.mark.parametrize("name", ["pendulum", "henon-heiles"])
def test_arrays_of_a_trajectory_are_read_as_they_are(name):
    run = bs.integrate("stormer-verlet", name, h=0.05, steps=400)
    d = len(run.y) // 2
    p, q = run.y[:d], run.y[d:]
    expected = bs.shadow_energy(run, order=6)
    for arrays in ({"p": p, "q": q}, {"p": p.T, "q": q.T}):
        found = bs.shadow_energy(arrays, bs.scene(name), order=6, h=0.05)
        assert [row.deviation for row in found.rows] == pytest.approx([row.deviation for row in expected.rows])
