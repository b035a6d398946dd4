"""What a run is of: for readers of its files, and to tell whether a checkpoint is of the same run."""

from __future__ import annotations

import json
from hashlib import sha256
from typing import TYPE_CHECKING, Any

from foundation.machine_code import PACKAGE, package_version

from .errors import IntegratorError
from .files import dumps_method
from .program_text import program_text

if TYPE_CHECKING:
    from .observers import Observers
    from .program_method import Method
    from .scenes.base import Scene
    from .steppers.states import State
    from .steppers.stepping import Stepper


def description(made: Stepper, seen: Observers, options: dict[str, Any]) -> dict[str, Any]:
    """The scene, the method and the options, as JSON can hold them; there is no date, so that runs can be compared."""
    return {
        "scene": _scene(made.scene),
        "method": _method(made.method),
        "observe": list(seen.names),
        **options,
        "version": f"{PACKAGE} {package_version()}".rstrip(),
    }


def identity(made: Stepper, seen: Observers, options: dict[str, Any], start: State) -> dict[str, Any]:
    """What must be the same where a run goes on from a checkpoint."""
    return {
        "scene": made.scene.name,
        "method": made.method.name,
        "observe": list(seen.names),
        **{key: value for key, value in options.items() if key != "steps"},
        "start": sha256(start.y.tobytes()).hexdigest(),
        "compiled steps": sha256(made.source.encode()).hexdigest(),
    }


def _scene(scene: Scene) -> dict[str, Any]:
    try:
        return {"name": scene.name} | scene.to_dict()
    except IntegratorError:  # a formula is too long for a file
        return {"name": scene.name, "active": list(scene.active)}


def _method(method: Method) -> dict[str, Any]:
    """The content of a tableau file, or the program of a method of another kind."""
    try:
        return {"name": method.name} | json.loads(dumps_method(method, "json"))  # type: ignore[arg-type]
    except IntegratorError:
        return {"name": method.name, "program": program_text(method.program).splitlines()}  # type: ignore[union-attr]
