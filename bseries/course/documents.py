"""The documents of the course, from Markdown to pages: pandoc parses and writes, typst sets PDF.

The source is pandoc's Markdown. Beyond that, images ``figure:NAME`` are figures of the package, equations may end in
``\\tag{5}``, and blocks ``::: solution`` are solutions of exercises.
"""

from __future__ import annotations

import json
import os
import re
from base64 import b64encode
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from html import escape
from itertools import count
from pathlib import Path
from string import Template
from typing import Any, NamedTuple, TypeVar

from bseries.course.computed import computed, figure_data, filled, places
from bseries.exceptions import SeriesError
from bseries.figures.registry import drawn, figure_file
from bseries_base.errors import not_one_of
from bseries_base.extras import MissingPackage, optional_module
from bseries_base.plotting import picture
from integrators.core.text_files import atomic_write

Element = dict[str, Any]
"""A block or an inline of pandoc's document: its type ``t`` and its contents ``c``."""

MARKDOWN = "markdown-smart-citations"
"""Quotes and dashes are written as they are meant; @ is no citation."""
HERE = Path(__file__).parent
TAG = re.compile(r"\\tag\{([^{}]*)\}")
DELIMITER = re.compile(r"\\(?:[bB]igg?(?P<size>[lr])(?:\\[lr](?P<bar>vert))?|(?P<side>[lr])vert)(?![A-Za-z])")
SPACING = {"\u0302": "^", "\u0303": "~", "\u0307": "˙"}
ACCENT = re.compile(rf'(<mo accent="true">)([{"".join(SPACING)}])(</mo>)')
"""Accents of pandoc's MathML, which are combining characters, and those that browsers place well."""


class Picture(NamedTuple):
    """A figure as a file."""

    content: bytes
    suffix: str  # svg or png

    @property
    def address(self) -> str:
        """The file as a data URI."""
        kind = "svg+xml" if self.suffix == "svg" else self.suffix
        return f"data:image/{kind};base64,{b64encode(self.content).decode()}"


Pictures = Mapping[str, Picture]  # by name of the figure


def parsed(text: str) -> Element:
    """Markdown as pandoc's document.

    Example:
        >>> [block["t"] for block in parsed("# One\\n\\nA *word*.")["blocks"]]
        ['Header', 'Para']
    """
    return json.loads(_pandoc(text, "json", MARKDOWN, "--columns=10000"))  # wider tables would get equal columns


def without(document: Element, kind: str) -> Element:
    """A document without its blocks ``::: {.kind}``.

    Example:
        >>> document = parsed("What is 1 + 1?\\n\\n::: solution\\n2\\n:::")
        >>> [block["t"] for block in without(document, "solution")["blocks"]]
        ['Para']
    """
    return _rewritten(document, lambda element: [] if kind in _classes(element) else None)


def html_page(document: Element, title: str, layout: str, pictures: Pictures) -> bytes:
    """One HTML file with everything in it, by the template slides or sheets: formulas in MathML, pictures as data.

    Example:
        >>> page = html_page(parsed("$$ y' = f(y) \\\\tag{1} $$"), "One formula", "sheets", {}).decode()
        >>> "<mi>f</mi>" in page, '<span class="number">(1)</span>' in page
        (True, True)
    """

    def changed(element: Element) -> list[Element] | None:
        kind, content = element["t"], element.get("c", ())
        if kind == "Math" and content[0]["t"] == "DisplayMath":
            formula, number = _untagged(element)
            label = f'<span class="number">({escape(number)})</span>' if number else ""
            return [_raw("html", '<span class="formula">'), formula, _raw("html", f"{label}</span>")]
        if kind == "Image" and (name := _figure_name(content[2][0])):
            return [{"t": "Image", "c": [content[0], content[1], [pictures[name].address, ""]]}]
        return None

    blocks = _rewritten(document, changed)
    if layout == "slides":
        parts: list[list[Element]] = []
        for block in blocks["blocks"]:  # a section from each heading to the next
            if block["t"] == "Header" or not parts:
                parts.append([])
            parts[-1].append(block)
        kinds = (f"level{part[0]['c'][0]}" if part[0]["t"] == "Header" else "level2" for part in parts)
        sections = [[["", ["section", kind], []], part] for kind, part in zip(kinds, parts, strict=True)]
        blocks = {**blocks, "blocks": [{"t": "Div", "c": section} for section in sections]}
    body = _pandoc(json.dumps(blocks), "html5", "json", "--mathml", "--wrap=preserve")
    body = ACCENT.sub(lambda found: f"{found[1]}{SPACING[found[2]]}{found[3]}", body)
    template = Template((HERE / f"{layout}.html").read_text(encoding="utf-8"))
    style = (HERE / "common.css").read_text(encoding="utf-8")
    return template.substitute(title=escape(title), style=style, body=body).encode()


def pdf_pages(document: Element, title: str, layout: str, pictures: Pictures) -> bytes:
    """A PDF, set by typst with the template of a layout.

    Example:
        >>> pdf_pages(parsed("A *word*."), "One word", "sheets", {})[:5]
        b'%PDF-'
    """
    from tempfile import TemporaryDirectory

    typst = optional_module("typst", "a PDF of the course")
    with TemporaryDirectory() as folder:
        for name, drawing in pictures.items():
            Path(folder, f"{name}.{drawing.suffix}").write_bytes(drawing.content)
        main = Path(folder, "main.typ")
        main.write_text(typst_source(document, title, layout, pictures), encoding="utf-8")
        return typst.compile(str(main), root=folder, ignore_system_fonts=True)


def typst_source(document: Element, title: str, layout: str, pictures: Pictures) -> str:
    """What typst sets: the template of the layout and the document, whose own blocks are calls of its functions."""

    def changed(element: Element) -> list[Element] | None:
        kind, content = element["t"], element.get("c", ())
        if kind == "Math":
            formula, number = _untagged(element)
            formula["c"][1] = DELIMITER.sub(stretched, formula["c"][1])
            return [_raw("typst", f'#numbered("({number})")['), formula, _raw("typst", "]")] if number else [formula]
        images = [x["c"] for block in content[2] for x in block["c"] if x["t"] == "Image"] if kind == "Figure" else []
        for (_, classes, _), _, (address, _) in images:
            if (name := _figure_name(address)) is None:
                continue
            call = f'#picture("{name}.{pictures[name].suffix}", wide: {json.dumps("wide" in classes)})['
            return [_raw("typst", call, "RawBlock"), *content[1][1], _raw("typst", "]", "RawBlock")]
        if "solution" in _classes(element):
            return [_raw("typst", "#solution[", "RawBlock"), *content[1], _raw("typst", "]", "RawBlock")]
        return None

    body = _pandoc(json.dumps(_rewritten(document, changed)), "typst", "json", "--wrap=preserve")
    template = "\n".join((HERE / f"{name}.typ").read_text(encoding="utf-8") for name in ("common", layout))
    return f"{template}\n#show: course.with(title: {json.dumps(title, ensure_ascii=False)})\n\n{body}"


def _rewritten(node: Any, rule: Callable[[Element], list[Element] | None]) -> Any:
    """A copy of a document in which a rule replaces elements, the innermost first; None keeps an element."""
    if isinstance(node, dict):
        return {key: _rewritten(value, rule) for key, value in node.items()}
    if not isinstance(node, list):
        return node
    found = []
    for item in (_rewritten(item, rule) for item in node):
        replaced = rule(item) if isinstance(item, dict) and "t" in item else None
        found += [item] if replaced is None else replaced
    return found


def _classes(element: Element) -> list[str]:
    """The classes of a block; none of other elements."""
    return element["c"][0][1] if element["t"] == "Div" else []


def _figure_name(address: str) -> str | None:
    """The name of the figure of the package that an address such as figure:riccati stands for."""
    return address.removeprefix("figure:") if address.startswith("figure:") else None


def stretched(delimiter: re.Match[str]) -> str:
    """A delimiter of a given size as one that adapts to what is inside: pandoc would make typst lose its spacing."""
    side = {"l": "left", "r": "right"}[delimiter["size"] or delimiter["side"]]
    return f"\\{side}{'|' if delimiter['bar'] or delimiter['side'] else ''}"


def _untagged(formula: Element) -> tuple[Element, str]:
    r"""A formula without its ``\tag{5}``, which pandoc would leave out, and the number in it or nothing."""
    kind, text = formula["c"]
    found = TAG.search(text)
    return {"t": "Math", "c": [kind, TAG.sub("", text)]}, found[1] if found else ""


def _raw(language: str, text: str, kind: str = "RawInline") -> Element:
    """Text that pandoc writes as it is if the language is that of the output."""
    return {"t": kind, "c": [language, text]}


def _pandoc(text: str, to: str, source: str, *options: str) -> str:
    """The output of pandoc; what it cannot write as asked, such as a formula, is an error in a source."""
    pypandoc = optional_module("pypandoc", "a document of the course")
    try:
        return pypandoc.convert_text(text, to, source, extra_args=["--fail-if-warnings", *options])
    except OSError as error:  # pypandoc without a program
        raise MissingPackage(f"a document of the course needs pandoc: {error}") from None


class Document(NamedTuple):
    """A document of the course."""

    source: str  # the Markdown file beside this one
    title: str
    layout: str  # the templates of its pages: slides or sheets
    left_out: str = ""  # the class of blocks that are left out


LARGEST = 1_000_000
"""Bytes of a drawing with lines; larger ones are shown as pixels."""
DOCUMENTS = {
    "slides": Document("slides.md", "Backward error analysis", "slides"),
    "handout": Document("proofs.md", "Backward error analysis: the theorems with their proofs", "sheets"),
    "exercises": Document("exercises.md", "Backward error analysis: exercises", "sheets", "solution"),
    "solutions": Document("exercises.md", "Backward error analysis: exercises with solutions", "sheets"),
}
"""All documents by name."""
FORMATS = {"html": html_page, "pdf": pdf_pages}
"""Formats by name, and what makes a file of a document."""
FIGURE = re.compile(r"\]\(figure:([\w-]+)\)")
"""A figure of the package in the text."""

Item = TypeVar("Item")


def make_course(
    folder: str | os.PathLike[str],
    documents: Collection[str] = tuple(DOCUMENTS),
    formats: Collection[str] = tuple(FORMATS),
    *,
    progress: Callable[[int, int], object] | None = None,
) -> list[Path]:
    """Write documents of the course to a folder: their formulas are computed and their figures drawn anew.

    Args:
        folder: A folder that is there.
        documents: Some of `DOCUMENTS`.
        formats: Some of `FORMATS`.
        progress: Called with the work done and all work.

    Returns:
        The files, such as ``slides.html``. Each replaces an older one when it is complete.

    Example:
        >>> from tempfile import mkdtemp
        >>> [path.name for path in make_course(mkdtemp(), ["handout"], ["html"])]
        ['handout.html']
    """
    for known, names, argument in ((DOCUMENTS, documents, "document"), (FORMATS, formats, "format")):
        for name in names:
            if name not in known:
                raise SeriesError(not_one_of(known, argument, name))
    chosen, makers = {name: DOCUMENTS[name] for name in documents}, {name: FORMATS[name] for name in formats}
    texts = {file: (HERE / file).read_text(encoding="utf-8") for file in {part.source for part in chosen.values()}}
    whole = "\n".join(texts.values())
    formulas, figures = dict.fromkeys(places(whole)), dict.fromkeys(FIGURE.findall(whole))
    files = [(name, kind) for name in chosen for kind in makers]
    for package in ("pypandoc", *(["typst"] if "pdf" in makers else []), *(["matplotlib"] if figures else [])):
        optional_module(package, "the course")  # before the work, not after it
    done, total = count(), len(formulas) + len(figures) + len(files)

    def each(items: Iterable[Item]) -> Iterator[Item]:
        for item in items:
            if progress is not None:
                progress(next(done), total)
            yield item

    values = {name: computed(name) for name in each(formulas)}
    pictures = {name: drawn_picture(name) for name in each(figures)}
    contents = {name: parsed(filled(text, values)) for name, text in texts.items()}
    for name, kind in each(files):
        document = chosen[name]
        content = without(contents[document.source], document.left_out)
        atomic_write(Path(folder, f"{name}.{kind}"), makers[kind](content, document.title, document.layout, pictures))
    return [Path(folder, f"{name}.{kind}") for name, kind in files]


def drawn_picture(name: str) -> Picture:
    """A figure, drawn with lines unless that were too large.

    Example:
        >>> drawn_picture("theorem-3").suffix
        'svg'
    """
    figure = drawn(figure_file(name), figure_data(name))
    lines = picture(figure, "svg")
    return Picture(lines, "svg") if len(lines) <= LARGEST else Picture(picture(figure, "png"), "png")
