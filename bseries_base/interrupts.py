"""Interrupts that wait: until threads and processes are started, and until llvmlite has handled an object of LLVM.

A thread whose start is interrupted waits for ever, and so does Python at its end. An object that llvmlite was making or
freeing is freed twice or not at all; the first ends the process.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Executor
from contextlib import _GeneratorContextManager, contextmanager
from types import FrameType
from typing import TypeVar

T = TypeVar("T")
Handler = Callable[[int, FrameType | None], object]

SOON = 0.01
"""Seconds until an interrupt comes again that has come too early."""


def interrupt_soon() -> None:
    """Interrupt this process in a moment."""
    again = threading.Timer(SOON, os.kill, (os.getpid(), signal.SIGINT))
    again.daemon = True
    again.start()


def in_llvmlite(frame: FrameType | None) -> bool:
    """Whether llvmlite is being run, in a frame or in one from which it was called."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith("llvmlite.binding."):
            return True
        frame = frame.f_back
    return False


@contextmanager
def _handling(handle: Callable[[Handler], Handler]) -> Iterator[None]:
    """Replace the handler of interrupts in this block; other threads than the main one never run it."""
    before = signal.getsignal(signal.SIGINT)
    if not callable(before) or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, handle(before))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let an interrupt come after this block; processes and threads that are started in it are never interrupted.

    These inherit the mask. It is not enough for the main thread: other threads, as those of NumPy, take the signal.
    """
    came: list[int] = []
    mask = getattr(signal, "pthread_sigmask", None)  # not on Windows
    try:
        with _handling(lambda before: lambda number, frame: came.append(number)):
            blocked = mask and mask(signal.SIG_BLOCK, {signal.SIGINT})
            try:
                yield
            finally:
                if mask:
                    mask(signal.SIG_SETMASK, blocked)
    finally:
        if came:
            signal.raise_signal(signal.SIGINT)


def outside_llvmlite() -> _GeneratorContextManager[None]:
    """Let interrupts in this block come where llvmlite is not being run."""

    def handle(before: Handler) -> Handler:
        return lambda number, frame: interrupt_soon() if in_llvmlite(frame) else before(number, frame)

    return _handling(handle)


def mapped(pool: Executor, function: Callable[..., T], *arguments: Iterable[object]) -> Generator[T, None, None]:
    """The results of a pool of threads or processes, which are started without interrupts."""
    with uninterrupted():
        return pool.map(function, *arguments)  # pyright: ignore[reportReturnType] (a generator)
