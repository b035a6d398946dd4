"""Executors: threads, processes or a cluster, with results in the order of the tasks."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import closing, contextmanager
from typing import Any, TypeVar

from foundation.extras import optional_module
from integrators.core.errors import IntegratorError, shorten

T = TypeVar("T")

KINDS = ("threads", "processes")
MOST_LOSSES = 3
"""The number of successive pools that may break before a task is finished."""


def results_in_order(
    executor: Executor | str, workers: int | None, function: Callable[..., T], tasks: Sequence[tuple[Any, ...]]
) -> Generator[T, None, None]:
    """Results of a function for the arguments of each task, in the order of the tasks.

    If workers of a pool created here are lost, a new one runs the unfinished tasks; other executors stay open, and
    repeat tasks themselves, if at all.
    """
    losses = 0
    while tasks:
        try:
            with _opened(executor, workers) as pool, closing(pool.map(function, *zip(*tasks, strict=True))) as results:
                for result in results:
                    yield result
                    tasks, losses = tasks[1:], 0
        except _loss() as error:
            losses += 1
            if isinstance(executor, Executor) or losses == MOST_LOSSES:
                raise IntegratorError(
                    "executor must have working processes, but they ended (a script must start its work under "
                    f"`if __name__ == '__main__':`): {shorten(str(error), 200)}"
                ) from None


@contextmanager
def _opened(executor: Executor | str, workers: int | None) -> Iterator[Any]:
    """The executor given, or a pool of threads or of spawned processes; a fork would copy locks of other threads."""
    from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
    from multiprocessing import get_context

    if isinstance(executor, Executor):
        yield executor
        return
    count, context = workers or available_cores(), get_context("spawn")
    is_threads = executor == "threads"
    pool = ThreadPoolExecutor(count) if is_threads else ProcessPoolExecutor(count, context, _end_when_interrupted)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)  # Python 3.11 prints a traceback if a pool breaks with cancelled tasks


def check_executor(executor: Any, workers: Any) -> None:
    """Check the executor and the number of workers."""
    if not isinstance(executor, Executor) and executor not in KINDS:
        what = f"executor must be {', '.join(map(repr, KINDS))} or a concurrent.futures.Executor"
        raise IntegratorError(f"{what}, but was {shorten(repr(executor))}")
    check_workers(workers)


def check_workers(workers: Any) -> None:
    """Refuse numbers of workers that are not positive."""
    if workers is not None and (type(workers) is not int or workers < 1):
        raise IntegratorError(f"workers must be a positive integer, but was {shorten(repr(workers))}")


def available_cores() -> int:
    """The number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _end_when_interrupted() -> None:
    """Let Ctrl-C end a worker without a traceback: the parent reports it."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _loss() -> tuple[type[BaseException], ...]:
    """The exceptions for a lost worker."""
    distributed = sys.modules.get("distributed")
    return (BrokenExecutor,) if distributed is None else (BrokenExecutor, distributed.KilledWorker)


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
        >>> from integrators import scene
        >>> from integrators.runs.ensembles import ensemble
        >>> with cluster_executor("tcp://10.0.0.1:8786") as cluster:  # doctest: +SKIP
        ...     result = ensemble("gauss3", scene("kepler"), h=0.01, steps=10**6, y0=starts, executor=cluster)

    References:
        M. Rocklin, Proc. 14th Python in Science Conf. (2015) 126–132, doi:10.25080/Majora-7b98e3ed-013.
    """
    distributed = optional_module("distributed", "a cluster")
    check_workers(workers)
    if address is not None:
        if workers is not None:
            raise IntegratorError("workers must be left out where a scheduler has its own, but was given")
        try:
            client = distributed.Client(address, timeout="10s")
        except (OSError, ValueError, TypeError) as error:
            reason = shorten(str(error) or type(error).__name__, 120)
            raise IntegratorError(
                f"scheduler must be the address of one that runs, but was {shorten(repr(address))}: {reason}"
            ) from None
        with client:
            yield client.get_executor(pure=False)
        return
    options: Any = {"threads_per_worker": 1, "dashboard_address": ":0", "memory_limit": 0, "silence_logs": 50}
    with (
        distributed.LocalCluster(n_workers=workers or available_cores(), **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client.get_executor(pure=False)
