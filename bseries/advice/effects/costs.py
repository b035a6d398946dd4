"""A scene with any subset of its effects, and their cost: times of a step and of the field, numbers of trees."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bseries.advice.timing import MOST_STEPS, Timing, Work, step_costs
from bseries.algebra.stages import auxiliary_colors, check_method
from bseries.exceptions import SeriesError
from bseries.fields.scene_trees import trees_of_method
from bseries_base.diagrams import bar_height, draw_bars
from bseries_base.plotting import drawing
from bseries_base.table import Column, Table, as_frame, as_html, as_text, listed
from integrators.core.arguments import items
from integrators.exact.arguments import read_number
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.runs.titles import write_title
from integrators.scenes.catalogue.registry import SceneEntry, find_entry, scene_catalogue
from integrators.scenes.catalogue.registry import scene as built_in
from integrators.scenes.model.blocks import TIME
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes


NANO, WIDTH = 1e9, 12.0
"""Nanoseconds of a second; centimetres of a plot."""
ORDER = 6
"""The largest number of nodes of trees: two orders beyond the terms of the usual methods of order 4."""
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

    def parts(self, given: Parts | None, scene: Scene) -> Parts | None:
        """The assignment of a method's parts with these effects, without blocks that only other effects add."""
        if not isinstance(given, Mapping):
            return given
        absent = {block.name for block in self.full.blocks} - {block.name for block in scene.blocks}
        lists = {name: [value] if isinstance(value, str) else value for name, value in given.items()}
        return {name: [block for block in blocks if block not in absent] for name, blocks in lists.items()}

    def _labels(self, names: Names) -> list[str] | list[tuple[str, str]]:
        """An identifier for each variable: its name, or its body and component."""
        scene = self.build(names)
        if self.bodies is None:
            return list(scene.variables)
        bodies = self.bodies(names)
        return [(body, component) for block in scene.blocks for body in bodies for component in block.components]


def effect_variants(
    scene: Scene | str,
    effects: str | Iterable[str] | None = None,
    parameters: Mapping[str, object] | None = None,
    start: Mapping[str, object] | None = None,
) -> EffectVariants:
    """The combinations of the effects of a scene."""
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


def _mapping(values: Mapping[str, object] | None, argument: str) -> dict[str, object]:
    if not isinstance(values, Mapping | None):
        raise SeriesError(f"{argument} must map names to values, but was {values!r:.60}")
    return dict(values or {})


def _built_anew(entry: SceneEntry, names: Names, values: dict[str, object], start: dict[str, object]) -> EffectVariants:
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


@dataclass(frozen=True)
class CostRow:
    """The cost of a set of effects.

    Attributes:
        effects: The active effects.
        step: Seconds for a step.
        field: Seconds for an evaluation of the field.
        trees: The number of trees in the modified equation.
        all_trees: The number of all trees.

    Example:
        >>> import bseries as bs
        >>> row = bs.effect_costs("rk4", "pendulum", h=0.05, effects="damping")[-1]
        >>> row.effects, 0 < row.step.seconds < 1e-3
        (('damping',), True)
    """

    effects: Names
    step: Timing
    field: Timing
    trees: int | None
    all_trees: int | None


@dataclass(frozen=True, repr=False)
class EffectCosts(Sequence[CostRow]):
    """The costs of the effects of a scene, measured by `effect_costs`: a sequence of rows.

    Attributes:
        scene: The name of the scene.
        method: The name of the method.
        h: The step size.
        order: The largest number of nodes of trees.
        rows: The costs with no effect, the first one, the first two, … all.

    Example:
        >>> import bseries as bs
        >>> costs = bs.effect_costs("rk4", "pendulum", h=0.05, effects="damping")
        >>> costs
        <EffectCosts of pendulum, rk4: 2 rows>
        >>> costs.order, len(costs), costs[-1].effects
        (6, 2, ('damping',))
    """

    scene: str
    method: str
    h: float
    order: int
    rows: tuple[CostRow, ...]

    def __repr__(self) -> str:
        return f"<EffectCosts of {self.scene}, {self.method}: {len(self)} rows>"

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: Any) -> Any:
        return self.rows[index]

    def to_dict(self) -> dict[str, Any]:
        """The costs as plain data."""
        return {"schema": 1, "kind": "effect-costs", **asdict(self)}

    def to_table(self) -> Table:
        """The costs as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON."""
        notes = [
            "step, field: CPU time for a step and for an evaluation of the field; "
            "±: half the distance of the quartiles.",
            f"trees: those to order {self.order} that the modified equation of {self.method} needs there.",
        ]
        return Table(
            f"Cost of effects of {self.scene}, {self.method}",
            [Column(heading, heading != "effects") for heading in _HEADINGS],
            list(map(_cells, self.rows)),
            notes,
            data=self.to_dict,
            items="rows",
            records=listed(_FIELDS, self.rows),
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """The time of a step as effects are added; whiskers are the quartiles.

        Args:
            ax: The axes, which are returned; None for pyplot's current or new ones.

        Raises:
            SeriesError: `ax` is no axes.
            ImportError: matplotlib is not installed.

        Example:
            >>> import bseries as bs
            >>> axes = bs.effect_costs("rk4", "pendulum", h=0.05, effects="damping").plot()
            >>> [label.get_text() for label in axes.get_yticklabels()]
            ['no effects', '+ damping']
        """
        names = [f"+ {row.effects[-1]}" if row.effects else "no effects" for row in self.rows]
        times = [row.step for row in self.rows]
        below = [(time.seconds - time.low) * NANO for time in times]
        above = [(time.high - time.seconds) * NANO for time in times]
        with drawing(ax, SeriesError, (WIDTH, bar_height(len(names)))) as axes:
            draw_bars(axes, names, [time.seconds * NANO for time in times], (below, above))
            write_title(axes, f"{self.method} on {self.scene}, h = {self.h:g}")
            axes.set_xlabel("CPU time of a step in ns")
        return axes

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame


def _cells(row: CostRow) -> list[str]:
    """A row of the table: after each time half the distance of its quartiles."""
    cells = [str(len(row.effects)), ", ".join(row.effects)]
    for time in (row.step, row.field):
        cells += [f"{time.seconds * NANO:,.1f} ns", f"{(time.high - time.low) / 2 * NANO:.1f}"]
    return cells + ["" if count is None else f"{count:,}" for count in (row.trees, row.all_trees)]


_HEADINGS = ("on", "effects", "step", "±", "field", "±", "trees", "of")
_TIMES = [f"{what}.{part}" for what in ("step", "field") for part in ("seconds", "low", "high")]
_FIELDS = (
    ("on", lambda row: len(row.effects)),
    *((name.replace(".", "_"), attrgetter(name)) for name in ("effects", *_TIMES, "trees", "all_trees")),
)


def effect_costs(
    method: Method | str,
    scene: Scene | str,
    *,
    h: float,
    effects: str | Iterable[str] | None = None,
    parameters: Mapping[str, object] | None = None,
    start: Mapping[str, object] | None = None,
    parts: Parts | None = None,
    solver: str = "auto",
    order: int = ORDER,
) -> EffectCosts:
    """The cost of a scene as its effects are added: none, the first one, the first two, … all.

    Times are CPU seconds of compiled code, measured in interleaved rounds. The field is timed as a step of the explicit
    Euler method without compensation: one evaluation and one sum.

    Args:
        method, scene, effects, parameters, start, parts, solver: As for `effect_influence`.
        h: The step size, on which the costs of implicit steps depend.
        order: The largest number of nodes of trees in the modified equation.

    Raises:
        SeriesError: The scene has no effects.
        IntegratorError: The method does not suit the scene with some effects, or an argument is invalid; a StepError if
            a step failed.

    Example:
        >>> import bseries as bs
        >>> rows = bs.effect_costs("stormer-verlet", "kepler", h=0.02, effects="oblateness")
        >>> [(row.effects, row.trees, row.all_trees) for row in rows]
        [((), 37, 1202), (('oblateness',), 37, 1202)]
    """
    variants, step = effect_variants(scene, effects, parameters, start), read_number(h, "h")
    method = check_method(as_method(method))
    nested = [variants.names[:k] for k in range(len(variants.names) + 1)]
    options = {"solver": solver}
    steps = variant_costs(variants, nested, method, step, parts=parts, options=options)
    fields = variant_costs(variants, nested, "explicit-euler", step / MOST_STEPS, options={"compensated": False})
    rows = list[CostRow]()
    for names in nested:
        scene, counts = variants.build(names), (None, None)
        if not auxiliary_colors(method):  # methods with a matrix are no series of trees of the scene
            trees = trees_of_method(method, order, scene, variants.parts(parts, scene))
            counts = len(trees.table), trees.total
        rows.append(CostRow(names, steps[names], fields[names], *counts))
    return EffectCosts(variants.full.name, method.name, step, order, tuple(rows))


def variant_costs(
    variants: EffectVariants,
    chosen: Iterable[Names],
    method: Method | str,
    h: float,
    *,
    parts: Parts | None = None,
    options: Mapping[str, object],
    most_steps: int = MOST_STEPS,
) -> dict[Names, Timing]:
    """CPU seconds per step with each of several sets of effects, timed in interleaved rounds."""
    chosen, work = tuple(chosen), dict[str, Work]()
    for names in chosen:
        scene = variants.build(names)
        given = {**options, "parts": variants.parts(parts, scene)}
        work[", ".join(names)] = Work(scene, method, h, options=given, most_steps=most_steps)
    return dict(zip(chosen, step_costs(work).values(), strict=True))
