"""The records of tableaus in files, folders and texts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from typing import Any, TypeAlias

from bseries.exceptions import SeriesError
from bseries_base.errors import BSeriesError, plain, shown
from integrators.methods.exchange.reading import read_tableaus
from integrators.methods.exchange.records import Record

Sources: TypeAlias = str | PathLike[str] | Iterable[str | PathLike[str]] | Mapping[str, str]
"""Files and folders, one or several; or texts by name."""

SUFFIXES = (
    *(".c", ".cc", ".cpp", ".cxx", ".def", ".h", ".hpp", ".jl", ".py", ".f", ".f90", ".f95", ".f03", ".f08", ".for"),
    *(".m", ".wl", ".nb", ".json", ".toml", ".csv", ".tex"),
)
"""Files of a folder that are read."""


def read_sources(sources: Sources) -> tuple[list[Record], list[str]]:
    """The tableaus in some sources, and a sentence for each source or table that could not be read."""
    records: list[Record] = []
    unread: list[str] = []
    for source, name in _texts_and_paths(sources):
        try:
            reading = read_tableaus(source, name=plain(name))
        except BSeriesError as error:
            unread.append(str(error))
            continue
        unread += reading.unread
        records += map(_named, reading.records)
    return records, unread


def _named(record: Record) -> Record:
    """A record with a name that terminals can show, that of its file in place of a variable such as A."""
    return replace(record, name=plain(Path(record.source).stem if len(record.name) == 1 else record.name))


def _texts_and_paths(sources: Any) -> Iterator[tuple[Any, str]]:
    """Texts or paths, with their names."""
    if isinstance(sources, Mapping):
        yield from ((text, name) for name, text in sources.items())
        return
    for source in [sources] if isinstance(sources, str | PathLike) else list(sources):
        path = Path(fspath(source))
        if path.is_dir():
            found = (p for p in sorted(path.rglob("*")) if p.suffix.lower() in SUFFIXES and p.is_file())
            yield from ((p, str(p)) for p in found)
        elif path.is_file():
            yield path, str(path)
        else:
            raise SeriesError(f"sources must be files and folders that exist, but was {shown(str(path))}")
