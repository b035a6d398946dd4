"""`integrate`: what is kept and observed, and that nothing of it depends on how the work was cut."""

from __future__ import annotations

import json
import math
import os
import pickle
import signal
import subprocess
import sys
import time
import warnings
from contextlib import contextmanager

import numpy as np
import psutil
import pytest

from integrators import IntegratorError, Scene, method, scene
from integrators.reference.plain_steps import block_parts, plain_steps
from integrators.runs import integration
from integrators.runs.integration import integrate
from integrators.runs.observers import observers
from integrators.runs.storage import checksum
from integrators.runs.trajectory import load_trajectory
from integrators.steppers.states import StepError

PENDULUM = scene("pendulum")
KEPLER = scene("kepler")


def pendulum_field(y):
    return np.array([-np.sin(y[1]), y[0]])


def same(a, b):
    """Whether two trajectories agree bit for bit."""
    arrays = [(a.t, b.t), (a.y, b.y), (a.observed_t, b.observed_t)]
    arrays += [(a.observed[name], b.observed[name]) for name in {*a.observed, *b.observed}]
    return all(x.shape == z.shape and x.tobytes() == z.tobytes() for x, z in arrays)


@pytest.mark.parametrize("name", ["rk4", "stormer-verlet", "gauss2"])
def test_states_are_those_of_plain_steps(name):
    chosen = method(name)
    field = pendulum_field if len(chosen.names) == 1 else block_parts(pendulum_field, {"p": [0], "q": [1]})
    expected = plain_steps(chosen, field, [0.3, -1.5], 0.1, 50)
    run = integrate(chosen, PENDULUM, h=0.1, steps=50, y0=[0.3, -1.5])
    np.testing.assert_allclose(run.y, expected, rtol=0, atol=1e-13)
    assert run.t.tolist() == [n * 0.1 for n in range(51)]
    assert run.variables == ("p", "q")


@pytest.mark.parametrize(
    ("steps", "every", "numbers"),
    [
        (0, 1, [0]),
        (0, None, [0]),
        (1, 5, [0, 1]),
        (10, 5, [0, 5, 10]),
        (12, 5, [0, 5, 10, 12]),
        (12, None, [0, 12]),
        (3, 1, [0, 1, 2, 3]),
    ],
)
def test_grid_has_the_start_every_so_many_and_the_last(steps, every, numbers):
    whole = integrate("stormer-verlet", KEPLER, h=0.01, steps=steps)
    run = integrate("stormer-verlet", KEPLER, h=0.01, steps=steps, save_every=every, observe="energy")
    assert run.t.tolist() == [n * 0.01 for n in numbers]
    assert run.y.tolist() == whole.y[:, numbers].tolist()
    assert run.observed["energy"].shape == (len(numbers),)
    assert run.observed_t is run.t


@pytest.mark.parametrize(("save_every", "observe_every"), [(None, 7), (7, None), (10, 3), (3, 10), (1, 4), (40, 1)])
def test_observations_have_a_grid_of_their_own(save_every, observe_every):
    whole = integrate("rk4", KEPLER, h=0.01, steps=100, observe=["energy", "angular_momentum"])
    run = integrate(
        "rk4",
        KEPLER,
        h=0.01,
        steps=100,
        save_every=save_every,
        observe_every=observe_every,
        observe=list(whole.observed),
    )
    chosen = observe_every or save_every
    numbers = sorted({*range(0, 101, chosen), 100})
    assert run.observed_t.tolist() == [n * 0.01 for n in numbers]
    for name, values in whole.observed.items():
        np.testing.assert_allclose(run.observed[name], values[numbers], rtol=1e-15)


def test_observers_agree_with_numpy():
    def radius(t, y):
        return math.hypot(y[2], y[3])

    seen = ["energy", "invariants", radius, {"double": lambda t, y: 2 * t, "first": "angular_momentum"}]
    run = integrate("rk4", KEPLER, h=0.01, steps=200, save_every=3, observe=seen)
    p1, p2, q1, q2 = run.y
    r = np.hypot(q1, q2)
    expected = {
        "energy": (p1**2 + p2**2) / 2 - 1 / r,
        "angular_momentum": q1 * p2 - q2 * p1,
        "runge_lenz_1": p2 * (q1 * p2 - q2 * p1) - q1 / r,
        "runge_lenz_2": -p1 * (q1 * p2 - q2 * p1) - q2 / r,
        "radius": r,
        "double": 2 * run.t,
        "first": q1 * p2 - q2 * p1,
    }
    assert list(run.observed) == list(expected)
    for name, values in expected.items():
        np.testing.assert_allclose(run.observed[name], values, rtol=0, atol=1e-14, err_msg=name)


@pytest.mark.parametrize("name", ["lennard-jones", "outer-solar-system", "toda", "rigid-body"])
def test_energy_of_scenes_over_sites_is_the_formula(name):
    chosen = scene(name)
    energy = observers(chosen, "energy")(0.0, chosen.y0)[0]
    exact = chosen.hamiltonian.subs(dict(zip(chosen.symbols, chosen.start, strict=True)))
    assert energy == pytest.approx(float(exact), rel=1e-13)


def test_energy_of_the_base_system_is_seen_where_an_effect_has_taken_it():
    damped = scene("pendulum", effects=["damping"])
    run = integrate("rk4", damped, h=0.05, steps=400, observe="energy")
    p, q = run.y
    np.testing.assert_allclose(run.observed["energy"], p**2 / 2 - np.cos(q), atol=1e-14)
    assert (np.diff(run.observed["energy"]) < 0).all()
    conservative = integrate("rk4", PENDULUM, h=0.05, steps=400, observe="energy")
    assert np.ptp(conservative.observed["energy"]) < 1e-5


def test_a_first_integral_is_seen_even_if_an_effect_breaks_it():
    run = integrate("rk4", scene("kepler", effects=["drag"]), h=0.01, steps=100, observe="angular_momentum")
    p1, p2, q1, q2 = run.y
    np.testing.assert_allclose(run.observed["angular_momentum"], q1 * p2 - q2 * p1, atol=1e-14)
    assert list(integrate("rk4", scene("henon-heiles"), h=0.01, steps=1, observe="invariants").observed) == ["energy"]
    none = integrate("rk4", scene("kepler", effects=["drag"]), h=0.01, steps=1, observe="invariants")
    assert none.observed == {}


def test_observers_pickle_and_show_themselves():
    seen = pickle.loads(pickle.dumps(observers(KEPLER, ["energy", "angular_momentum"])))
    assert repr(seen) == "<Observers energy, angular_momentum on kepler>"
    assert seen(0.0, KEPLER.y0).tolist() == observers(KEPLER, ["energy", "angular_momentum"])(0.0, KEPLER.y0).tolist()


def test_chunks_change_no_bit(monkeypatch):
    arguments = {"h": 0.01, "steps": 1001, "save_every": 7, "observe": "energy", "observe_every": 10}
    whole = integrate("gauss2", KEPLER, **arguments)
    calls = []
    monkeypatch.setattr(integration, "CHUNK_SECONDS", 0.0)  # so that chunks have one step
    chopped = integrate("gauss2", KEPLER, **arguments, progress=lambda done, total: calls.append((done, total)))
    assert len(calls) > 900
    assert calls[-1] == (1001, 1001)
    assert same(whole, chopped)
    monkeypatch.undo()
    monkeypatch.setattr(integration, "CHUNK_NUMBERS", 4)  # so that chunks are cut where rows would be too many
    assert same(whole, integrate("gauss2", KEPLER, **arguments))


def test_backwards_in_time():
    there = integrate("stormer-verlet", PENDULUM, h=0.1, steps=100, y0=[0.0, -1.5])
    back = integrate("stormer-verlet", PENDULUM, h=-0.1, steps=100, y0=there.y[:, -1], t0=there.t[-1])
    assert back.t[-1] == pytest.approx(0.0, abs=1e-14)
    np.testing.assert_allclose(back.y[:, ::-1], there.y, atol=1e-13)
    forth = integrate("explicit-euler", PENDULUM, h=0.1, steps=100, y0=[0.0, -1.5])
    not_back = integrate("explicit-euler", PENDULUM, h=-0.1, steps=100, y0=forth.y[:, -1])
    assert abs(not_back.y[:, -1] - forth.y[:, 0]).max() > 0.1


def test_time_as_a_variable_begins_at_t0():
    forced = Scene({"y": 1}, field={"y": "cos(t)"}, start={"y": [0]})
    run = integrate("rk4", forced, h=0.01, steps=100, t0=2.0)
    np.testing.assert_allclose(run.y[1], run.t, rtol=1e-14)
    np.testing.assert_allclose(run.y[0], np.sin(run.t) - math.sin(2), atol=1e-9)


def test_a_failed_step_keeps_what_was_before(tmp_path):
    path = tmp_path / "square.npz"
    arguments = {"h": 0.01, "steps": 10_000, "y0": [1.0], "save_every": 7}
    with pytest.raises(StepError, match=r"step \d+, from t = 1\.\d+, did not end in finite numbers") as found:
        integrate("rk4", scene("riccati"), **arguments, to=path, checkpoint=tmp_path / "check")
    kept = found.value.trajectory
    last = found.value.step - 1
    whole = integrate("rk4", scene("riccati"), h=0.01, steps=last, y0=[1.0], save_every=7)
    assert same(kept, whole)
    assert kept.t[-1] == last * 0.01
    assert same(load_trajectory(path), whole)
    assert os.listdir(tmp_path) == ["square.npz"]


def test_a_step_that_fails_first_keeps_the_start():
    with pytest.raises(StepError, match="step 1, from t = 0") as found:
        integrate("explicit-euler", scene("riccati"), h=1e200, steps=3, y0=[1e200])
    assert found.value.trajectory.t.tolist() == [0.0]


class Interrupt:
    """A progress callback that interrupts once."""

    def __init__(self, after: int):
        self.after = after

    def __call__(self, done: int, total: int) -> None:
        if done >= self.after:
            raise KeyboardInterrupt


@pytest.mark.parametrize("name", ["stormer-verlet", "gauss3"])
@pytest.mark.parametrize("streamed", [True, False])
def test_a_run_goes_on_from_its_checkpoint_bit_for_bit(tmp_path, name, streamed):
    arguments = {"h": 0.02, "steps": 20_003, "save_every": 10, "observe": ["energy"], "observe_every": 25}
    whole = integrate(name, KEPLER, **arguments, to=tmp_path / "whole.npz")
    to, check = (tmp_path / "parts.npz" if streamed else None), tmp_path / "check"
    for after in (1, 3000, 9000):
        with pytest.raises(KeyboardInterrupt):
            integrate(name, KEPLER, **arguments, to=to, checkpoint=check, progress=Interrupt(after))
        assert check.exists()
    run = integrate(name, KEPLER, **arguments, to=to, checkpoint=check)
    assert same(run, whole)
    assert sorted(os.listdir(tmp_path)) == ["parts.npz", "whole.npz"][1 - streamed :]
    if streamed:
        assert (tmp_path / "parts.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()


def test_an_interrupted_run_may_become_longer(tmp_path):
    check = tmp_path / "check"
    with pytest.raises(KeyboardInterrupt):
        integrate("rk4", KEPLER, h=0.01, steps=5000, save_every=100, checkpoint=check, progress=Interrupt(1000))
    run = integrate("rk4", KEPLER, h=0.01, steps=7000, save_every=100, checkpoint=check)
    assert same(run, integrate("rk4", KEPLER, h=0.01, steps=7000, save_every=100))


def test_an_interrupt_without_checkpoint_leaves_a_readable_file(tmp_path):
    path = tmp_path / "run.npz"
    with pytest.raises(KeyboardInterrupt):
        integrate("rk4", KEPLER, h=0.01, steps=10**6, save_every=10, to=path, progress=Interrupt(2000))
    kept = load_trajectory(path)
    n = len(kept.t)
    assert 200 < n < 10**5
    assert same(kept, integrate("rk4", KEPLER, h=0.01, steps=10 * (n - 1), save_every=10))
    assert os.listdir(tmp_path) == ["run.npz"]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_a_killed_run_goes_on_bit_for_bit(tmp_path):
    script = (
        "import sys; from integrators import scene; from integrators.runs.integration import integrate\n"
        "integrate('gauss2', scene('kepler'), h=0.02, steps=300_007, save_every=20, observe='energy',\n"
        "          observe_every=50, to=sys.argv[1], checkpoint=sys.argv[2], checkpoint_every=0.0)\n"
    )
    whole, parts, check = tmp_path / "whole.npz", tmp_path / "parts.npz", tmp_path / "check"
    killed = 0
    for _ in range(2):
        job = subprocess.Popen([sys.executable, "-c", script, str(parts), str(check)])
        seen = check.stat().st_mtime_ns if check.exists() else 0
        while job.poll() is None and (not check.exists() or check.stat().st_mtime_ns == seen):
            time.sleep(0.002)
        job.kill()
        killed += job.wait() == -signal.SIGKILL
    assert killed
    if check.exists():
        part = load_trajectory(parts)
        assert part.y.shape == (4, len(part.t))
    for path, arguments in ((parts, [str(check)]), (whole, [str(tmp_path / "other")])):
        subprocess.run([sys.executable, "-c", script, str(path), *arguments], check=True)
    assert parts.read_bytes() == whole.read_bytes()


@pytest.fixture
def small_disk():
    """A context in which no file grows beyond a number of bytes."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)

    @contextmanager
    def limited(size):
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))

    return limited


def test_a_run_goes_on_after_a_full_disk(tmp_path, small_disk):
    arguments = {"h": 0.01, "steps": 20_000, "save_every": 2, "observe": "energy"}
    whole = integrate("rk4", KEPLER, **arguments, to=tmp_path / "whole.npz")
    parts = {"to": tmp_path / "parts.npz", "checkpoint": tmp_path / "check"}
    with small_disk(100_001), pytest.raises(IntegratorError, match=r"parts\.npz\.part must be a folder that can be wr"):
        integrate("rk4", KEPLER, **arguments, **parts)
    assert same(integrate("rk4", KEPLER, **arguments, **parts), whole)
    with small_disk(100_001), pytest.raises(IntegratorError, match=r"must be a .*writ"):
        integrate("rk4", KEPLER, **arguments, to=tmp_path / "other.npz")
    kept = load_trajectory(tmp_path / "other.npz")
    assert 1 < len(kept.t) < 10_000
    assert (kept.y == whole.y[:, : len(kept.t)]).all()


@pytest.fixture
def stopped(tmp_path):
    """A run that was interrupted, and its checkpoint."""
    arguments = {"h": 0.01, "steps": 5000, "save_every": 10, "observe": "energy", "checkpoint": tmp_path / "check"}
    with pytest.raises(KeyboardInterrupt):
        integrate("rk4", KEPLER, **arguments, progress=Interrupt(100))
    return arguments


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"h": 0.02}, r"had as h 0\.01 and not 0\.02"),
        ({"save_every": 5}, "had as save_every 10 and not 5"),
        ({"observe": None}, r'had as observe \["energy"\] and not \[\]'),
        ({"y0": [0.0, 1.0, 1.0, 0.0]}, "had as start other ones"),
        ({"t0": 1.0}, r"had as t0 0\.0 and not 1\.0"),
        ({"compensated": False}, "had as compensated true and not false"),
        ({"steps": 1}, r"steps must be at least the \d+ of the checkpoint, but was 1"),
    ],
)
def test_another_run_does_not_go_on_from_a_checkpoint(stopped, change, match):
    with pytest.raises(IntegratorError, match=match):
        integrate("rk4", KEPLER, **(stopped | change))


def test_another_scene_or_method_does_not_go_on_from_a_checkpoint(stopped):
    with pytest.raises(IntegratorError, match='had as method "rk4" and not "explicit-midpoint"'):
        integrate("explicit-midpoint", KEPLER, **stopped)
    with pytest.raises(IntegratorError, match="had as compiled steps other ones"):
        integrate("rk4", KEPLER.with_parameters(mu=2), **stopped)


def test_lost_or_foreign_rows_are_noticed(stopped, tmp_path):
    folder = tmp_path / "check.part"
    with open(folder / "y.f64", "r+b") as file:
        file.truncate(150)
    with pytest.raises(IntegratorError, match=r"y\.f64 must have the rows to resume from, but has fewer"):
        integrate("rk4", KEPLER, **stopped)
    (folder / "run.json").unlink()
    with pytest.raises(IntegratorError, match="must have the rows of the run to resume from, but has not"):
        integrate("rk4", KEPLER, **stopped)
    (tmp_path / "check").write_bytes(b"nonsense")
    with pytest.raises(IntegratorError, match="checkpoint must be a file of a run, but"):
        integrate("rk4", KEPLER, **stopped)


DAMAGED = {
    "no carry": ({"carry": np.zeros(0)}, r"carry must be doubles in the shape \(4\), but was float64 in \(0,\)"),
    "another n": ({"n": 7}, "its content was not written by a run"),
    "negative n": ({"n": -7}, "its content was not written by a run"),
    "part of a step": ({"n": 7.5}, "head.n must be a whole number, but was 7.5"),
    "control": ({"control": np.zeros(1)}, r"control must be doubles in the shape \(0\), but was float64 in \(1,\)"),
    "memory": ({"memory": np.zeros(9)}, r"memory must be doubles in the shape"),
    "nan": ({"values": np.full(4, np.nan)}, "its content was not written by a run"),
    "another state": ({"values": np.ones(4)}, "its content was not written by a run"),
    "text": ({"values": np.array("0.01")}, "values must be doubles in the shape"),
    "solver": ({"solver": "none"}, "its content was not written by a run"),
    "fresh": ({"is_fresh": 1}, "head.is_fresh must be true or false, but was 1"),
    "nothing": ({"memory": None}, "it has no array memory"),
    "no run": ({"run": None}, "head.run must be a table, but was null"),
    "null": ({"head": np.array("null")}, "head must be a table, but was null"),
}


def change_checkpoint(path, change, *, signed=False):
    """Change arrays of a checkpoint, or entries of its head, with or without the checksum."""
    with np.load(path) as file:
        arrays = dict(file)
    head = json.loads(str(arrays["head"]))
    arrays["head"] = np.array(json.dumps(head | {name: value for name, value in change.items() if name in head}))
    arrays |= {name: value for name, value in change.items() if name not in head}
    arrays = {name: array for name, array in arrays.items() if array is not None}
    if signed:
        arrays["digest"] = np.array(checksum({name: array for name, array in arrays.items() if name != "digest"}))
    with open(path, "wb") as file:
        np.savez(file, **arrays)


@pytest.mark.parametrize("case", DAMAGED)
def test_a_damaged_checkpoint_is_refused(stopped, case):
    change, reason = DAMAGED[case]
    change_checkpoint(stopped["checkpoint"], change)
    with pytest.raises(IntegratorError, match="checkpoint must be a file of a run, but .*check was not: " + reason):
        integrate("rk4", KEPLER, **stopped)


@pytest.mark.parametrize("change", [{"values": np.full(4, np.nan)}, {"n": -7}, {"n": 2**60}, {"solver": "none"}])
def test_a_checkpoint_that_no_run_has_written_is_refused(stopped, change):
    change_checkpoint(stopped["checkpoint"], change, signed=True)
    with pytest.raises(IntegratorError, match="check was not: its content was not written by a run"):
        integrate("rk4", KEPLER, **stopped)


def test_a_checkpoint_must_have_the_rows_of_its_step(stopped):
    change_checkpoint(stopped["checkpoint"], {"n": 4000}, signed=True)
    with pytest.raises(IntegratorError, match=r"y\.f64 must have the rows to resume from, but has fewer"):
        integrate("rk4", KEPLER, **stopped)


@pytest.mark.parametrize("content", [b"null", b'{"meta": null}', b"\xff", b'{"variables": ["p", 1]}'])
def test_a_damaged_description_is_refused(stopped, content):
    (stopped["checkpoint"].with_name("check.part") / "run.json").write_bytes(content)
    with pytest.raises(IntegratorError, match=r"check\.part"):
        integrate("rk4", KEPLER, **stopped)
    with pytest.raises(IntegratorError, match=r"check\.part"):
        load_trajectory(stopped["checkpoint"].with_name("check.part"))


@pytest.mark.parametrize("content", ["[" * 100_000, '{"a', "1" * 5000])
def test_a_description_must_hold_json(stopped, content):
    (stopped["checkpoint"].with_name("check.part") / "run.json").write_text(content)
    with pytest.raises(
        IntegratorError, match=r"check\.part must .*: run.json must hold JSON, not too deeply nested, but"
    ):
        integrate("rk4", KEPLER, **stopped)


def test_memory_does_not_grow_with_steps():
    arguments = {"h": 0.1, "save_every": None, "observe": "energy", "observe_every": 100}
    integrate("stormer-verlet", PENDULUM, **arguments, steps=1000)
    before = psutil.Process().memory_info().rss
    most = []
    run = integrate(
        "stormer-verlet", PENDULUM, **arguments, steps=10**7,
        progress=lambda done, total: most.append(psutil.Process().memory_info().rss),
    )  # fmt: skip
    assert len(run.observed["energy"]) == 10**5 + 1
    assert max(most) - before < 20e6


def test_streaming_takes_no_memory(tmp_path):
    arguments = {"h": 0.1, "save_every": 1, "to": tmp_path / "run.npz"}
    integrate("stormer-verlet", PENDULUM, **arguments, steps=1000)
    before, most = psutil.Process().memory_info().rss, []
    run = integrate(
        "stormer-verlet", PENDULUM, **arguments, steps=4 * 10**6,
        progress=lambda done, total: most.append(psutil.Process().memory_info().rss),
    )  # fmt: skip
    assert run.y.shape == (2, 4 * 10**6 + 1)  # 96 MB with the times
    assert max(most) - before < 70e6  # a chunk has at most 2^21 numbers, 17 MB, and times


def test_what_does_not_fit_is_refused_before_the_first_step(monkeypatch, tmp_path):
    with pytest.raises(
        IntegratorError,
        match=r"save_every must be larger, or `to` a file, since the stored run would take 240000\.0 GB of memory",
    ):
        integrate("stormer-verlet", PENDULUM, h=0.1, steps=10**13)
    with pytest.raises(IntegratorError, match=r"save_every must be larger, since 480000\.0 GB of disk"):
        integrate("stormer-verlet", PENDULUM, h=0.1, steps=10**13, to=tmp_path / "run.npz")
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"steps": -1}, r"steps must be a whole number from 0 to 2\^53, but was -1"),
        ({"steps": 1.5}, r"steps must be a whole number from 0 to 2\^53, but was 1\.5"),
        ({"steps": True}, "steps must be a whole number"),
        ({"save_every": 0}, r"save_every must be a whole number from 1 to 2\^53, but was 0"),
        ({"observe_every": "x"}, "observe_every must be a whole number from 1"),
        ({"h": 0}, "h must not be zero"),
        ({"h": math.nan}, "h must be a finite number, but was nan"),
        ({"y0": [1, 2, 3]}, "y0 must hold 2 finite numbers"),
        ({"checkpoint_every": -1}, "checkpoint_every must be seconds, 0 or more, but was -1"),
        (
            {"observe": "mass"},
            "observe must hold functions, or quantities of pendulum \\(energy\\), but one was 'mass'",
        ),
        ({"observe": ["energy", "energy"]}, "observe must have names of their own, but energy was there twice"),
        ({"observe": {"q": "energy"}}, "observe must have names of their own, but q is a variable"),
        ({"observe": lambda t, y: 1.0}, "observe must give names, .* but one was a lambda"),
        ({"observe": {"a/b": "energy"}}, "observe must give names"),
        ({"observe": 5}, "observe must be of names and functions of .*, but one was 5"),
        ({"observe": {"f": 5}}, "observe must be of names and functions of .*, but f was 5"),
        ({"observe": {"f": lambda t: t}}, r"observe must have functions of \(t, y\) that numba can compile, but f was"),
        ({"observe": {"f": lambda t, y: y}}, "observe must have functions whose value is a number, but that of f is"),
        ({"observe": {"f": lambda t, y: str(object())}}, "that numba can compile, but f was not"),
        ({"observe": {"f": lambda t, y: y.fill(0.0) or 1.0}}, "that numba can compile, but f was not"),
        (
            {"observe": {"f": lambda t, y: [1.0][int(5 + y[0])] / 0}},
            "functions with a value at the start, but f raised",
        ),
        ({"to": 5}, "to must be a path, but was 5"),
        ({"to": "run", "checkpoint": "run"}, "checkpoint must be another file than to, but both were run"),
        ({"to": "/no/such/folder/run.npz"}, "must be a folder that can be written, but was not: No such file"),
    ],
)
def test_bad_arguments_are_refused(change, match):
    arguments = {"h": 0.1, "steps": 3, "observe": "energy"} | change
    with pytest.raises(IntegratorError, match=match):
        integrate("rk4", PENDULUM, **arguments)


def test_leftovers_of_a_run_that_died_are_replaced(tmp_path):
    folder = tmp_path / "run.npz.part"
    folder.mkdir()
    for name in ("y", "t", "observed", "observed_t"):
        (folder / f"{name}.f64").write_bytes(b"something longer than what comes now" * 1000)
    run = integrate("rk4", PENDULUM, h=0.1, steps=3, to=tmp_path / "run.npz")
    assert same(run, integrate("rk4", PENDULUM, h=0.1, steps=3))
    assert os.listdir(tmp_path) == ["run.npz"]


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(IntegratorError, match=r"to must be a file, but .* was a folder"):
        integrate("rk4", PENDULUM, h=0.1, steps=3, to=tmp_path)


def test_observers_that_fail_leave_nan():
    def late(t, y):
        if t > 0.25:
            raise ValueError
        return t

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the error cannot leave machine code, and an observed nan is warned of
        run = integrate("rk4", PENDULUM, h=0.1, steps=4, observe=late)
    (values,) = run.observed.values()
    np.testing.assert_allclose(values, [0, 0.1, 0.2, np.nan, np.nan], atol=1e-15)


def test_runs_are_read_by_name_and_by_numpy():
    run = integrate("rk4", "henon-heiles", h=0.1, steps=1e1, observe="energy")
    assert len(run.t) == 11
    assert (run["q2"] == run.y[3]).all()
    assert run["energy"] is run.observed["energy"]
    assert run["t"] is run.t
    assert np.asarray(run) is run.y
    assert np.mean(run) == run.y.mean()
    assert np.array(run, dtype=np.float32).dtype == np.float32
    with pytest.raises(IntegratorError, match="name must be one of p1, p2, q1, q2, energy, t, but was 'x'"):
        run["x"]
    with pytest.raises(IntegratorError, match="steps must be a whole number"):
        integrate("rk4", "henon-heiles", h=0.1, steps=10.5)
