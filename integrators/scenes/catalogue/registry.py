"""Built-in scenes by name, with options, effects and parameters. Files of this folder declare scenes in SCENES."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache, partial
from typing import TYPE_CHECKING, Any

from integrators.core.catalogues import declared_entries
from integrators.core.errors import IntegratorError, shorten
from integrators.scenes.catalogue.entry import SceneEntry
from integrators.scenes.model.assembly import UnknownNameError

if TYPE_CHECKING:
    from integrators.scenes.scene import Scene


ENTRIES: tuple[SceneEntry, ...] = tuple(declared_entries(__package__ or "", "SCENES"))
_SPELLING = str.maketrans({"-": None, "–": None, "_": None, " ": None})


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
        IntegratorError: There is no such scene, effect, option or parameter.

    Example:
        >>> scene("pendulum", effects=["damping"], gamma="1/5").field
        (-p/5 - sin(q), p)
    """
    entry = find_entry(name)
    options = {key: parameters.pop(key) for key in list(parameters) if key in entry.options}
    if entry.built_in_effects is not None and effects is not None:
        options["effects"] = _checked(_names(effects), entry.built_in_effects)
    built = entry.build(**options)
    has_others = entry.built_in_effects is None
    change = partial(built.with_effects, *_names(effects)) if has_others else built.with_parameters
    try:
        return change(**parameters)
    except UnknownNameError as error:
        hint = f"; options of {entry.name} are {', '.join(entry.options)}" if entry.options else ""
        raise IntegratorError(f"{error}{hint}") from None


def _names(effects: Any) -> tuple[str, ...]:
    if effects is None:
        return ()
    if isinstance(effects, str):
        return (effects,)
    if not isinstance(effects, Iterable):
        raise IntegratorError(f"effects must be names, but was {shorten(repr(effects))}")
    return tuple(effects)


def _checked(names: tuple[str, ...], known: Iterable[str]) -> tuple[str, ...]:
    known = tuple(known)
    for name in names:
        if name not in known:
            raise IntegratorError(f"effects must be of {', '.join(known)}, but one was {name!r:.60}")
    return names


def find_entry(name: Any) -> SceneEntry:
    """The entry of a name or alias, in any spelling."""
    spelled = _spelling(name) if isinstance(name, str) else ""
    if spelled in _index():
        return _index()[spelled]
    from difflib import get_close_matches

    near = [_index()[key].name for key in get_close_matches(spelled, _index(), n=3, cutoff=0.6)]
    hint = f"; did you mean {' or '.join(dict.fromkeys(near))}?" if near else ""
    raise IntegratorError(f"scene must be one of the catalogue, but was {shorten(repr(name))}{hint}")


@cache
def _index() -> dict[str, SceneEntry]:
    return {_spelling(name): entry for entry in ENTRIES for name in (entry.name, *entry.aliases)}


def _spelling(name: str) -> str:
    return name.strip().lower().translate(_SPELLING)
