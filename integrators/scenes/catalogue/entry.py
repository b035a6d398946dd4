"""Catalogue entry of a built-in scene."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.scenes.scene import labelled

if TYPE_CHECKING:
    from integrators.scenes.scene import Scene


class SceneEntry(NamedTuple):
    """A built-in scene before it is built.

    Attributes:
        name: Its name.
        builder: Builds the scene without labels, all effects off; keyword arguments are options that change its shape
            or its start, such as the number of particles.
        summary: One line about the scene.
        reference: The source.
        aliases: Other names of the scene.
        built_in_effects: Effects that are more than additions to the base system, with their summaries: `builder`
            receives their names as `effects`.
        bodies: Names of the particles, in their order, for given effects, where these change the number of particles.
    """

    name: str
    builder: Callable[..., Scene]
    summary: str
    reference: str
    aliases: tuple[str, ...] = ()
    built_in_effects: Mapping[str, str] | None = None
    bodies: Callable[[Collection[str]], Sequence[str]] | None = None

    def build(self, **options: Any) -> Scene:
        """Build the scene; it has the labels of the entry unless the builder sets its own."""
        return labelled(self.builder(**options), name=self.name, summary=self.summary, reference=self.reference)

    @property
    def options(self) -> dict[str, Any]:
        """The names of its options and their defaults."""
        return {name: value for name, value in (self.builder.__kwdefaults__ or {}).items() if name != "effects"}

    @property
    def effects(self) -> dict[str, str]:
        """The names of its effects and their summaries; the scene is built to find them."""
        if self.built_in_effects is not None:
            return dict(self.built_in_effects)
        return {name: effect.summary or "" for name, effect in self.build().effects.items()}

    @property
    def default_effects(self) -> tuple[str, ...]:
        """The names of the effects that are on by default."""
        return tuple((self.builder.__kwdefaults__ or {}).get("effects", ()))
