"""Scene files: everything comes back equal, and bad files and failed writes do no harm."""

from __future__ import annotations

import io
import json
import os
import tomllib

import pytest
import sympy

from integrators import Effect, IntegratorError, Scene, Term, load_scene, save_scene, scene, scene_catalogue
from integrators.core.text_files import MAX_BYTES
from integrators.scenes.text import loads_scene

pytestmark = pytest.mark.minimum

PENDULUM = """
name = "pendulum"
variables = {p = 1, q = 1}          # block = dimension, in the order of the state
hamiltonian = "p^2/2 - cos(q)"      # or [field] p = "…", q = "…"
[start]
p = [0.0]
q = [-1.5]
[invariants]
[effects.damping]
field = {p = "-gamma*p"}
parameters = {gamma = 0.1}
[effects.asymmetry]
hamiltonian = "0.2*sin(2*q)"
"""
EVERYTHING = Scene(
    {"p": [2, 2], "q": [2, 2], "z": ["u", "v"]},
    hamiltonian="px1^2*qx1 + k*exp(1)",
    field={"u": "v", "v": 0, "px1": "sqrt(2)*cos(t)/7"},
    terms=[
        Term(over="each", hamiltonian="(px_i^2 + py_i^2)/(2*m_i)", part="kinetic"),
        Term(over=[(1, 2), (2, 2)], field={"px_i": "qx_j", "py_j": "c*qx_i*t"}),
        Term(field={"u": "u^3"}, part="cubic"),
    ],
    parameters={"m": [1, "1/3"], "k": 0.25, "c": "c"},
    start={"p": [[1, 2], ["sqrt(3)", 10**30]], "q": [[0.1, -2], [3, "pi"]], "z": [1, 0], "t": 4},
    invariants={"a name": "v", "Ω": "exp(v) - t/2"},
    positive=["qx1 + 1", "m2"],
    effects={
        "bath": Effect(
            field={"u": "-xi*u"}, terms=[Term(field={"xi": "u^2 - T"})], variables={"xi": 1}, parameters={"T": "1/2"},
            start={"xi": 3}, breaks=["Ω"], summary="a “bath”",
        ),
        "spring": Effect(terms=[Term(over="ring", hamiltonian="(qx_i - qx_j)^2")]),
    },
    active=["bath"],
    name="everything",
    summary="one of each",
    reference="here",
)  # fmt: skip


def catalogue():
    """Every built-in scene, plain and with all effects that it has."""
    for entry in scene_catalogue():
        plain = scene(entry.name)
        yield pytest.param(plain, id=entry.name)
        if plain.effects:
            yield pytest.param(plain.with_effects(*plain.effects), id=f"{entry.name} with effects")


@pytest.mark.few(8)
@pytest.mark.parametrize("original", [pytest.param(EVERYTHING, id="everything"), *catalogue()])
def test_saved_scenes_come_back(original, tmp_path):
    path = tmp_path / "scene.toml"
    save_scene(original, path)
    with path.open("rb") as file:
        found = [load_scene(path), load_scene(str(path)), load_scene(file), loads_scene(original.to_toml())]
    found.append(load_scene(io.StringIO(path.read_text("utf-8"))))
    for other in found:
        assert other == original
        assert hash(other) == hash(original)
        assert (other.name, other.summary, other.reference) == (original.name, original.summary, original.reference)
        assert other.active == original.active
        assert [e.summary for e in other.effects.values()] == [e.summary for e in original.effects.values()]
    assert os.listdir(tmp_path) == ["scene.toml"]
    assert tomllib.loads(original.to_toml()) == json.loads(json.dumps(original.to_dict()))


def test_a_file_as_people_write_it_is_the_scene_in_python():
    found = loads_scene(PENDULUM)
    assert found == Scene(
        {"p": 1, "q": 1},
        hamiltonian="p**2/2 - cos(q)",
        start={"p": 0, "q": "-3/2"},
        effects={
            "damping": Effect(field={"p": "-gamma*p"}, parameters={"gamma": sympy.Rational(1, 10)}),
            "asymmetry": Effect(hamiltonian=sympy.sin(2 * sympy.Symbol("q")) / 5),
        },
    )
    assert found.name == "pendulum"
    assert found.with_effects("damping").field == scene("pendulum", effects=["damping"]).field


def test_numbers_in_files_are_the_decimals_they_spell():
    found = loads_scene('variables = {y = 1}\nfield = {y = 0.1}\nstart = {y = 1e-3}\nparameters = {k = "sqrt(2)"}')
    assert found.field == (sympy.Rational(1, 10),)
    assert found.start == (sympy.Rational(1, 1000),)
    assert found.parameters["k"] == sympy.sqrt(2)


def test_long_sums_go_on_in_further_terms():
    names = [f"{'long' * 20}{k}" for k in range(150)]
    total = sympy.Add(*(sympy.Symbol(name) ** 2 * (k + 1) for k, name in enumerate(names)))
    original = Scene({"z": names}, field={**dict.fromkeys(names, 0), names[0]: total})
    assert [len(term["field"]) for term in original.to_dict()["terms"]] == [1]
    assert loads_scene(original.to_toml()) == original
    with pytest.raises(
        IntegratorError, match=r"invariants\.long must have at most 10000 characters in a file, but had"
    ):
        Scene({"z": names}, field=dict.fromkeys(names, 0), invariants={"long": total}).to_toml()


def test_zero_equations_and_zero_hamiltonians_come_back():
    for original in (Scene({"y": 2}, field={"y1": 0, "y2": 0}), Scene({"p": 1, "q": 1}, hamiltonian=0)):
        assert loads_scene(original.to_toml()) == original


BAD = {
    "no TOML": ("variables = ", "content must be TOML, but was not"),
    "two keys": ("variables = {y = 1}\nvariables = {y = 1}", "content must be TOML"),
    "empty": ("", "content must have the key variables, but had none"),
    "unknown key": (
        "variable = {y = 1}",
        r"must have the keys .* only, but had 'variable'; did you mean variables\?",
    ),
    "odd key": ("variables = {y = 1}\nzzz = 1", "but had 'zzz'$"),
    "effects": ("variables = {y = 1}\neffects = 3", "effects must map names to tables, but was 3"),
    "effect": ("variables = {y = 1}\neffects.a = 3", "effects.a must be a table of keys and values, but was 3"),
    "effect key": ("variables = {y = 1}\n[effects.a]\nfeld = {y = 1}", r"effects.a .* 'feld'; did you mean field\?"),
    "empty effect": ('variables = {y = 1}\n[effects.a]\nsummary = "s"', "effects.a: an effect must have a hamiltonian"),
    "terms": ("variables = {y = 1}\nterms = 3", "terms must be a sequence, but was 3"),
    "term": ("variables = {y = 1}\nterms = [3]", r"terms\[1\] must be a table of keys and values"),
    "term key": (
        'variables = {y = 1}\n[[terms]]\nform = "y"',
        r"terms\[1\] must have the keys over, .* but had 'form'",
    ),
    "empty term": ('variables = {y = 1}\n[[terms]]\nover = "each"', r"terms\[1\]: a term must have either"),
    "effect term": ("variables = {y = 1}\n[[effects.a.terms]]\nover = 3", r"effects.a.terms\[1\]: a term must have"),
    "formula": (
        'variables = {y = 1}\nfield = {y = "z"}',
        "field.y must be a formula in y, t, but has the unknown name 'z'",
    ),
    "number": ("variables = {y = 1}\nfield = {y = 1}\nstart = {y = nan}", r"start.y\[1\] .* not finite"),
    "truth": ("variables = {y = 1}\nfield = {y = true}", "field.y must be a formula or a number, but was True"),
    "date": ("variables = {y = 1}\nfield = {y = 2020-01-01}", "field.y must be a formula or a number"),
    "size": ("variables = {y = 1.5}\nfield = {y = 1}", "variables.y must be a number, a pair"),
    "active": ('variables = {y = 1}\nfield = {y = 1}\nactive = ["a"]', "there is no effect 'a'"),
    "label": ("variables = {y = 1}\nfield = {y = 1}\nname = 3", "name must be text, but was 3"),
    "integral where the field is singular": (
        'variables = {y = 1}\nfield = {y = "1/(sin(y)^2 + cos(y)^2 - 1)"}\ninvariants = {c = "y"}',
        "field and invariants of scene must be defined near the start, but were not at one point$",
    ),
    "integral": ('variables = {y = 1}\nfield = {y = "y"}\ninvariants = {c = "y"}', "along the field, but c is not$"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_bad_files_are_refused_in_one_sentence(text, message):
    with pytest.raises(IntegratorError, match=message) as caught:
        loads_scene(text, source="scene.toml")
    assert str(caught.value).startswith("scene.toml: ")


def test_deep_nesting_is_refused():
    with pytest.raises(IntegratorError, match=r"scene\.toml: (nesting must be flat|content must be TOML)"):
        loads_scene("variables = " + "[" * 5000 + "]" * 5000, source="scene.toml")


def test_effects_in_files_say_which_integrals_they_break():
    text = PENDULUM.replace("[invariants]", '[invariants]\nenergy = "p^2/2 - cos(q)"')
    with pytest.raises(IntegratorError, match="but energy is not with the effect damping, whose breaks should name it"):
        loads_scene(text)
    text = text.replace("parameters =", 'breaks = ["energy"]\nparameters =')
    text = text.replace('hamiltonian = "0.2*sin(2*q)"', 'hamiltonian = "0.2*sin(2*q)"\nbreaks = ["energy"]')
    assert list(loads_scene(text).invariants) == ["energy"]
    assert list(loads_scene(text).with_effects("asymmetry").invariants) == []


def test_integrals_of_symbols_and_of_very_large_fields_are_not_checked():
    assert loads_scene('variables = {y = 1}\nfield = {y = "k"}\nparameters = {k = "k"}\ninvariants = {c = "y"}')
    sizes = 'variables = {p = 400, q = 400}\nterms = [{over = "each", hamiltonian = "p_i^2"}, {over = "pairs", '
    assert loads_scene(sizes + 'hamiltonian = "(q_i - q_j)^2"}]\ninvariants = {c = "q1"}').dimension == 800


def test_files_that_cannot_be_read_or_written(tmp_path):
    with pytest.raises(IntegratorError, match="must be a readable file, but was not: No such file"):
        load_scene(tmp_path / "none.toml")
    with pytest.raises(IntegratorError, match="source must be a path or an open file, but was 3"):
        load_scene(3)  # type: ignore[arg-type]
    with pytest.raises(IntegratorError, match=f"must have at most {MAX_BYTES} bytes"):
        load_scene(io.BytesIO(b"#" * (MAX_BYTES + 1)))
    with pytest.raises(IntegratorError, match="must be a writable file, but was not"):
        save_scene(EVERYTHING, tmp_path / "none" / "scene.toml")
    path = tmp_path / "scene.toml"
    path.write_text("precious")
    names = [f"{'long' * 20}{k}" for k in range(150)]
    long = Scene({"z": names}, field=dict.fromkeys(names, 0), invariants={"long": sum(map(sympy.Symbol, names))})
    with pytest.raises(IntegratorError, match="at most 10000 characters"):
        save_scene(long, path)
    assert path.read_text() == "precious"
    assert os.listdir(tmp_path) == ["scene.toml"]
