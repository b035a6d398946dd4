"""How much memory this process may still take, and the refusal of work that needs more."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

SMALL = 2**24
"""Bytes that are not worth a look."""
CGROUPS = Path("/sys/fs/cgroup")
OWN_CGROUPS = Path("/proc/self/cgroup")


def refuse_beyond_memory(needed: int, refusal: type[Exception], what: str) -> None:
    """Refuse work before it is started that would not fit in memory.

    Args:
        needed: Bytes that it takes, work arrays and bookkeeping included.
        refusal: The error that is raised.
        what: The beginning of the message, which says what must be smaller, and what "would take … GB of memory".

    Example:
        >>> refuse_beyond_memory(10**21, ValueError, "order must be smaller: a table")
        Traceback (most recent call last):
            ...
        ValueError: order must be smaller: a table would take 1000000000000.0 GB of memory, but ... GB are available
    """
    if needed < SMALL:
        return
    available = available_memory()
    if needed > available:
        raise refusal(
            f"{what} would take {needed / 1e9:.1f} GB of memory, but {max(available, 0) / 1e9:.1f} GB are available"
        )


def available_memory() -> int:
    """Bytes that this process may still take: of the machine, of its control groups, and of its limits (ulimit).

    Example:
        >>> available_memory() > 0
        True
    """
    import psutil

    return min([psutil.virtual_memory().available, *_room_of_limits(), *_room_in_cgroups()])


def _room_of_limits() -> Iterator[int]:
    """What RLIMIT_AS and RLIMIT_DATA leave."""
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


def _room_in_cgroups() -> Iterator[int]:
    """What the limits of the process's control groups leave, of version 1 or 2; file caches can be given up."""
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
