"""Sources of states: columns of a finished trajectory, read piece by piece, with its metadata."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from bseries.exceptions import SeriesError
from bseries.shadow.roundings import ULPS, Rounding, precision

if TYPE_CHECKING:
    import numpy as np

    from bseries.shadow.scene_forces import SceneForces

    Columns: TypeAlias = Mapping[str, np.ndarray]
    """Consecutive states by role: t, U (steps,); q, p, v, F, gradU (steps, coordinates)."""

ROLES = {
    "t": "the time",
    "q": "positions",
    "p": "momenta",
    "v": "velocities",
    "U": "the potential",
    "F": "forces",
    "gradU": "the potential's gradient",
}
VECTORS = ("q", "p", "v", "F", "gradU")
ALIASES = {
    "t": ("t", "time", "times"),
    "q": ("q", "position", "positions", "coordinates", "x", "r"),
    "p": ("p", "momentum", "momenta"),
    "v": ("v", "velocity", "velocities", "vel"),
    "U": ("U", "potential", "potential_energy", "PotEng", "epot"),
    "F": ("F", "f", "force", "forces"),
    "gradU": ("gradU", "gradient", "gradients", "g"),
    "mass": ("mass", "masses", "m"),
    "h": ("h", "dt", "step", "timestep"),
}
"""Names of arrays in other programs."""
SAME = (("p", "v"), ("F", "gradU"))
"""Roles for the same quantity; both must agree, unless one is chosen."""


class Source(NamedTuple):
    """A finished trajectory as columns.

    Attributes:
        label: Its name in messages.
        blocks: Gives the columns by role in blocks with at most the given number of steps.
        states: The number of states; None if unknown before reading.
        dimension: The number of coordinates.
        roundings: Rounding by role, and of "h"; others are doubles.
        h: The step size, if stored.
        every: The steps per stored state, if known.
        mass: Masses, if stored.
        method: The method, if known.
        forces: The scene that supplies potentials and forces; None if the columns contain them.
    """

    label: str
    blocks: Callable[[int], Iterator[Columns]]
    states: int | None
    dimension: int
    roundings: Mapping[str, Rounding]
    h: float | None = None
    every: int = 1
    mass: Any = None
    method: str | None = None
    forces: SceneForces | None = None

    def off(self, role: str, rows: np.ndarray) -> np.ndarray:
        """Rounding bounds of numbers of a role, (states, …), for each column."""
        return self.roundings.get(role, Rounding()).of(rows)


def with_equivalents(chosen: Iterable[str]) -> set[str]:
    """Roles, with those for the same quantities."""
    roles = set(chosen)
    return roles.union(*(pair for pair in SAME if not roles.isdisjoint(pair)))


def choose(
    names: Iterable[str], chosen: Mapping[str, str] | None, label: str, *, roles: Sequence[str]
) -> dict[str, list[str]]:
    """The names of each role.

    Args:
        names: All names.
        chosen: Patterns by role, as in ``{"q": "x*"}``; other roles are found by `ALIASES`.
        label: The name of the data in messages.
        roles: The possible roles.
    """
    there, found = list(names), dict[str, list[str]]()
    for role, patterns in (chosen or {}).items():
        if role not in roles:
            raise SeriesError(f"columns must be for {', '.join(roles)}, but one was for {role!r:.60}")
        pieces = [piece.strip() for piece in patterns.split(",")]
        found[role] = [name for piece in pieces for name in there if fnmatch.fnmatchcase(name, piece)]
        if not found[role]:
            shown = f"{', '.join(there)}"
            raise SeriesError(f"columns must fit names in {label}, but {patterns!r:.60} fits none of {shown:.200}")
    for role in roles:
        if role not in with_equivalents(chosen or ()):
            found[role] = next(([name] for name in ALIASES[role] if name in there), [])
    return {role: names for role, names in found.items() if names}


def check_roles(roles: Iterable[str], label: str, *, with_forces: bool) -> None:
    """Check that positions, momenta and forces are available."""
    there = set(roles)
    needs = [("q",), ("p", "v")] + ([] if with_forces else [("U",), ("F", "gradU")])
    for choices in needs:
        if there.isdisjoint(choices):
            texts = " or ".join(f"{ROLES[role]} ({role})" for role in choices)
            hint = "" if choices[0] in "qp" else "; a scene would supply it"
            raise SeriesError(f"{label} must have {texts}, but has {', '.join(sorted(there)) or 'nothing known'}{hint}")


def array_source(
    arrays: Mapping[str, Any], label: str, columns: Mapping[str, str] | None, forces: SceneForces | None
) -> Source:
    """The source of arrays by name, (steps, …) each; or (…, steps) if only the last axis has the length of the times.

    Args:
        arrays: The arrays.
        label: Their name in messages.
        columns: Names of arrays by role; others are found by `ALIASES`.
        forces: The scene that supplies potentials and forces, if any.
    """
    import numpy as np

    found = choose(arrays, columns, label, roles=tuple(ALIASES))
    check_roles(found, label, with_forces=forces is not None)
    numbers = {role: _numbers(arrays[names[0]], names[0]) for role, names in found.items()}
    masses, h = numbers.pop("mass", None), numbers.pop("h", None)
    count = _count(numbers)
    rows = {role: _rows(values, count, role) for role, values in numbers.items()}
    dimension = rows["q"].shape[1]
    for role in VECTORS:
        if role in rows and rows[role].shape[1] != dimension:
            raise SeriesError(f"{role} must have as many coordinates as q, {dimension}, but has {rows[role].shape[1]}")
    scale = () if masses is None else (masses,)  # masses in single precision limit the precision of p and v
    roundings = {
        role: Rounding(ULPS * precision(values, *(scale if role in ("p", "v") else ())))
        for role, values in rows.items()
    }
    roundings |= {
        role: Rounding(precision(array)) for role, array in (("t", numbers.get("t")), ("h", h)) if array is not None
    }

    def blocks(size: int) -> Iterator[Columns]:
        for start in range(0, count, size):
            yield {role: np.asarray(values[start : start + size], dtype=float) for role, values in rows.items()}

    step = None if h is None else _step(h)
    return Source(label, blocks, count, dimension, roundings, h=step, mass=masses, forces=forces)


def _numbers(values: Any, name: str) -> np.ndarray:
    import numpy as np

    array = np.asanyarray(values)
    if array.dtype.kind not in "fiu":
        raise SeriesError(f"{name} must be an array of real numbers, but was of the kind {array.dtype}")
    return array


def _step(h: np.ndarray) -> float:
    """The step size, which may be repeated for each step."""
    import numpy as np

    if not h.size or np.any(h != h.flat[0]):  # true for nan
        raise SeriesError(f"h must be one finite number, but was {np.array2string(h, threshold=5):.60}")
    return float(h.flat[0])


def _count(arrays: Mapping[str, np.ndarray]) -> int:
    """The number of states."""
    for role in ("t", "U"):
        if role in arrays and arrays[role].ndim >= 1:
            return arrays[role].size
    shape = arrays["q"].shape
    return shape[0] if shape else 0


def _rows(values: np.ndarray, count: int, role: str) -> np.ndarray:
    """An array with a row for each state."""
    if not values.size:
        raise SeriesError(f"{role} must have numbers for at least one state, but has the shape {values.shape}")
    if role not in VECTORS:
        if values.size != count:
            raise SeriesError(f"{role} must have one number for each of {count} states, but has {values.size}")
        return values.reshape(count)
    if values.ndim and values.shape[0] == count:
        return values.reshape(count, -1)
    if values.ndim and values.shape[-1] == count:
        return values.reshape(-1, count).T
    raise SeriesError(f"{role} must have {count} states along its first axis, but has the shape {values.shape}")


def inverse_masses(mass: Any, dimension: int) -> np.ndarray:
    """The inverse mass of each coordinate.

    Args:
        mass: A number, one for each particle, or one for each coordinate; None: 1.
        dimension: The number of coordinates.
    """
    import numpy as np

    try:
        values = np.asarray(1.0 if mass is None else mass, dtype=float).reshape(-1)
    except (TypeError, ValueError, OverflowError):
        raise SeriesError(f"mass must be numbers, but was {mass!r:.60}") from None
    if not len(values) or dimension % len(values):
        raise SeriesError(
            f"mass must be one number, or one for each particle or coordinate, but there were {len(values)} for "
            f"{dimension} coordinates"
        )
    if not (np.all(np.isfinite(values)) and np.all(values > 0)):
        raise SeriesError(f"mass must be positive, but one was {values[~(values > 0) | ~np.isfinite(values)][0]:g}")
    return np.repeat(1 / values, dimension // len(values))
