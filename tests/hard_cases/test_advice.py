"""Advice in hard cases: an accuracy, a clear error that names the argument, or “unknown” with a reason; never nan."""

from __future__ import annotations

import math
import re
from functools import cache

import numpy as np
import pytest

import bseries as bs
from bseries.advice.predictions import perturbation_run as runs_module

pytestmark = pytest.mark.slow

COMET = bs.scene("kepler", eccentricity="0.999")
PENDULUM, RICCATI, STIFF = bs.scene("pendulum"), bs.scene("riccati"), bs.scene("van-der-pol")
PREDATORS, LORENZ, ATOMS = bs.scene("lotka-volterra"), bs.scene("lorenz"), bs.scene("lennard-jones")
DIMER = bs.scene("lennard-jones", particles=2, dimension=1, temperature=0)
LARGE = 10**400
NO_NUMBERS = {
    "nan": math.nan, "∞": math.inf, "−∞": -math.inf, "10⁴⁰⁰": LARGE, "True": True, "text": "x", "complex": 0.1j,
}  # fmt: skip


def refused(argument, function, *arguments, **options):
    """The error, which is ours: one sentence that begins with the argument, or says what there is not."""
    with pytest.raises(bs.errors) as found:
        function(*arguments, **options)
    wanted = rf"{re.escape(argument)} (must .*, (but|and) |'.*'; the \w+ are )"
    assert re.match(wanted, str(found.value)), str(found.value)
    assert "\n" not in str(found.value)
    return found.value


def beside(distance):
    """Two atoms so far apart, at rest; their minimum is at 1.12."""
    return [0, 0, -distance / 2, distance / 2]


# predict_run


@pytest.fixture(autouse=True)
def same_runs(monkeypatch):
    """Pilots of the same length however busy the machine is."""
    monkeypatch.setattr(runs_module, "SECONDS", 1e9)


def predicted(scene, method, h, steps, **options):
    return bs.predict_run(method, scene, h=h, steps=steps, timed=False, **options)


def distances(scene, method, h, steps, y0):
    """The errors of a run: of its energy (nan without one), and against the reference solution."""
    looks = max(1, steps // 200)
    start = np.array(scene.y0 if y0 is None else y0, float)
    observed = {"observe": "energy", "observe_every": 1} if scene.is_hamiltonian else {}
    run = bs.integrate(method, scene, h=h, steps=steps, y0=start, save_every=looks, **observed)
    exact = bs.reference_solution(scene, run.t[1:], y0=start)
    largest = np.linalg.norm(np.column_stack([start, exact]), axis=0).max()
    solution = np.linalg.norm(run.y[:, 1:] - exact, axis=0).max() / largest
    if not scene.is_hamiltonian:
        return math.nan, solution
    values = run.observed["energy"]
    size = abs(values[0]) if abs(values[0]) > 1e-14 else 1.0
    return abs(values - values[0]).max() / size, solution


KNOWN = {
    "kepler e = 0.999 at the perihelion, stormer-verlet, 10⁴ steps of 1e-6": (
        COMET, "stormer-verlet", 1e-6, 10**4, None,
    ),
    "kepler e = 0.999 at the perihelion, gauss3, 10⁴ steps of 1e-6": (COMET, "gauss3", 1e-6, 10**4, None),
    "pendulum, energy 6e-17, stormer-verlet, 200 steps of 0.1": (
        PENDULUM, "stormer-verlet", 0.1, 200, [0, math.pi / 2],
    ),
    "pendulum, energy 2.7e-8, rk4, 200 steps of 0.1": (PENDULUM, "rk4", 0.1, 200, [0, 1.5707963]),
    "pendulum, 1e-8 from the top, rk4, 200 steps of 0.1": (PENDULUM, "rk4", 0.1, 200, [0, math.pi - 1e-8]),
    "van-der-pol (ε = 1e-6), rk4, 200 steps of 1e-7": (STIFF, "rk4", 1e-7, 200, None),
    "van-der-pol (ε = 1e-6), explicit-euler, 200 steps of 5e-8": (STIFF, "explicit-euler", 5e-8, 200, None),
    "y' = y² to t = 0.9, rk4, 90 steps of 0.01": (RICCATI, "rk4", 0.01, 90, None),
    "y' = y² to t = 0.9, explicit-euler, 90 steps of 0.01": (RICCATI, "explicit-euler", 0.01, 90, None),
    "lennard-jones, two atoms at distance 0.5, stormer-verlet, 1000 steps of 1e-5": (
        DIMER, "stormer-verlet", 1e-5, 1000, beside(0.5),
    ),
    "lennard-jones, two atoms at distance 0.5, rk4, 1000 steps of 1e-5": (DIMER, "rk4", 1e-5, 1000, beside(0.5)),
    "lorenz to t = 20, rk4, 2000 steps of 0.01": (LORENZ, "rk4", 0.01, 2000, None),
}  # fmt: skip


@pytest.mark.parametrize("case", KNOWN)
def test_errors_that_are_predicted(case, measured):
    """What is given is within the promised factor of what a run does."""
    scene, method, h, steps, y0 = KNOWN[case]
    found, real = predicted(scene, method, h, steps, y0=y0), distances(scene, method, h, steps, y0)
    for what, expected, error in zip(("energy", "solution"), (found.energy, found.solution), real, strict=True):
        if math.isnan(error):
            assert not scene.is_hamiltonian
            assert expected.value is None
            assert expected.reason
            continue
        assert expected.value is not None, expected.reason
        factor = max(expected.value / error, error / expected.value)
        note = f"{expected.value:.1e} expected, {error:.1e} found"
        measured.within(f"{case}: error of the {what}", factor, 3, " times off", form=".2f", note=note)


def test_a_step_twice_as_large_would_be_noticed():
    """Negative control: the errors of order 2 and 4 at another step are not within the factor."""
    for case in ("stormer-verlet, 10⁴", "rk4, 90"):
        scene, method, h, steps, y0 = next(run for name, run in KNOWN.items() if case in name)
        expected = predicted(scene, method, 2 * h, steps // 2, y0=y0).solution.value or 0.0
        assert expected > 3 * distances(scene, method, h, steps, y0)[1]


SHRINK = "terms of the modified equation to shrink"
UNKNOWN = {
    "kepler e = 0.999, stormer-verlet, 1000 steps of 1e-3": (COMET, "stormer-verlet", 1e-3, 1000, {}, SHRINK),
    "kepler e = 0.999, gauss3, 200 steps of 0.03": (COMET, "gauss3", 0.03, 200, {}, SHRINK),
    "kepler e = 0.999, variable steps": (
        COMET, "stormer-verlet", 0.02, 5000, {"control": "(q1^2 + q2^2)^(3/4)"}, "constant steps",
    ),
    "van-der-pol (ε = 1e-6), explicit-euler, 1000 steps of 1e-3": (STIFF, "explicit-euler", 1e-3, 1000, {}, SHRINK),
    "van-der-pol (ε = 1e-6), rk4, 20 steps of 0.1": (STIFF, "rk4", 0.1, 20, {}, SHRINK),
    "y' = y² to its blow-up at t = 1, rk4": (RICCATI, "rk4", 0.01, 100, {}, "could not be computed"),
    "y' = y² to t = 2, explicit-euler": (RICCATI, "explicit-euler", 0.01, 200, {}, "could not be computed"),
    "lennard-jones, two atoms at one place": (
        DIMER, "stormer-verlet", 1e-3, 100, {"y0": beside(0)}, "could not be computed beyond t = 0",
    ),
    "lennard-jones, two atoms at distance 1e-200": (
        DIMER, "rk4", 1e-3, 100, {"y0": beside(1e-200)}, "could not be computed beyond t = 0",
    ),
    "lennard-jones, two atoms at distance 1e-3": (DIMER, "stormer-verlet", 1e-5, 100, {"y0": beside(1e-3)}, SHRINK),
    "pendulum, rk4, steps of 1e300": (PENDULUM, "rk4", 1e300, 10, {}, SHRINK),
    "pendulum, rk4, steps of −1e300": (PENDULUM, "rk4", -1e300, 10, {}, SHRINK),
    "pendulum, p = 1e300": (PENDULUM, "rk4", 0.1, 10, {"y0": [1e300, 0]}, "finite"),
}  # fmt: skip


@pytest.mark.parametrize("case", UNKNOWN)
def test_errors_that_cannot_be_known(case, measured):
    scene, method, h, steps, options, reason = UNKNOWN[case]
    found = predicted(scene, method, h, steps, **options)
    for expected in (found.energy, found.solution):
        assert expected.value is None
        assert expected.reason
    assert reason in found.solution.reason
    measured.said(case, "unknown, with a reason", f"“{found.solution.reason}”")


def test_chaos_has_an_energy_error_but_no_solution_error(measured):
    found = predicted(ATOMS, "stormer-verlet", 0.005, 10**6)
    assert found.energy.value is not None
    assert found.solution.value is None
    assert "as in chaos" in found.solution.reason
    case = "lennard-jones, stormer-verlet, 10⁶ steps of 0.005: error of the solution"
    measured.said(case, "unknown, with a reason", f"“{found.solution.reason}”")


@pytest.mark.parametrize("h", [1e-300, -1e-300, 5e-324])
def test_steps_without_influence(h, measured):
    found = predicted(PENDULUM, "rk4", h, 10)
    assert found.energy == found.solution
    assert found.solution.value == 0
    measured.said(f"pendulum, rk4, 10 steps of {h:.0e}: errors", "0", f"{found.solution}")


NO_STEPS = {"0": 0, "−0.0": -0.0, "None": None, "a list": [0.1], **NO_NUMBERS}


@pytest.mark.parametrize("h", NO_STEPS)
def test_what_is_no_step_size_is_refused(h, measured):
    """By all that take one."""
    step = NO_STEPS[h]
    found = refused("h", bs.predict_run, "rk4", PENDULUM, h=step, steps=100)
    refused("h", bs.effect_costs, "rk4", "pendulum", h=step, effects="damping")
    influence = "span" if h in ("0", "−0.0") else "h"  # span must be positive, and h not zero
    error = refused(influence, bs.effect_influence, "rk4", "pendulum", h=step, span=1, effects="damping")
    assert "h not zero" in str(error) or influence == "h"
    shown = str(found).split(", but")[0]
    measured.said(f"predict_run, effect_costs and effect_influence, h: {h}", "a clear error", f"“{shown} …”")


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("steps", -1), ("steps", 2.5), ("steps", math.nan), ("steps", 10**30), ("y0", [math.nan, 0]), ("y0", [1]),
        ("t0", math.nan), ("seconds_per_step", 0), ("seconds_per_step", math.nan),
    ],
)  # fmt: skip
def test_other_arguments_of_predictions_are_refused(argument, value):
    refused(argument, bs.predict_run, "rk4", PENDULUM, **{"h": 0.1, "steps": 100, argument: value})


def test_a_run_that_ends_while_it_is_timed_says_so():
    error = refused("h", bs.predict_run, "rk4", RICCATI, h=0.01, steps=10_000)
    assert isinstance(error, bs.integrators.StepError)


# work_precision


@cache
def precision(name):
    scene, span, measure = {
        "y' = y² to t = 0.9": (RICCATI, 0.9, "all"),
        "van-der-pol (ε = 1e-6) to t = 1e-5": (STIFF, 1e-5, "all"),
        "pendulum from q = π/2, where its energy is 0": (PENDULUM.with_start(p=[0], q=["pi/2"]), 20, "energy"),
        "lennard-jones, two atoms at distance 1/2": (DIMER.with_start(q=["-1/4", "1/4"]), 0.01, "all"),
    }[name]
    return bs.work_precision(["rk4"], scene, span=span, errors=(1e-2, 1e-6), measure=measure)


@pytest.mark.parametrize(
    "name",
    [
        "y' = y² to t = 0.9", "van-der-pol (ε = 1e-6) to t = 1e-5", "pendulum from q = π/2, where its energy is 0",
        "lennard-jones, two atoms at distance 1/2",
    ],
)  # fmt: skip
def test_recommended_steps_meet_their_error(name, measured):
    """A run with them, measured without `work_precision`; a step three times as large misses the error."""
    found = precision(name)
    best = found.best(1e-4)
    which = ("energy", "solution").index(best.measure)

    def error(steps):
        return distances(found.scene, "rk4", found.span / steps, steps, None)[which]

    measured.within(
        f"{name}: error of the {best.measure} with the step recommended for 1e-4", error(best.steps), 1e-4, form=".1e",
        note=f"h = {best.h:.2g}",
    )  # fmt: skip
    assert error(max(1, best.steps // 3)) > 1e-4


@pytest.mark.parametrize("span", [1, 2])
def test_spans_beyond_a_blow_up_are_refused(span, measured):
    error = refused("measure", bs.work_precision, ["rk4"], RICCATI, span=span)
    assert "t must end before 1, beyond which the solution of riccati could not be continued" in str(error)
    measured.said(f"work_precision, y' = y² to t = {span}", "a clear error", f"“… {str(error).rpartition(': ')[2]}”")


@pytest.mark.parametrize("span", ["0", "−0.0", "−1", *NO_NUMBERS])
def test_what_is_no_span_is_refused(span, measured):
    length = {"0": 0, "−0.0": -0.0, "−1": -1, **NO_NUMBERS}[span]
    found = refused("span", bs.work_precision, ["rk4"], PENDULUM, span=length)
    refused("span", bs.effect_influence, "rk4", "pendulum", h=0.1, span=length, effects="damping")
    shown = str(found).split(", but")[0]
    measured.said(f"work_precision and effect_influence, span: {span}", "a clear error", f"“{shown} …”")


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("errors", (1e-4, 1e-2)), ("errors", (math.nan, 1e-3)), ("errors", (1e-2, 0)), ("errors", None),
        ("budget", 0), ("budget", math.nan), ("methods", []), ("measure", "speed"), ("scene", None),
    ],
)  # fmt: skip
def test_other_arguments_of_measurements_are_refused(argument, value):
    refused(argument, bs.work_precision, **{"scene": PENDULUM, "methods": ["rk4"], argument: value})


@pytest.mark.parametrize("value", [0, -1, math.nan, math.inf, 1e-300, None])
def test_errors_that_no_method_can_meet_are_refused(value):
    found = precision("y' = y² to t = 0.9")
    refused("error", found.best, value)


# effect_influence, effect_costs


def influence(scene="pendulum", h=0.05, span=10, **options):
    options = {"effects": "damping", **options}
    return bs.effect_influence("rk4", scene, h=h, span=span, **options)


def oscillate(t, gamma):
    """p' = −q − γp, q' = p from (1, 0)."""
    rate = math.sqrt(1 - gamma**2 / 4)
    decay = np.exp(-gamma * t / 2)
    q = decay * np.sin(rate * t) / rate
    return np.array([decay * np.cos(rate * t) - gamma / 2 * q, q])


def test_influence_on_a_vanishing_oscillation(measured):
    """From p = 1e-300 the pendulum is linear, and friction on it known exactly; its energy changes by nothing."""
    report = influence(start={"p": ["1e-300"], "q": [0]})
    t = np.linspace(0, 10, 201)
    without, damped = oscillate(t, 0.0), oscillate(t, 0.1)
    exact = np.linalg.norm(damped - without, axis=0).max()  # of a state that is 1 at the start, and then smaller
    found = report.rows[0].left_out
    measured.within(
        "pendulum from p = 1e-300: influence of friction against the exact one",
        abs(found.solution - exact) / report.own_error.solution, 1, " times the error of the method",
        note=f"{found.solution:.6f}",
    )  # fmt: skip
    assert report.own_error.solution < found.solution / 10**5
    assert found.energy == 0
    assert report.keep == ("damping",)


def test_influence_on_a_comet(measured):
    """Drag at the perihelion, against two reference solutions: two runs make the same errors but for what drag does.

    An orbit whose energy is off by some part answers to drag with as large a part of the difference.
    """
    options = {"h": 1e-6, "span": 0.005, "effects": "drag", "parameters": {"eccentricity": "0.999"}}
    report = influence("kepler", **options)
    t = np.linspace(0, 0.005, 101)[1:]
    without, slowed = (
        bs.reference_solution(bs.scene("kepler", eccentricity="0.999", effects=on), t) for on in ([], ["drag"])
    )
    exact = np.linalg.norm(slowed - without, axis=0).max() / np.hypot(*COMET.y0[:2])
    found = report.rows[0].left_out.solution
    assert report.own_error.energy is not None
    measured.within(
        "kepler e = 0.999, rk4, 5000 steps of 1e-6: influence of drag against references",
        abs(found / exact - 1) / report.own_error.energy, 1, " times the error of the energy",
        what="relative error", note=f"{found:.2e}, error of the energy {report.own_error.energy:.1e}",
    )  # fmt: skip
    with pytest.raises(bs.SeriesError, match="h must be small enough for an accurate run"):
        influence("kepler", **{**options, "h": 1e-4})  # with 50 steps the orbit is another one


def test_influence_where_the_energy_is_zero(measured):
    """From q = π/2 the energy is −6e-17, of which nothing is a part: changes are shown as they are."""
    found = influence(start={"p": [0], "q": ["pi/2"]}, span=1).rows[0].left_out.energy
    damped = bs.scene("pendulum", effects=["damping"]).with_start(p=[0], q=["pi/2"])
    p, q = bs.reference_solution(damped, [1])[:, 0]
    lost = abs(p**2 / 2 - math.cos(q))
    case = "pendulum from q = π/2: influence of friction on the energy, against the reference"
    assert found is not None
    measured.within(case, abs(found / lost - 1), 1e-6, what="relative error", note=f"{found:.4f}")


@pytest.mark.parametrize(("gamma", "kept"), [("1e-300", False), ("1/10", True), ("10", True)])
def test_strengths_of_all_sizes(gamma, kept):
    report = influence(parameters={"gamma": gamma}, span=1, h=0.01)
    assert (report.keep == ("damping",)) == kept
    assert (report.rows[0].left_out.solution == 0) == (not kept)


@pytest.mark.parametrize(
    ("argument", "options"),
    [
        ("h", {"h": 1e300}), ("span", {"h": 1e-300}), ("span", {"span": 1e300}), ("accept", {"accept": -1}),
        ("accept", {"accept": math.nan}), ("margin", {"margin": 0.5}), ("margin", {"margin": math.nan}),
        ("h", {"parameters": {"gamma": "1e300"}}), ("parameters.gamma", {"parameters": {"gamma": math.nan}}),
        ("there is no effect", {"effects": "nope"}), ("effects", {"effects": ()}), ("measure", {"measure": "speed"}),
        ("start.p[1]", {"start": {"p": [math.nan]}}), ("scene", {"scene": "riccati", "effects": None}),
    ],
)  # fmt: skip
def test_other_arguments_of_influences_are_refused(argument, options):
    refused(argument, influence, **options)


def test_costs_do_not_depend_on_scales(measured):
    """Times are positive for steps of 1e-300 too, and trees are those of any step; 37 of them are needed to order 6."""
    rows = bs.effect_costs("rk4", "pendulum", h=1e-300, effects="damping")
    assert [row.effects for row in rows] == [(), ("damping",)]
    assert all(0 < time.low <= time.seconds <= time.high < math.inf for row in rows for time in (row.step, row.field))
    trees = [(row.trees, row.all_trees) for row in rows]
    assert trees == [(37, 37), (37, 37)]
    assert len(bs.series(bs.method("rk4"), 6)) == 37
    measured.said("effect_costs of the pendulum, rk4, h = 1e-300", "times, and trees to order 6", "37 of 37 trees")


@pytest.mark.parametrize(
    ("argument", "options"),
    [
        ("h", {"h": 1e300}), ("h", {"parameters": {"gamma": "1e300"}}), ("order", {"order": 0}),
        ("order", {"order": 2.5}), ("there is no effect", {"effects": "nope"}),
        ("parameters and start", {"scene": "kepler", "effects": "drag", "start": {"p": [0, 1], "q": [0, 0]}}),
    ],
)  # fmt: skip
def test_other_arguments_of_costs_are_refused(argument, options):
    options = {"scene": "pendulum", "method": "rk4", "h": 0.05, "effects": "damping", **options}
    refused(argument, bs.effect_costs, **options)
