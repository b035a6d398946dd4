"""Sources of trajectories in files: of this package, NPZ of any program, and text."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import suppress
from itertools import chain, islice
from typing import IO, TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.shadow.roundings import Rounding, written
from bseries.shadow.scene_forces import SceneForces
from bseries.shadow.sources import ALIASES, VECTORS, Source, array_source, check_roles, choose, with_equivalents
from integrators.core.stored_arrays import StoredArrays
from integrators.core.text_files import read_lines
from integrators.runs.trajectory import PART, RUN
from integrators.scenes.files import scene_from_table

if TYPE_CHECKING:
    from bseries.shadow.scene_forces import SceneForces
    from bseries.shadow.sources import Columns
    from integrators import Trajectory


SAMPLE = 64
"""Number of lines that determine the columns and the rounding of numbers."""
AXES = re.compile(r"[xyz]\d*")
ROLE = re.compile(r"(gradU|[qpvFf])_?((?:[xyz]|\d|_)+)")


def text_source(
    path: str | IO[Any], label: str, columns: Mapping[str, str] | None, forces: SceneForces | None
) -> Source:
    """The source of a table in a text file.

    Args:
        path: The file, or an open one that is read once.
        label: Its name in messages.
        columns: Patterns of headings by role, as in ``{"q": "x*,y*"}``.
        forces: The scene that supplies potentials and forces, if any.
    """
    head, rest = _head(path, label)
    heading = head[0] if head else ""
    separator = next((mark for mark in ",;\t" if mark in heading), None)
    names = [name.strip().strip('"') for name in heading.lstrip("# ").split(separator) if name.strip()]
    if not names or all(map(_is_number, names)):
        raise SeriesError(f"{label} must begin with the names of its columns, but began with {heading!r:.60}")
    found = _roles(names, columns, label, forces)
    column = {name: k for k, name in enumerate(names)}
    places = {role: [column[name] for name in chosen] for role, chosen in found.items()}

    def blocks(size: int) -> Iterator[Columns]:
        import numpy as np

        lines, start = chain(head[1:], rest), 0
        while piece := list(islice(lines, size)):
            table = _numbers(piece, separator, len(names), label, start)
            start += len(piece)
            yield {
                role: np.ascontiguousarray(table[:, chosen] if role in VECTORS else table[:, chosen[0]])
                for role, chosen in places.items()
            }

    return Source(label, blocks, None, len(places["q"]), _roundings(head[1:], separator, names, places), forces=forces)


def _head(path: str | IO[Any], label: str) -> tuple[list[str], Iterator[str]]:
    """The first lines, and an iterator over the others; a file is only open while it is read."""
    if not isinstance(path, str):
        lines = _lines(path, label)
        return list(islice(lines, SAMPLE)), lines
    with _open(path, label) as file:
        head = list(islice(_lines(file, label), SAMPLE))

    def rest() -> Iterator[str]:
        with _open(path, label) as file:
            yield from islice(_lines(file, label), len(head), None)

    return head, rest()


def _open(path: str, label: str) -> IO[str]:
    try:
        return open(path, encoding="utf-8-sig")
    except OSError as error:
        raise SeriesError(f"{label} must be a readable file, but was not: {error.strerror}") from None


def _lines(file: IO[Any], label: str) -> Iterator[str]:
    """The nonempty lines without comments; the heading may be one."""
    is_first = True
    try:
        for line in read_lines(file, label):
            text = line.strip()
            if text and (is_first or not text.startswith("#")):
                is_first = False
                yield text
    except UnicodeDecodeError as error:
        encoding = _encoding(error.object)
        if encoding is None:
            raise SeriesError(f"{label} must be text or an NPZ file, but was neither") from None
        raise SeriesError(f"{label} must be text in UTF-8, but seems to be in {encoding}") from None


def _encoding(data: bytes) -> str | None:
    """A guess at the encoding of text that is not UTF-8; None for binary data."""
    if 4 * data.count(0) > len(data) and data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "UTF-16"
    letters = sum(32 <= byte < 127 or byte in b"\t\r\n" for byte in data)
    return "Latin-1" if 10 * letters > 9 * len(data) and not data.count(0) else None


def _roles(
    names: Sequence[str], columns: Mapping[str, str] | None, label: str, forces: SceneForces | None
) -> dict[str, list[str]]:
    """The columns of each role: as chosen, by the names of a scene, or by their own names."""
    roles = tuple(role for role in ALIASES if role not in ("mass", "h"))
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise SeriesError(f"{label} must have different names, but has {twice!r:.60} twice")
    if columns is None and forces is not None and {name for block in forces.names for name in block} <= set(names):
        momenta, positions = map(list, forces.names)
        return {"p": momenta, "q": positions} | choose(names, None, label, roles=("t",))
    near = _by_coordinate(names, with_equivalents(columns or ()), label)
    several = {role: there for role, there in near.items() if len(there) > 1}  # x beside y is not all positions
    found = near | choose(names, columns, label, roles=roles) | several
    check_roles(found, label, with_forces=forces is not None)
    for role in VECTORS:
        if role in found and len(found[role]) != len(found["q"]):
            raise SeriesError(
                f"{label} must have as many columns for {role} as for q, {len(found['q'])}, but has {len(found[role])}"
            )
    return found


def _by_coordinate(names: Sequence[str], chosen: Set[str], label: str) -> dict[str, list[str]]:
    """Columns such as q1, q2, p1, p2, or x1, y1, vx1, vy1, fx1, fy1, in the same order for each role not chosen."""
    found: dict[str, dict[str, str]] = {}
    for name in names:
        match = ROLE.fullmatch(name)
        role = "q" if AXES.fullmatch(name) else match and match[1].replace("f", "F")
        if role and role not in chosen:
            found.setdefault(role, {})[name if match is None else match[2].strip("_")] = name
    order = found.get("q")
    for role, there in found.items() if order else ():
        missing = next((key for key in order or () if key not in there), None)
        if missing is not None:
            raise SeriesError(f"{label} must have a column {role}{missing} beside {found['q'][missing]}, but has none")
    return {role: [there[key] for key in order or there] for role, there in found.items()}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return text.isascii() and "_" not in text  # Python also reads other digits and underscores


def _numbers(lines: Sequence[str], separator: str | None, width: int, label: str, start: int) -> Any:
    """Lines as an array of numbers."""
    import numpy as np

    try:
        table = np.loadtxt(lines, delimiter=separator, ndmin=2, comments=None)
    except ValueError:
        table = None
    if table is None or table.shape[1] != width:
        for k, line in enumerate(lines, start + 1):
            cells = line.split(separator)
            bad = next((cell for cell in cells if not _is_number(cell)), None)
            if bad is not None:
                raise SeriesError(f"{label} must have numbers in state {k}, but one was {bad.strip()!r:.60}")
            if len(cells) != width:
                raise SeriesError(f"{label} must have {width} numbers for state {k}, but has {len(cells)}")
        raise SeriesError(
            f"{label} must have plain numbers in states {start + 1} to {start + len(lines)}, but some were not"
        )
    return table


def _roundings(
    lines: Sequence[str], separator: str | None, names: Sequence[str], places: Mapping[str, Sequence[int]]
) -> dict[str, Rounding]:
    """The rounding of numbers of each role, from the way they are written."""
    import numpy as np

    rows = [[cell.strip() for cell in line.split(separator)] for line in lines]
    whole = [row for row in rows if len(row) == len(names)]  # others are refused where they are read
    chosen = sorted({k for columns in places.values() for k in columns})
    of = dict(zip(chosen, written([[row[k] for row in whole] for k in chosen]), strict=True))
    tables = {role: np.array([of[k] for k in columns]).T for role, columns in places.items()}
    return {role: Rounding(*(table if role in VECTORS else table[:, 0])) for role, table in tables.items()}


MOST_LETTERS = 100
"""Most characters of a path in a message."""


def open_source(trajectory: Any, columns: Mapping[str, str] | None = None, forces: SceneForces | None = None) -> Source:
    """The source of a trajectory.

    Args:
        trajectory: A `Trajectory`, arrays by name, the path of a file, or an open text file.
        columns: Names, or patterns of names, by role.
        forces: The scene that supplies potentials and forces, if there is one.
    """
    from integrators import Trajectory, load_trajectory

    if isinstance(trajectory, Trajectory):
        if columns is not None:
            raise SeriesError("columns must be left out for a Trajectory, which has names of its own, but was given")
        return _own(trajectory, "trajectory", forces)
    if isinstance(trajectory, Mapping):
        return array_source(trajectory, "trajectory", columns, forces)
    if hasattr(trajectory, "readline"):
        name = getattr(trajectory, "name", None)
        known = isinstance(name, str) and not name.startswith("<")
        return text_source(trajectory, str(name) if known else "standard input", columns, forces)
    if not isinstance(trajectory, str | os.PathLike):
        raise SeriesError(f"trajectory must be a Trajectory, arrays by name, or a path, but was {trajectory!r:.60}")
    path = os.fspath(trajectory)
    label = path if len(path) < MOST_LETTERS else f"…{path[-MOST_LETTERS:]}"
    if not os.path.exists(path) and not os.path.isdir(path + PART):
        raise SeriesError(f"{label} must be a trajectory file, but there is none")
    if os.path.isdir(path) and not os.path.exists(os.path.join(path, RUN)):
        raise SeriesError(f"{label} must be a trajectory file, but was a folder")
    if _is_text(path):
        return text_source(path, label, columns, forces)
    if columns is None and _is_own(path):
        return _own(load_trajectory(path), label, forces)
    return array_source(StoredArrays(path, f"{label} must be an NPZ file, but was not"), label, columns, forces)


def _is_text(path: str) -> bool:
    """Whether a path is a file and no archive."""
    if not os.path.isfile(path) or path.lower().endswith(".npz"):
        return False
    with suppress(OSError), open(path, "rb") as file:
        return file.read(4) not in (b"PK\3\4", b"PK\5\6")
    return True


def _is_own(path: str) -> bool:
    """Whether a path is a trajectory of this package or the folder of a running one; unreadable files count as well."""
    from integrators import IntegratorError

    try:
        return not os.path.isfile(path) or {"t", "y", "variables"} <= set(StoredArrays(path, path))
    except IntegratorError:
        return True


def _own(run: Trajectory, label: str, forces: SceneForces | None) -> Source:
    """The source of a trajectory of this package, which stores its scene."""
    import numpy as np

    forces = forces or _stored_forces(run.meta.get("scene"), label)
    missing = next((name for block in forces.names for name in block if name not in run.variables), None)
    if missing is not None:
        raise SeriesError(
            f"{label} must have the variable {missing} of the scene, but has {', '.join(run.variables):.200}"
        )
    places = {role: _places(block, run.variables) for role, block in zip("pq", forces.names, strict=True)}

    def blocks(size: int) -> Iterator[Columns]:
        for start in range(0, len(run.t), size):
            piece = slice(start, start + size)
            rows = np.asarray(run.y[:, piece], dtype=float).T
            yield {"t": np.asarray(run.t[piece], dtype=float)} | {role: rows[:, x] for role, x in places.items()}

    method = (run.meta.get("method") or {}).get("name")
    every = run.meta.get("save_every", 1)
    dimension = len(forces.names[1])
    return Source(label, blocks, len(run.t), dimension, {}, h=run.h, every=every, method=method, forces=forces)


def _places(names: Sequence[str], variables: Sequence[str]) -> slice | list[int]:
    """The indices of variables; consecutive ones as a slice, which avoids copies."""
    places = [variables.index(name) for name in names]
    whole = slice(places[0], places[0] + len(places))
    return whole if tuple(variables[whole]) == tuple(names) else places


def _stored_forces(table: Any, label: str) -> SceneForces:
    """The forces of the scene stored with a trajectory."""
    if not isinstance(table, Mapping) or "variables" not in table:
        raise SeriesError(f"scene must be given, since {label} does not tell what the forces are, but was not")
    without = {key: x for key, x in table.items() if key != "invariants"}  # avoids checking them again
    effects = table.get("effects")
    if isinstance(effects, Mapping):
        without["effects"] = {
            name: {key: x for key, x in effect.items() if key != "breaks"} if isinstance(effect, Mapping) else effect
            for name, effect in effects.items()
        }
    return SceneForces(scene_from_table(without, f"scene of {label}"))
