"""The course as files: the parts, refusals, completeness of the sources."""

from __future__ import annotations

import re
import sys
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pytest

from bseries.course import documents
from bseries.course.documents import DOCUMENTS, make_course
from bseries.exceptions import SeriesError
from bseries_base.extras import MissingPackage
from integrators import IntegratorError

pytestmark = pytest.mark.minimum

pytest.importorskip("pypandoc")
ROOT = Path(__file__).parents[3]
FOLDER = Path(documents.__file__).parent


def source(name: str) -> str:
    return (FOLDER / DOCUMENTS[name].source).read_text(encoding="utf-8")


def test_files_are_made_and_replaced(tmp_path):
    pytest.importorskip("typst")
    (tmp_path / "handout.pdf").write_text("an old one", encoding="utf-8")
    (tmp_path / "notes.txt").write_text("of a user", encoding="utf-8")
    done: list[tuple[int, int]] = []
    made = make_course(tmp_path, ["handout"], progress=lambda part, whole: done.append((part, whole)))
    assert [path.name for path in made] == ["handout.html", "handout.pdf"]
    assert {path.name for path in tmp_path.iterdir()} == {"handout.html", "handout.pdf", "notes.txt"}
    assert (tmp_path / "handout.pdf").read_bytes().startswith(b"%PDF")
    assert done == [(0, 2), (1, 2)]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (
            {"documents": ["slide"]},
            "document must be one of slides, handout, exercises, solutions, but was 'slide'; did",
        ),
        ({"formats": ["docx"]}, "format must be one of html, pdf, but was 'docx'"),
    ],
)
def test_unknown_names_are_refused(tmp_path, options, sentence):
    with pytest.raises(SeriesError, match=re.escape(sentence)):
        make_course(tmp_path, **options)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(IntegratorError, match=r"handout\.html must be a writable file, but was not: No such file"):
        make_course(tmp_path / "nowhere", ["handout"], ["html"])


@pytest.mark.parametrize("package", ["pypandoc", "typst", "matplotlib"])
def test_without_a_package_there_is_a_sentence_before_the_work(tmp_path, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    extra = "plot" if package == "matplotlib" else "course"
    with pytest.raises(MissingPackage, match=rf"the course needs {package}: pip install '\.\[{extra}\]'"):
        make_course(tmp_path, ["slides"])
    assert not list(tmp_path.iterdir())


def test_pypandoc_without_pandoc(tmp_path, monkeypatch):
    import pypandoc

    def convert_text(*_, **__):
        raise OSError("No pandoc was found")

    monkeypatch.setattr(pypandoc, "convert_text", convert_text)
    with pytest.raises(MissingPackage, match="a document of the course needs pandoc: No pandoc was found"):
        make_course(tmp_path, ["handout"], ["html"])


@pytest.mark.slow
def test_the_whole_course(tmp_path):
    pytest.importorskip("typst")
    make_course(tmp_path)
    names = {f"{name}.{kind}" for name in DOCUMENTS for kind in documents.FORMATS}
    assert names <= {path.name for path in tmp_path.iterdir()}
    assert all((tmp_path / name).stat().st_size < 20_000_000 for name in names)
    slides = (tmp_path / "slides.html").read_text(encoding="utf-8")
    assert slides.count("data:image/") == len(documents.FIGURE.findall(source("slides")))
    assert "{{" not in re.sub(r"data:[^\"]*", "", slides)


@pytest.mark.parametrize(
    ("pattern", "last"),
    [
        (r"\\tag\{(\d+)\}", 28),
        (r"Theorem (\d)", 7),
        (r"Example (\d)", 9),
        (r"[Ff]igure (\d+)", 10),
        (r"Definition (\d)", 1),
    ],
)
def test_slides_have_all_that_the_lecture_numbers(pattern, last):
    assert {int(number) for number in re.findall(pattern, source("slides"))} == set(range(1, last + 1))


def test_slides_show_every_figure():
    from bseries.figures.registry import figure_file, figure_names

    shown = documents.FIGURE.findall(source("slides"))
    assert len(shown) == len(set(shown))
    assert {name for name in figure_names() if figure_file(name).NUMBER} <= set(shown) <= set(figure_names())


def test_every_theorem_of_the_handout_has_a_proof():
    parts = re.split(r"^## ", source("handout"), flags=re.MULTILINE)[1:]
    theorems = [part for part in parts if part.startswith("Theorem")]
    assert [part[8] for part in theorems] == list("1234567")
    for part in parts:
        statements = re.findall(r"^> \*\*(.*?)\*\*", part, re.MULTILINE)
        proofs = re.findall(r"^\*Proof", part, re.MULTILINE)
        assert len(statements) == len(proofs) >= 1, part[:40]
        assert part.count("∎") >= len(proofs)


def test_every_exercise_has_a_solution():
    parts = re.split(r"^## Exercise ", source("exercises"), flags=re.MULTILINE)[1:]
    assert [int(re.match(r"\d+", part)[0]) for part in parts] == list(range(1, len(parts) + 1))
    assert len(parts) >= 16
    for part in parts:
        assert len(re.findall(r"^::: *\{?\.?solution", part, re.MULTILINE)) == 1, part[:40]


def test_the_page_of_proofs_is_the_handout():
    page = (ROOT / "docs" / "proofs.md").read_text(encoding="utf-8")
    (included,) = re.findall(r"\{include\} (.*)", page)
    assert (ROOT / "docs" / included).resolve() == FOLDER / "proofs.md"
    assert "](" not in source("handout"), "links would lead nowhere in one of the two"


def test_sources_and_templates_are_distributed():
    setuptools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    patterns = setuptools["package-data"]["*"]
    others = [path for path in FOLDER.iterdir() if path.is_file() and path.suffix != ".py"]
    assert {"slides.md", "proofs.md", "exercises.md", "slides.typ", "sheets.html"} <= {path.name for path in others}
    assert all(any(fnmatch(path.name, pattern) for pattern in patterns) for path in others)
