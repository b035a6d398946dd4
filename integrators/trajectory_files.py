"""Trajectory files: NPZ, never compressed, so that large ones are mapped into memory instead of read.

A file has the arrays ``t``, ``y``, ``h``, ``variables`` and ``observed/NAME``, ``observed_t`` if that is not ``t``, and
``meta`` (JSON). The same trajectory gives the same bytes.
"""

from __future__ import annotations

import json
import os
import struct
import zipfile
from typing import TYPE_CHECKING, Any

from .errors import IntegratorError
from .expressions import shorten
from .text_files import check_path, replacing
from .trajectory import Trajectory

if TYPE_CHECKING:
    import numpy as np

LARGE = 2**26
"""Bytes from which on an array is mapped and not read."""
ALIGNMENT = 64
PADDING = 0xD935
"""The kind of a field in a ZIP archive that only fills up."""
LOCAL_HEADER, ZIP64_FIELD = 30, 20
OBSERVED = "observed/"
RUN = "run.json"
"""The file that says what else is in the folder of a run."""
PART = ".part"
"""What is added to a path for the folder to which a run is written while it lasts."""


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
    try:
        if os.path.isdir(name) or (not os.path.exists(name) and os.path.isdir(name + PART)):
            return _from_arrays(folder_arrays(name if os.path.isdir(name) else name + PART))
        with zipfile.ZipFile(name) as archive:
            return _from_arrays({i.filename.removesuffix(".npy"): read_member(archive, i) for i in archive.infolist()})
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise IntegratorError(
            f"{shorten(name, 200)} must be a trajectory file, but was not: {shorten(reason)}"
        ) from None


def folder_arrays(folder: str) -> dict[str, Any]:
    """The arrays in the folder of a run, as far as all of them have been written, mapped into memory."""
    import numpy as np

    with open(os.path.join(folder, RUN), encoding="utf-8") as file:
        run = json.load(file)

    def table(name: str) -> Any:
        return np.load(os.path.join(folder, f"{name}.npy"), mmap_mode="r")

    t = times = table("t")  # times come last: what belongs to them is there
    arrays = {"t": t, "y": table("y")[:, : len(t)], "h": run["h"], "variables": run["variables"]}
    if run["observed"]:
        times, values = table("observed_t"), table("observed")
        if run["same_times"]:
            times = times[: len(t)]
        else:
            arrays["observed_t"] = times
        observed = zip(run["observed"], values, strict=True)
        arrays |= {OBSERVED + name: row[: len(times)] for name, row in observed}
    return arrays | {"meta": json.dumps(run["meta"])}


def _from_arrays(arrays: dict[str, Any]) -> Trajectory:
    t, y, variables = arrays["t"], arrays["y"], [str(name) for name in arrays["variables"]]
    observed = {key.removeprefix(OBSERVED): value for key, value in arrays.items() if key.startswith(OBSERVED)}
    times = arrays.get("observed_t", t)
    if y.shape != (len(variables), len(t)) or any(value.shape != times.shape for value in observed.values()):
        raise ValueError(f"t, y and variables have shapes {t.shape}, {y.shape} and {(len(variables),)}")
    meta = json.loads(str(arrays.get("meta", "{}")))
    h = float(arrays["h"])
    return Trajectory(t, y, h=h, variables=variables, observed=observed, observed_t=times, meta=meta)


def read_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray:
    """An array in an archive, mapped if it is large and stored as it is."""
    import numpy as np

    with archive.open(member) as file:
        if member.file_size < LARGE or member.compress_type != zipfile.ZIP_STORED:
            return np.lib.format.read_array(file, allow_pickle=False)
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, is_fortran, kind = read(file)
        header = file.tell()
    assert archive.filename is not None
    with open(archive.filename, "rb") as file:
        file.seek(member.header_offset + LOCAL_HEADER - 4)
        lengths = struct.unpack("<HH", file.read(4))
    offset = member.header_offset + LOCAL_HEADER + sum(lengths) + header
    order = "F" if is_fortran else "C"
    return np.memmap(archive.filename, dtype=kind, mode="r", offset=offset, shape=shape, order=order)
