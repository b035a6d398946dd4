"""Columns of a finished trajectory by role: from a run of this package, arrays by name, or a file of any program."""

from __future__ import annotations

import fnmatch
import os
import re
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from itertools import chain, islice
from types import ModuleType
from typing import IO, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from bseries.exceptions import SeriesError
from integrators import Scene
from integrators.compile.modules import load_module
from integrators.compile.printer import ModuleText
from integrators.compile.scene_source import energy_lines, field_lines
from integrators.core.text_files import read_lines
from integrators.runs.trajectory import Trajectory
from integrators.scenes.particles.parts import Piece, degrees
from integrators.scenes.text import scene_from_table

Columns: TypeAlias = Mapping[str, np.ndarray]
"""Consecutive states by role: t, U (steps,); q, p, v, F, gradU (steps, coordinates)."""

MEANINGS = {"q": "positions", "p": "momenta", "v": "velocities", "U": "the potential", "F": "forces"}
MEANINGS |= {"gradU": "the potential's gradient"}
VECTORS = ("q", "p", "v", "F", "gradU")
TEXT_ROLES = ("t", "q", "p", "v", "U", "F", "gradU")
ROLES = (*TEXT_ROLES, "mass", "h")
"""Names of columns and of arrays; columns of vectors are numbered, as q1, q2."""
SAME = {"p": "v", "v": "p", "F": "gradU", "gradU": "F"}
"""Roles for the same quantity; choosing one sets the other aside."""
PLACES = re.compile(r"(\d*):(\d*)")
MOST_LETTERS = 100
"""Most characters of a path in a message."""
FORMULAS = '''\
"""Potentials and their gradients.

{state}
"""

{imports}
from integrators.compile.machine import inlined, kept
{constants}
'''
LOOP = """\
for k in range(positions.shape[0]):
    state[first : first + positions.shape[1]] = positions[k]
    field(state, out)
    for d in range(positions.shape[1]):
        gradients[k, d] = -out[momenta + d]
    potentials[k] = energy(state)"""


class SceneForces:
    """Potentials and their gradients of a scene with H = pᵀM⁻¹p/2 + U(q); others are refused.

    `names` are those of momenta and of positions, and `inverse_masses` is the matrix M⁻¹.
    """

    def __init__(self, scene: object):
        if not isinstance(scene, Scene):
            raise SeriesError(f"scene must be a Scene, but was {scene!r:.60}")
        blocks = scene.canonical_pair if scene.is_hamiltonian else None
        if blocks is None:
            raise SeriesError(f"scene must have a Hamiltonian of momenta and positions, but {scene.name} has none")
        of_p, of_q = degrees(scene, [Piece(frozenset({block.name})) for block in blocks])
        if of_p[0] != 0 or of_q[:2] != [1, 0]:
            raise SeriesError(
                f"scene must have the Hamiltonian p^T M^-1 p/2 + U(q) with constant masses, but that of {scene.name} "
                "is another"
            )
        self._p, self._q = blocks
        self.names = self._p.variables, self._q.variables
        self._module = _module(scene)
        self._state, self._out = np.zeros(scene.dimension), np.empty(scene.dimension)
        units = np.eye(self._p.dimension)
        at_rest = self._velocities(np.zeros(self._p.dimension))
        self.inverse_masses = np.array([self._velocities(unit) - at_rest for unit in units])  # q' is linear in p
        if at_rest.any():
            raise SeriesError(f"scene must have velocities M^-1 p, but those of {scene.name} are not zero for p = 0")

    def _velocities(self, momenta: np.ndarray) -> np.ndarray:
        """q' for given momenta; it does not depend on the positions."""
        self._state[self._p.offset : self._p.end] = momenta
        self._module.field(self._state, self._out)
        self._state[self._p.offset : self._p.end] = 0.0
        return self._out[self._q.offset : self._q.end].copy()

    def __call__(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The gradients (steps, coordinates) and the potentials (steps,) at positions (steps, coordinates)."""
        gradients, potentials = np.empty(positions.shape), np.empty(len(positions))
        places = self._q.offset, self._p.offset
        self._module.sweep(positions, self._state, self._out, *places, gradients, potentials)
        return gradients, potentials


def _module(scene: Scene) -> ModuleType:
    """The compiled functions of a scene, with a loop over positions at zero momenta."""
    from integrators.compile import machine

    writer = ModuleText()
    lines = field_lines(scene.numeric_terms, lambda term: term.outputs, range(scene.dimension), writer)
    writer.function("field(y, out)", "Put f(y) in out.", lines, "@kept")
    writer.function("energy(y)", "The Hamiltonian at y.", energy_lines(scene, writer), "@inlined")
    signature = "sweep(positions, state, out, first, momenta, gradients, potentials)"
    writer.function(signature, "Put gradients and potentials in their arrays.", LOOP.split("\n"), "@kept")
    return load_module(writer.source(scene, FORMULAS), helpers=[machine])


class Source(NamedTuple):
    """A finished trajectory as columns."""

    label: str  # its name in messages
    blocks: Callable[[int], Iterator[Columns]]  # the columns by role, in blocks with at most this number of steps
    states: int | None  # the number of states; None if unknown before reading
    dimension: int  # the number of coordinates
    h: float | None = None  # the step size, if stored
    every: int = 1  # the steps per stored state; 0 if only the start and the end are stored
    mass: np.ndarray | None = None  # masses, if stored
    method: str | None = None  # the method, if known
    forces: SceneForces | None = None  # the scene that supplies potentials and forces, unless columns do


def open_source(trajectory: Any, columns: Mapping[str, object] | None, forces: SceneForces | None) -> Source:
    """The source of a trajectory: its `columns` by role, and the scene that supplies forces, if there is one."""
    if columns is not None and not isinstance(columns, Mapping):
        raise SeriesError(f'columns must be a dict, as in {{"q": "x*"}}, but was {columns!r:.60}')
    label = "trajectory"
    if isinstance(trajectory, str | os.PathLike):
        path = os.fspath(trajectory)
        label = path if len(path) < MOST_LETTERS else f"…{path[-MOST_LETTERS:]}"
        trajectory = _stored(path, label)
    elif hasattr(trajectory, "readline"):
        name = getattr(trajectory, "name", None)
        label = name if isinstance(name, str) and not name.startswith("<") else "standard input"
    if isinstance(trajectory, Trajectory):
        return _own(trajectory, label, columns, forces)
    if isinstance(trajectory, str) or hasattr(trajectory, "readline"):
        return _of_text(trajectory, label, columns, forces)
    return _of_arrays(_by_name(trajectory, label), label, columns, forces)


def _stored(path: str, label: str) -> Any:
    """What a file holds: a `Trajectory`, the arrays of NumPy, or text, of which this is the path."""
    from integrators import load_trajectory

    if not os.path.isfile(path):  # the folder of a run, also of an unfinished one
        return load_trajectory(path)
    try:
        with open(path, "rb") as file:
            start = file.read(6)
        if start.startswith(b"PK"):
            zipfile.ZipFile(path).close()  # NumPy leaves damaged archives open
        elif not start.startswith(b"\x93NUMPY"):
            return path
        stored = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # damaged files cause errors of a dozen kinds
        raise SeriesError(f"{label} must be text, an NPY or an NPZ file, but was not: {error}") from None
    if isinstance(stored, Mapping) and {"t", "y", "variables"} <= set(stored):
        return load_trajectory(path)
    return stored


def _by_name(data: Any, label: str) -> Mapping[str, ArrayLike]:
    """Arrays by name: those of a mapping or data frame, or the fields or columns of one array."""
    if hasattr(data, "to_records"):  # a frame of pandas, with its index
        data = data.to_records()
    if isinstance(data, Mapping):
        coordinates = getattr(data, "coords", None)  # of xarray
        return data if coordinates is None else {**coordinates, **data}
    if not isinstance(data, np.ndarray):
        raise SeriesError(f"trajectory must be a Trajectory, arrays by name, or a path, but was {data!r:.60}")
    if data.dtype.names is not None:
        return {name: data[name] for name in data.dtype.names}
    if data.ndim != 2:
        raise SeriesError(f"{label} must have a row for each state, but has the shape {data.shape}")
    return {str(k): column for k, column in enumerate(data.T)}


def _own(run: Trajectory, label: str, columns: Mapping[str, object] | None, forces: SceneForces | None) -> Source:
    """The source of a trajectory of this package, which stores its scene."""
    if columns is not None:
        raise SeriesError("columns must be left out for a Trajectory, which has names of its own, but was given")
    if forces is None:
        stored = run.meta.get("scene")
        if not isinstance(stored, Mapping) or "variables" not in stored:
            raise SeriesError(f"scene must be given, since {label} contains none, but was not")
        forces = SceneForces(scene_from_table(stored, f"scene of {label}"))
    missing = next((name for block in forces.names for name in block if name not in run.variables), None)
    if missing is not None:
        raise SeriesError(
            f"{label} must have the variable {missing} of the scene, but has {', '.join(run.variables):.200}"
        )
    places = {
        role: [run.variables.index(name) for name in block] for role, block in zip("pq", forces.names, strict=True)
    }

    def blocks(size: int) -> Iterator[Columns]:
        for start in range(0, len(run.t), size):
            piece = slice(start, start + size)
            rows = np.asarray(run.y[:, piece], dtype=float).T
            yield {"t": np.asarray(run.t[piece], dtype=float)} | {role: rows[:, x] for role, x in places.items()}

    method = (run.meta.get("method") or {}).get("name")
    every = run.meta.get("save_every", 1) or 0
    return Source(label, blocks, len(run.t), len(forces.names[1]), h=run.h, every=every, method=method, forces=forces)


def _of_text(
    file: str | IO[str], label: str, columns: Mapping[str, object] | None, forces: SceneForces | None
) -> Source:
    """The source of a table: names of columns in the first line, unless `columns` has places, then a line per state."""
    lines = _lines(file, label)
    heading = next(lines, "").lstrip("# ")
    separator = "," if "," in heading else None
    names = [name.strip().strip('"') for name in heading.split(separator)]
    if all(map(_is_number, names)):
        if columns is None:
            raise SeriesError(
                f"{label} must begin with the names of its columns, but began with {heading!r:.60}: columns assigns "
                'places, as in "t=0,q=1:3"'
            )
        lines, names = chain([heading], lines), [str(k) for k in range(len(names))]
    found = _find_roles(names, columns, label, forces, TEXT_ROLES)
    for role, chosen in found.items():
        _check_width(role, len(chosen), len(found["q"]))
    places = [names.index(name) for role in found.values() for name in role]
    ends = np.cumsum([len(role) for role in found.values()])

    def blocks(size: int) -> Iterator[Columns]:
        first = 1
        while piece := list(islice(lines, size)):
            try:
                table = np.loadtxt(piece, delimiter=separator, usecols=places, ndmin=2, comments=None)
            except ValueError as error:
                rows = f" (row 0 is state {first})" * (first > 1)
                raise SeriesError(f"{label} must have numbers in its columns, but {error}{rows}") from None
            first += len(piece)
            parts = zip(found, np.split(table, ends[:-1], axis=1), strict=True)
            yield {role: rows if role in VECTORS else rows[:, 0] for role, rows in parts}

    return Source(label, blocks, None, len(found["q"]), forces=forces)


def _lines(source: str | IO[str], label: str) -> Iterator[str]:
    """The lines that are neither empty nor comments; the first may be a comment."""
    lines = text_lines(source, label, "text in UTF-8, an NPY or an NPZ file, but was neither")
    yield from islice(lines, 1)
    yield from (line for line in lines if not line.startswith("#"))


def text_lines(source: str | IO[str], label: str, wanted: str) -> Iterator[str]:
    """The lines that are not empty, without spaces around them; `wanted` ends the error where they are no text."""
    try:
        with open(source, encoding="utf-8-sig") if isinstance(source, str) else nullcontext(source) as file:
            yield from filter(None, map(str.strip, read_lines(file, label)))
    except UnicodeDecodeError:
        raise SeriesError(f"{label} must be {wanted}") from None
    except OSError as error:
        raise SeriesError(f"{label} must be a readable file, but was not: {error.strerror}") from None


def _is_number(text: str) -> bool:
    try:
        float(text or "0")
    except ValueError:
        return False
    return True


def _find_roles(
    names: Iterable[str],
    columns: Mapping[str, object] | None,
    label: str,
    forces: SceneForces | None,
    roles: Sequence[str],
) -> dict[str, list[str]]:
    """The names of the columns of each role: as chosen, or those of a scene, or the role's own, perhaps numbered."""
    names, chosen = list(names), columns or {}
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise SeriesError(f"{label} must have different names, but has {twice!r:.60} twice")
    unknown = next((role for role in chosen if role not in roles), None)
    if unknown is not None:
        raise SeriesError(f"columns must be for {', '.join(roles)}, but one was for {unknown!r:.60}")
    if forces is not None and not chosen and {name for block in forces.names for name in block} <= set(names):
        found = dict(zip("pq", map(list, forces.names), strict=True))
        roles = [role for role in roles if role in ("t", "mass", "h")]
    else:
        found = {role: chosen_names(what, names, label) for role, what in chosen.items()}
    for role in roles:
        numbered = rf"{role}(_?\d+)?" if role in VECTORS else role
        own = [role] if role in names else [name for name in names if re.fullmatch(numbered, name)]
        if own and role not in found and SAME.get(role) not in chosen:
            found[role] = own
    for choices in [("q",), ("p", "v")] + ([] if forces else [("U",), ("F", "gradU")]):
        if found.keys().isdisjoint(choices):
            texts = " or ".join(f"{MEANINGS[role]} ({role})" for role in choices)
            scene = "" if choices[0] in "qp" else ", or a scene supply it"
            raise SeriesError(
                f"{label} must have {texts}, but has {', '.join(names) or 'nothing':.200}; columns can name it, as in "
                f"{choices[0]}=NAME{scene}"
            )
    return found


def chosen_names(what: object, names: list[str], label: str) -> list[str]:
    """The names that ``x*``, ``x,y``, a place such as 3 or places such as ``1:3`` stand for."""
    found: list[str] = []
    for piece in what.split(",") if isinstance(what, str) else what if isinstance(what, list | tuple) else [what]:
        text = str(piece).strip()
        places = PLACES.fullmatch(text)
        if places:
            found += names[slice(*(int(end) if end else None for end in places.groups()))]
        elif text not in names and text.isdecimal():
            found += names[int(text) : int(text) + 1]
        else:
            found += [name for name in names if fnmatch.fnmatchcase(name, text)]
    if not found:
        raise SeriesError(f"columns must fit names in {label}, but {what!r:.60} fits none of {', '.join(names):.200}")
    return found


def _of_arrays(
    arrays: Mapping[str, ArrayLike], label: str, columns: Mapping[str, object] | None, forces: SceneForces | None
) -> Source:
    """The source of arrays, (variables, times) or (times, …) each: (times, …) if both axes are as long as the times."""
    by_text = {str(name): name for name in arrays}
    found = _find_roles([str(name) for name in arrays], columns, label, forces, ROLES)
    numbers = {role: [_array(arrays, by_text[name], label) for name in names] for role, names in found.items()}
    masses, h = (numbers.pop(role, [None])[0] for role in ("mass", "h"))
    if h is not None and (not h.size or np.any(h != h.flat[0])):  # true for nan
        raise SeriesError(f"h must be one finite number, but was {np.array2string(h, threshold=5):.60}")
    positions = np.atleast_1d(numbers["q"][0])
    turned = forces is not None and len(positions) == len(forces.inverse_masses) and len(numbers["q"]) == 1
    states = positions.shape[-1 if turned else 0]
    count = next((numbers[role][0].size for role in ("t", "U") if role in numbers), states)
    parts = {role: [_rows(x, count, role) for x in part] for role, part in numbers.items()}
    rows = {role: part[0] if len(part) == 1 else np.hstack(part) for role, part in parts.items()}
    dimension = rows["q"].shape[1]
    for role, values in rows.items():
        _check_width(role, values.shape[1], dimension)

    def blocks(size: int) -> Iterator[Columns]:
        for start in range(0, count, size):
            piece = {role: np.asarray(x[start : start + size], dtype=float) for role, x in rows.items()}
            yield {role: x if role in VECTORS else x[:, 0] for role, x in piece.items()}

    return Source(label, blocks, count, dimension, None if h is None else float(h.flat[0]), mass=masses, forces=forces)


def _check_width(role: str, width: int, dimension: int) -> None:
    """Check the number of columns of a role."""
    wanted = dimension if role in VECTORS else 1
    if width != wanted:
        whose = f"as many coordinates as q, {wanted}" if role in VECTORS else "one number for each state"
        raise SeriesError(f"{role} must have {whose}, but has {width}")


def _array(arrays: Mapping[str, ArrayLike], name: str, label: str) -> np.ndarray:
    """A stored array of real numbers."""
    try:
        array = np.asanyarray(arrays[name])
    except Exception as error:  # as for files
        raise SeriesError(
            f"{label} must have an array of real numbers {name}, but it cannot be read: {error}"
        ) from None
    if array.dtype.kind not in "fiu":
        raise SeriesError(f"{name} must be an array of real numbers, but was of the kind {array.dtype}")
    return array


def _rows(values: np.ndarray, count: int, role: str) -> np.ndarray:
    """An array with a row for each state."""
    if not values.size:
        raise SeriesError(f"{role} must have numbers for at least one state, but has the shape {values.shape}")
    if values.ndim and values.shape[0] == count:
        return values.reshape(count, -1)
    if values.ndim and values.shape[-1] == count:
        return values.reshape(-1, count).T
    raise SeriesError(f"{role} must have {count} states along one axis, but has the shape {values.shape}")
