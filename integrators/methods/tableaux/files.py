"""Tableau files in JSON and TOML; a method written is read back as an equal one.

    {"name": "heun2", "A": [[0, 0], [1, 0]], "b": ["1/2", "1/2"], "c": [0, 1]}

Further keys: ``embedded`` (one or several rows of weights), ``parameters`` (symbols in formulas), ``digits`` (correct
digits of published decimals), ``reference``, ``domain`` ("float": numbers are doubles instead of exact decimals).
Instead of A, b and c a file may have ``algebra`` (``polynomial``, ``A``, ``b``, see `StageAlgebra`) or ``partitions``
(name to tableau).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from decimal import Decimal
from fractions import Fraction
from typing import IO, TYPE_CHECKING, Any

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten, shown
from integrators.core.text_files import FORMATS, atomic_write, check_keys, json_text, parse_json, parse_toml, read_text
from integrators.exact.entries import read_entry
from integrators.exact.expressions import decimal_text, format_number
from integrators.methods.tableaux.partitioned import PartitionedRungeKutta
from integrators.methods.tableaux.runge_kutta import RungeKutta, emit
from integrators.methods.tableaux.stage_algebra import StageAlgebra

if TYPE_CHECKING:
    Method = RungeKutta | PartitionedRungeKutta

LABELS = ("name", "reference")
PART_KEYS = ("name", "A", "b", "c", "embedded", "algebra", "parameters", "digits", "reference", "domain")
KEYS = (*PART_KEYS, "partitions")
LARGEST_NUMBER = 2**53
"""Larger integers are written as text, since many JSON readers convert numbers to doubles."""


def load_method(source: str | os.PathLike[str] | IO[Any], format: str | None = None) -> Method:
    """Read a method from a file.

    Args:
        source: a path, or an open file of text or bytes.
        format: ``"json"`` or ``"toml"``; by default inferred from the suffix or the content.

    Returns:
        The method; a `TableauWarning` is emitted for each of its issues.

    Raises:
        IntegratorError: the file cannot be read, is not JSON or TOML, or contains no tableau.

    Example:
        >>> import io
        >>> heun = load_method(io.StringIO('A = [[0, 0], [1, 0]]\\nb = ["1/2", "1/2"]'), "toml")
        >>> heun.b
        (Fraction(1, 2), Fraction(1, 2))
    """
    text, label = read_text(source)
    if format is None:
        format = _suffix(label) or ("json" if text.lstrip().startswith("{") else "toml")
    method = _read(text, format, label)
    emit(method.issues)
    return method


def loads_method(text: str, format: str, *, source: str = "text") -> Method:
    """Read a method from text.

    Args:
        text: the content of a tableau file.
        format: ``"json"`` or ``"toml"``.
        source: the name of the text in messages.

    Returns:
        The method; a `TableauWarning` is emitted for each of its issues.

    Raises:
        IntegratorError: the text is not JSON or TOML, or contains no tableau.

    Example:
        >>> loads_method('{"A": [[0.1]], "b": [1], "c": ["1/10"]}', "json").A
        ((Fraction(1, 10),),)
    """
    method = _read(text, format, source)
    emit(method.issues)
    return method


def _read(text: str, format: str, source: str) -> Method:
    parse = {"json": parse_json, "toml": parse_toml}[_checked_format(format)]
    try:
        return _read_method(parse(text))
    except RecursionError:
        raise IntegratorError(f"{shorten(source, 200)}: nesting must be flat, but was too deep") from None
    except IntegratorError as error:
        raise IntegratorError(f"{shorten(source, 200)}: {error}") from None


def save_method(method: Method, path: str | os.PathLike[str], format: str | None = None) -> None:
    """Write a method to a file, from which `load_method` reads an equal one.

    Args:
        method: the method.
        path: the file, which is replaced atomically.
        format: ``"json"`` or ``"toml"``; by default inferred from the suffix.

    Raises:
        IntegratorError: the format is unknown or the file cannot be written.

    Example:
        >>> import pathlib, tempfile
        >>> from integrators import method
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder, "gauss3.toml")
        ...     save_method(method("gauss3"), path)
        ...     load_method(path) == method("gauss3")
        True
    """
    if format is None and not _suffix(os.fspath(path)):
        raise IntegratorError(f"path must end in .json or .toml, but was {shorten(os.fspath(path))}")
    atomic_write(path, dumps_method(method, format or _suffix(os.fspath(path))))


def dumps_method(method: Method, format: str) -> str:
    """A method as the text of a tableau file.

    Args:
        method: the method.
        format: ``"json"`` or ``"toml"``.

    Returns:
        The text.

    Raises:
        IntegratorError: the format is unknown.

    Example:
        >>> print(dumps_method(RungeKutta([["1/2"]], [1], name="implicit-midpoint"), "json"), end="")
        {
          "name": "implicit-midpoint",
          "A": [
            ["1/2"]
          ],
          "b": [1],
          "c": ["1/2"]
        }
    """
    data = _write_method(method)
    if _checked_format(format) == "json":
        return json_text(data) + "\n"
    import tomli_w

    return tomli_w.dumps(data)


def _suffix(path: str) -> str:
    suffix = os.path.splitext(path)[1][1:].lower()
    return suffix if suffix in FORMATS else ""


def _checked_format(format: str) -> str:
    if format not in FORMATS:
        raise IntegratorError(f"format must be json or toml, but was {shorten(str(format))}")
    return format


def _read_method(data: Any) -> Method:
    check_keys(data, KEYS, "content")
    if "partitions" not in data:
        return _read_tableau(data, ())
    check_keys(data, (*LABELS, "parameters", "partitions"), "a partitioned method")
    partitions = data["partitions"]
    if not isinstance(partitions, dict):
        raise IntegratorError(f"partitions must map names to tableaux, but was {shown(partitions)}")
    parameters = items(data.get("parameters", ()), "parameters")
    parts = {name: _prefixed(name, _read_tableau, part, parameters) for name, part in partitions.items()}
    return PartitionedRungeKutta(parts, **{key: data.get(key) for key in LABELS}, warn=False)


def _prefixed(name: str, read: Callable[..., RungeKutta], *arguments: Any) -> RungeKutta:
    try:
        return read(*arguments)
    except IntegratorError as error:
        raise IntegratorError(f"partition {shorten(name)}: {error}") from None


def _read_tableau(data: Any, parameters: Iterable[str]) -> RungeKutta:
    check_keys(data, PART_KEYS, "a tableau")
    labels = {key: data.get(key) for key in LABELS}
    if "algebra" in data:
        check_keys(data, (*LABELS, "algebra"), "a method given by an algebra")
        return RungeKutta.from_algebra(_read_algebra(data["algebra"]), **labels)
    for key in ("A", "b"):
        if key not in data:
            raise IntegratorError(f"content must have the key {key}, but had {shorten(', '.join(data) or 'none')}")
    if data.get("domain", "float") != "float":
        raise IntegratorError(f"domain must be float or left out, but was {shown(data['domain'])}")
    rows = {key: data[key] for key in ("A", "b", "c", "embedded") if key in data}
    if "domain" in data:
        rows = {key: _as_floats(value) for key, value in rows.items()}
    method = RungeKutta(
        **rows,
        parameters=[*parameters, *items(data.get("parameters", ()), "parameters")],
        digits=data.get("digits"),
        **labels,
        warn=False,
    )
    return method.to_float() if "domain" in data else method


def _as_floats(value: Any) -> Any:
    """Nested lists with numbers as doubles; `RungeKutta` checks everything else."""
    if isinstance(value, list):
        return [_as_floats(entry) for entry in value]
    # Through text, an integer beyond the largest double becomes infinite and is refused as such.
    return float(str(value)) if isinstance(value, int | Decimal) and not isinstance(value, bool) else value


def _read_algebra(data: Any) -> StageAlgebra:
    check_keys(data, ("polynomial", "A", "b"), "algebra")
    for key in ("polynomial", "A", "b"):
        if key not in data:
            raise IntegratorError(f"algebra must have the key {key}, but had {', '.join(data) or 'none'}")
    rows = [items(row, f"row {i} of algebra.A") for i, row in enumerate(items(data["A"], "algebra.A"), 1)]
    polynomial, b = (items(data[key], f"algebra.{key}") for key in ("polynomial", "b"))
    read = [[read_entry(value, "an entry of algebra") for value in row] for row in (polynomial, b, *rows)]
    return StageAlgebra(read[0], read[2:], read[1])


def _write_method(method: Method) -> dict[str, Any]:
    """The method as the dictionary of a file, without absent entries."""
    if isinstance(method, PartitionedRungeKutta):
        partitions = dict(zip(method.names, map(_write_method, method.partitions), strict=True))
        return {**_labels(method), "partitions": partitions}
    if not isinstance(method, RungeKutta):
        raise IntegratorError(f"method must be a RungeKutta or PartitionedRungeKutta, but was {shown(method)}")
    algebra = method.algebra
    if algebra is not None:
        polynomial, b = _numbers(algebra.polynomial), _numbers(algebra.b)
        return {
            **_labels(method),
            "algebra": {"polynomial": polynomial, "A": [_numbers(row) for row in algebra.A], "b": b},
        }
    data = _labels(method)
    if method.parameters:
        data["parameters"] = list(method.parameters)
    if method.digits is not None:
        data["digits"] = method.digits
    if method.domain == "float":
        data["domain"] = "float"
    write = decimal_text if method.domain == "decimal" else format_number
    data |= {"A": [_numbers(row, write) for row in method.A], "b": _numbers(method.b, write)}
    # Formulas of row sums can exceed the limit of length; summing again gives equal ones.
    if method.domain not in ("algebraic", "symbolic") or method.c != method.row_sums:
        data["c"] = _numbers(method.c, write)
    if method.embedded:
        data["embedded"] = [_numbers(row, write) for row in method.embedded]
    return data


def _labels(method: Method) -> dict[str, Any]:
    labels = {"name": method.name, "reference": method.reference}
    return {key: value for key, value in labels.items() if value is not None}


def _numbers(values: Iterable[Any], write: Callable[[Any], str] = format_number) -> list[Any]:
    """Doubles unchanged, small integers as numbers, everything else as text."""
    return [
        value
        if isinstance(value, float)
        else int(value)
        if isinstance(value, Fraction) and value.denominator == 1 and abs(value) < LARGEST_NUMBER
        else write(value)
        for value in values
    ]
