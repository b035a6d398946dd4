"""Summary of a trajectory: start, end and largest change of observed quantities and variables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from bseries.advice.measures import energy_size
from bseries.scene_text import head, place
from foundation.table import Table, number_column
from integrators.runs.trajectory import START_AND_END, Trajectory
from integrators.scenes.scene import Scene

MOST_ROWS = 60
"""The most rows of printed tables; JSON has all."""


def run_summary(
    run: Trajectory, scene: Scene, method: str, steps: int, *, effects: Sequence[str] | None = None
) -> Table:
    """The start, the end and the largest changes of a run as a table; CSV holds all states.

    The title contains the given effects, by default the active ones.

    Example:
        >>> import bseries as bs
        >>> pendulum = bs.scene("pendulum")
        >>> run = bs.integrate("stormer-verlet", pendulum, h=0.1, steps=100, save_every=1, observe="energy")
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
        (*START_AND_END, number_column("relative", ".3g")),
        records[:MOST_ROWS],
        notes,
        data=lambda: {**facts, "rows": records},
        items="rows",
        records=run.to_table().records,
    )


def energy_error(records: Sequence[Mapping[str, Any]]) -> float | None:
    """The largest change of the energy, relative to the start unless that is zero up to rounding."""
    for record in records:
        if record["what"] == "energy":
            return record["change"] if record["relative"] is None else record["relative"]
    return None


def _records(run: Trajectory, scene: Scene) -> Iterator[dict[str, Any]]:
    """The records of the table of a run, with changes relative to the start; None for numbers that are not finite."""
    for record in run.to_table().rows:
        if "change" in record:
            change, first = record["change"], record["start"]
            only_rounding = first and record["what"] == "energy" and energy_size(scene, run.y[:, 0]) != abs(first)
            known = change is not None and first and not only_rounding
            record = record | {"relative": change / abs(first) if known else None}
        yield record
