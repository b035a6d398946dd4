"""Trajectories: the stored states and observations of a run, in memory and in files."""

from __future__ import annotations

import json
import os
import struct
import zipfile
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError, shorten
from integrators.core.optional_modules import optional_module
from integrators.core.stored_arrays import FINITE, LOCAL_HEADER, MOST_TEXT, TEXT, Form, StoredArrays, read_json, reading
from integrators.core.text_files import check_path, read_text, replacing

if TYPE_CHECKING:
    import numpy as np


class Trajectory:
    """The stored states and observations of a run, in float64; made by `integrate` and `load_trajectory`.

    Attributes:
        t: The times of the stored states, (n,).
        y: The stored states, (variables, n).
        observed: The observed quantities by name, arrays (m,).
        observed_t: The times of the observations, (m,); the array `t` itself if exactly the stored states are observed.
        h: The step size.
        variables: The names of the variables.
        meta: The scene, the method and the options of the run, as JSON values.

    Example:
        >>> from integrators import scene
        >>> from integrators.runs.integration import integrate
        >>> run = integrate(scene("pendulum"), "rk4", h=0.1, steps=200, save_every=100, observe="energy")
        >>> run
        <Trajectory of rk4 on pendulum: 3 states from t = 0 to 20, energy observed>
        >>> run.t, run.variables, run.y.shape, run.meta["method"]["b"]
        (array([ 0., 10., 20.]), ('p', 'q'), (2, 3), ['1/6', '1/3', '1/3', '1/6'])
    """

    def __init__(
        self,
        t: np.ndarray,
        y: np.ndarray,
        *,
        h: float,
        variables: Sequence[str],
        observed: Mapping[str, np.ndarray] | None = None,
        observed_t: np.ndarray | None = None,
        meta: Mapping[str, Any] | None = None,
    ):
        self.t, self.y, self.h, self.variables = t, y, h, tuple(variables)
        self.observed = dict(observed or {})
        self.observed_t = t if observed_t is None else observed_t
        self.meta = dict(meta or {})

    def __repr__(self) -> str:
        names = ((self.meta.get(key) or {}).get("name") for key in ("method", "scene"))
        of = " on ".join(name for name in names if name) or f"{len(self.variables)} variables"
        span = f"{len(self.t):,} states from t = {self.t[0]:g} to {self.t[-1]:g}" if len(self.t) else "no states"
        observed = f", {', '.join(self.observed)} observed" if self.observed else ""
        return f"<Trajectory of {of}: {span}{observed}>"

    def copy(self) -> Trajectory:
        """A copy in memory."""
        labels = {"h": self.h, "variables": self.variables, "meta": self.meta}
        t, y, observed = self.t.copy(), self.y.copy(order="F"), {key: x.copy() for key, x in self.observed.items()}
        times = None if self.observed_t is self.t else self.observed_t.copy()
        return Trajectory(t, y, observed=observed, observed_t=times, **labels)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a trajectory file, which `load_trajectory` and ``numpy.load`` read.

        Args:
            path: The file; it is replaced only when the new one is complete.

        Raises:
            IntegratorError: The file cannot be written.
        """

        save_trajectory(self, path)

    def to_pandas(self) -> Any:
        """The trajectory as a ``pandas.DataFrame``: a row for each time, a column for each variable and quantity.

        Raises:
            IntegratorError: pandas is not installed, or states were not observed exactly when they were stored.
        """
        if self.observed and self.observed_t is not self.t:
            raise IntegratorError(
                f"observe_every must be save_every for one table, but there are {len(self.t)} states and "
                f"{len(self.observed_t)} observations"
            )
        pandas = optional_module("pandas", "to_pandas")
        columns = dict(zip(self.variables, self.y, strict=True)) | self.observed
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    def to_xarray(self) -> Any:
        """The trajectory as an ``xarray.Dataset``: y (variable, time), and observations (time) or (observed_time).

        Raises:
            IntegratorError: xarray is not installed, or a quantity has the name of a coordinate.
        """
        xarray = optional_module("xarray", "to_xarray")
        time = "time" if self.observed_t is self.t else "observed_time"
        coordinates = {"variable": list(self.variables), "time": self.t, time: self.observed_t}
        for name in self.observed:
            if name in ("y", *coordinates):
                raise IntegratorError(f"observed must have other names than xarray's coordinates, but has {name}")
        values = {"y": (("variable", "time"), self.y)} | {name: ((time,), x) for name, x in self.observed.items()}
        return xarray.Dataset(values, coordinates, {"h": self.h, "meta": json.dumps(self.meta, ensure_ascii=False)})


ALIGNMENT = 64
PADDING = 0xD935
"""Identifier of a padding field in a ZIP archive."""
ZIP64_FIELD = 20
OBSERVED = "observed/"
RUN = "run.json"
"""The file that describes the other files in the folder of a run."""
PART = ".part"
"""Suffix of the folder that a run writes to."""
REAL = "fiu"
SERIES = Form(REAL, ("n",), None)
META = {key: (None, {"name": (None, str)}) for key in ("method", "scene")} | {"save_every": (None, int)}
CONTENT = {"variables": [str], "observed": [str], "h": (int, float), "same_times": bool, "meta": META}
"""The content of `RUN`."""


def save_trajectory(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """Write a trajectory file."""
    arrays: dict[str, Any] = {
        "t": trajectory.t,
        "y": trajectory.y,
        "h": trajectory.h,
        "variables": trajectory.variables,
    }
    if trajectory.observed_t is not trajectory.t:
        arrays["observed_t"] = trajectory.observed_t
    arrays |= {OBSERVED + name: values for name, values in trajectory.observed.items()}
    arrays["meta"] = json.dumps(trajectory.meta, ensure_ascii=False)
    write_arrays(path, arrays)


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, Any]) -> None:
    """Write an NPZ file, piece by piece, in constant memory; each array is aligned for mapping into memory."""
    import numpy as np

    with replacing(path) as file, zipfile.ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy")  # dated 1980: equal content gives equal files
            member.external_attr = 0o600 << 16
            before = file.tell() + LOCAL_HEADER + len(member.filename.encode()) + ZIP64_FIELD + 4
            fill = -before % ALIGNMENT
            member.extra = struct.pack(f"<HH{fill}x", PADDING, fill)
            with archive.open(member, "w", force_zip64=True) as target:
                np.lib.format.write_array(target, np.asarray(array), allow_pickle=False)


def load_trajectory(path: str | os.PathLike[str]) -> Trajectory:
    """Read a trajectory file.

    Args:
        path: The file of a run. During the run, or after a crash, there is only a folder with ``.part`` added to the
            name; then everything written so far is read.

    Returns:
        The trajectory; large arrays are read-only and mapped into memory, without a check of their numbers.

    Raises:
        IntegratorError: The file does not exist, or is not a trajectory.

    Example:
        >>> import pathlib, tempfile
        >>> import numpy as np
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder, "line.npz")
        ...     Trajectory(np.arange(3.0), np.ones((1, 3)), h=1.0, variables=["y"]).save(path)
        ...     load_trajectory(path)
        <Trajectory of 1 variables: 3 states from t = 0 to 2>
    """
    name = check_path(path, "path")
    sentence = f"{shorten(name, 200)} must be a trajectory file, but was not"
    with reading(sentence):
        if os.path.isdir(name) or (not os.path.exists(name) and os.path.isdir(name + PART)):
            return _of_folder(name if os.path.isdir(name) else name + PART, sentence)
        arrays = StoredArrays(name, sentence)
        times = "m" if "observed_t" in arrays else "n"
        forms = {"variables": Form("U", ("variables",), None), "t": SERIES, "y": Form(REAL, ("variables", "n"), None)}
        forms |= {"h": Form(REAL), "observed_t": Form(REAL, (times,), None)}
        forms |= {name: Form(REAL, (times,), None) for name in arrays if name.startswith(OBSERVED)}
        found = arrays.read({name: form for name, form in forms.items() if name != "observed_t" or name in arrays})
        meta = read_json(arrays.read({"meta": TEXT})["meta"], META, "meta") if "meta" in arrays else {}
        observed = {key.removeprefix(OBSERVED): values for key, values in found.items() if key.startswith(OBSERVED)}
        labels = {"h": float(found["h"]), "variables": found["variables"], "meta": meta}
        return _checked(
            Trajectory(found["t"], found["y"], observed=observed, observed_t=found.get("observed_t"), **labels)
        )


def read_run(folder: str) -> dict[str, Any]:
    """The description of the rows in the folder of a run.

    Raises:
        ValueError: It is not the folder of a run.
        IntegratorError: The description cannot be read.
    """
    path = os.path.join(folder, RUN)
    if not os.path.isfile(path):
        raise ValueError(f"it has no {RUN}")
    return read_json(read_text(path, MOST_TEXT)[0], CONTENT, RUN)


def _of_folder(folder: str, sentence: str) -> Trajectory:
    """The complete rows in the folder of a run; large arrays are mapped into memory."""
    run = read_run(folder)
    names, arrays = run["observed"], StoredArrays(folder, sentence)
    forms = {"t": SERIES, "y": Form(REAL, (len(run["variables"]), "rows"), None)}
    if names:
        forms |= {"observed_t": Form(REAL, ("m",), None), "observed": Form(REAL, (len(names), "seen"), None)}
    found = arrays.read(forms)  # times are read first but written last, so their rows are complete
    t = times = found["t"]
    if names:
        times = found["observed_t"][: len(t)] if run["same_times"] else found["observed_t"]
    observed = {name: row[: len(times)] for name, row in zip(names, found.get("observed", ()), strict=True)}
    y = found["y"][:, : len(t)]
    if y.shape[1] < len(t) or any(len(row) < len(times) for row in observed.values()):
        raise ValueError(f"it has {len(t)} times, but fewer states or observations")
    labels = {"h": run["h"], "variables": run["variables"], "meta": run["meta"]}
    return _checked(Trajectory(t, y, observed=observed, observed_t=None if run["same_times"] else times, **labels))


def _checked(run: Trajectory) -> Trajectory:
    """A trajectory as a run may have made it; arrays that are mapped into memory are too large to be scanned.

    Runs store finite states only, also if they fail. Times may repeat only where steps may be
    below the resolution of time.

    Raises:
        ValueError: It is not.
    """
    import numpy as np

    if len(set(run.variables)) < len(run.variables):
        raise ValueError(f"variables must have different names, but were {shorten(', '.join(run.variables))}")
    if not 0 < abs(run.h) <= FINITE[1]:
        raise ValueError(f"h must be finite and not 0, but was {shorten(str(run.h))}")
    if not isinstance(run.y, np.memmap) and not np.isfinite(run.y).all():
        raise ValueError("y must be finite, but was not")
    for name, t in (("t", run.t), ("observed_t", run.observed_t)):
        if isinstance(t, np.memmap):
            continue
        if not np.isfinite(t).all():
            raise ValueError(f"{name} must be finite, but was not")
        resolution = 2 * np.spacing(np.abs(t).max(initial=0.0))  # of n h as well, where t = t0 + n h
        is_fine = run.meta.get("control") is None and abs(run.h) > resolution
        follows = np.greater if is_fine else np.greater_equal
        if not (follows(t[1:], t[:-1]).all() or follows(t[:-1], t[1:]).all()):
            raise ValueError(f"{name} must be times in order, without repetition, but was not")
    return run
