"""Results are kept as JSON and shown as tables and as a page; two of them are compared."""

import json
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks import __main__, comparison, parts, report, results, rivals  # noqa: E402
from benchmarks.calibration import calibration_cases  # noqa: E402
from benchmarks.cases import cases  # noqa: E402
from benchmarks.kinds import Figure, Measurement, Part, Study, Table  # noqa: E402
from benchmarks.running import Clocked, is_empty, measure_parts  # noqa: E402
from benchmarks.timing import Sample  # noqa: E402

GROWTH = [{"order": n, "seconds": 2.0**n, "trees": n} for n in (1, 2)]
STUDY = Study(
    "growth",
    "How it grows.",
    lambda rivals: GROWTH,
    lambda rows: [Table("By order", ["order", "takes"], [[str(row["order"]), f"{row['seconds']} s"] for row in rows])],
    lambda rows: [Figure(f"order {row['order']}", row["seconds"], 3.0 if row["order"] == 2 else None) for row in rows],
    lambda rows: __import__("matplotlib.figure", fromlist=["Figure"]).Figure(figsize=(1, 1)),
)
FIGURES = [
    Figure("error", 4.2e-14, 1e-13),
    Figure("speed-up", 1.85, 1.9, at_least=True),
    Figure("held, |x|", 0.25, unit="MB"),
    Figure("first", 0.5, 2.0, unit="s"),
]
PARTS = [Part("Growth", studies=(STUDY,)), Part("Stepping", lambda: [Measurement("step", lambda: FIGURES)])]


@pytest.fixture(autouse=True)
def small_parts(monkeypatch):
    for module in (report, sys.modules["benchmarks.running"]):
        monkeypatch.setattr(module, "PARTS", PARTS)


@pytest.fixture
def result():
    """The figures of a made-up run: pybs at hand, kauri not."""
    names = ("midpoint-9", "midpoint-9-all", "midpoint-20-float", "import")
    rows = [*calibration_cases(), *(case for case in cases() if case.name in names)]
    samples = {
        "calibration/compiled": [Sample(0.02)],
        "calibration/interpreted": [Sample(0.03)],
        "midpoint-9": [Sample(0.0004), Sample(0.0001)],
        "midpoint-9-all": [Sample(0.001)],
        "midpoint-20-float": [Sample(30.0, 3_500_000_000)],
        "import": [Sample(0.05), Sample(0.05)],
        "midpoint-9-all/pybs": [Sample(3.0)],
    }
    pybs, kauri = rivals.RIVALS[:2]
    measured = measure_parts("", False, Path(), Clocked())
    surroundings = {"date": "2026-01-02 03:04 UTC", "commit": "abc"}
    return results.collect(rows, {pybs: "0.3", kauri: None}, samples, surroundings, measured.figures, measured.studies)


def test_a_result_holds_ratios_to_bars_and_rivals(result):
    row = {row["name"]: row for row in result["rows"]}["midpoint-9"]
    assert (row["seconds"], row["ratio"], row["rounds"]) == (0.0001, 0.5, [0.0004, 0.0001])
    assert [(row["package"], row["ratio"]) for row in result["rivals"]] == [("pybs", 3000.0)]
    assert result["published"][0]["ratio"] == pytest.approx(53.9)


def test_what_the_interpreter_does_is_measured_by_its_own_loop(result):
    loops = {row["name"]: row["loop"] for row in result["rows"]}
    assert (loops["midpoint-9"], loops["midpoint-9-all"]) == ("interpreted", "compiled")
    assert (loops["midpoint-20-float"], loops["import"]) == ("compiled", "interpreted")


def test_json_has_four_digits_and_a_line_for_each_row(result):
    text = results.to_json(result)
    read = json.loads(text)
    assert read == json.loads(json.dumps(result), parse_float=lambda text: float(f"{float(text):.4g}"))
    mixed = results.to_json({**result, "rows": [1.23456, 10**20, "x", None, {"a": (2 / 3,)}]})
    assert json.loads(mixed)["rows"] == [1.235, 10**20, "x", None, {"a": [0.6667]}]
    assert sum('"name": "midpoint-9",' in line for line in text.splitlines()) == 1
    assert '   {"order": 2, "seconds": 4.0, "trees": 2}\n' in text
    assert results.to_json(read) == text


def test_files_are_named_by_date_and_commit(result, tmp_path):
    assert results.file_name(result) == "2026-01-02-0304-abc.json"
    for name in ("2026-02-01-0000-a.json", "2025-12-31-2359-b.json", "notes.txt"):
        (tmp_path / name).touch()
    assert [path.name[:4] for path in results.kept_results(tmp_path)] == ["2025", "2026"]
    assert results.kept_results(tmp_path / "missing") == []


def test_bars_that_are_missed_are_named_at_the_top(result):
    total, missed = report.missed_bars(result)
    assert missed == ["speed-up", "order 2"]
    assert total == 10
    assert report.heading(result)[-3:] == ["bars: 8 of 10 met", "missed: speed-up", "missed: order 2"]


def test_the_page(result):
    page = report.to_markdown(result)
    assert page.startswith("# Benchmarks\n")
    assert "- commit: abc\n" in page
    assert "| explicit-midpoint, order 9, integers out | ≤ 200 µs | 100 µs | 0.5 |\n" in page
    assert "| ≤ 60 s, 4.5 GB | 30 s, 3.5 GB | 0.5 |\n" in page
    assert "| pybs 0.3 | modified equation, order 9, exact, memoised | 3 s | 1 ms | 3,000 | ≥ 1,000 |\n" in page
    assert "## Growth\n\nHow it grows.\n\n![growth](pictures/benchmarks-growth.svg)\n\n**By order**\n" in page
    assert "| order | takes |\n| --- | --- |\n| 1 | 2.0 s |\n| 2 | 4.0 s |\n" in page
    assert "| order 2 | ≤ 3 | 4 | 1.33 |\n" in page
    assert "| order 1 |" not in page  # has no bar, and is in the table above
    assert "## Stepping\n" in page
    assert "| error | ≤ 1e-13 | 4.2e-14 | 0.42 |\n" in page
    assert "| speed-up | ≥ 1.9 | 1.85 | 0.974 |\n" in page
    assert "| held, \\|x\\| | – | 0.25 MB | – |\n" in page
    assert "| first | ≤ 2 s | 500 ms | 0.25 |\n" in page


def test_a_page_without_parts_and_rivals():
    rows = calibration_cases()
    bare = results.collect(rows, {}, {case.name: [Sample(1.0)] for case in rows}, {"commit": "abc"})
    titles = [line for line in report.to_markdown(bare).splitlines() if line.startswith("## ")]
    assert titles == ["## Time and peak memory"]
    assert report.pictures(bare) == {}


def test_a_rival_that_is_not_installed_is_said_so(result):
    gone = {**result, "rivals": [{**result["rivals"][0], "version": None, "seconds": None, "ratio": None}]}
    row = "| pybs | modified equation, order 9, exact, memoised | not installed | 1 ms | – |"
    assert row in report.to_markdown(gone)


def test_tables_are_printed(result):
    from io import StringIO

    from rich.console import Console

    console = Console(file=StringIO(), width=150)
    report.show(result, console)
    printed = console.file.getvalue()
    assert "Growth: By order" in printed
    assert "not installed" not in printed


def test_parts_are_measured_by_their_names_and_clocked():
    clocked = Clocked()
    measured = measure_parts("step", False, Path(), clocked)
    assert [(row["part"], row["name"]) for row in measured.figures] == [("Stepping", "step")] * 4
    assert (measured.studies, measured.failed) == ({}, {})
    assert clocked.seconds.keys() == {"step"}
    assert all(seconds >= 0 for pair in clocked.seconds.values() for seconds in pair)
    assert is_empty("nothing", True)
    assert not is_empty("growth", False)


def test_a_part_that_fails_is_named_and_the_others_are_kept(monkeypatch, result):
    broken = Part("Broken", lambda: [Measurement("broken", lambda: [1 / 0])])  # pyright: ignore[reportArgumentType]
    monkeypatch.setattr(sys.modules["benchmarks.running"], "PARTS", [broken, *PARTS])
    measured = measure_parts("", False, Path(), Clocked())
    assert measured.failed == {"broken": "ZeroDivisionError: division by zero"}
    assert len(measured.figures) == 4
    failed = report.heading({**result, "failed": measured.failed})[-1]
    assert failed == "failed: broken: ZeroDivisionError: division by zero"


def test_every_part_of_the_real_run_has_names_of_its_own():
    names = [study.name for part in parts.PARTS for study in part.studies]
    names += [measurement.name for part in parts.PARTS for measurement in part.measurements()]
    names += [case.name for case in cases()]
    assert len(set(names)) == len(names)
    assert len({part.title for part in parts.PARTS}) == len(parts.PARTS)
    assert {"algebra-growth", "scene-growth", "stepping-c", "stepping-precision", "stepping-memory"} <= set(names)


def faster(result, factor, machine=1.0):
    """The result of code that takes `factor` times as long, on a machine that takes `machine` times as long."""
    copy = json.loads(json.dumps(result))
    for row in copy["rows"]:
        by = machine if row["name"].startswith("calibration/") else machine * factor
        row["seconds"] *= by
        row["rounds"] = [seconds * by for seconds in row["rounds"]]
    for row in copy["rivals"]:
        row["seconds"] *= machine
    return copy


def times(found):
    return {change.work: (change.ratio, change.mark) for change in found.changes}


@pytest.mark.parametrize(("factor", "mark"), [(1.0, ""), (1.05, ""), (2.0, "slower"), (0.5, "faster")])
def test_times_are_compared_in_units_of_the_machines(result, factor, mark):
    found = comparison.compare(result, faster(result, factor, machine=3.0))
    assert found.speeds == pytest.approx({"compiled": 3.0, "interpreted": 3.0})
    ratio, marked = times(found)["explicit-midpoint, order 9, table and 486 Fractions made"]
    assert (ratio, marked) == (pytest.approx(factor), mark)
    assert times(found)["pybs: modified equation, order 9, exact, memoised"] == (pytest.approx(1.0), "")
    assert times(found)["error"] == (1.0, "")
    assert not any(change.work.startswith("calibration") for change in found.changes)
    assert (found.came, found.went) == ([], [])


def test_each_row_has_its_own_calibration_loop(result):
    new = json.loads(json.dumps(result))
    new["rows"][1]["seconds"] /= 2  # an interpreter twice as fast
    found = times(comparison.compare(result, new))
    assert found['python -c "import bseries"'] == (pytest.approx(2.0), "slower")
    assert found["explicit-midpoint, order 9, table and 486 Fractions made"] == (pytest.approx(1.0), "")


def test_rows_that_scatter_are_not_marked(result):
    found = times(comparison.compare(result, faster(result, 2.0)))
    assert found["explicit-midpoint, order 9, integers out"] == (pytest.approx(2.0), "")  # rounds of 100 and 400 µs
    assert found["explicit-midpoint, order 20, float64, all from nothing"] == (pytest.approx(2.0), "slower")


def test_figures_are_worse_or_better_by_what_they_are(result):
    new = json.loads(json.dumps(result))
    for row in new["figures"]:
        row["value"] *= 2
    found = times(comparison.compare(result, new))
    assert found["error"] == (2.0, "worse")
    assert found["speed-up"] == (2.0, "better")
    assert found["first"] == (2.0, "slower")
    new["figures"][0]["value"] = 0.0
    assert times(comparison.compare(new, result))["error"] == (None, "")


def test_rows_come_and_go(result):
    old, new = (json.loads(json.dumps(result)) for _ in range(2))
    old["figures"] = old["figures"][:-1]
    del new["rows"][2]
    new["studies"]["growth"] = GROWTH[:1]
    found = comparison.compare(old, new)
    assert found.came == ["first"]
    assert found.went == ["explicit-midpoint, order 9, integers out", "order 2"]


def test_figures_that_name_what_they_found_are_paired_in_their_order(result):
    new = json.loads(json.dumps(result))
    new["figures"][1]["work"] = "speed-up of something else"
    found = comparison.compare(result, new)
    assert times(found)["speed-up of something else"] == (1.0, "")
    assert (found.came, found.went) == ([], [])


@pytest.fixture
def kept(result, tmp_path, monkeypatch):
    """A folder with two results, one of which is slower."""
    (tmp_path / "2026-01-01-0000-a.json").write_text(results.to_json(result))
    (tmp_path / "2026-01-02-0000-b.json").write_text(results.to_json(faster(result, 2.0)))
    monkeypatch.setattr(__main__, "kept_results", lambda: results.kept_results(tmp_path))
    return sorted(tmp_path.glob("*.json"))


def invoke(*arguments):
    return CliRunner().invoke(__main__.main, [str(argument) for argument in arguments], env={"COLUMNS": "200"})


def test_the_command_compares_the_last_two_by_default(kept):
    ended = invoke("compare")
    assert ended.exit_code == 0, ended.output
    assert "slower" in ended.output
    assert invoke("compare", *kept).output == ended.output
    assert "faster" in invoke("compare", kept[1], kept[0]).output
    assert "slower" not in invoke("compare", kept[1]).output  # with the last, itself


def test_a_run_that_is_kept_is_compared_with_the_last_one(kept, tmp_path, monkeypatch):
    folder = tmp_path / "results"
    monkeypatch.setattr(__main__, "SUMMARY_PAGE", tmp_path / "summary.md")
    for name, value in {"KEPT": folder, "kept_results": lambda: results.kept_results(folder)}.items():
        monkeypatch.setattr(__main__, name, value)
    run = {**json.loads(kept[0].read_text()), "failed": {}}
    monkeypatch.setattr(__main__, "run", lambda *_: run)
    page = tmp_path / "page.md"
    first = invoke("--keep", "--output", page)
    assert first.exit_code == 0, first.output
    assert [path.name for path in folder.iterdir()] == ["2026-01-02-0304-abc.json"]
    assert page.read_text(encoding="utf-8") == report.to_markdown(
        json.loads((folder / "2026-01-02-0304-abc.json").read_text())
    )
    assert (tmp_path / "summary.md").read_text(encoding="utf-8") == report.to_summary(run)
    assert "New over old" not in first.output
    run["environment"]["date"] = "2026-01-03 00:00 UTC"
    run["failed"] = {"stepping-c": "CFailure: gone"}
    second = invoke("--keep", "--json", tmp_path / "run.json")
    assert "New over old" in second.output
    assert second.exit_code == 1
    assert "every part must be measured, but stepping-c failed" in second.output
    assert len(list(folder.iterdir())) == 2
    assert (tmp_path / "run.json").exists()


def test_the_command_writes_the_page_of_the_last_result(kept, tmp_path):
    page = tmp_path / "docs" / "page.md"
    page.parent.mkdir()
    ended = invoke("page", "--output", page)
    assert ended.exit_code == 0, ended.output
    assert "200 µs" in page.read_text(encoding="utf-8")
    assert b"<svg" in (page.parent / "pictures" / "benchmarks-growth.svg").read_bytes()
    once = (page.parent / "pictures" / "benchmarks-growth.svg").read_bytes()
    invoke("page", kept[1], "--output", page)
    assert (page.parent / "pictures" / "benchmarks-growth.svg").read_bytes() == once


BAD = {
    "empty": ("", "is no JSON"),
    "deep": ("[" * 100_000, "is no JSON"),
    "list": ("[1, 2]", "is something else"),
    "number": ("7", "is something else"),
    "other": ('{"kind": "stepping-ratios"}', "is something else"),
    "partial": ('{"kind": "benchmarks"}', "is damaged: KeyError 'rows'"),
    "rows": ('{"kind": "benchmarks", "rows": 3, "figures": [], "studies": {}, "rivals": []}', "is damaged: TypeError"),
    "figures": (
        '{"kind": "benchmarks", "rows": [], "figures": [{}], "studies": {}, "rivals": []}',
        "is damaged: KeyError",
    ),
    "uncalibrated": (
        '{"kind": "benchmarks", "rows": [], "figures": [], "studies": {}, "rivals": []}',
        "is damaged: KeyError 'calibration/compiled'",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_file_that_is_no_result_is_named_in_one_sentence(kept, tmp_path, name):
    text, reason = BAD[name]
    file = tmp_path / "bad.txt"
    file.write_text(text)
    for argument, arguments in {
        "OLD": ("compare", file),
        "NEW": ("compare", kept[0], file),
        "RESULT": ("page", file),
    }.items():
        ended = invoke(*arguments)
        assert ended.exit_code == 2
        assert f"Error: {argument} must be a result of `python -m benchmarks`, but" in ended.output
        assert reason in ended.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["compare", "missing.json"], "cannot be read: No such file or directory"),
        (["--rounds", "2", "compare"], "options must stand behind 'compare', but some stood before it"),
        (["--keep", "--only", "midpoint"], "--keep must stand without --only, since results are kept as a whole"),
        (["page", "--output", "missing/page.md"], "file must lie in a writable folder, but was 'missing/page.md'"),
    ],
)
def test_wrong_arguments_are_refused(kept, arguments, message):
    ended = invoke(*arguments)
    assert ended.exit_code == 2
    assert message in ended.output


def test_there_must_be_results(monkeypatch):
    monkeypatch.setattr(__main__, "kept_results", list)
    assert "OLD and NEW must be given where fewer than two results are kept" in invoke("compare").output
    assert "RESULT must be given where none is kept" in invoke("page").output


def test_the_summary_has_a_row_for_each_section_and_the_work_closest_to_its_bar(result):
    page = report.to_summary(result)
    assert "| Time and peak memory | 4 | explicit-midpoint, order 9, integers out | ≤ 200 µs | 100 µs |\n" in page
    assert "| Growth | 1 | order 2 | ≤ 3 | 4 |\n" in page
    assert "| speed-up | ≥ 1.9 | 1.85 |\n" in page  # a lower bar that is missed, closer than one that is met
    assert "| pybs 0.3 | modified equation, order 9, exact, memoised | 3 s | 1 ms | 3,000 | ≥ 1,000 |\n" in page


def test_the_summary_is_that_of_the_last_result_that_was_kept(monkeypatch):
    if not (kept := results.kept_results()):
        pytest.skip("no result is kept")
    monkeypatch.setattr(report, "PARTS", parts.PARTS)
    result = comparison.load_result(kept[-1], "RESULT")
    assert (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8") == report.to_summary(result)
