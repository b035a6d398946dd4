"""Measured errors are relative to the size of the solution."""

import numpy as np

import bseries as bs
from bseries.advice.work_precision.sweeps import DenseReference


def test_the_start_is_a_state_of_the_solution():
    """A decaying solution is nowhere as large."""
    decay = bs.Scene({"y": 1}, field={"y": "-500*y"}, start={"y": [1]})
    assert DenseReference(decay, np.array([1.0]), 10.0).size == 1.0
