"""A server of its own for these tests."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SERVE = "from bseries_command import main; main()"


@pytest.fixture(scope="session")
def address() -> Iterator[str]:
    """The address of a server, which must end when interrupted."""
    pytest.importorskip("bokeh")
    command = [sys.executable, "-c", SERVE, "explore", "--port", "0", "--no-open"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": environment}
    if os.name == "posix":  # where these tests run in the background, interrupts are ignored
        options["preexec_fn"] = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(command, **options) as server:
        assert server.stdout is not None
        assert server.stderr is not None
        line = server.stdout.readline()
        assert line.startswith("The explorer is at http://127.0.0.1:"), server.stderr.read()
        yield line.split()[4].removesuffix(";")
        server.send_signal(signal.SIGINT)
        try:
            code = server.wait(30)
        except subprocess.TimeoutExpired:
            server.kill()
            code = server.wait()
        problems = server.stderr.read()
        assert (code, "Traceback" in problems) == (0, False), problems
