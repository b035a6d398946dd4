"""Ensembles: the same bits wherever they run, statistics against NumPy, lost workers, failed members, going on."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import integrators.runs.ensembles
from integrators import IntegratorError, Scene, scene
from integrators.runs.ensemble_results import load_ensemble, member_statistics, merged_pairwise
from integrators.runs.ensembles import Members, cluster_executor, ensemble, member_generator, results_in_order
from integrators.runs.integration import integrate
from integrators.runs.random_starts import perturbed_start, thermal_momenta

pytestmark = pytest.mark.minimum

ATOMS = scene("lennard-jones", particles=3)
PENDULUM = scene("pendulum")
RICCATI = Scene({"y": 1}, field={"y": "y^2"}, start={"y": [1]})


def run(members=21, **options):
    """Some atoms, whose motion is chaotic enough to tell any two orders of additions apart."""
    given = {"h": 0.02, "steps": 95, "observe_every": 10, "observe": ["energy", "angular_momentum"], "keep": 3}
    given |= {"sample": thermal_momenta(ATOMS, 0.2), "members": members, "final": True}
    return ensemble("stormer-verlet", ATOMS, **{**given, **options})


def content(result):
    """All bits of a result."""
    tables = (result.mean, result.variance, result.minimum, result.maximum, result.series)
    arrays = [result.t, result.count, result.final, *(table[name] for table in tables for name in result.names)]
    return [array.tobytes() for array in arrays], result.failures, result.meta


def value(t, y):
    return y[0]


class Backwards(Executor):
    """Does its tasks in the reverse order, when somebody waits."""

    def __init__(self, until):
        self.until, self._tasks = until, []

    def submit(self, function, /, *args, **options):
        future = Future()
        self._tasks.append((future, function, args))
        if len(self._tasks) == self.until:
            for done, work, arguments in reversed(self._tasks):
                done.set_result(work(*arguments))
        return future


# The same numbers


@pytest.fixture(scope="module")
def reference():
    return content(run(workers=1))


@pytest.mark.parametrize("workers", [2, 3])
def test_threads_do_not_change_a_bit(workers, reference):
    assert content(run(workers=workers)) == reference


@pytest.mark.slow
def test_processes_do_not_change_a_bit(reference):
    assert content(run(workers=2, executor="processes")) == reference


@pytest.mark.slow
def test_a_cluster_does_not_change_a_bit(reference):
    pytest.importorskip("distributed")
    with cluster_executor(workers=2) as executor:
        assert content(run(executor=executor)) == reference


def test_an_executor_of_the_user_stays_open(reference):
    with ThreadPoolExecutor(2) as executor:
        assert content(run(executor=executor)) == reference
        assert executor.submit(int, "7").result() == 7


def test_the_order_of_blocks_does_not_change_a_bit(reference):
    assert content(run(executor=Backwards(until=21))) == reference


@pytest.mark.parametrize("blocks", [1, 2, 5])
def test_the_size_of_blocks_does_not_change_a_bit(blocks, reference, monkeypatch):
    monkeypatch.setattr(integrators.runs.ensembles, "BLOCKS", blocks)
    assert content(run()) == reference


def test_another_seed_changes_the_numbers(reference):
    assert content(run(rng=1))[0] != reference[0]


def test_members_do_not_depend_on_how_many_there_are():
    few, many = run(members=3), run(members=5)
    assert all((few.series[name] == many.series[name]).all() for name in few.names)
    assert (few.final == many.final[:3]).all()


def test_a_member_is_a_run_of_its_own():
    result, draw = run(members=4, keep=4), thermal_momenta(ATOMS, 0.2)
    for k in range(4):
        alone = integrate(
            "stormer-verlet", ATOMS, h=0.02, steps=95, y0=draw(member_generator(0, k)), save_every=10,
            observe=["energy", "angular_momentum"],
        )  # fmt: skip
        assert alone.t.tolist() == result.t.tolist()
        assert alone.y[:, -1].tolist() == result.final[k].tolist()
        assert all((alone.observed[name] == result.series[name][k]).all() for name in result.names)


def test_generators_are_those_that_numpy_spawns():
    for k, sequence in enumerate(np.random.SeedSequence(5).spawn(4)):
        assert member_generator(5, k).random() == np.random.default_rng(sequence).random()


# Statistics


def test_statistics_are_those_of_the_members():
    result = run(keep=21)
    assert result.t.tolist() == pytest.approx([0, *np.arange(0.2, 1.9, 0.2), 1.9])
    assert result.count.tolist() == [21] * 11
    for name in result.names:
        series = result.series[name]
        assert series.shape == (21, 11)
        np.testing.assert_allclose(result.mean[name], series.mean(axis=0), rtol=1e-13)
        np.testing.assert_allclose(result.variance[name], series.var(axis=0, ddof=1), rtol=1e-12)
        np.testing.assert_allclose(result.std[name], series.std(axis=0, ddof=1), rtol=1e-12)
        assert (result.minimum[name] == series.min(axis=0)).all()
        assert (result.maximum[name] == series.max(axis=0)).all()


@pytest.mark.parametrize("change", ["absolute", "relative", {"energy": "relative", "angular_momentum": "absolute"}])
def test_changes_are_from_the_start_of_each_member(change):
    plain, changed = run(), run(change=change)
    for name in plain.names:
        start, kind = plain.series[name][:, :1], change if isinstance(change, str) else change[name]
        expected = plain.series[name] - start
        assert (changed.series[name] == (expected / start if kind == "relative" else expected)).all()
        assert changed.mean[name][0] == changed.std[name][0] == 0


def test_variances_do_not_suffer_from_large_means():
    values = 1e9 + np.random.default_rng(1).standard_normal(1000)
    naive = (values**2).mean() - values.mean() ** 2
    exact = np.var(values - 1e9, ddof=1)
    assert gathered(values).squares.item() / 999 == pytest.approx(exact, rel=1e-7)
    assert naive != pytest.approx(exact, rel=0.1)


def gathered(values, block=1):
    """The statistics of numbers, block by block."""
    leaves = [member_statistics(np.array([[value]]), rows=1) for value in values]
    return merged_pairwise(merged_pairwise(leaves[k : k + block]) for k in range(0, len(leaves), block))


@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 13, 100])
def test_merging_does_not_depend_on_blocks_of_powers_of_two(count):
    values = np.random.default_rng(count).lognormal(sigma=9, size=count)
    expected = [array.tobytes() for array in gathered(values)]
    for block in (2, 4, 16, 128):
        assert [array.tobytes() for array in gathered(values, block)] == expected


def test_other_blocks_would_change_bits():
    values = np.random.default_rng(0).lognormal(sigma=9, size=100)
    assert gathered(values, block=3).mean.tobytes() != gathered(values).mean.tobytes()


def test_infinite_quantities_spoil_means_only():
    total = gathered([1.0, np.inf, 2.0])
    assert (total.count.item(), total.minimum.item(), total.maximum.item()) == (3, 1, np.inf)
    assert not np.isfinite(total.mean).any()


# Failures


def test_failed_members_count_up_to_where_they_failed():
    starts = [[0.1], [5.0], [0.2], [np.nan], [0.3]]
    result = ensemble("rk4", RICCATI, h=0.1, steps=20, y0=starts, observe={"value": value}, keep=5, final=True)
    blown, missing = result.failures
    assert (blown.member, missing.member, missing.step) == (1, 3, 0)
    assert 1 <= blown.step < 20
    assert blown.t == pytest.approx(0.1 * (blown.step - 1))
    assert len(blown.y) == 1
    assert "did not end in finite numbers" in blown.reason
    assert "y0 must hold 1 finite numbers" in missing.reason
    assert result.count.tolist() == [4] * blown.step + [3] * (21 - blown.step)
    assert np.isfinite(result.series["value"][1, : blown.step]).all()
    assert np.isnan(result.series["value"][1, blown.step :]).all()
    np.testing.assert_allclose(result.mean["value"], np.nanmean(result.series["value"], axis=0), rtol=1e-14)
    assert np.isnan(result.final[[1, 3]]).all()
    np.testing.assert_allclose(result.final[[0, 2, 4], 0], [0.1 / 0.8, 0.2 / 0.6, 0.3 / 0.4], rtol=1e-6)


def test_where_nobody_is_left_there_is_nothing():
    result = ensemble("rk4", RICCATI, h=0.1, steps=30, y0=[[4.0], [5.0]], observe={"value": value})
    assert len(result.failures) == 2
    assert result.count[-1] == 0
    tables = result.mean, result.std, result.minimum, result.maximum
    assert all(np.isnan(table["value"][-1]) for table in tables)


def test_a_function_that_fails_now_and_then_fails_single_members():
    def draw(rng):
        if rng.random() < 0.4:
            raise RuntimeError("no luck")
        return [0.0, 1.0]

    result = ensemble("stormer-verlet", PENDULUM, h=0.1, steps=5, sample=draw, members=20, rng=1)
    unlucky = [k for k in range(20) if member_generator(1, k).random() < 0.4]
    assert [failure.member for failure in result.failures] == unlucky
    assert all(failure.reason == "start: no luck" for failure in result.failures)
    assert (result.count == 20 - len(unlucky)).all()


@pytest.mark.slow
def test_members_of_a_lost_worker_run_again(tmp_path):
    mark, start = tmp_path / "killed", perturbed_start(PENDULUM, 0.1)

    def draw(rng):
        if multiprocessing.parent_process() is not None and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return start(rng)

    options = {"h": 0.1, "steps": 20, "members": 6}
    result = ensemble("stormer-verlet", PENDULUM, sample=draw, executor="processes", workers=1, **options)
    assert mark.exists()
    assert content(result) == content(ensemble("stormer-verlet", PENDULUM, sample=start, **options))


def die_once(k, mark):
    if k == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return 10 * k


@pytest.mark.slow
def test_tasks_of_lost_workers_run_again_and_results_are_in_order(tmp_path):
    tasks = [(k, tmp_path / "killed") for k in range(8)]
    assert list(results_in_order("processes", 2, die_once, tasks)) == [10 * k for k in range(8)]
    assert (tmp_path / "killed").exists()


def test_an_executor_that_has_lost_its_workers_is_told():
    class Broken(Executor):
        def submit(self, function, /, *args, **options):
            future = Future()
            future.set_exception(BrokenExecutor("lost"))
            return future

    with pytest.raises(IntegratorError, match=r"executor must have working processes, but they ended .*: lost"):
        run(executor=Broken())


def test_workers_that_never_live_are_not_started_for_ever():
    with pytest.raises(IntegratorError, match="executor must have working processes"):
        list(results_in_order("processes", 1, os._exit, [(k,) for k in range(1, 9)]))


# Going on


class StopError(Exception):
    pass


@pytest.mark.parametrize("workers", [1, 3])
def test_an_ensemble_can_be_gone_on_with(tmp_path, workers, reference):
    begun, seen, momenta = [], [], thermal_momenta(ATOMS, 0.2)

    def draw(rng):
        begun.append(1)
        return momenta(rng)

    def stop(done, total):
        if done == 5:
            raise StopError

    with pytest.raises(StopError):
        run(sample=draw, checkpoint=tmp_path, progress=stop, workers=workers)
    kept = len(list(tmp_path.glob("block-*.npz")))
    assert 5 <= kept < 21
    begun.clear()
    result = run(sample=draw, checkpoint=tmp_path, progress=lambda *x: seen.append(x))
    assert content(result) == reference
    assert len(begun) == 21 - kept + 2  # two are drawn to see that it is the same function
    assert seen == [(k, 21) for k in range(1, 22)]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_a_killed_ensemble_is_gone_on_with(tmp_path):
    script = (
        "import sys; from integrators import ensemble, perturbed_start, scene\n"
        "draw = perturbed_start(scene('kepler'), 1e-3)\n"
        "ensemble('gauss2', scene('kepler'), h=0.02, steps=20_000, sample=draw, members=40, keep=2, final=True,\n"
        "         workers=2, checkpoint=sys.argv[1]).save(sys.argv[2])\n"
    )
    folder, killed = tmp_path / "blocks", 0
    command = [sys.executable, "-c", script, str(folder)]
    for blocks in (3, 10):
        job = subprocess.Popen([*command, str(tmp_path / "killed.npz")])
        while job.poll() is None and len(list(folder.glob("block-*.npz"))) < blocks:
            time.sleep(0.002)
        job.kill()
        killed += job.wait() == -signal.SIGKILL
    assert killed
    subprocess.run([*command, str(tmp_path / "killed.npz")], check=True)
    subprocess.run([*command[:-1], str(tmp_path / "other"), str(tmp_path / "whole.npz")], check=True)
    assert (tmp_path / "killed.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()


def test_failures_are_kept_too(tmp_path):
    options = {"h": 0.1, "steps": 20, "y0": [[0.1], [5.0], [np.nan]], "observe": {"value": value}}
    first = ensemble("rk4", RICCATI, checkpoint=tmp_path, **options)
    second = ensemble("rk4", RICCATI, checkpoint=tmp_path, **options)
    assert content(first)[:2] == content(second)[:2]
    assert len(second.failures) == 2


def test_damaged_blocks_run_again(tmp_path, reference):
    run(checkpoint=tmp_path)
    (tmp_path / "block-000004.npz").write_bytes(b"PK nonsense")
    (tmp_path / "block-000007.npz").unlink()
    assert content(run(checkpoint=tmp_path)) == reference


@pytest.mark.parametrize(
    "change",
    [
        {"mean": np.zeros((1, 1))},
        {"count": np.array("x")},
        {"series": np.zeros((9, 9, 9))},
        {"failures": np.array('[{"member": "a"}]')},
        {"failures": np.array("null")},
    ],
)
def test_blocks_that_do_not_fit_run_again(tmp_path, reference, change):
    run(checkpoint=tmp_path)
    with np.load(tmp_path / "block-000004.npz") as file:
        arrays = dict(file) | change
    np.savez(tmp_path / "block-000004.npz", **arrays)
    assert content(run(checkpoint=tmp_path)) == reference


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"h": 0.03}, "had as h 0.02 and not 0.03"),
        ({"members": 22}, "had as members 21 and not 22"),
        ({"seed": 3}, "had as seed 0 and not 3"),
        ({"observe": "energy"}, "had as observe"),
        ({"sample": thermal_momenta(ATOMS, 0.3)}, "had as start other ones"),
        ({"split": False}, "had as split true and not false"),
    ],
)
def test_another_ensemble_is_refused(tmp_path, changed, message):
    run(checkpoint=tmp_path)
    with pytest.raises(IntegratorError, match="checkpoint must be the folder of the same ensemble, but " + message):
        run(checkpoint=tmp_path, **changed)


def test_folders_that_will_not_do(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(IntegratorError, match="checkpoint must be a folder that can be made"):
        run(checkpoint=tmp_path / "file")
    for damage in ("[]", "[" * 100_000):
        (tmp_path / "ensemble.json").write_text(damage)
        with pytest.raises(IntegratorError, match="checkpoint must be the folder of an ensemble"):
            run(checkpoint=tmp_path)


# Files and tables


def test_files_hold_everything(tmp_path):
    result = ensemble(
        "rk4", RICCATI, h=0.1, steps=20, y0=[[0.1], [5.0], [0.2]], observe={"value": value}, keep=2, final=True
    )
    result.save(tmp_path / "out.npz")
    again = load_ensemble(tmp_path / "out.npz")
    assert content(again) == content(result)
    assert repr(again) == repr(result) == "<EnsembleResult rk4 on scene: 3 members, 1 failed, 21 times>"


def test_other_files_are_refused(tmp_path):
    np.savez(tmp_path / "other.npz", head=np.array(json.dumps({"kind": "trajectory"})))
    (tmp_path / "text.npz").write_text("text")
    for name in ("other.npz", "text.npz", "none.npz"):
        with pytest.raises(IntegratorError, match="must be the file of an ensemble"):
            load_ensemble(tmp_path / name)


def test_tables():
    pytest.importorskip("pandas")
    result = run()
    table = result.to_pandas()
    assert table.index.tolist() == result.t.tolist()
    assert (table["energy", "mean"] == result.mean["energy"]).all()


def test_data_sets():
    pytest.importorskip("xarray")
    result = run()
    data = result.to_xarray()
    assert data["std"].sel(quantity="energy").values.tolist() == result.std["energy"].tolist()
    assert data["count"].dims == ("time",)


# Starts


def test_temperatures_are_those_of_the_momenta():
    atoms = scene("lennard-jones", particles=5, dimension=3, m=2)
    draw = thermal_momenta(atoms, 0.25)
    starts = np.array([draw(np.random.default_rng(k)) for k in range(4000)])
    p, q = starts[:, :15], starts[:, 15:]
    kinetic = (p**2).sum(axis=1) / 4
    assert kinetic.mean() == pytest.approx(0.25 * 12 / 2, rel=0.03)
    assert kinetic.var() == pytest.approx(0.25**2 * 12 / 2, rel=0.15)
    assert abs(p.reshape(-1, 5, 3).sum(axis=1)).max() < 1e-14
    assert (q == atoms.y0[15:]).all()


def test_masses_and_mean_velocities_are_taken_from_the_energy():
    pair = Scene(
        {"p": 2, "q": 2}, hamiltonian="p1^2 + p1*p2/2 + p2^2/4 + q1*p1 + q2^4", start={"p": [0, 0], "q": [3, 0]}
    )
    draw = thermal_momenta(pair, 2)
    inverse = np.array([[2, 0.5], [0.5, 0.5]])
    assert draw.mean == pytest.approx([*-np.linalg.solve(inverse, [3, 0]), 3, 0])
    assert draw.root[:2] @ draw.root[:2].T == pytest.approx(2 * np.linalg.inv(inverse))


def test_conserved_momenta_stay_those_of_the_start():
    bodies = scene("outer-solar-system")
    draw = thermal_momenta(bodies, 1e-12)
    start, drawn = (y[:18].reshape(6, 3) for y in (bodies.y0, draw(np.random.default_rng(1))))
    assert abs(start - drawn).max() > 1e-9
    assert drawn.sum(axis=0) == pytest.approx(start.sum(axis=0), abs=1e-18)


def test_no_temperature_is_no_motion():
    assert (thermal_momenta(ATOMS, 0)(np.random.default_rng(0))[:6] == 0).all()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("lorenz", "scene must have a Hamiltonian in momenta and positions, but lorenz has none"),
        ("rigid-body", "scene must have a Hamiltonian in momenta and positions, but rigid-body has none"),
        ("double-pendulum", "scene must have a kinetic energy that is quadratic in the momenta"),
        ("field-nijhoff", "scene must have a kinetic energy that is quadratic in the momenta"),
    ],
)
def test_scenes_without_temperature(name, message):
    with pytest.raises(IntegratorError, match=message):
        thermal_momenta(scene(name), 1)


def test_energies_must_be_positive():
    saddle = Scene({"p": 1, "q": 1}, hamiltonian="q^2 - p^2", start={"p": [0], "q": [1]})
    with pytest.raises(IntegratorError, match="kinetic energy that is positive"):
        thermal_momenta(saddle, 1)


@pytest.mark.parametrize("value", [-1, "hot", float("nan"), float("inf"), None])
def test_temperatures_and_spreads_must_be_numbers(value):
    with pytest.raises(IntegratorError, match="temperature must be a number from 0 on, but was"):
        thermal_momenta(ATOMS, value)
    with pytest.raises(IntegratorError, match="spread must be a number from 0 on, but was"):
        perturbed_start(ATOMS, value)


# What is refused


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "either y0 or sample, but had neither"),
        ({"y0": [[0, 1]], "sample": len}, "either y0 or sample, but had both"),
        ({"y0": [0, 1]}, r"y0 must have a row of 2 numbers for each member, but was \[0, 1\]"),
        ({"y0": [[0, 1], [2]]}, "y0 must have a row of 2 numbers"),
        ({"y0": np.empty((0, 2))}, "y0 must have a row of 2 numbers"),
        ({"y0": [[0, 1]], "members": 2}, "members must be the number of rows of y0, 1, but was 2"),
        ({"sample": 3, "members": 2}, "sample must be a function of a generator, but was 3"),
        ({"sample": len}, "members must be an integer from 1 on, but was None"),
        ({"sample": len, "members": 0}, "members must be an integer from 1 on, but was 0"),
        ({"sample": len, "members": 3}, "sample must give starts, but the first member has none: TypeError"),
        ({"y0": [[np.inf, 0]]}, "y0 must give starts, but the first member has none: IntegratorError"),
        ({"y0": [[0, 1]], "steps": 1.5}, "steps must be a whole number from 0 to .*, but was 1.5"),
        ({"y0": [[0, 1]], "steps": True}, "steps must be a whole number from 0 to .*, but was True"),
        ({"y0": [[0, 1]], "h": 0}, "h must not be zero"),
        ({"y0": [[0, 1]], "seed": -1}, "seed must be an integer from 0 on, but was -1"),
        ({"y0": [[0, 1]], "keep": "all"}, "keep must be an integer from 0 on, but was 'all'"),
        ({"y0": [[0, 1]], "observe_every": 0}, "observe_every must be an integer from 1 on, but was 0"),
        ({"y0": [[0, 1]], "change": "percent"}, "change must be None, 'absolute' or 'relative', but was 'percent'"),
        ({"y0": [[0, 1]], "change": {"mass": "absolute"}}, "change must be of energy, but was of 'mass'"),
        ({"y0": [[0, 1]], "workers": 0}, "workers must be a positive integer, but was 0"),
        ({"y0": [[0, 1]], "executor": "gpu"}, "executor must be 'threads', 'processes' or a concurrent.futures.Exec"),
        ({"y0": [[0, 1]] * 3, "steps": 10**13, "observe_every": 1}, "observe_every must be larger"),
    ],
)
def test_what_is_refused(options, message):
    with pytest.raises(IntegratorError, match=message):
        ensemble("stormer-verlet", PENDULUM, **{"h": 0.1, "steps": 10, **options})


def test_functions_that_cannot_travel_are_refused():
    lock = ThreadPoolExecutor(1)._shutdown_lock

    def draw(rng):
        return [0.0, 1.0] if lock else []

    options = {"h": 0.1, "steps": 10, "sample": draw, "members": 2}
    assert ensemble("stormer-verlet", PENDULUM, **options).count[-1] == 2
    with pytest.raises(IntegratorError, match="functions that can be sent to other processes"):
        ensemble("stormer-verlet", PENDULUM, executor="processes", **options)


@pytest.mark.parametrize("options", [{"address": "tcp://127.0.0.1:1", "workers": 2}, {"address": "nowhere:bad:1"}])
def test_schedulers_that_are_not_there(options):
    pytest.importorskip("distributed")
    with pytest.raises(IntegratorError, match=r"workers must be left out|scheduler must be the address"):
        cluster_executor(**options).__enter__()


def test_a_run_that_nobody_wants_stops():
    started = []

    class Watching(ThreadPoolExecutor):
        def submit(self, function, /, *args, **options):
            started.append(args[0])
            return super().submit(function, *args, **options)

    def stop(done, total):
        raise StopError

    with Watching(1) as executor, pytest.raises(StopError):
        ensemble("stormer-verlet", PENDULUM, h=1e-3, steps=10**6, y0=[[0, 1]] * 300, executor=executor, progress=stop)
    assert isinstance(started[0], Members)
    assert started[0].is_stopped


def test_no_steps_and_no_quantities():
    result = ensemble("stormer-verlet", PENDULUM, h=0.1, steps=0, y0=[[0, 1], [0, 2]], observe=None, final=True)
    assert result.t.tolist() == [0]
    assert result.names == ()
    assert result.final.tolist() == [[0, 1], [0, 2]]


def test_nothing_is_left_behind_but_blocks(tmp_path):
    run(members=2, checkpoint=tmp_path)
    assert sorted(os.listdir(tmp_path)) == ["block-000000.npz", "block-000001.npz", "ensemble.json"]
    assert json.loads(Path(tmp_path, "ensemble.json").read_text())["members"] == 2


def test_random_numbers_are_given_as_rng():
    """By SPEC 7 of Scientific Python; `seed` is the older name."""

    def states(**options):
        sample = perturbed_start(PENDULUM, 0.1)
        return ensemble("rk4", PENDULUM, h=0.1, steps=2, sample=sample, members=3, final=True, **options).final.tolist()

    assert states(rng=7) == states(seed=7) != states()
    assert states() == states(rng=0)
    assert states(rng=np.random.default_rng(5)) == states(rng=np.random.default_rng(5)) != states(rng=5)
    generator = np.random.default_rng(5)
    assert states(rng=generator) != states(rng=generator)
    assert states(rng=None) != states(rng=None)
    for name, value in (("rng", -1), ("rng", 1.5), ("seed", True), ("rng", "x")):
        with pytest.raises(IntegratorError, match=f"{name} must be"):
            states(**{name: value})
