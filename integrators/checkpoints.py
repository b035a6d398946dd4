"""Checkpoints: all that a run goes on from, and what tells that it is the same run."""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Mapping
from time import monotonic
from typing import Any

from .errors import IntegratorError
from .expressions import shorten
from .recordings import Counts
from .steppers.states import State
from .text_files import atomic_write

DIGESTS = ("start", "compiled steps")
"""What is compared without being shown."""


class Checkpoint:
    """The file that a run can go on from.

    Args:
        path: The file.
        identity: What must be the same when the run goes on.
        every: Seconds between two checkpoints.
    """

    def __init__(self, path: str, identity: Mapping[str, Any], every: float):
        self.path, self._identity, self._every = path, identity, every
        self._last = monotonic()

    @property
    def is_due(self) -> bool:
        """Whether the last one is old enough."""
        return monotonic() - self._last >= self._every

    def write(self, state: State, counts: Counts) -> None:
        """Write the file, so that there is always a whole one.

        Args:
            state: The run.
            counts: How many rows have been recorded.

        Raises:
            IntegratorError: The file cannot be written.
        """
        import numpy as np

        arrays = {name: np.asarray(getattr(state, name)) for name in State.__slots__}
        file = io.BytesIO()
        np.savez(file, counts=counts, run=json.dumps(self._identity, ensure_ascii=False), **arrays)  # type: ignore[arg-type]
        atomic_write(self.path, file.getvalue())
        self._last = monotonic()

    def restore(self, state: State, steps: int) -> Counts | None:
        """Bring a run to where the file says that it was.

        Args:
            state: The run at its start.
            steps: How many steps it is to make in all.

        Returns:
            How many rows had been recorded; None if there is no file.

        Raises:
            IntegratorError: The file is no checkpoint, or one of another run; the message says what differs.
        """
        import numpy as np

        if not os.path.exists(self.path):
            return None
        try:
            with np.load(self.path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in State.__slots__}
                counts, known = Counts(*file["counts"].tolist()), dict(json.loads(str(file["run"])))
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
            name, reason = shorten(self.path, 200), getattr(error, "strerror", None) or str(error)
            raise IntegratorError(
                f"checkpoint must be a file of a run, but {name} was not: {shorten(reason)}"
            ) from None
        self._check(known)
        for name, array in arrays.items():
            setattr(state, name, array if array.ndim else array.item())
        if state.n > steps:
            raise IntegratorError(f"steps must be at least the {state.n} of the checkpoint, but was {steps}")
        return counts

    def _check(self, known: Mapping[str, Any]) -> None:
        for key, value in json.loads(json.dumps(self._identity)).items():
            if known.get(key) != value:
                was = "other ones" if key in DIGESTS else f"{_shown(known.get(key))} and not {_shown(value)}"
                raise IntegratorError(f"checkpoint must be of the same run, but had as {key} {was}")

    def remove(self) -> None:
        """Take the file away, if there is one: the run has ended."""
        if os.path.exists(self.path):
            os.unlink(self.path)


def _shown(value: Any) -> str:
    return shorten(json.dumps(value, ensure_ascii=False))
