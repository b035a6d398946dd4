"""When a fixed-point iteration is over: changes as the bits of doubles, and how small they must be."""

from __future__ import annotations

from .machine import bits, inlined, value_of

STAGNATION = 2.0**-39
"""The relative size of changes below which an iteration that does not go on has converged (plain steps: ε^(3/4))."""
BITS_OF_INFINITY = 0x7FF0000000000000


@inlined
def failed(change):
    """Whether the bits of a change are those of infinity or nan."""
    return change >= BITS_OF_INFINITY


@inlined
def falls(change, before, factor):
    """Whether a change is smaller than the one before by more than a factor."""
    return factor * value_of(change) < value_of(before)


@inlined
def largest(values, first, end):
    """The bits of the largest absolute value."""
    found = 0
    for i in range(first, end):
        found = max(found, bits(abs(values[i])))
    return found


@inlined
def negligible(change, h, y, first, end, *slopes):
    """Whether a change of slopes, as bits, is rounding only: that small next to the slopes, or next to y / h."""
    size = 0
    for k in slopes:
        size = max(size, largest(k, first, end))
    scale = max(abs(h) * value_of(size), value_of(largest(y, first, end)))
    return abs(h) * value_of(change) <= STAGNATION * scale
