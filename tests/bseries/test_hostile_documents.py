"""Documents and forms written by hostile hands: sentences in place of tracebacks; and results that travel by pickle."""

from __future__ import annotations

import json
import pickle
import random
import re

import numpy as np
import pytest

import bseries as bs
from bseries.explorer.reading import read_method
from bseries.figures.registry import figure
from integrators.core.stored_arrays import write_arrays
from integrators.methods.exchange.formats import FORMATS
from integrators.methods.exchange.tableaus import export_tableau, import_tableau
from integrators.runs.storage import checksum
from integrators.scenes.text import loads_scene

UNSHOWN = ("\ud800x", "a\x1b[31m", "\x00", "a\x07", "a\u2028b", "\x85")
SPACES = "\xa0\u3000\t\r\n "
CONTROL = "\x1c\x1d\x1e\x1f\x85\u2028\x0b\x0c\0\x1b\x7f"


def refused(call, *arguments, match=None, **options):
    """The one sentence of an error of ours, which every encoding has."""
    with pytest.raises(bs.errors, match=match) as caught:
        call(*arguments, **options)
    str(caught.value).encode()
    assert "\x1b" not in str(caught.value)


@pytest.mark.parametrize("space", SPACES, ids=ascii)
def test_spaces_of_any_kind_around_levels(space):
    assert bs.Tree(f"[{space}0{space},{space}1{space}]") == bs.Tree("[0,1]")


@pytest.mark.parametrize("text", ["[0{},1]", "[0,1]{}", "{}[0,1]", "[τ,{}τ]", "p[q{}]", "[0,1]:[0,{}1]"])
@pytest.mark.parametrize("character", CONTROL, ids=ascii)
def test_control_characters_are_no_spaces_in_trees(character, text):
    place = f"has the control character {character!a} at position {text.index('{') + 1}"
    refused(bs.Tree, text.format(character), match=re.escape(place))


@pytest.mark.parametrize("text", UNSHOWN, ids=ascii)
def test_names_that_cannot_be_shown_are_refused_on_reading(text, tmp_path):
    refused(bs.RungeKutta, [[0]], [1], name=text, match="name must be text that can be shown")
    refused(bs.RungeKutta, [[0]], [1], reference=text, match="reference must be text that can be shown")
    refused(bs.Scene, {"y": 1}, field={"y": "1"}, name=text, match="name must be text that can be shown")
    refused(bs.Scene, {"y": 1}, field={"y": "1"}, invariants={text: "1"}, match="names of invariants and effects")
    effects = {text: bs.Effect(field={"y": "1"})}
    refused(bs.Scene, {"y": 1}, field={"y": "1"}, effects=effects, match="names of invariants and effects")
    path = tmp_path / "method.json"
    path.write_text(json.dumps({"name": text, "A": [[0]], "b": [1]}), encoding="utf-8")
    refused(bs.load_method, path)
    series = bs.modified_equation("rk4", 3).to_dict() | {"method": text}
    refused(bs.load_series, json.dumps(series), match="method must be text that can be shown")


def test_longer_texts_may_have_several_lines():
    text = "line one\n\tline two\r\n"
    assert bs.RungeKutta([[0]], [1], reference=text).reference == text
    assert loads_scene(bs.Scene({"y": 1}, field={"y": "1"}, summary=text).to_toml()).summary == text
    refused(bs.RungeKutta, [[0]], [1], name="line one\nline two", match="name must be text that can be shown")


@pytest.mark.parametrize("text", ["; ;", "|;|", " | \n", "\n\n", ";|1", "0 0; 1; 0 1", "\x85\n\x85"])
def test_ragged_and_empty_rows_in_the_explorer(text):
    refused(read_method, text)


def test_random_rows_in_the_explorer():
    chance = random.Random(5)
    for _ in range(300):
        text = "".join(chance.choice("01/2 |;\n,=()[]{}\x1c\x85.-e") for _ in range(chance.randint(1, 30)))
        try:
            read_method(text)
        except bs.errors as error:
            str(error).encode()


@pytest.mark.parametrize("text", ["cos(gamma)", "sin(pi*gamma)", "cos(1)", "tan(2*gamma) + 1/cos(gamma)", "exp(gamma)"])
def test_series_of_transcendental_coefficients_are_read(text):
    document = bs.modified_equation("rk4", 3).to_dict() | {"domain": "EX"}
    document["terms"][1] = document["terms"][1] | {"coefficient": text}
    read = bs.load_series(json.dumps(document))
    assert str(read[read.table[1]]) == text
    assert bs.load_series(json.dumps(read.to_dict())) == read


def ensemble_file(path, drop=(), **changes):
    bs.ensemble("rk4", bs.scene("pendulum"), h=0.1, steps=4, y0=[[0, 1], [0, 2]]).save(path)
    with np.load(path) as stored:
        arrays = dict(stored)
    head = json.loads(str(arrays["head"]))
    for place in drop:
        inside = head["meta"] if len(place) == 1 else head["meta"][place[0]]
        del inside[place[-1]]
    write_arrays(path, arrays | {"head": json.dumps(head | {"meta": head["meta"] | changes})})
    return path


@pytest.mark.parametrize("place", [("h",), ("steps",), ("change",), ("method",), ("method", "name"), ("scene", "name")])
def test_ensembles_without_what_their_tables_need_are_refused(place, tmp_path):
    refused(bs.integrators.load_ensemble, ensemble_file(tmp_path / "out.npz", [place]), match="file of an ensemble")


def test_ensembles_with_other_lengths_are_refused(tmp_path):
    refused(
        bs.integrators.load_ensemble, ensemble_file(tmp_path / "out.npz", change=[]), match="an entry for each of 1"
    )
    str(bs.integrators.load_ensemble(ensemble_file(tmp_path / "whole.npz")))


@pytest.mark.parametrize("dtype", ["float16", "float32", ">f8", "int8", "uint64"])
def test_times_of_any_type_are_doubles(dtype, tmp_path):
    path = tmp_path / "run.npz"
    times = {name: np.arange(4).astype(dtype) for name in ("t", "observed_t")}
    write_arrays(path, {**times, "y": np.ones((1, 4)), "h": 1.0, "variables": ["y"], "observed/a": np.ones(4)})
    run = bs.load_trajectory(path)
    assert run.t.dtype == run.observed_t.dtype == np.dtype(float)
    run.observed_t = run.t
    pytest.importorskip("pandas")
    assert list(run.to_pandas().index) == [0.0, 1.0, 2.0, 3.0]


def test_checksums_depend_on_types_names_and_shapes():
    x = np.arange(6.0)
    variants = [{"a": x}, {"a": x.view(">f8")}, {"a": x.view("i8")}, {"a": x.reshape(2, 3)}, {"b": x}, {"a": x[:5]}]
    assert len({checksum(arrays) for arrays in variants}) == len(variants)
    assert checksum({"a": x}) == checksum({"a": x.copy()})


def test_a_checkpoint_in_another_byte_order_is_refused(tmp_path):
    path, arguments = tmp_path / "run.checkpoint", {"h": 0.1, "checkpoint": tmp_path / "run.checkpoint"}

    def stop(done, total):
        if done > 100:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bs.integrate("rk4", "pendulum", steps=10**6, save_every=10**5, progress=stop, checkpoint_every=0, **arguments)
    with np.load(path) as stored:
        arrays = dict(stored)
    write_arrays(path, arrays | {"carry": arrays["carry"].view(">f8")})
    refused(bs.integrate, "rk4", "pendulum", steps=10**6, save_every=10**5, **arguments, match="not written by a run")


RESULTS = {
    "drift": lambda: bs.energy_drift("rk4", "pendulum", y0=[2.5, 0], h=0.1),
    "catalogue": bs.catalogue,
    "scenes": bs.scene_catalogue,
    "stepper": lambda: bs.stepper("rk4", "pendulum"),
    "series table": lambda: bs.modified_equation("rk4", 3).to_table(),
    "report table": lambda: bs.check("rk4").to_table(),
    "field table": lambda: bs.modified_field("rk4", "pendulum", 3).to_table(),
    "hamiltonian table": lambda: bs.modified_hamiltonian("gauss2", "pendulum", 3).to_table(),
    "scene table": lambda: bs.scene("kepler").to_table(),
    "run table": lambda: bs.integrate("rk4", "pendulum", h=0.1, steps=3, observe="energy").to_table(),
    "conditions table": lambda: bs.order_conditions("runge-kutta", 3).to_table(),
}


@pytest.mark.parametrize("name", RESULTS)
def test_results_travel_by_pickle(name):
    result = RESULTS[name]()
    copy = pickle.loads(pickle.dumps(result))
    if hasattr(result, "to_csv"):
        for write in ("to_text", "to_markdown", "to_latex", "to_html", "to_json"):
            assert getattr(copy, write)() == getattr(result, write)()
        assert list(copy.to_csv()) == list(result.to_csv())
    elif hasattr(result, "start"):
        state, other = result.start(h=0.1), copy.start(h=0.1)
        result.advance(state, 5)
        copy.advance(other, 5)
        assert np.array_equal(state.y, other.y)
        pickle.loads(pickle.dumps(result))  # also after its first use
    else:
        assert str(copy) == str(result)


def test_an_animation_interrupted_before_its_first_frame(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    drawn = figure("area-patch")
    file = drawn.animate.args[0]

    def frames(numbers, where):
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(file, "frames", frames)
    with pytest.raises(KeyboardInterrupt):
        drawn.animate(tmp_path / "patch.gif")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("format_", [name for name in FORMATS if name != "scipy"])
def test_exchanged_text_with_surrogates_and_control_characters(format_):
    text, chance = export_tableau("rk4", format_), random.Random(7)
    for _ in range(60):
        at = chance.randint(0, len(text))
        character = chance.choice(["\ud800", "\x1b", "\x1c", "\0", "\x85", "\u2028"])
        try:
            import_tableau(text[:at] + character + text[at:], format_)
        except bs.IntegratorError as error:
            str(error).encode()
