"""The same steps again and again: what they cost, however few they are."""

from __future__ import annotations

from .machine import call_steps, compiled, kept, pointer


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
