"""New values in a declaration: of parameters, and of start values."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

from ..errors import IntegratorError
from ..expressions import shorten
from .assembly import has_time
from .blocks import TIME
from .declarations import read_parameters
from .start_values import read_start

if TYPE_CHECKING:
    from .assembly import Contribution, Declaration

BASE = ""
"""The owner of what belongs to no effect."""


class UnknownNameError(IntegratorError):
    """There is no parameter or block of a name."""


def with_values(scene: Declaration, active: Collection[str], values: Mapping[str, Any]) -> Declaration:
    """The declaration with other values of parameters, of the base system or of effects that are on.

    Raises:
        IntegratorError: There is no such parameter, or it has another number of values.
    """
    parts = _parts(scene)
    owners = {name: owner for owner, part in parts.items() for name in part.parameters}
    for name, value in values.items():
        owner = _owner(name, owners, active, "parameters")
        old, new = parts[owner].parameters[name], read_parameters({name: value})[name]
        if _count(old) != _count(new):
            raise IntegratorError(f"parameters.{name} must be {_count(old)}, as before, but was {_count(new)}")
        parts[owner] = parts[owner]._replace(parameters={**parts[owner].parameters, name: new})
    return _joined(scene, parts)


def with_start_values(scene: Declaration, active: Collection[str], values: Mapping[str, Any]) -> Declaration:
    """The declaration with other start values of blocks, of the base system or of effects that are on.

    Raises:
        IntegratorError: There is no such block, or it has another number of variables.
    """
    parts = _parts(scene)
    owners = {block.name: owner for owner, part in parts.items() for block in part.blocks}
    if TIME in values and TIME not in owners and has_time(scene, active):
        owners[TIME] = BASE
        parts = {
            owner: part._replace(start={k: v for k, v in part.start.items() if k != TIME})
            for owner, part in parts.items()
        }
    for name, value in values.items():
        owner = _owner(name, owners, active, "start")
        new = read_start({name: value}, parts[owner].blocks)
        parts[owner] = parts[owner]._replace(start={**parts[owner].start, **new})
    return _joined(scene, parts)


def _parts(scene: Declaration) -> dict[str, Contribution]:
    return {BASE: scene.base, **scene.effects}


def _joined(scene: Declaration, parts: dict[str, Contribution]) -> Declaration:
    return scene._replace(base=parts[BASE], effects={name: parts[name] for name in scene.effects})


def _owner(name: str, owners: Mapping[str, str], active: Collection[str], argument: str) -> str:
    """The effect that has brought a name, or none; names of effects that are off are refused."""
    owner = owners.get(name)
    if owner is not None and (owner == BASE or owner in active):
        return owner
    known = shorten(", ".join(key for key, value in owners.items() if value == BASE or value in active) or "none")
    off = f", which belongs to the effect {owner} that is off" if owner else ""
    raise UnknownNameError(f"{argument} must be of {known}, but one was {shorten(name)}{off}")


def _count(value: Any) -> str:
    return f"a list of {len(value)} numbers" if isinstance(value, tuple) else "a number"
