"""Two results side by side, each in units of its own machine's speed."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

from .kinds import Row
from .report import figure_rows, to_markdown
from .results import KIND, Result
from .texts import amount

if TYPE_CHECKING:
    from rich.console import Console

LOOPS = ("compiled", "interpreted")
NOTABLE = 1.1
"""A ratio is marked from here on, or from that of a row's rounds to their best where these scatter more."""


class ResultError(ValueError):
    """A file that holds no result."""


class Value(NamedTuple):
    """One number of a result.

    Attributes:
        work: What it is.
        number: The number.
        unit: Its unit: "s" for a time.
        more_is_better: Whether a larger number is the better one.
        loop: The calibration loop whose time it is to be divided by; empty for what does not depend on the machine.
        scatter: The median of the rounds over the best.
    """

    work: str
    number: float
    unit: str = "s"
    more_is_better: bool = False
    loop: str = ""
    scatter: float = 1.0


class Change(NamedTuple):
    """What became of a number: the ratio of new to old, in units of the machines' speeds, and a mark."""

    work: str
    old: str
    new: str
    ratio: float | None
    mark: str


class Comparison(NamedTuple):
    """Two results.

    Attributes:
        speeds: New over old of each calibration loop.
        changes: The numbers that both have.
        came: What only the new one has.
        went: What only the old one has.
    """

    speeds: dict[str, float]
    changes: list[Change]
    came: list[str]
    went: list[str]


def load_result(path: Path, argument: str) -> Result:
    """Read a result.

    Args:
        path: The file.
        argument: What messages call it.

    Raises:
        ResultError: The file cannot be read, or holds no result.
    """
    wanted = f"{argument} must be a result of `python -m benchmarks`, but {str(path)!r:.120}"
    try:
        result: Any = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ResultError(f"{wanted} cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise ResultError(f"{wanted} is no JSON") from None
    if not _is_result(result):
        raise ResultError(f"{wanted} is something else")
    try:
        compare(result, result)
        to_markdown(result)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise ResultError(f"{wanted} is damaged: {type(error).__name__} {error!s:.60}") from None
    return result


def _is_result(data: Any) -> bool:
    return isinstance(data, dict) and data.get("kind") == KIND


def values(result: Result) -> dict[str, Value]:
    """Everything measured, under names that stay from run to run."""
    found = {row["name"]: _time(row) for row in result["rows"]}
    for row in figure_rows(result):
        loop = "compiled" if row["unit"] == "s" else ""
        found[f"{row['name']}: {row['work']}"] = Value(
            row["work"], float(row["value"]), row["unit"], bool(row["at_least"]), loop
        )
    for row in result["rivals"]:
        if row["seconds"] is not None:
            work = f"{row['package']}: {row['work']}"
            found[row["name"]] = Value(work, float(row["seconds"]), loop="interpreted")
    return found


def _paired(old: Mapping[str, Value], new: Mapping[str, Value], names: Iterable[str]) -> list[tuple[str, str]]:
    """Names of the same thing in both results.

    A measurement may say in its figures what it found, such as the name of the best method: those of its figures that
    have no counterpart are paired in their order, if both results have as many.
    """
    pairs = [(name, name) for name in old if name in new]
    for measurement in names:
        left, right = (
            [name for name in these if name.startswith(f"{measurement}: ") and name not in others]
            for these, others in ((old, new), (new, old))
        )
        if len(left) == len(right):
            pairs += zip(left, right, strict=True)
    return pairs


def _time(row: Row) -> Value:
    scatter = median(row["rounds"]) / min(row["rounds"])
    return Value(row["work"], float(row["seconds"]), loop=row["loop"], scatter=scatter)


def _speeds(old: Result, new: Result) -> dict[str, float]:
    before, after = ({row["name"]: row["seconds"] for row in result["rows"]} for result in (old, new))
    return {loop: after[f"calibration/{loop}"] / before[f"calibration/{loop}"] for loop in LOOPS}


def compare(old: Result, new: Result) -> Comparison:
    """What has changed from one result to another.

    Times are divided by the time of a calibration loop, that of the interpreter for commands and for what is short, so
    that results of two machines can be compared. A row that scatters more than it has changed is not marked.
    """
    speeds, before, after = _speeds(old, new), values(old), values(new)
    pairs = _paired(before, after, dict.fromkeys(row["name"] for row in new["figures"]))
    paired_before, paired_after = ({pair[k] for pair in pairs} for k in range(2))
    return Comparison(
        speeds,
        [_change(before[a], after[b], speeds) for a, b in pairs if not a.startswith("calibration/")],
        came=[value.work for name, value in after.items() if name not in paired_after],
        went=[value.work for name, value in before.items() if name not in paired_before],
    )


def _change(old: Value, new: Value, speeds: Mapping[str, float]) -> Change:
    texts = amount(old.number, old.unit), amount(new.number, new.unit)
    if old.number == 0:
        return Change(new.work, *texts, None, "")
    ratio = new.number / old.number / speeds.get(old.loop, 1.0)
    notable = max(NOTABLE, old.scatter, new.scatter)
    marks = ("slower", "faster") if new.unit == "s" else ("worse", "better")
    mark = ""
    if not 1 / notable < ratio < notable:
        mark = marks[(ratio < 1) != new.more_is_better]
    return Change(new.work, *texts, ratio, mark)


def show(comparison: Comparison, console: Console) -> None:
    """Print all ratios, what is marked in colour, and what came and went."""
    from rich.table import Table

    for loop, ratio in comparison.speeds.items():
        console.print(f"calibration loop, {loop}: {ratio:.3g} times as long", highlight=False)
    table = Table("work", "old", "new", "ratio", "", title="New over old, by calibration loops", title_justify="left")
    colours = {"slower": "red", "worse": "red", "faster": "green", "better": "green"}
    for change in comparison.changes:
        ratio = "–" if change.ratio is None else f"{change.ratio:.3g}"
        table.add_row(change.work, change.old, change.new, ratio, change.mark, style=colours.get(change.mark))
    console.print(table)
    for word, works in (("came", comparison.came), ("went", comparison.went)):
        for work in works:
            console.print(f"{word}: {work}", highlight=False, soft_wrap=True)
    counts = Counter(change.mark or "as before" for change in comparison.changes)
    console.print(", ".join(f"{count} {mark}" for mark, count in counts.items()), highlight=False)
