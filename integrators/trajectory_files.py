"""Trajectory files: NPZ, never compressed, so that large ones are mapped into memory instead of read.

A file has the arrays ``t``, ``y``, ``h``, ``variables`` and ``observed/NAME``, ``observed_t`` if that is not ``t``, and
``meta`` (JSON). The same trajectory gives the same bytes.
"""

from __future__ import annotations

import json
import os
import struct
import zipfile
from typing import Any

from .expressions import shorten
from .stored_arrays import LOCAL_HEADER, MOST_TEXT, TEXT, Form, StoredArrays, read_json, reading
from .text_files import check_path, read_text, replacing
from .trajectory import Trajectory

ALIGNMENT = 64
PADDING = 0xD935
"""The kind of a field in a ZIP archive that only fills up."""
ZIP64_FIELD = 20
OBSERVED = "observed/"
RUN = "run.json"
"""The file that says what else is in the folder of a run."""
PART = ".part"
"""What is added to a path for the folder to which a run is written while it lasts."""
REAL = "fiu"
SERIES = Form(REAL, ("n",), None)
META = {key: (None, {"name": (None, str)}) for key in ("method", "scene")} | {"save_every": (None, int)}
CONTENT = {"variables": [str], "observed": [str], "h": (int, float), "same_times": bool, "meta": META}
"""What `RUN` holds."""


def save_trajectory(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """Write a trajectory file, piece by piece, in constant memory."""
    import numpy as np

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
    with replacing(path) as file, zipfile.ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy")  # dated 1980, so that equal content gives equal files
            member.external_attr = 0o600 << 16
            before = file.tell() + LOCAL_HEADER + len(member.filename.encode()) + ZIP64_FIELD + 4
            fill = -before % ALIGNMENT
            member.extra = struct.pack(f"<HH{fill}x", PADDING, fill)
            with archive.open(member, "w", force_zip64=True) as target:
                np.lib.format.write_array(target, np.asarray(array), allow_pickle=False)


def load_trajectory(path: str | os.PathLike[str]) -> Trajectory:
    """Read a trajectory file.

    Args:
        path: The file that a run was or is written to. While a run lasts, or after a crash, there is no file yet but a
            folder with ``.part`` added to the name; then what is there so far is read.

    Returns:
        The trajectory; large arrays are read-only and mapped into memory.

    Raises:
        IntegratorError: There is no such file, or it is no trajectory.

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
    return Trajectory(found["t"], found["y"], observed=observed, observed_t=found.get("observed_t"), **labels)


def read_run(folder: str) -> dict[str, Any]:
    """What the folder of a run says that its rows are.

    Raises:
        ValueError: It is no such folder.
        IntegratorError: Its file cannot be read.
    """
    path = os.path.join(folder, RUN)
    if not os.path.isfile(path):
        raise ValueError(f"it has no {RUN}")
    return read_json(read_text(path, MOST_TEXT)[0], CONTENT, RUN)


def _of_folder(folder: str, sentence: str) -> Trajectory:
    """What the folder of a run has, as far as all of it has been written; large arrays are mapped into memory."""
    run = read_run(folder)
    names, arrays = run["observed"], StoredArrays(folder, sentence)
    forms = {"t": SERIES, "y": Form(REAL, (len(run["variables"]), "rows"), None)}
    if names:
        forms |= {"observed_t": Form(REAL, ("m",), None), "observed": Form(REAL, (len(names), "seen"), None)}
    found = arrays.read(forms)  # times come first here and last in the run: what belongs to them is there
    t = times = found["t"]
    if names:
        times = found["observed_t"][: len(t)] if run["same_times"] else found["observed_t"]
    observed = {name: row[: len(times)] for name, row in zip(names, found.get("observed", ()), strict=True)}
    y = found["y"][:, : len(t)]
    if y.shape[1] < len(t) or any(len(row) < len(times) for row in observed.values()):
        raise ValueError(f"it has {len(t)} times, but fewer states or observations")
    labels = {"h": run["h"], "variables": run["variables"], "meta": run["meta"]}
    return Trajectory(t, y, observed=observed, observed_t=None if run["same_times"] else times, **labels)
