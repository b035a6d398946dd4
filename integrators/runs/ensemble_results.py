"""Results of ensembles, in memory and in files, and the folder of finished blocks."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError, shorten
from integrators.core.optional_modules import optional_module
from integrators.core.stored_arrays import TEXT, Form, StoredArrays, read_json, reading
from integrators.core.text_files import atomic_write, check_path, read_text
from integrators.runs.ensemble_members import Block, Failure
from integrators.runs.ensemble_statistics import Statistics
from integrators.runs.trajectory import write_arrays

if TYPE_CHECKING:
    import numpy as np

KIND = "ensemble"
NAMED = {"name": (None, str)}
HEAD = {"kind": str, "names": [str], "meta": {"method": NAMED, "scene": NAMED, "members": int}}
BLOCK = {
    "count": Form("i", ("times",), (0, sys.maxsize)),
    **dict.fromkeys(Statistics._fields[1:], Form("f", ("times", "quantities"), None)),
    "series": Form("f", ("kept", "times", "quantities"), None),
    "ends": Form("f", ("ends", "variables"), None),
    "failures": TEXT,
}
NUMBER = int, float
FAILURE = {"member": int, "step": (None, int), "t": (None, *NUMBER), "y": (None, [NUMBER]), "reason": str}
"""The content of the files."""


class EnsembleResult:
    """Statistics of an ensemble; made by `ensemble`, and by `load_ensemble`.

    A member that failed counts up to its failure. All mappings are from the names of quantities.

    Attributes:
        t: The times, (times,).
        names: The quantities.
        meta: The scene, the method and the options.
        failures: The members that did not reach the end.

    Example:
        >>> from integrators import scene
        >>> from integrators.runs.ensembles import ensemble
        >>> result = ensemble(scene("riccati"), "rk4", h=0.1, steps=20, y0=[[-1], [-2], [9]], observe=None, final=True)
        >>> result
        <EnsembleResult rk4 on riccati: 3 members, 1 failed, 21 times>
        >>> [(failure.member, failure.step) for failure in result.failures]
        [(2, 4)]
        >>> print(result.final.T.round(4), result.count[-1])
        [[-0.3333 -0.4  nan]] 2
    """

    def __init__(self, t: np.ndarray, names: Sequence[str], whole: Block, meta: Mapping[str, Any]):
        self.t, self.names, self.meta = t, tuple(names), dict(meta)
        self.failures: tuple[Failure, ...] = whole.failures
        self._whole = whole

    def __repr__(self) -> str:
        about = f"{self.meta['method']['name']} on {self.meta['scene']['name']}"
        failed = f", {len(self.failures)} failed" if self.failures else ""
        return f"<EnsembleResult {about}: {self.meta['members']} members{failed}, {len(self.t)} times>"

    @property
    def count(self) -> np.ndarray:
        """The number of members that reached each time, (times,)."""
        return self._whole.statistics.count

    @property
    def mean(self) -> dict[str, np.ndarray]:
        """Means at each time; nan where there is no member."""
        return self._where(self._whole.statistics.mean)

    @property
    def variance(self) -> dict[str, np.ndarray]:
        """Unbiased variances at each time; nan where there are fewer than two members."""
        return self._columns(self._whole.statistics.variance)

    @property
    def std(self) -> dict[str, np.ndarray]:
        """Standard deviations at each time."""
        import numpy as np

        return self._columns(np.sqrt(self._whole.statistics.variance))

    @property
    def minimum(self) -> dict[str, np.ndarray]:
        """Smallest values at each time; nan where there is no member."""
        return self._where(self._whole.statistics.minimum)

    @property
    def maximum(self) -> dict[str, np.ndarray]:
        """Largest values at each time; nan where there is no member."""
        return self._where(self._whole.statistics.maximum)

    @cached_property
    def series(self) -> dict[str, np.ndarray]:
        """The quantities of the first `keep` members, (members, times); nan after a failure."""
        return {name: self._whole.series[:, :, k] for k, name in enumerate(self.names)}

    @property
    def final(self) -> np.ndarray:
        """The last states, (members, variables), nan for failed members; no rows if they were not saved."""
        return self._whole.ends

    def _columns(self, array: np.ndarray) -> dict[str, np.ndarray]:
        return {name: array[:, k] for k, name in enumerate(self.names)}

    def _where(self, array: np.ndarray) -> dict[str, np.ndarray]:
        import numpy as np

        return self._columns(np.where(self.count[:, None] > 0, array, np.nan))

    def _tables(self) -> dict[str, dict[str, np.ndarray]]:
        return {key: getattr(self, key) for key in ("mean", "std", "minimum", "maximum")}

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame`` by time, with columns (quantity, statistic).

        Raises:
            IntegratorError: pandas is not installed.
        """
        pandas = optional_module("pandas", "to_pandas")
        columns = {(name, key): table[name] for name in self.names for key, table in self._tables().items()}
        columns[("count", "")] = self.count
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    def to_xarray(self) -> Any:
        """An ``xarray.Dataset`` of mean, std, minimum, maximum, (quantity, time), and count, (time).

        Raises:
            IntegratorError: xarray is not installed.
        """
        xarray = optional_module("xarray", "to_xarray")
        data: dict[str, Any] = {
            key: (("quantity", "time"), [table[name] for name in self.names]) for key, table in self._tables().items()
        }
        data["count"] = ("time", self.count)
        attributes = {"meta": json.dumps(self.meta, ensure_ascii=False)}
        return xarray.Dataset(data, coords={"time": self.t, "quantity": list(self.names)}, attrs=attributes)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an NPZ file, which replaces an old one only when it is complete.

        Raises:
            IntegratorError: The file cannot be written.
        """
        head = {"kind": KIND, "names": list(self.names), "meta": self.meta}
        write_arrays(path, {"t": self.t, "head": json.dumps(head), **_arrays(self._whole)})


def load_ensemble(path: str | os.PathLike[str]) -> EnsembleResult:
    """Read a file of `EnsembleResult.save`.

    Args:
        path: The file.

    Raises:
        IntegratorError: The file is not that of an ensemble.

    Example:
        >>> import tempfile
        >>> from integrators import scene
        >>> from integrators.runs.ensembles import ensemble
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     ensemble(scene("pendulum"), "rk4", h=0.1, steps=10, y0=[[0, 1], [0, 2]]).save(f"{folder}/out.npz")
        ...     load_ensemble(f"{folder}/out.npz")
        <EnsembleResult rk4 on pendulum: 2 members, 11 times>
    """
    sentence = f"{shorten(check_path(path, 'path'), 200)} must be the file of an ensemble, but was not"
    with reading(sentence):
        arrays = StoredArrays(os.fspath(path), sentence)
        head = read_json(arrays.read({"head": TEXT})["head"], HEAD, "head")
        if head["kind"] != KIND:
            raise ValueError("it holds something else")
        names = head["names"]
        t = arrays.read({"t": Form("f", ("times",))})["t"]
        return EnsembleResult(t, names, _block(arrays, {"times": len(t), "quantities": len(names)}), head["meta"])


def _arrays(block: Block) -> dict[str, Any]:
    failures = json.dumps([failure._asdict() for failure in block.failures])
    return {**block.statistics._asdict(), "series": block.series, "ends": block.ends, "failures": failures}


def _block(arrays: StoredArrays, sizes: Mapping[str, int]) -> Block:
    """Read a block whose arrays have the given lengths."""
    found = arrays.read(BLOCK, sizes)
    records = read_json(found["failures"], [FAILURE], "failures")
    failures = (
        Failure(r["member"], r.get("step"), r.get("t"), None if r.get("y") is None else tuple(r["y"]), r["reason"])
        for r in records
    )
    statistics = Statistics(*(found[name] for name in Statistics._fields))
    return Block(statistics, found["series"], found["ends"], tuple(failures))


class BlockFolder:
    """The folder of finished blocks, from which an ensemble resumes.

    Args:
        path: The folder; created if missing.
        identity: Everything that must be the same when the ensemble resumes.

    Raises:
        IntegratorError: The folder belongs to another ensemble, or is not writable.
    """

    def __init__(self, path: str | os.PathLike[str], identity: Mapping[str, Any]):
        self._path = os.fspath(path)
        mine, label = json.loads(json.dumps(identity)), os.path.join(self._path, "ensemble.json")
        try:
            os.makedirs(self._path, exist_ok=True)
        except OSError as error:
            raise IntegratorError(
                f"checkpoint must be a folder that can be made, but was {shorten(self._path, 200)!r}: {error.strerror}"
            ) from None
        if not os.path.exists(label):
            atomic_write(label, json.dumps(mine, indent=1) + "\n")
        with reading(f"checkpoint must be the folder of an ensemble, but {shorten(label, 200)} is damaged"):
            found = read_json(read_text(label)[0], dict, "content")
        for key in (*mine, *found):
            if found.get(key) != mine.get(key):
                was, is_ = (shorten(json.dumps(x.get(key), ensure_ascii=False)) for x in (found, mine))
                raise IntegratorError(
                    f"checkpoint must be the folder of the same ensemble, but there {key} was {was}, here it is {is_}"
                )

    def load(self, number: int, sizes: Mapping[str, int]) -> Block | None:
        """A block whose arrays have these lengths; None if it is missing or damaged."""
        try:
            with reading("a block must be whole"):
                return _block(StoredArrays(self._file(number), ""), sizes)
        except IntegratorError:
            return None

    def save(self, number: int, block: Block) -> None:
        """Write a block."""
        write_arrays(self._file(number), _arrays(block))

    def _file(self, number: int) -> str:
        return os.path.join(self._path, f"block-{number:06d}.npz")
