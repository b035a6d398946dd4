"""The shape of the code base: rooms and the order of imports, public names, and what starting costs."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import networkx as nx
import pytest

import bseries

ROOT = Path(__file__).parent.parent
PACKAGES = ("trees", "integrators", "bseries")
BELOW = "bseries_base"
HEAVY = {"numpy", "sympy", "numba", "networkx", "matplotlib", "scipy", "rich", "click"}
MOST_LINES = 600


def module_name(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def all_sources():
    """The syntax trees of all modules, parsed where a test needs them: both workers load this file."""
    return {
        module_name(path): ast.parse(path.read_text(encoding="utf-8"))
        for package in (BELOW, *PACKAGES)
        for path in sorted((ROOT / package).rglob("*.py"))
    }


def read_rooms(page):
    """The rooms in the table of docs/architecture.md, from the lowest to the highest."""
    return re.findall(r"^\| `([a-z_.]+)` \|", page, re.MULTILINE)


ROOMS = read_rooms((ROOT / "docs" / "architecture.md").read_text(encoding="utf-8"))


def room_of(module, sources):
    """The folder of a module; a package's own file belongs to it."""
    return module if any(other.startswith(f"{module}.") for other in sources) else module.rpartition(".")[0]


def for_types(tree):
    """The nodes under TYPE_CHECKING."""
    tests = (node for node in ast.walk(tree) if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test))
    return {id(node) for test in tests for node in ast.walk(test)}


def imports(tree, sources, *, types=True):
    """The modules of this project that a module imports, anywhere in it."""
    skipped = set() if types else for_types(tree)
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in sources)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, "imports are absolute"
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            yield from names & set(sources)
            if not names <= set(sources) and node.module in sources:
                yield node.module


def wrong_ways(rooms, sources):
    """Imports of a module in a room that is not below."""
    height = {room: k for k, room in enumerate(rooms)}
    for name, tree in sources.items():
        for used in set(imports(tree, sources)) - {*PACKAGES, BELOW}:
            here, there = room_of(name, sources), room_of(used, sources)
            if height[there] > height[here]:
                yield name, used


def circles(sources, *, types):
    graph = nx.DiGraph((name, used) for name, tree in sources.items() for used in imports(tree, sources, types=types))
    graph.remove_edges_from(list(nx.selfloop_edges(graph)))
    return [sorted(part) for part in nx.strongly_connected_components(graph) if len(part) > 1]


def evaluations(tree):
    """Names of the functions that a module calls and that evaluate text; a strict `sympify` refuses text."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", None))
            strict = any(keyword.arg == "strict" and ast.unparse(keyword.value) == "True" for keyword in node.keywords)
            if name in {"eval", "exec", "parse_expr", "nsimplify"} or (name == "sympify" and not strict):
                yield name


STUBS = sorted(module_name(path) for package in PACKAGES for path in (ROOT / package).rglob("__init__.pyi"))


def public_names(package):
    """The names that the stub of a package or a room re-exports or declares."""
    path = ROOT.joinpath(*package.split("."), "__init__.pyi")
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from (alias.asname or alias.name for alias in node.names)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.target.id != "__version__":
            yield node.target.id


def public_objects():
    """Functions and classes in public places, not the places themselves."""
    for package in STUBS:
        for name in public_names(package):
            thing = getattr(importlib.import_module(package), name)
            if not inspect.ismodule(thing):
                yield package, name, thing


def test_every_folder_is_a_room_of_the_table():
    folders = {room_of(module, all_sources()) for module in all_sources()}
    assert folders == set(ROOMS)
    assert len(ROOMS) == len(set(ROOMS))


def test_imports_go_from_higher_rooms_to_lower_ones():
    assert list(wrong_ways(ROOMS, all_sources())) == []
    for package, others in ((BELOW, PACKAGES), ("trees", PACKAGES[1:]), ("integrators", ("trees", "bseries"))):
        for name, tree in all_sources().items():
            if name.split(".")[0] == package:
                assert not {used.split(".")[0] for used in imports(tree, all_sources())} & set(others), name


def test_there_are_no_circles_of_imports():
    assert circles(all_sources(), types=True) == []


def test_wrong_imports_would_be_found():
    low, high = "from trees.high.b import f", "def g():\n    from trees.low.a import f"
    sources = {name: ast.parse(text) for name, text in {"trees.low.a": low, "trees.high.b": high}.items()}
    sources |= {"trees.low": ast.parse(""), "trees.high": ast.parse("")}
    assert list(wrong_ways(["trees.low", "trees.high"], sources)) == [("trees.low.a", "trees.high.b")]
    assert circles(sources, types=False) == [["trees.high.b", "trees.low.a"]]
    assert room_of("trees.low", sources) == room_of("trees.low.a", sources) == "trees.low"
    module = ast.parse("def f(text):\n    return sympy.sympify(text), eval(text), sympy.sympify(1, strict=True)")
    assert sorted(evaluations(module)) == ["eval", "sympify"]
    assert read_rooms("| room |\n| `trees` | a |\n| `trees.hopf` | b |\n") == ["trees", "trees.hopf"]


def test_no_text_is_evaluated_and_files_are_whole_but_not_long():
    for name, tree in all_sources().items():
        assert not list(evaluations(tree)), name
        lines = max((node.end_lineno for node in tree.body), default=0)
        assert lines <= MOST_LINES, name


def test_machine_code_is_kept_in_one_way():
    """Numba's own cache needs a place to write, and trusts what it finds there."""
    for package in (BELOW, *PACKAGES):
        for path in (ROOT / package).rglob("*.py"):
            assert "cache=True" not in path.read_text(encoding="utf-8"), path


def test_public_names_resolve_and_are_documented_with_an_example():
    for package, name, thing in public_objects():
        if (package, name) == ("bseries", "errors"):
            continue
        doc = inspect.getdoc(thing)
        assert doc, name
        assert ">>> " in doc or (isinstance(thing, type) and issubclass(thing, Exception)), name


def test_stub_and_runtime_list_the_same_names():
    assert {"bseries", "bseries.analysis.stability", "trees.hopf"} < set(STUBS)
    for package in STUBS:
        module = importlib.import_module(package)
        own = sorted(public_names(package))
        assert own == sorted(module.__all__)
        assert set(module.__all__) <= set(dir(module))


def test_names_at_the_top_are_few_and_all_others_are_one_level_down():
    top = set(public_names("bseries"))
    assert len(top) <= 90
    places = [name for name in top if inspect.ismodule(getattr(bseries, name))]
    below = {name for place in places for name in vars(getattr(bseries, place))["__all__"]}
    assert below | top >= {name for package in STUBS for name in public_names(package)}


def test_no_room_hides_a_public_function():
    """Importing `bseries.series.x` would put the module `series` where the function `bseries.series` is looked up."""
    functions = {name for _, name, thing in public_objects() if inspect.isfunction(thing)}
    assert "modified_equation" in functions
    assert not functions & {name.split(".")[1] for name in all_sources() if "." in name}


@pytest.mark.parametrize(
    "code",
    [
        "import bseries",
        "import bseries as bs; bs.modified_equation(bs.method('rk4'), 6)",
        "import bseries as bs; bs.modified_equation(bs.method('gauss3'), 6)",
        "import bseries as bs; bs.modified_equation(bs.method('stormer-verlet'), 4)",
        "import bseries as bs; str(bs.modified_equation(bs.RungeKutta([[0, 0], ['1/2', 0]], [0, 1]), 6))",
    ],
)
def test_the_common_path_imports_nothing_heavy(code):
    script = f"{code}\nimport sys\nprint(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert not HEAVY & set(loaded.split())


def test_lower_bounds_are_those_that_are_tested():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    required = [*project["dependencies"], *(x for extra in project["optional-dependencies"].values() for x in extra)]
    bounds = {re.split("[;,]", bound)[0].replace(">=", "==") for bound in required if ">=" in bound}
    lines = (ROOT / "tests" / "minimum.txt").read_text(encoding="utf-8").splitlines()
    assert bounds == {line for line in lines if not line.startswith("#")}


def test_every_room_is_distributed():
    setuptools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    assert setuptools["packages"]["find"]["include"] == [f"{package}*" for package in (BELOW, *PACKAGES)]
    for package in (BELOW, *PACKAGES):
        for path in (ROOT / package).rglob("*.py"):
            assert (path.parent / "__init__.py").is_file(), path


@pytest.mark.minimum
def test_public_names_win_over_modules_of_the_same_name():
    """In whatever order they are loaded: lazy-loader before 0.6 left the module where it was imported first."""
    code = """
import bseries.auditing.corrections, bseries.hamiltonians.energy_drift, bseries.shadow.energy_log
import bseries as bs
print(*(type(x).__name__ for x in (bs.auditing.corrections, bs.hamiltonians.energy_drift, bs.shadow.energy_log)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["function"] * 3
