"""A scene with any subset of its effects, and the variables that two subsets share."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from bseries.exceptions import SeriesError
from integrators.core.arguments import items
from integrators.scenes.catalogue.registry import SceneEntry, find_entry, scene_catalogue
from integrators.scenes.catalogue.registry import scene as built_in
from integrators.scenes.model.blocks import TIME
from integrators.scenes.scene import Scene

Names = tuple[str, ...]


class EffectVariants(NamedTuple):
    """A scene with any subset of its effects."""

    effects: Mapping[str, str]  # with their descriptions
    build: Callable[[Names], Scene]  # the scene with exactly these effects
    bodies: Callable[[Collection[str]], Sequence[str]] | None = None  # names of particles, if effects change these

    @property
    def names(self) -> Names:
        """The names of the effects."""
        return tuple(self.effects)

    @property
    def full(self) -> Scene:
        """The scene with all effects."""
        return self.build(self.names)

    def without(self, *left_out: str) -> Names:
        """All effects except these."""
        return tuple(name for name in self.effects if name not in left_out)

    def shared(self, more: Names, less: Names) -> tuple[np.ndarray, np.ndarray]:
        """The places of the variables, except the time, that exist with both sets of effects."""
        places = {label: k for k, label in enumerate(self._labels(more))}
        pairs = [(places[label], k) for k, label in enumerate(self._labels(less)) if label != TIME]
        first, second = np.array(pairs, dtype=np.intp).T
        return first, second

    def parts(self, given: Any, scene: Scene) -> Any:
        """The assignment of a method's parts with these effects, without blocks that only other effects add."""
        if not isinstance(given, Mapping):
            return given
        absent = {block.name for block in self.full.blocks} - {block.name for block in scene.blocks}
        lists = {name: [value] if isinstance(value, str) else value for name, value in given.items()}
        return {name: [block for block in blocks if block not in absent] for name, blocks in lists.items()}

    def _labels(self, names: Names) -> Iterator[Any]:
        """An identifier for each variable: its name, or its body and component."""
        scene = self.build(names)
        if self.bodies is None:
            yield from scene.variables
            return
        bodies = self.bodies(names)
        for block in scene.blocks:
            yield from ((body, component) for body in bodies for component in block.components)


def effect_variants(
    scene: Scene | str,
    effects: str | Iterable[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    start: Mapping[str, Any] | None = None,
) -> EffectVariants:
    """The combinations of the effects of a scene.

    Example:
        >>> found = effect_variants("pendulum", ["drive", "damping"], {"gamma": "1/5"})
        >>> found.without("drive"), found.build(("damping",)).field
        (('damping',), (-p/5 - sin(q), p))
    """
    values, blocks = _mapping(parameters, "parameters"), _mapping(start, "start")
    chosen = (effects,) if isinstance(effects, str) else tuple(items(effects or (), "effects"))
    if effects is not None and not chosen:
        raise SeriesError("effects must name one effect or more, or be None for those of the scene, but was empty")
    if isinstance(scene, str):
        entry = find_entry(scene)
        names = chosen or tuple(entry.effects)
        if entry.built_in_effects is not None:
            return _built_anew(entry, names, values, blocks)
        full = built_in(entry.name, names, **values)
    elif isinstance(scene, Scene):
        full = scene.with_effects(*(chosen or scene.active or scene.effects), **values)
    else:
        raise SeriesError(f"scene must be a Scene or the name of one, but was {scene!r:.60}")
    if not full.active:
        raise _no_effects(full)
    full = full.with_start(**blocks)
    known = {name: full.effects[name].summary or "" for name in full.active}
    return EffectVariants(known, cache(lambda names: full.with_effects(*names)))


def _mapping(values: Any, argument: str) -> dict[str, Any]:
    if values is not None and not isinstance(values, Mapping):
        raise SeriesError(f"{argument} must map names to values, but was {values!r:.60}")
    return dict(values or {})


def _built_anew(entry: SceneEntry, names: Names, values: dict[str, Any], start: dict[str, Any]) -> EffectVariants:
    """Effects of scenes that are built with them; their parameters exist only with them."""
    options = {name: values.pop(name) for name in list(values) if name in entry.options}
    full = built_in(entry.name, names, **options, **values).with_start(**start)

    def build(names: Names) -> Scene:
        scene = built_in(entry.name, names, **options).with_start(**start)
        return scene.with_parameters(**{name: value for name, value in values.items() if name in scene.parameters})

    known = {name: text for name, text in (entry.built_in_effects or {}).items() if name in names}
    if not known:
        raise _no_effects(full)
    return EffectVariants(known, cache(build), entry.bodies)


def _no_effects(scene: Scene) -> SeriesError:
    by_name = any(entry.name == scene.name and entry.built_in_effects for entry in scene_catalogue())
    hint = "; its effects are chosen when it is built, so give its name in place of the scene" * by_name
    return SeriesError(f"scene must have effects, but {scene.title} has none{hint}")
