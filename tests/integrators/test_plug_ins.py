"""Methods and scenes of other distributions: a fake one on the path, in a fresh process."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
MODULE = """
from functools import partial
from integrators import MethodEntry, RungeKutta, SceneEntry, parse_hamiltonian

def quartic(*, k=1):
    return parse_hamiltonian("p^2/2 + k*q^4/4", parameters={"k": k}, start="p=0; q=1")

def broken():
    raise RuntimeError("no quartic today")

build = partial(RungeKutta, [[0, 0], ["2/3", 0]], ["1/4", "3/4"])
METHODS = [MethodEntry("their-method", "explicit", 2, 2, "order 2", "a source", build, aliases=("theirs",))]
TAKEN = [MethodEntry("rk_4", "explicit", 2, 2, "order 2", "a source", build)]
UNKNOWN_KIND = [MethodEntry("other", "magic", 2, 2, "order 2", "a source", build)]
SCENES = (SceneEntry("their-scene", quartic, "a quartic oscillator", "a source"),)
BROKEN_SCENE = (SceneEntry("broken", broken, "a scene that cannot be built", "a source"),)
"""


@pytest.fixture
def run(tmp_path):
    """Run a script where a distribution has some entry points; its output and its warnings."""
    (tmp_path / "their_module.py").write_text(MODULE, encoding="utf-8")
    distribution = tmp_path / "theirs-1.0.dist-info"
    distribution.mkdir()
    (distribution / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n", encoding="utf-8")

    def run(points, script):
        (distribution / "entry_points.txt").write_text(points, encoding="utf-8")
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(tmp_path)])}
        command = [sys.executable, "-c", f"import bseries as bs\n{script}"]
        done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout.split("\n")[:-1], [line for line in done.stderr.split("\n") if "Warning: " in line]

    return run


GOOD = "[bseries.methods]\ngood = their_module:METHODS\n[bseries.scenes]\ngood = their_module:SCENES\n"


def test_methods_and_scenes_of_a_distribution_are_in_the_catalogues(run):
    script = """
    print(bs.order_of(bs.method("Their_Method")), bs.method("theirs").b, bs.scene("their-scene", k=2).field)
    print("their-method" in [e.name for e in bs.catalogue()], "their-scene" in [e.name for e in bs.scene_catalogue()])
    print(bs.integrate("theirs", bs.scene("their-scene"), h=0.1, steps=2).t[-1])
    """.replace("\n    ", "\n")
    output, warned = run(GOOD, script)
    assert output == ["2 (Fraction(1, 4), Fraction(3, 4)) (-2*q**3, p)", "True True", "0.2"]
    assert warned == []


BROKEN = [
    ("methods", "no_such_module:METHODS", "No module named 'no_such_module'"),
    ("methods", "their_module:NOTHING", "module 'their_module' has no attribute 'NOTHING'"),
    ("methods", "their_module:build", "it must be a tuple or list of MethodEntry, but was functools.partial"),
    ("methods", "their_module:TAKEN", "its names must be new, but 'rk_4' was there already"),
    ("methods", "their_module:UNKNOWN_KIND", "kind of other must be one of explicit, "),
    ("scenes", "their_module:METHODS", "it must be a tuple or list of SceneEntry, but was [<MethodEntry: their"),
    ("scenes", "their_module:BROKEN_SCENE", "no quartic today"),
]


def test_a_broken_entry_point_gives_one_warning_and_the_others_are_there(run):
    points = GOOD
    for k, (group, value, _) in enumerate(BROKEN):
        points = points.replace(f"[bseries.{group}]", f"[bseries.{group}]\nbad{k} = {value}")
    script = "print(bs.scene('their-scene').name, bs.method('theirs').name, len(bs.catalogue()) > 50)"
    script += "\nbs.scene_catalogue(), bs.catalogue(), bs.method('their-method')"
    output, warned = run(points, script)
    assert output == ["their-scene their-method True"]
    assert len(warned) == len(BROKEN)
    for k, (group, _, reason) in enumerate(BROKEN):
        sentence = f"entry point 'bad{k}' of bseries.{group} in theirs must be usable, but was left out: {reason}"
        assert any(sentence in warning for warning in warned), warned


def test_built_in_names_do_not_read_entry_points(run):
    points = "[bseries.methods]\nbad = no_such_module:METHODS\n[bseries.scenes]\nbad = no_such_module:SCENES\n"
    script = "print(bs.method('rk4').name, bs.method('gauss3').name, bs.scene('pendulum').name)"
    assert run(points, script) == (["rk4 gauss3 pendulum"], [])
