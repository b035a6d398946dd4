"""Which slopes share a work array, because one is not needed any more when the other is computed."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence


def allocate(
    reads: Sequence[Collection[int]],
    writes: Sequence[Collection[int]],
    kept: Iterable[int],
    joined: Mapping[int, int],
) -> dict[int, int]:
    """A register for each slope.

    Args:
        reads: The slopes that each piece of work reads before it writes any.
        writes: The slopes that it writes.
        kept: Slopes that live from step to step and need a register of their own.
        joined: Slopes at the end of a step, and those at the start that take their place in the next one: they get the
            same register if the one is no longer read when the other is written.

    Returns:
        The number of the register of each slope.

    Example:
        Three slopes, each read by the work that computes the next one:

        >>> allocate([[], [0], [1], [2]], [[0], [1], [2], []], [], {})
        {0: 0, 1: 0, 2: 0}
    """
    last = {e: position for position, used in enumerate(reads) for e in used}
    first = {e: position for position, written in reversed(list(enumerate(writes))) for e in written}
    register: dict[int, int] = {}
    for e in kept:
        register.setdefault(e, len(register))
    for end, start in joined.items():
        if end not in register and last.get(start, 0) <= first[end]:
            register[end] = register[start]
    count, free = len(set(register.values())), []
    for position, written in enumerate(writes):
        free += [register[e] for e in register if last.get(e) == position and e not in kept and e not in joined]
        for e in sorted(written):
            if e not in register:
                if free:
                    register[e] = free.pop()
                else:
                    register[e], count = count, count + 1
    return register
