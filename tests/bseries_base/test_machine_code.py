"""Machine code on disk: found again, made anew where it is damaged, and never taken from where others can write."""

from __future__ import annotations

import errno
import importlib.util
import os
import pickle
import shutil
import subprocess
import sys
import warnings
from hashlib import sha256
from pathlib import Path

import numba
import pytest
from numba.core.dispatcher import Dispatcher

from bseries_base import machine_code
from bseries_base.machine_code import CHECKSUM, cache_directory, cfunc, njit

pytestmark = pytest.mark.minimum

ROOT = Path(__file__).parents[2]
KERNELS = """
def cube(x):
    return x * x * x

def power(n):
    def function(x):
        return x**n
    return function

def apply(f, x):
    return f(x)
"""
WARNING = "machine code is compiled in memory and not kept: "
POSIX = pytest.mark.skipif(os.name != "posix", reason="owners and modes of POSIX")
ROOT_ONLY = pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root gives files away")


@pytest.fixture
def kernels(tmp_path):
    """A module in a file, under a name of its own: its functions and their text."""
    return load(tmp_path / "kernels.py")


def load(path, text=KERNELS):
    path.write_text(text)
    spec = importlib.util.spec_from_file_location("kernels", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules["kernels"] = module
    spec.loader.exec_module(module)
    return module


def hits(function, *arguments, value=27.0, decorate=None):
    """Compile a function as a new process would, and see whether its code was found."""
    compiled = (decorate or njit())(function)
    assert compiled(*(arguments or (3.0,))) == value
    return sum(compiled.stats.cache_hits.values())


def codes(directory):
    return sorted(directory.glob("*.code"))


def test_code_is_found_again(directory, kernels):
    assert [hits(kernels.cube) for _ in range(3)] == [0, 1, 1]
    (file,) = directory.glob("*.code")
    if os.name == "posix":
        assert (directory.stat().st_mode & 0o777, file.stat().st_mode & 0o777) == (0o700, 0o600)


def test_c_functions_are_found_again(directory, kernels):
    made = [cfunc("float64(float64)", nogil=True)(kernels.cube) for _ in range(2)]
    assert [one.ctypes(3.0) for one in made] == [27.0, 27.0]
    assert [one.cache_hits for one in made] == [0, 1]


def test_compiling_is_known_while_it_lasts(directory, kernels, monkeypatch):
    seen, compile_extra = [], numba.core.compiler.compile_extra

    def compiling(*arguments, **options):
        seen.append(machine_code.is_compiling())
        return compile_extra(*arguments, **options)

    monkeypatch.setattr(numba.core.compiler, "compile_extra", compiling)
    assert [hits(kernels.cube) for _ in range(2)] == [0, 1]
    assert seen == [True]
    assert not machine_code.is_compiling()


def test_a_signature_compiles_at_once(directory, kernels):
    for found in (0, 1):
        compiled = njit(numba.float64(numba.float64))(kernels.cube)
        assert list(compiled.stats.cache_hits.values()) == [1] * found
        assert compiled(3) == 27.0
        with pytest.raises(TypeError):
            compiled(3j)


def test_whatever_the_code_depends_on_is_in_the_key(directory, kernels, tmp_path):
    source = tmp_path / "constants.py"
    source.write_text("A = 1\n")
    cases = [
        lambda: hits(kernels.cube),
        lambda: hits(kernels.cube, 3, value=27),  # other types
        lambda: hits(kernels.cube, decorate=njit(error_model="numpy")),
        lambda: hits(kernels.cube, decorate=njit(sources=[source])),
        lambda: hits(kernels.power(3.0)),
        lambda: hits(kernels.power(2.0), value=9.0),
        lambda: cfunc("float64(float64)")(kernels.cube).cache_hits,
    ]
    assert [case() for case in cases] == [0] * len(cases)
    assert [case() for case in cases] == [1] * len(cases)
    source.write_text("A = 2\n")
    assert [case() for case in cases] == [1, 1, 1, 0, 1, 1, 1]
    edited = load(tmp_path / "edited.py", KERNELS.replace("x * x * x", "x * x * 3 "))
    assert hits(edited.cube) == 0
    assert hits(kernels.cube) == 1


def test_functions_as_arguments_are_not_taken_for_each_other(directory, kernels, monkeypatch):
    """Numba names their types by addresses, which another process may use for another function."""
    monkeypatch.setattr(Dispatcher, "__repr__", lambda self: "function at 0x1")
    two, three = numba.njit(kernels.power(2.0)), numba.njit(kernels.power(3.0))
    assert hits(kernels.apply, two, 3.0, value=9.0) == 0
    assert hits(kernels.apply, three, 3.0, value=27.0) == 0


def test_what_has_no_text_is_compiled_in_memory(directory):
    scope = {}
    exec("def cube(x):\n    return x*x*x\n", scope)
    assert [hits(scope["cube"]) for _ in range(2)] == [0, 0]
    assert not directory.exists()


LENGTHS = [0, 1, CHECKSUM - 1, CHECKSUM, CHECKSUM + 1, 0.1, 0.5, 0.9, -100, -1]


@pytest.mark.few(4)
@pytest.mark.parametrize("length", LENGTHS)
def test_a_truncated_file_is_made_anew(directory, kernels, length):
    hits(kernels.cube)
    (file,) = codes(directory)
    whole = file.read_bytes()
    file.write_bytes(whole[: int(length * len(whole)) if isinstance(length, float) else length])
    assert [hits(kernels.cube) for _ in range(2)] == [0, 1]
    assert len(file.read_bytes()) == pytest.approx(len(whole), rel=0.1)


@pytest.mark.few(4)
@pytest.mark.parametrize("place", [0, CHECKSUM - 1, CHECKSUM, CHECKSUM + 1, 0.1, 0.3, 0.5, 0.7, 0.9, -1])
def test_a_flipped_bit_is_noticed(directory, kernels, place):
    hits(kernels.cube)
    (file,) = codes(directory)
    damaged = bytearray(file.read_bytes())
    damaged[int(place * len(damaged)) if isinstance(place, float) else place] ^= 4
    file.write_bytes(damaged)
    assert [hits(kernels.cube) for _ in range(2)] == [0, 1]


def test_appended_bytes_directories_and_other_pickles(directory, kernels):
    hits(kernels.cube)
    (file,) = codes(directory)
    file.write_bytes(file.read_bytes() + b"\0")
    assert [hits(kernels.cube) for _ in range(2)] == [0, 1]
    for content in (pickle.dumps(3), b"no pickle", b""):
        file.write_bytes(sha256(file.name.encode() + content).digest() + content)
        assert [hits(kernels.cube) for _ in range(2)] == [0, 1]
    file.unlink()
    file.mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # some systems call it a failure of the disk
        assert [hits(kernels.cube) for _ in range(2)] == [0, 0]


class Planted:
    """Code of somebody else: what unpickles this creates a file."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def planted(directory, kernels, path):
    """Let the cache hold such code for a kernel."""
    hits(kernels.cube)
    (file,) = codes(directory)
    content = pickle.dumps(Planted(path))
    file.write_bytes(sha256(file.name.encode() + content).digest() + content)
    return file


def refused(directory, kernels, path, named):
    with pytest.warns(RuntimeWarning, match=f"{WARNING}others may write to the cache {directory} .{named} has owner"):
        assert hits(kernels.cube) == 0
    assert hits(kernels.cube) == 0  # and no second warning
    assert not path.exists()


@POSIX
def test_code_in_a_cache_of_ones_own_would_run(directory, kernels, tmp_path):
    """The negative control of those below."""
    planted(directory, kernels, tmp_path / "ran")
    assert hits(kernels.cube) == 0
    assert (tmp_path / "ran").exists()


@POSIX
@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o770, 0o720, 0o702])
def test_a_cache_that_others_can_write_is_not_used(directory, kernels, tmp_path, mode):
    file = planted(directory, kernels, tmp_path / "ran")
    before = file.read_bytes()
    directory.chmod(mode)
    refused(directory, kernels, tmp_path / "ran", directory)
    assert file.read_bytes() == before


@POSIX
def test_nor_one_below_a_directory_that_everybody_can_write(directory, kernels, tmp_path, monkeypatch):
    above = tmp_path / "above"
    monkeypatch.setenv("BSERIES_CACHE", str(above / "cache"))
    planted(above / "cache", kernels, tmp_path / "ran")
    above.chmod(0o777)
    refused(above / "cache", kernels, tmp_path / "ran", above)
    above.chmod(0o1777)  # as /tmp
    file = codes(above / "cache")[0]
    file.unlink()
    assert [hits(kernels.cube) for _ in range(2)] == [0, 1]


@POSIX
def test_links_are_followed(directory, kernels, tmp_path, monkeypatch):
    planted(directory, kernels, tmp_path / "ran")
    directory.chmod(0o777)
    link = tmp_path / "link"
    link.symlink_to(directory)
    monkeypatch.setenv("BSERIES_CACHE", str(link))
    refused(link, kernels, tmp_path / "ran", directory)


@ROOT_ONLY
def test_nor_one_of_another_user(directory, kernels, tmp_path):
    planted(directory, kernels, tmp_path / "ran")
    os.chown(directory, 12345, 12345)
    refused(directory, kernels, tmp_path / "ran", directory)


@POSIX
@pytest.mark.parametrize("mode", [0o666, 0o620, 0o602])
def test_a_file_that_others_can_write_is_made_anew(directory, kernels, tmp_path, mode):
    file = planted(directory, kernels, tmp_path / "ran")
    file.chmod(mode)
    assert [hits(kernels.cube) for _ in range(2)] == [0, 1]
    assert file.stat().st_mode & 0o777 == 0o600
    assert not (tmp_path / "ran").exists()


@ROOT_ONLY
def test_a_file_of_another_user_is_made_anew(directory, kernels, tmp_path):
    file = planted(directory, kernels, tmp_path / "ran")
    os.chown(file, 12345, 12345)
    assert [hits(kernels.cube) for _ in range(2)] == [0, 1]
    assert file.stat().st_uid == 0
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO])
def test_a_full_disk_is_told_once(directory, kernels, monkeypatch, code):
    def full(*arguments):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "open", full)
    with pytest.warns(RuntimeWarning, match=f"{WARNING}the cache {directory} cannot be written .{os.strerror(code)}"):
        assert hits(kernels.cube) == 0
    assert hits(kernels.cube) == 0
    assert codes(directory) == []


@POSIX
def test_a_file_that_ends_too_early_is_removed(directory, kernels):
    program = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
sys.path.insert(0, sys.argv[1])
import kernels
from bseries_base import machine_code
print(machine_code.njit()(kernels.cube)(3.0))
"""
    command = [sys.executable, "-c", program, str(Path(kernels.__file__).parent)]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert ended.stdout == "27.0\n"
    assert f"{WARNING}the cache {directory} cannot be written (File too large)" in ended.stderr
    assert list(directory.iterdir()) == []


@pytest.mark.parametrize("code", [errno.EACCES, errno.EPERM, errno.EROFS])
def test_a_cache_that_cannot_be_written_is_still_read(directory, kernels, monkeypatch, code):
    hits(kernels.cube)

    def refuse(*arguments, **options):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(Path, "mkdir", refuse)
    assert hits(kernels.cube) == 1
    assert hits(kernels.cube, 3, value=27) == 0


@pytest.mark.parametrize("place", ["file/cache", "file", "/dev/null/cache", "/proc/nothing/cache"])
def test_where_nothing_can_be_written_code_stays_in_memory(tmp_path, kernels, monkeypatch, place):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("BSERIES_CACHE", str(tmp_path / place))
    assert [hits(kernels.cube) for _ in range(2)] == [0, 0]


def test_a_user_without_a_home(kernels, monkeypatch):
    def homeless(self):
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setenv("BSERIES_CACHE", "~/cache")
    monkeypatch.setattr(Path, "expanduser", homeless)
    assert [hits(kernels.cube) for _ in range(2)] == [0, 0]


def test_the_directory(monkeypatch):
    monkeypatch.setenv("BSERIES_CACHE", "~/elsewhere")
    assert cache_directory() == Path.home() / "elsewhere"
    monkeypatch.setenv("BSERIES_CACHE", "")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    monkeypatch.setenv("LOCALAPPDATA", "/data")
    for platform, expected in [
        ("linux", Path("/somewhere/bseries-engine")),
        ("darwin", Path.home() / "Library" / "Caches" / "bseries-engine"),
        ("win32", Path("/data/bseries-engine")),
    ]:
        monkeypatch.setattr(sys, "platform", platform)
        assert cache_directory() == expected.absolute()


RUN = """
import numba, bseries as bs
print(bs.__file__)
print(bs.integrate("rk4", bs.scene("pendulum"), h=.1, steps=10).y[1, -1])
bs.modified_equation(bs.method("rk4"), 7)
"""


@pytest.mark.slow
def test_the_library_runs_where_nothing_is_writable(tmp_path):
    """Installed where `__pycache__` cannot be made, with neither a home nor a cache."""
    for name in ("bseries_base", "trees", "integrators", "bseries"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
        for folder in [tmp_path / name, *(path for path in (tmp_path / name).rglob("*") if path.is_dir())]:
            (folder / "__pycache__").write_text("")
    kept = {name: value for name, value in os.environ.items() if "CACHE" not in name}
    environment = {**kept, "HOME": "/dev/null", "PYTHONPATH": str(tmp_path), "PYTHONWARNINGS": "error"}
    command = [sys.executable, "-c", RUN]
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    path, value = ended.stdout.split()
    assert Path(path).is_relative_to(tmp_path)
    assert -1.5 < float(value) < 1.5
