"""Work on many points shared by threads."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from .exceptions import SeriesError


def in_threads(work: Callable[[slice], Any], size: int, workers: int) -> None:
    """Do the work on slices of all points, in so many threads; compiled code lets them run at the same time."""
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise SeriesError(f"workers must be a whole number ≥ 1, but was {workers!r:.60}")
    if workers == 1:
        work(slice(0, size))
        return
    from concurrent.futures import ThreadPoolExecutor

    share = max(1, math.ceil(size / workers))
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(work, [slice(k, min(k + share, size)) for k in range(0, size, share)]))
