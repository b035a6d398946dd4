"""What measured errors are relative to, and which modified energy belongs to a method."""

import numpy as np
import pytest

import bseries as bs
from bseries.advice.work_precision.candidates import candidate
from bseries.advice.work_precision.dense_reference import DenseReference
from bseries.advice.work_precision.run_errors import Judge


def test_the_start_is_a_state_of_the_solution():
    """A decaying solution is nowhere as large."""
    decay = bs.Scene({"y": 1}, field={"y": "-2000*y"}, start={"y": [1]})
    assert DenseReference(decay, np.array([1.0]), 10.0).size == 1.0


def test_orders_go_by_methods_and_not_by_names():
    """A midpoint rule that is called rk4 has the modified energy of a method of order 2, with all its terms."""
    pendulum = bs.scene("pendulum")
    false = bs.RungeKutta([["1/2"]], [1], name="rk4")
    judge = Judge(pendulum, 10.0, ("energy", "modified-energy"))
    found, known = (judge.run(candidate(pendulum, m), 50) for m in (false, "implicit-midpoint"))
    assert found.modified_energy == pytest.approx(known.modified_energy)
    assert found.modified_order == known.modified_order
