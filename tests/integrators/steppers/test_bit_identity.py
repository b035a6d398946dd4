"""Runs go on bit for bit: in chunks, from copies, after pickling, and whatever is recorded."""

from __future__ import annotations

import pickle

import catalogue_cases as cases
import numpy as np
import pytest

from integrators import stepper

STEPS = 84
RUNS = [
    ("kepler", "stormer-verlet-kdk", {}),
    ("kepler", "stormer-verlet-dkd", {}),
    ("kepler", "stormer-verlet-kdk", {"compensated": False}),
    ("kepler", "stormer-verlet-dkd", {"control": "(q1^2 + q2^2)^(3/4)"}),
    ("henon-heiles", "blanes-moan6", {}),
    ("henon-heiles", "sofroniou-spaletta6", {}),
    ("henon-heiles", "takahashi-imada", {}),
    ("lotka-volterra", "strang", {}),
    ("kepler", "williamson3", {}),
    ("henon-heiles", "kennedy54", {"control": "1/(1 + q1^2 + q2^2)"}),
    ("double-pendulum", "ssprk104", {}),
    ("kepler", "gauss2", {}),
    ("double-pendulum", "gauss2", {}),
    ("double-pendulum", "gauss2", {"compensated": False, "split": False}),
    ("brusselator", "radau-iia2", {"solver": "newton"}),
    ("henon-heiles", "gauss2", {"control": "1/(1 + q1^2 + q2^2)"}),
    ("brusselator", "bogacki-shampine32", {}),
    ("brusselator", "rodas3", {}),
    ("henon-heiles", "avf", {}),
    ("reaction", "lawson4", {}),
]


def begun(where, name, options):
    compiled = stepper(name, cases.SCENES[where], **options)
    return compiled, compiled.start(cases.STARTS[where], h=1 / 32, t0=0.5)


def bits(state):
    """The whole state of a run as bytes."""
    arrays = [state.y, state.carry, state.memory, state.control]
    return [x.tobytes() for x in arrays], state.n, state.t, state.h, state.solver


@pytest.fixture(params=RUNS, ids=lambda run: "-".join([run[1], run[0], *run[2]]))
def run(request):
    return request.param


@pytest.fixture
def whole(run):
    compiled, state = begun(*run)
    compiled.advance(state, STEPS)
    return state


def test_chunks_copies_and_pickles_change_no_bit(run, whole):
    compiled, state = begun(*run)
    for steps in (1, 2, 30, 7, 43, 1):
        other = state.copy()
        compiled.advance(other, 3)  # which leaves the original as it was
        compiled.advance(state, steps)
        state = pickle.loads(pickle.dumps(state)).copy()
    assert bits(state) == bits(whole)


@pytest.mark.parametrize("every", [1, 7])
def test_recording_changes_no_bit(run, whole, every):
    compiled, state = begun(*run)
    rows, times = np.empty((STEPS // every, state.y.size)), np.empty(STEPS // every)
    compiled.record(state, STEPS, y_every=every, y_rows=rows, y_times=times)
    assert bits(state) == bits(whole)
    _, again = begun(*run)
    for row, t in zip(rows, times, strict=True):
        compiled.advance(again, every)
        assert row.tobytes() == again.y.tobytes()
        assert t == again.t


def test_compensation_and_stage_derivatives_are_part_of_a_run():
    """A new start from y alone gives other bits, which shows that the comparison is sharp."""
    compiled, state = begun("kepler", "gauss2", {})
    compiled.advance(state, 40)
    afresh = compiled.start(state.y, h=state.h)
    compiled.advance(state, 44)
    compiled.advance(afresh, 44)
    assert np.abs(state.y - afresh.y).max() < 1e-13
    assert state.y.tobytes() != afresh.y.tobytes()
