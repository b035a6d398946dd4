"""Built-in scenes by name, with options, effects and parameters. Files of this folder declare scenes in SCENES."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING, Any

from integrators.core.catalogues import declared_entries, index_by_name, spelling
from integrators.core.errors import IntegratorError, shorten
from integrators.scenes.catalogue.entry import SceneEntry
from integrators.scenes.model.assembly import UnknownNameError
from integrators.scenes.model.effects import check_active

if TYPE_CHECKING:
    from integrators.scenes.scene import Scene


ENTRIES: tuple[SceneEntry, ...] = tuple(declared_entries(__package__ or "", "SCENES"))


def scene_catalogue() -> tuple[SceneEntry, ...]:
    """List the built-in scenes.

    Returns:
        One entry for each scene, none of them built.

    Example:
        >>> [entry.name for entry in scene_catalogue() if "pendulum" in entry.name]
        ['pendulum', 'double-pendulum']
    """
    return ENTRIES


def scene(name: str, /, effects: Iterable[str] | None = None, **parameters: Any) -> Scene:
    """Build a scene of the catalogue.

    Args:
        name: Its name or an alias; case, ``-`` and ``_`` do not matter.
        effects: The effects to switch on; None for the default effects, which most scenes do not have.
        parameters: Options of the scene (such as the number of particles), and values of its parameters and of those
            of the effects that are on.

    Returns:
        The scene.

    Raises:
        IntegratorError: The scene, or an effect, option or parameter is unknown.

    Example:
        >>> scene("pendulum", effects=["damping"], gamma="1/5").field
        (-p/5 - sin(q), p)
    """
    entry = find_entry(name)
    options = {key: parameters.pop(key) for key in list(parameters) if key in entry.options}
    names = _names(effects)
    if entry.built_in_effects is not None:
        options |= {} if effects is None else {"effects": check_active(names, entry.built_in_effects)}
        names = ()
    try:
        return entry.build(**options).with_effects(*names, **parameters)
    except UnknownNameError as error:
        hint = f"; options of {entry.name} are {', '.join(entry.options)}" if entry.options else ""
        raise IntegratorError(f"{error}{hint}") from None


def _names(effects: Any) -> tuple[str, ...]:
    if isinstance(effects, str):
        return (effects,)
    if effects is not None and not isinstance(effects, Iterable):
        raise IntegratorError(f"effects must be names, but was {shorten(repr(effects))}")
    return () if effects is None else tuple(effects)


def find_entry(name: Any) -> SceneEntry:
    """The entry of a name or alias, in any spelling."""
    key = spelling(name) if isinstance(name, str) else ""
    if key in _index():
        return _index()[key][0]
    from difflib import get_close_matches

    near = [_index()[close][0].name for close in get_close_matches(key, _index(), n=3, cutoff=0.6)]
    hint = f"; did you mean {' or '.join(dict.fromkeys(near))}?" if near else ""
    raise IntegratorError(f"scene must be one of the catalogue, but was {shorten(repr(name))}{hint}")


@cache
def _index() -> dict[str, tuple[SceneEntry, str]]:
    return index_by_name(ENTRIES)
