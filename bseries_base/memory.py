"""Available memory, and the refusal of work that would exceed it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

SMALL = 2**24
"""Bytes below which the available memory is not queried."""
CGROUPS = Path("/sys/fs/cgroup")
OWN_CGROUPS = Path("/proc/self/cgroup")


def refuse_beyond_memory(needed: int, refusal: type[Exception], what: str) -> None:
    """Refuse work before it starts if the bytes it needs, with work arrays and bookkeeping, are not available.

    Example:
        >>> refuse_beyond_memory(10**21, ValueError, "order must be smaller: a table")
        Traceback (most recent call last):
            ...
        ValueError: order must be smaller: a table would take 1.0e+12 GB of memory, but ... GB are available
    """
    if needed < SMALL:
        return
    available = available_memory()
    if needed > available:
        gigabytes = f"{needed / 1e9:.1f}" if needed < 10**15 else f"{needed / 1e9:.1e}"
        raise refusal(f"{what} would take {gigabytes} GB of memory, but {max(available, 0) / 1e9:.1f} GB are available")


BROWSER = 2**30
"""Bytes that are assumed to be available in a browser, where psutil is not."""


def available_memory() -> int:
    """Bytes available to this process: of the machine, its control groups and its resource limits (ulimit).

    Example:
        >>> available_memory() > 0
        True
    """
    try:
        import psutil
    except ModuleNotFoundError:  # in a browser
        return BROWSER
    return min([psutil.virtual_memory().available, *_left_by_limits(), *_left_by_cgroups()])


def _left_by_limits() -> Iterator[int]:
    """Bytes left by RLIMIT_AS and RLIMIT_DATA."""
    try:
        import resource
    except ImportError:  # not a POSIX system
        return
    import psutil

    used = psutil.Process().memory_info()
    for limit, taken in ((resource.RLIMIT_AS, used.vms), (resource.RLIMIT_DATA, getattr(used, "data", used.vms))):
        most, _ = resource.getrlimit(limit)
        if most != resource.RLIM_INFINITY:
            yield most - taken


def _left_by_cgroups() -> Iterator[int]:
    """Bytes left by control groups, of version 1 or 2; file caches count as free."""
    try:
        lines = OWN_CGROUPS.read_text().splitlines()
    except OSError:  # not Linux
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            root, files, cache = CGROUPS, ("memory.max", "memory.current"), "file"
        elif "memory" in controllers.split(","):
            root, files, cache = CGROUPS / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes"), "total_cache"
        else:
            continue
        own = root / path.lstrip("/")
        for folder in (own, *own.parents):
            try:
                most, used = (int((folder / file).read_text()) for file in files)
                statistics = dict(row.split() for row in (folder / "memory.stat").read_text().splitlines())
                yield most - used + int(statistics[cache])
            except (OSError, ValueError, KeyError):  # no such group here, or no limit
                pass
            if folder == root:
                break
