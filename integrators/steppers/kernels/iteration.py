"""When a fixed-point iteration is over: changes as the bits of doubles, and how small they must be."""

from __future__ import annotations

from integrators.compile.machine import DOUBLE, DOUBLES, TRUTH, WHOLE, bits, inlined_as, value_of

STAGNATION = 2.0**-39
"""The relative size of changes below which an iteration that does not go on has converged (plain steps: ε^(3/4))."""
STALLS = 8
"""After so many sweeps that brought no change nearer to zero, all that is left is what rounding of the state does."""
BITS_OF_INFINITY = 0x7FF0000000000000


@inlined_as(TRUTH, WHOLE)
def failed(change):
    """Whether the bits of a change are those of infinity or nan."""
    return change >= BITS_OF_INFINITY


@inlined_as(TRUTH, WHOLE, WHOLE, DOUBLE)
def falls(change, before, factor):
    """Whether a change is smaller than the one before by more than a factor."""
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
    """Whether a change of slopes of some size, all as bits, is rounding only: that small next to them, or to y / h."""
    scale = max(abs(h) * value_of(size), value_of(largest(y, first, end)))
    return abs(h) * value_of(change) <= STAGNATION * scale


@inlined_as(TRUTH, WHOLE, DOUBLE, DOUBLES, WHOLE)
def within_rounding(change, h, y, end):
    """Whether a change of slopes, as bits, is no more than rounding errors of the whole state may do to them.

    An angle that has grown to 10⁴ turns is known to its last bit only, which moves slopes that are of size 1. As the
    iteration contracts, h times such a change is about a last bit of the state, which blocks of variables share.
    """
    return abs(h) * value_of(change) <= STAGNATION * value_of(largest(y, 0, end))
