"""What was measured, as plain data, and that data as JSON, as tables in the terminal, and as Markdown."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .rivals import PUBLISHED, Published, Rival
from .timing import Sample, best

if TYPE_CHECKING:
    from rich.console import Console

    from .cases import Case

Row = dict[str, Any]


def collect(
    cases: Sequence[Case],
    rivals: Mapping[Rival, str | None],
    samples: Mapping[str, Sequence[Sample]],
    environment: Mapping[str, str],
    figures: Sequence[Row] = (),
) -> dict[str, Any]:
    """Everything that one run has found, ready for JSON."""
    fastest = {name: best(taken) for name, taken in samples.items()}
    return {
        "schema": 1,
        "kind": "benchmarks",
        "environment": dict(environment),
        "rows": [_row(case, fastest[case.name], samples[case.name]) for case in cases],
        "figures": list(figures),
        "rivals": [_rival(rival, version, fastest) for rival, version in rivals.items() if rival.opponent in fastest],
        "published": [_published(figure, fastest) for figure in PUBLISHED if figure.opponent in fastest],
    }


def _row(case: Case, fastest: Sample, taken: Sequence[Sample]) -> Row:
    return {
        "name": case.name,
        "work": case.work,
        "seconds": fastest.seconds,
        "bar": case.bar,
        "ratio": _quotient(fastest.seconds, case.bar),
        "peak": fastest.peak,
        "peak_bar": case.peak_bar,
        "rounds": [sample.seconds for sample in taken],
    }


def _rival(rival: Rival, version: str | None, fastest: Mapping[str, Sample]) -> Row:
    theirs = fastest[rival.name].seconds if rival.name in fastest else None
    return {
        "package": rival.package,
        "version": version,
        "work": f"{rival.task}, order {rival.order}, {rival.note}",
        **_compared(theirs, rival.opponent, fastest),
        "bar": rival.bar,
    }


def _published(figure: Published, fastest: Mapping[str, Sample]) -> Row:
    return {
        "package": figure.package,
        "work": figure.work,
        **_compared(figure.seconds, figure.opponent, fastest),
        "source": figure.source,
    }


def _compared(theirs: float | None, opponent: str, fastest: Mapping[str, Sample]) -> Row:
    ours = fastest[opponent].seconds
    return {"seconds": theirs, "opponent": opponent, "ours": ours, "ratio": _quotient(theirs, ours)}


def _quotient(seconds: float | None, other: float | None) -> float | None:
    return seconds / other if seconds is not None and other else None


def duration(seconds: float | None) -> str:
    """Seconds for people: three significant digits in a unit that suits them."""
    if seconds is None:
        return "–"
    for unit, factor in (("µs", 1e6), ("ms", 1e3)):
        if seconds * factor < 999.5:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds:.3g} s"


def memory(size: float | None) -> str:
    """Bytes as GB."""
    return "" if size is None else f", {size / 1e9:.3g} GB"


def times(ratio: float | None) -> str:
    """A ratio: three significant digits."""
    return "–" if ratio is None else f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.3g}"


def amount(value: float, unit: str = "") -> str:
    """A number with its unit: three significant digits, and a power of ten for what is small."""
    if unit == "s":
        return duration(value)
    return f"{value:.3g} {unit}".rstrip()


def _bar(row: Row) -> str:
    if row["bar"] is None:
        return "–"
    return f"{'≥' if row['at_least'] else '≤'} {amount(row['bar'], row['unit'])}"


def tables(result: Mapping[str, Any]) -> list[tuple[str, list[str], list[list[str]]]]:
    """Title, headings and cells of every table that is not empty."""
    ours = [
        [
            row["work"],
            "–" if row["bar"] is None else f"≤ {duration(row['bar'])}{memory(row['peak_bar'])}",
            duration(row["seconds"]) + memory(row["peak"]),
            times(row["ratio"]),
        ]
        for row in result["rows"]
    ]
    figures = [
        [row["work"], _bar(row), amount(row["value"], row["unit"]), times(_quotient(row["value"], row["bar"]))]
        for row in result["figures"]
    ]
    others = [
        [
            f"{row['package']} {row['version'] or ''}".strip(),
            row["work"],
            duration(row["seconds"]) if row["version"] else "not installed",
            duration(row["ours"]),
            times(row["ratio"]),
            "–" if row["bar"] is None else f"≥ {times(row['bar'])}",
        ]
        for row in result["rivals"]
    ]
    quoted = [
        [row["package"], row["work"], duration(row["seconds"]), duration(row["ours"]), times(row["ratio"])]
        for row in result["published"]
    ]
    compared = ["package", "work", "takes", "ours", "times ours"]
    found = [
        ("Time and peak memory", ["work", "bar", "measured", "of the bar"], ours),
        ("Time stepping", ["work", "bar", "measured", "of the bar"], figures),
        ("Other packages in the same run", [*compared, "bar"], others),
        ("Published by others, on other machines", compared, quoted),
    ]
    return [table for table in found if table[2]]


def sources(result: Mapping[str, Any]) -> list[str]:
    """Where the published figures are from."""
    return [f"{row['package']}: {row['source']}" for row in result["published"]]


def heading(result: Mapping[str, Any]) -> list[str]:
    """The lines above the tables."""
    return [f"{name}: {value}" for name, value in result["environment"].items()]


def show(result: Mapping[str, Any], console: Console) -> None:
    """Print the tables."""
    from rich.table import Table

    for line in heading(result):
        console.print(line, highlight=False, soft_wrap=True)
    for title, headings, cells in tables(result):
        table = Table(title=title, title_justify="left")
        for column in headings:
            table.add_column(column, justify="left" if column in ("work", "package") else "right")
        for row in cells:
            table.add_row(*row)
        console.print(table)
    for line in sources(result):
        console.print(line, highlight=False, soft_wrap=True)


def to_markdown(result: Mapping[str, Any]) -> str:
    """The tables as a page."""
    page = [
        "# Benchmarks",
        "",
        "Written by `python -m benchmarks --output docs/benchmarks.md`; rows that take minutes come with `--full`.",
        "",
    ]
    page += [f"- {line}" for line in heading(result)]
    for title, headings, cells in tables(result):
        page += ["", f"## {title}", "", _line(headings), _line(["---"] * len(headings)), *map(_line, cells)]
    page += ["", *(f"- {line}" for line in sources(result))]
    return "\n".join(page) + "\n"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def to_json(result: Mapping[str, Any]) -> str:
    """The data as JSON."""
    return json.dumps(result, indent=1, ensure_ascii=False) + "\n"
