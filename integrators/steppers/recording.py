"""C functions that make steps, and store states or observe them, or repeat steps to measure their cost.

The machine code of the steps is called, not inlined: inlined into different loops, sums and products might fuse in
different ways, and storing states would change the run.
"""

from __future__ import annotations

from integrators.compile.c_functions import RECORDED, REPEATED
from integrators.compile.machine import call_observer, call_steps, in_c, shifted
from integrators.steppers.adaptive import TIME


@in_c(RECORDED)
def recorded(
    advance, y, compensation, memory, control, numbers, work, dimension, has_times, h, t0, first, steps, fresh,
    observer, y_every, y_rows, y_width, y_times, y_timed, o_every, o_rows, o_width, o_times, o_timed,
):  # fmt: skip
    """Make steps, store every `y_every`-th state and observe every `o_every`-th; returns the number of steps.

    Args:
        advance: The address of the steps.
        y, compensation, memory, control, numbers, work: Arguments of the steps, of which the first four change.
        dimension: The number of variables.
        has_times: Whether the time is in `control`, because steps vary.
        h: The step size.
        t0: The time at step 0.
        first: The number of earlier steps.
        steps: The number of steps to make.
        fresh: Whether `memory` is still to be computed.
        observer: The address of a C function ``void (double t, double *y, double *out)``.
        y_every: Steps between stored states; 0 stores none.
        y_rows, y_width, y_times, y_timed: An array for states, the length of its rows, and an array for times, if any.
        o_every, o_rows, o_width, o_times, o_timed: The same for observed quantities.
    """
    done, y_row, o_row = 0, 0, 0
    while done < steps:
        n = first + done
        stride = steps - done
        if y_every:
            stride = min(stride, y_every - n % y_every)
        if o_every:
            stride = min(stride, o_every - n % o_every)
        made = call_steps(advance, y, compensation, memory, control, numbers, work, h, stride, fresh)
        fresh = 0
        done += made
        finite = True
        for i in range(dimension):
            finite = finite and y[i] - y[i] == 0.0
        if made < stride or not finite:
            break
        n = first + done
        t = control[TIME] if has_times else t0 + n * h
        if y_every and n % y_every == 0:
            for i in range(dimension):
                y_rows[y_row * y_width + i] = y[i]
            if y_timed:
                y_times[y_row] = t
            y_row += 1
        if o_every and n % o_every == 0:
            call_observer(observer, t, y, shifted(o_rows, o_row * o_width))
            if o_timed:
                o_times[o_row] = t
            o_row += 1
    return done


def copy(source, to, count):
    """Copy numbers."""
    for i in range(count):
        to[i] = source[i]


@in_c(REPEATED)
def repeated(
    advance, begin, begin_compensation, begin_memory, begin_control, y, compensation, memory, control, numbers, work,
    dimension, kept, controls, h, steps, fresh, times,
):  # fmt: skip
    """Repeat steps from the same start, without calls from Python; returns how often all of them succeeded.

    Args:
        advance: The address of the steps.
        begin, begin_compensation, begin_memory, begin_control: The state at the start.
        y, compensation, memory, control: Arrays for the state.
        numbers, work, h, fresh: As above.
        dimension, kept, controls: The numbers of variables, and of entries of `memory` and of `control`.
        steps: The number of steps.
        times: The number of repetitions.
    """
    for done in range(times):
        copy(begin, y, dimension)
        copy(begin_compensation, compensation, dimension)
        copy(begin_memory, memory, kept)
        copy(begin_control, control, controls)
        made = call_steps(advance, y, compensation, memory, control, numbers, work, h, steps, fresh)
        if made < steps:
            return done
    return times
