"""Summary of a trajectory: start, end and largest change of observed quantities and variables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from bseries.advice.distances import energy_size
from bseries.scene_text import head, place
from bseries.table import Column, LazyRows, Table

if TYPE_CHECKING:
    from integrators import Scene, Trajectory

FORMS = {"start": ".15g", "end": ".15g", "change": ".3g", "relative": ".3g"}
MOST_ROWS = 60
"""The most rows for readers; JSON has all."""


def run_summary(
    run: Trajectory, scene: Scene, method: str, steps: int, *, effects: Sequence[str] | None = None
) -> Table:
    """The start, the end and the largest changes of a run as a table; CSV holds all states.

    Args:
        run: The trajectory.
        scene: The scene.
        method: The name of the method.
        steps: The number of steps.
        effects: Effects for the title; by default those that are on.

    Example:
        >>> import bseries as bs
        >>> pendulum = bs.scene("pendulum")
        >>> run = bs.integrate(pendulum, "stormer-verlet", h=0.1, steps=100, save_every=1, observe="energy")
        >>> print(run_summary(run, pendulum, "stormer-verlet", 100).title)
        stormer-verlet on pendulum: 100 steps of 0.1, t = 0 to 10
    """
    records = list(_records(run, scene))
    notes = []
    if run.observed:
        count = len(run.observed_t)
        notes.append(
            f"change: the largest distance from the start, at {count:,} times; relative: as a part of the start."
        )
    if len(records) > MOST_ROWS:
        notes.append(f"The first {MOST_ROWS} of {len(records):,} rows are shown; --format json has them all.")
    times = [float(run.t[0]), float(run.t[-1])]
    facts = {**head("simulation", method, scene, effects), "h": run.h, "steps": steps, "t": times}
    return Table(
        f"{place(method, scene, effects)}: {steps:,} steps of {run.h:g}, t = {run.t[0]:g} to {run.t[-1]:g}",
        (Column("what", get=itemgetter("what")), *(Column(key, True, _number(key)) for key in FORMS)),
        records[:MOST_ROWS],
        notes,
        data=lambda: {**facts, "rows": records},
        items="rows",
        records=_states(run),
    )


def energy_error(records: Sequence[Mapping[str, Any]]) -> float | None:
    """The largest change of the energy, relative to the start unless that is 0 but for rounding."""
    for record in records:
        if record["what"] == "energy":
            return record["change"] if record["relative"] is None else record["relative"]
    return None


def _records(run: Trajectory, scene: Scene) -> Iterator[dict[str, Any]]:
    """Observed quantities and variables, at the start and at the end; None for numbers that are not finite."""
    for name, values in run.observed.items():
        first, last = _finite(values[0]), _finite(values[-1])
        change = None if first is None else _finite(abs(values - first).max())
        is_size = first and not (name == "energy" and _is_rounding(first, run, scene))
        relative = change / abs(first) if change is not None and first and is_size else None
        yield {"what": name, "start": first, "end": last, "change": change, "relative": relative}
    for name, values in zip(run.variables, run.y, strict=True):
        yield {"what": name, "start": float(values[0]), "end": float(values[-1])}


def _is_rounding(energy: float, run: Trajectory, scene: Scene) -> bool:
    """Whether an energy at the start is 0 but for rounding, so that nothing is relative to it."""
    return energy_size(scene, run.y[:, 0]) != abs(energy)


def _finite(value: Any) -> float | None:
    return float(value) if math.isfinite(value) else None


def _number(key: str) -> Any:
    return lambda record: "" if record.get(key) is None else format(record[key], FORMS[key])


def _states(run: Trajectory) -> Table:
    """A row for each time."""
    columns = [run.t, *run.y, *run.observed.values()]

    def rows() -> Iterator[list[str]]:
        return ([repr(float(column[k])) for column in columns] for k in range(len(run.t)))

    return Table("", list(map(Column, ["t", *run.variables, *run.observed])), LazyRows(rows, len(run.t)))
