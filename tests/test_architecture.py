"""The shape of the house: which package may know which, what is public, and what starting costs."""

import ast
import importlib
import inspect
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("trees", "integrators", "bseries")
SOURCES = [path for package in ("foundation", *PACKAGES) for path in sorted((ROOT / package).rglob("*.py"))]
HEAVY = {"numpy", "sympy", "numba", "networkx", "matplotlib", "scipy", "rich", "click"}


def name_of(path):
    return str(path.relative_to(ROOT))


def imported_packages(tree):
    """Names of the packages that a module imports, anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.split(".")[0]


def evaluations(tree):
    """Names of the functions that a module calls and that evaluate text; a strict `sympify` refuses text."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", None))
            strict = any(keyword.arg == "strict" and ast.unparse(keyword.value) == "True" for keyword in node.keywords)
            if name in {"eval", "exec", "parse_expr", "nsimplify"} or (name == "sympify" and not strict):
                yield name


def public_names(package):
    """The names that a package's stub re-exports or declares."""
    for node in ast.parse((ROOT / package / "__init__.pyi").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            yield from (alias.asname or alias.name for alias in node.names)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield node.target.id


PUBLIC = [(package, name) for package in PACKAGES for name in public_names(package)]
PUBLIC_OBJECTS = [pair for pair in PUBLIC if pair != ("bseries", "errors")]


@pytest.mark.parametrize(
    ("package", "others"),
    [("foundation", PACKAGES), ("trees", PACKAGES[1:]), ("integrators", ("trees", "bseries"))],
)
def test_arrows_between_packages_go_one_way(package, others):
    for path in (ROOT / package).rglob("*.py*"):
        if path.suffix in (".py", ".pyi"):
            found = set(imported_packages(ast.parse(path.read_text(encoding="utf-8"))))
            assert not found & set(others), name_of(path)


def test_forbidden_imports_and_calls_would_be_found():
    module = ast.parse(
        "def f(text):\n    from bseries.algebra.modified import series\n    return sympy.sympify(text), eval(text)"
    )
    assert list(imported_packages(module)) == ["bseries"]
    assert sorted(evaluations(module)) == ["eval", "sympify"]
    assert not list(evaluations(ast.parse("sympy.sympify(number, strict=True)")))


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_no_text_is_evaluated_and_files_stay_short(path):
    text = path.read_text(encoding="utf-8")
    assert not list(evaluations(ast.parse(text)))
    assert len(text.splitlines()) < 400


def test_machine_code_is_kept_in_one_way():
    """Numba's own cache needs a place to write, and trusts what it finds there."""
    assert [name_of(path) for path in SOURCES if "cache=True" in path.read_text(encoding="utf-8")] == []


@pytest.mark.parametrize(("package", "name"), PUBLIC)
def test_public_names_resolve(package, name):
    assert getattr(importlib.import_module(package), name) is not None


@pytest.mark.parametrize(("package", "name"), PUBLIC_OBJECTS)
def test_public_names_are_documented_with_an_example(package, name):
    thing = getattr(importlib.import_module(package), name)
    doc = inspect.getdoc(thing)
    assert doc
    assert ">>> " in doc or (isinstance(thing, type) and issubclass(thing, Exception))


@pytest.mark.parametrize("package", PACKAGES)
def test_stub_and_runtime_list_the_same_names(package):
    module = importlib.import_module(package)
    assert sorted(public_names(package)) == sorted(module.__all__)
    assert set(module.__all__) <= set(dir(module))


def test_no_module_bears_the_name_of_a_public_function():
    things = {name: getattr(importlib.import_module(package), name) for package, name in PUBLIC}
    functions = {name for name, thing in things.items() if inspect.isfunction(thing)}
    modules = {path.parent.name if path.name == "__init__.py" else path.stem for path in SOURCES}
    assert "modified_equation" in functions
    assert not functions & modules


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
    bounds = {bound.replace(">=", "==") for bound in required if ">=" in bound}
    lines = (ROOT / "tests" / "minimum.txt").read_text(encoding="utf-8").splitlines()
    assert bounds == {line for line in lines if not line.startswith("#")}


def test_every_package_is_distributed():
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["packages"]
    assert sorted(packages) == sorted(
        ".".join(path.parent.relative_to(ROOT).parts) for path in SOURCES if path.name == "__init__.py"
    )
