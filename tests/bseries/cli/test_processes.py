"""What only whole processes show: exit codes, signals, pipes, and what is imported."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time

import psutil
import pytest

BSERIES = [sys.executable, "-c", "from bseries.cli import main; main()"]
RUN = ["simulate", "pendulum", "--method", "rk4", "--step", "1/10", "--steps", "3"]


def process(*arguments: str, **options) -> subprocess.Popen:
    return subprocess.Popen([*BSERIES, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)


def test_broken_pipe_is_quiet():
    bash = process("trees", "--order", "10", "--format", "csv")
    assert bash.stdout is not None
    assert bash.stdout.readline() == b"id,tree,levels,colors,order,symmetry,density,alpha,differential,weight\n"
    bash.stdout.close()
    assert bash.stderr is not None
    assert bash.stderr.read() == b""
    assert bash.wait() == 141
    bash.stderr.close()


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_interrupt_is_quiet_and_leaves_no_file(tmp_path):
    job = process("trees", "--order", "16", "--format", "csv", "-o", str(tmp_path / "trees.csv"))
    while psutil.Process(job.pid).cpu_times().user < 1:  # well past starting, on a busy machine too
        time.sleep(0.05)
    job.send_signal(signal.SIGINT)
    out, err = job.communicate()
    assert (job.returncode, out, err) == (130, b"", b"")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="modes of POSIX")
def test_a_cache_that_others_can_write_is_told_in_one_line(tmp_path):
    tmp_path.chmod(0o777)
    job = process(*RUN, env={**os.environ, "BSERIES_CACHE": str(tmp_path)})
    out, err = job.communicate()
    assert job.returncode == 0
    assert out
    (line,) = err.decode().splitlines()
    assert line.startswith("bseries: warning: machine code is compiled in memory and not kept: ")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "code", "err"),
    [
        (["modified", "rk4"], 0, b""),
        (["--version"], 0, b""),
        (["--help"], 0, b""),
        ([], 0, b""),
        (["check", "--help"], 0, b""),
        (["modified", "nosuch"], 2, b"bseries: error: name must be a method of the catalogue, but was 'nosuch'\n"),
    ],
)
def test_exit_codes(arguments, code, err):
    job = process(*arguments)
    out, found = job.communicate()
    assert (job.returncode, found) == (code, err)
    assert bool(out) == (code == 0)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize("arguments", [["modified", "rk4"], ["--help"], ["--version"], ["check", "--help"], []])
def test_full_disk(arguments):
    with open("/dev/full", "wb") as full:
        job = subprocess.run([*BSERIES, *arguments], stdout=full, stderr=subprocess.PIPE, check=False)
    assert job.returncode == 2
    assert job.stderr == b"bseries: error: output must be writable, but was not: No space left on device\n"


@pytest.mark.skipif(os.name == "nt", reason="a shell of POSIX")
@pytest.mark.parametrize("arguments", ["modified -", "scenes -", "shadow -", "modified rk4 --help"])
def test_standard_input_may_be_closed(arguments):
    command = f'exec "$0" -c "from bseries.cli import main; main()" {arguments} <&-'
    job = subprocess.run(["sh", "-c", command, sys.executable], capture_output=True, text=True, check=False)
    needed = arguments.endswith("-")
    sentence = "bseries: error: - must stand for what comes on standard input, but that was closed\n"
    assert (job.returncode, job.stderr) == ((2, sentence) if needed else (0, ""))


@pytest.mark.skipif(os.name == "nt", reason="a shell of POSIX")
@pytest.mark.parametrize("arguments", ["check rk4", "--help", "--version", "check --help"])
def test_a_lost_answer_is_a_failure(arguments):
    command = f'exec "$0" -c "from bseries.cli import main; main()" {arguments} >&-'
    job = subprocess.run(["sh", "-c", command, sys.executable], capture_output=True, text=True, check=False)
    sentence = "bseries: error: output must be writable, but was not: Bad file descriptor\n"
    assert (job.returncode, job.stderr) == (2, sentence)


@pytest.mark.skipif(os.name == "nt", reason="a shell of POSIX")
def test_an_answer_in_a_file_needs_no_standard_output(tmp_path):
    command = f'exec "$0" -c "from bseries.cli import main; main()" modified rk4 -o {tmp_path / "found.csv"} >&-'
    job = subprocess.run(["sh", "-c", command, sys.executable], capture_output=True, text=True, check=False)
    assert (job.returncode, job.stderr) == (0, "")
    assert (tmp_path / "found.csv").stat().st_size


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="needs /dev/zero")
@pytest.mark.parametrize("verb", ["modified", "scenes", "shadow"])
def test_input_without_end(verb):
    with open("/dev/zero", "rb") as zero:
        job = subprocess.run([*BSERIES, verb, "-"], stdin=zero, capture_output=True, text=True, check=False)
    assert job.returncode == 2
    assert re.fullmatch(r"bseries: error: .* at most 10000000 bytes, but (one )?has more\n", job.stderr)


def test_output_is_utf8_whatever_the_locale():
    environment = {**os.environ, "PYTHONIOENCODING": "latin-1"}
    out, err = process("series", "rk4", "--order", "2", env=environment).communicate()
    assert "[τ]" in out.decode("utf-8")
    assert err == b""


def loaded(modules: set[str], command: str) -> list[str]:
    """Which of these modules a command loads."""
    code = (
        "import sys; from bseries.cli.application import application\n"
        f"application({command.split()!r}, standalone_mode=False)\n"
        f"print(*sorted({modules!r} & set(sys.modules)), file=sys.stderr)"
    )
    job = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return job.stderr.split()


def test_the_common_path_imports_nothing_heavy():
    heavy = {"numpy", "sympy", "numba", "networkx", "matplotlib", "rich", "scipy"}
    assert loaded(heavy, "modified rk4 --order 6") == []


def test_formulas_on_a_scene_load_no_numpy():
    assert loaded({"numpy", "sympy", "numba"}, "equation rk4 --scene pendulum --order 5") == ["sympy"]


def test_help_imports_no_library():
    assert loaded({"numpy", "fractions", "bseries.algebra.modified"}, "--help") == []
