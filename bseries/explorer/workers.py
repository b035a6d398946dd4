"""Worker processes of the server. A worker that exceeds the bounds of time or memory is replaced."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Hashable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import TypeVar

from bseries.exceptions import SeriesError
from bseries_base.children import Children, end_with_parent

T = TypeVar("T")
SECONDS = 30.0
"""Time limit of a request. It includes the start of a worker and the compilation of machine code at first use."""
WAITING = 60.0
"""Longest time to wait for a free worker, in seconds."""
BYTES = 3 * 2**30
"""Memory limit of a worker."""


class NotComputed(SeriesError):
    """A request that took too long, ended its process or found no free worker. Repeating it may succeed."""


class Worker:
    """A process that answers one request at a time.

    Example:
        >>> from bseries.explorer.reading import read_integer
        >>> worker = Worker()
        >>> worker.ask(read_integer, "7", "order", 5, 8)
        7
        >>> worker.stop()
    """

    def __init__(self) -> None:
        self.seen: set[Hashable] = set()
        self._is_stopped = False
        self._start()

    def _start(self) -> None:
        children = Children()
        self._pipe, theirs = children.Pipe()
        self._process = children.Process(target=_work, args=(theirs, BYTES), daemon=True)
        self._process.start()
        theirs.close()
        self.seen.clear()

    def ask(self, function: Callable[..., T], *arguments: object, seconds: float = SECONDS) -> T:
        """The value of a function, computed in the process.

        Raises:
            SeriesError: The function refused its arguments, took too long or needed too much memory.
        """
        try:
            self._pipe.send((function, arguments))
            if not self._pipe.poll(seconds):
                self._restart()
                raise NotComputed(
                    f"request must take at most {seconds:g} s, but took longer: fewer nodes, a shorter time or a "
                    "smaller method may do"
                )
            is_value, answer = self._pipe.recv()
        except (EOFError, OSError):
            self._restart()
            raise NotComputed("request must not end its process, but did, perhaps for want of memory") from None
        if not is_value:
            raise SeriesError(answer)
        return answer

    def _restart(self) -> None:
        if not self._is_stopped:
            self._end()
            self._start()

    def stop(self) -> None:
        """End the process, even during a request."""
        self._is_stopped = True
        self._end()

    def _end(self) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()


def _work(pipe: Connection, most_bytes: int) -> None:
    """Answer requests until the other end of the pipe is closed."""
    from bseries import errors

    end_with_parent()
    with suppress(ImportError, OSError, ValueError):
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, most_bytes))
    while True:
        try:
            function, arguments = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            answer = True, function(*arguments)
        except errors as error:
            answer = False, str(error)
        except MemoryError:
            answer = False, "request must need less memory than there is"
        except Exception as error:  # the page reports it, and the server goes on
            answer = False, f"request could not be computed ({type(error).__name__}: {error})"
        try:
            pipe.send(answer)
        except OSError:
            return
        except Exception as error:
            pipe.send((False, f"request could not be sent back ({type(error).__name__}: {error})"))


class Workers:
    """Several workers and a queue for them. A free worker that has computed for a key before is preferred for it."""

    def __init__(self, count: int = 2):
        self._idle = [Worker() for _ in range(count)]
        self._all = tuple(self._idle)
        self._free = asyncio.Semaphore(count)

    async def ask(self, key: Hashable, function: Callable[..., T], *arguments: object) -> T:
        """The value of a function, computed in one of the processes.

        Raises:
            SeriesError: As for `Worker.ask`; or no worker became free in time.
        """
        try:
            await asyncio.wait_for(self._free.acquire(), WAITING)
        except TimeoutError:
            raise NotComputed(f"server must be free within {WAITING:g} s, but was busy: try again") from None
        worker = next((worker for worker in self._idle if key in worker.seen), self._idle[0])
        self._idle.remove(worker)
        answer = asyncio.get_running_loop().run_in_executor(None, lambda: worker.ask(function, *arguments))

        def release(_: asyncio.Future[T]) -> None:
            worker.seen.add(key)
            self._idle.append(worker)
            self._free.release()

        answer.add_done_callback(release)
        return await asyncio.shield(answer)  # if the client disconnects, the worker stays busy until the end

    def close(self) -> None:
        """End all processes."""
        for worker in self._all:
            worker.stop()
