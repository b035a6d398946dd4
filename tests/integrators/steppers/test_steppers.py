"""What compiled steps are made of: calls, blocks and arrays; sums in lanes; failures; rounding."""

import ast
import re
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import integrators as bi
from integrators.compile.scene_source import compiled_scene
from integrators.reference.plain_steps import plain_steps
from integrators.steppers import writer

pytestmark = pytest.mark.minimum

PENDULUM = bi.scene("pendulum")
CONTROLLED = bi.stepper("rk4", PENDULUM, control="1/(1+p**2)")
ROWS = [[1, 5], [2, 7], [3, 11], [4, 12], [5, 9], [6, 10], [7, 1], [8, 2], [9, 3]]
RING = bi.Scene(
    {"p": 12, "q": 12},
    terms=[
        bi.Term(over="each", hamiltonian="p_i^2/(2*m_i)"),
        bi.Term(over="ring", hamiltonian="(q_i - q_j)^2/2 + k_i*(q_i - q_j)^4/sqrt(1 + q_j^2)"),
        bi.Term(
            over=[[1, 5], [2, 7], [3, 11], [4, 12], [5, 9], [6, 10], [7, 1], [8, 2], [9, 3]], hamiltonian="q_i^2*q_j"
        ),
    ],
    parameters={"m": list(range(1, 13)), "k": [f"{k}/7" for k in range(12)]},
    start={"p": [f"{k}/10" for k in range(12)], "q": [f"{k * k % 7}/5" for k in range(12)]},
)


def loop_of(method, scene=PENDULUM, **options):
    """The lines of a step."""
    source = bi.stepper(method, scene, compensated=False, split=False, **options).source
    return re.search(r"while done < steps:\n(.*?)done \+= 1", source, re.S)[1]


def calls_in(text):
    return len(re.findall(r"\bf\d+\(", text))


@pytest.mark.parametrize(
    ("method", "calls"),
    [
        ("stormer-verlet-kdk", 1),  # the force at the end of a step is that at the start of the next one
        ("stormer-verlet-dkd", 1),
        ("rk4", 4),
        ("dormand-prince54", 6),  # first same as last
        ("yoshida6", 7),
        ("blanes-moan4", 6),
        ("gauss3", 3),  # in a sweep, on positions only
        ("rkn-nystrom4", 3),
    ],
)
def test_forces_in_a_step(method, calls):
    assert calls_in(loop_of(method)) == calls


def test_implicit_methods_take_their_nystrom_form_where_velocities_are_linear():
    assert len(bi.stepper("gauss3", bi.scene("kepler")).start(h=0.1).memory) == 3 * 2
    assert len(bi.stepper("gauss3", bi.scene("double-pendulum")).start(h=0.1).memory) == 3 * 4


def test_an_effect_that_is_off_leaves_no_trace_in_steps():
    bare = bi.Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)")
    assert bi.stepper("rk4", PENDULUM).source == bi.stepper("rk4", bare).source
    assert bi.stepper("rk4", PENDULUM.with_effects("damping")).source != bi.stepper("rk4", bare).source


@pytest.mark.few(3)
@pytest.mark.parametrize(
    ("scene", "lanes"),
    [
        (bi.scene("lennard-jones"), True),
        (bi.scene("lennard-jones", particles=20), True),  # more pairs than are taken at once
        (bi.scene("outer-solar-system"), True),
        (RING, False),  # no pairs
        (bi.scene("toda", n=12), False),
        (bi.scene("fermi-pasta-ulam"), False),
    ],
    ids=["36 pairs", "190 pairs", "masses", "ring and table", "exponentials", "few springs"],
)
def test_sums_in_lanes_are_those_of_the_scene(scene, lanes):
    stepper = bi.stepper("explicit-euler", scene, compensated=False)
    assert (" = stack(" in stepper.source.split("def advance")[0]) is lanes
    state = stepper.start(h=1.0)
    before, slope = state.y.copy(), np.empty(scene.dimension)
    compiled_scene(scene).field(before, slope)
    stepper.advance(state, 1)
    np.testing.assert_allclose(state.y, before + slope, rtol=1e-13, atol=1e-13 * abs(slope).max())


@pytest.mark.few(5)
@pytest.mark.parametrize(
    "method", ["rk4", "gauss2", "gauss8", "radau-iia2", "rodas4", "avf", "takahashi-imada", "tdrk5"]
)
@pytest.mark.parametrize("scene", ["kepler", "lennard-jones"])
def test_no_call_is_given_an_array_twice(scene, method):
    """Loops are written in vectors, as if arrays of different names did not overlap."""
    source = bi.stepper(method, bi.scene(scene)).source
    calls = [ast.unparse(node) for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    arrays = set(re.findall(r"(\w+) = (?:stack|shifted|pointer)\(", source)) | {"source", "lost", "m"}
    given = [[name for name in re.findall(r"[\w.]+", call) if name in arrays] for call in calls]
    assert any(len(names) > 1 for names in given)
    for call, names in zip(calls, given, strict=True):
        assert len(names) == len(set(names)) or re.match(r"(max|bits|abs|fma|stack|negligible)\(", call), call


def test_large_scenes_need_no_stack(monkeypatch):
    monkeypatch.setattr(writer, "MOST_STACK", 64)
    scene = bi.scene("fermi-pasta-ulam", m=20)
    stepper = bi.stepper("stormer-verlet", scene)
    state = stepper.start(np.zeros(scene.dimension), h=1e-3)
    stepper.advance(state, 3)
    assert not state.y.any()
    assert "shifted(w, " in stepper.source


def test_compensation_keeps_what_sums_lose():
    steady = bi.Scene({"y": 1}, field={"y": "1/3"})
    n, h, ends = 10**6, 0.1, {}
    for compensated in (True, False):
        stepper = bi.stepper("explicit-euler", steady, compensated=compensated)
        state = stepper.start([1.0], h=h)
        stepper.advance(state, n)
        ends[compensated] = abs(state.y[0] - (1 + n * (h * (1 / 3)))) / state.y[0]
    assert ends[True] < 2e-16
    assert ends[False] > 1e-13


def test_a_step_that_fails_leaves_the_last_good_state():
    stepper = bi.stepper("rk4", bi.parse_scene("y' = y^2"))
    state, rows = stepper.start([1.0], h=0.001), np.full((60, 1), np.nan)
    with pytest.raises(
        bi.StepError, match=r"rk4 on .*, but with h = 0.001 step 1003, from t = 1.002, did not end in"
    ) as e:
        stepper.record(state, 6000, y_every=100, y_rows=rows)
    assert (e.value.step, state.n) == (1003, 1002)
    assert e.value.y == state.y
    assert np.isfinite(rows[:10]).all()
    again = stepper.start([1.0], h=0.001)
    stepper.advance(again, 1002)
    assert again.y == state.y


def test_iterations_that_do_not_converge_are_no_steps():
    stepper = bi.stepper("gauss2", bi.scene("kepler"), solver="fixed-point")
    state = stepper.start(h=1.0)
    with pytest.raises(bi.StepError, match="gauss2 on kepler, but with h = 1 step 1, from t = 0, did not converge"):
        stepper.advance(state, 3)
    np.testing.assert_array_equal(state.y, bi.scene("kepler").y0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bi.stepper("rk4", 3), "scene must be a Scene or the name of one, but was 3"),
        (lambda: bi.stepper(4, PENDULUM), "method must be a method or its name, but was 4"),
        (lambda: bi.stepper("rk5", PENDULUM), "rk5"),
        (lambda: bi.stepper("strang", bi.scene("riccati")), "scene must have blocks or parts for a, b"),
        (lambda: bi.stepper("rk4", PENDULUM, solver="exact"), "solver must be one of"),
        (lambda: bi.stepper("rk4", PENDULUM).start(h=0), "h must not be zero"),
        (lambda: bi.stepper("rk4", PENDULUM).start(h="x"), "h must be a number, but 'x' has the unknown name"),
        (lambda: bi.stepper("rk4", PENDULUM).start(h=float("nan")), "h must be a finite number, but was nan"),
        (lambda: bi.stepper("rk4", PENDULUM).start([1.0], h=0.1), r"y0 must hold 2 finite numbers, but was \[1.0\]"),
        (lambda: bi.stepper("rk4", PENDULUM).start([1, np.inf], h=0.1), "y0 must hold 2 finite numbers"),
        (lambda: bi.stepper("rk4", bi.Scene({"y": 1}, field={"y": "a*y"}, parameters={"a": "a"})), "parameters.a"),
        (lambda: bi.stepper(bi.method("explicit2", alpha="alpha"), PENDULUM), "parameters must have values"),
    ],
)
def test_bad_input(call, message):
    with pytest.raises(bi.IntegratorError, match=message):
        call()


def assert_steps_are_plain(scene, method, parts):
    """Three compiled steps end where plain ones do; `parts` are functions of y."""
    stepper = bi.stepper(method, scene)
    state = stepper.start(h=0.1)
    stepper.advance(state, 3)
    np.testing.assert_allclose(state.y, plain_steps(method, parts, scene.y0, 0.1, 3)[:, -1], rtol=1e-14)


def test_several_potentials_may_kick_one_block():
    terms = {"U": "q^4/4", "V": "-cos(q)", "T": "p^2/2"}
    scene = bi.Scene(
        {"p": 1, "q": 1},
        terms=[bi.Term(hamiltonian=formula, part=part) for part, formula in terms.items()],
        start={"p": ["1/5"], "q": ["7/10"]},
    )
    parts = {
        "U": lambda y: [-(y[1] ** 3), 0 * y[0]],
        "V": lambda y: [-np.sin(y[1]), 0 * y[0]],
        "T": lambda y: [0 * y[0], y[0]],
    }
    for order in (["U", "V", "T"], ["U", "T", "V"], ["T", "V", "U"]):
        assert_steps_are_plain(scene, bi.strang(order), parts)


def test_a_point_may_be_the_shifted_end_of_a_step():
    scene = bi.Scene(
        {"a": 1, "b": 1, "c": 1},
        field={"a": "-b^3", "b": "a", "c": "a^2"},
        start={"a": ["1/2"], "b": ["4/5"], "c": ["1/10"]},
    )
    builder = bi.ProgramBuilder(["a", "b", "c"])
    y = builder.y
    k1 = builder.field(y, "a")
    k2 = builder.field(y + k1 / 2, "b")
    k3 = builder.field(y + k2, "a")
    k4 = builder.field(y + k1 / 2 + k3, "c")
    method = builder.program(y + k1 / 2 + k2 + k3 / 2 + k4)
    parts = {
        "a": lambda y: [-(y[1] ** 3), 0 * y[0], 0 * y[0]],
        "b": lambda y: [0 * y[0], y[0], 0 * y[0]],
        "c": lambda y: [0 * y[0], 0 * y[0], y[0] ** 2],
    }
    assert_steps_are_plain(scene, method, parts)


def test_blocks_hold_every_place_as_a_whole():
    scene = bi.Scene(
        {"y": 3},
        terms=[
            bi.Term(over=[[1], [2]], field={"y_i": "-y_i"}, part="a"),
            bi.Term(over=[[2], [3]], field={"y_i": "-y_i"}, part="a"),
            bi.Term(over=[[3]], field={"y_i": "-2*y_i"}, part="b"),
        ],
        start={"y": [1, 1, 1]},
    )
    stepper = bi.stepper(bi.lie_trotter(["a", "b"]), scene)
    state = stepper.start(h=0.1)
    stepper.advance(state, 1)
    np.testing.assert_allclose(state.y, np.exp([-0.1, -0.2, -0.3]), rtol=1e-15)


def test_a_state_changes_by_steps_only():
    stepper = bi.stepper("stormer-verlet", PENDULUM)
    state = stepper.start(h=0.1)
    stepper.advance(state, 3)
    with pytest.raises(ValueError, match="read-only"):
        state.y[0] = 1.0
    with pytest.raises(AttributeError):
        state.h = 0.2
    turned = stepper.restart(state, y=-state.y, h=0.2)
    assert (turned.t, turned.n, turned.h) == (state.t, 0, 0.2)
    np.testing.assert_array_equal(turned.y, -state.y)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s, t: s.advance(t, 1.5), "steps must be a whole number, 0 or more, but was 1.5"),
        (lambda s, t: s.advance(t, -1), "steps must be a whole number, 0 or more, but was -1"),
        (lambda s, t: s.record(t, 9, y_every=2, y_rows=np.empty((3, 2))), "y_rows must be .* with 4 rows of 2"),
        (lambda s, t: s.record(t, 9, y_every=2, y_rows=np.empty((2, 4)).T), "y_rows must be a contiguous array"),
        (lambda s, t: s.record(t, 9, y_every=2), "y_rows must be given with y_every"),
        (lambda s, t: s.record(t, 9, o_every=2, o_rows=np.empty((9, 1))), "observer must be the address"),
        (lambda s, t: s.advance(bi.stepper("rk4", bi.scene("kepler")).start(h=1), 1), "state must be one that"),
        (lambda s, t: s.advance(CONTROLLED.start(h=0.1), 1), "state must be one that"),
        (lambda s, t: CONTROLLED.advance(t, 1), "state must be one that"),
        (lambda s, t: s.record(t, 4, y_every=-1, y_rows=np.empty((9, 2))), "y_every must be a whole number, 0 or more"),
        (lambda s, t: s.record(t, 4, y_every=2**63, y_rows=np.empty((9, 2))), "y_every must be a whole number"),
        (lambda s, t: s.record(t, 4, o_every=-1, o_rows=np.empty((9, 2))), "o_every must be a whole number, 0 or more"),
        (lambda s, t: s.restart(t, y=[1 + 1j, 2]), "y0 must hold 2 finite numbers"),
    ],
)
def test_what_compiled_code_would_not_survive_is_refused(call, message):
    stepper = bi.stepper("rk4", PENDULUM)
    with pytest.raises(bi.IntegratorError, match=message):
        call(stepper, stepper.start(h=0.1))


@pytest.mark.parametrize("method", ["rkn-nystrom5", "blanes-moan-rkn6", "takahashi-imada"])
def test_methods_for_special_systems_are_refused_elsewhere(method):
    with pytest.raises(bi.IntegratorError, match="must be of the kind that"):
        bi.stepper(method, bi.scene("lotka-volterra"))


@pytest.mark.slow
def test_threads_compile_at_once(monkeypatch, tmp_path):
    """Python 3.11 confuses the syntax trees of two threads."""
    monkeypatch.setenv("BSERIES_CACHE", str(tmp_path))
    starts = [{"p": [0], "q": [k]} for k in range(1, 5)]
    scenes = [bi.Scene({"p": 1, "q": 1}, hamiltonian=f"p^2/2 - {k}*cos(q)/7", start=starts[k % 4]) for k in range(48)]
    with ThreadPoolExecutor(8) as threads:
        found = list(threads.map(lambda scene: bi.integrate("rk4", scene, h=0.1, steps=3).y, scenes))
    for scene, y in zip(scenes[::12], found[::12], strict=True):
        np.testing.assert_array_equal(y, bi.integrate("rk4", scene, h=0.1, steps=3).y)
