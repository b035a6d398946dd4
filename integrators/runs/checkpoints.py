"""Checkpoints: files from which a run resumes, and the identity of the run."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from hashlib import sha256
from time import monotonic
from typing import TYPE_CHECKING, Any

from foundation.machine_code import PACKAGE, package_version
from integrators.core.arguments import MOST_STEPS
from integrators.core.errors import IntegratorError, shorten
from integrators.core.stored_arrays import TEXT, Form, StoredArrays, read_json, reading
from integrators.core.text_files import remove_unfinished
from integrators.methods.program.program import program_text
from integrators.methods.tableaux.files import dumps_method
from integrators.runs.storage import Counts
from integrators.runs.trajectory import write_arrays
from integrators.steppers.states import State

if TYPE_CHECKING:
    from integrators.methods.program.program import Method
    from integrators.runs.observers import Observers
    from integrators.scenes.scene import Scene
    from integrators.steppers.stepping import Stepper


def description(compiled: Stepper, observer: Observers, options: dict[str, Any]) -> dict[str, Any]:
    """The scene, the method and the options, as JSON values; without a date, so that runs can be compared."""
    return {
        "scene": _scene(compiled.scene),
        "method": _method(compiled.method),
        "observe": list(observer.names),
        **options,
        "version": f"{PACKAGE} {package_version()}".rstrip(),
    }


def identity(compiled: Stepper, observer: Observers, options: dict[str, Any], start: State) -> dict[str, Any]:
    """Everything that must be the same when a run resumes from a checkpoint."""
    return {
        "scene": compiled.scene.name,
        "method": compiled.method.name,
        "observe": list(observer.names),
        **{key: value for key, value in options.items() if key != "steps"},
        "start": sha256(start.y.tobytes()).hexdigest(),
        "compiled steps": sha256(compiled.source.encode()).hexdigest(),
    }


def _scene(scene: Scene) -> dict[str, Any]:
    try:
        return {"name": scene.name} | scene.to_dict()
    except IntegratorError:  # a formula too long for a file
        return {"name": scene.name, "active": list(scene.active)}


def _method(method: Method) -> dict[str, Any]:
    """The content of a tableau file, or the program of a method without a tableau."""
    try:
        return {"name": method.name} | json.loads(dumps_method(method, "json"))  # type: ignore[arg-type]
    except IntegratorError:
        return {"name": method.name, "program": program_text(method.program).splitlines()}


DIGESTS = ("start", "compiled steps")
"""Entries that messages do not show."""
VECTORS = ("values", "carry", "memory", "control")


class Checkpoint:
    """The file from which a run resumes.

    Args:
        path: The file.
        identity: Everything that must be the same when the run resumes.
        every: Seconds between checkpoints.
    """

    def __init__(self, path: str, identity: Mapping[str, Any], every: float):
        self.path, self._identity, self._every = path, identity, every
        self._last = monotonic()

    @property
    def is_due(self) -> bool:
        """Whether the last checkpoint is old enough."""
        return monotonic() - self._last >= self._every

    def write(self, state: State, counts: Counts) -> None:
        """Write the state and the numbers of recorded rows; the old file is replaced by a complete one.

        Raises:
            IntegratorError: The file cannot be written.
        """
        import numpy as np

        arrays = {name: np.asarray(getattr(state, name)) for name in State.__slots__}
        arrays |= {"counts": np.asarray(counts), "run": np.asarray(json.dumps(self._identity, ensure_ascii=False))}
        write_arrays(self.path, {"digest": _digest(arrays), **arrays})
        self._last = monotonic()

    def restore(self, state: State, steps: int, rows: Callable[[int], Counts]) -> Counts | None:
        """Restore the state of a run.

        Args:
            state: The state at the start; overwritten.
            steps: The total number of steps.
            rows: The numbers of rows that a run has recorded after a number of steps.

        Returns:
            The numbers of recorded rows; None if there is no file.

        Raises:
            IntegratorError: The file is not a checkpoint of this run; the message says what differs.
        """
        import numpy as np

        if not os.path.exists(self.path):
            return None
        sentence = f"checkpoint must be a file of a run, but {shorten(self.path, 200)} was not"
        with reading(sentence):
            arrays = StoredArrays(self.path, sentence)
            run = arrays.read({"run": TEXT})
            self._check(read_json(run["run"], dict, "run"))
            sizes = {name: len(getattr(state, name)) for name in VECTORS}
            found = arrays.read(_forms(state), sizes)
            if found.pop("digest") != _digest(found | run) or found["solver"] not in (state.solver, "newton"):
                raise ValueError("its content is not what a run has written")
            counts, n = Counts(*found.pop("counts").tolist()), int(found["n"])
            if counts != rows(n):
                raise ValueError(f"counts must be {tuple(rows(n))} at step {n}, but were {tuple(counts)}")
        for name, value in found.items():
            setattr(state, name, np.array(value, dtype=float) if name in VECTORS else np.asarray(value).item())
        if state.n > steps:
            raise IntegratorError(f"steps must be at least the {state.n} of the checkpoint, but was {steps}")
        return counts

    def _check(self, known: Mapping[str, Any]) -> None:
        for key, value in json.loads(json.dumps(self._identity)).items():
            if known.get(key) != value:
                was = "other ones" if key in DIGESTS else f"{_shown(known.get(key))} and not {_shown(value)}"
                raise IntegratorError(f"checkpoint must be of the same run, but had as {key} {was}")

    def remove(self) -> None:
        """Remove the file, if it exists."""
        remove_unfinished(self.path)
        if os.path.exists(self.path):
            os.unlink(self.path)


def _forms(state: State) -> dict[str, Form]:
    """The forms of the arrays in a checkpoint, given the state at the start."""
    forms = {name: Form("f", (name,)) for name in VECTORS}
    forms |= {name: Form("f", (), (value, value)) for name, value in (("step_size", state.h), ("t0", state.t0))}
    forms |= {"n": Form("i", (), (0, MOST_STEPS)), "counts": Form("i", (2,), (0, MOST_STEPS)), "is_fresh": Form("b")}
    return forms | {"solver": TEXT, "digest": TEXT}


def _digest(arrays: Mapping[str, Any]) -> str:
    """A hash that detects changes of a checkpoint."""
    import numpy as np

    return sha256(b"".join(np.asarray(arrays[name]).tobytes() for name in sorted(arrays))).hexdigest()


def _shown(value: Any) -> str:
    return shorten(json.dumps(value, ensure_ascii=False))
