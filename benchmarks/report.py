"""What was measured, as sections of tables: printed in the terminal, or written as a page with pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from .kinds import Row, Study, Table
from .parts import PARTS
from .results import Result, quotient
from .texts import amount, duration, memory, times

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture
    from rich.console import Console

MEASURED = ("work", "bar", "measured", "of the bar")
COMPARED = ("package", "work", "takes", "ours", "times ours")
ABOUT = """\
Written by `make bench`: everything in one run, other packages included."""
SUMMARY = """\
The last run of `make bench`: for each section the number of bars, and the work closest to its bar. All rows and
pictures: `python -m benchmarks page`, which writes `build/benchmarks.md`. How it is measured, and how to run less or
more: [benchmarks/README.md](../benchmarks/README.md). Earlier runs are in
[`benchmarks/results`](../benchmarks/results); `python -m benchmarks compare` shows what has changed since."""


class Section(NamedTuple):
    """Tables below a heading of the page, with what is to be said of them; `picture` names a picture."""

    title: str
    about: str
    tables: Sequence[Table]
    picture: str | None = None


def sections(result: Result) -> list[Section]:
    """All sections that are not empty; where a part has several, only its first has a title."""
    found = [
        Section("Time and peak memory", "", [Table("", MEASURED, [_time_cells(row) for row in result["rows"]])]),
        *_parts(result),
        Section("Other packages in the same run", "", [_others(result)]),
        Section("Published by others, on other machines", "", [_published(result)]),
    ]
    return [section for section in found if any(table.rows for table in section.tables)]


def _parts(result: Result) -> Iterable[Section]:
    for part in PARTS:
        title = part.title
        for study in part.studies:
            if rows := result["studies"].get(study.name):
                yield Section(
                    title, study.about, [*study.tables(rows), _barred(study, rows)], study.draw and study.name
                )
                title = ""
        figures = [_figure_cells(row) for row in result["figures"] if row["part"] == part.title]
        yield Section(title, "", [Table("", MEASURED, figures)])


def _barred(study: Study, rows: list[Row]) -> Table:
    figures = [figure._asdict() for figure in study.figures(rows) if figure.bar is not None]
    return Table("", MEASURED, [_figure_cells(figure) for figure in figures])


def _time_cells(row: Row) -> list[str]:
    bar = "–" if row["bar"] is None else f"≤ {duration(row['bar'])}{memory(row['peak_bar'])}"
    return [row["work"], bar, duration(row["seconds"]) + memory(row["peak"]), times(row["ratio"])]


def _figure_cells(row: Row) -> list[str]:
    bar = "–" if row["bar"] is None else f"{'≥' if row['at_least'] else '≤'} {amount(row['bar'], row['unit'])}"
    return [row["work"], bar, amount(row["value"], row["unit"]), times(quotient(row["value"], row["bar"]))]


def _others(result: Result) -> Table:
    cells = [
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
    return Table("", [*COMPARED, "bar"], cells)


def _published(result: Result) -> Table:
    cells = [
        [row["package"], row["work"], duration(row["seconds"]), duration(row["ours"]), times(row["ratio"])]
        for row in result["published"]
    ]
    return Table("", COMPARED, cells)


def missed_bars(result: Result) -> tuple[int, list[str]]:
    """How many bars there are, and the works that missed theirs."""
    verdicts = [(row["work"], row["ratio"] <= 1) for row in result["rows"] if row["ratio"] is not None]
    verdicts += [
        (f"{row['work']}, memory", row["peak"] <= row["peak_bar"]) for row in result["rows"] if row["peak_bar"]
    ]
    verdicts += [
        (row["work"], row["value"] >= row["bar"] if row["at_least"] else row["value"] <= row["bar"])
        for row in figure_rows(result)
        if row["bar"] is not None
    ]
    verdicts += [
        (f"{row['package']}: {row['work']}", row["ratio"] >= row["bar"])
        for row in result["rivals"]
        if row["bar"] is not None and row["ratio"] is not None
    ]
    return len(verdicts), [work for work, met in verdicts if not met]


def figure_rows(result: Result) -> list[Row]:
    """The figures of measurements and those that studies give."""
    derived = [
        {"name": study.name, **figure._asdict()}
        for part in PARTS
        for study in part.studies
        for figure in study.figures(result["studies"].get(study.name, []))
    ]
    return [*result["figures"], *derived]


def sources(result: Result) -> list[str]:
    """Where the published figures are from."""
    return list(dict.fromkeys(f"{row['package']}: {row['source']}" for row in result["published"]))


def heading(result: Result) -> list[str]:
    """The lines above the tables."""
    lines = [f"{name}: {value}" for name, value in result["environment"].items()]
    total, missed = missed_bars(result)
    if total:
        lines += [f"bars: {total - len(missed)} of {total} met", *(f"missed: {work}" for work in missed)]
    return lines + [f"failed: {name}: {message}" for name, message in result.get("failed", {}).items()]


def show(result: Result, console: Console) -> None:
    """Print the tables."""
    for line in heading(result):
        console.print(line, highlight=False, soft_wrap=True)
    for section in sections(result):
        title = section.title
        for table in section.tables:
            if table.rows:
                show_table(table._replace(title=": ".join(filter(None, (title, table.title)))), console)
                title = ""
    for line in sources(result):
        console.print(line, highlight=False, soft_wrap=True)


def show_table(table: Table, console: Console) -> None:
    """Print a table; text stands on the left, numbers on the right."""
    from rich.table import Table as Printed

    printed = Printed(title=table.title or None, title_justify="left")
    for heading in table.headings:
        printed.add_column(heading, justify="left" if heading in ("work", "package") else "right")
    for row in table.rows:
        printed.add_row(*row)
    console.print(printed)


def picture_file(name: str) -> str:
    """Where a picture lies, beside the page."""
    return f"pictures/benchmarks-{name}.svg"


def to_markdown(result: Result) -> str:
    """The tables as a page, with links to the pictures."""
    page = ["# Benchmarks", "", ABOUT, "", *(f"- {line}" for line in heading(result))]
    for section in sections(result):
        page += ["", f"## {section.title}"] if section.title else []
        page += ["", section.about] if section.about else []
        if section.picture:
            page += ["", f"![{section.picture.replace('-', ' ')}]({picture_file(section.picture)})"]
        for table in section.tables:
            if table.rows:
                page += ["", f"**{table.title}**"] if table.title else []
                page += ["", *map(_line, [table.headings, ["---"] * len(table.headings), *table.rows])]
    page += ["", *(f"- {line}" for line in sources(result))] if result["published"] else []
    return "\n".join(page) + "\n"


def to_summary(result: Result) -> str:
    """The committed page: a row for each section, and the comparison with other packages."""
    found: dict[str, list[Sequence[str]]] = {}
    title = ""
    for section in sections(result):
        title = section.title or title
        rows = [row for table in section.tables if table.headings == MEASURED for row in table.rows if row[1] != "–"]
        if rows:
            found.setdefault(title, []).extend(rows)
    page = ["# Benchmarks", "", SUMMARY, "", *(f"- {line}" for line in heading(result)), ""]
    page += [_line(("section", "bars", "closest to its bar", "bar", "measured")), _line(["---"] * 5)]
    for name, rows in found.items():
        closest = max(rows, key=_part_of_bar)
        page.append(_line((name, str(len(rows)), *closest[:3])))
    others = _others(result)
    page += ["", "## Other packages in the same run", "", *map(_line, [others.headings, ["---"] * 6, *others.rows])]
    return "\n".join(page) + "\n"


def _part_of_bar(row: Sequence[str]) -> float:
    """The measured value as a part of an upper bar, or the inverse for a lower bar."""
    part = float(row[3])
    return 1 / part if row[1].startswith("≥") and part else part


def _line(cells: Sequence[str]) -> str:
    escaped = [cell.replace("|", "\\|") for cell in cells]
    return f"| {' | '.join(escaped)} |"


def pictures(result: Result) -> dict[str, Picture]:
    """The pictures of the page, each with the name of its file."""
    return {
        picture_file(study.name): study.draw(rows)
        for part in PARTS
        for study in part.studies
        if study.draw and (rows := result["studies"].get(study.name))
    }
