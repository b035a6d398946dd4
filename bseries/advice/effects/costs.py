"""Cost of effects: times of a step and of a field evaluation, and numbers of trees."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from bseries.advice.effects.variants import EffectVariants, Names, effect_variants
from bseries.advice.timing import MOST_STEPS, Timing, Work, step_costs
from bseries.algebra.stages import auxiliary_colors, check_method
from bseries.exceptions import SeriesError
from bseries.fields.modified_fields import trees_of_method
from foundation.diagrams import bar_height, draw_bars, write_title
from foundation.plotting import drawing
from foundation.table import Column, Table, as_frame, as_html, as_text, listed
from integrators.exact.arguments import read_number
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes


NANO, WIDTH = 1e9, 12.0
"""Nanoseconds of a second; centimetres of a plot."""
ORDER = 6
"""The largest number of nodes of trees: two orders beyond the terms of the usual methods of order 4."""


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
            _COLUMNS,
            self.rows,
            notes,
            data=self.to_dict,
            items="rows",
            records=listed(_FIELDS, self.rows),
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """The time of a step as effects are added; whiskers are the quartiles.

        Args:
            ax: The axes, which are returned; None for those of a new figure.

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


_COLUMNS = (
    Column("on", True, lambda row: len(row.effects)),
    Column("effects", get=lambda row: ", ".join(row.effects)),
    Column("step", True, lambda row: f"{row.step.seconds * 1e9:,.1f} ns"),
    Column("±", True, lambda row: f"{(row.step.high - row.step.low) / 2 * 1e9:.1f}"),
    Column("field", True, lambda row: f"{row.field.seconds * 1e9:,.1f} ns"),
    Column("±", True, lambda row: f"{(row.field.high - row.field.low) / 2 * 1e9:.1f}"),
    Column("trees", True, lambda row: "" if row.trees is None else f"{row.trees:,}"),
    Column("of", True, lambda row: "" if row.all_trees is None else f"{row.all_trees:,}"),
)
_FIELDS = (
    ("on", lambda row: len(row.effects)),
    ("effects", lambda row: row.effects),
    ("step_seconds", lambda row: row.step.seconds),
    ("step_low", lambda row: row.step.low),
    ("step_high", lambda row: row.step.high),
    ("field_seconds", lambda row: row.field.seconds),
    ("field_low", lambda row: row.field.low),
    ("field_high", lambda row: row.field.high),
    ("trees", lambda row: row.trees),
    ("all_trees", lambda row: row.all_trees),
)


def effect_costs(
    method: Method | str,
    scene: Scene | str,
    *,
    h: float,
    effects: str | Iterable[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    start: Mapping[str, Any] | None = None,
    parts: Mapping[str, Any] | None = None,
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
    rows = (
        CostRow(names, steps[names], fields[names], *_trees(variants, names, method, parts, order)) for names in nested
    )
    return EffectCosts(variants.full.name, method.name, step, order, tuple(rows))


def variant_costs(
    variants: EffectVariants,
    chosen: Iterable[Names],
    method: Method | str,
    h: float,
    *,
    parts: Any = None,
    options: Mapping[str, Any],
    most_steps: int = MOST_STEPS,
) -> dict[Names, Timing]:
    """CPU seconds per step with each of several sets of effects, timed in interleaved rounds."""
    chosen, work = tuple(chosen), dict[str, Work]()
    for names in chosen:
        scene = variants.build(names)
        given = {**options, "parts": variants.parts(parts, scene)}
        work[", ".join(names)] = Work(scene, method, h, options=given, most_steps=most_steps)
    return dict(zip(chosen, step_costs(work).values(), strict=True))


def _trees(
    variants: EffectVariants, names: Names, method: Method, parts: Any, order: int
) -> tuple[int | None, int | None]:
    """The numbers of trees in the modified equation on the scene and in general; None for methods with a matrix."""
    scene = variants.build(names)
    if auxiliary_colors(method):
        return None, None
    trees = trees_of_method(method, order, scene, variants.parts(parts, scene))
    return len(trees.table), trees.total
