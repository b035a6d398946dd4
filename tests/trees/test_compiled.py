"""Kernels: machine code on disk is not used once the constants it was made of have changed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

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
