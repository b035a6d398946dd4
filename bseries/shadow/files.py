"""Trajectories in files: of this package, NPZ of any program, and text."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from integrators.stored_arrays import StoredArrays
from integrators.trajectory_files import PART, RUN

from ..exceptions import SeriesError
from .sources import Source, array_source
from .text import text_source

if TYPE_CHECKING:
    from integrators import Trajectory

    from .scenes import SceneForces
    from .states import Columns

MOST_LETTERS = 100
"""Of a path in a message."""


def open_source(trajectory: Any, columns: Mapping[str, str] | None = None, forces: SceneForces | None = None) -> Source:
    """A trajectory from wherever it is.

    Args:
        trajectory: A `Trajectory`, arrays by name, the path of a file, or an open text file.
        columns: Names, or patterns of names, by role.
        forces: The scene that supplies potentials and forces, if there is one.

    Raises:
        SeriesError: It cannot be read, or something is missing.
        IntegratorError: The same, for files of this package.
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
    """Whether a path is that of a file and no archive."""
    if not os.path.isfile(path) or path.lower().endswith(".npz"):
        return False
    with suppress(OSError), open(path, "rb") as file:
        return file.read(4) not in (b"PK\3\4", b"PK\5\6")
    return True


def _is_own(path: str) -> bool:
    """Whether a file is one of `save_trajectory`, or the folder of a run that lasts; what is unreadable is, too."""
    from integrators import IntegratorError

    try:
        return not os.path.isfile(path) or {"t", "y", "variables"} <= set(StoredArrays(path, path))
    except IntegratorError:
        return True


def _own(run: Trajectory, label: str, forces: SceneForces | None) -> Source:
    """A trajectory of this package; it stores its scene."""
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
    """Where variables stand; neighbours are not copied when they are taken."""
    places = [variables.index(name) for name in names]
    whole = slice(places[0], places[0] + len(places))
    return whole if tuple(variables[whole]) == tuple(names) else places


def _stored_forces(table: Any, label: str) -> SceneForces:
    """The forces of the scene that a trajectory was made with."""
    if not isinstance(table, Mapping) or "variables" not in table:
        raise SeriesError(f"scene must be given, since {label} does not tell what the forces are, but was not")
    from integrators.scenes.files import scene_from_table

    from .scenes import SceneForces

    without = {key: x for key, x in table.items() if key != "invariants"}  # which would be checked again
    effects = table.get("effects")
    if isinstance(effects, Mapping):
        without["effects"] = {
            name: {key: x for key, x in effect.items() if key != "breaks"} if isinstance(effect, Mapping) else effect
            for name, effect in effects.items()
        }
    return SceneForces(scene_from_table(without, f"scene of {label}"))
