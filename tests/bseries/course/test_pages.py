"""Pages of the course: every formula is set, nothing is asked from elsewhere, and no slide is too full."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from bseries.course import documents
from bseries.course.documents import html_page, parsed, pdf_pages, typst_source, without

pytestmark = pytest.mark.minimum

pytest.importorskip("pypandoc")
DOCUMENTS = documents.DOCUMENTS
VOID = {"meta", "img", "br", "hr", "col", "input"}


class Reader(HTMLParser):
    """Reads a page: which elements it has, whether they are closed in order, and what its addresses are."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.count: dict[str, int] = {}
        self.addresses: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.count[tag] = self.count.get(tag, 0) + 1
        self.addresses += [value for key, value in attrs if key in ("src", "href", "srcset", "action", "data")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag, f"{tag} is closed, but another element is open"

    def handle_data(self, data):
        if not {"script", "style", "annotation"} & set(self.open):
            self.text.append(data)


def read(page: bytes) -> Reader:
    reader = Reader()
    reader.feed(page.decode())
    assert not reader.open
    return reader


def formulas(node) -> list[str]:
    """All formulas of a document; the text in place of a picture is its caption once more."""
    if isinstance(node, dict):
        if node.get("t") == "Image":
            return []
        own = [node["c"][1]] if node.get("t") == "Math" else []
        return own + formulas(list(node.values()))
    return [formula for part in node for formula in formulas(part)] if isinstance(node, list) else []


def typst_pages(source: str, pictures) -> int:
    """The number of pages that typst makes of a source."""
    typst = pytest.importorskip("typst")
    with TemporaryDirectory() as folder:
        for name, picture in pictures.items():
            Path(folder, f"{name}.{picture.suffix}").write_bytes(picture.content)
        main = Path(folder, "main.typ")
        main.write_text(source, encoding="utf-8")
        made = typst.compile(str(main), root=folder, ignore_system_fonts=True, format="svg")
    return len(made) if isinstance(made, list) else 1


def slides_in(text: str) -> int:
    return len(re.findall(r"^##? ", text, re.MULTILINE))


@pytest.mark.parametrize("name", DOCUMENTS)
def test_html_stands_alone_and_has_every_formula(name, contents, pictures):
    document, content = DOCUMENTS[name], contents[name]
    page = html_page(content, document.title, document.layout, pictures)
    reader = read(page)
    assert reader.count["math"] == len(formulas(content)) > 100
    assert all(address.startswith(("data:", "#")) for address in reader.addresses)
    rest = re.sub(r'xmlns="[^"]*"|data:[^"]*', "", page.decode())
    assert not re.search(r"https?:|url\(|@import", rest)
    text = "".join(reader.text)
    assert "$" not in text
    assert not re.search(r"\{\{[a-z0-9-]+\}\}|\\[a-z]", text)
    numbers = re.findall(r"\\tag\{([^}]*)\}", "".join(formulas(content)))
    assert re.findall(r'<span class="number">\((.*?)\)</span>', page.decode()) == numbers


def test_a_formula_that_cannot_be_set_is_an_error():
    document = parsed(r"$\frac{1$")
    for write in (html_page, typst_source):
        with pytest.raises(RuntimeError, match="warnings"):
            write(document, "Broken", "sheets", {})


def test_no_slide_is_longer_than_its_page(contents, texts, pictures):
    document = DOCUMENTS["slides"]
    source = typst_source(contents["slides"], document.title, "slides", pictures)
    assert typst_pages(source, pictures) == slides_in(texts[document.source])


def test_a_slide_that_is_too_full_would_be_noticed():
    text = "# Part\n\n## Full\n\n" + "A line.\n\n" * 20
    assert slides_in(text) == 2
    assert typst_pages(typst_source(parsed(text), "Full", "slides", {}), {}) == 3


@pytest.mark.parametrize("name", ["handout", "exercises", "solutions"])
def test_sheets_have_pages(name, contents, pictures):
    document = DOCUMENTS[name]
    made = typst_pages(typst_source(contents[name], document.title, "sheets", pictures), pictures)
    assert 4 <= made <= 30
    pdf = pdf_pages(contents[name], document.title, "sheets", pictures)
    assert pdf.startswith(b"%PDF")
    assert pdf == pdf_pages(contents[name], document.title, "sheets", pictures), "files are reproducible"


def test_html_has_a_section_for_each_slide(contents, texts, pictures):
    reader = read(html_page(contents["slides"], "Slides", "slides", pictures))
    assert reader.count["section"] == slides_in(texts["slides.md"])
    assert reader.count["img"] == len(documents.FIGURE.findall(texts["slides.md"]))


def test_solutions_are_left_out():
    document = parsed("## Exercise 1 {#ex1}\n\nHow much is $1 + 1$?\n\n::: {.solution}\nIt is $2$.\n:::\n")
    with_them = html_page(document, "Sheet", "sheets", {}).decode()
    without_them = html_page(without(document, "solution"), "Sheet", "sheets", {}).decode()
    assert 'class="solution"' in with_them
    assert "It is" in with_them
    assert "It is" not in without_them
    assert "How much" in without_them
    assert "#solution[" in typst_source(document, "Sheet", "sheets", {})
    assert "#solution[" not in typst_source(without(document, "solution"), "Sheet", "sheets", {})


@pytest.mark.parametrize(
    ("tex", "found"),
    [
        (r"\bigl( x \bigr)", r"\left( x \right)"),
        (r"\Bigl\lvert x \Bigr\rvert", r"\left| x \right|"),
        (r"\lvert x\rvert + \lVert y\rVert", r"\left| x\right| + \lVert y\rVert"),
        (r"\lvertx \bigcup", r"\lvertx \bigcup"),
    ],
)
def test_delimiters_adapt(tex, found):
    assert documents.DELIMITER.sub(documents.stretched, tex) == found


@pytest.mark.slow
def test_keys_lead_from_slide_to_slide(contents, pictures, tmp_path, browser):
    path = tmp_path / "slides.html"
    path.write_bytes(html_page(contents["slides"], "Slides", "slides", pictures))
    page = browser.new_page(viewport={"width": 400, "height": 800})
    problems: list[str] = []
    page.on("console", lambda message: problems.append(message.text))
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("request", lambda asked: None if asked.url.startswith(("file:", "data:")) else problems.append(asked.url))
    page.goto(path.as_uri())
    shown = "[...document.querySelectorAll('section')].findIndex(x => Math.abs(x.getBoundingClientRect().top) < 2)"
    for key, place in (("ArrowRight", 1), ("PageDown", 2), ("ArrowLeft", 1), ("PageUp", 0), ("PageUp", 0)):
        page.keyboard.press(key)
        assert page.evaluate(shown) == place, key
    page.keyboard.press("End")
    last = page.evaluate("document.querySelectorAll('section').length") - 1
    assert page.evaluate("[...document.querySelectorAll('section')].at(-1).getBoundingClientRect().top < innerHeight")
    assert last > 60
    assert page.evaluate("document.documentElement.scrollWidth") <= 400, "a phone would have to scroll sideways"
    assert not problems
    page.close()
