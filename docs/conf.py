"""Configuration of the documentation site; `make docs` builds it into build/docs.

Notebooks are pages too: `python -m notebooks` executes them beforehand, and they are copied here with their outputs.
Pages link to files as on a code host; links that leave this folder are rewritten here.
"""

import re
import shutil
import sys
from pathlib import Path

from docutils import nodes

HERE = Path(__file__).parent
sys.path.append(str(HERE))  # where the extension `browser` is
EXECUTED = HERE.parent / "notebooks" / "executed"
COPIES = HERE / "notebooks"

project = "bseries-engine"
author = "the authors of bseries-engine"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_click",
    "sphinx_copybutton",
    "sphinx-mathjax-offline",
    "browser",
]

autodoc_member_order = "bysource"
autosummary_generate = True
copybutton_prompt_is_regexp = True
copybutton_prompt_text = r">>> |\.\.\. |\$ "  # copied are the lines with prompts, without these
default_role = "code"
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "off"
smartquotes = False

html_theme = "pydata_sphinx_theme"
html_title = "bseries-engine"
html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["wide.css"]
html_theme_options = {"show_toc_level": 2}


def link_within_the_site(_: object, name: str, source: list[str]) -> None:
    """Links to notebooks lead to their pages; those to other files outside this folder become text.

    Sessions have marks of empty lines and end with one, for doctest; these are not shown.
    """
    del name
    source[0] = source[0].replace("<BLANKLINE>", "")
    source[0] = re.sub(r"\n\n```$", "\n```", source[0], flags=re.MULTILINE)
    source[0] = re.sub(r"\(\.\./notebooks/(\w+)\.py\)", r"(/notebooks/\1.ipynb)", source[0])
    source[0] = re.sub(r"\[([^]]+)\]\(\.\./[^)]*\)", r"\1", source[0])


def escape_markup(_: object, *arguments: object) -> None:
    """Docstrings are plain text with backticks: bars are no substitutions, and a plural may follow a backtick."""
    lines = arguments[-1]
    assert isinstance(lines, list)
    example = False
    for k, line in enumerate(lines):
        example = line.lstrip().startswith(">>> ") or (example and bool(line.strip()))
        if not example:
            lines[k] = re.sub(r"(``?[^`]+``?)(\w?)", spaced, line).replace("|", r"\|")


def spaced(code: re.Match[str]) -> str:
    """Code, and a letter that follows it."""
    return rf"{code[1]}\ {code[2]}" if code[2] else code[0]


def escape_help(_: object, __: object, lines: list[str]) -> None:
    """Help texts are plain text; a bar at the start of a line keeps the line as it is."""
    for k, line in enumerate(lines):
        if not line.lstrip().startswith(".."):
            start = re.match(r"\s*(\| ?)?", line)
            assert start is not None
            lines[k] = start[0] + re.sub(r"([*|])", r"\\\1", line[start.end() :])


def name_figures(_: object, tree: nodes.document, __: str) -> None:
    """Figures that notebooks draw have no text in their place; the title of their section is one."""
    for image in tree.findall(nodes.image):
        section = image.parent
        while not isinstance(section, nodes.section | nodes.document):
            section = section.parent
        title = section.next_node(nodes.title)
        image.setdefault("alt", "Figure" if title is None else f"Figure: {title.astext()}")


def setup(application: object) -> None:
    """Copy executed notebooks beside the pages, and adapt sources."""
    COPIES.mkdir(exist_ok=True)
    for notebook in EXECUTED.glob("*.ipynb"):
        shutil.copy(notebook, COPIES / notebook.name)
    connect = application.connect  # type: ignore[attr-defined]
    connect("source-read", link_within_the_site)
    connect("doctree-resolved", name_figures)
    connect("autodoc-process-docstring", escape_markup)
    connect("sphinx-click-process-description", escape_help)
    connect("sphinx-click-process-options", escape_help)
