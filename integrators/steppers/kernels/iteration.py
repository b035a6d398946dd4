"""Stopping criteria of iterations, for changes as bits of doubles."""

from __future__ import annotations

from integrators.compile.machine import DOUBLE, DOUBLES, TRUTH, WHOLE, bits, inlined_as, value_of

STAGNATION = 2.0**-39
"""Relative change below which an iteration without progress has converged, ε^(3/4)."""
STALLS = 8
"""Iterations without progress after which rounding errors of the state may explain the changes."""
BITS_OF_INFINITY = 0x7FF0000000000000


@inlined_as(TRUTH, WHOLE)
def failed(change):
    """Whether a change is infinite or nan."""
    return change >= BITS_OF_INFINITY


@inlined_as(TRUTH, WHOLE, WHOLE, DOUBLE)
def falls(change, before, factor):
    """Whether a change has fallen by more than a factor."""
    return factor * value_of(change) < value_of(before)


@inlined_as(WHOLE, DOUBLES, WHOLE, WHOLE)
def largest(values, first, end):
    """The bits of the largest absolute value."""
    found = 0
    for i in range(first, end):
        found = max(found, bits(abs(values[i])))
    return found


@inlined_as(TRUTH, WHOLE, WHOLE, DOUBLE, DOUBLES, WHOLE, WHOLE)
def negligible(change, size, h, y, first, end):
    """Whether a change of stage derivatives is small relative to their size or to y / h."""
    scale = max(abs(h) * value_of(size), value_of(largest(y, first, end)))
    return abs(h) * value_of(change) <= STAGNATION * scale


@inlined_as(TRUTH, WHOLE, DOUBLE, DOUBLES, WHOLE)
def within_rounding(change, h, y, end):
    """Whether rounding errors of the whole state explain a change of stage derivatives.

    The last bit of an angle near 10⁴ periods changes derivatives of size 1. As the iteration contracts, h times such a
    change is about the last bit of the state; the bound is the same for all blocks of variables.
    """
    return abs(h) * value_of(change) <= STAGNATION * value_of(largest(y, 0, end))
