"""Machine code with a safe cache on disk: numba's decorators, and C functions that need numba to be compiled only.

Numba's own cache raises an error if its folder cannot be written, trusts damaged files, and runs code that other users
may have put there. Here the code of a function for one signature is one file, ``<cache>/<key>.code``: a checksum and
numba's data or object code. The key covers everything the code depends on: the text of the module and of further
`sources` (numba does not notice edits of callees in other files), options, types, the processor, and versions. The
cache is

- the folder that the environment variable ``BSERIES_CACHE`` names, else
- the user's own: ``$XDG_CACHE_HOME/bseries-engine`` or ``~/.cache/bseries-engine``, ``~/Library/Caches/bseries-engine``
  on macOS, ``%LOCALAPPDATA%\\bseries-engine`` on Windows.

It may be deleted at any time; missing or damaged files are made again. Files that were not used for longest are removed
where all have more than `MOST_BYTES`. Code stays in memory where nothing can be written, and, with a warning, where
others can write or the disk is full.
"""

from __future__ import annotations

import ctypes
import errno
import linecache
import os
import pickle
import stat
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from time import time
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from bseries_base.interrupts import outside_llvmlite

if TYPE_CHECKING:
    from numba.core.ccallback import CFunc
    from numba.core.codegen import JITCPUCodegen
    from numba.core.compiler import CompileResult
    from numba.core.cpu import CPUContext

PACKAGE = "bseries-engine"
UNWRITABLE = {errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOENT, errno.ENOTDIR, errno.EEXIST}
"""Errors of a place without write access, or of a file that another process has just written."""
MOST_BYTES = 2**30
"""Of the cache: some ten thousand files."""
KEPT = 0.75
"""The part of it that pruning leaves."""
DAY = 86_400.0
"""Seconds after which a file that is read is marked as used."""
SUFFIX = ".code"
CHECKSUM = 32
"""Bytes of SHA-256."""
_compiling: set[object] = set()
"""The functions, by their caches or keys, that are being compiled."""


Compiled: TypeAlias = Callable[..., Any]
"""A function that numba has compiled, or will compile, for the types of each call."""
Decorator: TypeAlias = Callable[[Callable[..., object]], Compiled]


def njit(signature: object = None, *, sources: Iterable[ModuleType | Path] = (), **options: Any) -> Decorator:
    """`numba.njit` with cached machine code, for a signature or for the types of each call.

    `sources` are modules or files, besides that of the function, on which the code depends.

    Example:
        >>> @njit(error_model="numpy")
        ... def inverse(x):
        ...     return 1 / x
        >>> inverse(0.0)
        inf
    """

    def decorate(function: Callable[..., object]) -> Compiled:
        import numba

        dispatcher: Any = numba.njit(**options)(function)
        dispatcher._cache = _Cache(function, sources, "njit", options)
        if signature is not None:
            dispatcher.compile(signature)
            dispatcher.disable_compile()
        return dispatcher

    return decorate


def cfunc(
    signature: object, *, sources: Iterable[ModuleType | Path] = (), **options: object
) -> Callable[[FunctionType], CFunc]:
    """`numba.cfunc` with cached machine code; the arguments are those of `njit`.

    Example:
        >>> @cfunc("float64(float64)")
        ... def half(x):
        ...     return x / 2
        >>> half.ctypes(3.0)
        1.5
    """

    def decorate(function: FunctionType) -> CFunc:
        from numba.core.ccallback import CFunc
        from numba.core.sigutils import normalize_signature

        made = CFunc(function, normalize_signature(signature), {}, options)
        made._cache = _Cache(function, sources, "cfunc", options)  # type: ignore[attr-defined]
        made.compile()
        return made

    return decorate


def cache_directory() -> Path | None:
    """The directory of the cache, which need not exist; None for a user without a home."""
    chosen = os.environ.get("BSERIES_CACHE")
    if sys.platform == "win32":
        parent = os.environ.get("LOCALAPPDATA") or "~/AppData/Local"
    elif sys.platform == "darwin":
        parent = "~/Library/Caches"
    else:
        parent = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    with suppress(RuntimeError):  # there is no home
        return Path(chosen or f"{parent}/{PACKAGE}").expanduser().absolute()


@cache
def has_numba() -> bool:
    """Whether numba is installed; browsers do not have it."""
    return find_spec("numba") is not None


def is_compiling() -> bool:
    """Whether machine code is being compiled, in any thread."""
    return bool(_compiling)


@cache
def package_version(package: str = PACKAGE) -> str:
    """The version of a package, by default of this one; empty if it is not installed."""
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        text = distribution(package).read_text("METADATA") or ""
    except PackageNotFoundError:  # a checkout that is not installed
        return ""
    return text.partition("\nVersion: ")[2].partition("\n")[0]  # `version` would load a parser of e-mails


class _Cache:
    """The cache of one function, with the interface that numba expects."""

    def __init__(self, function: Callable[..., object], sources: Iterable[ModuleType | Path], *options: object):
        self._function, self._options = function, options
        self._sources = [Path(str(getattr(source, "__file__", source))) for source in sources]

    @property
    def cache_path(self) -> str:
        """The path in numba's statistics."""
        return str(cache_directory())

    def load_overload(self, signature: object, target: CPUContext) -> CompileResult | None:
        """The cached code for a signature; None if there is none."""
        from numba.core.runtime.nrt import rtsys

        rtsys.initialize(target)  # `target.refresh()` would import what only compiling needs, for a quarter of a second
        found = self._load(signature, target)
        if found is None:
            _compiling.add(self)
        return found

    def _load(self, signature: object, target: CPUContext) -> CompileResult | None:
        """The code in the file for a signature; None without a file that can be trusted."""
        from numba.core.compiler import CompileResult

        content = _read(self._path(signature, target.codegen()))
        if content is None:
            return None
        try:
            found, code = pickle.loads(content)
            return CompileResult._rebuild(target, *code) if found == signature else None
        except Exception:  # unreadable files are made again
            return None

    def save_overload(self, signature: object, result: CompileResult) -> None:
        """Write compiled code to the cache, unless it contains addresses of this process."""
        from numba.core.serialize import dumps

        _compiling.discard(self)
        path = self._path(signature, result.codegen)
        if path is not None and not result.library.has_dynamic_globals:
            _keep(path, dumps((signature, result._reduce())))

    def _path(self, signature: object, codegen: JITCPUCodegen) -> Path | None:
        """The file; None without a home, or if the source text is not available."""
        import numba
        from numba.core.serialize import dumps

        function, code = self._function, self._function.__code__
        directory, text = cache_directory(), "".join(linecache.getlines(code.co_filename, function.__globals__))
        if directory is None or not text:
            return None
        versions = package_version(), numba.__version__, sys.implementation.cache_tag, codegen.magic_tuple()
        name = function.__module__, function.__qualname__, code.co_filename, code.co_firstlineno
        parts = [repr((versions, name, self._options, str(signature))).encode(), text.encode()]
        parts += [source.read_bytes() for source in self._sources]
        parts += [dumps(cell.cell_contents) for cell in function.__closure__ or ()]
        return directory / _name(parts)


class ObjectCode(NamedTuple):
    """The machine code of a C function named `FUNCTION`."""

    symbols: Sequence[str]  # the functions of the C library that it calls
    content: bytes  # an object file
    is_lasting: bool = True  # whether it refers to nothing of this process
    objects: Mapping[str, object] = {}  # the objects of Python to which its global pointers refer, by their names


FUNCTION = "function"


class MachineCode:
    """A C function in memory. Its machine code is freed with this object, which whoever knows the address must keep.

    Attributes:
        address: The address of the function.
    """

    @outside_llvmlite()
    def __init__(self, code: ObjectCode):
        """Load object code."""
        from llvmlite import binding

        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        for symbol in code.symbols:
            binding.add_symbol(symbol, c_address(symbol))
        target = binding.Target.from_triple(binding.get_process_triple()).create_target_machine(jit=True)
        self._loader = binding.create_mcjit_compiler(binding.parse_assembly(""), target)  # one for each can be freed
        self._loader.add_object_file(binding.ObjectFileRef.from_data(code.content))
        self._loader.finalize_object()
        self.address: int = self._loader.get_function_address(FUNCTION)
        if not self.address:
            raise AttributeError(FUNCTION)
        self._objects = code.objects
        for name, value in code.objects.items():
            ctypes.c_void_p.from_address(self._loader.get_global_value_address(name)).value = id(value)

    def function(self, prototype: Callable[[int], Compiled]) -> Compiled:
        """The function for calls from Python, of a type made by `ctypes.CFUNCTYPE`; it keeps the machine code."""
        made = prototype(self.address)
        made.code = self  # type: ignore[attr-defined]
        return made


@cache
def c_address(symbol: str) -> int:
    """The address of a function of the C library.

    Raises:
        AttributeError: There is no such function.
    """
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)  # Python's own
    return ctypes.cast(getattr(library, symbol), ctypes.c_void_p).value or 0


def c_function(key: str, make: Callable[[], ObjectCode]) -> MachineCode:
    """Load the machine code of a C function from the cache, without numba, or compile and keep it.

    Args:
        key: A name for the function, its source, and all sources on which its code depends.
        make: Compiles the function.
    """
    path = _object_path(key)
    content = _read(path)
    if content is not None:
        symbols, _, code = content.partition(b"\n")
        with suppress(AttributeError, UnicodeError):  # another C library
            return MachineCode(ObjectCode(symbols.decode().split(), code))
    _compiling.add(key)
    try:
        made = make()
    finally:
        _compiling.discard(key)
    if path is not None and made.is_lasting:
        _keep(path, " ".join(made.symbols).encode() + b"\n" + made.content)
    return MachineCode(made)


def _object_path(key: str) -> Path | None:
    """The file of a C function; None without a home, or without numba, on whose version it depends."""
    directory = cache_directory()
    if directory is None or not has_numba():
        return None
    return directory / _name([key.encode(), repr(surroundings()).encode()])


@cache
def surroundings() -> tuple[object, ...]:
    """The processor, the versions and numba's settings, on which all object code depends."""
    import llvmlite
    from llvmlite import binding

    processor = binding.get_process_triple(), binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    settings = sorted(item for item in os.environ.items() if item[0].startswith("NUMBA_"))
    return processor, settings, _version_of_numba(), llvmlite.__version__, sys.implementation.cache_tag


def _version_of_numba() -> bytes | str:
    """The file with numba's version, which is read in a hundredth of the time of `package_version`."""
    with suppress(OSError):
        return Path(str(getattr(find_spec("numba"), "origin", ""))).with_name("_version.py").read_bytes()
    return package_version("numba")


def _name(parts: Iterable[bytes]) -> str:
    """The name of the file for everything that code depends on."""
    return sha256(b"".join(sha256(part).digest() for part in parts)).hexdigest() + SUFFIX


def _read(path: Path | None) -> bytes | None:
    """The content of a file that can be trusted; None if there is none."""
    if path is None or not _is_private(path.parent):
        return None
    try:
        with open(path, "rb") as file:
            state = os.fstat(file.fileno())
            if not _is_own(state):
                return None
            if time() - state.st_mtime > DAY:
                with suppress(OSError):  # of others, or in a place that can only be read
                    os.utime(path)
            checksum, content = file.read(CHECKSUM), file.read()
    except OSError:
        return None
    return content if _checksum(path, content) == checksum else None


def _checksum(path: Path, content: bytes) -> bytes:
    """The checksum of a file, which also holds for its name: code of another function has another one."""
    return sha256(path.name.encode() + content).digest()


def _keep(path: Path, content: bytes) -> None:
    """Write a file where nobody else can write; warns if the disk does not permit it."""
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if _is_private(path.parent):
            _write(path, _checksum(path, content) + content)
            _prune(path.parent)
    except OSError as error:
        if error.errno not in UNWRITABLE:
            _warn(f"the cache {path.parent} cannot be written ({error.strerror})")


def _write(path: Path, content: bytes) -> None:
    """Write a new private file; the checksum reveals a truncated one."""
    path.unlink(missing_ok=True)
    try:
        with open(path, "xb", opener=lambda name, flags: os.open(name, flags, 0o600)) as file:
            file.write(content)
    except FileExistsError:  # by another process
        pass
    except OSError:
        with suppress(OSError):
            path.unlink()
        raise


@cache
def _prune(directory: Path) -> None:
    """Remove the files that were used longest ago, if all are too large; once in a process, after it compiles.

    Other processes keep what they have loaded, and compile what they miss.
    """
    files = []
    with os.scandir(directory) as entries:
        for entry in entries:
            if entry.name.endswith(SUFFIX) and len(entry.name) == 2 * CHECKSUM + len(SUFFIX):
                with suppress(OSError):  # another process has removed it
                    state = entry.stat(follow_symlinks=False)
                    files.append((state.st_mtime, state.st_size, entry.path))
    total = sum(size for _, size, _ in files)
    if total <= MOST_BYTES:
        return
    for _, size, path in sorted(files):
        if total <= KEPT * MOST_BYTES:
            break
        total -= size
        with suppress(OSError):
            os.unlink(path)


def _is_private(directory: Path) -> bool:
    """Whether nobody else can write to a directory; warns otherwise.

    Users who can write to a parent directory could replace the directory, but not by one that belongs to this user.
    So parents are refused only if they are world-writable without the sticky bit.
    """
    try:
        real = directory.resolve()
        for place in (real, *real.parents):
            state = place.stat()
            if not (_is_own(state) if place == real else _is_protected(state)):
                what = f"{place} has owner {state.st_uid} and mode {stat.S_IMODE(state.st_mode):o}"
                _warn(f"others may write to the cache {directory} ({what})")
                return False
    except (OSError, RuntimeError):  # it does not exist yet, or is a loop of links
        pass
    return True


def _is_own(state: os.stat_result) -> bool:
    """Whether only this user and root can write."""
    return os.name != "posix" or (state.st_uid in (0, os.geteuid()) and not state.st_mode & 0o022)


def _is_protected(state: os.stat_result) -> bool:
    """Whether a directory is not world-writable, or has the sticky bit (as /tmp)."""
    return os.name != "posix" or not state.st_mode & stat.S_IWOTH or bool(state.st_mode & stat.S_ISVTX)


@cache
def _warn(reason: str) -> None:
    """Warn once why nothing is cached."""
    warnings.warn(
        f"machine code is compiled in memory and not kept: {reason}; BSERIES_CACHE may name a folder of your own",
        RuntimeWarning,
        stacklevel=2,
    )
