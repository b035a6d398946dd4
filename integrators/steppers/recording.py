"""Compiled loops over steps, which store and observe states."""

from __future__ import annotations

from integrators.compile.machine import call_observer, call_steps, compiled, kept, pointer, shifted
from integrators.steppers.adaptive import TIME


@kept
def recorded(
    advance, state, compensation, memory, control, numbers, work, h, t0, first, steps, fresh,
    y_every, y_rows, y_times, observer, o_every, o_rows, o_times,
):  # fmt: skip
    """Make steps, store every `y_every`-th state and observe every `o_every`-th.

    The machine code of the steps is called, not inlined: inlined into different loops, sums and products might fuse in
    different ways, and storing states would change the run.

    The arguments are the address of the steps and those of `steps_in_c`, of which `state`, `compensation`, `memory` and
    `control` are changed in place; the time at step 0 and the number of earlier steps; and those of `Stepper.record`,
    with empty arrays instead of None.
    """
    y = pointer(state)
    done, y_row, o_row = 0, 0, 0
    while done < steps:
        n = first + done
        stride = steps - done
        if y_every:
            stride = min(stride, y_every - n % y_every)
        if o_every:
            stride = min(stride, o_every - n % o_every)
        made = call_steps(
            advance, y, pointer(compensation), pointer(memory), pointer(control), pointer(numbers), pointer(work),
            h, stride, fresh,
        )  # fmt: skip
        fresh = 0
        done += made
        finite = True
        for i in range(len(state)):
            finite &= state[i] - state[i] == 0.0
        if made < stride or not finite:
            break
        n = first + done
        t = control[TIME] if len(control) else t0 + n * h
        if y_every and n % y_every == 0:
            for i in range(len(state)):  # assignments of arrays compile in two seconds
                y_rows[y_row, i] = state[i]
            if len(y_times):
                y_times[y_row] = t
            y_row += 1
        if o_every and n % o_every == 0:
            call_observer(observer, t, y, shifted(pointer(o_rows), o_row * o_rows.shape[1]))
            if len(o_times):
                o_times[o_row] = t
            o_row += 1
    return done


@compiled
def copy(source, to):
    """Copy numbers; assignments of arrays compile slowly."""
    for i in range(len(source)):
        to[i] = source[i]


@kept
def repeated(
    advance, start, start_compensation, start_memory, start_control, state, compensation, memory, control,
    numbers, work, h, steps, fresh, times,
):  # fmt: skip
    """Repeat steps from the same start, without calls from Python; returns how often all of them succeeded."""
    for done in range(times):
        copy(start, state)
        copy(start_compensation, compensation)
        copy(start_memory, memory)
        copy(start_control, control)
        made = call_steps(
            advance, pointer(state), pointer(compensation), pointer(memory), pointer(control), pointer(numbers),
            pointer(work), h, steps, fresh,
        )  # fmt: skip
        if made < steps:
            return done
    return times
