"""Ensembles: runs of one method on one scene from many starts, on all cores or a cluster."""

from __future__ import annotations

import hashlib
import operator
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from itertools import chain
from typing import TYPE_CHECKING, Any

from foundation.memory import refuse_beyond_memory
from integrators.core.arguments import check_end, read_array, read_whole
from integrators.core.errors import IntegratorError, shorten
from integrators.runs.checkpoints import description, identity
from integrators.runs.ensemble_members import Block, Members, Settings, block_sizes, lost_block, run_block
from integrators.runs.ensemble_results import BlockFolder, EnsembleResult
from integrators.runs.ensemble_statistics import Gathering, Statistics
from integrators.runs.executors import Workers
from integrators.runs.integration import OutputSteps
from integrators.runs.observers import observers
from integrators.steppers.states import StepError
from integrators.steppers.stepping import stepper

if TYPE_CHECKING:
    import numpy as np

    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene

BLOCKS = 64
"""Approximate number of blocks: enough to balance the load, few enough that their statistics take little memory."""
BOOKKEEPING = 2
"""List entries for each member: its start in the tasks, and in a worker."""
TIMES = 1000
"""Approximate number of observations by default."""
CHANGES = (None, "absolute", "relative")


def ensemble(
    scene: Scene,
    method: Method | str,
    *,
    h: float,
    steps: int,
    y0: Any = None,
    sample: Callable[[np.random.Generator], Any] | None = None,
    members: int | None = None,
    seed: int = 0,
    t0: float = 0.0,
    observe: Any = "energy",
    observe_every: int | None = None,
    change: str | Mapping[str, str] | None = None,
    keep: int = 0,
    final: bool = False,
    parts: Mapping[str, Any] | None = None,
    compensated: bool = True,
    split: bool = True,
    solver: str = "auto",
    average_nodes: int | None = None,
    executor: Executor | str = "threads",
    workers: int | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> EnsembleResult:
    """Integrate a scene from many starts, and return statistics of the observed quantities.

    Results do not depend on the executor, the number of workers, or the order in which they finish: each member has its
    own random numbers, and statistics are merged along a fixed tree. Each member agrees to the last bit with
    `integrate` from its start. (Different processors may round differently.)

    Args:
        scene: The scene.
        method: The method, or its name.
        h: The step size.
        steps: The number of steps of each member.
        y0: The starts, (members, variables), unless `sample` is given.
        sample: A function that draws a start, (variables,), from a NumPy generator: `thermal_momenta`,
            `perturbed_start`, or your own. Member k gets the generator of ``SeedSequence(seed).spawn(…)[k]``.
        members: The number of members; required with `sample`.
        seed: The seed of the random numbers, 0 or more.
        t0: The time at the start.
        observe: Quantities, as for `integrate`.
        observe_every: Steps between observations; by default there are about a thousand. The start and the last step
            are always observed.
        change: The values in the statistics: None, the quantities themselves; ``"absolute"``, their changes
            E(t) − E(0) since the start of the member; ``"relative"``, E(t)/E(0) − 1. Or a mapping from quantities.
        keep: The number of members, the first ones, whose observations are returned individually.
        final: Whether to return the last state of each member.
        parts: The parts of the scene that the parts of the method stand for; see `stepper`.
        compensated: Whether to use compensated summation.
        split: Whether to split the coefficients of implicit methods, so that their rounding causes no drift.
        solver: The solver for implicit stages; see `stepper`.
        average_nodes: The number of quadrature nodes for averages of the field; see `stepper`.
        executor: ``"threads"``, ``"processes"``, or an executor: of `concurrent.futures`, or `cluster_executor`.
        workers: The number of threads or processes; by default the number of cores.
        checkpoint: A folder for finished blocks of members; a later call with the same arguments resumes from it.
        progress: Called with the number of finished members and the total.

    Returns:
        The statistics. Failed members are listed, and count up to their failure; a member whose worker was lost is run
        again.

    Raises:
        IntegratorError: An argument is invalid, or the folder belongs to another ensemble.

    Warns:
        RuntimeWarning: A quantity, or its relative change, was not finite.

    Example:
        >>> from integrators import scene
        >>> from integrators.runs.random_starts import perturbed_start
        >>> pendulum = scene("pendulum")
        >>> result = ensemble(
        ...     pendulum, "stormer-verlet", h=0.1, steps=100, sample=perturbed_start(pendulum, 0.1), members=20,
        ...     change="absolute", observe_every=50,
        ... )
        >>> result.t, result.count
        (array([ 0., 5., 10.]), array([20, 20, 20]))
        >>> bool(0 < result.std["energy"][-1] < 1e-3)
        True

    References:
        E. Hairer, lecture on long-time behaviour, figure 8 (statistics of energy errors over 400 trajectories).
    """
    numerics = dict[str, Any](compensated=compensated, split=split, solver=solver, average_nodes=average_nodes)
    compiled, observer = stepper(scene, method, parts=parts, **numerics), observers(scene, observe)
    origin = compiled.start([0.0] * scene.dimension, h=h, t0=t0)
    steps = _whole(steps, "steps", 0)
    check_end(origin.t0, origin.h, steps)
    every = max(1, steps // TIMES) if observe_every is None else _whole(observe_every, "observe_every", 1)
    starts, count = _starts(y0, sample, members, scene.dimension)
    work = Members(
        scene, compiled.method, origin.h, steps, origin.t0, {"parts": parts, **numerics}, observer, every,
        _changes(change, observer.names), sample, _whole(seed, "seed", 0), _whole(keep, "keep", 0), bool(final),
    )  # fmt: skip
    s = work.settings
    _check_memory(s, count)
    options = {"h": s.h, "t0": s.t0, "steps": steps, "observe_every": every, **numerics, "members": count}
    options |= {"seed": s.seed if starts is None else None, "change": list(s.change), "keep": s.keep, "final": s.final}
    same = {**identity(compiled, observer, options, origin), "steps": steps, "start": _fingerprint(work, starts, count)}
    folder = None if checkpoint is None else BlockFolder(checkpoint, same)
    spans = _spans(count)
    with Workers(executor, workers) as pool:
        try:
            whole = _merged_blocks(_blocks(pool, work, starts, spans, folder), spans, progress)
        finally:
            work.is_stopped = True
    result = EnsembleResult(
        s.t0 + s.h * work.step_numbers, observer.names, whole, description(compiled, observer, options)
    )
    _warn_of_nonfinite_means(result)
    return result


def _warn_of_nonfinite_means(result: EnsembleResult) -> None:
    """Warn of the first time at which the mean of a quantity is not finite."""
    import numpy as np

    for name, mean in result.mean.items():
        gaps = np.flatnonzero((result.count > 0) & ~np.isfinite(mean))
        if gaps.size:
            at = f"the mean over members was {mean[gaps[0]]} at t = {result.t[gaps[0]]:g}"
            message = f"{name} must be finite at the states that are observed, but {at}"
            warnings.warn(message, RuntimeWarning, stacklevel=3)


def _starts(y0: Any, sample: Any, members: Any, dimension: int) -> tuple[np.ndarray | None, int]:
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


def _whole(value: Any, argument: str, least: int) -> int:
    return read_whole(value, argument, f"an integer from {least} on", least, sys.maxsize)


def _changes(change: Any, names: Sequence[str]) -> tuple[str | None, ...]:
    """The kind of change for each quantity."""
    given = change if isinstance(change, Mapping) else dict.fromkeys(names, change)
    for name, kind in given.items():
        if name not in names:
            raise IntegratorError(f"change must be of {shorten(', '.join(names))}, but was of {shorten(repr(name))}")
        if kind not in CHANGES:
            raise IntegratorError(f"change must be None, 'absolute' or 'relative', but was {shorten(repr(kind))}")
    return tuple(given.get(name) for name in names)


def _check_memory(s: Settings, count: int) -> None:
    """Refuse ensembles that would not fit in memory: series, last states, unmerged statistics, lists of starts."""
    values = OutputSteps(s.observe_every).count(s.steps) * len(s.observers)
    waiting = len(Statistics._fields) * min(count, 2 * BLOCKS.bit_length())
    rows = 2 * (values * min(s.keep, count) + s.final * count * s.scene.dimension)  # in blocks, and merged
    refuse_beyond_memory(
        8 * (values * waiting + rows + BOOKKEEPING * count), IntegratorError,
        "observe_every must be larger, or members, keep and final less: an ensemble",
    )  # fmt: skip


def _fingerprint(work: Members, starts: np.ndarray | None, count: int) -> str:
    """A hash of the starts (if drawn, the first and the last) and of one step, which identifies functions of the user.

    The step also compiles everything before workers start.

    Raises:
        IntegratorError: Neither the first member nor the last can start.
    """
    import numpy as np

    s, digest = work.settings, hashlib.sha256(b"" if starts is None else starts.tobytes())
    reasons: list[str] = []
    for member in (0, count - 1):
        try:
            state = work.start(member, None if starts is None else starts[member])
        except Exception as error:  # a function of the user may raise anything
            reasons.append(f"{type(error).__name__}: {error}")
            continue
        s.observers.check(state.t, state.y)
        row = np.zeros((1, len(s.observers)))
        digest.update(state.y.tobytes() + s.observers(state.t, state.y).tobytes())
        with suppress(StepError):
            work.stepper.record(state, 1, o_every=1 if s.observers else 0, observer=s.observers.address, o_rows=row)
        digest.update(state.y.tobytes() + row.tobytes())
    if len(reasons) == 2:
        what = "y0" if s.sample is None else "sample"
        raise IntegratorError(f"{what} must give starts, but the first member has none: {shorten(reasons[0], 200)}")
    return digest.hexdigest()


def _spans(count: int) -> list[range]:
    """Blocks of members, whose size depends on `count` alone: a power of two, so that each is a subtree."""
    size = 1 << (-(-count // BLOCKS) - 1).bit_length()
    return [range(first, min(first + size, count)) for first in range(0, count, size)]


def _blocks(
    pool: Workers, work: Members, starts: np.ndarray | None, spans: Sequence[range], folder: BlockFolder | None
) -> Iterator[tuple[int, Block]]:
    """All blocks and their numbers, in the order in which they finish."""
    tasks = []
    for number, span in enumerate(spans):
        block = None if folder is None else folder.load(number, block_sizes(work, span))
        if block is not None:
            yield number, block
        else:
            own = [None] * len(span) if starts is None else starts[span.start : span.stop]
            tasks.append((number, work, span.start, own))
    if tasks and not pool.share_memory:
        _ = work.packed  # refused here if it cannot be pickled
    for number, block in pool.run(run_block, tasks):
        if block is None:
            block = lost_block(work, spans[number].start, len(spans[number]))
        elif folder is not None:
            folder.save(number, block)
        yield number, block


def _merged_blocks(
    blocks: Iterator[tuple[int, Block]], spans: Sequence[range], progress: Callable[[int, int], None] | None
) -> Block:
    """Merge all blocks into one."""
    import numpy as np

    gathering, done, found = Gathering(len(spans)), 0, list[tuple[Any, ...]]()
    for number, block in blocks:
        gathering.add(number, block.statistics)
        found.append((number, block.series, block.ends, block.failures))
        done += len(spans[number])
        if progress is not None:
            progress(done, spans[-1].stop)
    _, series, ends, failures = zip(*sorted(found, key=operator.itemgetter(0)), strict=True)
    assert gathering.total is not None
    return Block(gathering.total, np.concatenate(series), np.concatenate(ends), tuple(chain.from_iterable(failures)))
