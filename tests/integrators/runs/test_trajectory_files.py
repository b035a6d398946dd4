"""Trajectory files: what is written is read back, by NumPy too, at any time, and nothing half-written is seen."""

from __future__ import annotations

import io
import json
import os
import sys
import zipfile

import numpy as np
import pytest

from bseries_base import memory
from integrators import IntegratorError, scene
from integrators.core import stored_arrays
from integrators.runs.integration import integrate
from integrators.runs.trajectory import Trajectory, load_trajectory
from integrators.scenes.text import loads_scene

pytestmark = pytest.mark.minimum

PENDULUM = scene("pendulum")
OPTIONS = {"h": 0.1, "steps": 103, "save_every": 10, "observe": ["energy", {"double energy": "energy"}]}


@pytest.fixture
def run():
    return integrate("rk4", PENDULUM, **OPTIONS)


def check_same(a, b):
    assert (a.h, a.variables, a.meta, list(a.observed)) == (b.h, b.variables, b.meta, list(b.observed))
    observed = [(a.observed[name], b.observed[name]) for name in a.observed]
    for x, z in ((a.t, b.t), (a.y, b.y), (a.observed_t, b.observed_t), *observed):
        assert x.dtype == z.dtype == float
        np.testing.assert_array_equal(x, z)


@pytest.mark.parametrize("observe_every", [None, 7])
@pytest.mark.parametrize("mapped", [True, False])
def test_a_file_is_read_back(tmp_path, monkeypatch, observe_every, mapped):
    run = integrate("rk4", PENDULUM, **OPTIONS, observe_every=observe_every)
    run.save(tmp_path / "run.npz")
    if mapped:
        monkeypatch.setattr(stored_arrays, "LARGE", 0)
    read = load_trajectory(str(tmp_path / "run.npz"))
    check_same(read, run)
    assert (read.observed_t is read.t) == (observe_every is None)
    assert isinstance(read.y, np.memmap) == mapped
    assert read.y.flags.aligned
    assert read.y.flags.f_contiguous


def test_numpy_reads_it(tmp_path, run):
    run.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz", allow_pickle=False) as file:
        assert set(file.files) == {"t", "y", "h", "variables", "meta", "observed/energy", "observed/double energy"}
        np.testing.assert_array_equal(file["y"], run.y)
        assert (float(file["h"]), file["variables"].tolist()) == (0.1, ["p", "q"])
        meta = json.loads(str(file["meta"]))
    assert (meta["steps"], meta["save_every"], meta["compensated"]) == (103, 10, True)
    assert meta["method"]["b"] == ["1/6", "1/3", "1/3", "1/6"]
    assert meta["scene"]["hamiltonian"] == "p^2/2 - cos(q)"


def test_the_scene_can_be_made_again_from_meta(run):
    import tomli_w

    table = run.meta["scene"]
    assert loads_scene(tomli_w.dumps(table)) == PENDULUM
    splitting = integrate("strang", PENDULUM, h=0.1, steps=1)
    assert splitting.meta["method"]["program"][-1].startswith("y1 = ")


def test_streamed_and_saved_files_are_the_same_to_the_byte(tmp_path, run):
    integrate("rk4", PENDULUM, **OPTIONS, to=tmp_path / "streamed.npz")
    run.save(tmp_path / "saved.npz")
    assert (tmp_path / "streamed.npz").read_bytes() == (tmp_path / "saved.npz").read_bytes()


def test_a_run_is_readable_while_it_lasts(tmp_path, run):
    path, seen = tmp_path / "run.npz", []

    def look(done, total):
        seen.append(load_trajectory(path).copy())

    whole = integrate("rk4", PENDULUM, **OPTIONS, to=path, progress=look)
    assert len(seen) > 1
    for part in seen:
        n = len(part.t)
        np.testing.assert_array_equal(part.y, whole.y[:, :n])
        np.testing.assert_array_equal(part.observed["energy"], whole.observed["energy"][:n])
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]


def test_files_of_others_are_read(tmp_path):
    arrays = {"t": np.arange(3.0), "y": np.ones((2, 3)), "h": 1.0, "variables": ["a", "b"]}
    np.savez_compressed(tmp_path / "run.npz", **arrays)
    read = load_trajectory(tmp_path / "run.npz")
    assert repr(read) == "<Trajectory of 2 variables: 3 states from t = 0 to 2>"
    np.testing.assert_array_equal(read.y, arrays["y"])


@pytest.mark.parametrize(
    "change",
    [{"y": np.ones((3, 3))}, {"t": None}, {"meta": np.array("{")}, {"t": np.array([{}, {}, {}])}, {"h": np.array("x")}],
)
def test_what_is_no_trajectory_is_refused(tmp_path, change):
    arrays = {"t": np.arange(3.0), "y": np.ones((2, 3)), "h": 1.0, "variables": ["a", "b"]} | change
    np.savez(tmp_path / "run.npz", **{key: value for key, value in arrays.items() if value is not None})
    with pytest.raises(IntegratorError, match=r"run\.npz must be a trajectory file, but was not: "):
        load_trajectory(tmp_path / "run.npz")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"t": [0.0, 2.0, 1.0]}, "t must be times in order, without repetition, but was not"),
        ({"t": [0.0, 1.0, 1.0]}, "t must be times in order, without repetition, but was not"),
        ({"t": np.array([2, 1, 3], "u1")}, "t must be times in order, without repetition, but was not"),
        ({"t": [0.0, 1.0, np.inf]}, "t must be finite, but was not"),
        ({"observed_t": [0.0, np.nan]}, "observed_t must be finite, but was not"),
        ({"y": np.full((2, 3), np.nan)}, "y must be finite, but was not"),
        ({"variables": ["a", "a"]}, "variables must have different names, but were a, a"),
        ({"h": 0.0}, "h must be finite and not 0, but was 0.0"),
    ],
)
def test_numbers_that_no_run_has_stored_are_refused(tmp_path, change, reason):
    arrays = {"t": np.arange(3.0), "y": np.ones((2, 3)), "h": 1.0, "variables": ["a", "b"]}
    np.savez(tmp_path / "run.npz", **(arrays | change))
    with pytest.raises(IntegratorError, match=rf"run\.npz must be a trajectory file, but was not: {reason}"):
        load_trajectory(tmp_path / "run.npz")


def test_runs_backwards_and_below_the_resolution_of_time_are_read(tmp_path):
    options = [{"h": -0.1}, {"h": 0.1, "control": "1/(1 + p^2)", "t0": 1e18}, {"h": 0.1, "t0": 1e15}]
    for k, option in enumerate(options):
        run = integrate("stormer-verlet", PENDULUM, steps=20, **option, to=tmp_path / f"{k}.npz")
        check_same(load_trajectory(tmp_path / f"{k}.npz"), run)


def test_other_files_are_refused(tmp_path):
    (tmp_path / "text.npz").write_text("no archive")
    with zipfile.ZipFile(tmp_path / "empty.npz", "w"):
        pass
    (tmp_path / "folder").mkdir()
    for name in ("text.npz", "empty.npz", "folder", "missing.npz"):
        with pytest.raises(IntegratorError, match=f"{name} must be a trajectory file, but was not: "):
            load_trajectory(tmp_path / name)


def npy(header: str, content: bytes = b"") -> bytes:
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + content


def described(shape: str, kind: str = "<f8") -> str:
    return f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n"


def text(value: str) -> bytes:
    file = io.BytesIO()
    np.save(file, np.array(value))
    return file.getvalue()


DAMAGE = {
    "10^12 numbers": ("t", npy(described("(1000000000000,)")), "t must have 8000000000000 bytes of numbers, but has 0"),
    "more than memory has addresses": (
        "t",
        npy(described(f"(0, {2**40}, {2**40})")),
        "t must be real numbers in the sh",
    ),
    "negative lengths": ("t", npy(described("(-1, -11)"), bytes(88)), "t must be an array of numbers or text, but was"),
    "deep header": ("t", npy("(" * 9000), "t must be an array of numbers or text, but was"),
    "nested header": ("t", npy("[" * 9000), "t must be an array of numbers or text, but was"),
    "signs in the header": ("t", npy("-" * 9000 + "1"), "t must be an array of numbers or text, but was"),
    "objects": ("t", npy(described("(11,)", "|O")), "t must be an array of numbers or text, but was"),
    "no such kind": ("t", npy(described("(11,)", "<f3")), "t must be an array of numbers or text, but was not: .*<f3"),
    "no letters": ("variables", npy(described("(2,)", "<U1"), b"\xff" * 8), "variables must be text, but has numbers"),
    "null metadata": ("meta", text("null"), "meta must be a table, but was null"),
    "list of metadata": ("meta", text("[]"), r"meta must be a table, but was \[\]"),
    "nested metadata": ("meta", text('{"a":' * 100_000), "meta must hold JSON, not too deeply nested, but did not$"),
    "unfinished metadata": ("meta", text('{"a'), "meta must hold JSON, not too deeply nested, but did not$"),
    "method": ("meta", text('{"method": 3}'), "meta.method must be a table, but was 3"),
    "name": ("meta", text('{"scene": {"name": [1]}}'), r"meta.scene.name must be text, but was \[1\]"),
    "no step": ("h", npy(described("()"), np.array(np.nan).tobytes()), "h must be finite and not 0, but was nan"),
}


@pytest.mark.parametrize("case", DAMAGE)
@pytest.mark.parametrize("kind", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_damaged_arrays_are_refused_before_they_are_read(tmp_path, run, case, kind):
    name, content, reason = DAMAGE[case]
    run.save(tmp_path / "run.npz")
    with zipfile.ZipFile(tmp_path / "run.npz") as old, zipfile.ZipFile(tmp_path / "bad.npz", "w", kind) as new:
        for member in old.namelist():
            new.writestr(member, content if member == f"{name}.npy" else old.read(member))
    with pytest.raises(IntegratorError, match=rf"bad\.npz must be a trajectory file, but was not: .*{reason}"):
        load_trajectory(tmp_path / "bad.npz")


def test_archives_of_other_kinds_are_refused(tmp_path, run):
    run.save(tmp_path / "run.npz")
    data = bytearray((tmp_path / "run.npz").read_bytes())
    for start, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.find(start) + place] |= 1
    (tmp_path / "encrypted.npz").write_bytes(data)
    with zipfile.ZipFile(tmp_path / "run.npz") as old, zipfile.ZipFile(tmp_path / "packed.npz", "w", 14) as new:
        for member in old.namelist():
            new.writestr(member, old.read(member))
    for name in ("encrypted.npz", "packed.npz"):
        with pytest.raises(IntegratorError, match=r"must be stored or deflated, but was encrypted or compressed in"):
            load_trajectory(tmp_path / name)


def test_what_is_compressed_must_fit_into_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "SMALL", 0)
    monkeypatch.setattr(memory, "available_memory", lambda: 10_000)
    arrays = {"t": np.arange(1000.0), "y": np.zeros((2, 1000)), "h": 1.0, "variables": ["a", "b"]}
    np.savez_compressed(tmp_path / "run.npz", **arrays)
    with pytest.raises(IntegratorError, match=r"what is compressed would take 0\.0 GB of memory, but"):
        load_trajectory(tmp_path / "run.npz")
    monkeypatch.setattr(memory, "available_memory", lambda: 40_000)
    np.testing.assert_array_equal(load_trajectory(tmp_path / "run.npz").y, arrays["y"])
    monkeypatch.setattr(stored_arrays, "LARGE", 10_000)
    np.savez_compressed(tmp_path / "text.npz", **arrays, meta="[" + "[]," * 10_000 + "[]]")
    with pytest.raises(IntegratorError, match="meta must be shorter text, but would take"):
        load_trajectory(tmp_path / "text.npz")


def test_pipes_are_not_waited_for(tmp_path):
    if not hasattr(os, "mkfifo"):
        pytest.skip("no pipes with names")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(IntegratorError, match="must be a trajectory file, but was not: it is a pipe or a device"):
        load_trajectory(tmp_path / "pipe")


def test_a_failed_write_leaves_the_old_file(tmp_path, run):
    path = tmp_path / "run.npz"
    path.write_text("old")
    broken = Trajectory(run.t, run.y, h=0.1, variables=["p", "q"], observed={"bad": np.array([object()])})
    with pytest.raises(IntegratorError, match="must be a writable file, but was not"):
        broken.save(path)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]
    with pytest.raises(IntegratorError, match="must be a writable file, but was not: No such file"):
        run.save(tmp_path / "no" / "run.npz")


def test_pandas(run):
    pandas = pytest.importorskip("pandas")
    frame = run.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.columns) == ["p", "q", "energy", "double energy"]
    assert frame.index.name == "t"
    np.testing.assert_array_equal(frame.index, run.t)
    np.testing.assert_array_equal(frame["q"], run.y[1])
    other = integrate("rk4", PENDULUM, **OPTIONS, observe_every=7)
    with pytest.raises(
        IntegratorError, match="observe_every must be save_every for one table, but there are 12 states"
    ):
        other.to_pandas()


@pytest.mark.parametrize(("observe_every", "dimension"), [(None, "time"), (7, "observed_time")])
def test_xarray(observe_every, dimension):
    pytest.importorskip("xarray")
    run = integrate("rk4", PENDULUM, **OPTIONS, observe_every=observe_every)
    data = run.to_xarray()
    assert data["y"].dims == ("variable", "time")
    assert data["energy"].dims == (dimension,)
    np.testing.assert_array_equal(data["y"].sel(variable="q"), run.y[1])
    np.testing.assert_array_equal(data[dimension], run.observed_t)
    assert json.loads(data.attrs["meta"]) == run.meta
    clash = integrate("rk4", PENDULUM, h=0.1, steps=1, observe={"time": "energy"})
    with pytest.raises(IntegratorError, match="observed must have other names than xarray's coordinates, but has time"):
        clash.to_xarray()


@pytest.mark.parametrize(("module", "call"), [("pandas", "to_pandas"), ("xarray", "to_xarray")])
def test_missing_packages_are_named(monkeypatch, run, module, call):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=f"{call} needs {module}: pip install"):
        getattr(run, call)()
