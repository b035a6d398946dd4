"""Many steps, of which some states are stored and observed."""

from __future__ import annotations

from integrators.compile.machine import call_observer, call_steps, compiled, kept, pointer, shifted
from integrators.steppers.adaptive import TIME


@kept
def recorded(
    advance, state, carry, memory, control, numbers, work, h, t0, first, steps, fresh,
    y_every, y_rows, y_times, observer, o_every, o_rows, o_times,
):  # fmt: skip
    """Make steps; store states after every `y_every`-th one, and what an observer sees after every `o_every`-th.

    There is one machine code of the steps of a method, which is called here: were it compiled into loops of several
    kinds, sums and products would be fused in several ways, and what is stored would change the run.

    Args:
        advance: The address of the C function that makes steps (see `steps_in_c`).
        state: The state, changed in place; so are `carry`, `memory` and `control`.
        control: What controls step sizes, if they vary.
        numbers: What depends on h only.
        work: Work arrays.
        h: The step size.
        t0: The time at step 0.
        first: The number of steps before.
        steps: How many steps.
        fresh: 1 if `memory` is still to be computed, else 0.
        y_every: Steps from one stored state to the next, counted from step 0; 0 stores none.
        y_rows: Where states go, row by row.
        y_times: Where their times go; may be empty.
        observer: The address of a C function void (double t, double *y, double *out).
        o_every: The same for the observer.
        o_rows: Where it writes.
        o_times: Where the times of that go; may be empty.

    Returns:
        The number of steps made; fewer if one failed, or a state that is stored or observed was not finite.
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
            advance, y, pointer(carry), pointer(memory), pointer(control), pointer(numbers), pointer(work),
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
            for i in range(len(state)):  # an assignment of arrays takes numba two seconds
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
    """Copy numbers; an assignment of arrays takes numba a second."""
    for i in range(len(source)):
        to[i] = source[i]


@kept
def repeated(
    advance, start, start_carry, start_memory, start_control, state, carry, memory, control, numbers, work,
    h, steps, fresh, times,
):  # fmt: skip
    """Make steps from a start so many times.

    A call from Python takes as long as hundreds of steps of a cheap scene; here nothing lies between two repetitions
    but copying the state.

    Args:
        advance: The address of the C function that makes steps (see `steps_in_c`).
        start: The state to begin with, and so are `start_carry`, `start_memory` and `start_control`.
        state: Where the steps are made, and so are `carry`, `memory` and `control`.
        numbers: What depends on h only.
        work: Work arrays.
        h: The step size.
        steps: How many steps.
        fresh: 1 if `memory` is still to be computed, else 0.
        times: How often.

    Returns:
        How many times all steps could be made.
    """
    for done in range(times):
        copy(start, state)
        copy(start_carry, carry)
        copy(start_memory, memory)
        copy(start_control, control)
        made = call_steps(
            advance, pointer(state), pointer(carry), pointer(memory), pointer(control), pointer(numbers), pointer(work),
            h, steps, fresh,
        )  # fmt: skip
        if made < steps:
            return done
    return times
