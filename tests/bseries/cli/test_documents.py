"""What the command and `to_dict` write, against the published JSON Schema."""

from __future__ import annotations

import importlib
import json
import re
import shlex
import tomllib
from functools import cache
from pathlib import Path

import pytest

import bseries as bs
import integrators
from bseries.algebra.presentation import KINDS
from bseries.course.answers import check_answers
from bseries.document_schemas import FILE, SHARED
from bseries.scene_text import head
from integrators.methods.kinds.files import WITH_MEMORY

ROOT = Path(__file__).parents[3]
WITHOUT_KIND = {"tableau", "scene-file", "verdict"}
COMMANDS = {
    "series rk4 --order 4": "series",
    "series tsit5 --order 4": "series",
    "series tsit5 --order 3 --float": "series",
    "series --A 0 --b 1/2 --order 3": "series",
    "compose rk4 heun2 --order 3": "series",
    "modified stormer-verlet --order 3 --nonzero": "modified",
    "modified sdirk2 --order 3": "modified",
    "modified rk4 --order 4 --max-children 2": "modified",
    "modifying gauss2 --order 4": "modifying",
    "trees --order 4 --colors 2": "trees",
    "trees --count --order 6": "tree-counts",
    "conditions runge-kutta --order 4 --assume 'C2'": "conditions",
    "conditions partitioned --order 3": "conditions",
    "check rk4": "check",
    "check sdirk2": "check",
    "check crouzeix3 --nonzero": "check",
    "check strang": "check",
    "check tsit5 --order 5": "check",
    "methods": "methods",
    "methods strang": "method",
    "methods avf": "method",
    "methods gauss3": "tableau",
    "methods sdirk2": "tableau",
    "methods dop853": "tableau",
    "methods williamson3": "tableau",
    "methods parsani53": "tableau",
    "check ssprk33": "check",
    "methods stormer-verlet": "tableau",
    "scenes": "scenes",
    "scenes kepler --effect oblateness": "scene",
    "scenes lotka-volterra": "scene",
    "equation rk4 --scene pendulum --order 3 --effect damping": "equation",
    "equation tsit5 --scene riccati --order 3 --modifying": "equation",
    "hamiltonian stormer-verlet --scene pendulum --order 3": "hamiltonian",
    "hamiltonian rk4 --scene pendulum --order 4": "hamiltonian",
    "hamiltonian rk4 --scene pendulum --order 5 --verdict": "hamiltonian-verdict",
    "hamiltonian strang --brackets --order 4 --nonzero": "brackets",
    "drift rk4 --scene pendulum --start p=5/2;q=0 --step 1/10 --order 6": "drift",
    "drift rk4 --scene henon-heiles --step 0.1 --steps 600": "drift",
    "drift gauss2 --scene pendulum": "drift",
    "simulate pendulum --method rk4 --step 1/10 --steps 20": "simulation",
    "simulate pendulum --method rk4 --step 1/10 --steps 20 --predict": "simulation",
    "simulate pendulum --method rk4 --step 1/10 --steps 20 --ensemble 3 --temperature 1/2": "ensemble",
    "effects pendulum --method rk4 --effect damping --step 1/20 --span 1": "effects",
    "effects pendulum --method rk4 --effect damping --step 1/20 --order 3": "effect-costs",
    "cost pendulum --methods rk4 --span 2 --errors 1e-2:1e-3 --error 1e-2": "work-precision",
}


def trajectory():
    return bs.integrate("stormer-verlet", "pendulum", h=0.1, steps=300)


def rotor():
    scene = bs.Scene({"a": 1, "theta": 1}, hamiltonian="a^2/2 + eps*cos(theta)", parameters={"eps": "1/9"})
    return bs.hamiltonians.lindstedt_poincare(scene, 2)


OBJECTS = {
    "audit": lambda: bs.audit({"euler.py": "# first-order method\nA = [[0]]\nb = [1]"}),
    "answers": lambda: check_answers("1d = no\n4c = 1/3\n7a = f"),
    "closed-hamiltonian": lambda: bs.hamiltonians.closed_hamiltonian("symplectic-euler-p", "harmonic-oscillator"),
    "field": lambda: bs.series("rk4", 3).log(),
    "error-coefficients": lambda: bs.analysis.error_coefficients("rk4"),
    "general-linear": lambda: bs.memory.bdf(2).to_general_linear(),
    "generating-function": lambda: bs.hamiltonians.generating_function("implicit-midpoint", "pendulum", 3),
    "linear-multistep": lambda: bs.method("ab2"),
    "invariant": lambda: bs.modified_invariant(bs.modified_field("symplectic-euler-p", "lotka-volterra", 3)),
    "normal-form": rotor,
    "prediction": lambda: bs.predict_run("stormer-verlet", "pendulum", h=0.1, steps=100, timed=False),
    "reach": lambda: bs.fields.reach(bs.modified_field("stormer-verlet", "pendulum", 5), [0.0, 1.0], 0.1),
    "recommendation": lambda: bs.work_precision("rk4", "pendulum", span=2, errors=(1e-1, 1e-2)).best(1e-1),
    "two-step-runge-kutta": lambda: bs.TwoStepRungeKutta([0], 0, [[0]], ["3/2"], [[0]], ["-1/2"]),
    "scene-file": lambda: bs.scene("outer-solar-system"),
    "shadow": lambda: bs.shadow_energy(trajectory(), order=4),
    "energy-log": lambda: bs.shadow.energy_log([f"{k % 7}" for k in range(600)]),
    "tableau": lambda: bs.method("lobatto-iiia-iiib3"),
    "tableau-comparison": lambda: bs.auditing.compare({"a.py": "A = [[0]]\nb = [1]"}, {"a.py": "A = [[0]]\nb = [2]"}),
    "trajectory": trajectory,
    "verdict": lambda: bs.symplecticity("rk4", 5),
}
TABLES_ONLY = {"trajectory"}


def kinds():
    return {name for name in bs.json_schema()["$defs"] if not name.startswith(SHARED)}


def json_schemas():
    """The package, loaded where a test needs it: it builds grammars for a second, and both workers load this file."""
    return importlib.import_module("jsonschema")


@cache
def validator(kind=None):
    return json_schemas().Draft202012Validator(bs.json_schema(kind))


def check(document, kind):
    """Validate a document with the schema of its kind and with the schema of all kinds."""
    validator(kind).validate(document)
    validator().validate(document)
    assert document.get("kind", kind) == kind


def test_the_schema_is_one():
    json_schemas().Draft202012Validator.check_schema(bs.json_schema())
    text = (ROOT / "bseries" / FILE).read_text(encoding="utf-8")
    named, defined = set(re.findall(r"#/\$defs/([\w-]+)", text)), set(bs.json_schema()["$defs"])
    assert named == defined


def test_all_kinds_in_the_code_have_a_schema():
    pattern = r'"kind": "([\w-]+)"|\bhead\(\s*"([\w-]+)"'
    sources = (path.read_text(encoding="utf-8") for room in ("trees", "integrators", "bseries")
               for path in (ROOT / room).rglob("*.py"))  # fmt: skip
    written = {one or other for source in sources for one, other in re.findall(pattern, source)}
    assert head("x", "rk4", bs.scene("pendulum"))["kind"] == "x"
    assert kinds() == written | set(KINDS) | set(WITH_MEMORY) | WITHOUT_KIND
    assert kinds() == set(COMMANDS.values()) | set(OBJECTS)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_command_keeps_to_the_schema(run, command):
    result = run(*shlex.split(command.replace(";", "\\;")), "--format", "json")
    assert result.exit_code == 0, result.output
    check(json.loads(result.stdout), COMMANDS[command])


@pytest.mark.parametrize("kind", OBJECTS)
def test_objects_keep_to_the_schema(kind):
    found = OBJECTS[kind]()
    document = json.loads(found.to_table().to_json()) if kind in TABLES_ONLY else found.to_dict()
    check(json.loads(json.dumps(document)), kind)


def test_every_tableau_and_every_scene_of_the_catalogues():
    for entry in bs.catalogue():
        method = bs.method(f"{entry.name}{entry.least_stages + 1 if entry.is_family else ''}")
        kind = "tableau" if isinstance(method, bs.RungeKutta | bs.PartitionedRungeKutta) else method.to_dict()["kind"]
        validator(kind).validate(json.loads(json.dumps(method.to_dict())))
    for entry in integrators.scene_catalogue():
        validator("scene-file").validate(json.loads(json.dumps(entry.build().to_dict())))


def test_a_changed_document_is_refused():
    document = bs.series("rk4", 3).to_dict()
    wrong = [
        document | {"kind": "modified"},
        document | {"schema": 2},
        document | {"order": "3"},
        document | {"further": 1},
        {key: value for key, value in document.items() if key != "terms"},
        document | {"terms": [{**document["terms"][0], "coefficient": 1}]},
        document | {"terms": [{}]},
    ]
    for other in wrong:
        with pytest.raises(json_schemas().ValidationError):
            validator("series").validate(other)


def test_other_kinds_are_refused_with_a_suggestion():
    with pytest.raises(bs.SeriesError, match=r"kind must be one of answers, .*, but was 'serie'; did you mean series"):
        bs.json_schema("serie")
    for wrong in (3, "shared-tree", ""):
        with pytest.raises(bs.SeriesError, match="kind must be one of"):
            bs.json_schema(wrong)


def test_schemas_are_copies():
    bs.json_schema()["$defs"].clear()
    assert kinds()


def test_the_schema_is_distributed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "*.schema.json" in project["tool"]["setuptools"]["package-data"]["*"]
