"""Files of methods in JSON and TOML; a method written is read back as an equal one.

    {"name": "heun2", "A": [[0, 0], [1, 0]], "b": ["1/2", "1/2"], "c": [0, 1]}

Further keys: ``embedded`` (one or several rows of weights), ``parameters`` (symbols in formulas), ``digits`` (correct
digits of published decimals), ``reference``, ``domain`` ("float": numbers are doubles instead of exact decimals).
Instead of A, b and c a file may have ``algebra`` (``polynomial``, ``A``, ``b``, see `StageAlgebra`), ``partitions``
(name to tableau), or ``form``, a low-storage or Shu–Osher form: its ``kind``, such as 2N, and its coefficients by name.
Methods with memory have a ``kind`` and the arguments of their class:

    {"kind": "linear-multistep", "name": "ab2", "alpha": [0, -1, 1], "beta": ["-1/2", "3/2", 0]}
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable
from decimal import Decimal
from typing import IO, Any

from bseries_base.errors import shorten, shown
from integrators.core import text_files
from integrators.core.arguments import items
from integrators.core.errors import IntegratorError
from integrators.core.text_files import atomic_write
from integrators.exact.entries import read_entry
from integrators.methods.kinds.memory import GeneralLinear, LinearMultistep, MethodWithMemory, TwoStepRungeKutta
from integrators.methods.tableaux.partitioned import PartitionedRungeKutta
from integrators.methods.tableaux.registers import read_form
from integrators.methods.tableaux.runge_kutta import RungeKutta, emit
from integrators.methods.tableaux.stage_algebra import StageAlgebra

Method = RungeKutta | PartitionedRungeKutta | MethodWithMemory

LABELS = ("name", "reference")
PART_KEYS = ("name", "A", "b", "c", "embedded", "algebra", "form", "parameters", "digits", "reference", "domain")
KEYS = (*PART_KEYS, "partitions")
OPTIONAL = ("rescaled", "finishing")
WITH_MEMORY: dict[str, tuple[Callable[..., MethodWithMemory], tuple[str, ...]]] = {
    LinearMultistep.kind: (LinearMultistep, ("alpha", "beta", "rescaled")),
    GeneralLinear.kind: (GeneralLinear, ("A", "U", "B", "V", "finishing")),
    TwoStepRungeKutta.kind: (TwoStepRungeKutta, ("d", "theta", "A", "b", "Ahat", "bhat")),
}
"""The classes and keys of methods with memory, by the kind in files."""


def load_method(
    source: str | os.PathLike[str] | IO[str] | IO[bytes], format: str | None = None, *, digits: int | None = None
) -> Method:
    """Read a method from a file; a `TableauWarning` is emitted for each of its issues.

    Args:
        source: a path, or an open file of text or bytes.
        format: ``"json"`` or ``"toml"``; by default inferred from the suffix or the content.
        digits: the number of correct significant digits of decimals, in place of that in the file.

    Raises:
        IntegratorError: the file cannot be read, is not JSON or TOML, or contains no tableau.

    Example:
        >>> import bseries as bs
        >>> import io
        >>> heun = bs.load_method(io.StringIO('A = [[0, 0], [1, 0]]\\nb = ["1/2", "1/2"]'), "toml")
        >>> heun.b
        (Fraction(1, 2), Fraction(1, 2))
    """
    text, label = text_files.read_text(source)
    if format is None:
        format = _suffix(label) or ("json" if text.lstrip().startswith("{") else "toml")
    method = loads_method(text, format, source=label, warn=False, digits=digits)
    emit(method.issues)
    return method


def loads_method(
    text: str, format: str, *, source: str = "text", warn: bool = True, digits: int | None = None
) -> Method:
    """Read a method from text in JSON or TOML, as `load_method` does; messages name it `source`."""
    parse = {"json": text_files.parse_json, "toml": text_files.parse_toml}[_checked_format(format)]
    with text_files.errors_from(source):
        method = _read_method(parse(text), digits)
    if warn:
        emit(method.issues)
    return method


def save_method(method: Method, path: str | os.PathLike[str], format: str | None = None) -> None:
    """Write a method to a file, from which `load_method` reads an equal one.

    Args:
        path: the file, which is replaced atomically.
        format: ``"json"`` or ``"toml"``; by default inferred from the suffix.

    Raises:
        IntegratorError: the format is unknown or the file cannot be written.

    Example:
        >>> import bseries as bs
        >>> import pathlib, tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder, "gauss3.toml")
        ...     bs.save_method(bs.method("gauss3"), path)
        ...     bs.load_method(path) == bs.method("gauss3")
        True
    """
    if format is None and not _suffix(os.fspath(path)):
        raise IntegratorError(f"path must end in .json or .toml, but was {shorten(os.fspath(path))}")
    atomic_write(path, dumps_method(method, format or _suffix(os.fspath(path))))


def dumps_method(method: Method, format: str) -> str:
    """A method as the text of a tableau file in JSON or TOML."""
    if not isinstance(method, Method):
        raise IntegratorError(
            f"method must be a RungeKutta, a PartitionedRungeKutta or a method with memory, but was {shown(method)}"
        )
    data = method.to_dict()
    if _checked_format(format) == "json":
        return text_files.json_text(data) + "\n"
    import tomli_w

    return tomli_w.dumps(data)


def _suffix(path: str) -> str:
    suffix = os.path.splitext(path)[1][1:].lower()
    return suffix if suffix in text_files.FORMATS else ""


def _checked_format(format: str) -> str:
    if format not in text_files.FORMATS:
        raise IntegratorError(f"format must be json or toml, but was {shorten(str(format))}")
    return format


def _read_method(data: Any, digits: int | None) -> Method:
    if _has_kind(data):
        return _read_with_memory(data, digits)
    text_files.check_keys(data, KEYS, "content")
    if "partitions" not in data:
        return _read_tableau(data, (), digits)
    text_files.check_keys(data, (*LABELS, "parameters", "partitions"), "a partitioned method")
    partitions = data["partitions"]
    if not isinstance(partitions, dict):
        raise IntegratorError(f"partitions must map names to tableaux, but was {shown(partitions)}")
    parameters = items(data.get("parameters", ()), "parameters")
    parts = {}
    for name, part in partitions.items():
        with text_files.errors_from(f"partition {shorten(name)}"):
            parts[name] = _read_tableau(part, parameters, digits)
    return PartitionedRungeKutta(parts, **{key: data.get(key) for key in LABELS}, warn=False)


def _has_kind(data: object) -> bool:
    return isinstance(data, dict) and "kind" in data


def _read_with_memory(data: Any, digits: int | None) -> MethodWithMemory:
    if not isinstance(data["kind"], str) or data["kind"] not in WITH_MEMORY:
        raise IntegratorError(f"kind must be one of {', '.join(WITH_MEMORY)}, but was {shown(data['kind'])}")
    make, keys = WITH_MEMORY[data["kind"]]
    text_files.check_keys(data, (*LABELS, "schema", "kind", "parameters", *keys), "content")
    _require_keys(data, [key for key in keys if key not in OPTIONAL], "content")
    given = {key: data[key] for key in keys if key in data}
    labels: dict[str, Any] = {key: data.get(key) for key in LABELS}
    labels |= {"parameters": items(data.get("parameters", ()), "parameters"), "digits": digits}
    return make(**given, **labels)


def _read_tableau(data: Any, parameters: Iterable[str], digits: int | None) -> RungeKutta:
    text_files.check_keys(data, PART_KEYS, "a tableau")
    labels = {key: data.get(key) for key in LABELS}
    if "algebra" in data:
        text_files.check_keys(data, (*LABELS, "algebra"), "a method given by an algebra")
        if digits is not None:
            raise IntegratorError(f"digits must be left out for a method given by an algebra, but was {shown(digits)}")
        return RungeKutta.from_algebra(_read_algebra(data["algebra"]), **labels)
    if data.get("domain", "float") != "float":
        raise IntegratorError(f"domain must be float or left out, but was {shown(data['domain'])}")
    parameters = [*parameters, *items(data.get("parameters", ()), "parameters")]
    digits = data.get("digits") if digits is None else digits
    if "form" in data:
        text_files.check_keys(data, (*LABELS, "form", "parameters", "digits", "domain"), "a method given by a form")
        form = _as_floats(data["form"]) if "domain" in data else data["form"]
        return RungeKutta.from_form(read_form(form, parameters, digits), **labels, warn=False)
    _require_keys(data, ("A", "b"), "content")
    rows = {key: data[key] for key in ("A", "b", "c", "embedded") if key in data}
    if "domain" in data:
        rows = {key: _as_floats(value) for key, value in rows.items()}
    method = RungeKutta(
        **rows,
        parameters=parameters,
        digits=digits,
        **labels,
        warn=False,
    )
    return method.to_float() if "domain" in data else method


def _require_keys(data: Collection[str], keys: Iterable[str], argument: str) -> None:
    for key in keys:
        if key not in data:
            raise IntegratorError(f"{argument} must have the key {key}, but had {shorten(', '.join(data) or 'none')}")


def _as_floats(value: object) -> object:
    """Nested lists and objects with numbers as doubles; `RungeKutta` checks everything else."""
    if isinstance(value, list):
        return [_as_floats(entry) for entry in value]
    if isinstance(value, dict):
        return {key: _as_floats(entry) for key, entry in value.items()}
    # Through text, an integer beyond the largest double becomes infinite and is refused as such.
    return float(str(value)) if isinstance(value, int | Decimal) and not isinstance(value, bool) else value


def _read_algebra(data: Any) -> StageAlgebra:
    text_files.check_keys(data, ("polynomial", "A", "b"), "algebra")
    _require_keys(data, ("polynomial", "A", "b"), "algebra")
    rows = [items(row, f"row {i} of algebra.A") for i, row in enumerate(items(data["A"], "algebra.A"), 1)]
    polynomial, b = (items(data[key], f"algebra.{key}") for key in ("polynomial", "b"))
    read = [[read_entry(value, "an entry of algebra") for value in row] for row in (polynomial, b, *rows)]
    return StageAlgebra(read[0], read[2:], read[1])
