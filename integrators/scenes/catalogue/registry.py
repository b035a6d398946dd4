"""Scenes by name, with options, effects and parameters.

Files of this folder declare scenes in SCENES; other distributions add theirs as entry points of `GROUP`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cache
from operator import itemgetter
from typing import Any, NamedTuple

from bseries_base.errors import shown, suggestion
from bseries_base.table import Column, Document, Table, Tabular, listed
from integrators.core.catalogues import Register, spelling
from integrators.core.errors import IntegratorError
from integrators.scenes.model.declarations import UnknownNameError
from integrators.scenes.model.terms import check_active
from integrators.scenes.scene import Scene, labelled

GROUP = "bseries.scenes"
"""The group of entry points by which other distributions add scenes."""
SCENE_FIELDS = ("name", "dimension", "effects", "options", "aliases", "summary", "reference")


class SceneEntry(NamedTuple):
    """A scene of the catalogue before it is built.

    A sequence of entries is what another distribution names as an entry point ``bseries.scenes``.

    Attributes:
        name, aliases: Its name, and other names.
        builder: Builds the scene without labels, all effects off; keyword arguments are options that change its shape
            or its start, such as the number of particles.
        summary, reference: One line about the scene, and its source.
        built_in_effects: Effects that are more than additions to the base system, with their summaries: `builder`
            receives their names as `effects`.
        bodies: Names of the particles, in their order, for given effects, where these change the number of particles.
        title: The name in titles and captions, where it is another.

    Example:
        >>> import bseries as bs
        >>> def quartic(*, k=1):
        ...     return bs.parse_hamiltonian("p^2/2 + k*q^4/4", parameters={"k": k}, start="p=0; q=1")
        >>> entry = bs.integrators.SceneEntry("quartic", quartic, "a quartic oscillator", "G. Duffing, 1918")
        >>> entry.options, entry.build(k=2).field
        ({'k': 1}, (-2*q**3, p))
    """

    name: str
    builder: Callable[..., Scene]
    summary: str
    reference: str
    aliases: tuple[str, ...] = ()
    built_in_effects: Mapping[str, str] | None = None
    bodies: Callable[[Collection[str]], Sequence[str]] | None = None
    title: str = ""

    def build(self, **options: object) -> Scene:
        """Build the scene; it has the labels of the entry unless the builder sets its own."""
        return labelled(self.builder(**options), name=self.name, summary=self.summary, reference=self.reference)

    @property
    def options(self) -> Document:
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

    def __repr__(self) -> str:
        return f"<SceneEntry: {self.name}, {self.summary}>"


REGISTER = Register(__package__ or "", "SCENES", GROUP, SceneEntry, SceneEntry.build)


class SceneCatalogue(Tabular, tuple["SceneEntry", ...]):
    """The built-in scenes, shown as a table."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"<SceneCatalogue: {len(self)} entries>"

    def to_table(self) -> Table:
        """Names, numbers of variables with default options, effects and summaries; records have sources too."""
        rows = _records()

        def description(row: Document) -> str:
            lists = (("also", row["aliases"]), ("options", row["options"]))
            return "\n".join([row["summary"], *(f"{what}: {', '.join(names)}" for what, names in lists if names)])

        def field(name: str) -> Any:
            return lambda row: row[name] if isinstance(row[name], str | int) else tuple(row[name])

        columns = (
            Column("name", get=itemgetter("name")),
            Column("variables", True, itemgetter("dimension")),
            Column("effects", get=lambda row: ", ".join(row["effects"])),
            Column("description", get=description),
        )
        return Table(
            "Scenes",
            columns,
            rows,
            data=lambda: {"schema": 1, "kind": "scenes", "scenes": rows},
            items="scenes",
            records=listed([(name, field(name)) for name in SCENE_FIELDS], rows),
            titled=False,
        )


@cache
def _records() -> list[Document]:
    """The fields of entries in JSON and CSV; scenes are built for their dimensions."""
    return [
        {field: entry.build().dimension if field == "dimension" else getattr(entry, field) for field in SCENE_FIELDS}
        for entry in REGISTER.entries
    ]


def scene_catalogue() -> SceneCatalogue:
    """The catalogue of scenes: a tuple with an entry for each of them, none of them built.

    Example:
        >>> import bseries as bs
        >>> [entry.name for entry in bs.scene_catalogue() if "pendulum" in entry.name]
        ['pendulum', 'double-pendulum']
    """
    return SceneCatalogue(REGISTER.entries)


def scene(name: str, /, effects: Iterable[str] | None = None, **parameters: object) -> Scene:
    """Build a scene of the catalogue.

    Args:
        name: Its name or an alias; case, ``-`` and ``_`` do not matter.
        effects: The effects to switch on; None for the default effects, which most scenes do not have.
        parameters: Options of the scene (such as the number of particles), and values of its parameters and of those
            of the effects that are on.

    Raises:
        IntegratorError: The scene, or an effect, option or parameter is unknown.

    Example:
        >>> import bseries as bs
        >>> bs.scene("pendulum", effects=["damping"], gamma="1/5").field
        (-p/5 - sin(q), p)
    """
    entry = find_entry(name)
    options = {key: parameters.pop(key) for key in list(parameters) if key in entry.options}
    if effects is not None and not isinstance(effects, Iterable):
        raise IntegratorError(f"effects must be names, but was {shown(effects)}")
    names = (effects,) if isinstance(effects, str) else tuple(effects or ())
    if entry.built_in_effects is not None:
        options |= {} if effects is None else {"effects": check_active(names, entry.built_in_effects)}
        names = ()
    try:
        return entry.build(**options).with_effects(*names, **parameters)
    except UnknownNameError as error:
        hint = f"; options of {entry.name} are {', '.join(entry.options)}" if entry.options else ""
        raise IntegratorError(f"{error}{hint}") from None


def as_scene(value: Scene | str) -> Scene:
    """The scene of a name, or the scene itself."""
    if isinstance(value, str):
        return scene(value)
    if not isinstance(value, Scene):
        hint = ", which scene_from_function makes of a function" if callable(value) else ""
        raise IntegratorError(f"scene must be a Scene or the name of one{hint}, but was {shown(value)}")
    return value


def find_entry(name: object) -> SceneEntry:
    """The entry of a name or alias, in any spelling."""
    key = spelling(name) if isinstance(name, str) else ""
    index = REGISTER.index_with(key)
    if key in index:
        return index[key][0]
    near = suggestion(key, [entry.name for entry in REGISTER.entries])
    raise IntegratorError(f"scene must be one of the catalogue, but was {shown(name)}{near}")
