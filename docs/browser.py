"""Sphinx extension: pages that readers run in their browser.

Each page of `PAGES` gets a button that opens it as a notebook of JupyterLite. The notebooks, JupyterLite and a wheel of
this package are files of the site; Python (Pyodide) and the packages that it needs are loaded from their public hosts
when a reader presses the button.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from doctest import DocTestParser
from pathlib import Path

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

HERE = Path(__file__).parent
WHEELS = HERE.parent / "build" / "wheels"  # `make wheel`
PAGES = ("try", "programs")  # none needs numba, which browsers do not have
BUTTON = """
```{{raw}} html
<button class="btn btn-primary" title="Python and packages are loaded from their public hosts"
 onclick="const frame = this.nextElementSibling; frame.src = frame.dataset.src; frame.hidden = false;
 this.hidden = true">Run this page</button>
<iframe class="notebook" title="This page as a notebook" data-src="lite/notebooks/index.html?path={name}.ipynb"
 hidden></iframe>
```
"""


def as_notebook(page: str) -> nbformat.NotebookNode:
    """A page with examples as a notebook: a cell of code ends where an example has output."""
    cells = [new_code_cell("%pip install -q bseries-engine")]
    for k, part in enumerate(re.split(r"```python\n(>>> .*?)```", page, flags=re.DOTALL)):
        if k % 2 == 0:
            cells.append(new_markdown_cell(re.sub(r"\[([^]]+)\]\((?!https?:)[^)]*\)", r"\1", part.strip())))
            continue
        source = ""
        for example in DocTestParser().get_examples(part):
            source += example.source
            if example.want:
                cells.append(new_code_cell(source.rstrip()))
                if example.exc_msg:
                    cells[-1].metadata.tags = ["raises-exception"]  # the cells below still run
                source = ""
        cells.append(new_code_cell(source.rstrip()))
    return new_notebook(
        cells=[cell for cell in cells if cell.source],
        metadata={"kernelspec": {"name": "python", "display_name": "Python (Pyodide)", "language": "python"}},
    )


def add_button(_: Sphinx, name: str, source: list[str]) -> None:
    """A button below the title of a page that can be run."""
    if name in PAGES:
        title, text = source[0].split("\n", 1)
        source[0] = title + "\n" + BUTTON.format(name=name) + text


def build(application: Sphinx, error: Exception | None) -> None:
    """Write JupyterLite with the notebooks and the wheel to the folder `lite` of the site."""
    if error is not None or application.builder.format != "html":
        return
    output = Path(application.outdir) / "lite"
    shutil.rmtree(output, ignore_errors=True)
    with tempfile.TemporaryDirectory() as folder:
        contents = Path(folder) / "contents"
        contents.mkdir()
        for name in PAGES:
            nbformat.write(as_notebook((HERE / f"{name}.md").read_text(encoding="utf-8")), contents / f"{name}.ipynb")
        places = {"contents": contents, "piplite-wheels": WHEELS, "output-dir": output, "apps": "notebooks"}
        options = ["--no-sourcemaps", "--no-unused-shared-packages", *(f"--{key}={x}" for key, x in places.items())]
        command = [sys.executable, "-m", "jupyterlite_core", "build", *options]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ExtensionError(f"JupyterLite could not be built:\n{done.stdout}\n{done.stderr}")


def setup(application: Sphinx) -> None:
    """Register both steps with Sphinx."""
    application.connect("source-read", add_button)
    application.connect("build-finished", build)
