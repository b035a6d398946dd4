"""What a public host needs: workflows, style before commits, project addresses, the paper's references."""

import inspect
import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
WORKFLOWS = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / ".github" / "workflows").glob("*.yml")}
PLACEHOLDER = "OWNER"


def test_workflows_pin_versions_hold_no_secrets_and_have_least_rights():
    """Jobs that can prove who they are to others pin commits, which nobody can move."""
    assert WORKFLOWS.keys() == {"tests", "docs", "release"}
    for name, text in WORKFLOWS.items():
        for job in re.split(r"\n  (?=\w+:\n)", text.partition("\njobs:\n")[2]):
            version = r"[0-9a-f]{40}" if "id-token: write" in job else r"v\d+"
            used = re.findall(r"uses: (\S+)", job)
            assert used, name
            assert all(re.fullmatch(rf"[\w-]+/[\w-]+@{version}", action) for action in used), name
        assert "secrets." not in text, name
        assert "permissions:\n  contents: read\n" in text, name


def test_workflows_test_the_oldest_python_that_is_allowed_and_all_later_ones():
    oldest = int(PROJECT["requires-python"].removeprefix(">=3."))
    (listed,) = re.findall(r"python: \[(.*)\]", WORKFLOWS["tests"])
    versions = re.findall(r'"3\.(\d+)"', listed)
    assert versions == [str(minor) for minor in range(oldest, oldest + len(versions))]
    assert len(versions) >= 4


def test_a_tool_has_one_version():
    text = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    tools = set(re.findall(r'"(\w+==[\d.]+)"', text))
    assert {tool.partition("==")[0] for tool in tools} == {"ruff", "pyright"}
    assert tools <= set(PROJECT["optional-dependencies"]["dev"])


def test_the_changelog_has_what_there_is_and_no_changes_of_what_never_was_released():
    """It names every verb and every room of names, and nothing that is gone."""
    import bseries as bs
    from bseries.cli.application import VERBS

    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## (.*)$", text, re.MULTILINE) == [f"{PROJECT['version']} (unreleased)"]
    assert not re.search(r"^### (Changed|Fixed|Removed)", text, re.MULTILINE)
    assert not [verb for verb in VERBS if f"`{verb}`" not in text and f"`bseries {verb}" not in text]
    rooms = [name for name in dir(bs) if inspect.ismodule(getattr(bs, name)) and not name.startswith("_")]
    assert not [room for room in rooms if f"`bs.{room}" not in text and f"`{room}`" not in text]
    for path in re.findall(r"`((?:docs|\.ci)/[\w./-]+)`", text):
        assert (ROOT / path).exists(), path


def test_issues_have_forms_and_dependencies_a_robot():
    forms = {path.stem for path in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")}
    assert forms == {"config", "wrong-number", "tableau", "question"}
    for path in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"):
        text = path.read_text(encoding="utf-8")
        assert path.stem == "config" or re.match(r"name: .+\ndescription: .+\nlabels: .+\nbody:\n", text), path
    assert "package-ecosystem: github-actions" in (ROOT / ".github" / "dependabot.yml").read_text(encoding="utf-8")
    assert "(CODE_OF_CONDUCT.md)" in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def test_numba_whose_internals_are_used_has_an_upper_bound_that_is_met():
    from importlib.metadata import version

    (bound,) = re.findall(r"numba>=[\d.]+,<(\d+)\.(\d+)", "\n".join(PROJECT["dependencies"]))
    installed = tuple(map(int, version("numba").split(".")[:2]))
    assert installed < tuple(map(int, bound)) == (installed[0], installed[1] + 1)
    assert "--pre numba" in WORKFLOWS["tests"]


def test_the_owner_is_named_in_one_place():
    places = [*ROOT.glob("*"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "paper").glob("*")]
    texts = {path.name: path.read_text(encoding="utf-8") for path in places if path.suffix in {".md", ".cff", ".toml"}}
    assert PROJECT["urls"].keys() == {"Homepage", "Documentation", "Issues", "Changelog"}
    assert not any(f"{PLACEHOLDER}/" in text for name, text in texts.items() if name != "pyproject.toml")
    assert PLACEHOLDER in WORKFLOWS["release"]  # which refuses to publish as long as it is there


def test_the_paper_has_its_length_and_cites_what_its_bibliography_lists():
    paper = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    text = re.sub(r"```.*?```", "", paper.split("\n---\n", 1)[1], flags=re.DOTALL)
    listed = re.findall(r"^@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(re.findall(r"(?<!\w)@(\w+)", text)) == set(listed)
    assert 750 <= len(text.split()) <= 1000
