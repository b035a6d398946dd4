"""The sources of the course with what is computed for them, where that is quick."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bseries.course import documents
from bseries.course.computed import COMPUTED, computed, filled, places

FOLDER = Path(documents.__file__).parent
SOURCES = {document.source for document in documents.DOCUMENTS.values()}
ROWS = "| a | b | c | d | e |\n|--|--|--|--|--|\n"
SLOW = {
    "large-steps": ROWS + "| 1.35 | $1.2\\cdot10^{-3}$ | 1 | 1 | 1 |\n" * 6,
    "atom-means": ROWS + "| 1 | $0.30 \\pm 0.71$ | 1 | 1 | 1 |\n" * 4,
}
"""Stand-ins, as high as the tables, for what takes more than a second; figure 8's numbers have none that is higher."""
DRAWING = b'<svg xmlns="http://www.w3.org/2000/svg" width="340" height="250"><path d="M0 0H340V250H0Z"/></svg>'


def quick(name: str) -> str:
    """What is computed, or a stand-in."""
    return SLOW.get(name) or ("1.23\\cdot10^{-6}" if name.startswith("figure-8") else computed(name))


@pytest.fixture(scope="session")
def texts() -> dict[str, str]:
    """The sources, filled."""
    found = {source: (FOLDER / source).read_text(encoding="utf-8") for source in SOURCES}
    values = {name: quick(name) for name in set(places("".join(found.values())))}
    assert set(values) <= set(COMPUTED)
    return {source: filled(text, values) for source, text in found.items()}


@pytest.fixture(scope="session")
def contents(texts) -> dict[str, documents.Element]:
    """The documents by name, as pandoc reads them."""
    pytest.importorskip("pypandoc")
    parsed = {source: documents.parsed(text) for source, text in texts.items()}
    return {
        name: documents.without(parsed[document.source], document.left_out)
        for name, document in documents.DOCUMENTS.items()
    }


@pytest.fixture(scope="session")
def pictures(texts) -> dict[str, documents.Picture]:
    """A drawing in the place of each figure."""
    names = re.findall(documents.FIGURE, "".join(texts.values()))
    return dict.fromkeys(names, documents.Picture(DRAWING, "svg"))
