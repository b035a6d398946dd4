"""Executors: threads, processes or a cluster, with tasks repeated when workers are lost."""

from __future__ import annotations

import os
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager
from typing import Any, TypeVar

from foundation.extras import how_to_install
from integrators.core.errors import IntegratorError, shorten

T = TypeVar("T")

KINDS = ("threads", "processes")
MOST_LOSSES = 3
"""Number of workers that a task may lose, and of times that workers which never finished a task are replaced."""


class Workers:
    """An executor that repeats tasks whose workers are lost; to be used in a `with` statement.

    Args:
        executor: ``"threads"`` or ``"processes"`` for a new pool, or any `concurrent.futures.Executor`, which stays
            open.
        count: The number of workers; by default the number of cores available to this process.

    Raises:
        IntegratorError: `executor` is not an executor, or `count` is not positive.
    """

    def __init__(self, executor: Executor | str, count: int | None = None):
        if not isinstance(executor, Executor) and executor not in KINDS:
            what = f"executor must be {', '.join(map(repr, KINDS))} or a concurrent.futures.Executor"
            raise IntegratorError(f"{what}, but was {shorten(repr(executor))}")
        _check_workers(count)
        self._kind = executor if isinstance(executor, str) else "processes"
        self._given = executor if isinstance(executor, Executor) else None
        self._count = count or getattr(executor, "_max_workers", None) or available_cores()
        self._own: Executor | None = None
        self._replaced = 0

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        if self._own is not None:
            self._own.shutdown(cancel_futures=True)

    @property
    def executor(self) -> Executor:
        """The present executor."""
        if self._given is not None:
            return self._given
        if self._own is None:
            self._own = _pool(self._kind, self._count)
        return self._own

    @property
    def share_memory(self) -> bool:
        """Whether workers are threads of this process."""
        from concurrent.futures import ThreadPoolExecutor

        return isinstance(self.executor, ThreadPoolExecutor)

    @property
    def _most_at_once(self) -> int:
        """The number of tasks submitted at once: all of them to a scheduler, which distributes them itself."""
        is_scheduler = self._given is not None and not hasattr(self._given, "_max_workers")
        return sys.maxsize if is_scheduler else 2 * self._count

    def run(self, function: Callable[..., T], tasks: Iterable[tuple[Any, ...]]) -> Iterator[tuple[Any, T | None]]:
        """Call a function with the arguments of each task.

        A task whose worker is lost is repeated after all others, alone, so that a task that kills its workers harms no
        other.

        Args:
            function: The function.
            tasks: Arguments; the first one identifies the task.

        Yields:
            The first argument of each task and its result, as they finish; None for a task that lost `MOST_LOSSES`
            workers.

        Raises:
            IntegratorError: Workers are lost before any of them has finished a task.
            Exception: Any error of the function.
        """
        waiting, running = deque(tasks), dict[Future[T], tuple[Any, ...]]()
        losses, is_proven = Counter[Any](), False
        try:
            while waiting or running:
                while waiting and len(running) < (1 if losses[waiting[0][0]] else self._most_at_once):
                    task = waiting.popleft()
                    running[self._submit(function, task)] = task
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    task = running.pop(future)
                    try:
                        result = future.result()
                    except _loss() as error:
                        losses[task[0]] += 1
                        if not is_proven and self._replaced >= MOST_LOSSES:
                            raise _lost_from_the_start(error) from None
                        if losses[task[0]] < MOST_LOSSES:
                            waiting.append(task)
                        else:
                            yield task[0], None
                    else:
                        is_proven = True
                        yield task[0], result
        finally:
            for future in running:
                future.cancel()

    def _submit(self, function: Callable[..., T], task: tuple[Any, ...]) -> Future[T]:
        try:
            return self.executor.submit(function, *task)
        except BrokenExecutor:
            if self._own is not None:
                self._own.shutdown()
            self._given, self._own = None, None
            self._replaced += 1
            return self.executor.submit(function, *task)


def available_cores() -> int:
    """The number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _check_workers(count: Any) -> None:
    if count is not None and (type(count) is not int or count < 1):
        raise IntegratorError(f"workers must be a positive integer, but was {shorten(repr(count))}")


def _pool(kind: str, count: int) -> Executor:
    """A pool of threads, or of spawned processes: a fork would copy the locks of other threads."""
    from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
    from multiprocessing import get_context

    if kind == "threads":
        return ThreadPoolExecutor(count)
    return ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=_end_when_interrupted)


def _end_when_interrupted() -> None:
    """Let Ctrl-C end a worker without a traceback: the parent reports it."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _loss() -> tuple[type[BaseException], ...]:
    """The exceptions for a lost worker."""
    distributed = sys.modules.get("distributed")
    return (BrokenExecutor,) if distributed is None else (BrokenExecutor, distributed.KilledWorker)


def _lost_from_the_start(error: BaseException) -> IntegratorError:
    return IntegratorError(
        "executor must have workers that live, but they died before they had done anything "
        f"(a script must start its work under `if __name__ == '__main__':`): {shorten(str(error), 200)}"
    )


@contextmanager
def cluster_executor(address: str | None = None, *, workers: int | None = None) -> Iterator[Executor]:
    """An executor on a Dask cluster, local or remote.

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
        ...     result = ensemble(scene("kepler"), "gauss3", h=0.01, steps=10**6, y0=starts, executor=cluster)

    References:
        M. Rocklin, Proc. 14th Python in Science Conf. (2015) 126–132, doi:10.25080/Majora-7b98e3ed-013.
    """
    try:
        import dask.config
        from distributed import Client, LocalCluster
    except ImportError:
        raise IntegratorError(
            f"distributed must be installed to use a cluster ({how_to_install('cluster')}), but was not"
        ) from None
    _check_workers(workers)
    if address is not None:
        if workers is not None:
            raise IntegratorError("workers must be left out where a scheduler has its own, but was given")
        with _client(Client, address) as client:
            yield client.get_executor(pure=False)
        return
    options = {"threads_per_worker": 1, "dashboard_address": ":0", "memory_limit": 0, "silence_logs": 50}
    # Without profiles a hundred times a second and memory checks ten times a second.
    with (
        dask.config.set({"distributed.worker.profile.enabled": False}),
        LocalCluster(n_workers=workers or available_cores(), **options) as cluster,  # type: ignore[arg-type]
        Client(cluster) as client,
    ):
        yield client.get_executor(pure=False)


def _client(kind: type[Any], address: str) -> Any:
    try:
        return kind(address, timeout="10s")
    except (OSError, ValueError, TypeError) as error:
        reason = shorten(str(error) or type(error).__name__, 120)
        raise IntegratorError(
            f"scheduler must be the address of one that runs, but was {shorten(repr(address))}: {reason}"
        ) from None
