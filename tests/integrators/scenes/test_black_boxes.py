"""Right-hand sides that are no formulas: compiled functions in scenes."""

from __future__ import annotations

import functools
import gc
import math
import pickle
import subprocess
import sys
from fractions import Fraction

import numpy as np
import psutil
import pytest
from numba import njit
from scipy.integrate import solve_ivp

import bseries as bs
from bseries_base.machine_code import MachineCode
from integrators.compile import black_boxes
from integrators.compile.black_boxes import dispatcher_of
from integrators.reference.halved_steps import settled_solution
from integrators.scenes.functions import scene_from_function
from integrators.steppers import stepping


def pendulum(t, y, g=1.0):
    return y[1], -g * math.sin(y[0])


def traced_pendulum(t, y, g=1.0):
    return [y[1], -g * np.sin(y[0])]


def bouncing(t, y):
    """Free fall onto a spring."""
    force = -1.0
    if y[0] < 0:
        force -= 100 * y[0]
    return y[1], force


TABLE = np.linspace(0, 2, 21) ** 2


def looked_up(y):
    """A potential well from a table, between whose entries it is interpolated."""
    place = min(abs(y[0]), 1.999) * 10
    k = int(place)
    slope = TABLE[k] + (place - k) * (TABLE[k + 1] - TABLE[k])
    return np.array([y[1], -math.copysign(slope, y[0])])


@functools.cache
def pair():
    """The same field as a compiled function and as formulas."""
    return scene_from_function(pendulum, [1, 0.5]), scene_from_function(traced_pendulum, [1, 0.5], compiled=False)


@pytest.mark.few(2)
@pytest.mark.parametrize("method", ["rk4", "dop853", "gauss2", "implicit-midpoint", "avf"])
def test_steps_are_those_of_formulas_to_the_bit(method):
    compiled, formulas = pair()
    runs = [bs.integrate(method, scene, h=0.1, steps=300) for scene in (compiled, formulas)]
    np.testing.assert_array_equal(runs[0].y, runs[1].y)
    other = bs.integrate(method, compiled.with_parameters(g=2), h=0.1, steps=300)
    assert abs(other.y - runs[1].y).max() > 0.1


@pytest.mark.parametrize("function", [bouncing, looked_up])
def test_branches_and_tables_agree_with_scipy(function):
    scene = scene_from_function(function, [1, 0])
    assert scene.variables == ("y1", "y2")  # a time that is not read is no variable
    run = bs.integrate("rk4", scene, h=2**-12, span=4)
    rate = function if function is bouncing else lambda t, y: function(y)
    true = solve_ivp(rate, (0, 4), [1, 0], rtol=1e-11, atol=1e-12, max_step=1e-3).y[:, -1]
    np.testing.assert_allclose(run.y[:, -1], true, atol=2e-6)
    np.testing.assert_array_equal(bs.integrators.right_hand_side(scene)(0.0, [-0.3, 2.0]), rate(0.0, [-0.3, 2.0]))


@pytest.mark.parametrize(("method", "order"), [("explicit-euler", 1), ("heun2", 2), ("rk4", 4), ("gauss2", 4)])
def test_errors_have_the_order_of_the_method(method, order):
    scene, formulas = pair()
    exact = bs.reference_solution(formulas, 2)[:, 0]
    sizes = [2.0**-k for k in (5, 6, 7)]
    errors = [np.abs(bs.integrate(method, scene, h=h, span=2).y[:, -1] - exact).max() for h in sizes]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert slopes == pytest.approx(order, abs=0.12)


def test_time_and_parameters():
    def driven(t, y, a=0.5, omega=2):
        return y[1], -y[0] + (a * math.cos(omega * t) if t >= 0 else 0.0)

    scene = scene_from_function(driven, [1, 0])
    assert scene.variables == ("y1", "y2", "t")
    assert dict(scene.parameters) == {"a": Fraction(1, 2), "omega": 2}
    true = solve_ivp(driven, (0, 3), [1, 0], rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(bs.integrate("rk4", scene, h=0.001, span=3).y[:2, -1], true, atol=1e-9)
    unforced = bs.integrate("rk4", scene.with_parameters(a=0), h=0.001, span=3)
    np.testing.assert_allclose(unforced.y[0, -1], math.cos(3), atol=1e-9)


def test_functions_of_blocks_split():
    def force(x, k=1.0):
        return -k * x[0] if x[0] > 0 else -2 * k * x[0]

    scene = scene_from_function({"v": force, "x": lambda v: v}, [0, 1], variables={"v": 1, "x": 1})
    text = "where(x > 0, -k*x, -2*k*x)"
    same = bs.Scene(
        {"v": 1, "x": 1}, field={"v": text, "x": "v"}, parameters={"k": 1}, start={"v": [0], "x": [1]}
    )  # fmt: skip
    for method in ("stormer-verlet", "blanes-moan4", "symplectic-euler-p"):
        runs = [bs.integrate(method, one, h=0.1, steps=200).y for one in (scene, same)]
        np.testing.assert_array_equal(*runs)
    with pytest.raises(bs.IntegratorError, match="function of v must take blocks of v, x or the time t, but takes q"):
        scene_from_function({"v": lambda q: q, "x": lambda v: v}, [0, 1], variables={"v": 1, "x": 1})
    with pytest.raises(bs.IntegratorError, match="function must have one for each block of v, x, but had v"):
        scene_from_function({"v": force}, [0, 1], variables={"v": 1, "x": 1})


def stiff(t, y, mu=1000.0):
    return y[1], mu * (1 - y[0] ** 2) * y[1] - y[0] if y[0] < 1e9 else 0.0


def stiff_jacobian(t, y, mu=1000.0):
    return (0.0, 1.0), (-2 * mu * y[0] * y[1] - 1, mu * (1 - y[0] ** 2))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "need"),
    [("radau-iia3", "h must be small enough"), ("ros34pw2", "given by formulas for derivatives of its field")],
)
def test_a_jacobian_serves_methods_that_need_derivatives(method, need):
    scene = scene_from_function(stiff, [2, 0], jacobian=stiff_jacobian)
    field = {"y1": "y2", "y2": "mu*(1 - y1^2)*y2 - y1"}
    same = bs.Scene({"y": 2}, field=field, parameters={"mu": 1000}, start={"y": [2, 0]})
    runs = [bs.integrate(method, one, h=0.5, steps=50).y for one in (scene, same)]
    np.testing.assert_allclose(*runs, rtol=1e-12, atol=1e-15)
    with pytest.raises(bs.IntegratorError, match="must return 2 times 2 numbers, but"):
        scene_from_function(stiff, [2, 0], jacobian=stiff)
    with pytest.raises(bs.IntegratorError, match=need):
        bs.integrate(method, scene_from_function(stiff, [2, 0]), h=0.5, steps=50)


NEEDS = {
    "a series": lambda scene: str(bs.modified_field("explicit-euler", scene, 3)),
    "derivatives of its field": lambda scene: bs.integrate("gauss2", scene, h=0.1, steps=1, solver="newton"),
    "a file": lambda scene: scene.to_toml(),
    "Taylor series": lambda scene: bs.reference_solution(scene, 1),
    "other arithmetic than doubles": lambda scene: scene.invariant_defects(),
}


@pytest.mark.parametrize("need", NEEDS)
def test_what_needs_formulas_is_refused_in_one_sentence(need):
    def rate(t, y):
        return y[1], -y[0] if y[0] > 0 else -2 * y[0]

    scene = scene_from_function(rate, [1, 0])
    sentence = rf"^scene must be given by formulas for {need}.*, but 'rate' is a compiled function$"
    with pytest.raises(bs.IntegratorError, match=sentence):
        NEEDS[need](scene)
    assert scene.notes == ("the compiled function rate has values, but neither formulas nor derivatives",)
    assert "it looks at their values" in str(scene)


def test_equal_is_the_same_text_with_the_same_values():
    def made(a):
        return lambda y: a * y[0] if y[0] > 0 else 0.0

    scenes = [scene_from_function(f, [1], name="f") for f in (made(1.0), made(1.0), made(2.0))]
    assert scenes[0] == scenes[1]
    assert hash(scenes[0]) == hash(scenes[1])
    assert scenes[0] != scenes[2]
    assert bs.stepper("rk4", scenes[0]) is bs.stepper("rk4", scenes[1])
    copy = pickle.loads(pickle.dumps(scenes[0]))
    assert copy == scenes[0]
    ends = [
        bs.integrate("rk4", f, h=0.1, steps=10).y for f in (scenes[0], scenes[1], scene_from_function(made(2.0), [1]))
    ]
    np.testing.assert_array_equal(ends[0], ends[1])
    assert ends[2][0, -1] > 2 * ends[0][0, -1]


def test_functions_that_are_gone_are_not_taken_for_new_ones():
    """A new function may have the address of one that is gone while its scene is used."""

    def made(a):
        return lambda y: a * y[0] if y[0] > 0 else 0.0

    scenes = [scene_from_function(made(float(a)), [1]) for a in range(4)]
    assert [bs.integrators.right_hand_side(scene)(0.0, [1.0])[0] for scene in scenes] == [0, 1, 2, 3]
    assert len(set(scenes)) == 4


@pytest.mark.parametrize("function", [functools.partial(max, 1), type("Rate", (), {"__call__": lambda self, y: y})()])
def test_other_callables_are_not_compiled(function):
    with pytest.raises(bs.IntegratorError, match="function must be made by def or lambda to be compiled, but"):
        dispatcher_of(function)


def test_functions_of_numba_are_taken_as_they_are():
    helper = njit(lambda x: x if x > 0 else 2 * x)
    rate = njit(lambda t, y: (y[1], -helper(y[0])))
    scene = scene_from_function(rate, [1, 0])
    true = solve_ivp(lambda t, y: rate(t, y), (0, 2), [1, 0], rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(bs.integrate("rk4", scene, h=0.001, span=2).y[:, -1], true, atol=1e-9)


def test_a_list_has_the_values_of_a_tuple_and_a_warning_advises_the_tuple():
    def listed(t, y):
        return [y[1], -y[0] if y[0] > 0 else -2 * y[0]]

    def paired(t, y):
        return y[1], -y[0] if y[0] > 0 else -2 * y[0]

    with pytest.warns(RuntimeWarning, match="^listed should return a tuple: with the list that it returns"):
        first = scene_from_function(listed, [1, 0])
    runs = [bs.integrate("rk4", one, h=0.1, steps=50).y for one in (first, scene_from_function(paired, [1, 0]))]
    np.testing.assert_allclose(*runs, rtol=0, atol=1e-14)


def test_errors_of_the_function_are_told_where_they_are():
    def limited(t, y, top=2.0):
        if y[0] > top:
            raise ValueError("too high")
        return 1.0, 0.0

    scene = scene_from_function(limited, [0, 5], compiled=True)
    for method in ("rk4", "gauss2"):
        with pytest.raises(
            bs.IntegratorError, match=r"limited must have a value at .*, but raised ValueError: too high"
        ) as caught:
            bs.integrate(method, scene, h=0.25, steps=100)
        assert isinstance(caught.value.__cause__.__cause__, ValueError)
        assert caught.value.trajectory.t[-1] == pytest.approx(1.75, abs=0.26)
    with pytest.raises(bs.IntegratorError, match=r"limited must have a value at \(0, 3, 0, 2\), but raised ValueError"):
        bs.integrators.right_hand_side(scene)(0.0, [3.0, 0.0])
    run = bs.integrate("rk4", scene.with_parameters(top=100), h=0.25, steps=100)  # an old error is not told again
    assert run.y[0, -1] == pytest.approx(25)


REFUSED = {
    "not compiled": (
        lambda y: np.frexp(y[0])[0],
        "numba can compile, but .*numpy.frexp.*without numba, function must run",
    ),
    "a builtin": (lambda y: float(hash(input) if y[0] > 0 else 0), "Untyped global name 'input'"),
    "too many": (lambda y: (y[0] if y[0] > 0 else 0.0, 1.0), r"must return one number, but .* type UniTuple"),
    "text": (lambda y: "a" if y[0] > 0 else "b", "must return one number, but .* unicode_type"),
    "complex": (lambda y: 1j * y[0] if y[0] > 0 else 1j, "must return one number, but .* complex128"),
    "nan": (lambda y: math.nan if y[0] > 0 else 0.0, "y0 must be where <lambda> is finite, but its value was .nan"),
    "a length that varies": (lambda y: y[:0] if y[0] > 0 else y, "returned another number"),
    "raises": (lambda y: math.factorial(-1) if y[0] > 0 else 0.0, "must have a value at|numba can compile"),
}


@pytest.mark.filterwarnings("ignore::numba.core.errors.NumbaWarning")
@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_compiled_is_refused(case):
    function, message = REFUSED[case]
    with pytest.raises(bs.IntegratorError, match=message):
        scene_from_function(function, [1.0])


def test_options_that_do_not_go_together():
    with pytest.raises(bs.IntegratorError, match="compiled must be True, False or None, but was 3"):
        scene_from_function(pendulum, [1, 0], compiled=3)
    with pytest.raises(bs.IntegratorError, match="function must run on symbols where hamiltonian is true"):
        scene_from_function(lambda p, q: p[0], [1, 0], hamiltonian=True, compiled=True)
    with pytest.raises(bs.IntegratorError, match="variables must be given for functions of blocks"):
        scene_from_function({"p": pendulum}, [1, 0])


def test_bounds_of_settled_solutions_hold():
    compiled, formulas = pair()
    times = [1, 10, 100]
    found, exact = settled_solution(compiled, times), bs.reference_solution(formulas, times)
    assert (np.abs(found.high - exact) <= found.error).all()
    assert found.error.max() < 1e-12
    rough = settled_solution(compiled, times, digits=6)
    assert found.error.max() < rough.error.max() < 1e-4
    jumping = scene_from_function(lambda y: (y[1], -y[0] - (1.0 if y[0] > 0 else 0.0)), [1, 0], name="jumping")
    half = math.acos(0.5)  # y = 2 cos t − 1 until it vanishes
    late = settled_solution(jumping, [half + 0.5], digits=6)
    end = -math.sqrt(3) * math.sin(0.5)
    assert abs(late.high[0, 0] - end) <= late.error[0, 0] < 1e-3


def test_costs_are_measured_without_formulas():
    compiled, formulas = pair()
    found = [bs.work_precision(["rk4"], s, span=10, errors=(1e-3, 1e-6)) for s in (compiled, formulas)]
    rows = [[(row.steps, row.errors.solution) for row in one.curves[0].rows] for one in found]
    for (steps, error), (same, exact) in zip(*rows, strict=True):
        assert steps == same
        assert error == pytest.approx(exact, rel=1e-4)
    assert any("dop853 with halved steps" in note for note in found[0].notes)
    assert not any("halved steps" in note for note in found[1].notes)
    expected = bs.predict_run("rk4", compiled, h=0.1, steps=100, timed=False)
    assert "scene must be given by formulas" in str(expected)


@pytest.mark.slow
def test_modified_energies_of_a_compiled_function():
    scene = scene_from_function(
        {"p": lambda q: -np.sin(q), "q": lambda p: p}, [0, 1], variables={"p": 1, "q": 1}, compiled=True
    )
    run = bs.integrate("stormer-verlet", scene, h=0.1, steps=2000)
    p, q = run.y
    data = {"t": run.t, "p": p, "q": q, "U": -np.cos(q), "F": -np.sin(q)}
    report = bs.shadow_energy(data, order=6)
    same = bs.shadow_energy(
        bs.integrate("stormer-verlet", bs.scene("pendulum").with_start(p=[0], q=[1]), h=0.1, steps=2000), order=6
    )
    for row, other in zip(report.rows, same.rows, strict=True):
        assert row.deviation == pytest.approx(other.deviation, rel=1e-3)


@pytest.mark.slow
def test_processes_receive_closures(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        """
import numpy as np
import bseries as bs
from integrators.scenes.functions import scene_from_function

def radius(t, y):
    return y[0]**2 + y[1]**2

if __name__ == "__main__":
    weights = np.array([1.0, 2.0, 4.0])
    def rate(t, y):
        total = 0.0
        for weight in weights:
            total -= weight*y[0]
        return y[1], total if y[0] > 0 else 2*total
    scene = scene_from_function(rate, [0.1, 0])
    y0 = np.random.default_rng(1).normal(size=(8, 2))
    ends = [
        bs.ensemble("rk4", scene, h=0.1, steps=50, y0=y0, observe={"radius": radius}, final=True,
            executor=executor, workers=2,
        ).final
        for executor in ("threads", "processes")
    ]
    assert np.array_equal(*ends)
    print("equal")
"""
    )
    found = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=300, check=False)
    assert found.stdout.strip() == "equal", found.stderr


def bouncing_with(k):
    def rate(t, y):
        return y[1], -k * y[0] if y[0] < 0 else -1.0

    return scene_from_function(rate, [1, 0], compiled=True)


def forget():
    """Drop what is kept for later calls."""
    for cache in (stepping.kept_stepper, black_boxes.compiled_box):
        cache.cache_clear()
    gc.collect()


@pytest.mark.slow
def test_machine_code_is_freed_with_the_steps():
    """Numba's own engine would keep 3 MB of each."""
    for k in range(8):
        bs.integrate("rk4", bouncing_with(1 + k), h=0.1, steps=10)
    forget()
    before, codes = psutil.Process().memory_info().rss, alive()
    for k in range(25):
        bs.integrate("rk4", bouncing_with(10 + k), h=0.1, steps=10)
    forget()
    assert alive() <= codes
    assert psutil.Process().memory_info().rss - before < 25e6


def alive():
    return sum(type(thing) is MachineCode for thing in gc.get_objects())


def test_code_that_is_called_by_its_address_lives_as_long_as_the_scene():
    scene = bouncing_with(50)
    field = bs.integrators.right_hand_side(scene)
    forget()
    assert field(0.0, [-1.0, 2.0]).tolist() == [2.0, 50.0]


def test_arguments_in_any_order_and_with_other_defaults():
    table = np.array([1.0, 2.0, 4.0])

    def rate(t, y, /, weights=table, k=2.0, *, g=3.0):
        return np.array([k * y[1], -g * weights[2] if y[0] > 0 else g * weights[0]])

    scene = scene_from_function(rate, [1, 5], compiled=True)
    field = bs.integrators.right_hand_side(scene.with_parameters(k=7, g=11))
    assert field(0.0, [1.0, 5.0]).tolist() == [35.0, -44.0]
    assert field(0.0, [-1.0, 5.0]).tolist() == [35.0, 11.0]
