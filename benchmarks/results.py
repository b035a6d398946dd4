"""Results of runs as plain data: collected, written to files of JSON, and read back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NotRequired, TypedDict

from .kinds import Case, Row
from .rivals import PUBLISHED, Published, Rival
from .timing import ROOT, Sample, best

KEPT = ROOT / "benchmarks" / "results"
"""Where results are kept, a file for each run."""
KIND = "benchmarks"
SHORT = 1e-3
"""Seconds: what takes less is mostly the interpreter's time."""


class Result(TypedDict):
    """Everything that one run has found, ready for JSON."""

    schema: int
    kind: str
    environment: dict[str, str]
    rows: list[Row]
    figures: list[Row]
    studies: dict[str, list[Row]]
    rivals: list[Row]
    published: list[Row]
    failed: NotRequired[dict[str, str]]
    seconds: NotRequired[dict[str, tuple[float, float]]]


def collect(
    cases: Sequence[Case],
    rivals: Mapping[Rival, str | None],
    samples: Mapping[str, Sequence[Sample]],
    environment: Mapping[str, str],
    figures: Sequence[Row] = (),
    studies: Mapping[str, list[Row]] | None = None,
) -> Result:
    """Everything that one run has found, ready for JSON."""
    fastest = {name: best(taken) for name, taken in samples.items()}
    return {
        "schema": 1,
        "kind": KIND,
        "environment": dict(environment),
        "rows": [_row(case, fastest[case.name], samples[case.name]) for case in cases],
        "figures": list(figures),
        "studies": dict(studies or {}),
        "rivals": [_rival(rival, version, fastest) for rival, version in rivals.items() if rival.opponent in fastest],
        "published": [_published(figure, fastest) for figure in PUBLISHED if figure.opponent in fastest],
    }


def _row(case: Case, fastest: Sample, taken: Sequence[Sample]) -> Row:
    return {
        "name": case.name,
        "work": case.work,
        "seconds": fastest.seconds,
        "bar": case.bar,
        "ratio": quotient(fastest.seconds, case.bar),
        "peak": fastest.peak,
        "peak_bar": case.peak_bar,
        "loop": "interpreted" if case.interpreted or fastest.seconds < SHORT else "compiled",
        "rounds": [sample.seconds for sample in taken],
    }


def _rival(rival: Rival, version: str | None, fastest: Mapping[str, Sample]) -> Row:
    theirs = fastest[rival.name].seconds if rival.name in fastest else None
    return {
        "name": rival.name,
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
    return {"seconds": theirs, "opponent": opponent, "ours": ours, "ratio": quotient(theirs, ours)}


def quotient(number: float | None, other: float | None) -> float | None:
    """The quotient where there is one."""
    return number / other if number is not None and other else None


def to_json(result: Result) -> str:
    """The data as JSON: floats with four digits, each row of a list on a line of its own."""
    return _indented(_rounded(result), depth=3) + "\n"


def _rounded(data: Any) -> Any:
    if isinstance(data, float):
        return float(f"{data:.4g}")
    if isinstance(data, Mapping):
        return {key: _rounded(value) for key, value in data.items()}
    return [_rounded(value) for value in data] if isinstance(data, list | tuple) else data


def _indented(data: Any, depth: int, margin: str = "") -> str:
    """JSON with an entry in each line: those of outer objects, and those of the lists in them."""
    if not depth or not data or not isinstance(data, dict | list):
        return json.dumps(data, ensure_ascii=False)
    inside = margin + " "
    if isinstance(data, dict):
        entries = [f"{json.dumps(key)}: {_indented(value, depth - 1, inside)}" for key, value in data.items()]
        first, last = "{}"
    else:
        entries = [json.dumps(entry, ensure_ascii=False) for entry in data]
        first, last = "[]"
    return f"{first}\n{inside}" + f",\n{inside}".join(entries) + f"\n{margin}{last}"


def kept_results(folder: Path = KEPT) -> list[Path]:
    """The files of the kept results, the newest last."""
    return sorted(folder.glob("*.json"))


def file_name(result: Result) -> str:
    """What the file of a result is called, after its date and commit, so that names sort by date."""
    date, commit = (result["environment"].get(key, "unknown") for key in ("date", "commit"))
    return f"{date.removesuffix(' UTC').replace(' ', '-').replace(':', '')}-{commit}.json"
