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

pytestmark = pytest.mark.minimum

BSERIES = [sys.executable, "-c", "from bseries_command import main; main()"]
RUN = ["simulate", "pendulum", "--method", "rk4", "--step", "1/10", "--steps", "3"]
LONG = ["simulate", "pendulum", "--method", "rk4", "--step", "0.001", "--steps", "100000000"]
PROCESSES = ["--no-predict", "--ensemble", "400", "--spread", "0.1", "--workers", "2", "--processes"]
POSIX = pytest.mark.skipif(os.name == "nt", reason="signals and shells of POSIX")


def interruptible() -> None:
    """Hear SIGINT in a child, also where it is ignored: in the background of a shell, where these tests may run."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def process(*arguments: str, command: list[str] = BSERIES, **options) -> subprocess.Popen:
    if os.name == "posix":
        options["preexec_fn"] = interruptible
    return subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)


def children_of(job: subprocess.Popen, count: int) -> list[psutil.Process]:
    """The processes that a job has started, once they are that many and compute."""
    while True:
        found = [child for child in psutil.Process(job.pid).children() if child.cpu_times().user > 0.5]
        if len(found) >= count:
            return found
        assert job.poll() is None
        time.sleep(0.05)


def test_broken_pipe_is_quiet():
    bash = process("trees", "--order", "10", "--format", "csv")
    assert bash.stdout is not None
    assert bash.stdout.readline() == b"id,tree,levels,colors,order,symmetry,density,alpha,differential,weight\n"
    bash.stdout.close()
    assert bash.stderr is not None
    assert bash.stderr.read() == b""
    assert bash.wait() == 141
    bash.stderr.close()


@POSIX
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


@POSIX
@pytest.mark.parametrize("arguments", ["modified -", "scenes -", "shadow -", "modified rk4 --help"])
def test_standard_input_may_be_closed(arguments):
    command = f'exec "$0" -c "from bseries.cli import main; main()" {arguments} <&-'
    job = subprocess.run(["sh", "-c", command, sys.executable], capture_output=True, text=True, check=False)
    needed = arguments.endswith("-")
    sentence = "bseries: error: - must stand for what comes on standard input, but that was closed\n"
    assert (job.returncode, job.stderr) == ((2, sentence) if needed else (0, ""))


@POSIX
@pytest.mark.parametrize("arguments", ["check rk4", "--help", "--version", "check --help"])
def test_a_lost_answer_is_a_failure(arguments):
    command = f'exec "$0" -c "from bseries.cli import main; main()" {arguments} >&-'
    job = subprocess.run(["sh", "-c", command, sys.executable], capture_output=True, text=True, check=False)
    sentence = "bseries: error: output must be writable, but was not: Bad file descriptor\n"
    assert (job.returncode, job.stderr) == (2, sentence)


@POSIX
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


@POSIX
@pytest.mark.parametrize("arguments", ["modified rk4", "methods", "check rk4", " ".join(RUN), "--help"])
def test_standard_error_may_be_closed(arguments):
    command = f'exec "$0" -c "from bseries_command import main; main()" {arguments}'
    whole, closed = (
        subprocess.run(["sh", "-c", command + end, sys.executable], capture_output=True, text=True, check=False)
        for end in ("", " 2>&-")
    )
    assert (closed.returncode, whole.returncode, whole.stderr) == (0, 0, "")
    without_times = [re.sub(r"A step took .*", "", job.stdout) for job in (whole, closed)]
    assert without_times[0] == without_times[1] != ""


def test_settings_of_other_packages_give_no_tracebacks(tmp_path):
    plot = str(tmp_path / "energy.png")
    out, err = process(*RUN, env={**os.environ, "NUMBA_NUM_THREADS": "0"}).communicate()
    assert (out, err) == (
        b"", b"bseries: error: NUMBA_NUM_THREADS must be a number of threads, 1 or more, but was '0'\n",
    )  # fmt: skip
    job = process(*RUN, "--plot", plot, env={**os.environ, "MPLBACKEND": "junk"})
    err = [line for line in job.communicate()[1].splitlines() if b"deprecated" not in line]
    assert (err, job.returncode) == ([], 0)  # old versions of matplotlib use what their neighbours deprecate
    assert os.path.getsize(plot)


LOADING = """
import os, signal, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)

from bseries_command import main
sys.meta_path.insert(0, Interrupting())
sys.argv = ["bseries", *{arguments!r}]
main()
"""


@POSIX
@pytest.mark.parametrize(
    ("module", "arguments"),
    [
        *((x, RUN) for x in ("bseries", "click", "numpy", "numpy.linalg")),
        ("sympy", ["equation", "rk4", "--scene", "toda"]),
    ],
)
def test_interrupts_while_packages_load_are_quiet(module, arguments):
    script = LOADING.format(module=module, arguments=arguments)
    job = process(command=[sys.executable, "-c", script])
    assert (*job.communicate(), job.returncode) == (b"", b"", 130)


@POSIX
def test_interrupts_in_finalizers_are_heard():
    script = """
import signal, time
from bseries.cli import Interrupts

class Interrupted:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)

interrupts = Interrupts()
try:
    Interrupted()
    time.sleep(60)
except KeyboardInterrupt:
    print("heard", interrupts.came)
"""
    job = process(command=[sys.executable, "-c", script])
    assert (*job.communicate(), job.returncode) == (b"heard True\n", b"", 0)


@POSIX
def test_interrupts_at_the_very_end_change_nothing():
    """Python gives signals their default action before it frees its modules."""
    script = """
import os, signal, sys

class Late:
    def __del__(self, kill=os.kill, pid=os.getpid(), number=signal.SIGINT):
        kill(pid, number)

sys.late = Late()
from bseries_command import main
sys.argv = ["bseries", "completion", "bash"]
main()
"""
    job = process(command=[sys.executable, "-c", script])
    out, err = job.communicate()
    assert (bool(out), err, job.returncode) == (True, b"", 0)


LLVMLITE = """
import os, signal
from bseries.cli import Interrupts
from llvmlite.binding.ffi import ObjectRef

interrupts = Interrupts()

def dispose(self):
    os.kill(os.getpid(), signal.SIGINT)
    freed.append(self._ptr)

freed, ObjectRef._dispose = [], dispose
try:
    ObjectRef(7).close()
    while True:
        pass
except KeyboardInterrupt:
    print(freed, interrupts.came)
"""


@POSIX
def test_interrupts_wait_for_llvmlite():
    job = process(command=[sys.executable, "-c", LLVMLITE])
    assert (*job.communicate(), job.returncode) == (b"[7] True\n", b"", 0)


@POSIX
@pytest.mark.slow
@pytest.mark.parametrize("more", [[], PROCESSES[:-1], PROCESSES, [*PROCESSES[:-1], "--scheduler", "local"]])
@pytest.mark.parametrize("is_group", [True, False])
def test_interrupts_of_runs_give_one_line(more, is_group):
    """A terminal sends SIGINT to all processes of a group, other programs to one."""
    job = process(*LONG, "--no-predict", *more, start_new_session=True)
    workers = children_of(job, 2) if len(more) >= len(PROCESSES) else []
    time.sleep(2)
    (os.killpg if is_group else os.kill)(job.pid, signal.SIGINT)
    out, err = job.communicate(timeout=60)
    assert (job.returncode, out) == (130, b"")
    assert re.fullmatch(rb"bseries: warning: stopped after [0-9,]+ of [0-9,]+ (runs|steps)\n", err) or not err
    assert not psutil.wait_procs(workers, timeout=10)[1]


@POSIX
@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL, signal.SIGHUP] if os.name == "posix" else [])
def test_processes_end_with_their_parent(number):
    job = process(*LONG, *PROCESSES)
    workers = children_of(job, 2)
    job.send_signal(number)
    assert job.communicate(timeout=60) == (b"", b"")
    assert not psutil.wait_procs(workers, timeout=10)[1]


@pytest.mark.slow
@pytest.mark.parametrize("more", [PROCESSES, [*PROCESSES[:-1], "--scheduler", "local"]])
def test_children_run_no_code_of_the_working_directory(more, tmp_path):
    """As the installed command does: `python -c` would put the working directory on the path of the parent, too."""
    command, here = tmp_path / "command", tmp_path / "here"
    command.mkdir()
    here.mkdir()
    (command / "bseries.py").write_text("from bseries_command import main\nif __name__ == '__main__':\n    main()\n")
    (command / "bseries.py").rename(command / "run.py")
    (here / "pickle.py").write_text("open('executed', 'w').close()\nraise SystemExit\n")
    environment = {**os.environ, "PYTHONPATH": os.path.abspath(".")}
    job = process(*RUN, *more, command=[sys.executable, str(command / "run.py")], cwd=here, env=environment)
    _, err = job.communicate(timeout=120)
    assert (job.returncode, err) == (0, b"")
    assert os.listdir(here) == ["pickle.py"]
