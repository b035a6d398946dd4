"""Which effects matter and what they cost: against exact solutions, other runs, scenes that never had an effect."""

from __future__ import annotations

import io
import json
import math
from functools import partial

import numpy as np
import pytest
import tomli_w

import bseries as bs
from bseries.advice.effects.costs import effect_variants
from bseries.advice.effects.influences import EffectRow, Influence, effects_to_leave_out
from bseries.advice.timing import Timing
from integrators.compile.scene_source import scene_source
from integrators.runs.observers import observers
from integrators.scenes.catalogue.gravity import BODIES, GRAVITATION

WITH_EFFECTS = [entry.name for entry in bs.scene_catalogue() if entry.effects]
DECLARED = [entry.name for entry in bs.scene_catalogue() if entry.effects and not entry.built_in_effects]

ADVISED = {
    "pendulum": ("rk4", 0.05, 5, 1e-3, {"gamma": "1e-4"}, ("damping",)),
    "kepler": ("rk4", 0.02, 6, 0.06, {}, ("oblateness",)),
    "perturbed-kepler": ("rk4", 0.02, 6, 0.06, {"effects": ["oblateness", "drag"]}, ("oblateness",)),
    "central-field": ("rk4", 0.02, 6, 1e-2, {"mu": "1e-5"}, ("perturbation",)),
    "n-body": ("stormer-verlet", 0.01, 3, 1e-3, {"epsilon": "1e-3"}, ("softening",)),
    "outer-solar-system": ("stormer-verlet", 20, 4000, 1e-4, {"effects": ["saturn", "pluto"]}, ("pluto",)),
    "lennard-jones": ("stormer-verlet", 0.01, 2, 1e-2, {"k": "1/1000"}, ("confinement",)),
    "magnetic-dipole": ("rk4", 0.01, 3, 1e-2, {"k": "1/1000000"}, ("attraction",)),
}
"""Method, step, span, accepted error, parameters, and what is to be left out."""


def advised(name, **options):
    method, h, span, accept, parameters, _ = ADVISED[name]
    effects = parameters.get("effects")
    values = {key: value for key, value in parameters.items() if key != "effects"}
    options = {"accept": accept, "effects": effects, "parameters": values, **options}
    return bs.effect_influence(method, name, h=h, span=span, **options)


def body_of(variable, scene):
    """A variable of the outer solar system as what it is: component and mass."""
    return variable[:2], scene.parameters["m"][int(variable[2:]) - 1]


def apart(name, effects, left_out):
    """How far runs with and without some effects are apart: on its own, variable by variable."""
    method, h, span, _, parameters, _ = ADVISED[name]
    runs = []
    for chosen in (effects, [effect for effect in effects if effect not in left_out]):
        full = bs.scene(name, effects=effects, **{key: x for key, x in parameters.items() if key != "effects"})
        if name == "n-body":
            scene = full if chosen else bs.scene(name)
        else:
            scene = bs.scene(name, effects=chosen) if name == "outer-solar-system" else full.with_effects(*chosen)
        run = bs.integrate(method, scene, h=h, steps=round(span / h))
        keys = [body_of(v, scene) if name == "outer-solar-system" else v for v in scene.variables]
        runs.append({key: y for key, y in zip(keys, run.y, strict=True) if key != "t"})
    shared = [key for key in runs[1] if key in runs[0]]
    first, second = (np.array([run[key] for key in shared]) for run in runs)
    return np.linalg.norm(first - second, axis=0).max() / np.linalg.norm(first, axis=0).max()


def test_every_scene_with_effects_is_here():
    assert sorted(ADVISED) == sorted(WITH_EFFECTS)


@pytest.mark.slow
@pytest.mark.parametrize("name", ADVISED)
def test_recommendations_hold(name):
    report = advised(name)
    effects = [row.name for row in report.rows]
    assert report.leave_out == ADVISED[name][-1]
    assert 0 < report.apart.solution <= report.promised <= report.accept
    assert apart(name, effects, report.leave_out) == pytest.approx(report.apart.solution, rel=0.02, abs=1e-13)
    for kept in report.keep:  # the negative control
        assert apart(name, effects, [*report.leave_out, kept]) > report.accept
    if not report.keep:
        strict = advised(name, accept=report.apart.solution / 2)
        assert (strict.leave_out, strict.keep, strict.promised) == ((), tuple(effects), 0)
        assert apart(name, effects, effects) > strict.accept


OSCILLATOR = bs.Scene(
    {"p": 1, "q": 1},
    hamiltonian="(p^2 + q^2)/2",
    start={"p": [0], "q": [1]},
    effects={
        "stiffening": bs.Effect(hamiltonian="delta*q^2/2", parameters={"delta": "1/100"}),
        "drag": bs.Effect(field={"p": "-c*p", "q": "-c*q"}, parameters={"c": "1/1000"}),
        "memory": bs.Effect(
            variables={"s": 1}, field={"s": "q", "p": "-k*s"}, parameters={"k": "1/500"}, start={"s": [0]}
        ),
        "wind": bs.Effect(field={"p": "sin(w*t)/100"}, parameters={"w": "1/2"}),
    },
    name="oscillator",
)


def influences(*effects, **options):
    options = {"h": 0.02, "span": 10, "effects": effects, **options}
    return {row.name: row for row in bs.effect_influence("rk4", OSCILLATOR, **options).rows}


def test_influences_of_exact_solutions():
    rows = influences("stiffening", "drag")
    t = np.linspace(0, 10, 501)
    w = math.sqrt(1.01)
    plain, stiff = np.array([-np.sin(t), np.cos(t)]), np.array([-w * np.sin(w * t), np.cos(w * t)])
    fade = np.exp(-t / 1000)
    size = np.linalg.norm(stiff, axis=0).max()
    expected = np.linalg.norm(stiff - plain, axis=0).max() / size
    assert rows["stiffening"].alone.solution == pytest.approx(expected, rel=1e-5)
    energy = (stiff**2).sum(axis=0) / 2
    assert rows["stiffening"].alone.energy == pytest.approx(abs(energy - 0.5).max() / 0.5, rel=1e-5)
    assert rows["drag"].alone.solution == pytest.approx(1 - math.exp(-0.01), rel=1e-5)
    assert rows["drag"].alone.energy == pytest.approx(1 - math.exp(-0.02), rel=1e-5)
    both = fade * np.array([-w * np.sin(w * t), np.cos(w * t)])
    less = np.linalg.norm(both - fade * plain, axis=0).max() / np.linalg.norm(both, axis=0).max()
    assert rows["stiffening"].left_out.solution == pytest.approx(less, rel=0.01)


def test_effects_with_variables_of_their_own_and_the_time():
    rows = influences("memory", "wind", span=1)
    assert 0 < rows["memory"].left_out.solution < rows["wind"].left_out.solution < 0.01
    variants = effect_variants(OSCILLATOR, ["memory", "wind"])
    assert variants.full.variables == ("p", "q", "s", "t")
    for less, places in (((), 2), (("memory",), 3), (("wind",), 2)):
        first, second = variants.shared(variants.names, less)
        assert list(first) == list(second) == list(range(places))


def test_planets_are_compared_with_themselves():
    variants = effect_variants("outer-solar-system", ["jupiter", "saturn", "pluto"])
    first, second = variants.shared(variants.names, ("pluto",))
    full, less = variants.full, variants.build(("pluto",))
    named = [body_of(full.variables[k], full) for k in first]
    assert named == [body_of(less.variables[k], less) for k in second]
    assert len(named) == less.dimension == 12
    assert [full.variables[k] for k in first] != list(less.variables)  # names alone would compare Jupiter with Pluto


def test_influences_far_below_the_error_of_the_method():
    tiny = [influences("drag", parameters={"c": c})["drag"].alone.solution for c in ("1e-6", "1e-9")]
    assert tiny[0] / tiny[1] == pytest.approx(1000, rel=1e-3)
    report = bs.effect_influence("rk4", OSCILLATOR, h=0.2, span=10, effects="drag", parameters={"c": "1e-9"})
    assert tiny[1] < 1e-4 * report.own_error.solution
    assert report.leave_out == ("drag",)


@pytest.mark.parametrize(("name", "h"), [("pendulum", 0.05), ("kepler", 0.02)])
def test_own_error_against_the_reference_solution(name, h):
    report = advised(name, measure="energy")
    scene = effect_variants(name, parameters=ADVISED[name][4]).full
    run = bs.integrate("rk4", scene, h=h, steps=report.steps)
    state = slice(None, -1) if "t" in scene.variables else slice(None)
    exact = bs.reference_solution(scene, run.t[1:])[state]
    error = np.linalg.norm(run.y[state, 1:] - exact, axis=0).max() / np.linalg.norm(exact, axis=0).max()
    assert report.own_error.solution == pytest.approx(error, rel=0.05)
    base = scene.with_effects()
    seen = observers(base, "energy")
    energy, truth = (np.array([seen(0.0, x)[0] for x in y[: base.dimension].T]) for y in (run.y[:, 1:], exact))
    error = abs(energy - truth).max() / abs(seen(0.0, base.y0)[0])
    assert report.own_error.energy == pytest.approx(error, rel=0.05)
    assert (report.measure, report.accept) == ("energy", ADVISED[name][3])
    assert bs.effect_influence("rk4", scene, h=h, span=1).accept < report.own_error.solution


def test_effects_that_only_matter_together_are_taken_back():
    brake = {"field": {"p": "-50*p"}}
    scene = bs.Scene(
        {"p": 1, "q": 1},
        hamiltonian="(p^2 + q^2)/2",
        start={"p": [0], "q": [1]},
        effects={"left brake": bs.Effect(**brake), "right brake": bs.Effect(**brake)},
    )
    report = bs.effect_influence("rk4", scene, h=0.01, span=1, accept=0.1)
    assert report.margin * sum(row.left_out.solution for row in report.rows) < report.accept
    assert report.leave_out == ("left brake",)
    assert report.rows[1].alone.solution > 10 * report.rows[1].left_out.solution
    assert report.apart.solution <= report.promised


def test_runs_that_fail_without_an_effect():
    scene = bs.Scene(
        {"y": 1}, field={"y": "y^2"}, start={"y": ["9/10"]}, effects={"bound": bs.Effect(field={"y": "-y^3"})}
    )
    report = bs.effect_influence("rk4", scene, h=0.01, span=2, accept=1)
    assert (report.rows[0].left_out, report.keep) == (Influence(math.inf, None), ("bound",))
    assert (report.bare, report.rows[0].seconds, report.saved) == (None, None, 0)
    assert report.to_dict()["rows"][0]["left_out"] == {"solution": None, "energy": None}
    growth = {"growth": bs.Effect(field={"y": "y^2"})}
    blown_up = bs.Scene({"y": 1}, field={"y": "-y"}, start={"y": [2]}, effects=growth)
    with pytest.raises(bs.IntegratorError, match="h must be small enough"):
        bs.effect_influence("rk4", blown_up, h=0.01, span=10)


def test_states_whose_squares_overflow_are_compared():
    """They are not said to agree, nor to be infinitely far apart."""
    scene = bs.Scene(
        {"y": 1},
        field={"y": "-y"},
        start={"y": [1]},
        effects={"source": bs.Effect(field={"y": "c"}, parameters={"c": 1})},
    )
    report = bs.effect_influence("rk4", scene, h=0.1, span=1, accept=1, parameters={"c": "10^200"})
    assert report.keep == ("source",)
    assert report.rows[0].left_out.solution == pytest.approx(1)
    weak = bs.effect_influence("rk4", scene, h=0.1, span=1, accept=1, parameters={"c": "1e-9"})
    assert weak.leave_out == ("source",)


class Runs:
    """In place of runs: how far leaving out several effects takes them apart."""

    def __init__(self, together):
        self.together = together

    def without(self, *names):
        return Influence(self.together if len(names) > 1 else 0.1, None)


@pytest.mark.parametrize(
    ("alone", "together", "expected"),
    [
        ((0.1, 0.1), 0.2, ("a", "b")), ((0.1, 0.1), math.nan, ("a",)), ((0.1, 0.1), 1.0, ("a",)),
        ((math.nan, math.nan), 0.2, ()), ((0.1, math.inf), 0.2, ("a",)),
    ],
)  # fmt: skip
def test_what_is_no_number_is_never_left_out_or_confirmed(alone, together, expected):
    found = {name: Influence(size, None) for name, size in zip("ab", alone, strict=True)}
    rows = [EffectRow(name, "", influence, influence) for name, influence in found.items()]
    assert effects_to_leave_out(Runs(together), rows, "solution", 0.5, 2.0) == expected  # pyright: ignore[reportArgumentType]


def test_parts_of_a_method_with_effects_that_bring_blocks():
    parts = {"a": ["q", "t"], "b": "p"}
    report = bs.effect_influence("strang", OSCILLATOR, h=0.1, span=1, effects="wind", parts=parts)
    assert report.keep == ("wind",)
    assert report.rows[0].alone == report.rows[0].left_out
    with pytest.raises(bs.IntegratorError, match="parts must say what the method's parts a, b are"):
        bs.effect_influence("strang", OSCILLATOR, h=0.1, span=1, effects="wind")


def test_text_and_data_of_a_report():
    done = []
    report = bs.effect_influence(
        "rk4", OSCILLATOR, h=0.1, span=0.3, effects=["drag"], progress=lambda *at: done.append(at)
    )
    made, known = zip(*done, strict=True)
    assert report.steps == 3
    assert set(known) == {3 * (2 + 4)}  # with and without, and in pieces of a quarter
    assert (list(made), made[-1]) == (sorted(made), known[-1])
    assert "Keep all effects: leaving out any of them changes the solution by 0.0003" in str(report)
    data = report.to_dict()
    assert (data["kind"], data["keep"], data["seconds_per_step"]["full"]["seconds"]) == (
        "effects", ("drag",), report.full.seconds,
    )  # fmt: skip
    full, less = Timing(1.0, 0.9, 1.1, 5), Timing(0.7, 0.7, 0.8, 5)
    cost = EffectRow("a", "", Influence(0, None), Influence(0, None)).with_costs(full, less)
    assert (cost.seconds, cost.uncertainty) == (pytest.approx(0.3), pytest.approx(0.15))
    left = report._replace(leave_out=("drag",))
    for kept, text in (
        (less, "Leave out drag, which saves 30% of a step's time; keep none"),
        (Timing(0.95, 0.9, 1.0, 5), "less than it varies"),
        (Timing(1.5, 1.5, 1.5, 5), "though a step takes 50% longer"),
    ):
        assert text in str(left._replace(full=full, kept=kept))


@pytest.mark.slow
def test_costs_against_the_number_of_effects():
    rows = bs.effect_costs("stormer-verlet", "pendulum", h=0.01, effects=["damping", "asymmetry"])
    assert [row.effects for row in rows] == [(), ("asymmetry",), ("asymmetry", "damping")]
    assert (len(rows), rows[-1], rows[:1]) == (3, rows.rows[2], rows.rows[:1])
    assert [(row.trees, row.all_trees) for row in rows] == [(37, 1202), (37, 1202), (217, 1202)]
    for row in rows:
        tree_count = bs.modified_field(
            bs.method("stormer-verlet"), bs.scene("pendulum", effects=row.effects), 6
        ).report()
        assert tree_count == f"{row.trees:,} of {row.all_trees:,} trees"
        assert 0 < row.field.low <= row.field.seconds <= row.field.high
    data = json.loads(json.dumps(rows.to_dict()))
    assert [data[key] for key in ("schema", "kind", "scene", "method", "h", "order")] == [
        *(1, "effect-costs", "pendulum", "stormer-verlet-kdk", 0.01, 6)
    ]
    assert [(row["effects"], row["trees"], row["step"]["seconds"]) for row in data["rows"]] == [
        (list(row.effects), row.trees, row.step.seconds) for row in rows
    ]
    with_matrix = bs.effect_costs("ros34pw2", OSCILLATOR, h=0.1, effects="drag")
    assert [(row.trees, row.all_trees) for row in with_matrix] == [(None, None)] * 2


MISTAKES = {
    "no effects": (("lorenz",), {}, "scene must have effects, but lorenz has none"),
    "built in": ((bs.scene("n-body"),), {}, "its effects are chosen when it is built, so give its name"),
    "no scene": ((3,), {}, "scene must be a Scene or the name of one, but was 3"),
    "unknown scene": (("pendulumm",), {}, "did you mean pendulum"),
    "unknown effect": (("pendulum",), {"effects": ["wind"]}, "the effects are asymmetry, damping, drive"),
    "unknown built in": (("n-body",), {"effects": ["wind"]}, "the effects are softening"),
    "no effect's name": (("pendulum",), {"effects": 3}, "effects must be a sequence, but was 3"),
    "parameter that is off": (
        ("pendulum",),
        {"effects": "drive", "parameters": {"gamma": 1}},
        "there is no parameter gamma unless the effect damping is on",
    ),
    "empty": (("pendulum",), {"effects": []}, "effects must name one effect or more, or be None"),
    "start": (("pendulum",), {"start": [1, 2]}, r"start must map names to values, but was \[1, 2\]"),
    "parameters": (("pendulum",), {"parameters": "gamma=1"}, "parameters must map names to values, but was 'gamma=1'"),
    "progress": (("pendulum",), {"progress": 5}, "progress must be a function of two numbers, True or None, but was 5"),
    "block": (("pendulum",), {"start": {"x": [1]}}, "there is no block x; the blocks are p, q"),
    "zero step": (("pendulum",), {"h": 0}, "span must be positive, and h not zero, but they were 1 and 0"),
    "no span": (("pendulum",), {"span": -1}, "span must be positive"),
    "long": (("pendulum",), {"h": 1e-300}, "span must have fewer than 2.53 steps, but had 1e.300"),
    "nan": (("pendulum",), {"h": math.nan}, "h must be a finite number, but was nan"),
    "measure": (("pendulum",), {"measure": "phase"}, "measure must be one of solution, energy, but was 'phase'"),
    "margin": (("pendulum",), {"margin": 0.5}, "margin must be a factor, 1 or more, but was 0.5"),
    "accept": ((OSCILLATOR,), {"accept": -1, "effects": "drag"}, "accept must be an error, 0 or more, but was -1"),
    "energy": (
        (bs.Scene({"y": 1}, field={"y": "-y"}, start={"y": [1]}, effects={"e": bs.Effect(field={"y": "1"})}),),
        {"measure": "energy"},
        "measure must be solution for scene, which has no energy, but was energy",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes(mistake):
    given, options, sentence = MISTAKES[mistake]
    with pytest.raises(bs.errors, match=sentence):
        bs.effect_influence("rk4", given[0], **{"h": 0.1, "span": 1, **options})


def test_methods():
    for call in (partial(bs.effect_influence, span=1), bs.effect_costs):
        with pytest.raises(bs.SeriesError, match="method must be a method"):
            call(4, "pendulum", h=0.1)


def never_had(scene, *effects):
    """The scene as it would be read from a file in which these effects were never written."""
    table = scene.to_dict()
    for name in effects:
        del table["effects"][name]
    return bs.load_scene(io.BytesIO(tomli_w.dumps(table).encode()))


@pytest.mark.few(2)
@pytest.mark.parametrize("name", DECLARED)
def test_an_effect_that_is_off_leaves_no_trace_in_the_code(name):
    scene = bs.scene(name)
    on = scene.with_effects(*scene.effects)
    writers = [scene_source]
    writers += [lambda system, m=method: bs.stepper(m, system).source for method in ("rk4", "stormer-verlet", "gauss2")]
    for effect in scene.effects:
        others = [other for other in scene.effects if other != effect]
        off, never = scene.with_effects(*others), never_had(scene, effect).with_effects(*others)
        assert effect not in never.effects
        for write in writers:
            assert write(off) == write(never) != write(on)


def test_built_in_effects_that_are_off_leave_no_trace_in_the_code():
    bodies = {name: body for name, body in BODIES.items() if name in ("sun", "jupiter")}
    masses, positions, velocities = zip(*bodies.values(), strict=True)
    never = bs.scene("n-body", masses=masses, positions=positions, velocities=velocities, G=GRAVITATION)
    chosen = bs.scene("outer-solar-system", effects=["jupiter"])
    softened = bs.scene(
        "n-body", ["softening"], masses=masses, positions=positions, velocities=velocities, G=GRAVITATION
    )
    sources = [bs.stepper("stormer-verlet", system).source for system in (chosen, never, softened)]
    assert sources[0] == sources[1] != sources[2]


@pytest.mark.parametrize(("accept", "warns"), [(1e-3, False), (1e-6, True)])
def test_an_error_that_the_method_itself_exceeds_is_said_to_take_a_smaller_step(accept, warns):
    report = bs.effect_influence("rk4", "kepler", h=0.02, span=6, accept=accept, effects=["drag"])
    own = report.own_error.solution
    assert (own > accept) is warns
    assert ("exceeds the accepted error: use a smaller step" in str(report)) is warns
