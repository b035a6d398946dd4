"""The built-in scenes: looking them up by name, and building them with options, effects and parameters."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.core.errors import IntegratorError, shorten
from integrators.scenes.catalogue import chains, first_order, gravity, kepler, lennard_jones, mechanical
from integrators.scenes.model.assembly import UnknownNameError

if TYPE_CHECKING:
    from integrators.scenes.scene import Scene


class SceneEntry(NamedTuple):
    """A built-in scene before it is built.

    Attributes:
        name: Its name.
        build: Builds it, all effects off; keyword arguments are options that change its shape or its start, such as the
            number of particles.
        summary: What it is, in one line.
        reference: Where it comes from.
        aliases: Other names that find it.
        built_in_effects: Effects that are no addition to the base system, with their summaries: `build` takes their
            names as `effects`.
        bodies: What the sites are called, in their order, with such effects; where these change how many there are.
    """

    name: str
    build: Callable[..., Scene]
    summary: str
    reference: str
    aliases: tuple[str, ...] = ()
    built_in_effects: Mapping[str, str] | None = None
    bodies: Callable[[Collection[str]], Sequence[str]] | None = None

    @property
    def options(self) -> dict[str, Any]:
        """The names of its options and their defaults."""
        return {name: value for name, value in (self.build.__kwdefaults__ or {}).items() if name != "effects"}

    @property
    def effects(self) -> dict[str, str]:
        """The names of its effects and what they are; the scene is built for this."""
        if self.built_in_effects is not None:
            return dict(self.built_in_effects)
        return {name: effect.summary or "" for name, effect in self.build().effects.items()}

    @property
    def default_effects(self) -> tuple[str, ...]:
        """The names of the effects that are on by default."""
        return tuple((self.build.__kwdefaults__ or {}).get("effects", ()))


def _entries(*declared: tuple[Any, ...]) -> tuple[SceneEntry, ...]:
    return tuple(SceneEntry(*entry) for entry in declared)


ENTRIES = _entries(
    *first_order.SCENES,
    *mechanical.SCENES,
    *kepler.SCENES,
    *gravity.SCENES,
    *chains.SCENES,
    *lennard_jones.SCENES,
)
_SPELLING = str.maketrans({"-": None, "–": None, "_": None, " ": None})


def scene_catalogue() -> tuple[SceneEntry, ...]:
    """List the built-in scenes.

    Returns:
        One entry for each; nothing is built.

    Example:
        >>> [entry.name for entry in scene_catalogue() if "pendulum" in entry.name]
        ['pendulum', 'double-pendulum']
    """
    return ENTRIES


def scene(name: str, /, effects: Iterable[str] | None = None, **parameters: Any) -> Scene:
    """Build a scene of the catalogue.

    Args:
        name: Its name; upper and lower case are equal, ``-`` and ``_`` do not matter.
        effects: The effects to switch on; None for those that are on by default, which is none for most scenes.
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
    """The entry of a name or alias, however it is spelt.

    Raises:
        IntegratorError: There is no such scene.
    """
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
