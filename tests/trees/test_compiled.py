"""Kernels: when they are compiled, and that machine code on disk is not used once its constants have changed."""

import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from trees import TreeTable, compiled

ROOT = Path(__file__).resolve().parent.parent.parent
KERNELS = """
from trees.compiled import float_kernel
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


@compiled.kernel
def scaled(x):
    return SCALE * x


def test_kernels_called_are_interpreted_with_any_global_names():
    assert scaled(Fraction(1, 3)) == Fraction(2, 3)
    assert scaled.interpreted(SCALE=3)(Fraction(1, 3)) == 1


def test_interpreted_time_adds_up(monkeypatch):
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    monkeypatch.setattr(compiled, "_interpreted", 0.0)
    for cached in (True, False):
        monkeypatch.setattr(compiled, "has_machine_code", lambda module, cached=cached: cached)
        assert not compiled.compiling_pays(0.3)
        assert compiled.compiling_pays(0.5) == cached
        assert compiled.compiling_pays(6.0)
    with compiled.interpreting():
        pass
    assert 0 < compiled._interpreted < 1
    monkeypatch.setattr(compiled, "_interpreted", 6.0)
    assert compiled.compiling_pays(0.0)


def test_tables_made_by_the_interpreter_take_up_compiled_kernels(monkeypatch):
    monkeypatch.setattr("trees.table.compiling_pays", lambda seconds: False)
    table = TreeTable(6, 2)
    table.choose_kernels(1.0)
    assert not table.compiled
    assert isinstance(table.columns.left, list)
    symmetry, splits = table.symmetry.tolist(), table.splits
    monkeypatch.setattr("trees.table.compiling_pays", lambda seconds: seconds >= 1.0)  # of the work, not of the table
    table.choose_kernels(1.0)
    assert table.compiled
    assert isinstance(table.columns.left, np.ndarray)
    assert table.symmetry.tolist() == symmetry
    assert table.splits.trunk.tolist() == splits.trunk
    assert table.splits.trunk.dtype == np.uint32
    with pytest.raises(AttributeError, match="immutable"):
        table.compiled = False


def test_arrays_pay_once_they_save_the_import_of_numpy(monkeypatch):
    monkeypatch.setattr(compiled, "_interpreted", 0.0)
    assert compiled.arrays_pay(0.01)
    assert not compiled.arrays_pay(1e-4)
    monkeypatch.delitem(sys.modules, "numpy")
    assert not compiled.arrays_pay(0.01)
    assert compiled.arrays_pay(0.2)
    monkeypatch.setattr(compiled, "_interpreted", 0.1)
    assert compiled.arrays_pay(0.01)
