"""Compiling on another core, meanwhile, what is needed later."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

REFERENCE = "import bseries as bs; bs.reference_solution(bs.scene('riccati'), [0.5], full=True)"


@contextmanager
def reference_compiled_ahead() -> Iterator[None]:
    """Let another process compile what reference solutions need; where there is a cache on disk, it is found there.

    Example:
        >>> with reference_compiled_ahead():
        ...     pass
    """
    null = subprocess.DEVNULL
    process = subprocess.Popen([sys.executable, "-c", REFERENCE], stdin=null, stdout=null, stderr=null)
    try:
        yield
    finally:
        process.kill()
        process.wait()
