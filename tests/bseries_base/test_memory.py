"""How much memory may be taken: of the machine, of control groups, and of the limits of the process."""

import subprocess
import sys

import pytest

from bseries_base import memory

LIMITED = """
import resource
import bseries as bs

chain = [bs.Term(over="each", hamiltonian="p_i^2/2"), bs.Term(over="chain", hamiltonian="exp(q_i - q_j)")]
toda = bs.Scene({"p": 5000, "q": 5000}, terms=chain, start={"p": [0] * 5000, "q": [0] * 5000})
start = bs.runs.perturbed_start(bs.scene("pendulum"), 0.1)
_, most = resource.getrlimit(resource.RLIMIT_AS)
resource.setrlimit(resource.RLIMIT_AS, (4 * 10**9, most))
for work in (
    lambda: bs.integrate("gauss2", toda, h=0.1, steps=1, solver="newton"),
    lambda: bs.ensemble("rk4", bs.scene("pendulum"), h=0.1, steps=1, sample=start, members=10**9),
    lambda: bs.integrate("rk4", bs.scene("pendulum"), h=0.1, steps=10**9),
    lambda: bs.modified_equation(bs.method("rk4"), 25),
):
    try:
        work()
    except (bs.IntegratorError, bs.TreeError) as error:
        print(error)
"""


def groups(tmp_path, monkeypatch, own, files):
    """Control groups with these files, and the text that names those of the process."""
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (tmp_path / "own").write_text(own)
    monkeypatch.setattr(memory, "CGROUPS", tmp_path)
    monkeypatch.setattr(memory, "OWN_CGROUPS", tmp_path / "own")


@pytest.mark.parametrize(
    ("own", "files"),
    [
        (
            "0::/user/job\n",
            {
                "user/memory.max": "1000000",
                "user/memory.current": "400000",
                "user/memory.stat": "anon 300000\nfile 100000\n",
                "user/job/memory.max": "max",
                "user/job/memory.current": "100000",
                "user/job/memory.stat": "file 0\n",
            },
        ),
        (
            "9:cpu:/job\n4:memory:/job\n",
            {
                "memory/job/memory.limit_in_bytes": "1000000",
                "memory/job/memory.usage_in_bytes": "400000",
                "memory/job/memory.stat": "cache 1\ntotal_cache 100000\n",
            },
        ),
    ],
    ids=["version 2", "version 1"],
)
def test_limits_of_control_groups_count(tmp_path, monkeypatch, own, files):
    groups(tmp_path, monkeypatch, own, files)
    assert memory.available_memory() == 700_000
    with pytest.raises(KeyError, match=r"a table would take 0\.1 GB of memory, but 0\.0 GB are available"):
        memory.refuse_beyond_memory(10**8, KeyError, "a table")


def test_without_limits_the_machine_counts(tmp_path, monkeypatch):
    groups(tmp_path, monkeypatch, "0::/job\n", {})
    assert memory.available_memory() > 10**8


@pytest.mark.slow
def test_limits_of_the_process_count():
    pytest.importorskip("resource")
    found = subprocess.run([sys.executable, "-c", LIMITED], capture_output=True, text=True, check=True).stdout
    messages = found.splitlines()
    assert len(messages) == 4
    assert all("GB of memory, but" in message for message in messages)
