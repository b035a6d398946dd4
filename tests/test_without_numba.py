"""Exact results where numba and psutil are not installed, as in a browser, are those of compiled kernels."""

from __future__ import annotations

import doctest
import json
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import bseries as bs

BLOCKED = """
import importlib.util, json, sys
BLOCKED = {"numba", "llvmlite", "psutil"}
found = importlib.util.find_spec
importlib.util.find_spec = lambda name, package=None: None if name in BLOCKED else found(name, package)

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocked())
"""
RESULTS = """
import bseries as bs

def results():
    yield bs.modified_equation("rk4", 8).to_dict()
    yield bs.modified_equation("gauss2", 7).to_dict()
    yield bs.modified_equation("dop853", 5).to_dict()
    yield bs.series("stormer-verlet", 6).to_dict()
    yield bs.modifying_integrator("heun2", 7).to_dict()
    yield bs.compose(bs.series("rk4", 7), bs.series("heun2", 7)).to_dict()
    yield bs.substitute(bs.modified_equation("heun2", 6), bs.series("rk4", 6)).to_dict()
    yield bs.check("lobatto-iiia3").to_dict()
    yield bs.check("dormand-prince54").to_dict()
    yield bs.order_conditions("runge-kutta", 5).to_dict()
    yield bs.modified_field("rk4", "pendulum", 6).to_dict()
    yield bs.modified_hamiltonian("stormer-verlet", "kepler", 5).to_table().to_text()
    yield bs.bch(8).to_dict()
    yield str(bs.hopf.coproduct(bs.Tree("[[t],[t,t]]")))
    yield [str(tree) for tree in bs.TreeTable(7, colors=2)][::50]
"""

DOCS = Path(__file__).parent.parent / "docs"
EXAMPLES = """
import doctest
options = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
done = doctest.testfile(sys.argv[1], module_relative=False, optionflags=options, encoding="utf-8")
assert done.attempted and not done.failed
assert not BLOCKED & set(sys.modules)
"""


def test_results_are_the_same():
    script = BLOCKED + RESULTS + "\nprint(json.dumps(list(results())))\nassert not BLOCKED & set(sys.modules)\n"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    scope: dict = {"bs": bs}
    exec(RESULTS, scope)  # the text above
    import numba  # noqa: F401  # compiled kernels from here on

    assert json.loads(done.stdout) == json.loads(json.dumps(list(scope["results"]())))


@pytest.mark.slow
def test_pages_that_run_in_a_browser_show_what_plain_python_gives():
    for page in runpy.run_path(str(DOCS / "browser.py"))["PAGES"]:
        command = [sys.executable, "-c", BLOCKED + EXAMPLES, str(DOCS / f"{page}.md")]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_notebooks_have_all_examples_of_their_page():
    browser = runpy.run_path(str(DOCS / "browser.py"))
    for page in browser["PAGES"]:
        text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
        install, *cells = (cell for cell in browser["as_notebook"](text).cells if cell.cell_type == "code")
        examples = doctest.DocTestParser().get_examples(text)
        assert install.source == "%pip install -q bseries-engine"
        assert "\n".join(cell.source for cell in cells) == "".join(example.source for example in examples).rstrip()
