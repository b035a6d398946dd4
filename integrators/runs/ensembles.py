"""Ensembles: runs of one method on one scene from many starts, on threads, processes or a cluster."""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache, partial
from itertools import repeat
from time import monotonic
from typing import Any, TypeVar

import numpy as np

from bseries_base.children import Children, end_with_parent, safe_path, start_tracker
from bseries_base.errors import shorten, warn_user
from bseries_base.extras import loaded_module, optional_module
from bseries_base.interrupts import mapped, uninterrupted
from bseries_base.memory import refuse_beyond_memory
from integrators.core.arguments import check_end, check_progress, read_array, read_whole
from integrators.core.errors import IntegratorError
from integrators.exact.arguments import step_count
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.runs.ensemble_results import (
    Block,
    EnsembleResult,
    Failure,
    Statistics,
    block_folder,
    load_block,
    member_statistics,
    merged_blocks,
    save_block,
)
from integrators.runs.integration import OutputSteps
from integrators.runs.observers import Observers, observers
from integrators.runs.storage import description, identity
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene
from integrators.steppers.states import State, StepError
from integrators.steppers.stepping import Stepper, stepper

T = TypeVar("T")

KINDS = ("threads", "processes")
MOST_LOSSES = 3
"""The number of successive pools that may break before a task is finished."""
PATIENCE = 0.1
"""Seconds between checks whether the ensemble was cancelled."""


@dataclass(eq=False)
class Members:
    """The common arguments of all members, see `ensemble`; pickled as bytes that each process unpacks once."""

    scene: Scene
    method: Method
    h: float
    steps: int
    t0: float
    options: Mapping[str, Any]
    observers: Observers
    observe_every: int
    change: Sequence[str | None]
    sample: Callable[[np.random.Generator], object] | None
    seed: int
    keep: int
    final: bool

    def __post_init__(self) -> None:
        self.is_stopped = False
        self._chunk = 1000  # steps between checks of `is_stopped`

    def __reduce__(self) -> tuple[object, ...]:
        return _restored, (self.packed,)

    def stop(self) -> None:
        """Cancel members that run in threads."""
        self.is_stopped = True

    @cached_property
    def packed(self) -> bytes:
        """The pickled arguments; functions of the user are pickled by value, lambdas included."""
        from numba import cloudpickle

        try:
            return cloudpickle.dumps([getattr(self, field.name) for field in fields(self)])
        except Exception as error:  # objects of the user may raise anything
            raise IntegratorError(
                "sample and observe must be functions that can be sent to other processes, but were not: "
                f"{shorten(str(error), 120)}"
            ) from None

    @cached_property
    def stepper(self) -> Stepper:
        """The compiled steps."""
        return stepper(self.method, self.scene, **self.options)

    @cached_property
    def step_numbers(self) -> np.ndarray:
        """The observed steps: 0, every `observe_every`-th, and the last."""
        return np.append(np.arange(0, self.steps, self.observe_every), self.steps) if self.steps else np.zeros(1, int)

    def sizes(self, members: range) -> dict[str, int]:
        """Lengths of the axes of the arrays of a block."""
        kept = max(0, min(len(members), self.keep - members.start))
        sizes = {"times": len(self.step_numbers), "quantities": len(self.observers), "variables": self.scene.dimension}
        return {**sizes, "kept": kept, "ends": len(members) if self.final else 0}

    def start(self, member: int, y0: object) -> State:
        """A member before its first step, from its start or, where `y0` is None, from a drawn one."""
        start = y0 if self.sample is None else self.sample(member_generator(self.seed, member))
        if start is None:
            raise IntegratorError("sample must give the start of a member, but gave None")
        return self.stepper.start(start, h=self.h, t0=self.t0)

    def run(self, state: State, values: np.ndarray) -> None:
        """Make all steps of a member in place, and write the observations, (times, quantities), until a step fails."""
        observer = self.observers
        values[0] = observer(state.t, state.y)
        while state.n < self.steps:
            if self.is_stopped:
                raise CancelledError
            began, chunk = monotonic(), self._chunk
            self.stepper.record(
                state, min(chunk, self.steps - state.n), o_every=self.observe_every if observer else 0,
                observer=observer.address, o_rows=values[1 + state.n // self.observe_every :],
            )  # fmt: skip
            is_short = monotonic() - began < PATIENCE / 2
            self._chunk = min(chunk * 2, self.steps) if is_short else max(1, chunk // 2)
        values[-1] = observer(state.t, state.y)

    def changed(self, values: np.ndarray) -> np.ndarray:
        """The quantities, or their changes since the start, depending on `change`."""
        result = values.copy()
        with np.errstate(all="ignore"):  # initial values may be zero
            for k, change in enumerate(self.change):
                if change is not None:
                    result[:, k] -= values[0, k]
                if change == "relative":
                    result[:, k] /= values[0, k]
        return result

    def result(self, member: int, y0: object) -> Block:
        """The run of one member, as a block."""
        values = np.full((len(self.step_numbers), len(self.observers)), np.nan)
        end, rows, failures = np.full(self.scene.dimension, np.nan), 0, list[Failure]()
        state = None
        try:
            state = self.start(member, y0)
            self.run(state, values)
            rows, end = len(values), state.y
        except StepError as error:
            rows = (error.step - 1) // self.observe_every + 1
            failures = [Failure(member, error.step, error.t, tuple(error.y.tolist()), str(error))]
        except Exception as error:
            if state is not None:
                raise
            failures = [Failure(member, 0, self.t0, None, shorten(f"start: {error or type(error).__name__}", 300))]
        values = self.changed(values)
        series, ends = values[None][: int(member < self.keep)], end[None][: int(self.final)]
        return Block(member_statistics(values, rows), series, ends, tuple(failures))

    def block(self, members: range, starts: np.ndarray | None) -> Block:
        """The runs of a block of members from their starts; None: they are drawn."""
        own = repeat(None, len(members)) if starts is None else starts
        return merged_blocks(self.result(member, y0) for member, y0 in zip(members, own, strict=True))


@lru_cache(maxsize=4)
def _restored(packed: bytes) -> Members:
    return Members(*pickle.loads(packed))


def member_generator(seed: int, member: int) -> np.random.Generator:
    """The generator of a member: that of ``SeedSequence(seed).spawn(…)[member]``, made directly."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(member,)))


BOOKKEEPING = 2
"""List entries for each member of an ensemble."""
BLOCKS = 64
"""Approximate number of blocks: enough to balance the load, few enough that their statistics take little memory."""
TIMES = 1000
"""Approximate number of observations by default."""
CHANGES = (None, "absolute", "relative")


def ensemble(
    method: Method | str,
    scene: Scene | str,
    *,
    h: float | str,
    steps: int | None = None,
    span: float | str | None = None,
    y0: object = None,
    sample: Callable[[np.random.Generator], object] | None = None,
    members: int | None = None,
    rng: np.random.Generator | int | None = 0,
    seed: int | None = None,
    t0: float = 0.0,
    observe: object = "energy",
    observe_every: int | None = None,
    change: str | Mapping[str, str] | None = None,
    keep: int = 0,
    final: bool = False,
    parts: Parts | None = None,
    compensated: bool = True,
    split: bool = True,
    solver: str = "auto",
    average_nodes: int | None = None,
    executor: Executor | str = "threads",
    workers: int | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], object] | bool | None = None,
) -> EnsembleResult:
    """Integrate a scene from many starts, and return statistics of the observed quantities.

    Results do not depend on the executor, the number of workers, or the order in which they finish: each member has its
    own random numbers, and statistics are merged along a fixed tree. Each member agrees to the last bit with
    `integrate` from its start. (Different processors may round differently.)

    Args:
        span: The length of time instead of `steps`; the last step may end later.
        y0: The starts, (members, variables), unless `sample` is given.
        sample: A function that draws a start, (variables,), from a NumPy generator: `thermal_momenta`,
            `perturbed_start`, or your own. Member k gets the generator of ``SeedSequence(rng).spawn(…)[k]``.
        members: The number of members; required with `sample`.
        rng: The seed of the random numbers, 0 or more; a NumPy generator that draws it; or None for one of the moment.
            The results keep it.
        seed: Another name of `rng`.
        observe: Quantities, as for `integrate`.
        observe_every: Steps between observations; by default there are about a thousand. The start and the last step
            are always observed.
        change: The values in the statistics: None, the quantities themselves; ``"absolute"``, their changes
            E(t) − E(0) since the start of the member; ``"relative"``, E(t)/E(0) − 1. Or a mapping from quantities.
        keep: The number of members, the first ones, whose observations are returned individually.
        final: Whether to return the last state of each member.
        parts, compensated, split, solver, average_nodes: As for `stepper`.
        executor: ``"threads"``, ``"processes"``, or an executor: of `concurrent.futures`, or `cluster_executor`.
        workers: The number of threads or processes; by default the number of cores.
        checkpoint: A folder for finished blocks of members; a later call with the same arguments resumes from it.
        progress: Called with the number of finished members and the total.

    Returns:
        The statistics. Failed members are listed, and count up to their failure. Members whose worker was lost are run
        again, by process pools created here and by Dask.

    Raises:
        IntegratorError: An argument is invalid, the folder belongs to another ensemble, or workers are lost again and
            again.

    Warns:
        RuntimeWarning: A quantity, or its relative change, was not finite.

    Example:
        >>> import bseries as bs
        >>> pendulum = bs.scene("pendulum")
        >>> result = bs.ensemble(
        ...     "stormer-verlet", pendulum, h=0.1, steps=100, sample=bs.runs.perturbed_start(pendulum, 0.1), members=20,
        ...     change="absolute", observe_every=50,
        ... )
        >>> result.t, result.count
        (array([ 0., 5., 10.]), array([20, 20, 20]))
        >>> bool(0 < result.std["energy"][-1] < 1e-3)
        True

    References:
        E. Hairer, lecture on long-time behaviour, figure 8 (statistics of energy errors over 400 trajectories).
    """
    method = as_method(method)
    scene = as_scene(scene)
    if not isinstance(executor, Executor) and executor not in KINDS:
        what = f"executor must be {', '.join(map(repr, KINDS))} or a concurrent.futures.Executor"
        raise IntegratorError(f"{what}, but was {shorten(repr(executor))}")
    _check_workers(workers)
    numerics = dict[str, Any](compensated=compensated, split=split, solver=solver, average_nodes=average_nodes)
    compiled, observer = stepper(method, scene, parts=parts, **numerics), observers(scene, observe)
    origin = compiled.start([0.0] * scene.dimension, h=h, t0=t0)
    steps = step_count(h, steps, span)
    check_end(origin.t0, origin.h, steps)
    every = max(1, steps // TIMES) if observe_every is None else _whole(observe_every, "observe_every", 1)
    starts, count = _starts(y0, sample, members, scene.dimension)
    work = Members(
        scene, compiled.method, origin.h, steps, origin.t0, {"parts": parts, **numerics}, observer, every,
        _changes(change, observer.names), sample, _read_seed(rng, seed), _whole(keep, "keep", 0), bool(final),
    )  # fmt: skip
    _check_memory(work, count)
    options = {"h": work.h, "t0": work.t0, "steps": steps, "observe_every": every, **numerics, "members": count}
    options |= {"seed": None if sample is None else work.seed, "change": work.change}
    options |= {"keep": work.keep, "final": work.final}
    same = identity(compiled, observer, options, _fingerprint(work, starts, count))
    if executor != "threads" and not isinstance(executor, ThreadPoolExecutor):
        _ = work.packed  # refused here if it cannot be pickled
    folder = None if checkpoint is None else block_folder(checkpoint, same)
    show = check_progress(progress)
    compute = partial(results_in_order, executor, workers, Members.block, stop=work.stop)
    with closing(_blocks(work, starts, count, folder, compute, show)) as blocks:
        whole = merged_blocks(blocks)
    t = work.t0 + work.h * work.step_numbers
    result = EnsembleResult(t, observer.names, whole, description(compiled, observer, options))
    for name, mean in result.mean.items():
        for k in np.flatnonzero((result.count > 0) & ~np.isfinite(mean))[:1]:
            at = f"the mean over members was {mean[k]} at t = {t[k]:g}"
            message = f"{name} must be finite at the states that are observed, but {at}"
            warn_user(message, RuntimeWarning)
    return result


def _read_seed(rng: object, seed: object) -> int:
    """The seed of the members, from what SPEC 7 of Scientific Python allows, or by its older name."""
    if seed is not None:
        return _whole(seed, "seed", 0)
    if rng is None or isinstance(rng, np.random.Generator):
        return int(np.random.default_rng(rng).integers(2**63))
    return _whole(rng, "rng", 0)


def _starts(y0: object, sample: object, members: object, dimension: int) -> tuple[np.ndarray | None, int]:
    """The starts (None: to be drawn), and the number of members."""
    if (y0 is None) == (sample is None):
        given = "neither" if y0 is None else "both"
        raise IntegratorError(f"an ensemble must have either y0 or sample, but had {given}")
    if y0 is None:
        if not callable(sample):
            raise IntegratorError(f"sample must be a function of a generator, but was {shorten(repr(sample))}")
        return None, _whole(members, "members", 1)
    starts = read_array(y0)
    if starts.ndim != 2 or starts.shape[-1] != dimension or not len(starts):
        raise IntegratorError(f"y0 must have a row of {dimension} numbers for each member, but was {shorten(repr(y0))}")
    if members not in (None, len(starts)):
        raise IntegratorError(
            f"members must be the number of rows of y0, {len(starts)}, but was {shorten(repr(members))}"
        )
    return starts, len(starts)


def _whole(value: object, argument: str, least: int) -> int:
    return read_whole(value, argument, f"an integer from {least} on", least, sys.maxsize)


def _changes(change: Any, names: Sequence[str]) -> list[str | None]:
    """The kind of change for each quantity."""
    given = change if isinstance(change, Mapping) else dict.fromkeys(names, change)
    for name, kind in given.items():
        if name not in names:
            raise IntegratorError(f"change must be of {shorten(', '.join(names))}, but was of {shorten(repr(name))}")
        if kind not in CHANGES:
            raise IntegratorError(f"change must be None, 'absolute' or 'relative', but was {shorten(repr(kind))}")
    return [given.get(name) for name in names]


def _check_memory(work: Members, count: int) -> None:
    """Refuse ensembles that would not fit in memory: statistics of finished blocks, series, and last states."""
    values = OutputSteps(work.observe_every).count(work.steps) * len(work.observers)
    waiting = len(Statistics._fields) * min(count, 2 * BLOCKS)
    rows = 2 * (values * min(work.keep, count) + work.final * count * work.scene.dimension)  # in blocks, and merged
    refuse_beyond_memory(
        8 * (values * waiting + rows + BOOKKEEPING * count), IntegratorError,
        "observe_every must be larger, or members, keep and final less: an ensemble",
    )  # fmt: skip


def _fingerprint(work: Members, starts: np.ndarray | None, count: int) -> str:
    """A hash of the starts (if drawn, the first and the last) and of one step, which identifies functions of the user.

    The step also compiles everything before workers start.
    """
    observer, digest = work.observers, hashlib.sha256(b"" if starts is None else starts.tobytes())
    reasons: list[str] = []
    for member in (0, count - 1):
        try:
            state = work.start(member, None if starts is None else starts[member])
        except Exception as error:  # a function of the user may raise anything
            reasons.append(f"{type(error).__name__}: {error}")
            continue
        observer.check(state.t, state.y)
        row = np.zeros((1, len(observer)))
        digest.update(state.y.tobytes() + observer(state.t, state.y).tobytes())
        with suppress(StepError):
            work.stepper.record(state, 1, o_every=1 if observer else 0, observer=observer.address, o_rows=row)
        digest.update(state.y.tobytes() + row.tobytes())
    if len(reasons) == 2:
        what = "y0" if work.sample is None else "sample"
        raise IntegratorError(f"{what} must give starts, but the first member has none: {shorten(reasons[0], 200)}")
    return digest.hexdigest()


def _blocks(
    work: Members, starts: np.ndarray | None, count: int, folder: str | None,
    compute: Callable[[Sequence[tuple[object, ...]]], Generator[Block, None, None]],
    progress: Callable[[int, int], object] | None,
) -> Generator[Block, None, None]:  # fmt: skip
    """All blocks in order; their size, a power of two, depends on `count` alone."""
    size = 1 << (-(-count // BLOCKS) - 1).bit_length()
    spans = [range(first, min(first + size, count)) for first in range(0, count, size)]
    stored = [load_block(folder, number, work.sizes(span)) for number, span in enumerate(spans)]
    missing = [span for span, block in zip(spans, stored, strict=True) if block is None]
    tasks = [(work, span, None if starts is None else starts[span.start : span.stop]) for span in missing]
    with closing(compute(tasks)) as results:
        for number, span in enumerate(spans):
            block, stored[number] = stored[number], None
            if block is None:
                block = next(results)
                save_block(folder, number, block)
            if progress is not None:
                progress(span.stop, count)
            yield block


def results_in_order(
    executor: Executor | str, workers: int | None, function: Callable[..., T], tasks: Sequence[tuple[object, ...]],
    stop: Callable[[], object] = lambda: None,
) -> Generator[T, None, None]:  # fmt: skip
    """Results of a function for the arguments of each task, in the order of the tasks.

    If workers of a pool created here are lost, a new one runs the unfinished tasks; other executors stay open, and
    repeat tasks themselves, if at all. At the end, however it comes, `stop` cancels what runs in threads, for which a
    pool waits.
    """
    losses, distributed = 0, loaded_module("distributed")
    lost = (BrokenExecutor,) if distributed is None else (BrokenExecutor, distributed.KilledWorker)
    while tasks:
        try:
            with _opened(executor, workers) as pool, ExitStack() as ended:
                ended.callback(stop)  # before the pool waits
                for result in ended.enter_context(closing(mapped(pool, function, *zip(*tasks, strict=True)))):
                    yield result
                    tasks, losses = tasks[1:], 0
        except lost as error:
            losses += 1
            if isinstance(executor, Executor) or losses == MOST_LOSSES:
                raise IntegratorError(
                    "executor must have working processes, but they ended (a script must start its work under "
                    f"`if __name__ == '__main__':`): {shorten(str(error), 200)}"
                ) from None


@contextmanager
def _opened(executor: Executor | str, workers: int | None) -> Iterator[Any]:
    """The executor given, or a pool of threads or of spawned processes; a fork would copy locks of other threads."""
    if isinstance(executor, Executor):
        yield executor
        return
    count, children = workers or available_cores(), None
    if executor == "threads":
        pool: Executor = ThreadPoolExecutor(count)
    else:
        from concurrent.futures import ProcessPoolExecutor

        children = Children()
        pool = ProcessPoolExecutor(count, children, end_with_parent)
    try:
        yield pool
    except BaseException:  # nobody waits for what is running
        pool.shutdown(wait=False, cancel_futures=True)
        if children is not None:
            children.end()
        raise
    finally:
        pool.shutdown(cancel_futures=True)  # Python 3.11 prints a traceback if a pool breaks with cancelled tasks


def _check_workers(workers: object) -> None:
    """Refuse numbers of workers that are not positive."""
    if workers is not None and (type(workers) is not int or workers < 1):
        raise IntegratorError(f"workers must be a positive integer, but was {shorten(repr(workers))}")


def available_cores() -> int:
    """The number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def cluster_executor(address: str | None = None, *, workers: int | None = None) -> Iterator[Executor]:
    """An executor on a Dask cluster, local or remote, which repeats the tasks of lost workers.

    Args:
        address: The address of a scheduler, such as ``"tcp://10.0.0.1:8786"``; by default a local cluster is started,
            and stopped at the end.
        workers: The number of processes of a local cluster; by default the number of cores available to this process.

    Yields:
        The executor, for `ensemble` and every other function that accepts one.

    Raises:
        IntegratorError: Dask is not installed, there is no scheduler at the address, or both arguments are given.

    Example:
        >>> import bseries as bs
        >>> options = {"h": 0.01, "steps": 10**6, "y0": [[0, 2, 0.4, 0], [0, 1.9, 0.4, 0]]}
        >>> with bs.runs.cluster_executor("tcp://10.0.0.1:8786") as cluster:  # doctest: +SKIP
        ...     result = bs.ensemble("gauss3", "kepler", **options, executor=cluster)

    References:
        M. Rocklin, Proc. 14th Python in Science Conf. (2015) 126–132, doi:10.25080/Majora-7b98e3ed-013.
    """
    distributed = optional_module("distributed", "a cluster")
    _check_workers(workers)
    if address is not None and workers is not None:
        raise IntegratorError("workers must be left out where a scheduler has its own, but was given")
    options: Any = {"threads_per_worker": 1, "dashboard_address": ":0", "memory_limit": 0, "silence_logs": 50}
    with ExitStack() as opened:
        cluster: Any = address
        if address is None:
            count = workers or available_cores()
            opened.enter_context(safe_path())  # for as long as lost workers are replaced
            start_tracker()
            with uninterrupted():
                cluster = opened.enter_context(distributed.LocalCluster(n_workers=count, **options))
        try:
            client = opened.enter_context(distributed.Client(cluster, timeout="10s"))
        except (OSError, ValueError, TypeError) as error:
            reason = shorten(str(error) or type(error).__name__, 120)
            raise IntegratorError(
                f"scheduler must be the address of one that runs, but was {shorten(repr(address))}: {reason}"
            ) from None
        yield client.get_executor(pure=False)
