"""`pytest --audit-tableaus`: a test for each method of which something is claimed."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[3]
RIGHT = "def heun():\n    # second-order method\n    A = [[0, 0], [1, 0]]\n    b = [1/2, 1/2]\n"


def audited(folder, *paths):
    """The exit code and output of pytest in a folder without tests."""
    options = [argument for path in paths for argument in ("--audit-tableaus", str(path))]
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-p", "bseries.auditing.plugin", *options]
    environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # installed, it is loaded already
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def test_wrong_tableaus_fail_with_their_entry_and_right_ones_pass(tmp_path):
    (tmp_path / "right.py").write_text(RIGHT)
    assert audited(tmp_path, "right.py")[0] == 0
    (tmp_path / "wrong.py").write_text(RIGHT.replace("[1, 0]]", "[-1, 0]]"))
    code, output = audited(tmp_path, "right.py", "wrong.py")
    assert code == 1
    assert "1 failed, 1 passed" in output
    assert "wrong.py:3: heun: order 2, but order 1: a[2,1] = 1 in place of -1 (line 3)" in output


def test_files_that_do_not_exist_are_an_error_of_usage(tmp_path):
    code, output = audited(tmp_path, "nothing.py")
    assert code == 4
    assert "sources must be files and folders that exist" in output
    assert "Traceback" not in output


def test_the_plugin_is_distributed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["pytest11"] == {"bseries-audit": "bseries.auditing.plugin"}
