"""Kernels: when they are compiled, and that machine code on disk is not used once its constants have changed."""

import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from bseries_base.kernels import kernel
from bseries_base.lowering.flat_kernels import address_of, flat_kernel, machine_code_pays
from trees import TreeTable

pytestmark = pytest.mark.minimum

ROOT = Path(__file__).resolve().parent.parent.parent
KERNELS = """
from bseries_base.kernels import float_kernel
import constants

@float_kernel
def unkeyed(x):
    return x * constants.FACTOR

def _keyed(x):
    return x * constants.FACTOR

keyed = float_kernel(_keyed, sources=[constants])
"""


@pytest.mark.slow
def test_edits_of_sources_are_noticed(tmp_path):
    tmp_path.joinpath("kernels.py").write_text(KERNELS)
    found = []
    for factor in (2, 3):
        tmp_path.joinpath("constants.py").write_text(f"FACTOR = {factor}.0  # {'x' * factor}\n")
        program = "import kernels; print(kernels.keyed.compiled(1.0), kernels.unkeyed.compiled(1.0))"
        variables = {
            **os.environ,
            "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}",
            "BSERIES_CACHE": str(tmp_path / "cache"),
        }
        ended = subprocess.run(
            [sys.executable, "-c", program], env=variables, capture_output=True, text=True, check=True
        )
        found.append(ended.stdout.split())
    assert [keyed for keyed, _ in found] == ["2.0", "3.0"]
    assert [unkeyed for _, unkeyed in found] == ["2.0", "2.0"]  # what would happen without


SCALE = 2


@kernel
def scaled(x):
    return SCALE * x


def test_kernels_called_are_interpreted_with_any_global_names():
    assert scaled(Fraction(1, 3)) == Fraction(2, 3)
    assert scaled.interpreted(SCALE=3)(Fraction(1, 3)) == 1


@flat_kernel
def rounded_up(x) -> int:
    whole = 0
    while whole < x:
        whole += 1
    return whole


@flat_kernel
def add_rounded(count, factor, numbers, whole, narrow):
    for i in range(count):
        narrow[i] = rounded_up(factor * numbers[i])
        whole[0] += narrow[i]


def test_flat_kernels_in_both_executions():
    """Arrays of any type, numbers of both kinds, and callees that return integers."""
    for run in (add_rounded.py_func, add_rounded.compiled):
        for kind, narrow in ((np.float64, np.int8), (np.int64, np.uint32)):
            numbers, whole, small = np.array([1, 2, 3], kind), np.zeros(1, np.int64), np.zeros(3, narrow)
            run(3, 1.5, numbers, whole, small)
            assert (whole.tolist(), small.tolist()) == ([10], [2, 3, 5])


def test_addresses_of_arrays_are_those_of_numpy():
    numbers = np.arange(6.0)
    frozen = numbers.view("u8")
    frozen.flags.writeable = False
    for array in (numbers, numbers[2:], frozen, numbers[:0], np.zeros((2, 3), np.int8), np.array(["a"], object)):
        assert address_of(array) == array.__array_interface__["data"][0]


def test_the_choice_of_machine_code_depends_on_the_work_alone():
    assert not machine_code_pays(900)
    assert machine_code_pays(901)
    assert isinstance(TreeTable(7).columns.left, list)
    assert isinstance(TreeTable(8).columns.left, np.ndarray)


def test_machine_code_is_loaded_without_numba(tmp_path):
    program = (
        "import sys\nimport bseries as bs\n"
        "b = bs.modified_equation('rk4', 9)\n"
        "bs.compose(b.exp(), bs.algebra.substitution_inverse(b)), bs.modifying_integrator('rk4', 8)\n"
        "print('numba' in sys.modules, b.stored.raw.sum())\n"
    )
    variables = {**os.environ, "BSERIES_CACHE": str(tmp_path), "PYTHONPATH": str(ROOT)}
    found = [
        subprocess.run(
            [sys.executable, "-c", program], env=variables, capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    ]
    assert found[0].replace("True", "False") == found[1]
    assert found[1].startswith("False")


def test_machine_code_depends_on_the_files_of_all_callees(tmp_path):
    """The caller's file and key stay as they are when a callee in another file is edited."""
    (tmp_path / "caller.py").write_text(
        "from callee import twice\nfrom bseries_base.lowering.flat_kernels import flat_kernel\n\n"
        "@flat_kernel\ndef run(x):\n    twice(x)\n"
    )
    program = "import numpy as np, caller\nx = np.ones(1)\ncaller.run.compiled(x)\nprint(x[0])"
    variables = {
        **os.environ,
        "BSERIES_CACHE": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join(map(str, (ROOT, tmp_path))),
    }
    found = []
    for factor in ("2", "3", "2"):
        (tmp_path / "callee.py").write_text(
            f"from bseries_base.lowering.flat_kernels import flat_kernel\n\n"
            f"@flat_kernel\ndef twice(x):\n    x[0] *= {factor}\n"
        )
        command = [sys.executable, "-B", "-c", program]
        found.append(subprocess.run(command, env=variables, capture_output=True, text=True, check=True).stdout)
    assert found == ["2.0\n", "3.0\n", "2.0\n"]
